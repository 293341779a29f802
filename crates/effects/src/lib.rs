//! The catalogue of effects: forward action and regressors together.
//!
//! One file an effect: equation and source, parameters, how it acts on a simulated measurement
//! ([`star_tracker::Disturbance`]), how it enters a residual ([`Candidate`]), and the tests that the two
//! agree. Adding an effect touches its file and the list in `catalogue.rs`.
//!
//! - [`catalogue`], [`kind`], [`build`]: effects by id, from the keys of a model file;
//! - [`EffectKind::candidates`]: the ways in which an effect could be in given data;
//! - [`step_at`], [`line_at`], [`hot_pixel_at`], [`harmonics_of`]: candidates at a place or instant that
//!   a search has found;
//! - [`reported`]: parameters and their uncertainty from fitted coefficients.
#![forbid(unsafe_code)]

#[cfg(test)]
mod agreement;
mod bending;
mod candidate;
mod catalogue;
mod catalogue_position;
mod channels;
mod chromatic_shift;
mod effect;
mod empirical;
mod error;
mod exposure_smear;
mod focal_length_drift;
#[cfg(test)]
mod harness;
mod hot_pixel;
mod image_effects;
mod lens;
mod magnitude_noise;
mod optical_distortion;
mod outliers;
mod parameters;
mod path;
mod periodic_misalignment;
mod pixel_phase_harmonics;
mod pixel_wave;
mod rate_noise;
mod reference_error;
mod rolling_shutter;
mod scene;
mod shift;
mod step_misalignment;
mod thermal_misalignment;
mod time_tag_offset;
mod velocity_aberration;
mod warm_pixels;

pub use candidate::{AttitudeRows, Candidate, Coefficient, Nonlinear, StarRows, Twin, reported};
pub use catalogue::{build, catalogue, kind};
pub use effect::{ActsOn, Effect, EffectKind, ReferenceWander};
pub use empirical::{CHANNEL, empirical_parameters};
pub use error::EffectError;
pub use exposure_smear::longest_exposure_s;
pub use hot_pixel::hot_pixel_at;
pub use parameters::{Parameter, ParameterValue, Parameters};
pub use path::mean_turn;
pub use periodic_misalignment::line_at;
pub use pixel_phase_harmonics::{LARGEST_WAVE_PX, harmonics_of};
pub use pixel_wave::{PixelWave, PixelWaves};
pub use scene::{FrameGeometry, Scene, StarFacts, Surroundings, VectorFrame};
pub use step_misalignment::step_at;
pub use velocity_aberration::{
    SHORTEST_ORBIT_S, could_be_about_a_planet, free_orbit, nearest_circles, orbit_could_show,
};
pub use warm_pixels::WarmPixels;
