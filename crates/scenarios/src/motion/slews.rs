//! Slews with holds between them.
//!
//! One slew turns the tracker about an axis of its own by `angle` in `duration`: its rate rises over
//! `ramp`, stays, and falls over `ramp`,
//!
//! ```text
//! rate = peak S(t / ramp),    S(s) = 10 s^3 - 15 s^4 + 6 s^5,    peak = angle / (duration - ramp)
//! ```
//!
//! so that rate, acceleration and its derivative are continuous (the quintic has zero slope and
//! curvature at both ends, and integrates to 1/2). Drift and jitter go on throughout.
//!
//! Source: [M23] Section 4.2 and Fig. 9: orthogonal rate slews with inertial holds between them. The
//! paper prints no shape; the quintic is an assumption.

use std::sync::Arc;

use focal_plane::Angle;
use nalgebra::Vector3;
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Deserialize;

use super::hold::drift_rad_s;
use super::jitter::{Jitter, unit_axis};
use super::turning::{Turning, neighbour};
use super::{ClosedLoop, Pointing, STEP_S, Sinusoid};
use crate::ScenarioError;

/// `[motion]` with `kind = "slews"`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Slews {
    /// Attitude at t = 0.
    #[serde(default)]
    pub start: Pointing,
    /// Constant rate, arcsec/s, tracker axes; default 0.
    #[serde(default)]
    pub drift_arcsec_s: [f64; 3],
    /// Hold before the first slew, s; default 0.
    #[serde(default)]
    pub wait_s: f64,
    /// How often the whole sequence is run through; default 1.
    #[serde(default = "once")]
    pub repeat: u32,
    /// The sequence.
    pub slew: Vec<Slew>,
    /// Lines.
    #[serde(default)]
    pub sinusoid: Vec<Sinusoid>,
    /// Noise of a control loop.
    #[serde(default)]
    pub closed_loop: Option<ClosedLoop>,
}

fn once() -> u32 {
    1
}

/// One slew: `[[motion.slew]]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Slew {
    /// Axis in the tracker; its length does not matter.
    pub axis: [f64; 3],
    /// Angle, deg.
    pub angle_deg: f64,
    /// Time from rest to rest, s.
    pub duration_s: f64,
    /// Time in which the rate rises, and falls, s; default half the duration, which leaves no plateau.
    #[serde(default)]
    pub ramp_s: Option<f64>,
    /// Hold after it, s; default 0.
    #[serde(default)]
    pub hold_s: f64,
}

/// A slew at its place in time.
#[derive(Clone, Copy, Debug)]
struct Turn {
    start_s: f64,
    duration_s: f64,
    ramp_s: f64,
    peak_rad_s: Vector3<f64>,
}

/// Slews, drift and jitter.
#[derive(Clone, Debug)]
pub(super) struct Slewing {
    drift_rad_s: Vector3<f64>,
    jitter: Jitter,
    step_s: f64,
    turns: Arc<[Turn]>,
    breaks_s: Arc<[f64]>,
}

impl Slews {
    pub(super) fn turning(
        &self,
        from_s: f64,
        rng: &Xoshiro256PlusPlus,
    ) -> Result<Slewing, ScenarioError> {
        let drift_rad_s = drift_rad_s(self.drift_arcsec_s)?;
        let turns = self.turns()?;
        let (jitter, step_s) = Jitter::new(
            &self.sinusoid,
            self.closed_loop.as_ref(),
            from_s,
            STEP_S,
            rng,
        )?;
        let mut breaks_s: Vec<f64> = turns.iter().flat_map(Turn::breaks_s).collect();
        breaks_s.sort_by(f64::total_cmp);
        Ok(Slewing {
            drift_rad_s,
            jitter,
            step_s,
            turns: turns.into(),
            breaks_s: breaks_s.into(),
        })
    }

    fn turns(&self) -> Result<Vec<Turn>, ScenarioError> {
        ScenarioError::check_not_negative("motion.wait_s", self.wait_s)?;
        let mut start_s = self.wait_s;
        let mut turns = Vec::new();
        for _ in 0..self.repeat {
            for slew in &self.slew {
                turns.push(slew.turn(start_s)?);
                start_s += slew.duration_s + slew.hold_s;
            }
        }
        Ok(turns)
    }
}

impl Turning for Slewing {
    fn rate_rad_s(&self, t_s: f64) -> Vector3<f64> {
        self.drift_rad_s + self.jitter.rate_rad_s(t_s) + slew_rate_rad_s(&self.turns, t_s)
    }

    fn step_s(&self) -> f64 {
        self.step_s
    }

    fn next_break_s(&self, from_s: f64, backwards: bool) -> Option<f64> {
        neighbour(&self.breaks_s, from_s, backwards)
    }

    fn extend(&mut self, to_s: f64) {
        self.jitter.extend(to_s);
    }

    fn forget(&mut self, before_s: f64) {
        self.jitter.forget(before_s);
    }
}

