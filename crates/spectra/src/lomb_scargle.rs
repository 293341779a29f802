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
//! Source: Scargle, Astrophys. J. 263 (1982) 835, Eq. 10; Zechmeister & Kuerster, Astron. Astrophys. 496 (2009) 577,
//! Eqs. 4-19 (equal weights); normalised here to a density.

use std::f64::consts::TAU;

use crate::{Psd, SpectraError, gaps};

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
    series: Vec<f64>,
}

/// Share of its usual 1/2 below which `CC` or `SS` counts as nothing.
const NOTHING: f64 = 1e-10;

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
        let mut phasors = Phasors::new(t_s.len());
        let bins = (0..settings.bins)
            .map(|k| {
                phasors.turn_to(&t_s, &settings, k);
                phasors.bin(settings.floating_mean)
            })
            .collect();
        Ok(Self {
            settings,
            t_s,
            bins,
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
            phasors: Phasors::new(self.t_s.len()),
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
        let count = x.len() as f64;
        for (k, (p, bin)) in psd.iter_mut().zip(&self.bins).enumerate() {
            scratch.phasors.turn_to(&self.t_s, &self.settings, k);
            let [yc, ys] = scratch.phasors.projections(&scratch.series);
            // the mean of the series is gone: yc and ys are the same with a mean of their own
            let along = yc * bin.cos_tau + ys * bin.sin_tau;
            let across = ys * bin.cos_tau - yc * bin.sin_tau;
            let power = along * along * bin.inverse_cc + across * across * bin.inverse_ss;
            *p = power * count / self.settings.fs_hz;
        }
        Ok(())
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

/// Cosine and sine of every sample at the present frequency, turned from bin to bin by one complex
/// product: no sine is computed but every 128 bins, which keeps the rounding below 3e-14.
#[derive(Clone, Debug)]
struct Phasors {
    cos: Vec<f64>,
    sin: Vec<f64>,
    step_cos: Vec<f64>,
    step_sin: Vec<f64>,
}

impl Phasors {
    fn new(samples: usize) -> Self {
        let zeros = vec![0.0; samples];
        Self {
            cos: zeros.clone(),
            sin: zeros.clone(),
            step_cos: zeros.clone(),
            step_sin: zeros,
        }
    }

    /// From bin `k - 1` to bin `k`; bins come in order from 0.
    fn turn_to(&mut self, t_s: &[f64], settings: &LombScargleSettings, k: usize) {
        if k.is_multiple_of(128) {
            for (i, t) in t_s.iter().enumerate() {
                (self.sin[i], self.cos[i]) = (TAU * settings.at(k) * t).sin_cos();
                (self.step_sin[i], self.step_cos[i]) = (TAU * settings.step_hz * t).sin_cos();
            }
            return;
        }
        let turned = self.cos.iter_mut().zip(&mut self.sin);
        for ((c, s), (dc, ds)) in turned.zip(self.step_cos.iter().zip(&self.step_sin)) {
            (*c, *s) = (*c * dc - *s * ds, *s * dc + *c * ds);
        }
    }

    /// `<x cos>` and `<x sin>`, in eight partial sums that fill a vector register.
    fn projections(&self, x: &[f64]) -> [f64; 2] {
        const LANES: usize = 8;
        let (mut with_cos, mut with_sin) = ([0.0; LANES], [0.0; LANES]);
        let whole = x.len() - x.len() % LANES;
        for i in (0..whole).step_by(LANES) {
            let (x, c, s) = (
                &x[i..i + LANES],
                &self.cos[i..i + LANES],
                &self.sin[i..i + LANES],
            );
            for l in 0..LANES {
                with_cos[l] += x[l] * c[l];
                with_sin[l] += x[l] * s[l];
            }
        }
        for i in whole..x.len() {
            with_cos[0] += x[i] * self.cos[i];
            with_sin[0] += x[i] * self.sin[i];
        }
        let count = x.len() as f64;
        [
            with_cos.iter().sum::<f64>() / count,
            with_sin.iter().sum::<f64>() / count,
        ]
    }

    /// Sums over the samples of a few numbers made of cosine and sine, each in eight parts that fill a
    /// vector register.
    fn sums<const N: usize>(&self, of: impl Fn(f64, f64) -> [f64; N]) -> [f64; N] {
        const LANES: usize = 8;
        let mut parts = [[0.0; LANES]; N];
        let (cos, sin) = (self.cos.chunks_exact(LANES), self.sin.chunks_exact(LANES));
        let rest = cos.remainder().iter().zip(sin.remainder());
        for (c, s) in cos.zip(sin) {
            for l in 0..LANES {
                let values = of(c[l], s[l]);
                for n in 0..N {
                    parts[n][l] += values[n];
                }
            }
        }
        for (c, s) in rest {
            let values = of(*c, *s);
            for n in 0..N {
                parts[n][0] += values[n];
            }
        }
        parts.map(|part| part.iter().sum())
    }

    /// The averages of the present frequency.
    fn bin(&self, floating_mean: bool) -> Bin {
        let count = self.cos.len() as f64;
        let means = self.sums(|c, s| [c, s, c * c, s * s, c * s]);
        let [c, s, cc, ss, cs] = means.map(|sum| sum / count);
        let [mean_cos, mean_sin] = if floating_mean { [c, s] } else { [0.0; 2] };
        let cc = cc - mean_cos * mean_cos;
        let ss = ss - mean_sin * mean_sin;
        let cs = cs - mean_cos * mean_sin;
        let (sin_tau, cos_tau) = (0.5 * (2.0 * cs).atan2(cc - ss)).sin_cos();
        // summed at this phase, where the smaller of the two keeps its digits
        let squares = self.sums(|c, s| {
            let (c, s) = (c - mean_cos, s - mean_sin);
            let (along, across) = (c * cos_tau + s * sin_tau, s * cos_tau - c * sin_tau);
            [along * along, across * across]
        });
        let inverse = |sum: f64| {
            let v = sum / count;
            if v > NOTHING { 1.0 / v } else { 0.0 }
        };
        Bin {
            cos_tau,
            sin_tau,
            inverse_cc: inverse(squares[0]),
            inverse_ss: inverse(squares[1]),
        }
    }
}
