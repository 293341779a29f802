//! The spectrum of irregular samples: the Lomb-Scargle periodogram as a one-sided density.
//!
//! In every bin a sinusoid, with a mean of its own if asked, is fitted by least squares:
//!
//! ```text
//! psd(f) = (YC^2 / CC + YS^2 / SS) N / fs          (averages over the samples, at the phase where CS = 0)
//! YC = <(x - <x>) cos>,  CC = <cos^2> - <cos>^2,  SS = <sin^2> - <sin>^2   (means only if floating)
//! ```
//!
//! On regular samples and at multiples of fs/N this is the periodogram. `fs` is the rate at which white
//! noise was sampled: for a regular grid with holes the rate of the grid, else [`mean_rate_hz`]. The bins
//! are not independent, there is no Parseval's identity, and power leaks through the pattern of the
//! samples: a spectrum for finding lines rather than for integrating.
//!
//! N samples and M bins cost N M turns of a phasor; samples of a regular grid with holes, one place in eight
//! taken at least, (N + M) ln(N + M).
//!
//! Source: Scargle, Astrophys. J. 263 (1982) 835, Eq. 10; Zechmeister & Kuerster, Astron. Astrophys. 496 (2009) 577,
//! Eqs. 4-19 (equal weights); normalised here to a density.

use std::f64::consts::TAU;
use std::ops::Range;

use crate::{Psd, SpectraError, gaps};

mod chirp;

use chirp::{Chirp, ChirpScratch, Regular};

/// Whether samples at these times, s, are those of a regular grid with holes, one place in eight taken at least:
/// then a spectrum takes (N + M) ln(N + M).
#[must_use]
pub fn is_on_a_grid(t_s: &[f64]) -> bool {
    Regular::of(t_s).is_some()
}

/// What a plan is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct LombScargleSettings {
    /// First frequency, Hz.
    pub first_hz: f64,
    /// Step of the frequencies, Hz.
    pub step_hz: f64,
    /// Number of frequencies.
    pub bins: usize,
    /// Whether a mean is fitted in every bin, rather than one for all being removed before.
    pub floating_mean: bool,
    /// Rate at which white noise was sampled, Hz.
    pub fs_hz: f64,
}

/// A plan for series sampled at the same times: what depends on the times alone is kept.
///
/// ```
/// use spectra::{LombScargle, LombScargleSettings, mean_rate_hz};
///
/// let t_s: Vec<f64> = (0..400).map(|n| f64::from(n) + 0.3 * f64::from(n * n % 7)).collect();
/// let x: Vec<f64> = t_s.iter().map(|t| (0.61 * t).sin()).collect();
/// let settings = LombScargleSettings {
///     first_hz: 0.002,
///     step_hz: 0.001,
///     bins: 400,
///     floating_mean: true,
///     fs_hz: mean_rate_hz(&t_s)?,
/// };
/// let spectrum = LombScargle::new(&t_s, settings)?.process(&x)?;
/// let peak = (0..400).max_by(|a, b| spectrum.psd[*a].total_cmp(&spectrum.psd[*b])).expect("bins");
/// assert!((spectrum.frequency_hz[peak] - 0.61 / std::f64::consts::TAU).abs() <= 0.001);
/// # Ok::<(), spectra::SpectraError>(())
/// ```
#[derive(Clone, Debug)]
pub struct LombScargle {
    settings: LombScargleSettings,
    t_s: Vec<f64>,
    bins: Vec<Bin>,
    /// Where the samples are on a grid.
    chirp: Option<Chirp>,
}

/// What the times alone say about a bin.
#[derive(Clone, Copy, Debug, Default)]
struct Bin {
    /// Phase at which cosine and sine are orthogonal.
    cos_tau: f64,
    sin_tau: f64,
    /// `1/CC` and `1/SS` at this phase; 0 where the sampling leaves nothing to fit.
    inverse_cc: f64,
    inverse_ss: f64,
}

/// Memory of one estimate at a time, made by [`LombScargle::make_scratch`].
#[derive(Clone, Debug)]
pub struct LombScargleScratch {
    phasors: Phasors,
    chirp: ChirpScratch,
    series: Vec<f64>,
}

