//! A model of the noise of rows, and its likelihood.
//!
//! ```text
//! v    = e^a V 10^(0.4 b (m - 5)) + w R^2             V declared variance, R rate in deg/s
//! q/v ~ chi2_2 with weight 1 - rho - sum rho_d,   q/(v + S^2) ~ chi2_2 with rho,   q/(v + S_d^2) with rho_d
//! ln L = sum ln sum_c pi_c exp(-q / 2 v_c) / v_c
//! ```
//!
//! `a`, the noise level itself, is always free. `rho_d, S_d` are the outliers that
//! the model declares. The covariance of the estimates comes from sums of scores
//! over clusters: blocks of time, or stars,
//!
//! ```text
//! C = H^-1 (sum_c s_c s_c^T) H^-1 n/(n - 1)
//! ```
//!
//! and holds whatever the tails of the noise and the correlation within a cluster.
//!
//! Source: maximum likelihood of a scale mixture; White 1980, Liang & Zeger 1986
//! (sandwich over clusters); Berndt, Hall, Hall & Hausman 1974 (the ascent).

use block_regression::Folds;
use coloured_noise::LogProduct;
use nalgebra::{Cholesky, DMatrix, DVector, SMatrix, SVector};
use pulp::{Arch, NullaryFnOnce};
use rayon::prelude::*;

use super::density::{DECLARED, Lanes, Levels, There};
use super::rows::Row;
use super::squares::SPIKE;

/// Parameters: level a, magnitude b, rate w, share rho (logit), size S^2 (log).
pub(super) const PARAMETERS: usize = 5;
pub(super) const LEVEL: usize = 0;
pub(super) const MAGNITUDE: usize = 1;
pub(super) const RATE: usize = 2;
pub(super) const SHARE: usize = 3;
pub(super) const SIZE: usize = 4;

pub(super) type Vector = SVector<f64, PARAMETERS>;
pub(super) type Matrix = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// 0.4 ln 10: the variance's exponent of a slope and a magnitude.
pub(super) const PER_MAG: f64 = 0.921_034_037_197_618_3;
/// Share of spikes where there are none.
pub(super) const NO_SHARE: f64 = 1e-9;
/// A larger share of rows is not a matter of spikes.
pub(super) const MOST_SHARE: f64 = 0.2;
/// Least size of a spike, sigma of the usual row: smaller is no spike, but noise with tails.
const LEAST_SIZE: f64 = 4.0;
const ROUNDS: usize = 60;
/// Farthest that a round moves the logarithms of share and size. Where there are next to no spikes, nothing bends
/// the likelihood along them, and a step of thousands stops every parameter short of its summit.
const FARTHEST: f64 = 3.0;
/// Nats that a round gains at the summit, and that one more would, as the curvature has it.
const CONVERGED: f64 = 1e-4;
const NEXT_TO_NOTHING: f64 = 1e-5;
/// The same of a fit without one of the folds, whose start lies a fraction of a sigma away: what the curvature has it
/// that a round gains is true but for a tenth or so of itself, and of a gain over all folds a hundredth of a nat says
/// nothing.
const FOLDS_NOTHING: f64 = 3e-3;
/// Rows that are looked at side by side.
const LANES: usize = 8;
/// Pairs of parameters, each with itself too.
const PAIRS: usize = PARAMETERS * (PARAMETERS + 1) / 2;

/// The model: what is given, and the units of its parameters.
#[derive(Clone, Debug)]
pub(super) struct Model {
    /// Usual variance per axis, arcsec^2.
    variance: f64,
    /// Outliers that are declared: share and variance of each kind.
    declared: [[f64; 2]; DECLARED],
}

/// Log-likelihood, gradient, and sum of the outer products of the rows' gradients.
#[derive(Clone, Debug, Default)]
struct Sums {
    value: f64,
    gradient: Vector,
    outer: Matrix,
}

/// Rows whose sums are formed together.
struct Piece<'a> {
    there: &'a There,
    rows: &'a [Row],
    of: &'a (dyn Fn(&Row) -> bool + Sync),
}

