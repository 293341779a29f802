//! A model beside what was measured.
//!
//! - [`Residual`]: the attitude against the reference, per axis, outliers marked;
//! - [`Spectrum`]: its density, whatever gaps and irregular steps it has;
//! - [`fit`]: white noise and first-order Gauss-Markov process per axis, the parameters of a HEM.
#![forbid(unsafe_code)]

mod ensemble;
mod error;
mod fit;
mod hybrid;
mod residual;
mod spectrum;

pub use ensemble::{Ensemble, Standing};
pub use error::ComparisonError;
pub use fit::{FitSettings, Fitted, fit};
pub use residual::{AXES, MeasuredBy, Residual};
pub use spectrum::Spectrum;
