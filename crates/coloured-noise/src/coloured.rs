//! Coloured noise of one series: white plus a first-order
//! Gauss-Markov process, removed exactly by a whitening filter.
//!
//! ```text
//! y_k = b_k + w_k         w ~ N(0, s_w^2)
//! b_k+1 = a b_k + n_k     a = exp(-dt/tau),  n ~ N(0, s_b^2 (1 - a^2))
//! ```
//!
//! A row may be the mean of `count` measurements: its white variance is `s_w^2/count`.
//! The scalar Kalman filter of this model turns the series into independent
//! unit-variance innovations, at any spacing and across gaps. It is linear and
//! its gains depend on the times alone, so that regressors go through the same
//! filter and ordinary least squares afterwards is generalised least squares.
//! Without it, the slow error of a reference turns into trends, lines and steps.
//!
//! The three numbers are those of greatest likelihood,
//!
//! ```text
//! ln L = -1/2 sum_k ( ln(2 pi S_k) + e_k^2 / S_k )
//! ```
//!
//! Source: Brown & Hwang 2012, ch. 4 (Gauss-Markov process, scalar filter).

use argmin::core::{CostFunction, Executor};
use argmin::solver::neldermead::NelderMead;
use rayon::prelude::*;

use crate::foreknown::Foreknown;
use crate::log_product::LogProduct;

/// White plus first-order Gauss-Markov noise of one axis.
///
/// A series is given by the times `t_s` of its rows in ascending order, s, its values, and the `count` of
/// measurements that each row is the mean of; 0 leaves a row out. All three have one length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coloured {
    /// Standard deviation of the white part of one measurement, in the unit of the series.
    pub white: f64,
    /// Standard deviation of the slow part, in the unit of the series.
    pub slow: f64,
    /// Correlation time of the slow part, s.
    pub tau_s: f64,
}

impl Coloured {
    /// Nothing known: measurements count alike and stay as they are.
    pub const WHITE: Self = Self {
        white: 1.0,
        slow: 0.0,
        tau_s: 1.0,
    };

    /// Goes through the rows: the decay up to each, and the filter at those that count.
    #[inline]
    fn filter(&self, t_s: &[f64], count: &[f64], mut row: impl FnMut(usize, f64, Option<Step>)) {
        let (r, s) = (self.white * self.white, self.slow * self.slow);
        let (mut variance, mut last_s) = (s, f64::NEG_INFINITY);
        let mut known = Known::default();
        for (k, (&t_s, &count)) in t_s.iter().zip(count).enumerate() {
            let decay = known.decay(t_s - last_s, self.tau_s);
            last_s = t_s;
            let square = decay * decay;
            variance = square * variance + s * (1.0 - square);
            if count <= 0.0 {
                row(k, decay, None);
                continue;
            }
            let innovation = variance + r / count;
            let inverse = 1.0 / innovation;
            let gain = variance * inverse;
            row(
                k,
                decay,
                Some(Step {
                    gain,
                    innovation,
                    inverse,
                }),
            );
            variance *= 1.0 - gain;
        }
    }

    /// The filter's decay, gain and 1/sqrt(innovation variance) at each row; a row
    /// that counts for nothing has gain 0 and weight 0.
    fn gains(&self, t_s: &[f64], count: &[f64]) -> Vec<[f64; 3]> {
        let mut out = Vec::with_capacity(t_s.len());
        self.filter(t_s, count, |_, decay, step| {
            let [gain, weight] = step.map_or([0.0; 2], |s| [s.gain, 1.0 / s.innovation.sqrt()]);
            out.push([decay, gain, weight]);
        });
        out
    }

    /// Log-likelihood of `y`, nats.
    pub fn log_likelihood(&self, t_s: &[f64], y: &[f64], count: &[f64]) -> f64 {
        let sums = self.sums(t_s, count, |k| [y[k]]);
        sums.log_likelihood(sums.squares[0][0], sums.kept)
    }

