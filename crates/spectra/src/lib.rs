//! Power spectra, coherence and Allan deviation of error series.
//!
//! Every density is one-sided, in unit^2/Hz over 0 to fs/2, and its integral is the variance. Each
//! comes with its equivalent degrees of freedom, from which follow confidence bands
//! ([`Psd::confidence`]) and the bias and variance of its logarithm ([`log_bias`], [`log_variance`]).
//!
//! | for | use |
//! |---|---|
//! | a long series, with or without gaps | [`Welch`], [`finite_runs`], [`continuous_runs`] |
//! | a short series, a spectrum of great range | [`Multitaper`] |
//! | lines | [`Multitaper::find_lines`] |
//! | two series | [`Welch::process_cross`], [`coherence_significance`] |
//! | irregular samples | [`LombScargle`] |
//! | equal steps in the logarithm of frequency | [`LogAverage`] |
//! | drift against averaging time | [`Allan`] |
//! | samples that do not belong | [`robust`] |
//!
//! Plans are made once and hold the transforms; `make_scratch` hands out memory, and the functions
//! ending in `_into` allocate nothing. A plan can be shared between threads, each with its own scratch.
//!
//! ```
//! use spectra::{LogAverage, Welch, WelchSettings};
//!
//! let x: Vec<f64> = (0..10_000_i64).map(|n| (0.618_034 * (n * n) as f64).fract()).collect();
//! let welch = Welch::new(WelchSettings::half_overlap(1000, 2.0))?;
//! let spectrum = welch.process(&x)?;
//! let smooth = LogAverage::new(&spectrum, 10.0)?.apply(&spectrum, &welch.bin_correlation(19));
//! let band = smooth.confidence(0.95)?;
//! // uniform numbers: variance 1/12 spread over 0 to 1 Hz
//! let last = smooth.len() - 1;
//! assert!(band.lower[last] < 1.0 / 12.0 && 1.0 / 12.0 < band.upper[last]);
//! # Ok::<(), spectra::SpectraError>(())
//! ```
#![forbid(unsafe_code)]

mod allan;
mod averaging;
mod confidence;
mod cross;
mod detrend;
mod error;
mod gaps;
mod lines;
mod log_chi;
mod lomb_scargle;
mod multitaper;
mod psd;
pub mod robust;
mod slepian;
pub mod standing_out;
mod welch;
mod window;

pub use fourier::Complex;

pub use allan::{Allan, AllanData, AllanDeviation, AllanKind, AllanScratch, PowerLaw, allan_edf};
pub use averaging::LogAverage;
pub use confidence::{Band, chi_squared_quantile, confidence_factors};
pub use cross::{CrossMut, CrossSpectrum, coherence_significance};
pub use detrend::Detrend;
pub use error::SpectraError;
pub use gaps::{continuous_runs, finite_runs, whole};
pub use lines::{Line, f_test_ln_p};
pub use log_chi::{log_bias, log_variance};
pub use lomb_scargle::{
    LombScargle, LombScargleScratch, LombScargleSettings, is_on_a_grid, mean_rate_hz,
};
pub use multitaper::{Multitaper, MultitaperScratch, MultitaperSettings, TaperWeights};
pub use psd::Psd;
pub use slepian::Slepian;
pub use welch::{Coverage, Welch, WelchScratch, WelchSettings, periodogram};
pub use window::{Window, coherent_gain, noise_bandwidth_bins};
