//! The physics-based star tracker model: truth attitude in, centroids and attitude out.
#![forbid(unsafe_code)]

mod disturbance;

pub use disturbance::{Disturbance, Stages, StarView};
