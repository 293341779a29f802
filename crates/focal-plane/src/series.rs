//! One housekeeping channel against time, and its first-order lag.
//!
//! Between valid samples a channel is linear; a missing value (NaN) is skipped, a hole may be
//! declared too long to be bridged, and nothing is extrapolated. The lag filter
//!
//! ```text
//! x' = (u - x)/lag
//! ```
//!
//! has, for an input linear from u0 to u0 + a h, the exact solution
//!
//! ```text
//! x(h) = u(h) - lag a + (x0 - u0 + lag a) e^-z,          z = h/lag
//!      = x0 + (u0 - x0) E + a h (1 - E/z),               E = 1 - e^-z
//! ```
//!
//! (put x = u - lag a + c e^(-t/lag) into the equation). The second form keeps its accuracy when
//! the step is short against the lag: E by `exp_m1`, and 1 - E/z by its series.
//!
//! Source: effects catalogue, `thermal_misalignment`, `lag_s`; derivation above.

use std::sync::Arc;

/// Why a channel cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SeriesError {
    /// Times and values differ in number.
    #[error("{times} times but {values} values")]
    Length {
        /// Number of times.
        times: usize,
        /// Number of values.
        values: usize,
    },
    /// A time is not finite, or not later than the one before.
    #[error("sample {index} at {t_s} s is not later than the one before, or not finite")]
    Time {
        /// The sample.
        index: usize,
        /// Its time, s.
        t_s: f64,
    },
    /// A value is infinite.
    #[error("sample {index} at {t_s} s is infinite")]
    Infinite {
        /// The sample.
        index: usize,
        /// Its time, s.
        t_s: f64,
    },
}

/// A channel of housekeeping: valid samples in time order, linear in between. Copies, and lagged channels beside the one
/// that they follow, share what they have in common.
///
/// ```
/// use focal_plane::Series;
/// let heater = Series::new(vec![0.0, 10.0, 20.0], vec![20.0, f64::NAN, 22.0])?;
/// assert_eq!(heater.at(5.0), Some(20.5));
/// assert_eq!(heater.at(21.0), None);
/// assert_eq!(heater.clone().with_max_gap_s(15.0).at(5.0), None);
/// let bracket = heater.lagged(8.0);
/// assert!(bracket.at(20.0).expect("inside") < 22.0);
/// # Ok::<(), focal_plane::SeriesError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    t_s: Arc<[f64]>,
    value: Arc<[f64]>,
    max_gap_s: f64,
    lag: Option<Lag>,
}

/// What a lagged channel follows, to be exact between its samples too.
#[derive(Clone, Debug, PartialEq)]
struct Lag {
    lag_s: f64,
    input: Arc<[f64]>,
}

impl Series {
    /// From times, s, and values; NaN values are missing and are left out.
    ///
    /// # Errors
    ///
    /// Different lengths, times that are not finite and strictly increasing (missing samples
    /// included), or an infinite value.
    pub fn new(t_s: Vec<f64>, value: Vec<f64>) -> Result<Self, SeriesError> {
        if t_s.len() != value.len() {
            return Err(SeriesError::Length {
                times: t_s.len(),
                values: value.len(),
            });
        }
        let mut last_s = f64::NEG_INFINITY;
        for (index, (&t_s, &value)) in t_s.iter().zip(&value).enumerate() {
            if !t_s.is_finite() || t_s <= last_s {
                return Err(SeriesError::Time { index, t_s });
            }
            if value.is_infinite() {
                return Err(SeriesError::Infinite { index, t_s });
            }
            last_s = t_s;
        }
        let valid = t_s.into_iter().zip(value).filter(|(_, v)| !v.is_nan());
        let (t_s, value): (Vec<f64>, Vec<f64>) = valid.unzip();
        Ok(Self {
            t_s: t_s.into(),
            value: value.into(),
            max_gap_s: f64::INFINITY,
            lag: None,
        })
    }

    /// The same channel, with no value inside a hole longer than this (infinite by default).
    ///
    /// # Panics
    ///
    /// Unless the length is positive.
    #[must_use]
    pub fn with_max_gap_s(mut self, max_gap_s: f64) -> Self {
        assert!(max_gap_s > 0.0, "max_gap_s = {max_gap_s} must be positive");
        self.max_gap_s = max_gap_s;
        self
    }

    /// Times of the valid samples, s.
    #[must_use]
    pub fn t_s(&self) -> &[f64] {
        &self.t_s
    }

