//! Power spectra, coherence and Allan deviation of error series.
#![forbid(unsafe_code)]

mod log_chi;
mod psd;

pub use log_chi::{log_bias, log_variance};
pub use psd::Psd;
