//! The fit of \[M23\] Eq. 19-20: least squares between logarithms of spectra.
//!
//! ```text
//! J = sum_k w_k [ln Phi(f_k; sigma_HSF, tau, sigma_TN) - ln Phi_o(f_k) + E_k]^2
//!
//! as printed   w = 1, E = 0, Phi of Eq. 17
//! consistent   w = 1/psi'(nu/2), E = psi(nu/2) - ln(nu/2), Phi of the sampled series (errata E6, E8, E9)
//! ```
//!
//! Minimised by Nelder and Mead's method over the logarithms of the parameters, each squeezed into
//! its bounds by a logistic function, from several correlation times. The search begins with means over
//! neighbouring bins, whose densities hardly differ, and ends with all bins. Uncertainties follow from
//! the curvature and the known scatter of each logarithm:
//!
//! ```text
//! cov = (H^-1) (sum_k w_k^2 c psi'(nu_k/2) g_k g_k') (H^-1),   H = sum_k w_k g_k g_k',   g = d ln Phi
//! ```
//!
//! Source: \[M23\] Eq. 17-20; errata E6 to E9; Nelder & Mead, Computer Journal 7 (1965) 308.

use argmin::core::{CostFunction, Executor, State};
use argmin::solver::neldermead::NelderMead;
use spectra::{Psd, log_bias, log_variance};

use super::bins::Bins;
use super::estimate::{Estimate, Reason};
use super::information::inverse;
use super::likelihood::Logs;
use crate::density::{Bin, Step, as_printed};
use crate::process::{Fogm, FogmWhite};
use crate::{Convention, FitOptions, FogmError};

/// Correlation times from which the search starts.
const STARTS: usize = 5;
/// Steps from each of them, and from the best of all, at most.
const FIRST_STEPS: u64 = 40;
const STEPS: u64 = 500;
/// Scatter of the cost over the simplex at which the search ends; 1 is the scatter of the data, and
/// the cost rises with the square: parameters are known to 3e-4 of their errors.
const TOLERANCE: f64 = 1e-7;
/// Sides of the simplex, as logistic variables: from a start, and from where means of bins lead.
const WIDE: f64 = 0.3;
const NARROW: f64 = 0.02;
/// Bins whose frequencies differ by less than this fraction are one at first.
const NEIGHBOURS: f64 = 0.02;
/// An error of the logarithm above which a parameter counts as not determined.
const HOPELESS: f64 = 1.0;
/// Distance from a bound, in logarithm, at which a parameter counts as lying on it.
const AT_BOUND: f64 = 0.05;

/// Parameters by least squares on logarithms, in the convention of the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct LogPsdFit {
    /// Whose equations were followed: as printed, `sigma_hsf` is
    /// [`printed_sigma_hsf`](crate::printed_sigma_hsf) of the true one.
    pub convention: Convention,
    /// Standard deviation of the FOGM, unit of the series.
    pub sigma_hsf: Estimate,
    /// Its correlation time, s.
    pub tau_s: Estimate,
    /// Standard deviation of the white noise, unit of the series.
    pub sigma_tn: Estimate,
    /// The minimum itself, also where an estimate does not vouch for it: `sigma_HSF, tau (s), sigma_TN`.
    pub minimum: [f64; 3],
    /// \[M23\] Eq. 19 at the minimum, each square divided by its variance, per degree of freedom: near 1
    /// for a consistent fit of a spectrum that is FOGM plus white.
    pub cost: f64,
    /// Bins used.
    pub bins: usize,
}

/// Fits the logarithm of a one-sided spectrum, \[M23\] Eq. 19-20.
///
/// The bins at 0 and fs/2, those outside the band and those in lines are left out. For \[M23\]'s own
/// numbers give a raw periodogram and [`Convention::AsPrinted`].
///
/// # Errors
///
/// [`FogmError::LengthMismatch`], [`FogmError::BadBin`], [`FogmError::BadRange`],
/// [`FogmError::TooFew`] for fewer than six bins, [`FogmError::NotPositive`] for `fs_hz` or a
/// bin correlation that is not, [`FogmError::NotConverged`].
pub fn fit_log_psd(
    psd: &Psd,
    convention: Convention,
    options: &FitOptions,
) -> Result<LogPsdFit, FogmError> {
    let bins = Bins::of_psd(psd, &options.chosen())?;
    fit_bins(&bins, convention, options.checked_correlation()?)
}

/// The same, of bins already chosen.
pub(crate) fn fit_bins(
    bins: &Bins,
    convention: Convention,
    correlation: f64,
) -> Result<LogPsdFit, FogmError> {
    let problem = LogCost::new(bins, convention);
    let coarse = problem.coarse();
    let first = problem
        .starts()
        .into_iter()
        .filter_map(|start| coarse.search(coarse.free(start), WIDE, FIRST_STEPS))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    let (best, _) = first
        .and_then(|(from, _)| coarse.search(from, WIDE, STEPS))
        .and_then(|(near, _)| problem.search(near, NARROW, STEPS))
        .ok_or(FogmError::NotConverged)?;
    Ok(problem.report(problem.inside(&best), correlation))
}

