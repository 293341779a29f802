//! Lines in a spectrum: found by the F-test, refined far below a bin.
//!
//! The bin with the largest F is tested against the number of bins searched,
//!
//! ```text
//! ln P = min(0, ln m + ln P1),   P1 = (1 + F/(K - 1))^-(K - 1)          union bound over m bins
//! ```
//!
//! its frequency moved to the maximum of `|G(f)|`, `G(f) = sum_n w[n] (x[n] - image[n]) exp(-2 pi i f n)`
//! with `w = sum_k U_k v_k` and the image of the line at `-f`, the line taken from the series, and the search goes on in what is left. At the end
//! every line is refined once more with all others removed. With the noise `sigma^2 = S fs / 2` around
//! the line, and `n` counted from the middle,
//!
//! ```text
//! var(f) = sigma^2 fs^2 / (2 pi^2 A^2) sum n^2 w^2 / (sum n^2 w)^2
//! ```
//!
//! which for constant `w` is the Cramer-Rao bound `6 sigma^2 fs^2 / (pi^2 A^2 N^3)`.
//!
//! Source: Thomson (1982), Section XIII; Percival & Walden (1993), Section 10.11; bound: Rife & Boorstyn, IEEE
//! Trans. Inf. Theory 20 (1974) 591. The variance for a taper is the same linearisation with weights.

use std::f64::consts::{PI, TAU};

use fourier::Complex;

use crate::multitaper::LineFit;
use crate::{Multitaper, MultitaperScratch, SpectraError};

/// A line `A cos(2 pi f t + phase)`, `t` from the first sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Its standard deviation, Hz.
    pub sigma_frequency_hz: f64,
    /// Amplitude `A`, unit of the series.
    pub amplitude: f64,
    /// Its standard deviation.
    pub sigma_amplitude: f64,
    /// Phase at the first sample, rad in (-pi, pi].
    pub phase_rad: f64,
    /// F statistic at the bin where it was found.
    pub f: f64,
    /// Natural logarithm of the probability that noise alone shows so large an F anywhere in the
    /// search.
    pub ln_p: f64,
}

/// Natural logarithm of the probability that one F of Thomson's test with `tapers` tapers exceeds `f`
/// where no line is: exact, F with 2 and 2K - 2 degrees of freedom. Never underflows.
///
/// ```
/// // three tapers: (1 + F/2)^-2
/// assert!((spectra::f_test_ln_p(2.0, 3) - 0.25_f64.ln()).abs() < 1e-15);
/// ```
#[must_use]
pub fn f_test_ln_p(f: f64, tapers: usize) -> f64 {
    let others = tapers.saturating_sub(1) as f64;
    -others * (f / others).ln_1p()
}

/// The working values of a line.
#[derive(Clone, Copy)]
struct Found {
    /// Frequency, rad a sample.
    omega: f64,
    /// `C` with its phase at the middle of the series.
    amplitude: Complex<f64>,
    f: f64,
    ln_p: f64,
}

