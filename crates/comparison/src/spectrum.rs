//! One spectrum for every series of the same times: regular, with gaps, or irregular.
//!
//! ```text
//! regular, with gaps   Welch, Hann, the longest segments that still use half of the samples
//! irregular            Lomb-Scargle at frequencies that widen with frequency
//! short holes          of at most 3 samples, 2 % of all at most: a straight line across
//! then                 averages over a tenth of a decade, with their degrees of freedom
//! ```
//!
//! A plan is made once from times and mask, so that a measured series and a thousand simulated ones go
//! through the same estimate: what a window or a gap does to one, it does to the other.
//!
//! Source: crate `spectra`; the choices are this crate's.

use std::ops::Range;

use spectra::{
    Detrend, LogAverage, LombScargle, LombScargleSettings, Psd, SpectraError, Welch, WelchSettings,
    Window, mean_rate_hz,
};

/// Part of a step by which an interval may differ and still go on.
const STEP_TOLERANCE: f64 = 0.05;
/// Groups to a factor of ten in frequency.
const PER_DECADE: f64 = 10.0;
/// Most samples of a hole that is bridged, and of all holes together for each sample that is there.
const LONGEST_HOLE: usize = 3;
const HOLES: f64 = 0.02;
/// Segments shorter than this show too little: such series count as irregular.
const SHORTEST: usize = 64;
/// Frequencies to a factor of ten of an irregular series.
const LADDER: usize = 200;

/// A plan for the spectrum of series at one set of times.
#[derive(Clone, Debug)]
pub struct Spectrum {
    kind: Kind,
    fs_hz: f64,
    average: LogAverage,
    correlation: Vec<f64>,
    /// Where the values that are analysed come from.
    grid: Vec<Take>,
}

/// A value of the series: of one sample, or on the straight line between two.
#[derive(Clone, Copy, Debug)]
struct Take {
    left: usize,
    right: usize,
    part: f64,
}

impl Take {
    fn of(self, x: &[f64]) -> f64 {
        if self.left == self.right {
            x[self.left]
        } else {
            x[self.left] + self.part * (x[self.right] - x[self.left])
        }
    }
}

#[derive(Clone, Debug)]
enum Kind {
    Welch {
        plan: Box<Welch>,
        runs: Vec<Range<usize>>,
    },
    Ladder {
        rungs: Vec<LombScargle>,
    },
}

impl Spectrum {
    /// A plan for series at `t_s`, of which those values count that are not NaN in `mask`.
    ///
    /// # Errors
    ///
    /// Times that do not ascend, or too few values.
    pub fn new(t_s: &[f64], mask: &[f64]) -> Result<Self, SpectraError> {
        let kept: Vec<usize> = (0..mask.len()).filter(|k| mask[*k].is_finite()).collect();
        let times: Vec<f64> = kept.iter().map(|k| t_s[*k]).collect();
        let step_s = typical_step(t_s)?;
        let (grid, runs) = laid_out(&times, &kept, step_s);
        let (kind, fs_hz, grid) = match segment(&runs, times.len()) {
            Some(length) => {
                let settings = WelchSettings::half_overlap(length, 1.0 / step_s);
                let plan = Box::new(Welch::new(settings)?);
                (Kind::Welch { plan, runs }, 1.0 / step_s, grid)
            }
            None => {
                let fs_hz = mean_rate_hz(&times)?;
                let rungs = ladder(&times, fs_hz)?;
                let grid = kept.iter().map(|k| sample(*k)).collect();
                (Kind::Ladder { rungs }, fs_hz, grid)
            }
        };
        let correlation = match &kind {
            Kind::Welch { plan, runs } => plan.bin_correlation(segments(plan.settings(), runs)),
            Kind::Ladder { .. } => vec![1.0],
        };
        let laid: Vec<f64> = grid.iter().map(|take| take.of(mask)).collect();
        Ok(Self {
            average: LogAverage::new(&kind.density(&laid, fs_hz)?, PER_DECADE)?,
            kind,
            fs_hz,
            correlation,
            grid,
        })
    }

    fn laid(&self, x: &[f64]) -> Vec<f64> {
        self.grid.iter().map(|take| take.of(x)).collect()
    }

    /// Rate of the samples, Hz; the mean one of an irregular series.
    #[must_use]
    pub fn fs_hz(&self) -> f64 {
        self.fs_hz
    }

    /// Whether the series is taken as irregular.
    #[must_use]
    pub fn irregular(&self) -> bool {
        matches!(self.kind, Kind::Ladder { .. })
    }

