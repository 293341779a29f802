//! Thomson's multitaper estimate and his F-test for lines.
//!
//! With Slepian tapers `v_k` of unit energy and concentration `lambda_k`:
//!
//! ```text
//! Y_k(f) = sum_n v_k[n] x[n] exp(-2 pi i f n)
//! S(f)   = sum_k g_k |Y_k|^2 / fs / sum_k g_k,   nu = 2 (sum g_k)^2 / sum g_k^2
//! g_k    = 1 | lambda_k | lambda_k b_k^2,   b_k = S / (lambda_k S + (1 - lambda_k) sigma^2 / fs)
//! C(f)   = sum_k U_k Y_k / sum_k U_k^2,   U_k = sum_n v_k[n]
//! F(f)   = (K - 1) |C|^2 sum_k U_k^2 / sum_k |Y_k - C U_k|^2   ~ F(2, 2K - 2) where no line is
//! ```
//!
//! A line `A cos(2 pi f t + phi)` has `C = (A/2) exp(i phi)`. The adaptive weights (third form) keep what
//! leaks from strong parts out of weak ones; they are iterated to a fixed point in every bin.
//!
//! Source: Thomson, Proc. IEEE 70 (1982) 1055, Sections V, XIII; Percival & Walden (1993), Eqs. 368a, 370b, 499c.

use std::sync::Arc;

use fourier::{Complex, RealToComplex};

use crate::welch::{frequencies, trimmed};
use crate::{Psd, Slepian, SpectraError};

mod settings;

pub use settings::{MultitaperSettings, TaperWeights};

/// A plan for the multitaper estimate of series of one length.
///
/// ```
/// use spectra::{Multitaper, MultitaperSettings};
///
/// let x: Vec<f64> = (0..500).map(|n| (0.618_034 * f64::from(n * n)).fract()).collect();
/// let multitaper = Multitaper::new(MultitaperSettings::new(500, 4.0, 2.0))?;
/// let spectrum = multitaper.process(&x)?;
/// assert_eq!(multitaper.tapers().count(), 7);
/// assert!(spectrum.dof[20] > 13.0 && spectrum.dof[20] <= 14.0);
/// # Ok::<(), spectra::SpectraError>(())
/// ```
#[derive(Clone)]
pub struct Multitaper {
    settings: MultitaperSettings,
    tapers: Slepian,
    /// `U_k`, exactly 0 for antisymmetric tapers.
    pub(crate) sums: Vec<f64>,
    fft: Arc<dyn RealToComplex<f64>>,
}

/// Memory of one estimate at a time, made by [`Multitaper::make_scratch`].
#[derive(Clone, Debug)]
pub struct MultitaperScratch {
    pub(crate) series: Vec<f64>,
    padded: Vec<f64>,
    /// `Y_k` of every bin, taper by taper.
    pub(crate) coefficients: Vec<Complex<f64>>,
    fft: Vec<Complex<f64>>,
}

impl std::fmt::Debug for Multitaper {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Multitaper")
            .field("settings", &self.settings)
            .finish_non_exhaustive()
    }
}

impl Multitaper {
    /// A plan; computes the tapers.
    ///
    /// # Errors
    ///
    /// [`SpectraError::TooShort`] below four samples, [`SpectraError::Bandwidth`],
    /// [`SpectraError::Tapers`] unless there are 2 to `2 N W` of them, [`SpectraError::Transform`]
    /// shorter than the series, [`SpectraError::NotPositive`] for the sampling frequency.
    pub fn new(settings: MultitaperSettings) -> Result<Self, SpectraError> {
        let MultitaperSettings {
            samples,
            tapers,
            time_half_bandwidth,
            ..
        } = settings;
        SpectraError::positive("fs_hz", settings.fs_hz)?;
        if samples < 4 {
            return Err(SpectraError::TooShort {
                got: samples,
                need: 4,
            });
        }
        if settings.transform < samples {
            return Err(SpectraError::Transform {
                transform: settings.transform,
                samples,
            });
        }
        let slepian = Slepian::new(samples, time_half_bandwidth, tapers.max(1))?;
        let most = settings.most_tapers();
        if tapers < 2 || tapers > most {
            return Err(SpectraError::Tapers {
                got: tapers,
                least: 2,
                most,
            });
        }
        let sums = (0..tapers)
            .map(|k| match k % 2 {
                0 => slepian.taper(k).iter().sum(),
                _ => 0.0,
            })
            .collect();
        let fft = fourier::real_forward(settings.transform);
        Ok(Self {
            settings,
            tapers: slepian,
            sums,
            fft,
        })
    }

    /// What the plan was made of.
    #[must_use]
    pub fn settings(&self) -> &MultitaperSettings {
        &self.settings
    }

    /// The tapers.
    #[must_use]
    pub fn tapers(&self) -> &Slepian {
        &self.tapers
    }

