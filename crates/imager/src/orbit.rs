//! The true velocity of the tracker.
//!
//! ```text
//! v = constant + (2 pi r/P) Rz(node) Rx(inclination) (-sin a, cos a, 0),   a = 2 pi t/P + phase     inertial
//! ```
//!
//! Stars are seen at `(u + v/c)` normalised; nothing in the readout knows it.
//!
//! Source: circular orbit; aberration as in `focal_plane::aberrated`.

use core::f64::consts::TAU;

use nalgebra::{Rotation3, Vector3};
use serde::{Deserialize, Serialize};

use crate::ImagerError;

/// `[orbit]`
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Orbit {
    /// Constant part of the velocity, km/s, inertial; default 0.
    pub velocity_km_s: [f64; 3],
    /// Radius of the orbit, km; default 0: none.
    pub radius_km: f64,
    /// Period, s; default 5400.
    pub period_s: Option<f64>,
    /// Inclination to the equator, deg; default 0.
    pub inclination_deg: f64,
    /// Right ascension of the ascending node, deg; default 0.
    pub node_deg: f64,
    /// Angle from the node at t = 0, deg; default 0.
    pub phase_deg: f64,
    /// Whether the velocity is in the housekeeping, as `vx_km_s`, `vy_km_s`, `vz_km_s`; default no.
    pub reported: bool,
}

const PERIOD_S: f64 = 5400.0;

impl Orbit {
    pub(crate) fn check(&self) -> Result<(), ImagerError> {
        for value in self.velocity_km_s {
            let slow = value.abs() < 1000.0;
            ImagerError::check("orbit.velocity_km_s", value, slow, "below 1000")?;
        }
        ImagerError::not_negative("orbit.radius_km", self.radius_km)?;
        ImagerError::positive("orbit.period_s", self.period_s.unwrap_or(PERIOD_S))?;
        ImagerError::finite("orbit.inclination_deg", self.inclination_deg)?;
        ImagerError::finite("orbit.node_deg", self.node_deg)?;
        ImagerError::finite("orbit.phase_deg", self.phase_deg)
    }

    /// Velocity, km/s, inertial.
    pub(crate) fn velocity_km_s(&self, t_s: f64) -> Vector3<f64> {
        let constant = Vector3::from(self.velocity_km_s);
        if self.radius_km == 0.0 {
            return constant;
        }
        let period_s = self.period_s.unwrap_or(PERIOD_S);
        let a = TAU * t_s / period_s + self.phase_deg.to_radians();
        let node = Rotation3::from_axis_angle(&Vector3::z_axis(), self.node_deg.to_radians());
        let tilt =
            Rotation3::from_axis_angle(&Vector3::x_axis(), self.inclination_deg.to_radians());
        let speed = TAU * self.radius_km / period_s;
        constant + node * tilt * Vector3::new(-a.sin(), a.cos(), 0.0) * speed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Speed 2 pi r/P in the plane of the orbit; at the node it climbs by the inclination.
    #[test]
    fn a_circle_is_gone_round_at_its_speed() {
        let orbit = Orbit {
            velocity_km_s: [0.0, 0.0, 1.0],
            radius_km: 7000.0,
            period_s: Some(6000.0),
            inclination_deg: 60.0,
            node_deg: 90.0,
            ..Orbit::default()
        };
        let speed = TAU * 7000.0 / 6000.0;
        let own = |t| orbit.velocity_km_s(t) - Vector3::z();
        assert!((own(1234.0).norm() - speed).abs() < 1e-12);
        // node at +y: there the velocity is half back along x, the rest up
        let climb = Vector3::new(-0.5, 0.0, 0.75_f64.sqrt()) * speed;
        assert!((own(0.0) - climb).norm() < 1e-12, "{}", own(0.0));
        // a quarter on, the velocity is against the node
        assert!((own(1500.0) + Vector3::y() * speed).norm() < 1e-12);
    }
}
