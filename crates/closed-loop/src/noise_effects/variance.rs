//! A model of the noise of rows, and its likelihood.
//!
//! ```text
//! v    = e^a V 10^(0.4 b (m - 5)) + w R^2             V declared variance, R rate in deg/s
//! q/v ~ chi2_2 with weight 1 - rho - rho_0,   q/(v + S^2) ~ chi2_2 with rho,   q/(v + S_0^2) with rho_0
//! ln L = sum ln sum_c pi_c exp(-q / 2 v_c) / v_c
//! ```
//!
//! `a`, the noise level itself, is always free. `rho_0, S_0` are the outliers that
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

use nalgebra::{Cholesky, SMatrix, SVector};
use rayon::prelude::*;

use super::rows::Row;

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
const PER_MAG: f64 = 0.921_034_037_197_618_3;
/// Share of spikes where there are none.
const NO_SHARE: f64 = 1e-9;
/// A larger share of rows is not a matter of spikes.
const MOST_SHARE: f64 = 0.2;
/// Least size of a spike, sigma of the usual row: smaller is no spike, but noise with tails.
const LEAST_SIZE: f64 = 4.0;
const ROUNDS: usize = 60;
const CONVERGED: f64 = 1e-4;

/// The model: what is given, and the units of its parameters.
#[derive(Clone, Debug)]
pub(super) struct Model {
    /// Usual variance per axis, arcsec^2.
    variance: f64,
    /// Outliers that are declared: share and variance.
    declared: Option<[f64; 2]>,
}

/// A point in the space of parameters with its likelihood.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) at: Vector,
    pub(super) free: [bool; PARAMETERS],
    pub(super) loglik: f64,
}

