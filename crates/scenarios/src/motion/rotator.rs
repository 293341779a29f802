//! A rigid body that spins without torque, and a tracker on it.
//!
//! ```text
//! J dw/dt = -w x (J w)                        Euler, body principal axes
//! dv/dt = -w x v                              attitude of the body
//! q_tracker = exp(theta) (N M)^-1 q_body      N tracker to body, M(phi, theta, 0) the misalignment
//! ```
//!
//! `theta` are oscillations of the tracker against the body, given about body axes: booms that flex. The
//! Euler equations are integrated by the classical fourth-order method with steps of 0.05 s, whose error
//! at a turn of 3 deg/s is below 1e-13 rad/s over an hour.
//!
//! Source: [A01] Eqs. 1 and 2 and the text around Eq. 3; Wertz, Spacecraft Attitude Determination and
//! Control (1978), Section 16.2.

use std::sync::Arc;

use focal_plane::{Angle, AttitudeSeries, AttitudeSource, rotation_from_vector};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::integrate::whole;
use super::jitter::{Sinusoid, unit_axis};
use super::turning::Turning;
use super::{Pointing, STEP_S};
use crate::ScenarioError;

/// `[motion]` with `kind = "rotator"`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotator {
    /// Attitude of the tracker at t = 0, oscillations left out.
    #[serde(default)]
    pub start: Pointing,
    /// Principal moments of inertia about body x, y, z; any unit.
    pub inertia_kg_m2: [f64; 3],
    /// Spin about body z at t = 0, revolutions a minute; negative turns the other way.
    pub spin_rpm: f64,
    /// Angle between angular momentum and body z at t = 0, deg; default 0.
    #[serde(default)]
    pub nutation_deg: f64,
    /// Direction of the transverse momentum at t = 0, from body x towards body y, deg; default 0.
    #[serde(default)]
    pub nutation_phase_deg: f64,
    /// Rows of the matrix that turns vectors from tracker to body axes; default one.
    #[serde(default = "one")]
    pub alignment: [[f64; 3]; 3],
    /// Misalignment of the tracker, Euler angles phi and theta of a 1-2-3 sequence, deg; default 0.
    #[serde(default)]
    pub misalignment_deg: [f64; 2],
    /// Oscillations of the tracker against the body; their axes are those of the body.
    #[serde(default)]
    pub sinusoid: Vec<Sinusoid>,
}

fn one() -> [[f64; 3]; 3] {
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
}

impl Rotator {
    pub(super) fn truth(&self, span_s: [f64; 2]) -> Result<AttitudeSeries, ScenarioError> {
        let [ix, iy, iz] = self.inertia_kg_m2;
        for moment in self.inertia_kg_m2 {
            ScenarioError::check_positive("motion.inertia_kg_m2", moment)?;
        }
        let body = ix <= iy + iz && iy <= ix + iz && iz <= ix + iy;
        let rule = "no larger than the sum of the two others";
        let largest = ix.max(iy).max(iz);
        ScenarioError::check("motion.inertia_kg_m2", largest, body, rule)?;
        ScenarioError::check_finite("motion.spin_rpm", self.spin_rpm)?;
        let tilt = self.nutation_deg;
        let fits = (0.0..90.0).contains(&tilt);
        ScenarioError::check("motion.nutation_deg", tilt, fits, "from 0 to below 90")?;
        ScenarioError::check_finite("motion.nutation_phase_deg", self.nutation_phase_deg)?;
        let to_body = self.to_body()?;
        let rates = Rates::new(self.inertia_kg_m2, self.start_rate(), span_s);
        let turning = Spinning {
            to_tracker: to_body.inverse(),
            rates: Arc::new(rates),
        };
        let plain = whole(turning, self.start.attitude()?, span_s)?;
        if self.sinusoid.is_empty() {
            return Ok(plain);
        }
        let mut lines = Vec::new();
        for line in &self.sinusoid {
            let axis = unit_axis("motion.sinusoid.axis", line.axis)?;
            ScenarioError::check_finite("motion.sinusoid.amplitude_arcsec", line.amplitude_arcsec)?;
            ScenarioError::check_positive("motion.sinusoid.frequency_hz", line.frequency_hz)?;
            ScenarioError::check_finite("motion.sinusoid.phase_deg", line.phase_deg)?;
            let amplitude = Angle::from_arcsec(line.amplitude_arcsec).rad();
            lines.push((to_body.inverse() * axis * amplitude, line));
        }
        let (mut t_s, mut q) = (vec![], vec![]);
        for &t in plain.t_s() {
            let turn: Vector3<f64> = lines
                .iter()
                .map(|(axis, line)| {
                    let phase = Angle::from_deg(line.phase_deg).rad();
                    let angle = core::f64::consts::TAU * line.frequency_hz * t + phase;
                    axis * angle.sin()
                })
                .sum();
            let Some(at) = plain.attitude(t) else {
                continue;
            };
            t_s.push(t);
            q.push(rotation_from_vector(&turn) * at);
        }
        Ok(AttitudeSeries::new(t_s, q, None)?)
    }

