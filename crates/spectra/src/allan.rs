//! Allan deviation, of angles or of rates, with its confidence.
//!
//! ```text
//! sigma^2(m tau0) = 1 / (2 (m tau0)^2 M) sum_i (x[i+2m] - 2 x[i+m] + x[i])^2
//! i = 0, 1, 2, ...  (overlapping, M = N - 2m)   or   i = 0, m, 2m, ...  (classic)
//! ```
//!
//! `x` is the phase of clocks: here an *angle*; its derivative, the frequency of clocks, is a *rate*. A
//! series of rates is summed to angles first. The deviation has the unit of the rate: that of the angle
//! per second for angles.
//!
//! Source: Riley, Handbook of Frequency Stability Analysis, NIST SP 1065 (2008), Eqs. 7, 11.

use crate::confidence::{self, Band};
use crate::{Detrend, SpectraError};

mod edf;

pub use edf::{PowerLaw, allan_edf};

/// What the samples are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AllanData {
    /// Angles (phase, attitude error) at the sampling instants.
    Angle,
    /// Rates (frequency, drift), each the mean over its sampling interval.
    Rate,
}

/// Which differences are averaged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AllanKind {
    /// Those that do not overlap: the original definition.
    Classic,
    /// All: the same expectation and more certainty.
    #[default]
    Overlapping,
}

/// A plan for Allan deviations.
///
/// ```
/// use spectra::{Allan, AllanData, AllanKind, PowerLaw};
///
/// // a constant rate has none, whatever its size
/// let allan = Allan::new(AllanData::Rate, AllanKind::Overlapping, PowerLaw::WhiteRate, 10.0)?;
/// let result = allan.process(&[5.0; 100], &[1, 2, 4])?;
/// assert_eq!(result.tau_s, [0.1, 0.2, 0.4]);
/// assert!(result.deviation.iter().all(|d| *d < 1e-12));
/// # Ok::<(), spectra::SpectraError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Allan {
    data: AllanData,
    kind: AllanKind,
    noise: PowerLaw,
    fs_hz: f64,
}

/// Memory of one series at a time, made by [`Allan::make_scratch`].
#[derive(Clone, Debug, Default)]
pub struct AllanScratch {
    angle: Vec<f64>,
}

/// Allan deviations of one series.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AllanDeviation {
    /// Averaging times, s.
    pub tau_s: Vec<f64>,
    /// Deviations, unit of the rate.
    pub deviation: Vec<f64>,
    /// Differences averaged in each.
    pub differences: Vec<usize>,
    /// Equivalent degrees of freedom, for the noise the plan was told of.
    pub edf: Vec<f64>,
}

impl AllanDeviation {
    /// Confidence band of probability `level` around each deviation.
    ///
    /// # Errors
    ///
    /// [`SpectraError::Probability`] outside (0, 1).
    pub fn confidence(&self, level: f64) -> Result<Band, SpectraError> {
        confidence::band(&self.deviation, &self.edf, level, 0.5)
    }
}

impl Allan {
    /// A plan. `noise` is the law assumed for the degrees of freedom alone: the deviation does not
    /// depend on it.
    ///
    /// # Errors
    ///
    /// [`SpectraError::NotPositive`] for the sampling frequency.
    pub fn new(
        data: AllanData,
        kind: AllanKind,
        noise: PowerLaw,
        fs_hz: f64,
    ) -> Result<Self, SpectraError> {
        SpectraError::positive("fs_hz", fs_hz)?;
        Ok(Self {
            data,
            kind,
            noise,
            fs_hz,
        })
    }

    /// Memory for series of up to `samples`.
    #[must_use]
    pub fn make_scratch(&self, samples: usize) -> AllanScratch {
        AllanScratch {
            angle: Vec::with_capacity(samples + 1),
        }
    }

    /// Largest averaging factor for `samples`: one difference, `2m < N` angles.
    #[must_use]
    pub fn most(&self, samples: usize) -> usize {
        self.angles(samples).saturating_sub(1) / 2
    }

    /// Averaging factors 1, 2, 4, ... for `samples`.
    #[must_use]
    pub fn octaves(&self, samples: usize) -> Vec<usize> {
        std::iter::successors(Some(1_usize), |m| m.checked_mul(2))
            .take_while(|m| *m <= self.most(samples))
            .collect()
    }