impl Model {
    pub(super) fn new(rows: &[Row], declared: Option<[f64; 2]>) -> Self {
        let mut ratio: Vec<f64> = rows
            .iter()
            .filter(|r| !r.marked)
            .map(|r| r.square / (2.0 * std::f64::consts::LN_2))
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

    /// Variance of a row, and of it what grows with the level.
    fn variance(at: &Vector, row: &Row) -> [f64; 2] {
        let own = row.declared * (at[LEVEL] + PER_MAG * at[MAGNITUDE] * row.mag).exp();
        [own + at[RATE] * row.rate, own]
    }

    /// Variance of a row, and the probability that it holds no spike.
    pub(super) fn belief(&self, at: &Vector, row: &Row) -> [f64; 2] {
        let [v, _] = Self::variance(at, row);
        let (_, posterior) = self.components(at, row, v);
        [v, posterior[0]]
    }

    /// ln of the density, and the weight of each component.
    fn components(&self, at: &Vector, row: &Row, v: f64) -> (f64, [f64; 3]) {
        let rho = sigmoid(at[SHARE]);
        let [rho0, s0] = self.declared.unwrap_or([0.0, 0.0]);
        let part = |share: f64, v: f64| {
            if share > 0.0 {
                share.ln() - 0.5 * row.square / v - v.ln()
            } else {
                f64::NEG_INFINITY
            }
        };
        let parts = [
            part(1.0 - rho - rho0, v),
            part(rho, v + at[SIZE].exp()),
            part(rho0, v + s0),
        ];
        let most = parts.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights = parts.map(|p| (p - most).exp());
        let sum: f64 = weights.iter().sum();
        (most + sum.ln(), weights.map(|w| w / sum))
    }

    /// ln of the density of a row, and its slope.
    fn row(&self, at: &Vector, row: &Row) -> (f64, Vector) {
        let [v, own] = Self::variance(at, row);
        let (value, posterior) = self.components(at, row, v);
        let size = at[SIZE].exp();
        let s0 = self.declared.map_or(0.0, |d| d[1]);
        let slope = |k: usize, v: f64| posterior[k] * (0.5 * row.square / v - 1.0) / v;
        let spike = slope(1, v + size);
        let all = slope(0, v) + spike + slope(2, v + s0);
        let rho = sigmoid(at[SHARE]);
        let rest = (1.0 - rho - self.declared.map_or(0.0, |d| d[0])).max(NO_SHARE);
        let share = posterior[1] * (1.0 - rho) - posterior[0] * rho * (1.0 - rho) / rest;
        let gradient = Vector::from([
            all * own,
            all * own * PER_MAG * row.mag,
            all * row.rate,
            share,
            spike * size,
        ]);
        (value, gradient)
    }

    /// Log-likelihood of the rows that `of` keeps.
    pub(super) fn loglik(&self, at: &Vector, rows: &[Row], of: impl Fn(&Row) -> bool) -> f64 {
        rows.iter()
            .filter(|r| of(r))
            .map(|r| {
                let [v, _] = Self::variance(at, r);
                self.components(at, r, v).0
            })
            .sum()
    }

    /// Log-likelihood of noise with tails instead of spikes: Student's t in two dimensions,
    /// `-(nu/2 + 1) ln(1 + q/(nu v)) - ln v`, at the best of a grid of freedoms and levels.
    pub(super) fn loglik_of_tails(&self, at: &Vector, rows: &[Row]) -> f64 {
        let mut best = f64::NEG_INFINITY;
        for freedom in [2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 14.0, 20.0, 40.0] {
            for level in 0..16 {
                let level = 0.5 + 0.04 * f64::from(level);
                let total: f64 = rows
                    .iter()
                    .map(|row| {
                        let v = level * Self::variance(at, row)[0];
                        -(0.5 * freedom + 1.0) * (row.square / (freedom * v)).ln_1p() - v.ln()
                    })
                    .sum();
                best = best.max(total);
            }
        }
        best
    }

    /// Climbs from `start` along the `free` parameters, over the rows that `of` keeps.
    pub(super) fn fit(
        &self,
        rows: &[Row],
        start: &Vector,
        free: [bool; PARAMETERS],
        of: &(dyn Fn(&Row) -> bool + Sync),
    ) -> Fit {
        let mut at = *start;
        let (mut value, mut gradient, mut outer) = self.sums(&at, rows, of);
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
            let next = self.bounded(&(at + step));
            let (there, its_gradient, its_outer) = self.sums(&next, rows, of);
            if there >= value {
                let gained = there - value;
                (at, value, gradient, outer) = (next, there, its_gradient, its_outer);
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

    /// Log-likelihood, gradient, and sum of the outer products of the rows' gradients.
    fn sums(
        &self,
        at: &Vector,
        rows: &[Row],
        of: &(dyn Fn(&Row) -> bool + Sync),
    ) -> (f64, Vector, Matrix) {
        // pieces of fixed length, added in order: the same for any number of threads
        let pieces: Vec<_> = rows
            .par_chunks(4096)
            .map(|chunk| {
                let (mut value, mut gradient, mut outer) = (0.0, Vector::zeros(), Matrix::zeros());
                for row in chunk.iter().filter(|r| of(r)) {
                    let (l, g) = self.row(at, row);
                    value += l;
                    gradient += g;
                    outer += g * g.transpose();
                }
                (value, gradient, outer)
            })
            .collect();
        pieces.into_iter().fold(
            (0.0, Vector::zeros(), Matrix::zeros()),
            |(a, b, c), (x, y, z)| (a + x, b + y, c + z),
        )
    }

    /// Whether parameter `k` stands at a bound that `gradient` pushes it against.
    fn held(&self, at: &Vector, k: usize, gradient: f64) -> bool {
        let [low, high] = self.bounds()[k];
        (at[k] <= low && gradient < 0.0) || (at[k] >= high && gradient > 0.0)
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

    /// Covariance of the free parameters, clusters numbered by `cluster`. Parameters
    /// that are not free, or stand at a bound, have none.
    pub(super) fn covariance(
        &self,
        fit: &Fit,
        rows: &[Row],
        cluster: impl Fn(&Row) -> usize,
    ) -> Option<(Matrix, usize)> {
        let bounds = self.bounds();
        let inside: Vec<usize> = (0..PARAMETERS)
            .filter(|&k| fit.free[k] && fit.at[k] > bounds[k][0] && fit.at[k] < bounds[k][1])
            .collect();
        let p = inside.len();
        let count = rows.iter().map(|r| cluster(r) + 1).max().unwrap_or(0);
        let mut score = vec![Vector::zeros(); count];
        let mut seen = vec![false; count];
        for row in rows {
            score[cluster(row)] += self.row(&fit.at, row).1;
            seen[cluster(row)] = true;
        }
        let everywhere: &(dyn Fn(&Row) -> bool + Sync) = &|_| true;
        let mut hessian = nalgebra::DMatrix::zeros(p, p);
        for (j, &k) in inside.iter().enumerate() {
            let h = 1e-4 * fit.at[k].abs().max(if k == RATE { 0.0 } else { 1.0 });
            let along = |side: f64| {
                let mut at = fit.at;
                at[k] += side * h;
                self.sums(&at, rows, everywhere).1
            };
            let (up, down) = (along(1.0), along(-1.0));
            for (i, &other) in inside.iter().enumerate() {
                hessian[(i, j)] = -(up[other] - down[other]) / (2.0 * h);
            }
        }
        let hessian = 0.5 * (&hessian + hessian.transpose());
        let inverse = Cholesky::new(hessian)?.inverse();
        let clusters = seen.iter().filter(|s| **s).count();
        let mut middle = nalgebra::DMatrix::zeros(p, p);
        for s in &score {
            let s = nalgebra::DVector::from_fn(p, |i, _| s[inside[i]]);
            middle += &s * s.transpose();
        }
        let widened = clusters as f64 / (clusters.max(2) - 1) as f64;
        let small = &inverse * middle * &inverse * widened;
        let mut out = Matrix::zeros();
        for i in 0..p {
            for j in 0..p {
                out[(inside[i], inside[j])] = small[(i, j)];
            }
        }
        Some((out, clusters))
    }

    /// How much wider than chi-squared twice the log-likelihood runs: the variance
    /// of `q/2v`, 1 for Gaussian noise, over the rows that hold no spike.
    pub(super) fn widening(&self, at: &Vector, rows: &[Row]) -> f64 {
        let (mut sum, mut weight) = (0.0, 0.0);
        for row in rows {
            let [v, sound] = self.belief(at, row);
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

pub(super) fn logit(p: f64) -> f64 {
    (p / (1.0 - p)).ln()
}

pub(super) fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}
