//! The distortion residual as a field over the detector.
//!
//! ```text
//! x' = x + eps_x,  y' = y + eps_y,   eps_x ~ F1(x, y),  eps_y ~ F2(x, y)
//! F1 = sum_j sum_k A[j][k] y^j x^k,  F2 = sum_j sum_k B[j][k] y^j x^k,   0 <= j, k <= order
//! ```
//!
//! with normalised x, y in [-1, 1] and F in arcsec, added to the ideal position.
//!
//! Source: [M23] Eq. 3 to 8. Eq. 5 as printed carries the star's index (`a_ij`) and makes the
//! first index the power of x; Eq. 7 and 8 make it the power of y, and the code follows them
//! (erratum E1). M = N throughout, as in the paper.

use focal_plane::{Normalised, Points, PointsMut};

use crate::error::DistortionError;
use crate::{MAX_ORDER, legendre, polynomial};

/// Two polynomials of equal order over the normalised field, in arcsec.
#[derive(Clone, Debug, PartialEq)]
pub struct DistortionField {
    order: usize,
    a: Vec<f64>,
    b: Vec<f64>,
}

impl DistortionField {
    /// The field that moves nothing.
    pub fn zero() -> Self {
        Self {
            order: 0,
            a: vec![0.0],
            b: vec![0.0],
        }
    }

    /// A field from known coefficients, for instance a calibration.
    ///
    /// `a` (x displacement) and `b` (y displacement), in arcsec, hold `(order + 1)^2` numbers each,
    /// row by row: entry `j * (order + 1) + k` belongs to `x^k y^j`.
    ///
    /// # Errors
    ///
    /// An order above [`MAX_ORDER`], a wrong number of coefficients, or one that is not finite.
    ///
    /// ```
    /// use distortion::DistortionField;
    /// use focal_plane::Normalised;
    ///
    /// // x displacement 3 y, y displacement -2 x
    /// let field = DistortionField::from_coefficients(1, &[0., 0., 3., 0.], &[0., -2., 0., 0.])?;
    /// assert_eq!(field.evaluate(Normalised { x: 0.5, y: 0.25 }), [0.75, -1.0]);
    /// # Ok::<(), distortion::DistortionError>(())
    /// ```
    pub fn from_coefficients(order: usize, a: &[f64], b: &[f64]) -> Result<Self, DistortionError> {
        check_order(order)?;
        let width = order + 1;
        for (axis, coefficients) in [('x', a), ('y', b)] {
            if coefficients.len() != width * width {
                return Err(DistortionError::Coefficients {
                    axis,
                    got: coefficients.len(),
                    need: width * width,
                });
            }
            if let Some(at) = coefficients.iter().position(|c| !c.is_finite()) {
                return Err(DistortionError::Coefficient {
                    axis,
                    power_x: at % width,
                    power_y: at / width,
                    value: coefficients[at],
                });
            }
        }
        Ok(Self {
            order,
            a: a.to_vec(),
            b: b.to_vec(),
        })
    }

    /// Highest power of each variable.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Coefficients of the x displacement, arcsec, row by row (rows: powers of y).
    pub fn a(&self) -> &[f64] {
        &self.a
    }

    /// Coefficients of the y displacement, arcsec, row by row (rows: powers of y).
    pub fn b(&self) -> &[f64] {
        &self.b
    }

    /// Displacement at one place, arcsec, `[M23]` Eq. 8.
    ///
    /// Outside [-1, 1] the polynomials grow without bound and mean nothing.
    pub fn evaluate(&self, at: Normalised) -> [f64; 2] {
        let ([f1], [f2]) = polynomial::lanes(self.order + 1, &self.a, &self.b, &[at.x], &[at.y]);
        [f1, f2]
    }

    /// Displacements at many places, arcsec; equal to [`evaluate`](Self::evaluate) to the last bit.
    /// A position that is NaN gives NaN.
    ///
    /// # Panics
    ///
    /// If the four slices differ in length.
    ///
    /// ```
    /// use distortion::DistortionField;
    /// use focal_plane::{Points, PointsMut};
    ///
    /// let field = DistortionField::from_coefficients(1, &[0., 0., 3., 0.], &[0., -2., 0., 0.])?;
    /// let (mut dx, mut dy) = ([0.0; 2], [0.0; 2]);
    /// field.evaluate_into(
    ///     Points { x: &[0.5, 1.0], y: &[0.25, -1.0] },
    ///     PointsMut { x: &mut dx, y: &mut dy },
    /// );
    /// assert_eq!((dx, dy), ([0.75, -3.0], [-1.0, -2.0]));
    /// # Ok::<(), distortion::DistortionError>(())
    /// ```
    #[inline]
    pub fn evaluate_into(&self, at: Points<'_>, out: PointsMut<'_>) {
        let width = self.order + 1;
        polynomial::in_blocks(at, out, |x, y| {
            polynomial::lanes(width, &self.a, &self.b, x, y)
        });
    }

