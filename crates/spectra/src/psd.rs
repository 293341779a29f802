//! The one-sided power spectral density as everything here returns it.
//!
//! ```text
//! sum_k psd[k] df = variance,   f_k = k df in [0, fs/2]
//! ```
//!
//! The bins at 0 and at fs/2 have no partner at negative frequencies: they are not doubled, and hold
//! half the degrees of freedom. Where the spectrum is flat they stand at half the height of their
//! neighbours: leave both out of averages and fits ([`LogAverage`](crate::LogAverage) does).
//!
//! Source: Percival & Walden, Spectral Analysis for Physical Applications (1993), Sections 4.1, 6.2; erratum E7.

use crate::confidence::{self, Band};
use crate::{SpectraError, log_bias};

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

impl Psd {
    /// Number of bins.
    #[must_use]
    pub fn len(&self) -> usize {
        self.frequency_hz.len()
    }

    /// Whether there is no bin.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.frequency_hz.is_empty()
    }

    /// Width of a bin, Hz, of a uniform grid that starts at 0; `None` for any other.
    #[must_use]
    pub fn step_hz(&self) -> Option<f64> {
        let last = *self.frequency_hz.last()?;
        let step = last / (self.len() - 1) as f64;
        // a product is rounded by half a unit in its last place, which of many bins is much of a step
        let rounding = |f: f64| 1e-9 * step + 4.0 * f64::EPSILON * f;
        let uniform = |(k, f): (usize, &f64)| (f - k as f64 * step).abs() <= rounding(*f);
        (step > 0.0 && self.frequency_hz.iter().enumerate().all(uniform)).then_some(step)
    }

    /// Variance within `[low_hz, high_hz]`, unit^2: the sum of the bins there times their width.
    ///
    /// Over all frequencies this is the variance of the series. `None` unless the grid is uniform.
    #[must_use]
    pub fn band_variance(&self, low_hz: f64, high_hz: f64) -> Option<f64> {
        let bins = self.frequency_hz.iter().zip(&self.psd);
        let sum: f64 = bins
            .filter(|(f, _)| (low_hz..=high_hz).contains(*f))
            .map(|(_, p)| p)
            .sum();
        Some(sum * self.step_hz()?)
    }

    /// Variance over all frequencies, unit^2; `None` unless the grid is uniform.
    #[must_use]
    pub fn variance(&self) -> Option<f64> {
        self.band_variance(f64::NEG_INFINITY, f64::INFINITY)
    }

    /// Confidence band of probability `level` around every bin.
    ///
    /// # Errors
    ///
    /// [`SpectraError::Probability`] outside (0, 1), [`SpectraError::NotPositive`] where a bin has
    /// no degrees of freedom.
    pub fn confidence(&self, level: f64) -> Result<Band, SpectraError> {
        confidence::band(&self.psd, &self.dof, level, 1.0)
    }

    /// `ln psd` less the expectation of its error, [`log_bias`]: an unbiased logarithm (erratum E9).
    #[must_use]
    pub fn log_unbiased(&self) -> Vec<f64> {
        let bins = self.psd.iter().zip(&self.dof);
        bins.map(|(p, d)| p.ln() - log_bias(*d)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sixteen million bins of 0.7 Hz over a number of samples that is no power of two: products are off by 1e-9 of a
    /// step by rounding alone.
    #[test]
    fn a_grid_of_many_bins_is_uniform() {
        let n = 32_000_001_u32;
        let bins = n.div_ceil(2);
        let psd = Psd {
            frequency_hz: (0..bins)
                .map(|k| f64::from(k) * 0.7 / f64::from(n))
                .collect(),
            psd: Vec::new(),
            dof: Vec::new(),
            fs_hz: 0.7,
        };
        assert!(psd.step_hz().is_some());
        let mut bent = psd;
        bent.frequency_hz[7] *= 1.0 + 1e-6;
        assert!(bent.step_hz().is_none());
    }
}
