//! On-orbit noise of a star tracker from its quaternions, without a model of the tracker.
#![forbid(unsafe_code)]

mod assess;
mod closing;
mod document;
mod ecss;
mod error;
mod gyro;
mod least_squares;
mod model;
mod noise;
mod observed;
mod rotator;
mod start;

pub use assess::{Assessment, Options, RequirementCheck, RotatorFindings, SPIN_LIMITS_RPM, assess};
pub use closing::{Added, Closing, Considered, Term, close};
pub use document::{Document, GyroDocument, NamedEstimate, RotatorDocument};
pub use ecss::{Ecss, Index, SHARES, ecss};
pub use error::AssessError;
pub use gyro::{GyroSolution, gyro_solution};
pub use model::{Fit, Fitter, Free, Oscillation, Rotating, TimeTagStep};
pub use noise::{
    AxisNoise, FlatInterval, Plateau, Rival, SpanNoise, Windows, allan_white, axis_noise,
    find_plateau, flat_intervals, local_maxima, noise_at_span, pooled_sigma, spans_s,
    spectral_floor,
};
pub use observed::{Counts, Observed};
pub use rotator::{Body, Inertia, NutationRates, axisymmetric, nutation_rates};
pub use start::{Start, alignment, euler_123, misalignment_123, start};