    /// Mean displacement over the field, arcsec, exact.
    pub fn mean_arcsec(&self) -> [f64; 2] {
        [&self.a, &self.b].map(|c| mean(c, self.order))
    }

    /// Root mean square of each axis over the field, mean included, arcsec, exact.
    pub fn rms_arcsec(&self) -> [f64; 2] {
        [&self.a, &self.b].map(|c| {
            let (mean, deviation) = statistics(c, self.order);
            mean.hypot(deviation)
        })
    }

    /// Standard deviation of each axis over the field, about its mean, arcsec, exact.
    pub fn deviation_arcsec(&self) -> [f64; 2] {
        [&self.a, &self.b].map(|c| statistics(c, self.order).1)
    }

    /// The same field `factor` times as large.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            order: self.order,
            a: self.a.iter().map(|c| c * factor).collect(),
            b: self.b.iter().map(|c| c * factor).collect(),
        }
    }

    /// Sum of two fields, of the higher of their orders: a prior and its correction, for instance.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let (high, low) = if self.order >= other.order {
            (self, other)
        } else {
            (other, self)
        };
        let mut sum = high.clone();
        let (wide, narrow) = (high.order + 1, low.order + 1);
        for j in 0..narrow {
            for k in 0..narrow {
                sum.a[j * wide + k] += low.a[j * narrow + k];
                sum.b[j * wide + k] += low.b[j * narrow + k];
            }
        }
        sum
    }

    /// The monomials `x^k y^j` in the order of the coefficients: the derivative of either axis'
    /// displacement with respect to its own coefficients.
    ///
    /// # Panics
    ///
    /// If `out` does not hold `(order + 1)^2` numbers.
    ///
    /// ```
    /// use distortion::DistortionField;
    /// use focal_plane::Normalised;
    ///
    /// let mut basis = [0.0; 4];
    /// DistortionField::basis_into(1, Normalised { x: 2.0, y: 3.0 }, &mut basis);
    /// assert_eq!(basis, [1.0, 2.0, 3.0, 6.0]);
    /// ```
    pub fn basis_into(order: usize, at: Normalised, out: &mut [f64]) {
        let width = order + 1;
        assert_eq!(out.len(), width * width, "one entry per coefficient");
        let mut y_power = 1.0;
        for row in out.chunks_exact_mut(width) {
            let mut product = y_power;
            for value in row {
                *value = product;
                product *= at.x;
            }
            y_power *= at.y;
        }
    }

    /// Trusted parts, used inside the crate.
    pub(crate) fn from_parts(order: usize, a: Vec<f64>, b: Vec<f64>) -> Self {
        Self { order, a, b }
    }
}

/// Orders above [`MAX_ORDER`] are refused everywhere.
pub(crate) fn check_order(order: usize) -> Result<(), DistortionError> {
    if order > MAX_ORDER {
        return Err(DistortionError::Order {
            order,
            limit: MAX_ORDER,
        });
    }
    Ok(())
}

/// Mean over the field, from the moments of the monomials.
pub(crate) fn mean(coefficients: &[f64], order: usize) -> f64 {
    let width = order + 1;
    coefficients
        .iter()
        .enumerate()
        .map(|(i, c)| c * crate::monomial_moment(i % width, i / width))
        .sum()
}

/// Mean and standard deviation over the field, from the Legendre coefficients.
pub(crate) fn statistics(coefficients: &[f64], order: usize) -> (f64, f64) {
    let width = order + 1;
    let legendre = legendre::change_basis(coefficients, order, &legendre::from_monomials());
    let variance: f64 = legendre
        .iter()
        .enumerate()
        .skip(1)
        .map(|(i, c)| c * c / ((2 * (i % width) + 1) * (2 * (i / width) + 1)) as f64)
        .sum();
    (legendre[0], variance.sqrt())
}
