//! Power spectral densities of FOGM plus white noise: as printed, continuous, sampled, and the
//! expectation of a periodogram.
//!
//! ```text
//! as printed   2 tau s^2 / (1 + (2 pi f tau)^2) + (2/fs) w^2                        [M23] Eq. 17
//! continuous   4 tau s^2 / (1 + (2 pi f tau)^2) + (2/fs) w^2                        erratum E6
//! sampled      (2/fs) [ s^2 (1 - a^2) / (1 - 2 a cos(2 pi f/fs) + a^2) + w^2 ]      erratum E8
//! periodogram  sampled - (2/fs) s^2 (2/n) Re[ z (1 - z^n) / (1 - z)^2 ],   z = a exp(2 pi i f/fs)
//! ```
//!
//! with `s = sigma_HSF`, `w = sigma_TN`, `a = exp(-1/(fs tau))`. All are per Hz for `f` in
//! `[0, fs/2]` (\[M23\] prints `[0, pi fs)`, the range of an angular frequency: erratum E7). The
//! last two integrate over that band to `s^2 + w^2`. The continuous form does so only for an
//! infinite band, and the printed one counts half of the FOGM: its first term is two-sided.
//!
//! Sampling folds what lies above `fs/2` back: for `tau` far above `1/fs` the sampled density at
//! `fs/2` is `pi^2/4` times the continuous one, and equal to it at low frequency.
//!
//! The last form is what the periodogram of `n` samples has on average: the sampled density seen
//! through the rectangular window, whose leakage fills what the steep FOGM leaves empty.
//!
//! Source: \[M23\] Eq. 17; Percival & Walden, Spectral Analysis for Physical Applications (1993),
//! sections 6.3 (expected periodogram) and 9.2 (AR(1)); errata E6, E7 and E8.

use std::f64::consts::{PI, TAU};

use crate::FogmWhite;

/// Which expression stands for the density of FOGM plus white noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Density {
    /// \[M23\] Eq. 17 as printed, [`as_printed`].
    AsPrinted,
    /// One-sided and continuous in time, [`continuous`].
    Continuous,
    /// One-sided, of the sampled series, [`sampled`]: the right one for data.
    #[default]
    Sampled,
}

impl Density {
    /// One-sided density at `frequency_hz` of a series sampled at `fs_hz`, unit^2/Hz.
    #[must_use]
    pub fn at(self, process: FogmWhite, frequency_hz: f64, fs_hz: f64) -> f64 {
        match self {
            Self::AsPrinted => as_printed(process, frequency_hz, fs_hz),
            Self::Continuous => continuous(process, frequency_hz, fs_hz),
            Self::Sampled => sampled(process, frequency_hz, fs_hz),
        }
    }
}

fn white(process: FogmWhite, fs_hz: f64) -> f64 {
    2.0 / fs_hz * process.sigma_white() * process.sigma_white()
}

/// \[M23\] Eq. 17 as printed: white noise one-sided, FOGM two-sided (erratum E6). unit^2/Hz.
///
/// Its `sigma_HSF` is [`printed_sigma_hsf`](crate::printed_sigma_hsf) of the true one.
#[must_use]
pub fn as_printed(process: FogmWhite, frequency_hz: f64, fs_hz: f64) -> f64 {
    let (s, tau) = (process.fogm().sigma(), process.fogm().tau_s());
    let x = TAU * frequency_hz * tau;
    2.0 * tau * s * s / (1.0 + x * x) + white(process, fs_hz)
}

/// One-sided density of the process in continuous time, with the white noise of samples at `fs_hz`.
/// unit^2/Hz.
#[must_use]
pub fn continuous(process: FogmWhite, frequency_hz: f64, fs_hz: f64) -> f64 {
    let (s, tau) = (process.fogm().sigma(), process.fogm().tau_s());
    let x = TAU * frequency_hz * tau;
    4.0 * tau * s * s / (1.0 + x * x) + white(process, fs_hz)
}

/// Exact one-sided density of the series sampled at `fs_hz`. unit^2/Hz.
///
/// ```
/// use fogm_fit::{Fogm, FogmWhite, continuous, sampled};
///
/// let process = FogmWhite::new(Fogm::new(3.58, 161.0)?, 0.0)?;
/// let fold = sampled(process, 5.0, 10.0) / continuous(process, 5.0, 10.0);
/// assert!((fold - std::f64::consts::PI.powi(2) / 4.0).abs() < 1e-4);
/// # Ok::<(), fogm_fit::FogmError>(())
/// ```
#[must_use]
pub fn sampled(process: FogmWhite, frequency_hz: f64, fs_hz: f64) -> f64 {
    let s = process.fogm().sigma();
    let step = Step::new(1.0 / (fs_hz * process.fogm().tau_s()));
    2.0 / fs_hz * s * s * step.gain(Bin::new(frequency_hz / fs_hz)) + white(process, fs_hz)
}