impl NullaryFnOnce for Piece<'_> {
    type Output = Sums;

    /// Inlined, so that it is compiled for the registers of the machine.
    #[inline(always)]
    fn call(self) -> Sums {
        let mut levels = Levels::default();
        let mut value = [0.0; LANES];
        let mut product = LogProduct::default();
        let mut gradient = [[0.0; LANES]; PARAMETERS];
        let mut outer = [[0.0; LANES]; PAIRS];
        let mut kept = self.rows.iter().filter(|r| (self.of)(r)).peekable();
        while kept.peek().is_some() {
            let mut lanes = Lanes::<LANES>::of_none();
            let mut filled = 0;
            for row in kept.by_ref().take(LANES) {
                lanes.put(filled, row, levels.own(self.there, row));
                filled += 1;
            }
            let density = self.there.densities(&lanes);
            let slopes = self.there.slopes(&lanes, &density);
            for factor in &density.factor[..filled] {
                product.times(*factor);
            }
            // lanes without a row have no exponent and no slopes
            let mut pair = 0;
            for l in 0..LANES {
                value[l] += density.exponent[l];
            }
            for i in 0..PARAMETERS {
                for l in 0..LANES {
                    gradient[i][l] += slopes[i][l];
                }
                for j in 0..=i {
                    for l in 0..LANES {
                        outer[pair][l] += slopes[i][l] * slopes[j][l];
                    }
                    pair += 1;
                }
            }
        }
        let outer = outer.map(|lanes| lanes.iter().sum::<f64>());
        Sums {
            value: value.iter().sum::<f64>() + product.ln(),
            gradient: gradient.map(|lanes| lanes.iter().sum::<f64>()).into(),
            outer: Matrix::from_fn(|i, j| outer[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)]),
        }
    }
}

/// `step` without more of share and size than a round moves.
fn shortened(mut step: Vector) -> Vector {
    for k in [SHARE, SIZE] {
        step[k] = step[k].clamp(-FARTHEST, FARTHEST);
    }
    step
}

impl Sums {
    fn add(self, other: &Self) -> Self {
        Self {
            value: self.value + other.value,
            gradient: self.gradient + other.gradient,
            outer: self.outer + other.outer,
        }
    }
}

/// A point in the space of parameters with its likelihood.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) at: Vector,
    pub(super) free: [bool; PARAMETERS],
    pub(super) loglik: f64,
}

/// A fold that took no part in a fit.
#[derive(Clone, Debug)]
pub(super) struct Without {
    /// The fit of all others.
    pub(super) others: Fit,
    /// What the fold itself tells where all rows are fitted best: the sum of the outer products of its gradients.
    outer: Matrix,
}

/// What each of these folds tells of parameter `k` of `fit`, if the others are known as well as all rows know them.
pub(super) fn information(folds: &[Without], fit: &Fit, k: usize) -> Vec<f64> {
    let whole: Matrix = folds.iter().map(|f| f.outer).sum();
    let others: Vec<usize> = (0..PARAMETERS)
        .filter(|&j| j != k && fit.free[j] && whole[(j, j)] > 0.0)
        .collect();
    let normal = DMatrix::from_fn(others.len(), others.len(), |i, j| {
        whole[(others[i], others[j])]
    });
    let beside = DVector::from_fn(others.len(), |i, _| whole[(others[i], k)]);
    // the direction in which k moves the rows when the others make up for it
    let mut along = Vector::zeros();
    along[k] = 1.0;
    if let Some(factor) = Cholesky::new(normal) {
        let makes_up = factor.solve(&beside);
        others
            .iter()
            .zip(&makes_up)
            .for_each(|(&j, by)| along[j] = -by);
    }
    folds
        .iter()
        .map(|f| along.dot(&(f.outer * along)))
        .collect()
}

impl Model {
    pub(super) fn new(rows: &[Row], declared: [[f64; 2]; DECLARED]) -> Self {
        let mut ratio: Vec<f64> = rows
            .iter()
            .filter(|r| !r.marked)
            .map(|r| r.level_over(1.0))
            .collect();
        Self {
            // the median of chi2_2 is 2 ln 2
            variance: spectra::robust::median(&mut ratio).unwrap_or(1.0),
            declared: declared.map(|[share, size]| [share, size * size]),
        }
    }

    /// No effect but the level.
    pub(super) fn plain(&self, rows: &[Row]) -> Vector {
        let declared: f64 = rows.iter().map(|r| r.declared).sum::<f64>() / rows.len().max(1) as f64;
        let mut at = Vector::zeros();
        at[LEVEL] = (self.variance / declared).ln();
        at[SHARE] = logit(NO_SHARE);
        at[SIZE] = (100.0 * self.variance).ln();
        at
    }

