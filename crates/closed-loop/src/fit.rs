//! Out-of-fold fits and honest variances, all from the block Grams.
//!
//! With nuisance columns n (prior precision L), candidate columns c and the
//! residual r, the nuisance is eliminated exactly (Schur complement):
//!
//! ```text
//! W = (G_nn + L)^-1 G_n,[c r]      T = [ -W ; I ]
//! S = G_cc - G_cn W_c              s = G_cr - G_cn W_r        beta = S^-1 s
//! ```
//!
//! G is the sum over the training blocks. A held-out block b is judged with the
//! nuisance *and* the amplitudes of the others: its squared error is the
//! quadratic form of `[-beta, 1]` in `T^T G_b T`. The variance of beta is
//! cluster-robust over blocks, which stays right when the leftovers are coloured
//! on times shorter than a block and whatever the true noise level is:
//!
//! ```text
//! V = S^-1 (sum_b s_b s_b^T + v (S - sum_b S_b)) S^-1,   s_b = the score of block b at beta
//! F = (B - p) / (p (B - 1)) beta^T V^-1 beta ~ F(p, B - p)    (Hotelling)
//! ```
//!
//! `S - sum_b S_b` is what the prior of the nuisance adds: a drawn distortion is
//! one draw for all blocks, and its share of the score shows in none of them.
//! Few blocks, or a column that lives in few of them, make V too small by chance:
//! neither the standard error nor the p-value is let below that of white noise,
//! v S^-1 and chi-squared.
//!
//! Frames that share nothing in time have independent noise but for what the data
//! says otherwise: there v S^-1 enters V as a prior that counts for `d` blocks,
//!
//! ```text
//! V' = (d v S^-1 + (B - 1) V) / (d + B - 1)      and B + d takes the place of B in F
//! ```
//!
//! Source: Liang & Zeger 1986 (cluster-robust variance); Hotelling 1931; Smyth 2004
//! (moderated variance).

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use crate::folds::Folds;
use crate::gram::BlockGrams;

/// The columns of a Gram matrix, in their order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layout {
    /// Prior precision of each nuisance column, 1/variance in the unit of the
    /// column's amplitude; zero leaves it free.
    pub(crate) nuisance_precision: Vec<f64>,
    /// How many candidate columns follow the nuisance.
    pub(crate) candidates: usize,
    /// Residual columns: one, or one per fold and a last one for all data, where
    /// the centroids themselves depend on what was learned outside the fold.
    pub(crate) residuals: usize,
}

impl Layout {
    /// Candidate columns and the residual of `fold`.
    fn picked(&self, fold: Option<usize>) -> Vec<usize> {
        let n = self.nuisance_precision.len();
        (n..n + self.candidates)
            .chain([self.residual(fold)])
            .collect()
    }

    /// The residual column that belongs to `fold` (`None`: all data).
    pub(crate) fn residual(&self, fold: Option<usize>) -> usize {
        let first = self.nuisance_precision.len() + self.candidates;
        match fold {
            _ if self.residuals == 1 => first,
            Some(f) => first + f,
            None => first + self.residuals - 1,
        }
    }
}

/// The nuisance eliminated on one training set.
#[derive(Clone, Debug)]
struct Eliminated {
    /// W: nuisance amplitudes of each candidate column and of the residual, last.
    nuisance: DMatrix<f64>,
    /// Training Gram of the candidates and the residual (last), nuisance removed.
    train: DMatrix<f64>,
    /// ln det of the nuisance's normal matrix.
    log_det: f64,
    /// Training scalars.
    scalars: f64,
    /// Training scalars less the nuisance freedom.
    freedom: f64,
    /// Gram of what is judged in the transformed columns, and its scalars.
    blocks: Vec<(DMatrix<f64>, f64)>,
}

