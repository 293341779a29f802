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
//! quadratic form of `[-beta, 1]` in `T^T G_b T`. Nuisance that lives in the fold alone (the direction of
//! a star that is seen at no other time) is the fold's own: the others know nothing of it, nor of how what they
//! know in [`pieces`] fits together. The likelihood
//! takes account of how well all these are known,
//!
//! ```text
//! ln p(b | others) = Z(all) - Z(others)      Z = -(E/v + ln det(G_nn + L) + ln det(S + S_all/N)) / 2
//! ```
//!
//! with E the least error under the priors and N the number of scalars: the prior of the amplitudes is
//! worth one of them. The variance of beta is cluster-robust over blocks, which stays right when the
//! leftovers are coloured on times shorter than a block and whatever the true noise level is:
//!
//! ```text
//! V = S^-1 (g sum_b s_b s_b^T + v (S - sum_b S_b)) S^-1,   s_b = the score of block b at beta
//! B = 1 / sum_b t_b^2,   t_b = mean over the diagonal of S_b / S, less its sum,   g = B / (B - 1)
//! ```
//!
//! with B the number of blocks that hold the information: not all do where the motion
//! comes in slews. Where the data is also cut by what was measured ([`BlockGrams::by_source`]), those parts are the
//! blocks of all columns of which they hold the information more evenly: a few dozen frames have five blocks in time,
//! and of a trend two.
//!
//! How much wider than under white noise, m = eigenvalues of V over v S^-1, is known far
//! better on average over p parameters than for each alone: p (B - 1) squares tell it
//! instead of B - p. So beta is measured by white noise, and that by the mean of m,
//!
//! ```text
//! Q = beta^T S beta / v      Q / sum m ~ F(p e, p e (B - 1)),   e = (sum m)^2 / (p sum m^2)
//! ```
//!
//! and, where the m are unequal, no tail is let below that of the widest alone. Hotelling's
//! T^2, which asks for all of V, loses a tenth of six-parameter effects of six standard errors.
//!
//! `S - sum_b S_b` is what the prior of the nuisance adds: a drawn distortion is
//! one draw for all blocks, and its share of the score shows in none of them.
//! Few blocks, or a column that lives in few of them, make V too small by chance:
//! neither the standard error nor the p-value is let below that of white noise,
//! v S^-1 and chi-squared of Q.
//!
//! What all columns say of m ([`moderation`]) enters V as a prior that counts for `d` blocks,
//!
//! ```text
//! V' = (d m_0 v S^-1 + (B - 1) V) / (d + B - 1)      and B + d takes the place of B in F
//! ```
//!
//! Frames that share nothing in time have independent noise but for what the data
//! says otherwise: there d is given, with 1 for `m_0`.
//!
//! Source: Geisser & Eddy 1979 (predictive likelihood); Kass & Wasserman 1995 (a prior worth one
//! observation); Liang & Zeger 1986 (cluster-robust variance); Smyth 2004 (moderated variance);
//! Box 1954 and Greenhouse & Geisser 1959 (F of unequal variances).

use std::ops::Range;
use std::sync::OnceLock;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::folds::Folds;
use crate::gram::{BlockGrams, FoldSums, Gram};
use crate::symmetric::Symmetric;

mod alone;
mod elimination;
mod estimate;
mod moderation;
mod out_of_fold;
mod pieces;
#[cfg(test)]
mod tests;

use elimination::{Eliminated, less_into, quadratic, symmetric, transformed};
pub use estimate::Estimate;
use moderation::Usual;
pub use out_of_fold::OutOfFold;
use out_of_fold::gaussian;

/// Share of a column's squared length that has to be left: near zero, it is unobservable.
const OBSERVABLE_SHARE: f64 = 1e-7;
/// Share of the nuisance's priors that is left where it is as good as free.
const FREE: f64 = 1e-4;
/// Share of a nuisance column's squared length outside a fold below which it lives in the fold alone.
const UNSEEN: f64 = 1e-9;

