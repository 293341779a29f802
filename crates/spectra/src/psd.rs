//! The one-sided power spectral density as everything here returns it.
//!
//! ```text
//! sum_k psd[k] df = variance,   f_k = k df in [0, fs/2]
//! ```
//!
//! The bins at 0 and at fs/2 have no partner at negative frequencies: they are not doubled, and hold
//! half the degrees of freedom.
//!
//! Source: Percival & Walden, Spectral Analysis for Physical Applications (1993), Sections 4.1, 6.2; erratum E7.

/// A one-sided power spectral density.
///
/// The three columns have one length. Bins are in the order of their frequency, on a uniform grid
/// from a plan of this crate, on any grid after averaging.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Psd {
    /// Frequency of each bin, Hz.
    pub frequency_hz: Vec<f64>,
    /// Density of each bin, unit^2/Hz.
    pub psd: Vec<f64>,
    /// Equivalent degrees of freedom of each bin: `psd ~ truth chi2_dof / dof`.
    pub dof: Vec<f64>,
    /// Sampling frequency of the series, Hz.
    pub fs_hz: f64,
}