    /// The averaged one-sided density of a series, unit^2/Hz.
    ///
    /// # Errors
    ///
    /// A value that is missing where the plan counts it.
    pub fn of(&self, x: &[f64]) -> Result<Psd, SpectraError> {
        let fine = self.fine(x)?;
        Ok(self.average.apply(&fine, &self.correlation))
    }

    /// Means of a model's density over the same groups of frequencies.
    #[must_use]
    pub fn means(&self, fine: &Psd, density: impl Fn(f64) -> f64) -> Vec<f64> {
        let values: Vec<f64> = fine.frequency_hz.iter().map(|f| density(*f)).collect();
        let mut out = vec![0.0; self.average.groups().len()];
        self.average.means_into(&values, &mut out);
        out
    }

    /// The density before it is averaged.
    ///
    /// # Errors
    ///
    /// As [`of`](Self::of).
    pub fn fine(&self, x: &[f64]) -> Result<Psd, SpectraError> {
        self.kind.density(&self.laid(x), self.fs_hz)
    }

    /// The periodogram of a series without window and average: what \[M23\] Eq. 19 as printed is fitted to.
    ///
    /// # Errors
    ///
    /// As [`of`](Self::of).
    pub fn raw(&self, x: &[f64]) -> Result<Psd, SpectraError> {
        match &self.kind {
            Kind::Welch { plan, runs } => {
                let settings = WelchSettings {
                    window: Window::Boxcar,
                    detrend: Detrend::Constant,
                    overlap: 0,
                    ..plan.settings().clone()
                };
                Welch::new(settings)?.process_runs(&self.laid(x), runs)
            }
            Kind::Ladder { .. } => self.fine(x),
        }
    }
}

impl Kind {
    fn density(&self, x: &[f64], fs_hz: f64) -> Result<Psd, SpectraError> {
        match self {
            Self::Welch { plan, runs } => plan.process_runs(x, runs),
            Self::Ladder { rungs } => {
                let mut all = Psd {
                    fs_hz,
                    ..Psd::default()
                };
                for rung in rungs {
                    let part = rung.process(x)?;
                    all.frequency_hz.extend(part.frequency_hz);
                    all.psd.extend(part.psd);
                    all.dof.extend(part.dof);
                }
                Ok(all)
            }
        }
    }
}

fn sample(k: usize) -> Take {
    Take {
        left: k,
        right: k,
        part: 0.0,
    }
}

/// The samples of a regular grid, short holes bridged, and the runs without a hole.
fn laid_out(times: &[f64], kept: &[usize], step_s: f64) -> (Vec<Take>, Vec<Range<usize>>) {
    // whole steps from one sample to the next, 0 where they are none
    let steps: Vec<usize> = times
        .windows(2)
        .map(|w| {
            let steps = (w[1] - w[0]) / step_s;
            let whole =
                (1..=LONGEST_HOLE + 1).find(|n| (steps - *n as f64).abs() <= STEP_TOLERANCE);
            whole.unwrap_or(0)
        })
        .collect();
    let missing: usize = steps.iter().map(|n| n.saturating_sub(1)).sum();
    let bridge = missing as f64 <= HOLES * kept.len() as f64;
    let mut grid = vec![];
    let mut runs: Vec<Range<usize>> = vec![];
    for (k, &row) in kept.iter().enumerate() {
        let from = if k == 0 { 0 } else { steps[k - 1] };
        let joins = from == 1 || (from > 1 && bridge);
        if joins {
            for m in 1..from {
                grid.push(Take {
                    left: kept[k - 1],
                    right: row,
                    part: m as f64 / from as f64,
                });
            }
        }
        let start = grid.len();
        grid.push(sample(row));
        match runs.last_mut() {
            Some(run) if joins => run.end = grid.len(),
            _ => runs.push(start..grid.len()),
        }
    }
    (grid, runs)
}

/// Mean of the steps near the median one, s.
fn typical_step(t_s: &[f64]) -> Result<f64, SpectraError> {
    mean_rate_hz(t_s)?;
    let mut steps: Vec<f64> = t_s.windows(2).map(|w| w[1] - w[0]).collect();
    let median = spectra::robust::median(&mut steps).unwrap_or(f64::NAN);
    let near: Vec<f64> = steps
        .into_iter()
        .filter(|s| (s / median - 1.0).abs() <= STEP_TOLERANCE)
        .collect();
    if near.is_empty() {
        return Ok(median);
    }
    Ok(near.iter().sum::<f64>() / near.len() as f64)
}

