//! Fits of FOGM plus white noise to a series or a spectrum, in three stages.
//!
//! ```text
//! 1  least squares on logarithms of the spectrum     [M23] Eq. 19-20, with erratum E9: the start
//! 2  Whittle likelihood with the exact density       a spectrum's best, a series' second start
//! 3  exact likelihood in time                        a series' best
//! BIC = k ln n - 2 ln L                              white, FOGM, or both
//! ```
//!
//! A spectrum ends at stage 2, and so does a series when a band or lines are chosen, which only a
//! spectrum can leave out. Values are corrected for their bias to first order in 1/n; intervals are
//! those of the profile likelihood, which need neither symmetry nor a Gaussian. Where the data do
//! not bound a parameter, its [`Estimate`] says so.
//!
//! Source: \[M23\] section 3.2; Schwarz, Ann. Statist. 6 (1978) 461 for the criterion; docs/fogm-fit.md
//! for the derivation.

mod bins;
mod estimate;
mod exact;
mod information;
mod likelihood;
mod log_psd;
mod surface;
mod whittle;

use spectra::Psd;

use crate::process::positive;
use crate::{Convention, FogmError};
use bins::{Bins, Chosen};
use exact::Exact;
use information::Spread;
use likelihood::{Likelihood, Logs, place_of};
use surface::{Best, Plane, Range, Region};
use whittle::Whittle;

pub use estimate::{Estimate, Reason};
pub use log_psd::{LogPsdFit, fit_log_psd};

/// Samples that three parameters need at least.
const NEED: usize = 16;

/// By how much Hann windows overlapping by half make neighbouring bins share their scatter:
/// `1 + 2 (4/9 + 1/36)`.
pub const HANN_BIN_CORRELATION: f64 = 35.0 / 18.0;

/// What is known of the mean of a series.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mean {
    /// Nothing: a constant is removed, at its price.
    #[default]
    Free,
    /// It is zero.
    Zero,
}

/// Choices of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// Frequencies used, Hz, ends included; `None` is all between 0 and fs/2.
    pub band_hz: Option<[f64; 2]>,
    /// Ranges left out because something else is there, such as a line, Hz.
    pub lines_hz: Vec<[f64; 2]>,
    /// The mean of a series. Spectral stages never use the bin at zero.
    pub mean: Mean,
    /// How many bins of a given spectrum share one bin's worth of scatter, at least 1:
    /// [`HANN_BIN_CORRELATION`] for Welch's method with Hann windows, 1 for independent bins and for
    /// spectra averaged far beyond a window's width, whose degrees of freedom already account for it.
    pub bin_correlation: f64,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            band_hz: None,
            lines_hz: vec![],
            mean: Mean::Free,
            bin_correlation: 1.0,
        }
    }
}

impl FitOptions {
    fn chosen(&self) -> Chosen<'_> {
        Chosen {
            band_hz: self.band_hz,
            lines_hz: &self.lines_hz,
        }
    }

    fn all_frequencies(&self) -> bool {
        self.band_hz.is_none() && self.lines_hz.is_empty()
    }

    fn checked_correlation(&self) -> Result<f64, FogmError> {
        positive("bin_correlation", self.bin_correlation)?;
        Ok(self.bin_correlation)
    }
}

/// How the best estimate was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Exact likelihood of the samples.
    TimeDomain,
    /// Whittle likelihood of the spectrum.
    Spectrum,
}

/// Which terms the data ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preferred {
    /// White noise alone.
    White,
    /// FOGM alone.
    Fogm,
    /// Both.
    FogmWhite,
}

/// Schwarz' criterion of the three models; the least is preferred.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The model of least BIC.
    pub preferred: Preferred,
    /// BIC of white noise alone.
    pub white: f64,
    /// BIC of FOGM alone.
    pub fogm: f64,
    /// BIC of both.
    pub fogm_white: f64,
}