    /// Values of the valid samples.
    #[must_use]
    pub fn value(&self) -> &[f64] {
        &self.value
    }

    /// Number of valid samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there is no valid sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// Mean of the valid samples, not weighted by time; NaN if there is none.
    #[must_use]
    pub fn mean(&self) -> f64 {
        // offsets from the first value, so that a large constant costs no digits
        let Some(&first) = self.value.first() else {
            return f64::NAN;
        };
        let sum: f64 = self.value.iter().map(|v| v - first).sum();
        first + sum / self.value.len() as f64
    }

    /// Value at a time, s; `None` outside the samples and inside a hole.
    #[must_use]
    pub fn at(&self, t_s: f64) -> Option<f64> {
        self.at_from(t_s, &mut 0)
    }

    /// [`at`](Self::at) for many times, NaN where it gives `None`. Fastest for ascending times.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn at_into(&self, t_s: &[f64], out: &mut [f64]) {
        assert_eq!(t_s.len(), out.len(), "one value for each time");
        let mut hint = 0;
        for (out, &t) in out.iter_mut().zip(t_s) {
            *out = self.at_from(t, &mut hint).unwrap_or(f64::NAN);
        }
    }

    /// The same as new numbers.
    #[must_use]
    pub fn at_all(&self, t_s: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; t_s.len()];
        self.at_into(t_s, &mut out);
        out
    }

    /// `hint` is the sample at or before the last time asked for.
    fn at_from(&self, t_s: f64, hint: &mut usize) -> Option<f64> {
        let (&first_s, &last_s) = (self.t_s.first()?, self.t_s.last()?);
        if !(t_s >= first_s && t_s <= last_s) {
            return None;
        }
        let i = crate::attitude::locate(&self.t_s, t_s, *hint);
        *hint = i;
        let since_s = t_s - self.t_s[i];
        if since_s <= 0.0 {
            return Some(self.value[i]);
        }
        let h_s = self.t_s[i + 1] - self.t_s[i];
        if h_s > self.max_gap_s {
            return None;
        }
        let part = since_s / h_s;
        Some(match &self.lag {
            None => self.value[i] + (self.value[i + 1] - self.value[i]) * part,
            Some(lag) => {
                let rise = (lag.input[i + 1] - lag.input[i]) * part;
                follow(self.value[i], lag.input[i], rise, since_s / lag.lag_s)
            }
        })
    }

    /// The channel behind a first-order lag, `x' = (u - x)/lag_s`, started at the first value:
    /// exact for this piecewise-linear input, at the samples and in between. A hole is crossed as
    /// if the input were linear there (the result is still `None` inside it). A channel that is
    /// itself lagged is taken as linear between its samples.
    ///
    /// # Panics
    ///
    /// If the lag is negative or not finite.
    #[must_use]
    pub fn lagged(&self, lag_s: f64) -> Self {
        assert!(
            lag_s.is_finite() && lag_s >= 0.0,
            "lag_s = {lag_s} must be finite and not negative"
        );
        if lag_s == 0.0 {
            return self.clone();
        }
        let mut value: Vec<f64> = Vec::with_capacity(self.len());
        for i in 0..self.len() {
            let x = match value.last() {
                None => self.value[0],
                Some(&x) => {
                    let z = (self.t_s[i] - self.t_s[i - 1]) / lag_s;
                    follow(x, self.value[i - 1], self.value[i] - self.value[i - 1], z)
                }
            };
            value.push(x);
        }
        Self {
            t_s: self.t_s.clone(),
            value: value.into(),
            max_gap_s: self.max_gap_s,
            lag: Some(Lag {
                lag_s,
                input: self.value.clone(),
            }),
        }
    }
}

/// Lag output after a step of `z` lags, from `x0`, while the input rises linearly from `u0` by
/// `rise`.
fn follow(x0: f64, u0: f64, rise: f64, z: f64) -> f64 {
    let reached = -(-z).exp_m1();
    // 1 - E/z = z/2 - z^2/6 + z^3/24 - z^4/120 + ...; the next term is z^5/720 < 1e-16 z
    let ramp = if z < 0.01 {
        z * (1.0 / 2.0 - z * (1.0 / 6.0 - z * (1.0 / 24.0 - z * (1.0 / 120.0 - z / 720.0))))
    } else {
        1.0 - reached / z
    };
    x0 + (u0 - x0) * reached + rise * ramp
}
