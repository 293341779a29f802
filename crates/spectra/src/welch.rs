//! Welch's estimate: averaged periodograms of windowed, overlapping segments.
//!
//! ```text
//! X_s(k) = sum_n w[n] x[n + s S] exp(-2 pi i k n / N)
//! psd(k) = c_k / (K fs sum w^2) sum_s |X_s(k)|^2,   c_k = 2, but 1 at 0 and fs/2
//! nu     = 2 K / (1 + 2 sum_r (1 - r/K) rho_r),   rho_r = (sum_n w[n] w[n + r S] / sum w^2)^2
//! ```
//!
//! for `K` segments of `N` samples, each `S` after the one before. One segment without window is the
//! periodogram, for which Parseval's identity holds to rounding. Samples after the last whole segment
//! of a run are left out, and counted.
//!
//! Source: Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70; Percival & Walden (1993), Eqs. 289a, 292b.

use std::ops::Range;
use std::sync::Arc;

use fourier::{Complex, RealToComplex};

use crate::{Detrend, Psd, SpectraError, Window, gaps};

mod settings;

pub use settings::{Coverage, WelchSettings};

/// A plan for Welch's estimate: window, transform and normalisation.
///
/// ```
/// use spectra::{Welch, WelchSettings, whole};
///
/// let x: Vec<f64> = (0..1000).map(|n| f64::from(n * n % 17)).collect();
/// let welch = Welch::new(WelchSettings::half_overlap(200, 10.0))?;
/// let spectrum = welch.process(&x)?;
/// assert_eq!(spectrum.len(), 101);
/// assert!((spectrum.dof[1] - 17.15).abs() < 0.01); // nine segments of which neighbours share a half
///
/// // the same without allocating
/// let (mut scratch, mut psd) = (welch.make_scratch(), vec![0.0; welch.bins()]);
/// let used = welch.process_into(&x, &whole(&x), &mut scratch, &mut psd)?;
/// assert_eq!((psd, used.segments), (spectrum.psd, 9));
/// # Ok::<(), spectra::SpectraError>(())
/// ```
#[derive(Clone)]
pub struct Welch {
    settings: WelchSettings,
    window: Vec<f64>,
    window_power: f64,
    /// `rho_r` for r = 1, 2, ... while segments overlap.
    overlap_correlation: Vec<f64>,
    fft: Arc<dyn RealToComplex<f64>>,
}

/// Memory of one estimate at a time, made by [`Welch::make_scratch`].
#[derive(Clone, Debug)]
pub struct WelchScratch {
    samples: Vec<f64>,
    pub(crate) first: Vec<Complex<f64>>,
    pub(crate) second: Vec<Complex<f64>>,
    fft: Vec<Complex<f64>>,
}

impl std::fmt::Debug for Welch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Welch")
            .field("settings", &self.settings)
            .finish_non_exhaustive()
    }
}

impl Welch {
    /// A plan.
    ///
    /// # Errors
    ///
    /// [`SpectraError::TooShort`] for segments of fewer than two samples, [`SpectraError::Overlap`]
    /// of a whole segment or more, [`SpectraError::NotPositive`] for the sampling frequency.
    pub fn new(settings: WelchSettings) -> Result<Self, SpectraError> {
        let WelchSettings {
            segment, overlap, ..
        } = settings;
        SpectraError::positive("fs_hz", settings.fs_hz)?;
        if segment < 2 {
            return Err(SpectraError::TooShort {
                got: segment,
                need: 2,
            });
        }
        if overlap >= segment {
            return Err(SpectraError::Overlap { overlap, segment });
        }
        let window = settings.window.values(segment);
        let lagged = |lag: usize| -> f64 {
            let pairs = window.iter().zip(&window[lag..]);
            pairs.map(|(a, b)| a * b).sum()
        };
        let window_power = lagged(0);
        let overlap_correlation = (segment - overlap..segment)
            .step_by(segment - overlap)
            .map(|lag| (lagged(lag) / window_power).powi(2))
            .collect();
        Ok(Self {
            settings,
            overlap_correlation,
            window_power,
            window,
            fft: fourier::real_forward(segment),
        })
    }

    /// What the plan was made of.
    #[must_use]
    pub fn settings(&self) -> &WelchSettings {
        &self.settings
    }

    /// The window, one value for each sample of a segment.
    #[must_use]
    pub fn window(&self) -> &[f64] {
        &self.window
    }

