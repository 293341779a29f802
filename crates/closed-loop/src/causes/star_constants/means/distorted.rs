//! What the declared distortion hides of the mean errors of the stars.
//!
//! What the distortion D may do hides what is no larger: means and columns are whitened. How much it may do is what its
//! prior, of precision L, and the rows beside their means leave of it, which see its slope as stars move,
//!
//! ```text
//! P = (L + N - D'D)^-1           N: what all rows say of it, D: mean columns, in units of what noise leaves of a mean
//! e -> (I + D P D')^-1/2 e = e - U diag(1 - (1 + s^2)^-1/2) U' e        D P^1/2 = U diag(s) V'
//! e = r + D P D' r                                                      r: mean residuals of the fit
//! ```
//!
//! with that part of the fitted distortion back in e which the means have put into it, for the fit has
//! `L d = D' r + D_beside' r_beside`; where N does not hold what the means say, all of it, and P is the prior's.
//!
//! Source: generalised least squares; the posterior of what the other rows tell (Lindley & Smith 1972).

use nalgebra::{DMatrix, DVector, Dim, Dyn, Matrix, StorageMut};

/// The distortion's columns among others.
pub(super) struct Distorted<'a> {
    pub(super) from: usize,
    pub(super) values: &'a DVector<f64>,
    /// Precision of the coefficients of an axis, 1/arcsec^2.
    pub(super) precision: Option<&'a DMatrix<f64>>,
    /// What all rows say of them, in the weights of the rows.
    pub(super) told: &'a DMatrix<f64>,
}

impl Distorted<'_> {
    /// What it does to means of squared noise `noise` by all that their rows do not say of it beside them.
    pub(super) fn modes(&self, columns: &DMatrix<f64>, noise: f64) -> Modes {
        let Some(of_axis) = self.precision else {
            return Modes::default();
        };
        let (count, all) = (of_axis.nrows(), self.values.len());
        let means = columns.columns(self.from, all);
        let mut prior = DMatrix::zeros(all, all);
        for first in [0, count] {
            let mut own = prior.view_mut((first, first), (count, count));
            own.copy_from(&(of_axis * noise));
        }
        let told = (&prior + self.told - means.tr_mul(&means)).cholesky();
        let by_rows = told.is_some();
        let Some(root) = told.or_else(|| prior.cholesky()) else {
            return Modes::default();
        };
        // root of the covariance: the inverse of that of the precision
        let mut scaled = means.transpose();
        root.l_dirty().solve_lower_triangular_mut(&mut scaled);
        let svd = scaled.transpose().svd(true, false);
        let sizes = svd.singular_values;
        svd.u.map_or_else(Modes::default, |along| Modes {
            along,
            sizes,
            by_rows,
        })
    }

    /// Puts back into errors what the means, and not the rows beside them, have put into the fitted distortion; all of
    /// it where that is not known.
    pub(super) fn put_back(&self, columns: &DMatrix<f64>, modes: &Modes, error: &mut DVector<f64>) {
        if modes.by_rows {
            let size = modes.along.tr_mul(error);
            let square = modes.sizes.component_mul(&modes.sizes);
            error.gemv(1.0, &modes.along, &size.component_mul(&square), 1.0);
            return;
        }
        let means = columns.columns(self.from, self.values.len());
        error.gemv(1.0, &means, self.values, 1.0);
    }
}

/// Directions in which errors are larger than noise, and how much larger what the distortion does is.
pub(super) struct Modes {
    along: DMatrix<f64>,
    sizes: DVector<f64>,
    /// What the rows say beside their means is in them.
    by_rows: bool,
}

impl Default for Modes {
    fn default() -> Self {
        Self {
            along: DMatrix::zeros(0, 0),
            sizes: DVector::zeros(0),
            by_rows: false,
        }
    }
}

impl Modes {
    pub(super) fn whiten<C: Dim, S: StorageMut<f64, Dyn, C>>(
        &self,
        errors: &mut Matrix<f64, Dyn, C, S>,
    ) {
        if self.sizes.is_empty() {
            return;
        }
        let less = self.sizes.map(|s| 1.0 - s.hypot(1.0).recip());
        for mut error in errors.column_iter_mut() {
            let size = self.along.tr_mul(&error).component_mul(&less);
            error.gemv(-1.0, &self.along, &size, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two stars that a distortion of one coefficient an axis shifts along x and y, by 3 sigmas of a mean for one of the
    /// prior. What is known of it from the rows beside the means hides nothing; where those say nothing, the means put
    /// all of what they fit back: an error of 10 becomes one of 10 / (1 + 2 * 9).
    #[test]
    fn what_rows_say_of_the_distortion_hides_no_star() {
        let means = DMatrix::from_row_slice(4, 2, &[3.0, 0.0, 0.0, 3.0, 3.0, 0.0, 0.0, 3.0]);
        let precision = DMatrix::from_element(1, 1, 1.0);
        let of = |beside: f64| {
            let told = means.tr_mul(&means) + DMatrix::from_diagonal_element(2, 2, beside);
            let prior = Distorted {
                from: 0,
                values: &DVector::zeros(2),
                precision: Some(&precision),
                told: &told,
            };
            let modes = prior.modes(&means, 1.0);
            // both stars off along x, less what a fit of both priors takes
            let mut error = DVector::from_row_slice(&[1.0, 0.0, 1.0, 0.0]);
            error *= 10.0 / (1.0 + 18.0 / (1.0 + beside));
            prior.put_back(&means, &modes, &mut error);
            let whole = error[0];
            modes.whiten(&mut error);
            [whole, error[0]]
        };
        let [whole, white] = of(0.0);
        assert!((whole - 10.0).abs() < 1e-9 && (white - 10.0 / 19.0_f64.sqrt()).abs() < 1e-9);
        let [whole, white] = of(1e9);
        assert!((whole - 10.0).abs() < 1e-6 && (white - 10.0).abs() < 1e-6);
    }
}