/// Parameters of FOGM plus white noise: true standard deviations of the sampled process.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Standard deviation of the FOGM, unit of the series.
    pub sigma_hsf: Estimate,
    /// Its correlation time, s.
    pub tau_s: Estimate,
    /// Standard deviation of the white noise of one sample, unit of the series.
    pub sigma_tn: Estimate,
    /// The maximum of the likelihood itself, uncorrected, also where an estimate does not vouch for
    /// it: `sigma_HSF, tau (s), sigma_TN`.
    pub maximum: [f64; 3],
    /// What the best estimate rests on.
    pub method: Method,
    /// Which terms the data ask for.
    pub choice: Choice,
    /// The first stage: least squares on logarithms.
    pub log_psd: LogPsdFit,
}

/// Fits a uniformly sampled series; NaN marks a missing sample.
///
/// ```
/// use fogm_fit::{Fogm, FogmWhite, FitOptions, fit_series};
/// use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
///
/// let truth = FogmWhite::new(Fogm::new(3.58, 20.0)?, 7.43)?;
/// let mut y = vec![0.0; 20_000];
/// truth.simulate_into(0.1, &mut Xoshiro256PlusPlus::seed_from_u64(4), &mut y);
///
/// let fit = fit_series(&y, 10.0, &FitOptions::default())?;
/// let [low, high] = fit.tau_s.interval().expect("2000 s tell a correlation time of 20 s");
/// assert!(low < 20.0 && 20.0 < high);
/// # Ok::<(), fogm_fit::FogmError>(())
/// ```
///
/// # Errors
///
/// [`FogmError::TooFew`] below 16 samples or six bins, [`FogmError::Constant`], [`FogmError::Infinite`],
/// [`FogmError::Gaps`] when samples are missing and frequencies chosen, [`FogmError::BadRange`],
/// [`FogmError::NotPositive`] for `fs_hz`, [`FogmError::NotConverged`].
pub fn fit_series(y: &[f64], fs_hz: f64, options: &FitOptions) -> Result<Fit, FogmError> {
    positive("fs_hz", fs_hz)?;
    let present = present(y)?;
    let missing = y.len() - present.len();
    if missing > 0 && !options.all_frequencies() {
        return Err(FogmError::Gaps { missing });
    }
    let bins = Bins::of_series(&filled(y), fs_hz, &options.chosen())?;
    let log_psd = log_psd::fit_bins(&bins, Convention::Consistent, 1.0)?;
    let whittle = Whittle::new(&bins, 1.0);
    let plane = Plane::new(1.0 / fs_hz, y.len() as f64 / fs_hz);
    let second = best_of_spectrum(&whittle, &plane, &log_psd);
    if !options.all_frequencies() {
        let region = surface::region(&whittle, &plane, second);
        return Ok(report(
            &whittle,
            whittle.white(),
            &plane,
            &region,
            information::spread(&bins, surface::logs_at(region.best, &plane), 1.0),
            surface::logs_at(region.best, &plane),
            Method::Spectrum,
            log_psd,
        ));
    }
    let mean = present.iter().sum::<f64>() / present.len() as f64;
    let offset = match options.mean {
        Mean::Free => mean,
        Mean::Zero => 0.0,
    };
    let exact = Exact::new(
        y.iter().map(|v| v - offset).collect(),
        1.0 / fs_hz,
        options.mean == Mean::Free,
    );
    let best = surface::climb(&exact, &plane, second.place);
    let region = surface::region(&exact, &plane, best);
    Ok(report(
        &exact,
        exact.white(),
        &plane,
        &region,
        information::spread(&bins, surface::logs_at(region.best, &plane), 1.0),
        surface::logs_at(region.best, &plane),
        Method::TimeDomain,
        log_psd,
    ))
}

/// Part of a step by which an interval may differ and still count as one step.
const STEP_TOLERANCE: f64 = 0.05;
/// Longest hole that the starting values of irregular samples see, steps.
const LONGEST_HOLE: f64 = 64.0;