/// Share of its usual 1/2 below which `CC` or `SS` counts as nothing.
const NOTHING: f64 = 1e-10;
/// Share below which its digits are lost among those of the other: of 1e-16, 1e-12 is left above it.
const DIGITS: f64 = 1e-4;

impl LombScargle {
    /// A plan for samples at `t_s`, in any pattern.
    ///
    /// # Errors
    ///
    /// [`SpectraError::TooShort`] below four samples, [`SpectraError::NotIncreasing`] or
    /// [`SpectraError::NotFinite`] times, [`SpectraError::NotPositive`] step, rate or first frequency.
    pub fn new(t_s: &[f64], settings: LombScargleSettings) -> Result<Self, SpectraError> {
        SpectraError::positive("fs_hz", settings.fs_hz)?;
        SpectraError::positive("first_hz", settings.first_hz)?;
        SpectraError::positive("step_hz", settings.step_hz)?;
        if t_s.len() < 4 {
            return Err(SpectraError::TooShort {
                got: t_s.len(),
                need: 4,
            });
        }
        gaps::increasing(t_s)?;
        // phases are counted from the middle: the smallest arguments
        let middle = 0.5 * (t_s[0] + t_s[t_s.len() - 1]);
        let t_s: Vec<f64> = t_s.iter().map(|t| t - middle).collect();
        let grid = Regular::of(&t_s).filter(|_| settings.bins >= FEW);
        let [first, step] = [settings.first_hz, settings.step_hz];
        let plan = |factor: f64| {
            let grid = grid.as_ref()?;
            Some(Chirp::new(
                grid,
                [factor * first, factor * step],
                settings.bins,
            ))
        };
        let chirp = plan(1.0);
        let sums = match chirp.as_ref().zip(plan(2.0)) {
            Some((once, twice)) => sums_of_grid(once, &twice, t_s.len()),
            None => sums_of_phasors(&t_s, &settings),
        };
        let of = |(k, sums)| Bin::of(sums, &t_s, settings.at(k), settings.floating_mean);
        let bins = sums.into_iter().enumerate().map(of).collect();
        Ok(Self {
            settings,
            t_s,
            bins,
            chirp,
        })
    }

