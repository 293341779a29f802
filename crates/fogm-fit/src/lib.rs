//! First-order Gauss-Markov processes: exact simulation, spectra, and fits to them.
//!
//! [`FogmWhite`] is the process of \[M23\] section 3, a FOGM and white noise; [`sampled`] its density;
//! `fit_series`, `fit_times` and `fit_psd` find its parameters. Sigmas are true standard deviations of one sample;
//! [`printed_sigma_hsf`] leads to the numbers of the paper. Simulation and densities need none of
//! the default feature `fit`.
//!
//! The derivations, and how well the errors are calibrated, are in `docs/fogm-fit.md`.
//!
//! Source: \[M23\] section 3, Eq. 15-20; errata E6 to E9.
#![forbid(unsafe_code)]

mod convention;
mod density;
mod error;
#[cfg(feature = "fit")]
mod fit;
mod process;

pub use convention::{Convention, consistent_sigma_hsf, log_fit_factor, printed_sigma_hsf};
pub use density::{Density, as_printed, continuous, expected_periodogram, sampled};
pub use error::FogmError;
#[cfg(feature = "fit")]
pub use fit::{
    Choice, Estimate, Fit, FitOptions, HANN_BIN_CORRELATION, LogPsdFit, Mean, Method, Preferred,
    Reason, fit_log_psd, fit_psd, fit_series, fit_times,
};
pub use process::{Fogm, FogmWhite};
