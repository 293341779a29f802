//! A field fitted to residuals by least squares.
//!
//! ```text
//! minimise  sum_i w_i |r_i - F(x_i, y_i)|^2      (each axis by itself)
//! sigma^2_F(x, y) = s^2 |R^-T l(x, y)|^2,        s^2 = RSS / (rows - coefficients)
//! ```
//!
//! solved by orthogonal triangularisation, block by block, so that memory does not grow with the
//! rows. The unknowns are coefficients of orthonormal Legendre products l (condition number near
//! one for stars spread over the field), turned into monomials at the end.
//!
//! Source: [M23] Eq. 5 for the model; Björck, Numerical Methods for Least Squares Problems (1996),
//! section 6.2 on sequential QR.

use focal_plane::{Normalised, Points};
use nalgebra::{DMatrix, DVector};

use crate::error::DistortionError;
use crate::field::{self, DistortionField};
use crate::legendre;

/// Highest condition number at which half the digits of a coefficient are still right.
const MAX_CONDITION: f64 = 1e8;

/// Result of a least-squares fit, with its formal uncertainty.
#[derive(Clone, Debug)]
pub struct FieldFit {
    /// The fitted field, arcsec.
    pub field: DistortionField,
    /// Weighted root mean square of what is left, each axis, arcsec.
    pub residual_rms_arcsec: [f64; 2],
    /// Standard deviation of one residual of weight 1, each axis, arcsec, with the degrees of
    /// freedom taken off; `None` when there are none left.
    pub unit_sigma_arcsec: Option<[f64; 2]>,
    /// Condition number of the design matrix: 1 at best.
    pub condition: f64,
    triangle: DMatrix<f64>,
}

impl FieldFit {
    /// Fits both axes of a field of `order` to residuals (arcsec) at normalised positions.
    ///
    /// `weights`, one per row, are inverse variances up to a common factor; without them all rows
    /// count alike.
    ///
    /// # Errors
    ///
    /// An order above [`MAX_ORDER`](crate::MAX_ORDER), a number that is not finite, a weight that
    /// is not positive, a position outside [-1, 1], fewer rows than the `(order + 1)^2`
    /// coefficients, and positions that do not determine them (condition number above 1e8).
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    ///
    /// ```
    /// use distortion::FieldFit;
    /// use focal_plane::{Normalised, Points};
    ///
    /// let (x, y) = ([-0.9, 0.8, 0.7, -0.6, 0.1], [-0.7, -0.8, 0.9, 0.6, 0.0]);
    /// let dx: Vec<f64> = x.iter().zip(&y).map(|(x, y)| 2.0 - x + 3.0 * x * y).collect();
    /// let dy = [0.0; 5];
    /// let fit = FieldFit::new(1, Points { x: &x, y: &y }, Points { x: &dx, y: &dy }, None)?;
    /// let [fx, _] = fit.field.evaluate(Normalised { x: 0.5, y: 0.5 });
    /// assert!((fx - 2.25).abs() < 1e-12);
    /// # Ok::<(), distortion::DistortionError>(())
    /// ```
    pub fn new(
        order: usize,
        at: Points<'_>,
        residual_arcsec: Points<'_>,
        weights: Option<&[f64]>,
    ) -> Result<Self, DistortionError> {
        field::check_order(order)?;
        let rows = at.x.len();
        check_rows(&at, &residual_arcsec, weights)?;
        let unknowns = (order + 1) * (order + 1);
        if rows < unknowns {
            return Err(DistortionError::TooFewRows {
                got: rows,
                need: unknowns,
            });
        }

        let mut normal = Triangle::new(unknowns);
        let block = unknowns.max(256);
        for start in (0..rows).step_by(block) {
            let rows = start..rows.min(start + block);
            normal.add(order, &at, &residual_arcsec, weights, rows);
        }
        let condition = normal.condition();
        if condition.is_nan() || condition > MAX_CONDITION {
            return Err(DistortionError::IllConditioned {
                order,
                condition,
                limit: MAX_CONDITION,
            });
        }
        normal.finish(order, rows, weights, condition)
    }

    /// Formal standard deviation of the fitted displacement at one place, each axis, arcsec;
    /// `None` when the fit has no degree of freedom left to tell the noise.
    pub fn sigma_arcsec(&self, at: Normalised) -> Option<[f64; 2]> {
        let unit = self.unit_sigma_arcsec?;
        let mut basis = vec![0.0; self.triangle.ncols()];
        basis_into(self.field.order(), at.x, at.y, &mut basis);
        let solved = self
            .triangle
            .tr_solve_upper_triangular(&DVector::from_vec(basis))?;
        Some(unit.map(|s| s * solved.norm()))
    }
}

/// Upper triangle and right-hand sides of the rows seen so far.
struct Triangle {
    r: DMatrix<f64>,
    rhs: DMatrix<f64>,
    left_over: [f64; 2],
}

impl Triangle {
    fn new(unknowns: usize) -> Self {
        Self {
            r: DMatrix::zeros(unknowns, unknowns),
            rhs: DMatrix::zeros(unknowns, 2),
            left_over: [0.0; 2],
        }
    }

