//! The physics-based star tracker model: truth attitude in, centroids and attitude out.
#![forbid(unsafe_code)]

mod disturbance;
mod error;
mod noise;
mod pbm;
mod quadrature;
mod rows;
pub mod sigma;
mod star_field;
mod streams;

pub use disturbance::{Disturbance, Stages, StarView};
pub use error::TrackerError;
pub use noise::TemporalNoise;
pub use pbm::{Pbm, Scratch};
pub use rows::{Measured, Rows};
pub use star_field::{CatalogueTracking, FieldStar, StarField, replacement_box};
pub use streams::{NoiseStreams, Purpose, stream};