    /// Number of bins.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.bins.len()
    }

    /// Memory for [`process_into`](Self::process_into).
    #[must_use]
    pub fn make_scratch(&self) -> LombScargleScratch {
        LombScargleScratch {
            phasors: Phasors::default(),
            chirp: (self.chirp.as_ref()).map_or_else(ChirpScratch::default, Chirp::make_scratch),
            series: vec![0.0; self.t_s.len()],
        }
    }

    /// Writes the density of `x`, unit^2/Hz; allocates nothing.
    ///
    /// # Errors
    ///
    /// [`SpectraError::WrongLength`], [`SpectraError::NotFinite`].
    ///
    /// # Panics
    ///
    /// If `psd` does not hold [`bins`](Self::bins) values, or `scratch` is of another plan.
    pub fn process_into(
        &self,
        x: &[f64],
        scratch: &mut LombScargleScratch,
        psd: &mut [f64],
    ) -> Result<(), SpectraError> {
        assert_eq!(psd.len(), self.bins(), "one place for each bin");
        if x.len() != self.t_s.len() {
            return Err(SpectraError::WrongLength {
                got: x.len(),
                planned: self.t_s.len(),
            });
        }
        SpectraError::finite(x, 0)?;
        crate::Detrend::Constant.apply_into(x, &mut scratch.series);
        let LombScargleScratch {
            phasors,
            chirp,
            series,
        } = scratch;
        if let Some(plan) = &self.chirp {
            plan.sums(series.iter().copied(), chirp);
            for ((bin, p), sum) in self.bins.iter().zip(psd).zip(&chirp.values) {
                *p = self.density(bin, [sum.re, sum.im]);
            }
            return Ok(());
        }
        for run in runs(self.bins()) {
            let mut sums = [[0.0; 2]; RUN];
            for (t_s, x) in self.t_s.chunks(SAMPLES).zip(series.chunks(SAMPLES)) {
                phasors.set(t_s, &self.settings, run.start);
                for sums in &mut sums[..run.len()] {
                    add(sums, phasors.sums(Some(x), |c, s, x| [x * c, x * s]));
                }
            }
            let bins = self.bins[run.clone()].iter().zip(&mut psd[run]);
            for ((bin, p), sums) in bins.zip(sums) {
                *p = self.density(bin, sums);
            }
        }
        Ok(())
    }

    /// Of the sums of cosine and sine times a series without its mean: they are the same with a mean of
    /// their own.
    fn density(&self, bin: &Bin, [yc, ys]: [f64; 2]) -> f64 {
        let count = self.t_s.len() as f64;
        let along = (yc * bin.cos_tau + ys * bin.sin_tau) / count;
        let across = (ys * bin.cos_tau - yc * bin.sin_tau) / count;
        let power = along * along * bin.inverse_cc + across * across * bin.inverse_ss;
        power * count / self.settings.fs_hz
    }

    /// Density of `x`, with two degrees of freedom a bin (one where the times leave no sine to fit).
    ///
    /// # Errors
    ///
    /// As [`process_into`](Self::process_into).
    pub fn process(&self, x: &[f64]) -> Result<Psd, SpectraError> {
        let mut psd = vec![0.0; self.bins()];
        self.process_into(x, &mut self.make_scratch(), &mut psd)?;
        let dof = |b: &Bin| f64::from(u8::from(b.inverse_cc > 0.0) + u8::from(b.inverse_ss > 0.0));
        Ok(Psd {
            frequency_hz: (0..self.bins()).map(|k| self.settings.at(k)).collect(),
            psd,
            dof: self.bins.iter().map(dof).collect(),
            fs_hz: self.settings.fs_hz,
        })
    }
}

impl LombScargleSettings {
    fn at(&self, k: usize) -> f64 {
        self.first_hz + k as f64 * self.step_hz
    }
}

/// Mean rate of samples at `t_s`, Hz: `(N - 1) / (t[N-1] - t[0])`.
///
/// # Errors
///
/// [`SpectraError::TooShort`] below two samples, [`SpectraError::NotIncreasing`] or
/// [`SpectraError::NotFinite`] times.
pub fn mean_rate_hz(t_s: &[f64]) -> Result<f64, SpectraError> {
    if t_s.len() < 2 {
        return Err(SpectraError::TooShort {
            got: t_s.len(),
            need: 2,
        });
    }
    gaps::increasing(t_s)?;
    Ok((t_s.len() - 1) as f64 / (t_s[t_s.len() - 1] - t_s[0]))
}

/// Fewer bins are not worth a transform.
const FEW: usize = 16;
/// Bins that are gone through at once.
const RUN: usize = 128;
/// Samples that are: their phasors stay in the nearest cache.
const SAMPLES: usize = 512;
/// Numbers that fill vector registers.
const LANES: usize = 8;

fn runs(bins: usize) -> impl Iterator<Item = Range<usize>> {
    (0..bins).step_by(RUN).map(move |k| k..(k + RUN).min(bins))
}

fn add<const N: usize>(sums: &mut [f64; N], part: [f64; N]) {
    for (sum, part) in sums.iter_mut().zip(part) {
        *sum += part;
    }
}

/// Sums of cos, sin, cos^2 and cos sin over the samples, bin by bin.
fn sums_of_phasors(t_s: &[f64], settings: &LombScargleSettings) -> Vec<[f64; 4]> {
    let mut phasors = Phasors::default();
    let mut all = vec![[0.0; 4]; settings.bins];
    for run in runs(settings.bins) {
        for t_s in t_s.chunks(SAMPLES) {
            phasors.set(t_s, settings, run.start);
            for sums in &mut all[run.clone()] {
                let part = phasors.sums(None, |c, s, _| [c, s, c * c, c * s]);
                add(sums, part);
            }
        }
    }
    all
}

