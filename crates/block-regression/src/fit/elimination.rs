//! The nuisance eliminated on one set of data: what is left of the candidates and the residual.
//!
//! ```text
//! W = (G_nn + L)^-1 G_n,[c r]      T = [ -W ; I ]      S = G_cc - G_cn W_c      s = G_cr - G_cn W_r
//! ```
//!
//! Source: the Schur complement of partitioned normal equations (Brown 1958).

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::Layout;
use super::out_of_fold::gaussian;

/// Share of a column's information that it is given beside, where it needs any.
const FLOOR: f64 = 1e-10;
/// Share of it beside other columns below which rounding is all that tells it from them.
const TOLD: f64 = 1e-9;

/// The nuisance eliminated on one training set.
#[derive(Clone, Debug)]
pub(super) struct Eliminated {
    /// W: nuisance amplitudes of each candidate column and of the residual, last.
    pub(super) nuisance: DMatrix<f64>,
    /// Training Gram of the candidates and the residual (last), nuisance removed.
    pub(super) train: DMatrix<f64>,
    /// What the prior adds to the nuisance's normal matrix.
    pub(super) prior: DMatrix<f64>,
    /// ln det of the nuisance's normal matrix.
    pub(super) log_det: f64,
    /// Training scalars.
    pub(super) scalars: f64,
    /// Training scalars less the nuisance freedom.
    pub(super) freedom: f64,
}

impl Eliminated {
    pub(super) fn new(
        (gram, scalars): &(DMatrix<f64>, f64),
        layout: &Layout,
        variance: f64,
        pick: &[usize],
    ) -> Option<Self> {
        let n = layout.nuisance_precision.nrows();
        let mut normal = gram.view((0, 0), (n, n)).into_owned();
        // A star never seen in training gets a precision far below what one scalar of data brings.
        let most = normal.diagonal().max().max(f64::MIN_POSITIVE);
        let mut prior = &layout.nuisance_precision * variance;
        let own: Vec<f64> = normal.diagonal().iter().copied().collect();
        let seen = |k: usize| own[k] > FLOOR * FLOOR * most;
        for k in (0..n).filter(|&k| !seen(k)) {
            prior[(k, k)] += FLOOR * most;
        }
        normal += &prior;
        let factor = told_apart(&normal).or_else(|| {
            // So does a gauge freedom: of its own information, for columns have all sorts of units. Where none is, that
            // would draw an angle of 1e5 of its sigmas to zero by dozens of nats, and by less beside slow noise.
            for k in (0..n).filter(|&k| seen(k)) {
                prior[(k, k)] += FLOOR * own[k];
                normal[(k, k)] += FLOOR * own[k];
            }
            Cholesky::new(normal)
        });
        let cross = picked(gram, 0..n, pick);
        let (nuisance, log_det) = if n == 0 {
            (cross.clone(), 0.0)
        } else {
            let factor = factor?;
            (factor.solve(&cross), factor.ln_determinant())
        };
        let mut reduced = both(gram, pick);
        reduced.gemm(-1.0, &cross.transpose(), &nuisance, 1.0);
        // Columns under a tight prior cost less than one degree of freedom each;
        // counting them whole is the cautious side.
        let freedom = (scalars - n as f64).max(1.0);
        Some(Self {
            nuisance,
            train: reduced,
            prior,
            log_det,
            scalars: *scalars,
            freedom,
        })
    }

    /// Takes for the nuisance columns `alone`, of which this training data knows nothing, what suits the held
    /// data best (`gram`), given all others.
    pub(super) fn learn(
        &mut self,
        alone: &[usize],
        gram: &DMatrix<f64>,
        pick: &[usize],
    ) -> Option<()> {
        let n = self.prior.nrows();
        let mut rows = gram.select_rows(alone);
        let mut own = rows.columns_mut(0, n);
        own += self.prior.select_rows(alone);
        let normal = rows.select_columns(alone);
        for &k in alone {
            self.nuisance.row_mut(k).fill(0.0);
        }
        let mut left = picked(&rows, 0..alone.len(), pick);
        left.gemm(-1.0, &rows.columns(0, n), &self.nuisance, 1.0);
        let own = Cholesky::new(normal)?.solve(&left);
        for (i, &k) in alone.iter().enumerate() {
            self.nuisance.row_mut(k).copy_from(&own.row(i));
        }
        Some(())
    }

    /// S and s of `set`.
    fn equations(&self, set: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
        let last = self.train.ncols() - 1;
        (
            DMatrix::from_fn(set.len(), set.len(), |i, j| self.train[(set[i], set[j])]),
            DVector::from_fn(set.len(), |i, _| self.train[(set[i], last)]),
        )
    }

    /// Amplitudes of the candidate columns `set` without priors.
    pub(super) fn amplitudes(&self, set: &[usize]) -> Option<(DVector<f64>, Cholesky<f64, Dyn>)> {
        let (normal, score) = self.equations(set);
        if (0..set.len()).any(|i| normal[(i, i)].is_nan() || normal[(i, i)] <= 0.0) {
            return None;
        }
        let factor = told_apart(&normal)?;
        let beta = factor.solve(&score);
        Some((beta, factor))
    }

    /// Amplitudes of `set` under priors of precision `ridge`, in the unit of the Gram.
    pub(super) fn shrunk(&self, set: &[usize], ridge: &[f64]) -> Option<DVector<f64>> {
        let (mut normal, score) = self.equations(set);
        for (i, ridge) in ridge.iter().enumerate() {
            normal[(i, i)] += ridge;
        }
        Some(Cholesky::new(normal)?.solve(&score))
    }

