//! What a plan of the multitaper estimate is made of.
//!
//! Source: Thomson (1982), see the parent module.

use crate::Detrend;

/// How the spectra of the single tapers are put together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TaperWeights {
    /// All alike: `2K` degrees of freedom in every bin.
    Uniform,
    /// By their concentration.
    Eigenvalue,
    /// By what each is worth in each bin: the right choice for a spectrum of great range.
    #[default]
    Adaptive,
}

/// What a plan is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct MultitaperSettings {
    /// Samples of the series.
    pub samples: usize,
    /// `N W`: half the width of the estimate in bins `fs/N`.
    pub time_half_bandwidth: f64,
    /// Number of tapers `K`, 2 to `2 N W`.
    pub tapers: usize,
    /// Length of the transform; beyond `samples` the series is padded with zeros, which gives a finer
    /// grid but no more information.
    pub transform: usize,
    /// What is taken from the series first.
    pub detrend: Detrend,
    /// Weights of the tapers.
    pub weights: TaperWeights,
    /// Sampling frequency, Hz.
    pub fs_hz: f64,
}

impl MultitaperSettings {
    /// The usual choice: `2 N W - 1` tapers, adaptive weights, mean removed, not padded.
    #[must_use]
    pub fn new(samples: usize, time_half_bandwidth: f64, fs_hz: f64) -> Self {
        let mut settings = Self {
            samples,
            time_half_bandwidth,
            tapers: 0,
            transform: samples,
            detrend: Detrend::Constant,
            weights: TaperWeights::Adaptive,
            fs_hz,
        };
        settings.tapers = settings.most_tapers().saturating_sub(1).max(2);
        settings
    }

    /// For a search for lines: as [`new`](Self::new), padded to at least four times the length, so that
    /// no line falls far from a bin.
    #[must_use]
    pub fn for_lines(samples: usize, time_half_bandwidth: f64, fs_hz: f64) -> Self {
        Self {
            transform: (4 * samples).next_power_of_two(),
            ..Self::new(samples, time_half_bandwidth, fs_hz)
        }
    }

    /// `2 N W`, whole tapers only, and not more than samples.
    pub(crate) fn most_tapers(&self) -> usize {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "rounded down on purpose; a negative or absent bandwidth gives none"
        )]
        let most = (2.0 * self.time_half_bandwidth + 1e-9).floor() as usize;
        most.min(self.samples)
    }
}