/// The same from transforms at the frequencies and at twice those.
fn sums_of_grid(once: &Chirp, twice: &Chirp, samples: usize) -> Vec<[f64; 4]> {
    let (count, bins) = (samples as f64, once.bins());
    let mut scratch = [once, twice].map(Chirp::make_scratch);
    for (chirp, scratch) in [once, twice].into_iter().zip(&mut scratch) {
        chirp.sums(std::iter::repeat_n(1.0, samples), scratch);
    }
    let [once, twice] = scratch;
    let both = once.values.iter().zip(&twice.values);
    both.map(|(v, w)| [v.re, v.im, 0.5 * (count + w.re), 0.5 * w.im])
        .take(bins)
        .collect()
}

/// Cosine and sine of some samples at one frequency, turned from bin to bin by one complex product: no
/// sine is computed but once in [`RUN`] bins, which keeps the rounding below 3e-14.
#[derive(Clone, Debug)]
struct Phasors {
    now: [[f64; SAMPLES]; 2],
    step: [[f64; SAMPLES]; 2],
    samples: usize,
}

impl Default for Phasors {
    fn default() -> Self {
        Self {
            now: [[0.0; SAMPLES]; 2],
            step: [[0.0; SAMPLES]; 2],
            samples: 0,
        }
    }
}

impl Phasors {
    /// At bin `k`, of the samples at `t_s`. What comes after them counts for nothing.
    fn set(&mut self, t_s: &[f64], settings: &LombScargleSettings, k: usize) {
        self.samples = t_s.len();
        let at = TAU * settings.at(k);
        let step = TAU * settings.step_hz;
        for (i, t) in t_s.iter().enumerate() {
            (self.now[1][i], self.now[0][i]) = (at * t).sin_cos();
            (self.step[1][i], self.step[0][i]) = (step * t).sin_cos();
        }
        for i in t_s.len()..t_s.len().next_multiple_of(LANES) {
            for part in self.now.iter_mut().chain(&mut self.step) {
                part[i] = 0.0;
            }
        }
    }

    /// Sums over the samples of a few numbers made of cosine, sine and `x` (0 without), each in eight
    /// parts that fill a vector register; turns to the next bin.
    fn sums<const N: usize>(
        &mut self,
        x: Option<&[f64]>,
        of: impl Fn(f64, f64, f64) -> [f64; N],
    ) -> [f64; N] {
        let mut parts = [[0.0; LANES]; N];
        let [cos, sin] = &mut self.now;
        let [step_cos, step_sin] = &self.step;
        for i in (0..self.samples).step_by(LANES) {
            let mut own = [0.0; LANES];
            if let Some(x) = x.and_then(|x| x.get(i..)) {
                let own_len = x.len().min(LANES);
                own[..own_len].copy_from_slice(&x[..own_len]);
            }
            let (c, s) = (&mut cos[i..i + LANES], &mut sin[i..i + LANES]);
            let (dc, ds) = (&step_cos[i..i + LANES], &step_sin[i..i + LANES]);
            for l in 0..LANES {
                let values = of(c[l], s[l], own[l]);
                for n in 0..N {
                    parts[n][l] += values[n];
                }
            }
            for l in 0..LANES {
                (c[l], s[l]) = (c[l] * dc[l] - s[l] * ds[l], s[l] * dc[l] + c[l] * ds[l]);
            }
        }
        parts.map(|part| part.iter().sum())
    }
}