/// The columns of a Gram matrix, in their order: nuisance, candidates, residuals.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// Prior precision of the nuisance columns' amplitudes, the inverse of their covariance; zero leaves them free.
    pub nuisance_precision: DMatrix<f64>,
    /// Nuisance columns that are told by one another alone, as directions of stars are in frames with attitudes of their
    /// own.
    pub relative: Range<usize>,
    /// How many candidate columns follow the nuisance.
    pub candidates: usize,
    /// Residual columns: one, or one per fold and a last one for all data, where
    /// what was measured depends on what was learned outside the fold.
    pub residuals: usize,
}

impl Layout {
    /// Candidate columns and the residual of `fold`.
    fn picked(&self, fold: Option<usize>) -> Vec<usize> {
        let n = self.nuisance_precision.nrows();
        (n..n + self.candidates)
            .chain([self.residual(fold)])
            .collect()
    }

    /// What a `gram` has of the nuisance.
    fn nuisance(&self, gram: &DMatrix<f64>) -> DMatrix<f64> {
        let n = self.nuisance_precision.nrows();
        gram.view((0, 0), (n, n)).into_owned()
    }

    /// Squared length of each candidate column.
    fn raw(&self, gram: &DMatrix<f64>) -> Vec<f64> {
        let n = self.nuisance_precision.nrows();
        (n..n + self.candidates).map(|c| gram[(c, c)]).collect()
    }

    /// Gram of the candidates in a `total` of these columns, and its scalars, once the nuisance is out; `variance` as
    /// of [`Fits::new`]. `None` if the nuisance itself is singular.
    pub fn without_nuisance(
        &self,
        total: &(DMatrix<f64>, f64),
        variance: f64,
    ) -> Option<DMatrix<f64>> {
        let n = self.nuisance_precision.nrows();
        let pick: Vec<usize> = (n..n + self.candidates).collect();
        Some(Eliminated::new(total, self, variance, &pick)?.train)
    }

    /// The residual column that belongs to `fold` (`None`: all data).
    pub fn residual(&self, fold: Option<usize>) -> usize {
        let first = self.nuisance_precision.nrows() + self.candidates;
        match fold {
            _ if self.residuals == 1 => first,
            Some(f) => first + f,
            None => first + self.residuals - 1,
        }
    }

    /// Mean square of the residual before anything is out, from its Gram and its scalars.
    fn residual_variance(&self, (gram, scalars): &(DMatrix<f64>, f64)) -> f64 {
        let k = self.residual(None);
        gram[(k, k)] / scalars.max(1.0)
    }
}

/// All fits that a choice among candidates needs, on one set of Grams.
///
/// A `set` holds numbers of candidate columns, each once, from 0 on.
#[derive(Clone, Debug)]
pub struct Fits {
    layout: Layout,
    folds: Vec<Eliminated>,
    /// Gram of each fold in the columns of its fit, and its scalars.
    held: Vec<(DMatrix<f64>, f64)>,
    all: Eliminated,
    /// All data with the residual of each fold, where each has its own.
    whole: Vec<Eliminated>,
    /// All data where the nuisance is as good as free.
    free: Option<Eliminated>,
    grams: BlockGrams,
    fold_of_block: Vec<usize>,
    /// `G W - 2 G_nc` of each block with W of all data: what makes T^T G T of any few columns.
    inner: Vec<DMatrix<f64>>,
    /// The same of each part by source.
    inner_by_source: Vec<DMatrix<f64>>,
    /// Gram of the nuisance columns, all data.
    nuisance_gram: DMatrix<f64>,
    /// Squared length of each candidate column before the nuisance is out.
    raw: Vec<f64>,
    /// Noise variance that is held for least.
    least: f64,
    /// [`Folds::prior_blocks`].
    prior: f64,
    /// What all columns say of the noise, once it is asked for.
    usual: OnceLock<Usual>,
}

/// Amplitudes and how they scatter from block to block.
struct Scatter {
    value: DVector<f64>,
    /// V of the module's header.
    robust: DMatrix<f64>,
    white: DMatrix<f64>,
    /// Blocks that hold the information.
    blocks: f64,
}

/// The blocks' shares of an information.
#[derive(Default)]
struct Shares {
    sum: f64,
    squares: f64,
}

impl Shares {
    fn add(&mut self, share: f64) {
        self.sum += share;
        self.squares += share * share;
    }

    /// As many equal blocks would hold as much.
    fn blocks(&self) -> f64 {
        self.sum * self.sum / self.squares.max(f64::MIN_POSITIVE)
    }