impl Multitaper {
    /// Finds the lines of `x` that noise would show anywhere in the search with a probability below
    /// `alpha`, at most `most`, in the order of their frequency.
    ///
    /// Searched is all but the half-bandwidth at 0 and at fs/2. The union bound counts the padded bins,
    /// so that fewer than `alpha` of noise series show a line. Plans from
    /// [`MultitaperSettings::for_lines`](crate::MultitaperSettings::for_lines) are padded for this;
    /// without padding, a line between two bins may be missed. After the call, `scratch`
    /// holds the series without trend and lines: [`MultitaperScratch::remainder`].
    ///
    /// ```
    /// use spectra::{Multitaper, MultitaperSettings};
    ///
    /// let noise = |n: i32| (0.618_034 * f64::from(n * n)).fract();
    /// let x: Vec<f64> = (0..1000)
    ///     .map(|n| 0.8 * (0.713_04 * f64::from(n) + 0.4).cos() + noise(n))
    ///     .collect();
    /// let plan = Multitaper::new(MultitaperSettings::for_lines(1000, 4.0, std::f64::consts::TAU))?;
    /// let lines = plan.find_lines(&x, 1e-6, 5, &mut plan.make_scratch())?;
    /// let line = lines.iter().find(|l| (l.frequency_hz - 0.713_04).abs() < 1e-3).expect("found");
    /// assert!((line.amplitude - 0.8).abs() < 0.1);
    /// # Ok::<(), spectra::SpectraError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`SpectraError::Probability`] for `alpha`, [`SpectraError::WrongLength`],
    /// [`SpectraError::NotFinite`].
    ///
    /// # Panics
    ///
    /// If `scratch` is of another plan.
    pub fn find_lines(
        &self,
        x: &[f64],
        alpha: f64,
        most: usize,
        scratch: &mut MultitaperScratch,
    ) -> Result<Vec<Line>, SpectraError> {
        SpectraError::probability("alpha", alpha)?;
        self.load(x, scratch)?;
        let weights = self.line_weights();
        let searched = self.searched_bins();
        let mut found: Vec<Found> = vec![];
        while found.len() < most && !searched.is_empty() {
            self.transform(scratch);
            let Some((bin, f)) = self.largest_f(searched.clone(), scratch) else {
                break;
            };
            let ln_p = (searched.len() as f64).ln() + f_test_ln_p(f, self.sums.len());
            if ln_p >= alpha.ln() {
                break;
            }
            let omega = TAU * bin as f64 / self.settings().transform as f64;
            let (omega, amplitude) = self.refine(omega, &weights, &scratch.series);
            add_line(&mut scratch.series, omega, -amplitude);
            found.push(Found {
                omega,
                amplitude,
                f,
                ln_p: ln_p.min(0.0),
            });
        }
        // twice round: each line once more without what the others left in it
        for _ in 0..2 {
            for line in &mut found {
                add_line(&mut scratch.series, line.omega, line.amplitude);
                (line.omega, line.amplitude) = self.refine(line.omega, &weights, &scratch.series);
                add_line(&mut scratch.series, line.omega, -line.amplitude);
            }
        }
        let mut lines: Vec<Line> = found
            .iter()
            .map(|line| self.describe(line, &weights, &scratch.series))
            .collect();
        lines.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        Ok(lines)
    }

    /// `w = sum_k U_k v_k`: the one taper that gives `C`.
    fn line_weights(&self) -> Vec<f64> {
        let mut weights = vec![0.0; self.settings().samples];
        for (k, sum) in self.sums.iter().enumerate().step_by(2) {
            for (w, v) in weights.iter_mut().zip(self.tapers().taper(k)) {
                *w += sum * v;
            }
        }
        weights
    }

    /// Bins further than the half-bandwidth from 0 and from fs/2.
    fn searched_bins(&self) -> std::ops::Range<usize> {
        let settings = self.settings();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive, far below the largest integer"
        )]
        let edge = (settings.time_half_bandwidth * settings.transform as f64
            / settings.samples as f64)
            .ceil() as usize;
        edge..(settings.transform / 2 + 1).saturating_sub(edge).max(edge)
    }

    fn largest_f(
        &self,
        searched: std::ops::Range<usize>,
        scratch: &MultitaperScratch,
    ) -> Option<(usize, f64)> {
        searched
            .map(|bin| {
                let of_bin = scratch.coefficients[bin..].iter().step_by(self.bins());
                (bin, LineFit::new(&self.sums, of_bin.copied()).f)
            })
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The frequency near `omega` of a line, and its `C`. Each round knows better what leaks from the
    /// image at `-omega`, by the height of the sidelobes there.
    fn refine(&self, omega: f64, weights: &[f64], series: &[f64]) -> (f64, Complex<f64>) {
        let mut line = climb(omega, NO_LINE, weights, series);
        for _ in 0..4 {
            let before = line;
            line = climb(line.0, (-line.0, line.1.conj()), weights, series);
            if (line.1 - before.1).norm() <= 1e-13 * line.1.norm() {
                break;
            }
        }
        line
    }

    fn describe(&self, line: &Found, weights: &[f64], remainder: &[f64]) -> Line {
        let settings = self.settings();
        let n = settings.samples as f64;
        let middle = 0.5 * (n - 1.0);
        let of_taper =
            |k: usize| moments(self.tapers().taper(k), remainder, line.omega, NO_LINE)[0];
        let coefficients: Vec<Complex<f64>> = (0..self.sums.len()).map(of_taper).collect();
        // phases from the middle: the tapers' sums stay real
        let noise = LineFit::new(&self.sums, coefficients.into_iter()).residual;
        let (mut second, mut second_square, mut square) = (0.0, 0.0, 0.0);
        for (i, w) in weights.iter().enumerate() {
            let m = i as f64 - middle;
            second += m * m * w;
            second_square += m * m * w * w;
            square += w * w;
        }
        let gain: f64 = weights.iter().sum();
        let amplitude = 2.0 * line.amplitude.norm();
        let sigma_omega = (2.0 * noise * second_square).sqrt() / (amplitude * second);
        let phase_rad = line.amplitude.arg() - line.omega * middle;
        Line {
            frequency_hz: line.omega * settings.fs_hz / TAU,
            sigma_frequency_hz: sigma_omega * settings.fs_hz / TAU,
            amplitude,
            sigma_amplitude: (2.0 * noise * square).sqrt() / gain,
            phase_rad: PI - (PI - phase_rad).rem_euclid(TAU),
            f: line.f,
            ln_p: line.ln_p,
        }
    }
}