/// The cost as argmin sees it.
#[derive(Clone, Debug)]
struct LogCost {
    fs_hz: f64,
    convention: Convention,
    /// Frequency, unbiased logarithm, weight and variance of each bin.
    bins: Vec<[f64; 4]>,
    bounds: [[f64; 2]; 3],
    window: Option<f64>,
    places: Vec<Bin>,
}

impl LogCost {
    fn new(bins: &Bins, convention: Convention) -> Self {
        let rows = bins.samples.iter().map(|s| {
            let variance = log_variance(s.dof);
            match convention {
                Convention::AsPrinted => [s.frequency_hz, s.psd.ln(), 1.0, variance],
                Convention::Consistent => [
                    s.frequency_hz,
                    s.psd.ln() - log_bias(s.dof),
                    variance.recip(),
                    variance,
                ],
            }
        });
        let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
        let mut first = f64::INFINITY;
        for s in &bins.samples {
            low = low.min(s.psd);
            high = high.max(s.psd);
            first = first.min(s.frequency_hz);
        }
        let half_band = 0.5 * bins.fs_hz;
        // from far below the least level to a FOGM whose corner lies below all bins
        let [small, large] = [low * half_band, high * half_band].map(|v| 0.5 * v.ln());
        let span = bins.window.map_or(1.0 / first, |n| n / bins.fs_hz);
        Self {
            fs_hz: bins.fs_hz,
            convention,
            bins: rows.collect(),
            bounds: [
                [small - 7.0, large + 2.0],
                [(1.0 / (15.0 * bins.fs_hz)).ln(), (50.0 * span).ln()],
                [small - 7.0, large + 2.0],
            ],
            window: match convention {
                Convention::AsPrinted => None,
                Convention::Consistent => bins.window,
            },
            places: bins.samples.iter().map(|s| s.bin).collect(),
        }
    }

    /// The same of means over neighbours, each at the place of the middle one.
    fn coarse(&self) -> Self {
        let neighbours = |a: &[f64; 4], b: &[f64; 4]| b[0] < a[0] * (1.0 + NEIGHBOURS);
        let (mut bins, mut places) = (Vec::new(), Vec::new());
        let mut first = 0;
        while first < self.bins.len() {
            let after = self.bins[first..].partition_point(|b| neighbours(&self.bins[first], b));
            let own = first..first + after.max(1);
            let middle = own.start + own.len() / 2;
            let weight: f64 = self.bins[own.clone()].iter().map(|b| b[2]).sum();
            let level: f64 = self.bins[own.clone()].iter().map(|b| b[2] * b[1]).sum();
            bins.push([self.bins[middle][0], level / weight, weight, weight.recip()]);
            places.push(self.places[middle]);
            first = own.end;
        }
        Self {
            bins,
            places,
            ..*self
        }
    }

    /// Bounded logarithms of free parameters.
    fn inside(&self, free: &[f64]) -> Logs {
        std::array::from_fn(|i| {
            let [low, high] = self.bounds[i];
            low + (high - low) / (1.0 + (-free[i]).exp())
        })
    }

    fn free(&self, logs: Logs) -> Vec<f64> {
        (0..3)
            .map(|i| {
                let [low, high] = self.bounds[i];
                let share = ((logs[i] - low) / (high - low)).clamp(1e-3, 1.0 - 1e-3);
                (share / (1.0 - share)).ln()
            })
            .collect()
    }

    /// White from the upper end of the band, FOGM from the lower, over a range of correlation times.
    fn starts(&self) -> Vec<Logs> {
        let n = self.bins.len();
        let tenth = (n / 10).max(2);
        let level = |rows: &[[f64; 4]]| rows.iter().map(|r| r[1]).sum::<f64>() / rows.len() as f64;
        let (first, last) = (level(&self.bins[..tenth]), level(&self.bins[n - tenth..]));
        let white = 0.5 * (last + (0.5 * self.fs_hz).ln());
        let (f_low, f_high) = (self.bins[0][0], self.bins[n - 1][0]);
        (0..STARTS)
            .map(|k| {
                let f =
                    (f_low.ln() + (f_high / f_low).ln() * (k as f64 + 0.3) / STARTS as f64).exp();
                let tau = 1.0 / (std::f64::consts::TAU * f);
                [0.5 * (first - (4.0 * tau).ln()), tau.ln(), white]
            })
            .collect()
    }

