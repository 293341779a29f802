//! On-orbit noise of a star tracker from its quaternions, without a model of the tracker.
#![forbid(unsafe_code)]

mod closing;
mod error;
mod least_squares;
mod model;
mod observed;
mod rotator;
mod start;

pub use closing::{Added, Closing, Considered, Term, close};
pub use error::AssessError;
pub use model::{Fit, Fitter, Free, Oscillation, Rotating, TimeTagStep};
pub use observed::{Counts, Observed};
pub use rotator::{Body, Inertia, NutationRates, axisymmetric, nutation_rates};
pub use start::{Start, alignment, euler_123, misalignment_123, start};