impl MultitaperScratch {
    /// The series of the last call without its trend and, after
    /// [`Multitaper::find_lines`], without its lines.
    #[must_use]
    pub fn remainder(&self) -> &[f64] {
        &self.series
    }
}

/// No line to take away: any frequency, no amplitude.
const NO_LINE: (f64, Complex<f64>) = (0.0, Complex::ZERO);

/// The frequency, near `omega`, where `|G|` is largest, and `C` there, by Newton's method; `image` is taken from
/// the series.
fn climb(
    omega: f64,
    image: (f64, Complex<f64>),
    weights: &[f64],
    series: &[f64],
) -> (f64, Complex<f64>) {
    let start = omega;
    // within one bin of the series, by a quarter of it at a time
    let bin = TAU / series.len() as f64;
    let mut omega = omega;
    for _ in 0..30 {
        let [g, g1, g2] = moments(weights, series, omega, image);
        let slope = 2.0 * (g.conj() * g1).re;
        let curvature = 2.0 * (g1.norm_sqr() + (g.conj() * g2).re);
        let step = if curvature < 0.0 {
            -slope / curvature
        } else {
            0.25 * bin * slope.signum()
        };
        let next = (omega + step.clamp(-0.25 * bin, 0.25 * bin)).clamp(start - bin, start + bin);
        let moved = (next - omega).abs();
        omega = next;
        if moved <= 1e-9 * bin {
            break;
        }
    }
    let gain: f64 = weights.iter().sum();
    (omega, moments(weights, series, omega, image)[0] / gain)
}

/// `sum w (x - image) e`, and its first and second derivative by omega, `e = exp(-i omega n)` with `n` from the
/// middle; `image` is a frequency, rad a sample, and a complex amplitude.
fn moments(
    weights: &[f64],
    series: &[f64],
    omega: f64,
    image: (f64, Complex<f64>),
) -> [Complex<f64>; 3] {
    let middle = 0.5 * (series.len() as f64 - 1.0);
    let mut sums = [Complex::ZERO; 3];
    for (i, (w, x)) in weights.iter().zip(series).enumerate() {
        let n = i as f64 - middle;
        let (sin, cos) = (omega * n).sin_cos();
        let (image_sin, image_cos) = (image.0 * n).sin_cos();
        let rest = *x - image.1 * Complex::new(image_cos, image_sin);
        let term = Complex::new(cos, -sin) * rest * *w;
        sums[0] += term;
        sums[1] += term * n;
        sums[2] += term * (n * n);
    }
    [sums[0], sums[1] * -Complex::I, -sums[2]]
}

/// Adds `2 Re(C exp(i omega n))`, `n` from the middle.
fn add_line(series: &mut [f64], omega: f64, amplitude: Complex<f64>) {
    let middle = 0.5 * (series.len() as f64 - 1.0);
    for (i, x) in series.iter_mut().enumerate() {
        let (sin, cos) = (omega * (i as f64 - middle)).sin_cos();
        *x += 2.0 * (amplitude.re * cos - amplitude.im * sin);
    }
}