impl Slew {
    fn turn(&self, start_s: f64) -> Result<Turn, ScenarioError> {
        let axis = unit_axis("motion.slew.axis", self.axis)?;
        let angle = self.angle_deg;
        ScenarioError::check_finite("motion.slew.angle_deg", angle)?;
        ScenarioError::check_positive("motion.slew.duration_s", self.duration_s)?;
        ScenarioError::check_not_negative("motion.slew.hold_s", self.hold_s)?;
        let ramp_s = self.ramp_s.unwrap_or(0.5 * self.duration_s);
        let fits = ramp_s > 0.0 && ramp_s <= 0.5 * self.duration_s;
        ScenarioError::check(
            "motion.slew.ramp_s",
            ramp_s,
            fits,
            "positive, at most half the duration",
        )?;
        let peak = Angle::from_deg(angle).rad() / (self.duration_s - ramp_s);
        Ok(Turn {
            start_s,
            duration_s: self.duration_s,
            ramp_s,
            peak_rad_s: axis * peak,
        })
    }
}

impl Turn {
    fn rate_rad_s(&self, t_s: f64) -> Vector3<f64> {
        let since = t_s - self.start_s;
        let from_end = since.min(self.duration_s - since);
        let s = (from_end / self.ramp_s).clamp(0.0, 1.0);
        self.peak_rad_s * (s * s * s * (10.0 + s * (6.0 * s - 15.0)))
    }

    fn breaks_s(&self) -> [f64; 4] {
        let end = self.start_s + self.duration_s;
        [
            self.start_s,
            self.start_s + self.ramp_s,
            end - self.ramp_s,
            end,
        ]
    }
}

/// Rate of the slew that is on at this time, if any; `turns` ascend and do not overlap.
fn slew_rate_rad_s(turns: &[Turn], t_s: f64) -> Vector3<f64> {
    let begun = turns.partition_point(|turn| turn.start_s <= t_s);
    begun
        .checked_sub(1)
        .map_or_else(Vector3::zeros, |i| turns[i].rate_rad_s(t_s))
}

#[cfg(test)]
mod tests {
    use focal_plane::{AttitudeSeries, AttitudeSource, rotation_from_vector, rotation_vector};
    use star_tracker::{Purpose, stream};

    use super::super::integrate::whole;
    use super::*;

    fn truth(sequence: &Slews, span_s: [f64; 2]) -> Result<AttitudeSeries, ScenarioError> {
        let turning = sequence.turning(span_s[0], &stream(1, 0, Purpose::Motion))?;
        whole(turning, sequence.start.attitude()?, span_s)
    }

    fn slew(axis: [f64; 3], angle_deg: f64, duration_s: f64) -> Slew {
        Slew {
            axis,
            angle_deg,
            duration_s,
            ramp_s: None,
            hold_s: 7.0,
        }
    }

    fn slews(slew: Vec<Slew>) -> Slews {
        Slews {
            start: Pointing {
                ra_deg: 10.0,
                dec_deg: -20.0,
                roll_deg: 5.0,
            },
            drift_arcsec_s: [0.0; 3],
            wait_s: 4.0,
            repeat: 1,
            slew,
            sinusoid: Vec::new(),
            closed_loop: None,
        }
    }

    /// Each slew turns the tracker by its angle about its axis: the product of the turns, to 1e-9 rad,
    /// and the attitude rests in between.
    #[test]
    fn every_slew_turns_by_its_angle() {
        let mut sequence = slews(vec![
            slew([1.0, 0.0, 0.0], 5.0, 20.0),
            Slew {
                ramp_s: Some(3.0),
                ..slew([0.0, -2.0, 0.0], 4.0, 31.0)
            },
            slew([1.0, 1.0, 1.0], -30.0, 40.03),
        ]);
        sequence.repeat = 2;
        let end_s = 4.0 + 2.0 * (20.0 + 31.0 + 40.03 + 21.0);
        let truth = truth(&sequence, [-1.0, end_s]).unwrap();
        let mut expected = sequence.start.attitude().unwrap();
        let mut t = 4.0;
        for _ in 0..2 {
            for slew in &sequence.slew {
                let turn = Vector3::from(slew.axis).normalize() * slew.angle_deg.to_radians();
                expected = rotation_from_vector(&-turn) * expected;
                t += slew.duration_s;
                for at in [t, t + 3.3, t + 6.9] {
                    let error = rotation_vector(&truth.attitude(at).unwrap(), &expected).norm();
                    assert!(error < 1e-9, "{error:.1e} rad at {at} s");
                    assert!(truth.rate_rad_s(at).unwrap().norm() < 1e-9);
                }
                t += slew.hold_s;
            }
        }
    }

    /// Peak rate is `angle / (duration - ramp)`, and the rate is that of the profile between samples.
    #[test]
    fn the_plateau_has_the_peak_rate() {
        let sequence = slews(vec![Slew {
            ramp_s: Some(2.0),
            ..slew([0.0, 1.0, 0.0], 3.0, 12.0)
        }]);
        let truth = truth(&sequence, [0.0, 20.0]).unwrap();
        for t in [6.1, 10.0, 13.9] {
            assert!((truth.rate_rad_s(t).unwrap().y - 0.3_f64.to_radians()).abs() < 1e-12);
        }
        // half way up the ramp S = 1/2
        assert!((truth.rate_rad_s(5.0).unwrap().y - 0.15_f64.to_radians()).abs() < 1e-12);
    }

    #[test]
    fn a_ramp_longer_than_half_the_slew_is_an_error() {
        let sequence = slews(vec![Slew {
            ramp_s: Some(7.0),
            ..slew([1.0, 0.0, 0.0], 3.0, 12.0)
        }]);
        let got = truth(&sequence, [0.0, 20.0]);
        assert!(matches!(
            got,
            Err(ScenarioError::OutOfRange {
                name: "motion.slew.ramp_s",
                ..
            })
        ));
    }
}
