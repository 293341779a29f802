//! Velocity on a circular orbit, in the inertial frame.
//!
//! ```text
//! v = V (-sin u P + cos u Q),    u = 2 pi t / period + phase,    V = 2 pi radius / period
//! P = (cos node, sin node, 0)                                    towards the ascending node
//! Q = (-sin node cos i, cos node cos i, sin i)
//! ```
//!
//! in equatorial axes (J2000); the channels are `<name>vx_km_s`, `<name>vy_km_s`, `<name>vz_km_s`.
//!
//! Source: uniform circular motion.

use focal_plane::Angle;
use nalgebra::Vector3;
use serde::Deserialize;

use super::Column;
use crate::ScenarioError;

/// `kind = "orbit_velocity"`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OrbitVelocity {
    /// Put before `vx_km_s`, `vy_km_s`, `vz_km_s`; default nothing.
    #[serde(default)]
    pub prefix: String,
    /// Radius of the orbit, km.
    pub radius_km: f64,
    /// Period, s.
    pub period_s: f64,
    /// Inclination to the equator, deg; default 0.
    #[serde(default)]
    pub inclination_deg: f64,
    /// Right ascension of the ascending node, deg; default 0.
    #[serde(default)]
    pub node_deg: f64,
    /// Angle from the node at t = 0, deg; default 0.
    #[serde(default)]
    pub phase_deg: f64,
    /// 1 sigma of each measured component, km/s; default 0.
    #[serde(default)]
    pub noise_km_s: f64,
}

impl OrbitVelocity {
    /// Velocity, km/s.
    pub fn velocity_km_s(&self, t_s: f64) -> Vector3<f64> {
        let rate = core::f64::consts::TAU / self.period_s;
        let (su, cu) = (rate * t_s + Angle::from_deg(self.phase_deg).rad()).sin_cos();
        let (sn, cn) = Angle::from_deg(self.node_deg).rad().sin_cos();
        let (si, ci) = Angle::from_deg(self.inclination_deg).rad().sin_cos();
        let p = Vector3::new(cn, sn, 0.0);
        let q = Vector3::new(-sn * ci, cn * ci, si);
        (q * cu - p * su) * (self.radius_km * rate)
    }

    pub(super) fn columns(&self, t_s: &[f64]) -> Result<Vec<Column>, ScenarioError> {
        ScenarioError::check_positive("housekeeping.channel.radius_km", self.radius_km)?;
        ScenarioError::check_positive("housekeeping.channel.period_s", self.period_s)?;
        ScenarioError::check_finite("housekeeping.channel.inclination_deg", self.inclination_deg)?;
        ScenarioError::check_finite("housekeeping.channel.node_deg", self.node_deg)?;
        ScenarioError::check_finite("housekeeping.channel.phase_deg", self.phase_deg)?;
        ScenarioError::check_not_negative("housekeeping.channel.noise_km_s", self.noise_km_s)?;
        let velocity: Vec<Vector3<f64>> = t_s.iter().map(|&t| self.velocity_km_s(t)).collect();
        let column = |axis: usize, name: &str| Column {
            name: format!("{}{name}", self.prefix),
            value: velocity.iter().map(|v| v[axis]).collect(),
            noise: self.noise_km_s,
        };
        Ok(vec![
            column(0, "vx_km_s"),
            column(1, "vy_km_s"),
            column(2, "vz_km_s"),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Earth-like numbers: 29.78 km/s, at right angles to the orbit's pole, northbound at the node.
    #[test]
    fn the_velocity_lies_in_the_plane_and_goes_north_at_the_node() {
        let orbit = OrbitVelocity {
            prefix: String::new(),
            radius_km: 149_597_870.7,
            period_s: 365.256_363 * 86_400.0,
            inclination_deg: 23.44,
            node_deg: 30.0,
            phase_deg: 0.0,
            noise_km_s: 0.0,
        };
        let (i, n) = (23.44_f64.to_radians(), 30_f64.to_radians());
        let pole = Vector3::new(i.sin() * n.sin(), -i.sin() * n.cos(), i.cos());
        for t in [0.0, 1e6, 2e7] {
            let v = orbit.velocity_km_s(t);
            assert!((v.norm() - 29.7847).abs() < 1e-3 && v.dot(&pole).abs() < 1e-12);
        }
        let v = orbit.velocity_km_s(0.0);
        assert!(v.z > 0.0 && (v.z / v.norm() - i.sin()).abs() < 1e-12);
        // a quarter later, at the northernmost point, it flies away from the node
        let v = orbit.velocity_km_s(0.25 * orbit.period_s);
        let node = Vector3::new(n.cos(), n.sin(), 0.0);
        assert!((v / v.norm() + node).norm() < 1e-12);
    }
}