    /// By how much the squares of scores are too small, of which the amplitudes take their part in every block.
    fn widening(&self) -> f64 {
        let blocks = self.blocks();
        blocks / (blocks - 1.0).max(1.0)
    }
}

impl Fits {
    /// Eliminates the nuisance in every fold and on all data. `variance` is the
    /// noise variance of a scalar, which turns prior precisions into the unit of
    /// the Gram. `None` if the nuisance itself is singular. `grams` and `folds` have
    /// the same blocks.
    pub fn new(grams: &BlockGrams, folds: &Folds, layout: &Layout, variance: f64) -> Option<Self> {
        Self::of(grams, &grams.by_fold(folds), folds, layout, variance)
    }

    /// As [`new`](Self::new) where the sums over the folds are there already.
    pub fn of(
        grams: &BlockGrams,
        sums: &FoldSums,
        folds: &Folds,
        layout: &Layout,
        variance: f64,
    ) -> Option<Self> {
        let n = layout.nuisance_precision.nrows();
        let pick = layout.picked(None);
        let of_fold = |f: usize| {
            let pick = layout.picked(Some(f));
            let train = sums.without(f);
            let mut fold = Eliminated::new(&train, layout, variance, &pick)?;
            let (own, scalars) = &sums.fold[f];
            let unseen = |&k: &usize| train.0[(k, k)] < UNSEEN * own[(k, k)];
            let mut alone = pieces::apart(&train.0, own, layout.relative.clone());
            alone.extend((0..n).filter(unseen));
            alone.sort_unstable();
            alone.dedup();
            if !alone.is_empty() {
                fold.learn(&alone, own, &pick)?;
            }
            let held = transformed(own, n, &pick, &fold.nuisance);
            Some((fold, (held, *scalars)))
        };
        let of_all = |variance: f64| Eliminated::new(&sums.all, layout, variance, &pick);
        let (by_fold, (all, free)) = rayon::join(
            || {
                let folds = (0..folds.count).into_par_iter();
                folds.map(of_fold).collect::<Option<Vec<_>>>()
            },
            || rayon::join(|| of_all(variance), || of_all(FREE * variance)),
        );
        let (by_fold, held) = by_fold?.into_iter().unzip();
        let (all, free) = (all?, free?);
        let own_residuals = if layout.residuals == 1 {
            0
        } else {
            folds.count
        };
        let whole = (0..own_residuals)
            .map(|f| Eliminated::new(&sums.all, layout, variance, &layout.picked(Some(f))))
            .collect::<Option<Vec<_>>>()?;
        let [inner, inner_by_source] = [&grams.gram, &grams.by_source].map(|cut| {
            let blocks = cut.par_iter();
            blocks.map(|g| g.inner(&all.nuisance, &pick)).collect()
        });
        Some(Self {
            layout: layout.clone(),
            folds: by_fold,
            held,
            all,
            whole,
            free: Some(free),
            grams: grams.clone(),
            fold_of_block: folds.fold_of_block.clone(),
            inner,
            inner_by_source,
            nuisance_gram: layout.nuisance(&sums.all.0),
            raw: layout.raw(&sums.all.0),
            least: out_of_fold::least_variance(layout.residual_variance(&sums.all)),
            prior: folds.prior_blocks,
            usual: OnceLock::new(),
        })
    }

    /// The same data where the noise that the priors are weighed against has another `variance`.
    pub fn reweighed(&self, folds: &Folds, variance: f64) -> Option<Self> {
        Self::new(&self.grams, folds, &self.layout, variance)
    }

    /// Noise variance of a scalar beside the candidate columns `set` alone, as far as they show, where priors are weighed
    /// against `variance`. `total`: the sum of all blocks, and its scalars.
    pub fn noise_beside(
        (gram, scalars): &(DMatrix<f64>, f64),
        layout: &Layout,
        set: &[usize],
        variance: f64,
    ) -> Option<f64> {
        let n = layout.nuisance_precision.nrows();
        let residuals = n + layout.candidates..gram.ncols();
        let candidates = set.iter().map(|c| n + c);
        let kept: Vec<usize> = (0..n).chain(candidates).chain(residuals).collect();
        let alone = gram.select_columns(&kept).select_rows(&kept);
        let layout = Layout {
            candidates: set.len(),
            ..layout.clone()
        };
        let alone = BlockGrams::whole(Symmetric::of_lower(&alone), *scalars);
        let fits = Self::whole(&alone, &layout, variance)?;
        let shown: Vec<usize> = (0..set.len()).filter(|&c| fits.shows(c)).collect();
        fits.variance(&shown)
    }

