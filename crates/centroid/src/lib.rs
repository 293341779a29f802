//! High spatial frequency error (HSFE) and the centroids of pixel windows.
//!
//! - [`CentroidError`]: how far a tracker's centroid is from the star, as a function of the place
//!   within the pixel: the paper's [`Triangle`], a series of [`Harmonics`], or the S-curve that a
//!   first moment over a window has for a Gaussian spot ([`GaussianPsf`]).
//! - [`FirstMoment`] and [`GaussianWeighted`]: centroids of a [`Window`] of pixels with
//!   background, pixels that were never read, and formal errors; a [`WindowBatch`] at a time too.
//! - [`pixel_gaussian_into`]: the Gaussian spot integrated over pixels.
//!
//! Sign: a centroid error is measured minus true. Units: px, or whatever unit the amplitudes are
//! given in; [`CentroidError::scaled`] changes it.
//!
//! ```
//! use centroid::{CentroidError, Triangle};
//! use focal_plane::Pixel;
//!
//! let hsfe = CentroidError::Triangle(Triangle::from_peak(5.06)); // arcsec
//! let centre = 0.5; // pixel centres at half-integers
//! let [x, y] = hsfe.error_at(Pixel { x: 10.25, y: -3.5 }, centre);
//! assert_eq!([x, y], [5.06, 0.0]); // pulled to the middle of its pixel; already there
//! ```
#![forbid(unsafe_code)]

mod batch;
mod error_model;
mod failure;
mod first_moment;
mod gaussian_psf;
mod gaussian_weighted;
mod harmonics;
mod normal;
mod phase;
mod spot;
mod triangle;
mod window;

pub use batch::{EstimatesMut, WindowBatch};
pub use error_model::{CentroidError, GAUSS_HERMITE_5};
pub use failure::CentroidFailure;
pub use first_moment::FirstMoment;
pub use gaussian_psf::GaussianPsf;
pub use gaussian_weighted::GaussianWeighted;
pub use harmonics::{Harmonic, Harmonics};
pub use phase::phase_rad;
pub use spot::pixel_gaussian_into;
pub use triangle::Triangle;
pub use window::{CentroidEstimate, Noise, Window};

/// Longest side of a window that [`GaussianWeighted`] accepts, px.
pub const MAX_WINDOW_SIDE: usize = 64;