    /// That of what `y` tells beside a constant, of which nothing is known: what is fitted of a slow error by its own
    /// mean makes it look smaller and shorter than it is.
    ///
    /// ```text
    /// ln L_R = ln L(y - m) - 1/2 ln(1' V^-1 1 / 2 pi)        m = 1' V^-1 y / 1' V^-1 1
    /// ```
    ///
    /// Source: restricted likelihood, Patterson & Thompson 1971.
    pub fn log_likelihood_beside_constant(&self, t_s: &[f64], y: &[f64], count: &[f64]) -> f64 {
        let sums = self.sums(t_s, count, |k| [y[k], 1.0]);
        let [[y, both], [_, one]] = sums.squares;
        if one <= 0.0 {
            return sums.log_likelihood(y, sums.kept);
        }
        sums.log_likelihood(y - both * both / one, sums.kept - 1.0) - 0.5 * one.ln()
    }

    /// Products of whitened series with each other, and what else a likelihood is made of.
    #[inline]
    fn sums<const N: usize>(
        &self,
        t_s: &[f64],
        count: &[f64],
        of: impl Fn(usize) -> [f64; N],
    ) -> Sums<N> {
        let mut mean = [0.0; N];
        let mut squares = [[0.0; N]; N];
        let mut determinant = LogProduct::default();
        let mut kept = 0.0;
        self.filter(t_s, count, |k, decay, step| {
            mean.iter_mut().for_each(|m| *m *= decay);
            let Some(step) = step else { return };
            let of = of(k);
            let e: [f64; N] = std::array::from_fn(|i| of[i] - mean[i]);
            for i in 0..N {
                mean[i] += step.gain * e[i];
                for j in i..N {
                    squares[i][j] += e[i] * e[j] * step.inverse;
                }
            }
            determinant.times(step.innovation);
            kept += 1.0;
        });
        Sums {
            squares,
            determinant: determinant.ln(),
            kept,
        }
    }

    /// Noise of greatest likelihood for a series about zero. With fewer than 30 rows, too
    /// few to tell a correlation, white noise.
    pub fn fit(t_s: &[f64], y: &[f64], count: &[f64]) -> Self {
        Self::fit_above(0.0, t_s, y, count)
    }

    /// As [`fit`](Self::fit), where the white part is known to be no less than `least`.
    pub fn fit_above(least: f64, t_s: &[f64], y: &[f64], count: &[f64]) -> Self {
        let kept: Vec<usize> = (0..y.len()).filter(|&k| count[k] > 0.0).collect();
        let variance =
            kept.iter().map(|&k| y[k] * y[k] * count[k]).sum::<f64>() / kept.len().max(1) as f64;
        let rms = variance.sqrt().max(least).max(1e-12);
        let white = Self {
            white: rms,
            slow: 0.0,
            tau_s: 1.0,
        };
        let Some(problem) = Likelihood::of(least, None, t_s, y, count) else {
            return white;
        };
        let Scales { step, span } = problem.scales;
        if kept.len() < 30 || step <= 0.0 {
            return white;
        }
        let problem = Likelihood { rms, ..problem };
        let own = if least > 0.0 { 0.3_f64 } else { 0.7 }.ln();
        // A likelihood in the correlation time has more than one hill: start on each.
        let best = [3.0 * step, (step * span).sqrt(), 0.1 * span]
            .into_par_iter()
            .filter_map(|tau| problem.climb([own, 0.7_f64.ln(), tau.ln()], -0.7))
            .collect::<Vec<_>>()
            .into_iter()
            .max_by(|a, b| a.0.total_cmp(&b.0));
        // Two more parameters must earn their keep (Akaike).
        match best {
            Some((found, noise)) if found > white.log_likelihood(t_s, y, count) + 2.0 => noise,
            _ => white,
        }
    }

    /// The noise of a similar series, started from this one.
    pub fn refit(&self, t_s: &[f64], y: &[f64], count: &[f64]) -> Self {
        self.refit_above(0.0, t_s, y, count)
    }

    /// As [`refit`](Self::refit), where the white part is known to be no less than `least`.
    pub fn refit_above(&self, least: f64, t_s: &[f64], y: &[f64], count: &[f64]) -> Self {
        if self.slow <= 0.0 {
            return Self::fit_above(least, t_s, y, count);
        }
        let Some(problem) = Likelihood::of(least, None, t_s, y, count) else {
            return *self;
        };
        problem
            .climb(
                [
                    own_white(self.white, least).ln(),
                    self.slow.ln(),
                    self.tau_s.ln(),
                ],
                -0.3,
            )
            .map_or(*self, |(_, noise)| noise)
    }

