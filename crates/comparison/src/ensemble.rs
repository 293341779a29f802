//! Spectra of many draws of a model, all through the estimate that the measured series goes through.
//!
//! ```text
//! mean, 3 sigma bound     mean_k and mean_k + 3 s_k of the densities of the draws
//! error_k                 ln P_k - <ln P_k>_draws
//! cost                    sum error_k^2 / (s_k^2 (1 + 1/n)) (n - 3)/(n - 1) / (bins - fitted)
//! ```
//!
//! with `s_k` in `cost` the standard deviation of `ln P_k` over the `n` draws: expectation and variance of
//! a bin (erratum E9), window, gaps and the spread of whatever a draw draws are all in it. `1 + 1/n` is
//! the error of the mean, `(n - 1)/(n - 3)` the expectation of `1/s^2`: 1 for a series of the model.
//!
//! Source: \[M23\] Eq. 19 and Figs. 11, 12 and 16 (mean and 3 sigma upper bound of 100 draws).

use rayon::prelude::*;
use spectra::{Psd, SpectraError};

use crate::Spectrum;

/// Spectra of the draws of a model about one axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ensemble {
    /// Frequencies, Hz.
    pub frequency_hz: Vec<f64>,
    /// One-sided density of each draw at each frequency, arcsec^2/Hz.
    pub draws: Vec<Vec<f64>>,
}

/// Where a series stands against an ensemble.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Standing {
    /// Number of bins.
    pub bins: usize,
    /// Mean of `ln measured - <ln model>`.
    pub error: f64,
    /// Its standard deviation over the draws, were the series one of them.
    pub sigma: f64,
    /// Root mean square of `ln measured - <ln model>`.
    pub rms: f64,
    /// Squares in units of their variance, per degree of freedom: 1 for a draw of the model.
    pub cost: f64,
    /// Share of bins above the 3 sigma bound.
    pub above: f64,
}

impl Ensemble {
    /// Mean density of the draws.
    #[must_use]
    pub fn mean(&self) -> Vec<f64> {
        self.over_draws(|values| moments(values).0)
    }

    /// Mean plus three standard deviations.
    #[must_use]
    pub fn upper(&self) -> Vec<f64> {
        self.over_draws(|values| {
            let (mean, sd) = moments(values);
            mean + 3.0 * sd
        })
    }

    /// Mean and standard deviation over the draws of the density in dB, at each frequency.
    #[must_use]
    pub fn decibels(&self) -> (Vec<f64>, Vec<f64>) {
        const DB: f64 = 10.0 * std::f64::consts::LOG10_E;
        let logs = self.logs();
        logs.into_iter().map(|(m, s)| (DB * m, DB * s)).unzip()
    }

    /// Mean and standard deviation of the logarithm at each frequency.
    fn logs(&self) -> Vec<(f64, f64)> {
        (0..self.frequency_hz.len())
            .map(|k| moments(&self.at(k).iter().map(|p| p.ln()).collect::<Vec<_>>()))
            .collect()
    }

    fn at(&self, k: usize) -> Vec<f64> {
        self.draws.iter().map(|draw| draw[k]).collect()
    }

    fn over_draws(&self, of: impl Fn(&[f64]) -> f64) -> Vec<f64> {
        (0..self.frequency_hz.len())
            .map(|k| of(&self.at(k)))
            .collect()
    }

    /// Where `measured` stands over the bins that `counts` says, `fitted` parameters of the model
    /// having been found on it. `None` without a bin, or with fewer than four draws.
    #[must_use]
    pub fn standing(
        &self,
        measured: &Psd,
        fitted: usize,
        counts: impl Fn(f64) -> bool,
    ) -> Option<Standing> {
        let n = self.draws.len() as f64;
        let logs = self.logs();
        let upper = self.upper();
        let bins: Vec<usize> = (0..self.frequency_hz.len())
            .filter(|&k| measured.psd[k] > 0.0 && logs[k].1 > 0.0 && counts(self.frequency_hz[k]))
            .collect();
        if bins.is_empty() || n < 4.0 {
            return None;
        }
        let count = bins.len() as f64;
        let error_of = |k: usize| measured.psd[k].ln() - logs[k].0;
        let mean = |of: &dyn Fn(usize) -> f64| bins.iter().map(|&k| of(k)).sum::<f64>() / count;
        let square = |k: usize| (error_of(k) / logs[k].1).powi(2);
        let of_draws: Vec<f64> = self
            .draws
            .iter()
            .map(|draw| mean(&|k| draw[k].ln() - logs[k].0))
            .collect();
        let spread = 1.0 + 1.0 / n;
        Some(Standing {
            bins: bins.len(),
            error: mean(&error_of),
            sigma: moments(&of_draws).1 * spread.sqrt(),
            rms: mean(&|k| error_of(k).powi(2)).sqrt(),
            cost: mean(&square) * count / (count - fitted as f64).max(1.0) / spread * (n - 3.0)
                / (n - 1.0),
            above: mean(&|k| f64::from(u8::from(measured.psd[k] > upper[k]))),
        })
    }
}

/// Spectra of `draws` series of three axes.
///
/// `draw(d)` makes the series of draw `d`; draws run side by side, and their order does not matter.
///
/// # Errors
///
/// What `draw` says, or the spectrum of an axis.
pub(crate) fn ensemble<E: Send + From<SpectraError>>(
    plans: &[Spectrum; 3],
    draws: u64,
    draw: impl Fn(u64) -> Result<[Vec<f64>; 3], E> + Sync,
) -> Result<[Ensemble; 3], E> {
    let of = |d: u64| -> Result<[Psd; 3], E> {
        let [x, y, z] = draw(d)?;
        Ok([plans[0].of(&x)?, plans[1].of(&y)?, plans[2].of(&z)?])
    };
    // of several errors the first draw's, whichever thread is quicker
    let all: Vec<Result<[Psd; 3], E>> = (0..draws).into_par_iter().map(of).collect();
    let all: Vec<[Psd; 3]> = all.into_iter().collect::<Result<_, E>>()?;
    let axis = |axis: usize| Ensemble {
        frequency_hz: all
            .first()
            .map_or_else(Vec::new, |psd| psd[axis].frequency_hz.clone()),
        draws: all.iter().map(|psd| psd[axis].psd.clone()).collect(),
    };
    Ok([axis(0), axis(1), axis(2)])
}

/// Mean and standard deviation (n - 1).
pub(crate) fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (mean, (square / (n - 1.0).max(1.0)).sqrt())
}