    /// No effect but spikes, which are the rows that stand out: their share, and their mean square. `None`: none does.
    ///
    /// From far below, the size is not reached: each spike pulls at ln S^2 by q/2S^2, the sum of whose squares passes for
    /// the curvature. A round adds 2 S^4/q to S^2, and all [`ROUNDS`] multiply it by 61 at most, the size by eight. From
    /// above each pulls by one at most.
    pub(super) fn standing_out(&self, rows: &[Row]) -> Option<Vector> {
        let mut at = self.plain(rows);
        let level = at[LEVEL].exp();
        let out = rows
            .iter()
            .filter(|r| r.square > SPIKE * level * r.declared);
        let (count, halves) = out.fold((0.0, 0.0), |(n, sum), r| (n + 1.0, sum + 0.5 * r.square));
        if count == 0.0 {
            return None;
        }
        at[SHARE] = logit(count / rows.len() as f64);
        at[SIZE] = (halves / count).ln();
        Some(self.bounded(&at))
    }

    /// The model at a point.
    fn there(&self, at: &Vector) -> There {
        let share = sigmoid(at[SHARE]);
        let [[first, s1], [second, s2]] = self.declared;
        There {
            level: at[LEVEL],
            slope: PER_MAG * at[MAGNITUDE],
            rate: at[RATE],
            share: [1.0 - share - first - second, share, first, second],
            more: [0.0, at[SIZE].exp(), s1, s2],
        }
    }

    /// What rests on spikes that are too small to be told, as far as sizes are Gaussian: which part of the share they
    /// are, and by how much the logarithm of S^2 were larger without them, as where all spikes are of one size.
    ///
    /// ```text
    /// s = S^2/v,  told from q/2v = h on:  rho e^(-h/(1 + s)) / (1 + s) = (1 - rho) e^-h
    /// part 1 - e^(-h/(1 + s))        those above h have the mean square s + h
    /// ```
    pub(super) fn untold(&self, at: &Vector) -> [f64; 2] {
        let size = at[SIZE].exp() / self.variance;
        let wide = 1.0 + size;
        let from = ((wide.ln() - at[SHARE]) * wide / size).max(0.0);
        [1.0 - (-from / wide).exp(), (from / size).ln_1p()]
    }

    /// Variance of a row, and the probability that it holds no spike.
    pub(super) fn belief(&self, at: &Vector) -> impl Fn(&Row) -> [f64; 2] + use<> {
        let there = self.there(at);
        move |row| {
            let own = row.declared * there.growth(row.mag);
            let sound = there.densities(&Lanes::of(row, own)).posterior[0][0];
            [own + there.rate * row.rate, sound]
        }
    }

    /// Log-likelihood of noise with tails instead of spikes: Student's t in two dimensions,
    /// `-(nu/2 + 1) ln(1 + q/(nu v)) - ln v`, at the best of a grid of freedoms and levels.
    pub(super) fn loglik_of_tails(&self, at: &Vector, rows: &[Row]) -> f64 {
        let there = self.there(at);
        let mut levels = Levels::default();
        let mut variances = LogProduct::default();
        let ratio: Vec<f64> = rows
            .iter()
            .map(|row| {
                let v = levels.own(&there, row) + at[RATE] * row.rate;
                variances.times(v);
                row.square / v
            })
            .collect();
        let grid: Vec<[f64; 2]> = [2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 14.0, 20.0, 40.0]
            .into_iter()
            .flat_map(|freedom| (0..16).map(move |k| [freedom, 0.5 + 0.04 * f64::from(k)]))
            .collect();
        let of = |&[freedom, level]: &[f64; 2]| {
            let scale = 1.0 / (freedom * level);
            let mut product = LogProduct::default();
            ratio.iter().for_each(|q| product.times(1.0 + q * scale));
            -(0.5 * freedom + 1.0) * product.ln() - rows.len() as f64 * level.ln()
        };
        let best = grid
            .par_iter()
            .map(of)
            .reduce(|| f64::NEG_INFINITY, f64::max);
        best - variances.ln()
    }

    /// Climbs from `start` along the `free` parameters, over the rows that `of` keeps.
    pub(super) fn fit(
        &self,
        rows: &[Row],
        start: &Vector,
        free: [bool; PARAMETERS],
        of: &(dyn Fn(&Row) -> bool + Sync),
    ) -> Fit {
        let sums = self.sums(start, rows, of);
        self.climb(sums, rows, start, free, of, NEXT_TO_NOTHING)
    }