    /// As [`refit`](Self::refit), of greatest likelihood times what is known of the slow part before; started from
    /// what is known.
    pub fn refit_near(&self, known: &Foreknown, t_s: &[f64], y: &[f64], count: &[f64]) -> Self {
        self.refit_near_above(0.0, known, t_s, y, count)
    }

    /// As [`refit_near`](Self::refit_near), where the white part is known to be no less than `least`.
    pub fn refit_near_above(
        &self,
        least: f64,
        known: &Foreknown,
        t_s: &[f64],
        y: &[f64],
        count: &[f64],
    ) -> Self {
        let start = Self {
            white: self.white,
            slow: known.slow,
            tau_s: known.tau_s,
        };
        let Some(problem) = Likelihood::of(least, Some(known), t_s, y, count) else {
            return start;
        };
        let own = own_white(start.white, least);
        let at = [own, start.slow, start.tau_s].map(f64::ln);
        problem.climb(at, -0.3).map_or(start, |(_, noise)| noise)
    }

    /// Standard errors of the slow part relative to it, of sigma and of tau, from
    /// the curvature of the log-likelihood; `None` where it has no summit.
    pub fn relative_sigma(&self, t_s: &[f64], y: &[f64], count: &[f64]) -> Option<[f64; 2]> {
        const STEP: f64 = 0.05;
        let height = |d: [f64; 3]| {
            Self {
                white: self.white * d[0].exp(),
                slow: self.slow * d[1].exp(),
                tau_s: self.tau_s * d[2].exp(),
            }
            .log_likelihood(t_s, y, count)
        };
        let shifted = |i: usize, a: f64, j: usize, b: f64| {
            let mut d = [0.0; 3];
            d[i] += a;
            d[j] += b;
            height(d)
        };
        let information = nalgebra::Matrix3::from_fn(|i, j| {
            (shifted(i, STEP, j, -STEP) + shifted(i, -STEP, j, STEP)
                - shifted(i, STEP, j, STEP)
                - shifted(i, -STEP, j, -STEP))
                / (4.0 * STEP * STEP)
        });
        let covariance = information.cholesky()?.inverse();
        Some([covariance[(1, 1)].sqrt(), covariance[(2, 2)].sqrt()])
    }

    /// Products of whitened steps (0 before each of the rows `at`, 1 from there on) with themselves and
    /// with two whitened series `with`, three numbers a step: what a fit of one step and its likelihood need.
    pub fn steps(
        &self,
        t_s: &[f64],
        count: &[f64],
        at: &[usize],
        with: [&[f64]; 2],
    ) -> Vec<[f64; 3]> {
        // side by side: each is a chain of products
        const LANES: usize = 8;
        let gains = self.gains(t_s, count);
        let mut out = Vec::with_capacity(at.len());
        for at in at.chunks(LANES) {
            let mut mean = [0.0; LANES];
            let mut sums = [[0.0; LANES]; 3];
            let mut from = [usize::MAX; LANES];
            from[..at.len()].copy_from_slice(at);
            let first = at.iter().copied().min().unwrap_or(0);
            let with = with.map(|w| &w[first..]);
            for (j, [decay, gain, weight]) in gains[first..].iter().enumerate() {
                for l in 0..LANES {
                    let step = f64::from(u8::from(first + j >= from[l]));
                    let before = mean[l] * decay;
                    let e = step - before;
                    let white = e * weight;
                    mean[l] = before + gain * e;
                    sums[0][l] += white * white;
                    sums[1][l] += white * with[0][j];
                    sums[2][l] += white * with[1][j];
                }
            }
            out.extend((0..at.len()).map(|l| [sums[0][l], sums[1][l], sums[2][l]]));
        }
        out
    }

    /// Whitens a series in place: independent, unit variance; rows that are left out become 0. Regressors
    /// whitened alike make least squares generalised.
    pub fn whiten(&self, t_s: &[f64], count: &[f64], columns: &mut [&mut [f64]]) {
        let gains = self.gains(t_s, count);
        for column in columns {
            let mut mean = 0.0;
            for (k, [decay, gain, weight]) in gains.iter().enumerate() {
                mean *= decay;
                if count[k] <= 0.0 {
                    column[k] = 0.0;
                    continue;
                }
                let e = column[k] - mean;
                mean += gain * e;
                column[k] = e * weight;
            }
        }
    }
}