/// The longest segment that uses half of the samples; `None` if none of a useful length does.
fn segment(runs: &[Range<usize>], samples: usize) -> Option<usize> {
    let mut lengths: Vec<usize> = runs.iter().map(Range::len).collect();
    lengths.sort_unstable_by(|a, b| b.cmp(a));
    let shortest = SHORTEST.min(samples);
    // runs as long as a segment are used but for a tail shorter than half of one
    let used = |length: usize| -> usize {
        lengths
            .iter()
            .take_while(|l| **l >= length)
            .map(|l| {
                let step = (length - length / 2).max(1);
                length + (l - length) / step * step
            })
            .sum()
    };
    let mut candidates = lengths.clone();
    candidates.dedup();
    candidates
        .into_iter()
        .take_while(|length| *length >= shortest)
        .find(|length| 2 * used(*length) >= samples)
}

fn segments(settings: &WelchSettings, runs: &[Range<usize>]) -> usize {
    let step = settings.segment - settings.overlap;
    let fits = runs.iter().filter(|run| run.len() >= settings.segment);
    fits.map(|run| (run.len() - settings.segment) / step + 1)
        .max()
        .unwrap_or(1)
}

/// Plans that go up a decade each, from one period in the span to half the mean rate.
fn ladder(t_s: &[f64], fs_hz: f64) -> Result<Vec<LombScargle>, SpectraError> {
    let first_hz = fs_hz / t_s.len() as f64;
    let top_hz = 0.5 * fs_hz;
    let mut rungs = vec![];
    let mut from = 1.0;
    while from * first_hz < top_hz {
        // never closer than what the span tells apart
        let step_hz = first_hz * (9.0 * from / LADDER as f64).max(1.0);
        let to_hz = (10.0 * from * first_hz).min(top_hz);
        let mut bins = 0;
        while from * first_hz + bins as f64 * step_hz < to_hz * (1.0 - 1e-9) {
            bins += 1;
        }
        rungs.push(LombScargle::new(
            t_s,
            LombScargleSettings {
                first_hz: from * first_hz,
                step_hz,
                bins,
                floating_mean: true,
                fs_hz,
            },
        )?);
        from *= 10.0;
    }
    Ok(rungs)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4000 samples, of which 1 % are missing one by one and three in a row: bridged, so that the lowest bins
    /// are those of the whole span, and what is laid out of a straight line is the line.
    #[test]
    fn short_holes_are_bridged_by_straight_lines() {
        let t: Vec<f64> = (0..4000).map(|k| 0.5 * f64::from(k)).collect();
        let line: Vec<f64> = t.iter().map(|t| 3.0 - 0.2 * t).collect();
        let mut mask = line.clone();
        for k in (50..4000).step_by(100) {
            mask[k] = f64::NAN;
        }
        mask[2001..2004].fill(f64::NAN);
        let plan = Spectrum::new(&t, &mask).unwrap();
        assert!(!plan.irregular());
        let laid = plan.laid(&mask);
        assert_eq!(laid.len(), line.len());
        let worst = laid
            .iter()
            .zip(&line)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(worst < 1e-10, "{worst}");
        assert!((plan.of(&mask).unwrap().frequency_hz[0] - 1.0 / 2000.0).abs() < 1e-9);
    }

    /// A tenth missing is too much to be made up: runs stay apart.
    #[test]
    fn many_holes_stay_holes() {
        let t: Vec<f64> = (0..4000).map(f64::from).collect();
        let mask: Vec<f64> = (0..4000)
            .map(|k| {
                if k % 400 < 40 {
                    f64::NAN
                } else {
                    f64::from(k % 7)
                }
            })
            .collect();
        let plan = Spectrum::new(&t, &mask).unwrap();
        assert!(!plan.irregular());
        assert!((plan.of(&mask).unwrap().frequency_hz[0] - 1.0 / 360.0).abs() < 1e-9);
    }

    /// White noise of variance 4 at irregular times has 2 sigma^2 / fs = 8 / fs at any frequency: the mean of
    /// some 20 averages of 2 to 60 degrees of freedom is within a tenth of it.
    #[test]
    fn irregular_white_noise_is_level() {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        let t: Vec<f64> = (0..3000).map(|k| f64::from(k) + 0.6 * uniform()).collect();
        // the sum of twelve uniforms has variance 1
        let x: Vec<f64> = (0..3000)
            .map(|_| 2.0 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0))
            .collect();
        let plan = Spectrum::new(&t, &x).unwrap();
        assert!(plan.irregular());
        let psd = plan.of(&x).unwrap();
        let weight: f64 = psd.dof.iter().sum();
        let mean: f64 = psd
            .psd
            .iter()
            .zip(&psd.dof)
            .map(|(p, dof)| p * dof)
            .sum::<f64>()
            / weight;
        // 2 degrees of freedom for each of some 600 bins: 1 +- 0.04
        assert!((mean * plan.fs_hz() / 8.0 - 1.0).abs() < 0.2, "{mean}");
    }
}