    /// Writes the deviation at each averaging factor `m = tau fs`; allocates nothing once `scratch` is
    /// as large as the series.
    ///
    /// # Errors
    ///
    /// [`SpectraError::Factor`] outside 1..=[`most`](Self::most), [`SpectraError::NotFinite`].
    ///
    /// # Panics
    ///
    /// If `deviation` does not hold one value for each factor.
    pub fn process_into(
        &self,
        x: &[f64],
        factors: &[usize],
        scratch: &mut AllanScratch,
        deviation: &mut [f64],
    ) -> Result<(), SpectraError> {
        assert_eq!(deviation.len(), factors.len(), "one place a factor");
        SpectraError::finite(x, 0)?;
        let most = self.most(x.len());
        let angle = &mut scratch.angle;
        angle.clear();
        angle.resize(x.len(), 0.0);
        // neither an angle nor a rate that is constant has an Allan deviation, but both cost digits
        Detrend::Constant.apply_into(x, angle);
        if self.data == AllanData::Rate {
            let mut sum = 0.0;
            for a in angle.iter_mut() {
                let rate = *a;
                *a = sum;
                sum += rate / self.fs_hz;
            }
            angle.push(sum);
        }
        for (d, m) in deviation.iter_mut().zip(factors) {
            if *m == 0 || *m > most {
                return Err(SpectraError::Factor { factor: *m, most });
            }
            let stride = self.stride(*m);
            let (sum, count) = second_differences(angle, *m, stride);
            let tau_s = *m as f64 / self.fs_hz;
            *d = (sum / (2.0 * count as f64)).sqrt() / tau_s;
        }
        Ok(())
    }

    /// Deviations at each averaging factor, with their degrees of freedom.
    ///
    /// # Errors
    ///
    /// As [`process_into`](Self::process_into).
    pub fn process(&self, x: &[f64], factors: &[usize]) -> Result<AllanDeviation, SpectraError> {
        let mut deviation = vec![0.0; factors.len()];
        self.process_into(x, factors, &mut self.make_scratch(x.len()), &mut deviation)?;
        let angles = self.angles(x.len());
        let differences = factors
            .iter()
            .map(|m| (angles - 2 * m).div_ceil(self.stride(*m)));
        Ok(AllanDeviation {
            tau_s: factors.iter().map(|m| *m as f64 / self.fs_hz).collect(),
            deviation,
            differences: differences.collect(),
            edf: factors
                .iter()
                .map(|m| allan_edf(self.noise, self.kind, *m, angles))
                .collect(),
        })
    }

    /// Angles that `samples` make.
    fn angles(&self, samples: usize) -> usize {
        samples + usize::from(self.data == AllanData::Rate)
    }

    fn stride(&self, factor: usize) -> usize {
        match self.kind {
            AllanKind::Classic => factor,
            AllanKind::Overlapping => 1,
        }
    }
}

/// Sum of the squared second differences over `m`, every `stride`, and their number.
fn second_differences(x: &[f64], m: usize, stride: usize) -> (f64, usize) {
    let count = (x.len() - 2 * m).div_ceil(stride);
    let difference = |i: usize| x[i + 2 * m] - 2.0 * x[i + m] + x[i];
    if stride > 1 {
        let sum = (0..count).map(|i| difference(i * stride).powi(2)).sum();
        return (sum, count);
    }
    // eight partial sums fill a vector register
    const LANES: usize = 8;
    let (first, second, third) = (&x[..count], &x[m..m + count], &x[2 * m..]);
    let mut sums = [0.0; LANES];
    let whole = count - count % LANES;
    for i in (0..whole).step_by(LANES) {
        let (a, b, c) = (
            &first[i..i + LANES],
            &second[i..i + LANES],
            &third[i..i + LANES],
        );
        for l in 0..LANES {
            let d = c[l] - 2.0 * b[l] + a[l];
            sums[l] += d * d;
        }
    }
    for i in whole..count {
        sums[0] += difference(i).powi(2);
    }
    (sums.iter().sum(), count)
}