impl Bin {
    /// Of the sums of cos, sin, cos^2 and cos sin over the samples at `t_s` and the frequency `f`, Hz.
    fn of([c, s, cc, cs]: [f64; 4], t_s: &[f64], f: f64, floating_mean: bool) -> Self {
        let count = t_s.len() as f64;
        let [c, s, cc, cs] = [c, s, cc, cs].map(|sum| sum / count);
        let [mean_cos, mean_sin] = if floating_mean { [c, s] } else { [0.0; 2] };
        let ss = 1.0 - cc - mean_sin * mean_sin;
        let cc = cc - mean_cos * mean_cos;
        let cs = cs - mean_cos * mean_sin;
        let (sin_tau, cos_tau) = (0.5 * (2.0 * cs).atan2(cc - ss)).sin_cos();
        let cross = 2.0 * cs * cos_tau * sin_tau;
        let (c2, s2) = (cos_tau * cos_tau, sin_tau * sin_tau);
        let mut squares = [cc * c2 + cross + ss * s2, cc * s2 - cross + ss * c2];
        if squares.iter().any(|v| *v < DIGITS) {
            // summed at this phase, where the smaller of the two keeps its digits
            squares = [0.0; 2];
            for t in t_s {
                let (s, c) = (TAU * f * t).sin_cos();
                let (c, s) = (c - mean_cos, s - mean_sin);
                let (along, across) = (c * cos_tau + s * sin_tau, s * cos_tau - c * sin_tau);
                squares[0] += along * along / count;
                squares[1] += across * across / count;
            }
        }
        let [inverse_cc, inverse_ss] = squares.map(|v| if v > NOTHING { 1.0 / v } else { 0.0 });
        Self {
            cos_tau,
            sin_tau,
            inverse_cc,
            inverse_ss,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On 33 regular samples, next to half their rate, the squared sine is 4e-9 of the cosine's: less the digits of
    /// a difference (1e-16) it would be known to 3e-8, summed by itself to rounding.
    #[test]
    fn a_faint_sine_keeps_its_digits() {
        let t_s: Vec<f64> = (0..33).map(|k| f64::from(k) - 16.0).collect();
        let f = 0.5 - 1e-6;
        let (mut sums, mut faint) = ([0.0; 4], 0.0);
        for t in &t_s {
            let (s, c) = (TAU * f * t).sin_cos();
            add(&mut sums, [c, s, c * c, c * s]);
            faint += s * s / 33.0;
        }
        let bin = Bin::of(sums, &t_s, f, false);
        let ours = bin.inverse_cc.max(bin.inverse_ss);
        assert!((ours * faint - 1.0).abs() < 1e-10, "{ours} {faint}");
    }

    /// Transforms give what phasors do, on a grid with holes and far from t = 0: both round by some 1e-16 times
    /// the samples' sum of squares.
    #[test]
    fn a_grid_with_holes_is_summed_by_transforms() {
        let taken = |k: &u32| k % 7 != 3 && !(200..260).contains(k);
        let t_s: Vec<f64> = (0..500)
            .filter(taken)
            .map(|k| 3000.0 + 0.5 * f64::from(k))
            .collect();
        let x: Vec<f64> = (0..t_s.len())
            .map(|k| ((k * k) % 29) as f64 - 14.0)
            .collect();
        for floating_mean in [false, true] {
            let settings = LombScargleSettings {
                first_hz: 0.007,
                step_hz: 0.0009,
                bins: 1100,
                floating_mean,
                fs_hz: 2.0,
            };
            let fast = LombScargle::new(&t_s, settings.clone()).unwrap();
            assert!(fast.chirp.is_some() && fast.bins() == 1100);
            let sums = sums_of_phasors(&fast.t_s, &settings)
                .into_iter()
                .enumerate();
            let bins = sums.map(|(k, s)| Bin::of(s, &fast.t_s, settings.at(k), floating_mean));
            let slow = LombScargle {
                bins: bins.collect(),
                chirp: None,
                ..fast.clone()
            };
            let (a, b) = (fast.process(&x).unwrap(), slow.process(&x).unwrap());
            for (k, (a, b)) in a.psd.iter().zip(&b.psd).enumerate() {
                assert!((a - b).abs() < 1e-9 * (1.0 + b), "{k}: {a} {b}");
            }
        }
        let jittered: Vec<f64> = t_s.iter().map(|t| t + 1e-4 * (7.0 * t).sin()).collect();
        let settings = LombScargleSettings {
            first_hz: 0.01,
            step_hz: 0.01,
            bins: 90,
            floating_mean: true,
            fs_hz: 2.0,
        };
        let plan = LombScargle::new(&jittered, settings).unwrap();
        assert!(plan.chirp.is_none());
    }
}