    /// As [`new`](Self::new), on all data alone: for what asks nothing of folds and blocks. Neither
    /// [`estimate`](Self::estimate) nor the errors out of fold are to be had then.
    pub fn whole(grams: &BlockGrams, layout: &Layout, variance: f64) -> Option<Self> {
        let total = grams.total();
        let all = Eliminated::new(&total, layout, variance, &layout.picked(None))?;
        Some(Self {
            layout: layout.clone(),
            folds: Vec::new(),
            held: Vec::new(),
            all,
            whole: Vec::new(),
            free: None,
            grams: grams.clone(),
            fold_of_block: Vec::new(),
            inner: Vec::new(),
            inner_by_source: Vec::new(),
            nuisance_gram: layout.nuisance(&total.0),
            raw: layout.raw(&total.0),
            least: out_of_fold::least_variance(layout.residual_variance(&total)),
            prior: 0.0,
            usual: OnceLock::new(),
        })
    }

    /// Amplitudes of all nuisance columns and then of the candidate columns `set`, from all data.
    pub fn solution(&self, set: &[usize]) -> Option<DVector<f64>> {
        let (beta, _) = self.all.amplitudes(set)?;
        let nuisance = self.nuisance(None, set, &beta);
        Some(DVector::from_iterator(
            nuisance.len() + beta.len(),
            nuisance.iter().chain(beta.iter()).copied(),
        ))
    }

    /// What the candidate columns `set` predict, fold by fold; `None` if they cannot be told apart.
    ///
    /// An error is that of the amplitudes which the other folds give
    /// ([`amplitudes_without`](Self::amplitudes_without)). The log-likelihood takes account of how well these
    /// are known: it is that of the fold's data given those of all others, amplitudes and nuisance integrated out,
    /// with a prior on the amplitudes that is worth one scalar of the data. What acts in one fold alone is
    /// not predicted by the others, but not spoiled by noise either. The declared priors of the nuisance
    /// count as one fold more: where the nuisance could imitate an effect, only they tell it.
    pub fn out_of_fold(&self, set: &[usize]) -> Option<OutOfFold> {
        let (ridge, unit) = (self.ridge(set)?, self.unit(set));
        let mut out = OutOfFold::default();
        for (f, fold) in self.folds.iter().enumerate() {
            let with = self.whole.get(f).unwrap_or(&self.all);
            let (with, without) = (with.with_prior(set, &unit)?, fold.with_prior(set, &unit)?);
            let (gram, scalars) = &self.held[f];
            let variance = without.variance(fold, set).max(self.least);
            let loglik = with.beyond(&without, *scalars, variance);
            let beta = fold.shrunk(set, &ridge)?;
            out.add(quadratic(gram, set, &beta), *scalars, loglik);
        }
        if let Some(free) = &self.free {
            let (with, without) = (
                self.all.with_prior(set, &unit)?,
                free.with_prior(set, &unit)?,
            );
            let variance = with.variance(&self.all, set).max(self.least);
            out.prior = with.beyond(&without, 0.0, variance);
        }
        Some(out)
    }

    /// As [`out_of_fold`](Self::out_of_fold), block by block.
    pub fn out_of_fold_by_block(&self, set: &[usize]) -> Option<OutOfFold> {
        let n = self.layout.nuisance_precision.nrows();
        let (ridge, unit) = (self.ridge(set)?, self.unit(set));
        let trained: Vec<(DVector<f64>, f64)> = (0..self.folds.len())
            .map(|f| {
                let fold = &self.folds[f];
                let beta = fold.shrunk(set, &ridge)?;
                let variance = fold.with_prior(set, &unit)?.variance(fold, set);
                let variance = variance.max(self.least);
                let residual = self.layout.residual(Some(f));
                let mut z = DVector::zeros(n + self.layout.candidates + self.layout.residuals);
                z[residual] = 1.0;
                for (&c, b) in set.iter().zip(beta.iter()) {
                    z[n + c] = -b;
                }
                z.rows_mut(0, n).axpy(-1.0, &fold.left(set, &beta), 1.0);
                Some((z, variance))
            })
            .collect::<Option<_>>()?;
        let mut out = OutOfFold::default();
        for (b, &f) in self.fold_of_block.iter().enumerate() {
            let (z, variance) = &trained[f];
            let error = self.grams.gram[b].quadratic(z).max(0.0);
            let scalars = self.grams.scalars[b];
            out.add(error, scalars, gaussian(scalars, error, *variance));
        }
        Some(out)
    }