/// Fits samples at any times: irregular, or with holes of any length. `sigma_tn` is the white noise of
/// one sample.
///
/// The likelihood is exact at every time (intervals within 5 % of the median one count as that).
/// Errors are those of the profile likelihood, since no spectrum of such samples has a closed
/// expectation; where every interval is one step this is [`fit_series`].
///
/// ```
/// use fogm_fit::{Fogm, FogmWhite, FitOptions, fit_times};
/// use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
///
/// // a sample every second or two, and an hour without any
/// let truth = FogmWhite::new(Fogm::new(3.58, 20.0)?, 2.0)?;
/// let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
/// let (mut t, mut state) = (0.0, truth.fogm().start(&mut rng));
/// let (mut t_s, mut y) = (vec![], vec![]);
/// for k in 0..4000_u32 {
///     let dt = if k == 2000 { 3600.0 } else { 1.0 + f64::from(k % 7) / 7.0 };
///     t += dt;
///     truth.fogm().step(&mut state, dt, &mut rng);
///     t_s.push(t);
///     y.push(truth.measure(state, &mut rng));
/// }
/// let fit = fit_times(&t_s, &y, &FitOptions::default())?;
/// let [low, high] = fit.tau_s.interval().expect("6000 s tell a correlation time of 20 s");
/// assert!(low < 20.0 && 20.0 < high);
/// # Ok::<(), fogm_fit::FogmError>(())
/// ```
///
/// # Errors
///
/// As [`fit_series`]; [`FogmError::NotIncreasing`] times, [`FogmError::Unequal`] numbers,
/// [`FogmError::Gaps`] with a choice of frequencies.
pub fn fit_times(t_s: &[f64], y: &[f64], options: &FitOptions) -> Result<Fit, FogmError> {
    if t_s.len() != y.len() {
        return Err(FogmError::Unequal {
            times: t_s.len(),
            samples: y.len(),
        });
    }
    present(y)?;
    let (t_s, y): (Vec<f64>, Vec<f64>) = t_s
        .iter()
        .zip(y)
        .filter(|(_, y)| !y.is_nan())
        .map(|(t, y)| (*t, *y))
        .unzip();
    let dt_s = typical_step(&t_s)?;
    let one_step = |w: &[f64]| ((w[1] - w[0]) / dt_s - 1.0).abs() <= STEP_TOLERANCE;
    if t_s.windows(2).all(one_step) {
        return fit_series(&y, 1.0 / dt_s, options);
    }
    if !options.all_frequencies() {
        return Err(FogmError::Gaps {
            missing: t_s.windows(2).filter(|w| !one_step(w)).count(),
        });
    }
    // starting values from whole steps, holes cut short and filled
    let mut rough = vec![y[0]];
    for (w, v) in t_s.windows(2).zip(&y[1..]) {
        let steps = ((w[1] - w[0]) / dt_s).round().clamp(1.0, LONGEST_HOLE);
        let mut k = 1.0;
        while k < steps {
            rough.push(f64::NAN);
            k += 1.0;
        }
        rough.push(*v);
    }
    let bins = Bins::of_series(&filled(&rough), 1.0 / dt_s, &options.chosen())?;
    let log_psd = log_psd::fit_bins(&bins, Convention::Consistent, 1.0)?;
    let plane = Plane::new(dt_s, t_s[t_s.len() - 1] - t_s[0] + dt_s);
    let offset = match options.mean {
        Mean::Free => y.iter().sum::<f64>() / y.len() as f64,
        Mean::Zero => 0.0,
    };
    let y = y.iter().map(|v| v - offset).collect();
    let exact = Exact::at_times(&t_s, y, dt_s, STEP_TOLERANCE, options.mean == Mean::Free);
    let (start, _) = place_of(log_psd.minimum.map(f64::ln), dt_s);
    let mut best = surface::climb(&exact, &plane, start);
    for place in surface::survey(&exact, &plane, 2) {
        let other = surface::climb(&exact, &plane, place);
        if other.ln_l > best.ln_l {
            best = other;
        }
    }
    let region = surface::region(&exact, &plane, best);
    let logs = surface::logs_at(region.best, &plane);
    Ok(report(
        &exact,
        exact.white(),
        &plane,
        &region,
        None,
        logs,
        Method::TimeDomain,
        log_psd,
    ))
}