    /// The set with a prior of its own, precision `ridge` in the unit of the Gram.
    pub(super) fn with_prior(&self, set: &[usize], ridge: &DMatrix<f64>) -> Option<Judged> {
        let last = self.train.ncols() - 1;
        let (normal, score) = self.equations(set);
        let factor = Cholesky::new(normal + ridge)?;
        Some(Judged {
            error: (self.train[(last, last)] - factor.solve(&score).dot(&score)).max(0.0),
            log_det: self.log_det + factor.ln_determinant(),
        })
    }

    /// Squared error at amplitudes `beta` that are best without priors.
    pub(super) fn error(&self, set: &[usize], beta: &DVector<f64>) -> f64 {
        let last = self.train.ncols() - 1;
        let explained: f64 = (0..set.len())
            .map(|i| beta[i] * self.train[(set[i], last)])
            .sum();
        self.train[(last, last)] - explained
    }

    /// Scalars less the freedom of the nuisance and of `set`.
    pub(super) fn freedom_beside(&self, set: &[usize]) -> f64 {
        (self.freedom - set.len() as f64).max(1.0)
    }

    /// Nuisance amplitudes of the residual less `beta` times `set`.
    pub(super) fn left(&self, set: &[usize], beta: &DVector<f64>) -> DVector<f64> {
        less(&self.nuisance, set, beta)
    }
}

/// The factor of a normal matrix; `None` where a column cannot be told from those before it.
fn told_apart(normal: &DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    let factor = Cholesky::new(normal.clone())?;
    let pivots = factor.l_dirty();
    let told = |k: usize| pivots[(k, k)].powi(2) >= TOLD * normal[(k, k)];
    (0..normal.nrows()).all(told).then_some(factor)
}

/// How well a set describes some data, all amplitudes integrated out.
pub(super) struct Judged {
    /// Squared error at the best amplitudes, with what their priors add.
    pub(super) error: f64,
    /// ln det of the normal matrix of all amplitudes.
    pub(super) log_det: f64,
}

impl Judged {
    /// Log-likelihood of the `scalars` that this holds beyond `before`, up to a constant of the priors, nats.
    pub(super) fn beyond(&self, before: &Self, scalars: f64, variance: f64) -> f64 {
        let error = self.error - before.error;
        gaussian(scalars, error, variance) - 0.5 * (self.log_det - before.log_det)
    }

    /// Noise variance beside `set` in the data that `of` is about.
    pub(super) fn variance(&self, of: &Eliminated, set: &[usize]) -> f64 {
        (self.error / of.freedom_beside(set)).max(f64::MIN_POSITIVE)
    }
}

/// The last column less `beta` times the columns `set`.
fn less(columns: &DMatrix<f64>, set: &[usize], beta: &DVector<f64>) -> DVector<f64> {
    let mut out = DVector::zeros(columns.nrows());
    less_into(columns, set, beta, &mut out);
    out
}

/// As [`less`], into `out` of as many rows.
pub(super) fn less_into(
    columns: &DMatrix<f64>,
    set: &[usize],
    beta: &DVector<f64>,
    out: &mut DVector<f64>,
) {
    out.copy_from(&columns.column(columns.ncols() - 1));
    for (&c, b) in set.iter().zip(beta.iter()) {
        out.axpy(-b, &columns.column(c), 1.0);
    }
}

/// `T^T G T` for `T = [-W; I]` over the picked columns.
pub(super) fn transformed(
    gram: &DMatrix<f64>,
    n: usize,
    pick: &[usize],
    w: &DMatrix<f64>,
) -> DMatrix<f64> {
    let cross = picked(gram, 0..n, pick);
    // cross^T W and its transpose, and W^T G W, in one product: W^T (G W - 2 cross)
    let mut inner = -2.0 * cross;
    inner.gemm(1.0, &gram.view((0, 0), (n, n)), w, 1.0);
    let mut out = both(gram, pick);
    out.gemm(1.0, &w.transpose(), &inner, 1.0);
    // the product above is symmetric but for its cross term
    symmetric(out)
}

/// Mean of a matrix and its transpose.
pub(super) fn symmetric(mut m: DMatrix<f64>) -> DMatrix<f64> {
    for j in 0..m.ncols() {
        for i in 0..j {
            let mean = 0.5 * (m[(i, j)] + m[(j, i)]);
            m[(i, j)] = mean;
            m[(j, i)] = mean;
        }
    }
    m
}

/// Columns `pick` of some rows.
pub(super) fn picked(gram: &DMatrix<f64>, rows: Range<usize>, pick: &[usize]) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(rows.len(), pick.len());
    for (&column, mut out) in pick.iter().zip(out.column_iter_mut()) {
        out.copy_from(&gram.column(column).rows(rows.start, rows.len()));
    }
    out
}

/// Rows and columns `pick`: candidates in one run, then a residual.
pub(super) fn both(gram: &DMatrix<f64>, pick: &[usize]) -> DMatrix<f64> {
    let run = pick.len() - 1;
    let first = pick[0];
    let mut out = DMatrix::zeros(pick.len(), pick.len());
    for (&column, mut out) in pick.iter().zip(out.column_iter_mut()) {
        let from = gram.column(column);
        out.rows_mut(0, run).copy_from(&from.rows(first, run));
        out[run] = from[pick[run]];
    }
    out
}

/// Squared error of a block: `[-beta, 1] G [-beta, 1]^T`.
pub(super) fn quadratic(gram: &DMatrix<f64>, set: &[usize], beta: &DVector<f64>) -> f64 {
    let last = gram.ncols() - 1;
    let mut error = gram[(last, last)];
    for (i, &a) in set.iter().enumerate() {
        error -= 2.0 * beta[i] * gram[(a, last)];
        for (j, &b) in set.iter().enumerate() {
            error += beta[i] * beta[j] * gram[(a, b)];
        }
    }
    error.max(0.0)
}
