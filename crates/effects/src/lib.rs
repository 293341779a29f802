//! The catalogue of effects: forward action and regressors together.
//!
//! One file an effect: equation and source, parameters, how it acts on a simulated measurement
//! ([`star_tracker::Disturbance`]), how it enters a residual ([`Candidate`]), and the tests that the two
//! agree. Adding an effect touches its file and the list in `catalogue.rs`.
#![forbid(unsafe_code)]

mod candidate;
mod catalogue;
mod effect;
mod error;
mod parameters;
mod scene;

pub use candidate::{AttitudeRows, Candidate, Coefficient, Nonlinear, StarRows, reported};
pub use catalogue::{build, catalogue, kind};
pub use effect::{ActsOn, Effect, EffectKind, ReferenceWander};
pub use error::EffectError;
pub use parameters::{Parameter, ParameterValue, Parameters};
pub use scene::{FrameGeometry, Scene, StarFacts, Surroundings, VectorFrame};