/// Mean of the intervals near the median one.
fn typical_step(t_s: &[f64]) -> Result<f64, FogmError> {
    let increasing = |w: &[f64]| w[1] > w[0] && w[0].is_finite() && w[1].is_finite();
    if let Some(index) = t_s.windows(2).position(|w| !increasing(w)) {
        return Err(FogmError::NotIncreasing {
            index: index + 1,
            time_s: t_s[index + 1],
        });
    }
    let mut steps: Vec<f64> = t_s.windows(2).map(|w| w[1] - w[0]).collect();
    let half = steps.len() / 2;
    let median = *steps.select_nth_unstable_by(half, f64::total_cmp).1;
    let near = |s: &&f64| (**s / median - 1.0).abs() <= STEP_TOLERANCE;
    let count = steps.iter().filter(near).count();
    Ok(steps.iter().filter(near).sum::<f64>() / count as f64)
}

/// Fits a one-sided spectrum with its degrees of freedom.
///
/// The bins at 0 and fs/2, those outside the band and those in lines are left out. Its span is taken
/// as the period of the lowest bin.
///
/// # Errors
///
/// As [`fit_log_psd`].
pub fn fit_psd(psd: &Psd, options: &FitOptions) -> Result<Fit, FogmError> {
    let correlation = options.checked_correlation()?;
    let bins = Bins::of_psd(psd, &options.chosen())?;
    let log_psd = log_psd::fit_bins(&bins, Convention::Consistent, correlation)?;
    let whittle = Whittle::new(&bins, correlation);
    let plane = Plane::new(1.0 / bins.fs_hz, 1.0 / bins.samples[0].frequency_hz);
    let best = best_of_spectrum(&whittle, &plane, &log_psd);
    let region = surface::region(&whittle, &plane, best);
    Ok(report(
        &whittle,
        whittle.white(),
        &plane,
        &region,
        information::spread(&bins, surface::logs_at(region.best, &plane), correlation),
        surface::logs_at(region.best, &plane),
        Method::Spectrum,
        log_psd,
    ))
}

/// Stage 2: from stage 1 and from the best places of a coarse net.
fn best_of_spectrum(whittle: &Whittle<'_>, plane: &Plane, log_psd: &LogPsdFit) -> Best {
    let (start, _) = place_of(log_psd.minimum.map(f64::ln), plane.dt_s);
    let mut best = surface::climb(whittle, plane, start);
    for place in surface::survey(whittle, plane, 2) {
        let other = surface::climb(whittle, plane, place);
        if other.ln_l > best.ln_l {
            best = other;
        }
    }
    best
}

fn report<L: Likelihood>(
    likelihood: &L,
    white: f64,
    plane: &Plane,
    region: &Region,
    spread: Option<Spread>,
    logs: Logs,
    method: Method,
    log_psd: LogPsdFit,
) -> Fit {
    let fogm = surface::fogm_alone(likelihood, plane).ln_l;
    // as many independent numbers as the weight says
    let ln_n = (2.0 * likelihood.weight()).ln();
    let choice = choose([white, fogm, region.best.ln_l], ln_n);
    let [sigma_hsf, tau_s, sigma_tn] = estimates(logs, plane, region, spread);
    Fit {
        sigma_hsf,
        tau_s,
        sigma_tn,
        maximum: logs.map(f64::exp),
        method,
        choice,
        log_psd,
    }
}

fn choose(ln_l: [f64; 3], ln_n: f64) -> Choice {
    let [white, fogm, fogm_white] = [1.0, 2.0, 3.0].map(|k| k * ln_n);
    let [white, fogm, fogm_white] = [
        white - 2.0 * ln_l[0],
        fogm - 2.0 * ln_l[1],
        fogm_white - 2.0 * ln_l[2].max(ln_l[0]).max(ln_l[1]),
    ];
    let preferred = if fogm_white < white && fogm_white < fogm {
        Preferred::FogmWhite
    } else if fogm < white {
        Preferred::Fogm
    } else {
        Preferred::White
    };
    Choice {
        preferred,
        white,
        fogm,
        fogm_white,
    }
}