impl Eliminated {
    fn new(
        grams: &BlockGrams,
        layout: &Layout,
        variance: f64,
        fold: Option<usize>,
        train: impl Fn(usize) -> bool,
        judged: impl Fn(usize) -> bool + Sync,
    ) -> Option<Self> {
        let n = layout.nuisance_precision.len();
        let (gram, scalars) = grams.sum(train);
        let pick = layout.picked(fold);
        let mut normal = gram.view((0, 0), (n, n)).into_owned();
        // A column that nothing constrains (a gauge freedom, a star never seen in
        // training) gets a precision far below what one scalar of data brings.
        let floor = 1e-10 * normal.diagonal().max().max(f64::MIN_POSITIVE);
        for (k, &precision) in layout.nuisance_precision.iter().enumerate() {
            normal[(k, k)] += precision * variance + floor;
        }
        let cross = picked(&gram, 0..n, &pick);
        let (nuisance, log_det) = if n == 0 {
            (cross.clone(), 0.0)
        } else {
            let factor = Cholesky::new(normal)?;
            (factor.solve(&cross), factor.ln_determinant())
        };
        let mut reduced = both(&gram, &pick);
        reduced.gemm(-1.0, &cross.transpose(), &nuisance, 1.0);
        let blocks = (0..grams.gram.len())
            .into_par_iter()
            .filter(|&b| judged(b))
            .map(|b| {
                let gram = transformed(&grams.gram[b], n, &pick, &nuisance);
                (gram, grams.scalars[b])
            })
            .collect();
        // Columns under a tight prior cost less than one degree of freedom each;
        // counting them whole is the cautious side.
        let freedom = (scalars - n as f64).max(1.0);
        Some(Self {
            nuisance,
            train: reduced,
            log_det,
            scalars,
            freedom,
            blocks,
        })
    }

    /// Amplitudes of the candidate columns `set`, with prior precisions.
    fn amplitudes(&self, set: &[usize]) -> Option<(DVector<f64>, Cholesky<f64, Dyn>)> {
        let last = self.train.ncols() - 1;
        let normal = DMatrix::from_fn(set.len(), set.len(), |i, j| self.train[(set[i], set[j])]);
        let score = DVector::from_fn(set.len(), |i, _| self.train[(set[i], last)]);
        if (0..set.len()).any(|i| normal[(i, i)].is_nan() || normal[(i, i)] <= 0.0) {
            return None;
        }
        let factor = Cholesky::new(normal.clone())?;
        // Collinear within rounding: the set cannot be told apart in this data.
        let pivots = factor.l_dirty();
        for i in 0..set.len() {
            if pivots[(i, i)] * pivots[(i, i)] < 1e-9 * normal[(i, i)] {
                return None;
            }
        }
        let beta = factor.solve(&score);
        Some((beta, factor))
    }
}