    /// `N M`: vectors from tracker to body axes.
    fn to_body(&self) -> Result<UnitQuaternion<f64>, ScenarioError> {
        let rows = self.alignment;
        let n = Matrix3::from_fn(|i, j| rows[i][j]);
        let off = (n * n.transpose() - Matrix3::identity()).amax();
        let fits = off <= 1e-3 && n.determinant() > 0.0;
        let expected = "the rows of a rotation, orthonormal within 1e-3";
        ScenarioError::check("motion.alignment", off, fits, expected)?;
        let [phi, theta] = self.misalignment_deg;
        ScenarioError::check_finite("motion.misalignment_deg", phi)?;
        ScenarioError::check_finite("motion.misalignment_deg", theta)?;
        // Euler angles turn axes, so vectors turn the other way
        let turn = |axis, deg| UnitQuaternion::from_axis_angle(&axis, -Angle::from_deg(deg).rad());
        let m = turn(Vector3::y_axis(), theta) * turn(Vector3::x_axis(), phi);
        Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&n)) * m)
    }

    /// Body rate at t = 0, rad/s.
    fn start_rate(&self) -> Vector3<f64> {
        let [ix, iy, iz] = self.inertia_kg_m2;
        let w3 = self.spin_rpm * core::f64::consts::TAU / 60.0;
        let across = iz * w3 * Angle::from_deg(self.nutation_deg).rad().tan();
        let (sin, cos) = Angle::from_deg(self.nutation_phase_deg).rad().sin_cos();
        Vector3::new(across * cos / ix, across * sin / iy, w3)
    }
}

/// The tracker turns with the body; the rate in its axes is the body's, turned.
#[derive(Clone)]
struct Spinning {
    to_tracker: UnitQuaternion<f64>,
    rates: Arc<Rates>,
}

impl Turning for Spinning {
    fn rate_rad_s(&self, t_s: f64) -> Vector3<f64> {
        self.to_tracker * self.rates.at(t_s)
    }

    fn step_s(&self) -> f64 {
        STEP_S
    }

    fn next_break_s(&self, _from_s: f64, _backwards: bool) -> Option<f64> {
        None
    }

    // the rates are there throughout
    fn extend(&mut self, _to_s: f64) {}

    fn forget(&mut self, _before_s: f64) {}
}

/// Body rate over time, at equal steps from t = 0 either way.
struct Rates {
    moments: Vector3<f64>,
    before: Vec<Vector3<f64>>,
    after: Vec<Vector3<f64>>,
}

impl Rates {
    fn new(moments: [f64; 3], start: Vector3<f64>, [from_s, to_s]: [f64; 2]) -> Self {
        let moments = Vector3::from(moments);
        let walk = |end_s: f64| {
            let h = STEP_S.copysign(end_s);
            let mut w = start;
            let mut path = vec![w];
            // one step beyond the end, for the last cubic
            while (path.len() as f64 - 2.0) * STEP_S < end_s.abs() {
                let k1 = acceleration(&moments, &w);
                let k2 = acceleration(&moments, &(w + k1 * (0.5 * h)));
                let k3 = acceleration(&moments, &(w + k2 * (0.5 * h)));
                let k4 = acceleration(&moments, &(w + k3 * h));
                w += (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0);
                path.push(w);
            }
            path
        };
        Self {
            moments,
            before: walk(from_s),
            after: walk(to_s),
        }
    }