/// Where the FOGM is not seen, a part of the white noise could still be correlated over less than a step.
/// No such series tells the two apart, and nothing hangs on it: it counts as white.
fn white_alone(region: &Region) -> Option<Estimate> {
    let Range {
        low,
        high,
        open_low,
        ..
    } = region.white;
    let lost = region.ranges[0].open_low && region.ranges[2].open_low;
    (lost && !open_low && low < high).then(|| {
        let width = (high - low) / (2.0 * 1.96);
        let value = (region.best_white - 0.5 * width * width)
            .clamp(low, high)
            .exp();
        Estimate::Estimated {
            value,
            sigma: value * width,
            interval: [low.exp(), high.exp()],
        }
    })
}

/// `spread` is what the spectrum tells at best; without it errors follow from the intervals.
fn estimates(logs: Logs, plane: &Plane, region: &Region, spread: Option<Spread>) -> [Estimate; 3] {
    std::array::from_fn(|i| {
        if i == 2
            && let Some(white) = white_alone(region)
        {
            return white;
        }
        let range = region.ranges[i];
        let (low, high) = (range.low.exp(), range.high.exp());
        match (range.open_low, range.open_high) {
            (false, false) => {
                if i == 1 && logs[1] < plane.dt_s.ln() {
                    return Estimate::UpperBound {
                        limit: high,
                        reason: Reason::BelowStep,
                    };
                }
                let width = (range.high - range.low) / (2.0 * 1.96);
                let (variance, bias) =
                    spread.map_or((width * width, 0.0), |s| (s.covariance[i][i], s.bias[i]));
                // of the logarithm, then of the value itself; never out of the interval
                let shift = (bias + 0.5 * variance).clamp(-width, width);
                let value = (logs[i] - shift).clamp(range.low, range.high).exp();
                Estimate::Estimated {
                    value,
                    sigma: value * variance.sqrt(),
                    interval: [low, high],
                }
            }
            (true, _) if i == 0 => Estimate::UpperBound {
                limit: region.sigma_high_within_span.exp(),
                reason: Reason::LostInWhite,
            },
            (true, _) if i == 2 => Estimate::UpperBound {
                limit: high,
                reason: Reason::LostInFogm,
            },
            (true, true) => Estimate::Undetermined {
                reason: Reason::LostInWhite,
            },
            (true, false) => Estimate::UpperBound {
                limit: high,
                reason: Reason::BelowStep,
            },
            (false, true) => Estimate::LowerBound {
                limit: low,
                reason: Reason::BeyondSpan,
            },
        }
    })
}

fn present(y: &[f64]) -> Result<Vec<f64>, FogmError> {
    if let Some(index) = y.iter().position(|v| v.is_infinite()) {
        return Err(FogmError::Infinite { index });
    }
    let present: Vec<f64> = y.iter().copied().filter(|v| !v.is_nan()).collect();
    if present.len() < NEED {
        return Err(FogmError::TooFew {
            what: "samples",
            got: present.len(),
            need: NEED,
        });
    }
    let value = present[0];
    if present
        .iter()
        .all(|v| (v - value).abs() <= f64::EPSILON * value.abs())
    {
        return Err(FogmError::Constant { value });
    }
    Ok(present)
}

/// Straight lines over missing samples, for starting values only.
fn filled(y: &[f64]) -> Vec<f64> {
    let mut out = y.to_vec();
    let mut last: Option<(usize, f64)> = None;
    for (k, v) in y.iter().enumerate() {
        if v.is_nan() {
            continue;
        }
        let (from, start) = last.map_or((0, *v), |(j, w)| (j + 1, w));
        for (m, slot) in out[from..k].iter_mut().enumerate() {
            *slot = start + (v - start) * (m as f64 + 1.0) / (k - from + 1) as f64;
        }
        last = Some((k, *v));
    }
    if let Some((k, v)) = last {
        out[k + 1..].fill(v);
    }
    out
}
