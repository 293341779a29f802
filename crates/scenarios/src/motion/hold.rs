//! An inertial hold: constant drift and jitter.
//!
//! ```text
//! omega(t) = drift + jitter(t)             tracker axes
//! ```
//!
//! Source: [M23] Section 4.1, the quasi-inertial hold that drifts by some pixels in hours.

use focal_plane::Angle;
use nalgebra::Vector3;
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Deserialize;

use super::jitter::Jitter;
use super::turning::Turning;
use super::{ClosedLoop, Pointing, STEP_S, Sinusoid};
use crate::ScenarioError;

/// `[motion]` with `kind = "hold"`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Hold {
    /// Attitude at t = 0.
    pub start: Pointing,
    /// Constant rate, arcsec/s, tracker axes; default 0.
    pub drift_arcsec_s: [f64; 3],
    /// Lines.
    pub sinusoid: Vec<Sinusoid>,
    /// Noise of a control loop.
    pub closed_loop: Option<ClosedLoop>,
}

/// Drift and jitter.
#[derive(Clone, Debug)]
pub(super) struct Drifting {
    drift_rad_s: Vector3<f64>,
    jitter: Jitter,
    step_s: f64,
}

impl Hold {
    pub(super) fn turning(
        &self,
        from_s: f64,
        rng: &Xoshiro256PlusPlus,
    ) -> Result<Drifting, ScenarioError> {
        let drift_rad_s = drift_rad_s(self.drift_arcsec_s)?;
        let (jitter, step_s) = Jitter::new(
            &self.sinusoid,
            self.closed_loop.as_ref(),
            from_s,
            STEP_S,
            rng,
        )?;
        Ok(Drifting {
            drift_rad_s,
            jitter,
            step_s,
        })
    }
}

impl Turning for Drifting {
    fn rate_rad_s(&self, t_s: f64) -> Vector3<f64> {
        self.drift_rad_s + self.jitter.rate_rad_s(t_s)
    }

    fn step_s(&self) -> f64 {
        self.step_s
    }

    fn next_break_s(&self, _from_s: f64, _backwards: bool) -> Option<f64> {
        None
    }

    fn extend(&mut self, to_s: f64) {
        self.jitter.extend(to_s);
    }

    fn forget(&mut self, before_s: f64) {
        self.jitter.forget(before_s);
    }
}

/// A drift of a scenario file in rad/s.
pub(super) fn drift_rad_s(drift_arcsec_s: [f64; 3]) -> Result<Vector3<f64>, ScenarioError> {
    for value in drift_arcsec_s {
        ScenarioError::check_finite("motion.drift_arcsec_s", value)?;
    }
    Ok(Vector3::from(
        drift_arcsec_s.map(|value| Angle::from_arcsec(value).rad()),
    ))
}

#[cfg(test)]
mod tests {
    use focal_plane::{AttitudeSource, rotation_vector};
    use star_tracker::{Purpose, stream};

    use super::super::integrate::whole;
    use super::*;

    /// A drift about one axis with a line about the same axis: the angle is the sum in closed form,
    /// at samples and between them (cubic: 1e-6 of 20 arcsec is 1e-10 rad).
    #[test]
    fn drift_and_line_add_up() {
        let hold = Hold {
            drift_arcsec_s: [0.0, 3.0, 0.0],
            sinusoid: vec![Sinusoid {
                axis: [0.0, 2.0, 0.0],
                amplitude_arcsec: 20.0,
                frequency_hz: 0.5,
                phase_deg: 30.0,
            }],
            ..Hold::default()
        };
        let at_zero = hold.start.attitude().unwrap();
        let turning = hold.turning(-3.0, &stream(1, 0, Purpose::Motion));
        let truth = whole(turning.unwrap(), at_zero, [-3.0, 600.0]).unwrap();
        for t in [-2.987_f64, 0.0, 0.013, 99.2, 599.999] {
            let phase = 30_f64.to_radians();
            let line = (core::f64::consts::TAU * 0.5 * t + phase).sin() - phase.sin();
            let angle = Angle::from_arcsec(3.0 * t + 20.0 * line).rad();
            // the tracker turns by +angle, so the error vector of the view is -angle
            let got = rotation_vector(&truth.attitude(t).unwrap(), &at_zero);
            assert!((got + Vector3::y() * angle).norm() < 1e-9, "{got:?} at {t}");
        }
    }
}