    /// Log-likelihood of all data at the best amplitudes of `set`, the nuisance
    /// integrated out under its prior; scalars have unit variance. Up to a constant
    /// of the prior, nats.
    pub fn log_marginal(&self, set: &[usize]) -> Option<f64> {
        let sse = self.error(set)?;
        let constant = self.all.scalars * std::f64::consts::TAU.ln();
        Some(-0.5 * (sse + self.all.log_det + constant))
    }

    /// Amplitudes of `set` in the training data of `fold`, all others, under a prior as wide as all data
    /// make each amplitude or leave it uncertain: what acts in one fold alone is noise in the others, many
    /// times as large.
    pub fn amplitudes_without(&self, fold: usize, set: &[usize]) -> Option<DVector<f64>> {
        self.folds[fold].shrunk(set, &self.ridge(set)?)
    }

    /// Precision of a prior on each amplitude, in the unit of the Gram: 1 sigma is its size, or its error
    /// where that is larger.
    fn ridge(&self, set: &[usize]) -> Option<Vec<f64>> {
        let (value, factor) = self.all.amplitudes(set)?;
        let variance = self.all.error(set, &value) / self.all.freedom_beside(set);
        let own = factor.inverse();
        let square = |(i, v): (usize, &f64)| (v * v).max(variance * own[(i, i)]);
        Some(
            value
                .iter()
                .enumerate()
                .map(|v| variance / square(v))
                .collect(),
        )
    }

    /// Precision that is worth one scalar of the data, in the unit of the Gram.
    fn unit(&self, set: &[usize]) -> DMatrix<f64> {
        let scalars = self.all.scalars.max(1.0);
        DMatrix::from_fn(set.len(), set.len(), |i, j| {
            self.all.train[(set[i], set[j])] / scalars
        })
    }

    /// Nuisance amplitudes that go with `beta` on `set`, in the training data of `fold`
    /// (`None`: all data).
    pub fn nuisance(
        &self,
        fold: Option<usize>,
        set: &[usize],
        beta: &DVector<f64>,
    ) -> DVector<f64> {
        let eliminated = fold.map_or(&self.all, |f| &self.folds[f]);
        eliminated.left(set, beta)
    }

    /// Gram matrix of the nuisance columns of all data, without their priors.
    pub fn nuisance_gram(&self) -> &DMatrix<f64> {
        &self.nuisance_gram
    }

    /// Joint estimate of `set` on all data; `None` if its columns cannot be told apart.
    pub fn estimate(&self, set: &[usize]) -> Option<Estimate> {
        if self.inner.len() != self.grams.gram.len() {
            return None;
        }
        let own = self.scatter(set)?;
        let Usual { wider, blocks: d } = if self.prior > 0.0 {
            Usual {
                wider: 1.0,
                blocks: self.prior,
            }
        } else {
            *self.asked()
        };
        let freedom = (own.blocks - 1.0).max(0.0);
        let covariance = if d > 0.0 {
            (&own.white * (d * wider) + own.robust * freedom) / (d + freedom)
        } else {
            own.robust
        };
        Some(Estimate {
            value: own.value,
            covariance,
            white: own.white,
            blocks: own.blocks + d,
        })
    }

    /// Takes what `all` says of the noise for its own: more columns say more.
    pub fn scatter_as(&mut self, all: &Self) {
        self.usual = OnceLock::from(*all.asked());
    }

    /// Asks all columns what they say of the noise, which [`estimate`](Self::estimate) needs: before several threads
    /// estimate at once, so that none waits for one that waits for it.
    pub fn ask_all(&self) {
        if self.prior <= 0.0 && !self.inner.is_empty() {
            self.asked();
        }
    }

