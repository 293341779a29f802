//! Between the parameters that \[M23\] prints and the true ones.
//!
//! ```text
//! sigma_HSF(printed) = sqrt(2) sigma_HSF      tau, sigma_TN unchanged          erratum E6
//! sigma(fitted)      = exp((psi(nu/2) - ln(nu/2)) / 2) sigma                   erratum E9
//! ```
//!
//! The first follows from [`as_printed`](crate::as_printed): its FOGM term must be doubled to be
//! one-sided. The second is the price of least squares on logarithms without correction: 0.749 for a
//! raw periodogram (nu = 2), for both sigmas alike. The two are apart because a spectrum that was
//! averaged first carries little of the second.
//!
//! Source: \[M23\] Eq. 17, 19 and 20; errata E6 and E9.

use std::f64::consts::SQRT_2;

use spectra::log_bias;

/// Whose equations a fit follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Convention {
    /// \[M23\] Eq. 17-20 as printed: the two-sided FOGM term, plain least squares on logarithms.
    AsPrinted,
    /// One-sided density of the sampled series, expectation and weight of each logarithm (erratum E9).
    #[default]
    Consistent,
}

/// The `sigma_HSF` that \[M23\] Eq. 17 as printed needs for a true standard deviation `sigma`.
///
/// ```
/// // the boresight value of [M23] 4.1 is a process of 3.58 arcsec
/// assert!((fogm_fit::printed_sigma_hsf(3.58) - 5.06).abs() < 0.005);
/// ```
#[must_use]
pub fn printed_sigma_hsf(sigma: f64) -> f64 {
    SQRT_2 * sigma
}

/// The true standard deviation behind a `sigma_HSF` of \[M23\] Eq. 17 as printed.
#[must_use]
pub fn consistent_sigma_hsf(printed: f64) -> f64 {
    printed / SQRT_2
}

/// What an uncorrected fit of logarithms returns for a sigma of 1, from bins of `dof` degrees of
/// freedom: 0.749 for a raw periodogram. Divide by it to correct such a fit.
#[must_use]
pub fn log_fit_factor(dof: f64) -> f64 {
    (0.5 * log_bias(dof)).exp()
}