    /// Number of bins: half a segment and one.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.settings.segment / 2 + 1
    }

    /// Frequency of each bin, Hz.
    #[must_use]
    pub fn frequency_hz(&self) -> Vec<f64> {
        frequencies(self.settings.segment, self.settings.fs_hz)
    }

    /// Memory for [`process_into`](Self::process_into) and its sibling for two series.
    #[must_use]
    pub fn make_scratch(&self) -> WelchScratch {
        WelchScratch {
            samples: self.fft.make_input_vec(),
            first: self.fft.make_output_vec(),
            second: self.fft.make_output_vec(),
            fft: self.fft.make_scratch_vec(),
        }
    }

    /// Writes the density of `x`, unit^2/Hz, from the segments that fit inside `runs`; allocates nothing.
    ///
    /// Runs shorter than a segment are left out. Values outside the runs are not read.
    ///
    /// # Errors
    ///
    /// [`SpectraError::TooShort`] if no run holds a segment, [`SpectraError::NotFinite`] inside a
    /// segment, [`SpectraError::Run`] outside the series.
    ///
    /// # Panics
    ///
    /// If `psd` does not hold [`bins`](Self::bins) values, or `scratch` is of another plan.
    pub fn process_into(
        &self,
        x: &[f64],
        runs: &[Range<usize>],
        scratch: &mut WelchScratch,
        psd: &mut [f64],
    ) -> Result<Coverage, SpectraError> {
        assert_eq!(psd.len(), self.bins(), "one place for each bin");
        let coverage = self.coverage(x.len(), runs)?;
        psd.fill(0.0);
        for start in self.starts(runs) {
            self.transform(x, start, scratch, false)?;
            for (p, z) in psd.iter_mut().zip(&scratch.first) {
                *p += z.re * z.re + z.im * z.im;
            }
        }
        for (k, p) in psd.iter_mut().enumerate() {
            *p *= self.scale(k, coverage.segments);
        }
        Ok(coverage)
    }

    /// Density of a series without gaps.
    ///
    /// # Errors
    ///
    /// As [`process_into`](Self::process_into).
    pub fn process(&self, x: &[f64]) -> Result<Psd, SpectraError> {
        self.process_runs(x, &gaps::whole(x))
    }

    /// Density of a series with gaps, from its `runs` ([`finite_runs`](crate::finite_runs),
    /// [`continuous_runs`](crate::continuous_runs)).
    ///
    /// # Errors
    ///
    /// As [`process_into`](Self::process_into).
    pub fn process_runs(&self, x: &[f64], runs: &[Range<usize>]) -> Result<Psd, SpectraError> {
        let mut psd = vec![0.0; self.bins()];
        self.process_into(x, runs, &mut self.make_scratch(), &mut psd)?;
        Ok(Psd {
            frequency_hz: self.frequency_hz(),
            psd,
            dof: self.dof(runs),
            fs_hz: self.settings.fs_hz,
        })
    }

    /// Equivalent degrees of freedom of each bin, for segments laid inside `runs`.
    #[must_use]
    pub fn dof(&self, runs: &[Range<usize>]) -> Vec<f64> {
        let (mut segments, mut variance) = (0.0, 0.0);
        for run in runs {
            let count = self.segments_in(run);
            segments += count as f64;
            variance += count as f64;
            for (r, rho) in self.overlap_correlation.iter().enumerate() {
                variance += 2.0 * count.saturating_sub(r + 1) as f64 * rho;
            }
        }
        let dof = if segments > 0.0 {
            2.0 * segments * segments / variance
        } else {
            0.0
        };
        (0..self.bins())
            .map(|k| dof / if self.single(k) { 2.0 } else { 1.0 })
            .collect()
    }

    /// Correlation of the estimates of bins `j` apart, `j = 0, 1, ...`, for white noise in one run of
    /// `segments`: what [`LogAverage`](crate::LogAverage) needs for honest degrees of freedom.
    ///
    /// ```text
    /// c_j = A_j / A_0,   A_j = sum_r (2 - [r = 0]) (1 - r/K) |sum_n w[n] w[n + r S] exp(-2 pi i j n / N)|^2
    /// ```
    #[must_use]
    pub fn bin_correlation(&self, segments: usize) -> Vec<f64> {
        let step = self.settings.segment - self.settings.overlap;
        let mut correlation = vec![0.0; self.bins()];
        let mut scratch = self.make_scratch();
        for r in 0..=self
            .overlap_correlation
            .len()
            .min(segments.saturating_sub(1))
        {
            let weight = if r == 0 { 1.0 } else { 2.0 } * (1.0 - r as f64 / segments as f64);
            scratch.samples.fill(0.0);
            let pairs = self.window.iter().zip(&self.window[r * step..]);
            for (s, (a, b)) in scratch.samples.iter_mut().zip(pairs) {
                *s = a * b;
            }
            self.run_fft(&mut scratch, false);
            for (c, z) in correlation.iter_mut().zip(&scratch.first) {
                *c += weight * z.norm_sqr();
            }
        }
        trimmed(correlation)
    }

    /// What the segments inside `runs` use of a series of `samples`.
    pub(crate) fn coverage(
        &self,
        samples: usize,
        runs: &[Range<usize>],
    ) -> Result<Coverage, SpectraError> {
        let WelchSettings {
            segment, overlap, ..
        } = self.settings;
        let mut coverage = Coverage::default();
        let mut longest = 0;
        for run in runs {
            if run.end > samples || run.start > run.end {
                return Err(SpectraError::Run {
                    start: run.start,
                    end: run.end,
                    samples,
                });
            }
            longest = longest.max(run.len());
            let count = self.segments_in(run);
            coverage.segments += count;
            if count > 0 {
                coverage.samples_used += segment + (count - 1) * (segment - overlap);
            }
        }
        coverage.samples_left_out = samples.saturating_sub(coverage.samples_used);
        if coverage.segments == 0 {
            return Err(SpectraError::TooShort {
                got: longest,
                need: segment,
            });
        }
        Ok(coverage)
    }

    /// Factor from a sum of `|X|^2` over `segments` to the one-sided density of bin `k`.
    pub(crate) fn scale(&self, k: usize, segments: usize) -> f64 {
        let sides = if self.single(k) { 1.0 } else { 2.0 };
        sides / (self.settings.fs_hz * self.window_power * segments as f64)
    }

    /// First sample of every segment inside `runs`.
    pub(crate) fn starts<'a>(
        &'a self,
        runs: &'a [Range<usize>],
    ) -> impl Iterator<Item = usize> + 'a {
        let step = self.settings.segment - self.settings.overlap;
        runs.iter()
            .flat_map(move |run| (0..self.segments_in(run)).map(move |s| run.start + s * step))
    }

    /// Transform of the segment of `x` that begins at `start`, into `first` or `second`.
    pub(crate) fn transform(
        &self,
        x: &[f64],
        start: usize,
        scratch: &mut WelchScratch,
        second: bool,
    ) -> Result<(), SpectraError> {
        let segment = &x[start..start + self.settings.segment];
        SpectraError::finite(segment, start)?;
        self.settings
            .detrend
            .apply_into(segment, &mut scratch.samples);
        for (s, w) in scratch.samples.iter_mut().zip(&self.window) {
            *s *= w;
        }
        self.run_fft(scratch, second);
        Ok(())
    }

    /// Whether bin `k` has no partner at a negative frequency.
    fn single(&self, k: usize) -> bool {
        k == 0 || 2 * k == self.settings.segment
    }

    fn segments_in(&self, run: &Range<usize>) -> usize {
        let WelchSettings {
            segment, overlap, ..
        } = self.settings;
        match run.len().checked_sub(segment) {
            Some(rest) => rest / (segment - overlap) + 1,
            None => 0,
        }
    }

    fn run_fft(&self, scratch: &mut WelchScratch, second: bool) {
        let out = if second {
            &mut scratch.second
        } else {
            &mut scratch.first
        };
        let done = self
            .fft
            .process_with_scratch(&mut scratch.samples, out, &mut scratch.fft);
        assert!(done.is_ok(), "scratch of another plan: {done:?}");
    }
}