    /// Number of bins: half a transform and one.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.settings.transform / 2 + 1
    }

    /// Frequency of each bin, Hz.
    #[must_use]
    pub fn frequency_hz(&self) -> Vec<f64> {
        frequencies(self.settings.transform, self.settings.fs_hz)
    }

    /// Half-bandwidth of the estimate, Hz: `W = NW fs / N`.
    #[must_use]
    pub fn half_bandwidth_hz(&self) -> f64 {
        self.settings.time_half_bandwidth * self.settings.fs_hz / self.settings.samples as f64
    }

    /// Memory for the functions that allocate nothing.
    #[must_use]
    pub fn make_scratch(&self) -> MultitaperScratch {
        MultitaperScratch {
            series: vec![0.0; self.settings.samples],
            padded: self.fft.make_input_vec(),
            coefficients: vec![Complex::ZERO; self.bins() * self.tapers.count()],
            fft: self.fft.make_scratch_vec(),
        }
    }

    /// Writes the one-sided density of `x`, unit^2/Hz, and the degrees of freedom of each bin;
    /// allocates nothing.
    ///
    /// # Errors
    ///
    /// [`SpectraError::WrongLength`], [`SpectraError::NotFinite`].
    ///
    /// # Panics
    ///
    /// If `psd` or `dof` does not hold [`bins`](Self::bins) values, or `scratch` is of another plan.
    pub fn process_into(
        &self,
        x: &[f64],
        scratch: &mut MultitaperScratch,
        psd: &mut [f64],
        dof: &mut [f64],
    ) -> Result<(), SpectraError> {
        let bins = self.bins();
        assert!(
            psd.len() == bins && dof.len() == bins,
            "one place for each of {bins} bins"
        );
        self.load(x, scratch)?;
        self.transform(scratch);
        let variance =
            scratch.series.iter().map(|v| v * v).sum::<f64>() / scratch.series.len() as f64;
        for (k, (p, d)) in psd.iter_mut().zip(dof).enumerate() {
            let (density, freedom) = self.combine(k, variance, &scratch.coefficients);
            let sides = if self.single(k) { 1.0 } else { 2.0 };
            *p = sides * density / self.settings.fs_hz;
            *d = 0.5 * sides * freedom;
        }
        Ok(())
    }

    /// One-sided density of `x`.
    ///
    /// # Errors
    ///
    /// As [`process_into`](Self::process_into).
    pub fn process(&self, x: &[f64]) -> Result<Psd, SpectraError> {
        let (mut psd, mut dof) = (vec![0.0; self.bins()], vec![0.0; self.bins()]);
        self.process_into(x, &mut self.make_scratch(), &mut psd, &mut dof)?;
        Ok(Psd {
            frequency_hz: self.frequency_hz(),
            psd,
            dof,
            fs_hz: self.settings.fs_hz,
        })
    }

    /// Writes the F statistic of every bin, with 2 and 2K - 2 degrees of freedom where no line is, and
    /// the amplitude `C` (unit of `x`; a line of amplitude `A` has `|C| = A/2`, and the phase at the
    /// first sample); allocates nothing.
    ///
    /// Within the half-bandwidth of 0 and of fs/2 a line meets its own image: those bins say nothing.
    ///
    /// # Errors
    ///
    /// [`SpectraError::WrongLength`], [`SpectraError::NotFinite`].
    ///
    /// # Panics
    ///
    /// If `f` or `amplitude` does not hold [`bins`](Self::bins) values, or `scratch` is of another plan.
    pub fn f_test_into(
        &self,
        x: &[f64],
        scratch: &mut MultitaperScratch,
        f: &mut [f64],
        amplitude: &mut [Complex<f64>],
    ) -> Result<(), SpectraError> {
        let bins = self.bins();
        assert!(
            f.len() == bins && amplitude.len() == bins,
            "one place for each of {bins} bins"
        );
        self.load(x, scratch)?;
        self.transform(scratch);
        for k in 0..bins {
            let of_bin = scratch.coefficients[k..].iter().step_by(bins);
            let fit = LineFit::new(&self.sums, of_bin.copied());
            f[k] = fit.f;
            amplitude[k] = fit.amplitude;
        }
        Ok(())
    }

    /// Correlation of the estimates of bins `j` apart, `j = 0, 1, ...`, for white noise: what
    /// [`LogAverage`](crate::LogAverage) needs for honest degrees of freedom.
    ///
    /// ```text
    /// c_j = A_j / A_0,   A_j = sum_kl |sum_n v_k[n] v_l[n] exp(-2 pi i j n / N)|^2
    /// ```
    #[must_use]
    pub fn bin_correlation(&self) -> Vec<f64> {
        let mut scratch = self.make_scratch();
        let mut correlation = vec![0.0; self.bins()];
        let mut product = vec![Complex::ZERO; self.bins()];
        let count = self.tapers.count();
        for (k, l) in (0..count).flat_map(|k| (0..=k).map(move |l| (k, l))) {
            scratch.padded.fill(0.0);
            let pairs = self.tapers.taper(k).iter().zip(self.tapers.taper(l));
            for (p, (a, b)) in scratch.padded.iter_mut().zip(pairs) {
                *p = a * b;
            }
            self.run_fft(&mut scratch.padded, &mut product, &mut scratch.fft);
            let weight = if k == l { 1.0 } else { 2.0 };
            for (c, z) in correlation.iter_mut().zip(&product) {
                *c += weight * z.norm_sqr();
            }
        }
        trimmed(correlation)
    }

    /// Checks `x` and copies it, without its trend.
    pub(crate) fn load(
        &self,
        x: &[f64],
        scratch: &mut MultitaperScratch,
    ) -> Result<(), SpectraError> {
        if x.len() != self.settings.samples {
            return Err(SpectraError::WrongLength {
                got: x.len(),
                planned: self.settings.samples,
            });
        }
        SpectraError::finite(x, 0)?;
        self.settings.detrend.apply_into(x, &mut scratch.series);
        Ok(())
    }

    /// `Y_k` of the series in `scratch`.
    pub(crate) fn transform(&self, scratch: &mut MultitaperScratch) {
        let samples = self.settings.samples;
        let MultitaperScratch {
            series,
            padded,
            coefficients,
            fft,
        } = scratch;
        for (k, out) in coefficients.chunks_exact_mut(self.bins()).enumerate() {
            padded[samples..].fill(0.0);
            for (p, (x, v)) in padded
                .iter_mut()
                .zip(series.iter().zip(self.tapers.taper(k)))
            {
                *p = x * v;
            }
            self.run_fft(padded, out, fft);
        }
    }

    fn run_fft(&self, input: &mut [f64], out: &mut [Complex<f64>], fft: &mut [Complex<f64>]) {
        let done = self.fft.process_with_scratch(input, out, fft);
        assert!(done.is_ok(), "scratch of another plan: {done:?}");
    }

    /// Two-sided density times fs, and degrees of freedom, of bin `k` of a series of this variance.
    fn combine(&self, k: usize, variance: f64, coefficients: &[Complex<f64>]) -> (f64, f64) {
        let bins = self.bins();
        let power = |t: usize| coefficients[t * bins + k].norm_sqr();
        let lambda = self.tapers.concentration();
        let mean = |weight: &dyn Fn(usize) -> f64| {
            let (mut sum, mut weights, mut squares) = (0.0, 0.0, 0.0);
            for t in 0..lambda.len() {
                let g = weight(t);
                sum += g * power(t);
                weights += g;
                squares += g * g;
            }
            (sum / weights, 2.0 * weights * weights / squares)
        };
        match self.settings.weights {
            TaperWeights::Uniform => mean(&|_| 1.0),
            TaperWeights::Eigenvalue => mean(&|t| lambda[t]),
            TaperWeights::Adaptive => {
                let mut density = 0.5 * (power(0) + power(1));
                let mut freedom = 2.0;
                // converges by a factor of about (1 - lambda) a step; a bin without power stays so
                for _ in 0..200 {
                    if density <= 0.0 {
                        return (0.0, 2.0 * lambda.len() as f64);
                    }
                    let before = density;
                    (density, freedom) = mean(&|t| {
                        let b = before / (lambda[t] * before + (1.0 - lambda[t]) * variance);
                        lambda[t] * b * b
                    });
                    if (density - before).abs() <= 1e-13 * density {
                        break;
                    }
                }
                (density, freedom)
            }
        }
    }

    fn single(&self, k: usize) -> bool {
        k == 0 || 2 * k == self.settings.transform
    }
}

/// The regression of the eigencoefficients of one frequency on those of a line there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LineFit {
    pub(crate) f: f64,
    pub(crate) amplitude: Complex<f64>,
    /// Mean square of what the line leaves: the two-sided density times fs.
    pub(crate) residual: f64,
}

impl LineFit {
    pub(crate) fn new(
        sums: &[f64],
        coefficients: impl Iterator<Item = Complex<f64>> + Clone,
    ) -> Self {
        let energy: f64 = sums.iter().map(|u| u * u).sum();
        let pairs = sums.iter().zip(coefficients);
        let product: Complex<f64> = pairs.clone().map(|(u, y)| y * u).sum();
        let amplitude = product / energy;
        let residual: f64 = pairs.map(|(u, y)| (y - amplitude * u).norm_sqr()).sum();
        let residual = residual / (sums.len() - 1) as f64;
        let line = amplitude.norm_sqr() * energy;
        Self {
            // a series of zeros has no line
            f: if line > 0.0 { line / residual } else { 0.0 },
            amplitude,
            residual,
        }
    }
}