    /// As [`fit`](Self::fit), where the `sums` at the start are known; a last round that gains `nothing` nats, as the
    /// curvature has it, is believed and not looked at.
    fn climb(
        &self,
        sums: Sums,
        rows: &[Row],
        start: &Vector,
        free: [bool; PARAMETERS],
        of: &(dyn Fn(&Row) -> bool + Sync),
        nothing: f64,
    ) -> Fit {
        let mut at = *start;
        let Sums {
            mut value,
            mut gradient,
            mut outer,
        } = sums;
        let mut damping = 1e-3;
        for _ in 0..ROUNDS {
            let mut normal = outer;
            let mut slope = gradient;
            for k in 0..PARAMETERS {
                if !free[k] || self.held(&at, k, gradient[k]) {
                    normal.row_mut(k).fill(0.0);
                    normal.column_mut(k).fill(0.0);
                    normal[(k, k)] = 1.0;
                    slope[k] = 0.0;
                } else {
                    normal[(k, k)] *= 1.0 + damping;
                    normal[(k, k)] += f64::MIN_POSITIVE;
                }
            }
            let Some(factor) = Cholesky::new(normal) else {
                break;
            };
            let step = factor.solve(&slope);
            let next = self.bounded(&(at + shortened(step)));
            let gains = 0.5 * slope.dot(&step);
            if gains < nothing && damping < 1e-2 {
                (at, value) = (next, value + gains);
                break;
            }
            let there = self.sums(&next, rows, of);
            if there.value >= value {
                let gained = there.value - value;
                at = next;
                Sums {
                    value,
                    gradient,
                    outer,
                } = there;
                damping = (0.2 * damping).max(1e-6);
                if gained < CONVERGED && damping < 1e-2 {
                    break;
                }
            } else {
                damping = (10.0 * damping).max(1e-2);
                if damping > 1e8 {
                    break;
                }
            }
        }
        Fit {
            at,
            free,
            loglik: value,
        }
    }

    /// The best fits without each of the folds, from `start`, which is the best of all.
    pub(super) fn without_each(
        &self,
        rows: &[Row],
        start: &Fit,
        folds: &Folds,
    ) -> impl Iterator<Item = Without> {
        let fold = |r: &Row| folds.fold_of_block[r.block];
        // at the start the sums of all folds come of one pass
        let own: Vec<Sums> = (0..folds.count)
            .into_par_iter()
            .map(|f| self.sums(&start.at, rows, &|r| fold(r) == f))
            .collect();
        (0..folds.count).map(move |f| {
            let others = own.iter().enumerate().filter(|(k, _)| *k != f);
            let others = others.fold(Sums::default(), |all, (_, own)| all.add(own));
            let of: &(dyn Fn(&Row) -> bool + Sync) = &|r| fold(r) != f;
            let others = self.climb(others, rows, &start.at, start.free, of, FOLDS_NOTHING);
            Without {
                others,
                outer: own[f].outer,
            }
        })
    }

    /// Of the rows that `of` keeps.
    fn sums(&self, at: &Vector, rows: &[Row], of: &(dyn Fn(&Row) -> bool + Sync)) -> Sums {
        let there = self.there(at);
        // pieces of fixed length, added in order: the same for any number of threads
        let pieces: Vec<Sums> = rows
            .par_chunks(4096)
            .map(|rows| {
                Arch::new().dispatch(Piece {
                    there: &there,
                    rows,
                    of,
                })
            })
            .collect();
        pieces.iter().fold(Sums::default(), Sums::add)
    }

    /// Whether parameter `k` stands at a bound that `gradient` pushes it against, or is the size of no spikes.
    fn held(&self, at: &Vector, k: usize, gradient: f64) -> bool {
        let [low, high] = self.bounds()[k];
        let pushed = (at[k] <= low && gradient < 0.0) || (at[k] >= high && gradient > 0.0);
        pushed || self.is_of_none(at, k)
    }

    /// Whether parameter `k` is the size of spikes of which there are none.
    fn is_of_none(&self, at: &Vector, k: usize) -> bool {
        k == SIZE && at[SHARE] <= self.bounds()[SHARE][0]
    }

    fn bounds(&self) -> [[f64; 2]; PARAMETERS] {
        let least = (LEAST_SIZE * LEAST_SIZE * self.variance).ln();
        [
            [-60.0, 60.0],
            [-10.0, 10.0],
            [0.0, f64::MAX],
            [logit(NO_SHARE), logit(MOST_SHARE)],
            [least, least + 30.0],
        ]
    }