/// The filter at a row.
#[derive(Clone, Copy)]
struct Step {
    gain: f64,
    /// Variance of the innovation, and one over it.
    innovation: f64,
    inverse: f64,
}

/// What likelihoods of some series are made of.
struct Sums<const N: usize> {
    /// Products of innovations over their variances; the upper half.
    squares: [[f64; N]; N],
    /// Of the logarithms of these variances.
    determinant: f64,
    /// How many rows count.
    kept: f64,
}

impl<const N: usize> Sums<N> {
    fn log_likelihood(&self, squares: f64, kept: f64) -> f64 {
        -0.5 * (squares + self.determinant + kept * std::f64::consts::TAU.ln())
    }
}

/// Steps repeat: one exponential serves them all.
#[derive(Clone, Copy, Debug)]
struct Known {
    step_s: f64,
    decay: f64,
}

impl Default for Known {
    fn default() -> Self {
        Self {
            step_s: f64::NAN,
            decay: 0.0,
        }
    }
}

impl Known {
    fn decay(&mut self, step_s: f64, tau_s: f64) -> f64 {
        // alike but for the rounding of times
        let alike = (step_s - self.step_s).abs() <= 1e-9 * step_s;
        if !alike || step_s.is_infinite() {
            *self = Self {
                step_s,
                decay: (-step_s / tau_s).exp(),
            };
        }
        self.decay
    }
}

/// What a white part has beside `least`: a start, not nothing.
fn own_white(white: f64, least: f64) -> f64 {
    (white * white - least * least)
        .max(0.01 * white * white)
        .max(1e-24)
        .sqrt()
}

/// The slow part of greatest likelihood that several series have alike, each beside a white part of
/// its own of no less than `least`, from `start`; and the log-likelihood of all, nats.
pub(crate) fn fit_alike(
    least: f64,
    t_s: &[f64],
    series: &[(&[f64], &[f64])],
    start: &Coloured,
) -> Option<(Coloured, f64)> {
    let problem = Alike {
        t_s,
        series,
        least,
        scales: Scales::of(t_s)?,
    };
    let mut first = vec![start.slow.ln(), start.tau_s.ln()];
    first.extend(series.iter().map(|_| own_white(start.white, least).ln()));
    let mut simplex = vec![first.clone()];
    for (k, step) in [0.5, -0.7]
        .into_iter()
        .chain(series.iter().map(|_| 0.5))
        .enumerate()
    {
        let mut corner = first.clone();
        corner[k] += step;
        simplex.push(corner);
    }
    let solver = NelderMead::new(simplex).with_sd_tolerance(1e-2).ok()?;
    let result = Executor::new(&problem, solver)
        .configure(|s| s.max_iters(160))
        .run()
        .ok()?;
    let best = result.state.best_param?;
    Some((problem.at(&best, 0), problem.height(&best)))
}

struct Alike<'a> {
    t_s: &'a [f64],
    /// Values and counts.
    series: &'a [(&'a [f64], &'a [f64])],
    least: f64,
    scales: Scales,
}

impl Alike<'_> {
    fn at(&self, p: &[f64], k: usize) -> Coloured {
        Coloured {
            white: p[2 + k].clamp(-40.0, 40.0).exp().hypot(self.least),
            slow: p[0].clamp(-40.0, 40.0).exp(),
            tau_s: self.scales.tau_s(p[1]),
        }
    }

    fn height(&self, p: &[f64]) -> f64 {
        let of = |(k, (y, count)): (usize, &(&[f64], &[f64]))| {
            self.at(p, k).log_likelihood(self.t_s, y, count)
        };
        self.series.iter().enumerate().map(of).sum()
    }
}

impl CostFunction for &Alike<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, p: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        Ok(-self.height(p))
    }
}

/// Usual step and span of some times, s.
#[derive(Clone, Copy)]
pub(crate) struct Scales {
    pub(crate) step: f64,
    pub(crate) span: f64,
}

impl Scales {
    /// `None` for times without steps.
    pub(crate) fn of(t_s: &[f64]) -> Option<Self> {
        Some(Self {
            step: spectra::robust::median_step(t_s)?,
            span: t_s.last()? - t_s.first()?,
        })
    }

