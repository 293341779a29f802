//! The shutter, and the time that a frame is given.
//!
//! ```text
//! t     = first + k / rate                    middle of the exposure of the row at y = 0
//! stamp = round((t + delay + jitter n) / step) step
//! ```
//!
//! Not physics: time tags.

use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::ImagerError;
use crate::random::Key;

/// `[shutter]`
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Shutter {
    /// Exposure of a row, s; default 0.1.
    pub exposure_s: f64,
    /// Time from one row to the next, s; default 0: a global shutter.
    pub row_time_s: f64,
}

impl Default for Shutter {
    fn default() -> Self {
        Self {
            exposure_s: 0.1,
            row_time_s: 0.0,
        }
    }
}

/// `[clock]`
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Clock {
    /// From the middle of the exposure to the time that the frame is given, s; default 0.
    pub delay_s: f64,
    /// Random part of it, s rms; default 0.
    pub jitter_s: f64,
    /// Step of the clock, s; default 0: none.
    pub step_s: f64,
}

impl Shutter {
    pub(crate) fn check(self) -> Result<(), ImagerError> {
        ImagerError::not_negative("shutter.exposure_s", self.exposure_s)?;
        ImagerError::positive("shutter.exposure_s", self.exposure_s)?;
        ImagerError::finite("shutter.row_time_s", self.row_time_s)
    }
}

impl Clock {
    pub(crate) fn check(&self) -> Result<(), ImagerError> {
        ImagerError::finite("clock.delay_s", self.delay_s)?;
        ImagerError::not_negative("clock.jitter_s", self.jitter_s)?;
        ImagerError::not_negative("clock.step_s", self.step_s)
    }

    /// The time that a frame is given.
    pub(crate) fn stamp_s(&self, t_s: f64, key: Key) -> f64 {
        let noise: f64 = StandardNormal.sample(&mut key.stream());
        let stamp = t_s + self.delay_s + self.jitter_s * noise;
        if self.step_s > 0.0 {
            (stamp / self.step_s).round() * self.step_s
        } else {
            stamp
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Use;

    /// Late by the delay, on whole steps; jitter has the spread asked for (1000 stamps: 5/sqrt(2000)).
    #[test]
    fn stamps_are_late_stepped_and_jittered() {
        let key = Key::new(1, 0, Use::Clock);
        let late = Clock {
            delay_s: 0.012_34,
            jitter_s: 0.0,
            step_s: 0.001,
        };
        assert!((late.stamp_s(5.0, key) - 5.012).abs() < 1e-12);
        let jittered = Clock {
            jitter_s: 2e-3,
            ..Clock::default()
        };
        let squares = |k: u64| jittered.stamp_s(0.0, key.with(k)).powi(2);
        let rms = ((0..1000).map(squares).sum::<f64>() / 1000.0).sqrt();
        assert!((rms / 2e-3 - 1.0).abs() < 5.0 / 2000_f64.sqrt(), "{rms}");
    }
}