    fn asked(&self) -> &Usual {
        self.usual.get_or_init(|| self.usual())
    }

    /// The blocks in time, and the parts by source where there are some.
    fn cuts(&self) -> impl Iterator<Item = (&[Gram], &[DMatrix<f64>])> {
        let in_time = (self.grams.gram.as_slice(), self.inner.as_slice());
        let by_source = (
            self.grams.by_source.as_slice(),
            self.inner_by_source.as_slice(),
        );
        let both = [in_time, by_source].into_iter();
        both.filter(|(blocks, _)| !blocks.is_empty())
    }

    /// Squares of the scores of each block of a cut at `value`, widened, and how many blocks hold the information.
    fn spread(
        &self,
        (blocks, inner): (&[Gram], &[DMatrix<f64>]),
        set: &[usize],
        value: &DVector<f64>,
    ) -> (DMatrix<f64>, f64) {
        let n = self.layout.nuisance_precision.nrows();
        let residual = self.layout.residual(None);
        let p = set.len();
        // M = T^T G T of a block: M_ij = G_ij + (W_i inner_j + inner_i W_j) / 2
        let w = &self.all.nuisance;
        let left = self.all.left(set, value);
        let mut spread = DMatrix::zeros(p, p);
        let mut shares = Shares::default();
        let columns: Vec<usize> = set.iter().map(|c| n + c).collect();
        let mut score = DVector::zeros(p);
        let mut within = DVector::zeros(n);
        for (gram, inner) in blocks.iter().zip(inner) {
            less_into(inner, set, value, &mut within);
            gram.less(residual, &columns, value, &mut score);
            let mut share = 0.0;
            for (i, &c) in set.iter().enumerate() {
                let (nuisance, inner) = (w.column(c), inner.column(c));
                score[i] += 0.5 * (nuisance.dot(&within) + inner.dot(&left));
                let own = gram.at(n + c, n + c) + nuisance.dot(&inner);
                share += own.max(0.0) / self.all.train[(c, c)];
            }
            spread.ger(1.0, &score, &score, 1.0);
            shares.add(share);
        }
        (spread * shares.widening(), shares.blocks())
    }

    fn scatter(&self, set: &[usize]) -> Option<Scatter> {
        let (value, factor) = self.all.amplitudes(set)?;
        let cuts = self.cuts().map(|cut| self.spread(cut, set, &value));
        let (mut spread, blocks) =
            cuts.reduce(|first, other| if other.1 > first.1 { other } else { first })?;
        let variance = self.variance(set)?;
        // S less the sum of M is what the prior adds
        let of_set = self.all.nuisance.select_columns(set);
        spread += of_set.tr_mul(&(&self.all.prior * &of_set)) * variance;
        let inverse = factor.inverse();
        Some(Scatter {
            robust: &inverse * spread * &inverse,
            white: inverse * variance,
            value,
            blocks,
        })
    }

    /// Whether anything is left of a column once the nuisance is out.
    pub fn shows(&self, c: usize) -> bool {
        let raw = self.raw[c];
        raw > 0.0 && self.information(c) > OBSERVABLE_SHARE * raw
    }

    /// Correlation between two candidate columns once the nuisance is out: how alike two
    /// one-parameter effects look in this data.
    pub fn likeness(&self, a: usize, b: usize) -> f64 {
        let s = &self.all.train;
        let norm = (s[(a, a)] * s[(b, b)]).sqrt();
        if norm > 0.0 { s[(a, b)] / norm } else { 0.0 }
    }

    /// What is left of the squared length of a candidate column once the nuisance is out: where that is
    /// next to nothing of what it was before, its amplitude is unobservable.
    pub fn information(&self, c: usize) -> f64 {
        self.all.train[(c, c)]
    }

    /// Noise variance of a scalar on all data with `set` in the model.
    pub fn variance(&self, set: &[usize]) -> Option<f64> {
        Some(self.error(set)? / self.all.freedom_beside(set))
    }

    /// Squared error of all data at the best amplitudes of `set`.
    pub fn error(&self, set: &[usize]) -> Option<f64> {
        let (beta, _) = self.all.amplitudes(set)?;
        Some(self.all.error(set, &beta))
    }
}