/// Expectation of the periodogram of `n` samples at `fs_hz`, one-sided: `2/(n fs) |sum y e^..|^2`.
/// unit^2/Hz.
///
/// At multiples of `fs/n` it also holds when the series' own mean was removed.
#[must_use]
pub fn expected_periodogram(process: FogmWhite, frequency_hz: f64, fs_hz: f64, n: usize) -> f64 {
    let s = process.fogm().sigma();
    let step = Step::new(1.0 / (fs_hz * process.fogm().tau_s()));
    let gain = step.gain_of_window(Bin::new(frequency_hz / fs_hz), n as f64);
    2.0 / fs_hz * s * s * gain + white(process, fs_hz)
}

/// The decay over one step, with the small quantities that `1 - a` would lose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    /// dt/tau.
    pub(crate) x: f64,
    /// a = exp(-x).
    pub(crate) a: f64,
    /// 1 - a.
    pub(crate) one_minus_a: f64,
    /// 1 - a^2.
    pub(crate) one_minus_a2: f64,
}

impl Step {
    pub(crate) fn new(x: f64) -> Self {
        Self {
            x,
            a: (-x).exp(),
            one_minus_a: -(-x).exp_m1(),
            one_minus_a2: -(-2.0 * x).exp_m1(),
        }
    }

    /// |1 - z|^2 = 1 - 2 a cos + a^2 without cancellation.
    fn distance2(self, bin: Bin) -> f64 {
        self.one_minus_a * self.one_minus_a + 4.0 * self.a * bin.sin2_half
    }

    /// Density of unit variance in units of 2/fs.
    pub(crate) fn gain(self, bin: Bin) -> f64 {
        self.one_minus_a2 / self.distance2(bin)
    }

    /// What a rectangular window of `n` samples takes from `gain`: `end` is `1 - z^n`, complex.
    fn leak(self, bin: Bin, n: f64, end: (f64, f64)) -> f64 {
        let d2 = self.distance2(bin);
        // Re[z (1 - z^n) (1 - z*)^2] / |1 - z|^4
        let z = (self.a * bin.cos, self.a * bin.sin);
        let r = (self.one_minus_a + 2.0 * self.a * bin.sin2_half, z.1);
        let square = (r.0 * r.0 - r.1 * r.1, 2.0 * r.0 * r.1);
        let zt = (z.0 * end.0 - z.1 * end.1, z.0 * end.1 + z.1 * end.0);
        2.0 / n * (zt.0 * square.0 - zt.1 * square.1) / (d2 * d2)
    }

    /// Expected periodogram of unit variance in units of 2/fs.
    fn gain_of_window(self, bin: Bin, n: f64) -> f64 {
        let angle = TAU * (bin.cycles * n).fract();
        let decayed = (-self.x * n).exp();
        let half = (0.5 * angle).sin();
        let end = (
            self.end_of(n) + 2.0 * decayed * half * half,
            -decayed * angle.sin(),
        );
        self.gain(bin) - self.leak(bin, n, end)
    }

    /// The same at a multiple of fs/n, where `1 - z^n` is `end`.
    #[cfg(feature = "fit")]
    pub(crate) fn gain_on_grid(self, bin: Bin, n: f64, end: f64) -> f64 {
        self.gain(bin) - self.leak(bin, n, (end, 0.0))
    }

    /// 1 - a^n.
    pub(crate) fn end_of(self, n: f64) -> f64 {
        -(-self.x * n).exp_m1()
    }
}

/// One frequency, with the trigonometry that all parameters share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bin {
    /// f/fs.
    cycles: f64,
    cos: f64,
    sin: f64,
    /// sin^2(pi f/fs).
    sin2_half: f64,
}

impl Bin {
    pub(crate) fn new(cycles: f64) -> Self {
        let (sin, cos) = (TAU * cycles).sin_cos();
        let half = (PI * cycles).sin();
        Self {
            cycles,
            cos,
            sin,
            sin2_half: half * half,
        }
    }
}