    /// The cubic through rates and accelerations on either side.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the quotient is clamped to the index range"
    )]
    fn at(&self, t_s: f64) -> Vector3<f64> {
        let (path, h) = if t_s < 0.0 {
            (&self.before, -STEP_S)
        } else {
            (&self.after, STEP_S)
        };
        let last = path.len() - 2;
        let steps = t_s / h;
        let k = steps.floor().clamp(0.0, last as f64) as usize;
        let s = steps - k as f64;
        let (w0, w1) = (path[k], path[k + 1]);
        let (a0, a1) = (
            acceleration(&self.moments, &w0) * h,
            acceleration(&self.moments, &w1) * h,
        );
        let rise = w1 - w0;
        w0 + (a0 + (rise * 3.0 - a0 * 2.0 - a1 + (a0 + a1 - rise * 2.0) * s) * s) * s
    }
}

fn acceleration(moments: &Vector3<f64>, w: &Vector3<f64>) -> Vector3<f64> {
    let l = moments.component_mul(w);
    -w.cross(&l).component_div(moments)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> Rotator {
        Rotator {
            start: Pointing::default(),
            inertia_kg_m2: [14710.5, 14688.8, 29041.9],
            spin_rpm: 0.5,
            nutation_deg: 5.0,
            nutation_phase_deg: 30.0,
            alignment: [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
            misalignment_deg: [0.2, -0.1],
            sinusoid: vec![],
        }
    }

    /// Momentum stays in inertial space, and energy stays: over 2000 s of 105 rad with steps of 2.6e-3
    /// rad the fourth-order error is 105 (2.6e-3)^4 / 120 = 4e-11 of the rate.
    #[test]
    fn momentum_and_energy_are_conserved() {
        let given = image();
        let truth = given.truth([-1000.0, 1000.0]).unwrap();
        let to_body = given.to_body().unwrap();
        let moments = Vector3::from(given.inertia_kg_m2);
        let at = |t: f64| {
            let w = to_body * truth.rate_rad_s(t).unwrap();
            let l = moments.component_mul(&w);
            let q = to_body * truth.attitude(t).unwrap();
            (q.inverse() * l, w.dot(&l))
        };
        let (l0, e0) = at(0.0);
        for t in [-1000.0, -333.3, 512.77, 1000.0] {
            let (l, e) = at(t);
            assert!((l - l0).norm() < 1e-9 * l0.norm(), "{t}");
            assert!((e / e0 - 1.0).abs() < 1e-9, "{t}");
        }
        // the angle to body z at t = 0 is the one asked for
        let z = (to_body * truth.attitude(0.0).unwrap()) * l0.normalize();
        assert!((z.z.acos().to_degrees() - 5.0).abs() < 1e-6);
    }

    /// An oscillation about body z, which is tracker x here, turns the tracker about its x.
    #[test]
    fn an_oscillation_turns_the_tracker_about_the_bodys_axis() {
        let still = Rotator {
            misalignment_deg: [0.0; 2],
            alignment: [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
            ..image()
        };
        let line = Sinusoid {
            axis: [0.0, 0.0, 2.0],
            amplitude_arcsec: 80.0,
            frequency_hz: 0.01,
            phase_deg: 0.0,
        };
        let shaken = Rotator {
            sinusoid: vec![line],
            ..still.clone()
        };
        let span = [-5.0, 60.0];
        let (a, b) = (shaken.truth(span).unwrap(), still.truth(span).unwrap());
        let turn =
            focal_plane::rotation_vector(&a.attitude(25.0).unwrap(), &b.attitude(25.0).unwrap());
        let expected = Vector3::x() * Angle::from_arcsec(80.0).rad();
        assert!((turn - expected).norm() < 1e-12);
    }

    #[test]
    fn a_body_that_cannot_be_is_an_error() {
        let given = Rotator {
            inertia_kg_m2: [1.0, 1.0, 2.5],
            ..image()
        };
        assert!(given.truth([0.0, 1.0]).is_err());
        let mut given = image();
        given.alignment[0][0] = 0.5;
        assert!(given.truth([0.0, 1.0]).is_err());
    }
}
