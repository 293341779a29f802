//! How large an effect would have to be to explain the residual by itself.
//!
//! ```text
//! needed     c^2 |column|^2 = excess
//! left       squared residual that is no noise with what was added, of column what the declared unknowns and
//!            the added effects leave
//! alone      the same with nothing added, of column what the declared unknowns leave
//! ```
//!
//! Squares and columns are those of one fit, in sample: what is predicted out of fold errs by more, which no size of an
//! effect explains.
//!
//! Where nothing is said to be left there is nothing to explain, whatever the level of the noise. Where something is,
//! what is described of it is the least: a declared noise that is larger than the noise hides it from the sum of all
//! squares.
//!
//! Source: Frisch & Waugh 1933 (a column beside others).

use block_regression::Fits;
use nalgebra::{DMatrix, DVector};

use crate::questions::hypothesis::SEEN;

/// Squared length of a candidate column beside others.
pub(crate) type Length<'a> = dyn Fn(usize, &[usize]) -> f64 + 'a;

/// What an effect would have to explain. `None` where there is nothing.
pub(crate) struct ToExplain<'a> {
    pub(crate) left: Option<f64>,
    pub(crate) alone: Option<f64>,
    pub(crate) length: &'a Length<'a>,
}

impl ToExplain<'_> {
    pub(crate) const NOTHING: ToExplain<'static> = ToExplain {
        left: None,
        alone: None,
        length: &|_, _| 0.0,
    };

    /// The amplitude of this column that explains what is left beside the columns that were added.
    pub(crate) fn needed(&self, column: usize, added: &[usize]) -> Option<f64> {
        amplitude(self.left?, (self.length)(column, added))
    }

    /// The amplitude that explains all that the declared model leaves.
    pub(crate) fn needed_alone(&self, column: usize) -> Option<f64> {
        amplitude(self.alone?, (self.length)(column, &[]))
    }
}

fn amplitude(excess: f64, length: f64) -> Option<f64> {
    (excess > 0.0 && length > 0.0).then(|| (excess / length).sqrt())
}

/// An excess of squared residual where it stands out of noise with `scalars` numbers of `variance` each: by 5
/// sigma of the sum of their squares.
pub(crate) fn remarkable(excess: f64, variance: f64, scalars: f64) -> Option<f64> {
    (excess > SEEN * variance * (2.0 * scalars).sqrt()).then_some(excess)
}

/// What is left of the squared error of `fits` with columns `set`, and with none. `declared` is the variance of a scalar;
/// `described` the share of what is left that follows something, `None` where nothing is left.
pub(crate) fn of_fits(
    fits: &Fits,
    set: &[usize],
    declared: Option<f64>,
    described: Option<f64>,
) -> [Option<f64>; 2] {
    let (Some(whole), Some(rest), Some(variance), Some(alone)) = (
        fits.error(&[]),
        fits.error(set),
        fits.variance(set),
        fits.variance(&[]),
    ) else {
        return [None; 2];
    };
    let freedom = rest / variance;
    let left = described.and_then(|share| {
        let over = declared.and_then(|v| remarkable(rest - v * freedom, v, freedom));
        let most = over.unwrap_or(0.0).max(share * rest);
        (most > 0.0).then_some(most)
    });
    // columns of nothing but noise take their part of it
    let taken = whole - rest - variance * (whole / alone - freedom);
    let all = taken.max(0.0) + left.unwrap_or(0.0);
    [left, (all > 0.0).then_some(all)]
}

/// What the nuisance and columns `others` leave of the squared length of `column`.
pub(crate) fn length_beside(fits: &Fits, column: usize, others: &[usize]) -> f64 {
    let n = others.len();
    let among = DMatrix::from_fn(n, n, |i, j| fits.likeness(others[i], others[j]));
    let with = DVector::from_fn(n, |i, _| fits.likeness(column, others[i]));
    let shared = match among.cholesky() {
        Some(among) => with.dot(&among.solve(&with)),
        None => 1.0,
    };
    fits.information(column) * (1.0 - shared).max(0.0)
}