/// `T^T G T` for `T = [-W; I]` over the picked columns.
fn transformed(gram: &DMatrix<f64>, n: usize, pick: &[usize], w: &DMatrix<f64>) -> DMatrix<f64> {
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
fn symmetric(mut m: DMatrix<f64>) -> DMatrix<f64> {
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
fn picked(gram: &DMatrix<f64>, rows: Range<usize>, pick: &[usize]) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(rows.len(), pick.len());
    for (&column, mut out) in pick.iter().zip(out.column_iter_mut()) {
        out.copy_from(&gram.column(column).rows(rows.start, rows.len()));
    }
    out
}

/// Rows and columns `pick`: candidates in one run, then a residual.
fn both(gram: &DMatrix<f64>, pick: &[usize]) -> DMatrix<f64> {
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

/// What a set of candidate columns does outside the folds it was fitted on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OutOfFold {
    /// Squared error of each block, predicted from the other folds.
    pub(crate) sse: Vec<f64>,
    /// Log-likelihood of each block, nats, noise variance from the other folds.
    pub(crate) loglik: Vec<f64>,
    /// Scalars of each block.
    pub(crate) scalars: Vec<f64>,
}

impl OutOfFold {
    pub(crate) fn total_loglik(&self) -> f64 {
        self.loglik.iter().sum()
    }

    pub(crate) fn total_sse(&self) -> f64 {
        self.sse.iter().sum()
    }
}

/// A set of amplitudes from all data with their cluster-robust covariance.
#[derive(Clone, Debug)]
pub(crate) struct Estimate {
    /// One amplitude a column of the set.
    pub(crate) value: DVector<f64>,
    /// Its cluster-robust covariance.
    pub(crate) covariance: DMatrix<f64>,
    /// Its covariance if the noise were white.
    pub(crate) white: DMatrix<f64>,
    /// Blocks behind the covariance, those that its prior counts for included.
    pub(crate) blocks: f64,
}

impl Estimate {
    /// Probability that amplitudes `which` (positions in the set) are all zero
    /// and yet as far from it as this.
    pub(crate) fn p_value(&self, which: &[usize]) -> f64 {
        let (p, b) = (which.len() as f64, self.blocks);
        if which.is_empty() || b <= p {
            return 1.0;
        }
        let (Some(robust), Some(white)) = (
            self.distance(&self.covariance, which),
            self.distance(&self.white, which),
        ) else {
            return 1.0;
        };
        let f = (b - p) / (p * (b - 1.0)) * robust;
        let hotelling = FisherSnedecor::new(p, b - p).map_or(1.0, |law| law.sf(f));
        hotelling.max(ChiSquared::new(p).map_or(1.0, |law| law.sf(white)))
    }

    /// Squares that amplitudes `which` take away, over the variance of white noise.
    pub(crate) fn square(&self, which: &[usize]) -> f64 {
        self.distance(&self.white, which).unwrap_or(0.0)
    }

    /// Squared distance of amplitudes `which` from zero in the metric of `covariance`.
    fn distance(&self, covariance: &DMatrix<f64>, which: &[usize]) -> Option<f64> {
        let value = DVector::from_fn(which.len(), |i, _| self.value[which[i]]);
        let part = DMatrix::from_fn(which.len(), which.len(), |i, j| {
            covariance[(which[i], which[j])]
        });
        Some(value.dot(&Cholesky::new(part)?.solve(&value)))
    }

    /// The cluster-robust covariance with no variance below that of white noise.
    pub(crate) fn cautious_covariance(&self) -> DMatrix<f64> {
        let stretch =
            |k: usize| self.sigma(k) / self.covariance[(k, k)].sqrt().max(f64::MIN_POSITIVE);
        DMatrix::from_fn(self.value.len(), self.value.len(), |i, j| {
            stretch(i) * self.covariance[(i, j)] * stretch(j)
        })
    }

    /// Standard error of amplitude `k`.
    pub(crate) fn sigma(&self, k: usize) -> f64 {
        self.covariance[(k, k)]
            .max(self.white[(k, k)])
            .max(0.0)
            .sqrt()
    }
}

/// All fits that selection needs, on one set of Grams.
#[derive(Clone, Debug)]
pub(crate) struct Fits {
    folds: Vec<Eliminated>,
    all: Eliminated,
    blocks: usize,
    /// [`Folds::prior_blocks`].
    prior: f64,
}

impl Fits {
    /// Eliminates the nuisance in every fold and on all data. `variance` is the
    /// noise variance of a scalar, which turns prior precisions into the unit of
    /// the Gram. `None` if the nuisance itself is singular.
    pub(crate) fn new(
        grams: &BlockGrams,
        folds: &Folds,
        layout: &Layout,
        variance: f64,
    ) -> Option<Self> {
        let of = &folds.fold_of_block;
        let by_fold = (0..folds.count)
            .into_par_iter()
            .map(|f| {
                Eliminated::new(
                    grams,
                    layout,
                    variance,
                    Some(f),
                    |b| of[b] != f,
                    |b| of[b] == f,
                )
            })
            .collect::<Option<Vec<_>>>()?;
        let all = Eliminated::new(grams, layout, variance, None, |_| true, |_| true)?;
        Some(Self {
            folds: by_fold,
            all,
            blocks: of.len(),
            prior: folds.prior_blocks,
        })
    }

    /// Noise variance of a scalar where no candidate is in the model, from a first guess.
    pub(crate) fn noise_alone(grams: &BlockGrams, layout: &Layout, guess: f64) -> Option<f64> {
        let n = layout.nuisance_precision.len();
        let (whole, scalars) = grams.sum(|_| true);
        let alone = BlockGrams {
            gram: vec![
                whole
                    .remove_columns(n, layout.candidates)
                    .remove_rows(n, layout.candidates),
            ],
            scalars: vec![scalars],
            log_scale: 0.0,
        };
        let layout = Layout {
            candidates: 0,
            ..layout.clone()
        };
        Self::whole(&alone, &layout, guess)?.variance(&[])
    }

    /// As [`new`](Self::new), on all data alone: for what asks nothing of the folds.
    pub(crate) fn whole(grams: &BlockGrams, layout: &Layout, variance: f64) -> Option<Self> {
        let all = Eliminated::new(grams, layout, variance, None, |_| true, |_| false)?;
        Some(Self {
            folds: Vec::new(),
            all,
            blocks: grams.gram.len(),
            prior: 0.0,
        })
    }

    /// Amplitudes of nuisance and candidate columns `set`, from all data.
    pub(crate) fn solution(&self, set: &[usize]) -> Option<DVector<f64>> {
        let (beta, _) = self.all.amplitudes(set)?;
        let nuisance = self.nuisance(None, set, &beta);
        Some(DVector::from_iterator(
            nuisance.len() + beta.len(),
            nuisance.iter().chain(beta.iter()).copied(),
        ))
    }

    /// Out-of-fold error of the candidate columns `set`; `None` if they cannot
    /// be told apart in some fold.
    pub(crate) fn out_of_fold(&self, set: &[usize]) -> Option<OutOfFold> {
        let (mut sse, mut loglik, mut count) = (Vec::new(), Vec::new(), Vec::new());
        for fold in &self.folds {
            let (beta, _) = fold.amplitudes(set)?;
            let last = fold.train.ncols() - 1;
            let train_sse = fold.train[(last, last)]
                - (0..set.len())
                    .map(|i| beta[i] * fold.train[(set[i], last)])
                    .sum::<f64>();
            let variance =
                (train_sse / (fold.freedom - set.len() as f64).max(1.0)).max(f64::MIN_POSITIVE);
            for (gram, scalars) in &fold.blocks {
                let error = quadratic(gram, set, &beta);
                sse.push(error);
                count.push(*scalars);
                loglik.push(
                    -0.5 * (scalars * (std::f64::consts::TAU * variance).ln() + error / variance),
                );
            }
        }
        Some(OutOfFold {
            sse,
            loglik,
            scalars: count,
        })
    }

    /// Log-likelihood of all data at the best amplitudes of `set`, the nuisance
    /// integrated out under its prior; scalars have unit variance. Up to a constant
    /// of the prior, nats.
    pub(crate) fn log_marginal(&self, set: &[usize]) -> Option<f64> {
        let sse = self.error(set)?;
        let constant = self.all.scalars * std::f64::consts::TAU.ln();
        Some(-0.5 * (sse + self.all.log_det + constant))
    }

    /// Amplitudes of `set` in fold `fold`'s training data.
    pub(crate) fn amplitudes_without(&self, fold: usize, set: &[usize]) -> Option<DVector<f64>> {
        self.folds[fold].amplitudes(set).map(|(beta, _)| beta)
    }

    /// Nuisance amplitudes that go with `beta` on `set`, in fold `fold`'s
    /// training data (`None`: all data).
    pub(crate) fn nuisance(
        &self,
        fold: Option<usize>,
        set: &[usize],
        beta: &DVector<f64>,
    ) -> DVector<f64> {
        let eliminated = fold.map_or(&self.all, |f| &self.folds[f]);
        let mut nuisance = eliminated
            .nuisance
            .column(eliminated.nuisance.ncols() - 1)
            .into_owned();
        for (i, &c) in set.iter().enumerate() {
            nuisance.axpy(-beta[i], &eliminated.nuisance.column(c), 1.0);
        }
        nuisance
    }

    /// Joint estimate of `set` on all data.
    pub(crate) fn estimate(&self, set: &[usize]) -> Option<Estimate> {
        let (value, factor) = self.all.amplitudes(set)?;
        let last = self.all.train.ncols() - 1;
        let p = set.len();
        let mut spread = DMatrix::zeros(p, p);
        for (gram, _) in &self.all.blocks {
            let score = DVector::from_fn(p, |i, _| {
                gram[(set[i], last)]
                    - (0..p)
                        .map(|j| gram[(set[i], set[j])] * value[j])
                        .sum::<f64>()
            });
            spread.ger(1.0, &score, &score, 1.0);
        }
        let b = self.blocks as f64;
        // Small-sample factor of the cluster-robust variance.
        spread *= b / (b - 1.0).max(1.0);
        let variance = self.variance(set)?;
        for i in 0..p {
            for j in 0..p {
                let own: f64 = self
                    .all
                    .blocks
                    .iter()
                    .map(|(gram, _)| gram[(set[i], set[j])])
                    .sum();
                spread[(i, j)] += variance * (self.all.train[(set[i], set[j])] - own);
            }
        }
        let inverse = factor.inverse();
        let robust = &inverse * spread * &inverse;
        let white = inverse * variance;
        let (d, freedom) = (self.prior, (b - 1.0).max(0.0));
        let covariance = if d > 0.0 {
            (&white * d + robust * freedom) / (d + freedom)
        } else {
            robust
        };
        Some(Estimate {
            value,
            covariance,
            white,
            blocks: b + d,
        })
    }

    /// Correlation between two columns once the nuisance is out: how alike two
    /// one-parameter effects look in this data.
    pub(crate) fn likeness(&self, a: usize, b: usize) -> f64 {
        let s = &self.all.train;
        let norm = (s[(a, a)] * s[(b, b)]).sqrt();
        if norm > 0.0 { s[(a, b)] / norm } else { 0.0 }
    }

    /// What is left of a column's squared length once the nuisance is out, as a
    /// share of `whole`, its squared length before: near zero, it is unobservable.
    pub(crate) fn information(&self, c: usize) -> f64 {
        self.all.train[(c, c)]
    }

    /// Noise variance of a scalar on all data with `set` in the model.
    pub(crate) fn variance(&self, set: &[usize]) -> Option<f64> {
        Some(self.error(set)? / (self.all.freedom - set.len() as f64).max(1.0))
    }

    /// Squared error of all data at the best amplitudes of `set`.
    pub(crate) fn error(&self, set: &[usize]) -> Option<f64> {
        let (beta, _) = self.all.amplitudes(set)?;
        let last = self.all.train.ncols() - 1;
        let explained: f64 = (0..set.len())
            .map(|i| beta[i] * self.all.train[(set[i], last)])
            .sum();
        Some(self.all.train[(last, last)] - explained)
    }
}

/// Squared error of a block: `[-beta, 1] G [-beta, 1]^T`.
fn quadratic(gram: &DMatrix<f64>, set: &[usize], beta: &DVector<f64>) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gram::Design;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// One scalar a frame: two nuisance columns, three candidates, one residual.
    struct Table(DMatrix<f64>);

    impl Design for Table {
        fn width(&self) -> usize {
            self.0.ncols()
        }
        fn fill(&self, frames: Range<usize>, out: &mut DMatrix<f64>) -> usize {
            *out = self.0.rows(frames.start, frames.len()).into_owned();
            frames.len()
        }
    }

    /// Smooth regressors; AR(1) noise of correlation `rho`; the first candidate acts with `size`.
    fn table(frames: usize, rho: f64, size: f64, seed: u64) -> Table {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let phase: Vec<f64> = (0..3).map(|_| 3.0 * normal()).collect();
        let mut noise = normal();
        let mut out = DMatrix::zeros(frames, 6);
        for k in 0..frames {
            let t = k as f64 / frames as f64;
            noise = rho * noise + (1.0 - rho * rho).sqrt() * normal();
            out[(k, 0)] = 1.0;
            out[(k, 1)] = t;
            for c in 0..3 {
                out[(k, 2 + c)] = (40.0 * (c as f64 + 1.0) * t + phase[c]).sin();
            }
            out[(k, 5)] = 0.7 - 0.3 * t + size * out[(k, 2)] + noise;
        }
        Table(out)
    }

    fn fits(table: &Table, precision: [f64; 2]) -> (Fits, Folds) {
        let folds = Folds::cut(table.0.nrows());
        let grams = BlockGrams::accumulate(table, &folds);
        let layout = Layout {
            nuisance_precision: precision.to_vec(),
            candidates: 3,
            residuals: 1,
        };
        (Fits::new(&grams, &folds, &layout, 1.0).unwrap(), folds)
    }

    /// The same numbers by brute force: solve on four folds, predict the fifth.
    #[test]
    fn out_of_fold_error_equals_a_direct_fit() {
        let table = table(400, 0.0, 1.0, 1);
        let precision = [0.0, 25.0];
        let (fits, folds) = fits(&table, precision);
        let fold = folds.fold_of_frame();
        let mut direct = 0.0;
        for f in 0..5 {
            let train: Vec<usize> = (0..400).filter(|&k| fold[k] != f).collect();
            let a = DMatrix::from_fn(train.len(), 4, |i, j| table.0[(train[i], [0, 1, 2, 4][j])]);
            let r = DVector::from_fn(train.len(), |i, _| table.0[(train[i], 5)]);
            let mut normal = a.transpose() * &a;
            normal[(1, 1)] += precision[1];
            let x = normal.lu().solve(&(a.transpose() * r)).unwrap();
            for k in (0..400).filter(|&k| fold[k] == f) {
                let model: f64 = (0..4).map(|j| x[j] * table.0[(k, [0, 1, 2, 4][j])]).sum();
                direct += (table.0[(k, 5)] - model).powi(2);
            }
        }
        let ours = fits.out_of_fold(&[0, 2]).unwrap().total_sse();
        assert!(
            (ours / direct - 1.0).abs() < 1e-9,
            "{ours} against {direct}"
        );
    }

    /// Under noise that is correlated over 8 frames (blocks hold 33) the chance of
    /// p < 0.05 without an effect is 0.05: over 400 seeds its standard error is
    /// 0.011. Ordinary least squares would raise it to about 0.5.
    #[test]
    fn p_values_hold_under_coloured_noise() {
        let alarms = (0..400)
            .filter(|&seed| {
                let (fits, _) = fits(&table(2000, 0.88, 0.0, seed), [0.0; 2]);
                fits.estimate(&[0, 1]).unwrap().p_value(&[0]) < 0.05
            })
            .count();
        let rate = alarms as f64 / 400.0;
        assert!((rate - 0.05).abs() < 5.0 * 0.011, "false alarm rate {rate}");
    }

    /// z of the estimate has unit rms over 300 seeds, to 5/sqrt(600).
    #[test]
    fn sigmas_are_honest_under_coloured_noise() {
        let mut sum = 0.0;
        for seed in 0..300 {
            let (fits, _) = fits(&table(2000, 0.88, 2.0, 1000 + seed), [0.0; 2]);
            let estimate = fits.estimate(&[0]).unwrap();
            sum += ((estimate.value[0] - 2.0) / estimate.sigma(0)).powi(2);
        }
        let rms = (sum / 300.0_f64).sqrt();
        assert!((rms - 1.0).abs() < 5.0 / 600.0_f64.sqrt(), "rms z {rms}");
    }

    #[test]
    fn a_set_that_cannot_be_told_apart_is_refused() {
        let mut table = table(400, 0.0, 1.0, 1);
        let copy = table.0.column(2).into_owned();
        table.0.set_column(3, &(2.0 * copy));
        let (fits, _) = fits(&table, [0.0; 2]);
        assert!(fits.estimate(&[0]).is_some());
        assert!(fits.estimate(&[0, 1]).is_none());
    }
}