    /// Takes a block of rows in: triangularises them below what is there.
    fn add(
        &mut self,
        order: usize,
        at: &Points<'_>,
        residual: &Points<'_>,
        weights: Option<&[f64]>,
        rows: std::ops::Range<usize>,
    ) {
        let unknowns = self.r.ncols();
        let mut stack = DMatrix::zeros(unknowns + rows.len(), unknowns);
        let mut rhs = DMatrix::zeros(unknowns + rows.len(), 2);
        stack.rows_mut(0, unknowns).copy_from(&self.r);
        rhs.rows_mut(0, unknowns).copy_from(&self.rhs);
        let mut basis = vec![0.0; unknowns];
        for (below, row) in rows.enumerate() {
            let root = weights.map_or(1.0, |w| w[row].sqrt());
            basis_into(order, at.x[row], at.y[row], &mut basis);
            for (column, value) in basis.iter().enumerate() {
                stack[(unknowns + below, column)] = root * value;
            }
            rhs[(unknowns + below, 0)] = root * residual.x[row];
            rhs[(unknowns + below, 1)] = root * residual.y[row];
        }
        let qr = stack.qr();
        qr.q_tr_mul(&mut rhs);
        self.r = qr.unpack_r();
        self.rhs = rhs.rows(0, unknowns).into_owned();
        let below = rhs.rows(unknowns, rhs.nrows() - unknowns);
        for axis in 0..2 {
            self.left_over[axis] += below.column(axis).norm_squared();
        }
    }

    fn condition(&self) -> f64 {
        let singular = self.r.singular_values();
        singular.max() / singular.min()
    }

    fn finish(
        self,
        order: usize,
        rows: usize,
        weights: Option<&[f64]>,
        condition: f64,
    ) -> Result<FieldFit, DistortionError> {
        let unknowns = self.r.ncols();
        let solution =
            self.r
                .solve_upper_triangular(&self.rhs)
                .ok_or(DistortionError::IllConditioned {
                    order,
                    condition: f64::INFINITY,
                    limit: MAX_CONDITION,
                })?;
        let total_weight = weights.map_or(rows as f64, |w| w.iter().sum());
        let freedom = rows - unknowns;
        Ok(FieldFit {
            field: DistortionField::from_parts(
                order,
                monomials(order, solution.column(0).as_slice()),
                monomials(order, solution.column(1).as_slice()),
            ),
            residual_rms_arcsec: self.left_over.map(|rss| (rss / total_weight).sqrt()),
            unit_sigma_arcsec: (freedom > 0)
                .then(|| self.left_over.map(|rss| (rss / freedom as f64).sqrt())),
            condition,
            triangle: self.r,
        })
    }
}

/// Orthonormal Legendre products in the order of the coefficients.
fn basis_into(order: usize, x: f64, y: f64, out: &mut [f64]) {
    let width = order + 1;
    let (mut along_x, mut along_y) = ([0.0; crate::MAX_ORDER + 1], [0.0; crate::MAX_ORDER + 1]);
    legendre::orthonormal_into(x, &mut along_x[..width]);
    legendre::orthonormal_into(y, &mut along_y[..width]);
    for (row, y_value) in out.chunks_exact_mut(width).zip(along_y) {
        for (value, x_value) in row.iter_mut().zip(along_x) {
            *value = y_value * x_value;
        }
    }
}

/// Monomial coefficients of a sum of orthonormal Legendre products.
fn monomials(order: usize, orthonormal: &[f64]) -> Vec<f64> {
    let width = order + 1;
    let plain: Vec<f64> = orthonormal
        .iter()
        .enumerate()
        .map(|(i, c)| c * (((2 * (i % width) + 1) * (2 * (i / width) + 1)) as f64).sqrt())
        .collect();
    legendre::change_basis(&plain, order, &legendre::to_monomials())
}

fn check_rows(
    at: &Points<'_>,
    residual: &Points<'_>,
    weights: Option<&[f64]>,
) -> Result<(), DistortionError> {
    let rows = at.x.len();
    assert_eq!(at.y.len(), rows, "x and y of the positions");
    assert_eq!(residual.x.len(), rows, "positions and x residuals");
    assert_eq!(residual.y.len(), rows, "positions and y residuals");
    if let Some(weights) = weights {
        assert_eq!(weights.len(), rows, "positions and weights");
    }
    for row in 0..rows {
        let (x, y) = (at.x[row], at.y[row]);
        for (name, value) in [
            ("x", x),
            ("y", y),
            ("x residual", residual.x[row]),
            ("y residual", residual.y[row]),
        ] {
            if !value.is_finite() {
                return Err(DistortionError::Row { row, name, value });
            }
        }
        if x.abs() > 1.0 || y.abs() > 1.0 {
            return Err(DistortionError::OffField { row, x, y });
        }
        if let Some(weights) = weights {
            let value = weights[row];
            if !(value.is_finite() && value > 0.0) {
                let name = "weight";
                return Err(DistortionError::Row { row, name, value });
            }
        }
    }
    Ok(())
}
