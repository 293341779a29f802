//! Medians that a few wild values do not move.
//!
//! Source: Rousseeuw & Croux 1993 (the scaled MAD).

/// The MAD of a Gaussian times this is its standard deviation.
pub(crate) const MAD_SCALE: f64 = 1.482_602_218_505_602;

/// Median of the finite values.
pub(crate) fn robust_median(mut values: Vec<f64>) -> Option<f64> {
    spectra::robust::median(&mut values)
}
