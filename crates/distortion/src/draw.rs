//! A random field of a given size.
//!
//! ```text
//! A[j][k], B[j][k] ~ N(0, 1);   A[0][0] -= <F1>;   A *= (sigma_LSF / sigma_A) / sqrt(2)
//! ```
//!
//! and the same for B, where `sigma_A` is the standard deviation of F1 over the field. Mean and
//! deviation are exact ([`monomial_moment`](crate::monomial_moment)). Since every draw is brought
//! to the same size, the coefficients of different draws differ in scale.
//!
//! Source: [M23] section 2.3, last paragraph.

use rand_core::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::error::DistortionError;
use crate::field::{self, DistortionField};
use crate::sigma::LsfSigma;

impl DistortionField {
    /// Draws a field whose mean is zero and whose per-axis RMS is `sigma.per_axis()`.
    ///
    /// Takes `2 (order + 1)^2` standard normals from `rng`: A row by row, then B. A sigma of zero
    /// takes the same numbers and gives a field of zeros.
    ///
    /// # Errors
    ///
    /// An order above [`MAX_ORDER`](crate::MAX_ORDER); a sigma that is negative or not finite;
    /// order 0 with a positive sigma, because a constant cannot be given a spread.
    ///
    /// ```
    /// use distortion::{DistortionError, DistortionField, LsfSigma};
    /// use focal_plane::Angle;
    /// use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
    ///
    /// let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
    /// let sigma = LsfSigma::PerAxis(Angle::from_arcsec(1.5));
    /// let [x, y] = DistortionField::draw(3, sigma, &mut rng)?.rms_arcsec();
    /// assert!((x - 1.5).abs() < 1e-12 && (y - 1.5).abs() < 1e-12);
    /// assert!(DistortionField::draw(0, sigma, &mut rng).is_err());
    /// # Ok::<(), DistortionError>(())
    /// ```
    pub fn draw<R: Rng + ?Sized>(
        order: usize,
        sigma: LsfSigma,
        rng: &mut R,
    ) -> Result<Self, DistortionError> {
        field::check_order(order)?;
        let per_axis = sigma.per_axis().arcsec();
        if !per_axis.is_finite() || per_axis < 0.0 {
            let (LsfSigma::Circular(given) | LsfSigma::PerAxis(given)) = sigma;
            return Err(DistortionError::Sigma {
                arcsec: given.arcsec(),
            });
        }
        let a = scaled_draw(order, per_axis, rng)?;
        let b = scaled_draw(order, per_axis, rng)?;
        Ok(Self::from_parts(order, a, b))
    }
}

/// One coefficient matrix with zero mean and deviation `sigma` over the field.
fn scaled_draw<R: Rng + ?Sized>(
    order: usize,
    sigma: f64,
    rng: &mut R,
) -> Result<Vec<f64>, DistortionError> {
    let width = order + 1;
    let mut coefficients: Vec<f64> = (0..width * width)
        .map(|_| StandardNormal.sample(rng))
        .collect();
    coefficients[0] -= field::mean(&coefficients, order);
    if sigma <= 0.0 {
        coefficients.fill(0.0);
        return Ok(coefficients);
    }
    let (_, deviation) = field::statistics(&coefficients, order);
    if order == 0 || deviation <= 0.0 {
        return Err(DistortionError::NothingToScale {
            order,
            arcsec: sigma,
        });
    }
    let factor = sigma / deviation;
    for c in &mut coefficients {
        *c *= factor;
    }
    Ok(coefficients)
}