/// Density of one segment, the whole series: a periodogram, two degrees of freedom a bin.
///
/// Without window and trend, `sum psd df = mean x^2` to rounding.
///
/// ```
/// use spectra::{Detrend, Window, periodogram};
/// let spectrum = periodogram(&[1.0, -2.0, 0.5, 3.0, 1.5], 2.0, Window::Boxcar, Detrend::None)?;
/// assert!((spectrum.variance().expect("uniform") - 16.5 / 5.0).abs() < 1e-14);
/// # Ok::<(), spectra::SpectraError>(())
/// ```
///
/// # Errors
///
/// As [`Welch::new`] and [`Welch::process_into`].
pub fn periodogram(
    x: &[f64],
    fs_hz: f64,
    window: Window,
    detrend: Detrend,
) -> Result<Psd, SpectraError> {
    Welch::new(WelchSettings {
        segment: x.len(),
        overlap: 0,
        window,
        detrend,
        fs_hz,
    })?
    .process(x)
}

/// Frequencies of the bins of a real transform of `length`.
pub(crate) fn frequencies(length: usize, fs_hz: f64) -> Vec<f64> {
    (0..=length / 2)
        .map(|k| k as f64 * fs_hz / length as f64)
        .collect()
}

/// Divided by its first term; without the tail that no longer counts.
pub(crate) fn trimmed(mut correlation: Vec<f64>) -> Vec<f64> {
    let first = correlation[0];
    correlation.iter_mut().for_each(|c| *c /= first);
    let last = correlation.iter().rposition(|c| *c > 1e-9).unwrap_or(0);
    correlation.truncate(last + 1);
    correlation
}
