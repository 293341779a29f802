//! A model beside what was measured.
//!
//! - [`Residual`]: the attitude against the reference, per axis, outliers marked;
//! - [`Spectrum`]: its density, whatever gaps and irregular steps it has;
//! - [`Ensemble`]: the densities of many draws of a model, and where a series stands among them;
//! - [`compare`]: models flown along the measured motion, beside what was measured;
//! - [`Scene`]: what a run looks like, for its figures;
//! - [`fit`]: white noise and first-order Gauss-Markov process per axis, the parameters of a HEM.
#![forbid(unsafe_code)]

mod compare;
mod ensemble;
mod error;
mod fit;
mod flight;
mod residual;
mod scene;
mod spectrum;
mod stars;

pub use compare::{BANDS_HZ, CompareSettings, Compared, Flown, compare};
pub use ensemble::{Ensemble, Standing};
pub use error::ComparisonError;
pub use fit::{FitSettings, Fitted, fit};
pub use residual::{AXES, MeasuredBy, Residual};
pub use scene::{Scene, Track};
pub use spectrum::Spectrum;
