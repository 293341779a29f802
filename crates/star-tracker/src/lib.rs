//! The star tracker models of \[M23\], physics-based and hybrid: truth attitude in, centroids and
//! attitude out.
//!
//! - [`Pbm`]: distortion, centroid error, noise and QUEST over a batch of frames (\[M23\] Fig. 4), one
//!   frame being a batch of one; [`Rows`] in, [`Measured`] out, all memory the caller's;
//! - [`Hem`]: the hybrid model (\[M23\] Fig. 5), distortion by the stars and a Gauss-Markov process
//!   with white noise per attitude axis;
//! - [`Disturbance`], [`Stages`]: the places where an effect may act, in the order of the light;
//! - [`StarField`], [`CatalogueTracking`]: which stars are tracked;
//! - [`solve_frames`]: attitudes of frames that were measured;
//! - [`sigma`]: which sigma is meant; [`stream`]: which random numbers.
//!
//! ```
//! use centroid::{CentroidError, Triangle};
//! use focal_plane::{Camera, UniformRotation, Vectors};
//! use nalgebra::UnitQuaternion;
//! use star_tracker::{
//!     Measured, NoiseStreams, Pbm, Purpose, Rows, Scratch, StarField, TemporalNoise, stream,
//! };
//!
//! let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0])?;
//! let mut rng = stream(1, 0, Purpose::StarField);
//! let field = StarField::generate(&camera, &UnitQuaternion::identity(), 14, &mut rng)?;
//! let axis = |k: usize| field.stars().iter().map(|s| s.direction[k]).collect::<Vec<f64>>();
//! let (x, y, z) = (axis(0), axis(1), axis(2));
//!
//! let tracker = Pbm::new(camera)
//!     .with_centroid_error(CentroidError::Triangle(Triangle::from_peak(5.06)))
//!     .with_noise(TemporalNoise::circular_arcsec(7.43)?);
//! let rows = Rows {
//!     t_s: &[0.0],
//!     first_row: &[0, 14],
//!     slot: &[],
//!     star_id: &[],
//!     mag: &[],
//!     bv: &[],
//!     direction: Vectors { x: &x, y: &y, z: &z },
//! };
//! let (mut scratch, mut seen) = (Scratch::default(), Measured::default());
//! let truth = UniformRotation::default();
//! tracker.measure_into(&truth, rows, &mut NoiseStreams::new(1, 0), &mut scratch, &mut seen);
//! let error = seen.attitude(0).expect("14 stars").angle();
//! assert!(error > 0.0 && error < 3e-4); // tens of arcsec, most of it roll
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! \[M23\]: Miller et al. 2023, star-tracker error models validated on DART and PSP data.
//!
//! Source: \[M23\] Section 2; each module names its own.
#![forbid(unsafe_code)]

mod disturbance;
mod error;
mod hem;
mod noise;
mod pbm;
mod quadrature;
mod rows;
pub mod sigma;
mod solve;
mod star_field;
mod streams;

pub use disturbance::{Disturbance, Stages, StarView};
pub use error::TrackerError;
pub use hem::{Hem, HemState, k0, k0_as_printed};
pub use noise::TemporalNoise;
pub use pbm::{Pbm, Scratch};
pub use quadrature::GAUSS_LEGENDRE_8;
pub use rows::{Measured, Rows};
pub use solve::solve_frames;
pub use star_field::{CatalogueTracking, FieldStar, StarField, replacement_box};
pub use streams::{NoiseStreams, Purpose, stream};