    fn bounded(&self, at: &Vector) -> Vector {
        let bounds = self.bounds();
        Vector::from_fn(|k, _| at[k].clamp(bounds[k][0], bounds[k][1]))
    }

    /// Covariances of the free parameters. Parameters that are not free, stand at a bound, or act on nothing, have none.
    /// `None`: `fit` is no summit.
    pub(super) fn covariance<const N: usize>(
        &self,
        fit: &Fit,
        rows: &[Row],
        clusters: [&dyn Fn(&Row) -> usize; N],
    ) -> Option<Covariance<N>> {
        let bounds = self.bounds();
        let inside: Vec<usize> = (0..PARAMETERS)
            .filter(|&k| fit.free[k] && fit.at[k] > bounds[k][0] && fit.at[k] < bounds[k][1])
            .filter(|&k| !self.is_of_none(&fit.at, k))
            .collect();
        let inverse = self.inverse_hessian(fit, rows, &inside)?;
        let spread = |small: &DMatrix<f64>| {
            let mut out = Matrix::zeros();
            for (i, &row) in inside.iter().enumerate() {
                for (j, &column) in inside.iter().enumerate() {
                    out[(row, column)] = small[(i, j)];
                }
            }
            out
        };
        let there = self.there(&fit.at);
        let mut levels = Levels::default();
        let scores: Vec<Vector> = rows
            .iter()
            .map(|row| {
                let lanes = Lanes::of(row, levels.own(&there, row));
                let slopes = there.slopes(&lanes, &there.densities(&lanes));
                Vector::from(slopes.map(|[slope]| slope))
            })
            .collect();
        let clustered = clusters.map(|cluster| {
            let p = inside.len();
            let count = rows.iter().map(|r| cluster(r) + 1).max().unwrap_or(0);
            let mut score = vec![Vector::zeros(); count];
            let mut seen = vec![false; count];
            for (row, own) in rows.iter().zip(&scores) {
                score[cluster(row)] += own;
                seen[cluster(row)] = true;
            }
            let clusters = seen.iter().filter(|s| **s).count();
            let mut middle = DMatrix::zeros(p, p);
            for s in &score {
                let s = DVector::from_fn(p, |i, _| s[inside[i]]);
                middle += &s * s.transpose();
            }
            let widened = clusters as f64 / (clusters.max(2) - 1) as f64;
            (spread(&(&inverse * middle * &inverse * widened)), clusters)
        });
        Some(Covariance {
            model: spread(&inverse),
            clustered,
        })
    }

    fn inverse_hessian(&self, fit: &Fit, rows: &[Row], inside: &[usize]) -> Option<DMatrix<f64>> {
        let everywhere: &(dyn Fn(&Row) -> bool + Sync) = &|_| true;
        let mut hessian = DMatrix::zeros(inside.len(), inside.len());
        let here = self.sums(&fit.at, rows, everywhere).gradient;
        for (j, &k) in inside.iter().enumerate() {
            let h = 1e-4 * fit.at[k].abs().max(if k == RATE { 0.0 } else { 1.0 });
            let mut at = fit.at;
            at[k] += h;
            let there = self.sums(&at, rows, everywhere).gradient;
            for (i, &other) in inside.iter().enumerate() {
                hessian[(i, j)] = -(there[other] - here[other]) / h;
            }
        }
        let hessian = 0.5 * (&hessian + hessian.transpose());
        Some(Cholesky::new(hessian)?.inverse())
    }

    /// How much wider than chi-squared twice the log-likelihood runs: the variance
    /// of `q/2v`, 1 for Gaussian noise, over the rows that hold no spike.
    pub(super) fn widening(&self, at: &Vector, rows: &[Row]) -> f64 {
        let (mut sum, mut weight) = (0.0, 0.0);
        let belief = self.belief(at);
        for row in rows {
            let [v, sound] = belief(row);
            if sound > 0.5 {
                sum += (0.5 * row.square / v - 1.0).powi(2);
                weight += 1.0;
            }
        }
        if weight > 0.0 {
            (sum / weight).max(1.0)
        } else {
            1.0
        }
    }
}

/// How well parameters are known.
pub(super) struct Covariance<const N: usize> {
    /// As the model says.
    pub(super) model: Matrix,
    /// As the sums over clusters scatter, and how many there are, for each way of numbering them.
    pub(super) clustered: [(Matrix, usize); N],
}

pub(super) fn logit(p: f64) -> f64 {
    (p / (1.0 - p)).ln()
}

pub(super) fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}