    /// Where Nelder and Mead's method ends, and the cost there; `None` unless finite.
    fn search(&self, origin: Vec<f64>, side: f64, steps: u64) -> Option<(Vec<f64>, f64)> {
        let solver = NelderMead::new(Self::simplex(origin, side))
            .with_sd_tolerance(TOLERANCE)
            .ok()?;
        let result = Executor::new(self, solver)
            .configure(|state| state.max_iters(steps))
            .run()
            .ok()?;
        let state = result.state();
        let cost = state.get_best_cost();
        let best = state.get_best_param()?.clone();
        cost.is_finite().then_some((best, cost))
    }

    fn simplex(origin: Vec<f64>, side: f64) -> Vec<Vec<f64>> {
        let mut simplex = vec![origin.clone()];
        for i in 0..3 {
            let mut corner = origin.clone();
            corner[i] += side;
            simplex.push(corner);
        }
        simplex
    }

    /// The log of the density at the bins, for these parameters.
    fn log_density(&self, logs: Logs) -> impl Fn(usize) -> f64 {
        let [sigma, tau, white] = logs.map(f64::exp);
        let step = Step::new(1.0 / (tau * self.fs_hz));
        let scale = 2.0 / self.fs_hz;
        let window = self.window.map(|n| (n, step.end_of(n)));
        // Fogm checks its parameters, which bounds have done already here
        let printed = Fogm::new(sigma, tau).and_then(|fogm| FogmWhite::new(fogm, white));
        move |k| match (self.convention, window, &printed) {
            (Convention::AsPrinted, _, Ok(process)) => {
                as_printed(*process, self.bins[k][0], self.fs_hz).ln()
            }
            (Convention::AsPrinted, _, Err(_)) => f64::NAN,
            (Convention::Consistent, Some((n, end)), _) => {
                let gain = step.gain_on_grid(self.places[k], n, end);
                (scale * (sigma * sigma * gain + white * white)).ln()
            }
            (Convention::Consistent, None, _) => {
                let gain = step.gain(self.places[k]);
                (scale * (sigma * sigma * gain + white * white)).ln()
            }
        }
    }

    fn value(&self, logs: Logs) -> f64 {
        let model = self.log_density(logs);
        (0..self.bins.len())
            .map(|k| {
                let e = model(k) - self.bins[k][1];
                self.bins[k][2] * e * e
            })
            .sum()
    }

    /// Derivatives of the log density of one bin.
    fn slope(&self, logs: Logs, k: usize) -> [f64; 3] {
        std::array::from_fn(|i| {
            let h = 1e-5;
            let (mut up, mut down) = (logs, logs);
            up[i] += h;
            down[i] -= h;
            (self.log_density(up)(k) - self.log_density(down)(k)) / (2.0 * h)
        })
    }

    fn report(&self, logs: Logs, correlation: f64) -> LogPsdFit {
        let (mut h, mut v) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        let mut chi2 = 0.0;
        let model = self.log_density(logs);
        for (k, [_, y, weight, variance]) in self.bins.iter().enumerate() {
            let g = self.slope(logs, k);
            let e = model(k) - y;
            chi2 += e * e / variance;
            for i in 0..3 {
                for j in 0..3 {
                    h[i][j] += weight * g[i] * g[j];
                    v[i][j] += weight * weight * correlation * variance * g[i] * g[j];
                }
            }
        }
        let covariance = inverse(&h).map(|inv| product(&product(&inv, &v), &inv));
        let reasons = [
            [Reason::LostInWhite, Reason::BeyondSpan],
            [Reason::BelowStep, Reason::BeyondSpan],
            [Reason::LostInFogm, Reason::LostInFogm],
        ];
        let estimate = |i: usize| {
            let [low, high] = self.bounds[i];
            let value = logs[i].exp();
            let spread = covariance.map_or(f64::INFINITY, |c| c[i][i].max(0.0).sqrt());
            if logs[i] < low + AT_BOUND {
                return Estimate::Undetermined {
                    reason: reasons[i][0],
                };
            }
            if logs[i] > high - AT_BOUND {
                return Estimate::Undetermined {
                    reason: reasons[i][1],
                };
            }
            if spread.is_nan() || spread > HOPELESS {
                return Estimate::Undetermined {
                    reason: Reason::Degenerate,
                };
            }
            Estimate::Estimated {
                value,
                sigma: value * spread,
                interval: [-1.96, 1.96].map(|z: f64| value * (z * spread).exp()),
            }
        };
        LogPsdFit {
            convention: self.convention,
            sigma_hsf: estimate(0),
            tau_s: estimate(1),
            sigma_tn: estimate(2),
            minimum: logs.map(f64::exp),
            cost: chi2 / (self.bins.len() as f64 - 3.0),
            bins: self.bins.len(),
        }
    }
}

impl CostFunction for &LogCost {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, free: &Self::Param) -> Result<Self::Output, argmin::core::Error> {
        Ok(self.value(self.inside(free)))
    }
}

fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}
