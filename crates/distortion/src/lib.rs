//! Low spatial frequency error (LSFE): what an optical calibration leaves behind, as two smooth
//! polynomials over the detector.
//!
//! - [`DistortionField`]: drawn at random at a given size ([`DistortionField::draw`]), given by
//!   coefficients ([`DistortionField::from_coefficients`]) or fitted to residuals
//!   ([`FieldFit::new`]); its mean and its root mean square are exact, not sums over a mesh.
//! - [`PixelDistortion`]: the same field prepared for one camera; moves pixel positions there and
//!   back.
//!
//! Units: positions are normalised (-1..1 over the detector), the field is in arcsec at the
//! centre's scale, `focal_plane::Camera::arcsec_per_px`.
//!
//! ```
//! use distortion::{DistortionField, LsfSigma};
//! use focal_plane::{Angle, Normalised};
//! use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
//!
//! # fn main() -> Result<(), distortion::DistortionError> {
//! let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
//! let sigma = LsfSigma::Circular(Angle::from_arcsec(3.1667));
//! let field = DistortionField::draw(7, sigma, &mut rng)?;
//!
//! let [x, y] = field.rms_arcsec();
//! assert!((x.hypot(y) - 3.1667).abs() < 1e-12);
//! let [dx, dy] = field.evaluate(Normalised { x: 0.25, y: -0.5 });
//! assert!(dx.is_finite() && dy.is_finite());
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]

mod draw;
mod error;
mod field;
mod fit;
mod legendre;
mod moments;
mod pixel;
mod polynomial;
mod prior;
mod sigma;

pub use error::DistortionError;
pub use field::DistortionField;
pub use fit::FieldFit;
pub use moments::monomial_moment;
pub use pixel::PixelDistortion;
pub use prior::coefficient_precision;
pub use sigma::LsfSigma;

/// Highest order of the polynomials in each variable.
///
/// Beyond it the monomials can no longer be told apart in double precision.
pub const MAX_ORDER: usize = 15;