    /// A correlation time, s, of those that can be told.
    fn tau_s(self, ln_tau: f64) -> f64 {
        ln_tau.exp().clamp(0.5 * self.step, 3.0 * self.span)
    }
}

struct Likelihood<'a> {
    t_s: &'a [f64],
    y: &'a [f64],
    count: &'a [f64],
    rms: f64,
    /// Least white part; the rest of it is fitted.
    least: f64,
    scales: Scales,
    /// What is known of the slow part before.
    known: Option<&'a Foreknown>,
}

impl<'a> Likelihood<'a> {
    /// With sizes in the unit of the series; `None` for a series without steps.
    fn of(
        least: f64,
        known: Option<&'a Foreknown>,
        t_s: &'a [f64],
        y: &'a [f64],
        count: &'a [f64],
    ) -> Option<Self> {
        Some(Self {
            t_s,
            y,
            count,
            rms: 1.0,
            least,
            scales: Scales::of(t_s)?,
            known,
        })
    }

    fn at(&self, p: &[f64]) -> Coloured {
        Coloured {
            white: (self.rms * p[0].clamp(-20.0, 20.0).exp()).hypot(self.least),
            slow: self.rms * p[1].clamp(-20.0, 20.0).exp(),
            tau_s: self.scales.tau_s(p[2]),
        }
    }

    /// Climbs from `start` (logarithms) with first steps of `step`; the height
    /// and the noise there.
    fn climb(&self, start: [f64; 3], step: f64) -> Option<(f64, Coloured)> {
        let noise = if self.least > 0.0 {
            self.at(&summit(&self, &start, &[step, step, -1.4 * step])?)
        } else {
            let start = [start[1] - start[0], start[2]];
            Scaled(self).at(&summit(&Scaled(self), &start, &[-step, -1.4 * step])?)
        };
        Some((noise.log_likelihood(self.t_s, self.y, self.count), noise))
    }
}

/// Where `problem` is least, from `start` with first steps `steps`.
fn summit<C>(problem: &C, start: &[f64], steps: &[f64]) -> Option<Vec<f64>>
where
    C: CostFunction<Param = Vec<f64>, Output = f64> + Copy,
{
    let mut simplex = vec![start.to_vec()];
    for (k, step) in steps.iter().enumerate() {
        let mut corner = start.to_vec();
        corner[k] += step;
        simplex.push(corner);
    }
    let solver = NelderMead::new(simplex).with_sd_tolerance(1e-3).ok()?;
    let result = Executor::new(*problem, solver)
        .configure(|s| s.max_iters(120))
        .run()
        .ok()?;
    result.state.best_param
}

impl CostFunction for &Likelihood<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, p: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        Ok(-self.at(p).log_likelihood(self.t_s, self.y, self.count))
    }
}

/// The likelihood at the best size of all noise, which is known at any ratio of its parts:
/// `s^2 = mean of e_k^2 / S_k`. Logarithms of slow over white, and of the correlation time.
#[derive(Clone, Copy)]
struct Scaled<'a>(&'a Likelihood<'a>);

impl Scaled<'_> {
    fn relative(self, p: &[f64]) -> Coloured {
        Coloured {
            white: 1.0,
            slow: p[0].clamp(-20.0, 20.0).exp(),
            tau_s: self.0.scales.tau_s(p[1]),
        }
    }

    /// Squares of the innovations, logarithms of their variances, and rows that count.
    fn sums(self, p: &[f64]) -> [f64; 3] {
        let Likelihood { t_s, y, count, .. } = *self.0;
        let sums = self.relative(p).sums(t_s, count, |k| [y[k]]);
        [sums.squares[0][0], sums.determinant, sums.kept]
    }

    fn at(self, p: &[f64]) -> Coloured {
        let [squares, _, kept] = self.sums(p);
        let size = (squares / kept).sqrt().max(1e-12 * self.0.rms);
        let relative = self.relative(p);
        Coloured {
            white: size,
            slow: size * relative.slow,
            ..relative
        }
    }
}

impl CostFunction for Scaled<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, p: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let [squares, determinant, kept] = self.sums(p);
        let known = self.0.known.map_or(0.0, |k| k.log_weight(&self.at(p)));
        Ok(0.5 * (kept * (squares / kept).max(f64::MIN_POSITIVE).ln() + determinant) - known)
    }
}

#[cfg(test)]
pub(crate) mod tests;
