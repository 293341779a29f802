//! The reference, and the bracket between it and the tracker.
//!
//! ```text
//! q_ref = exp(C e) exp(-b) q_true       tracker axes
//! b     = c (T_bracket - T0) + slips    bending: the tracker turns by b against whatever the reference rides on
//! e     = white + wander                wander: first-order Gauss-Markov, exact at its own step
//! ```
//!
//! C turns the axes of the reference, which are the tracker's turned about `cant_axis` by `cant_deg`, into the
//! tracker's: a second tracker that looks elsewhere is worst about its own boresight.
//!
//! A filter's error is mostly wander, a second tracker's mostly white.
//!
//! Source: linear thermo-elastic bending of a bracket; [M23] Eq. 15 for the wander.

use focal_plane::{Angle, AttitudeSource, rotation_from_vector};
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use telemetry::ReferenceTable;

use crate::ImagerError;
use crate::random::Key;
use crate::thermal::Temperatures;

/// `[reference]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Reference {
    /// Samples per second; default that of the frames.
    pub rate_hz: Option<f64>,
    /// Whether it comes with rates; default yes.
    pub rates: bool,
    /// Axis about which the reference is turned against the tracker; its length does not matter;
    /// default y.
    pub cant_axis: [f64; 3],
    /// Angle of that turn, deg; default 0.
    pub cant_deg: f64,
    /// White error of each sample, 1 sigma about each of its axes, arcsec; default 0.
    pub white_arcsec: [f64; 3],
    /// Standard deviation of the wander about each of its axes, arcsec; default 0.
    pub wander_arcsec: [f64; 3],
    /// Correlation time of the wander, s; default 100.
    pub wander_tau_s: [f64; 3],
    /// What it says of its own error, 1 sigma about the tracker's axes, arcsec; default the truth.
    pub declared_arcsec: Option<[f64; 3]>,
}

impl Default for Reference {
    fn default() -> Self {
        Self {
            rate_hz: None,
            rates: true,
            cant_axis: [0.0, 1.0, 0.0],
            cant_deg: 0.0,
            white_arcsec: [0.0; 3],
            wander_arcsec: [0.0; 3],
            wander_tau_s: [100.0; 3],
            declared_arcsec: None,
        }
    }
}

/// `[bracket]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Bracket {
    /// Thermal node of the bracket.
    pub node: Option<String>,
    /// Bending about x, y, z, arcsec per degree; default 0.
    pub arcsec_per_c: [f64; 3],
    /// Temperature without bending, deg C; default 20.
    pub straight_c: f64,
    /// Mechanical shifts.
    pub slip: Vec<Slip>,
}

impl Default for Bracket {
    fn default() -> Self {
        Self {
            node: None,
            arcsec_per_c: [0.0; 3],
            straight_c: 20.0,
            slip: Vec::new(),
        }
    }
}

/// `[[bracket.slip]]`
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Slip {
    /// Instant, s.
    pub at_s: f64,
    /// Turn about x, y, z that stays, arcsec.
    pub arcsec: [f64; 3],
}

impl Bracket {
    pub(crate) fn check(&self) -> Result<(), ImagerError> {
        for value in self.arcsec_per_c {
            ImagerError::finite("bracket.arcsec_per_c", value)?;
            if value != 0.0 && self.node.is_none() {
                return Err(ImagerError::NeedsNode {
                    name: "bracket.arcsec_per_c",
                });
            }
        }
        ImagerError::finite("bracket.straight_c", self.straight_c)?;
        for slip in &self.slip {
            let [x, y, z] = slip.arcsec;
            ImagerError::finite("bracket.slip", slip.at_s + x + y + z)?;
        }
        Ok(())
    }

    /// Turn of the tracker against the reference, rad; `node` is that of the bracket.
    fn turn_rad(&self, temperatures: &Temperatures, node: Option<usize>, t_s: f64) -> Vector3<f64> {
        let warm = node.map_or(0.0, |node| temperatures.at(node, t_s) - self.straight_c);
        let slipped = self.slip.iter().filter(|slip| t_s >= slip.at_s);
        let slips: Vector3<f64> = slipped.map(|slip| Vector3::from(slip.arcsec)).sum();
        (Vector3::from(self.arcsec_per_c) * warm + slips).map(|a| Angle::from_arcsec(a).rad())
    }
}

impl Reference {
    pub(crate) fn check(&self) -> Result<(), ImagerError> {
        if let Some(rate_hz) = self.rate_hz {
            ImagerError::positive("reference.rate_hz", rate_hz)?;
        }
        let length = Vector3::from(self.cant_axis).norm();
        ImagerError::positive("reference.cant_axis (length)", length)?;
        ImagerError::finite("reference.cant_deg", self.cant_deg)?;
        for axis in 0..3 {
            ImagerError::not_negative("reference.white_arcsec", self.white_arcsec[axis])?;
            ImagerError::not_negative("reference.wander_arcsec", self.wander_arcsec[axis])?;
            ImagerError::positive("reference.wander_tau_s", self.wander_tau_s[axis])?;
            let declared = self.declared_arcsec.map_or(1.0, |declared| declared[axis]);
            ImagerError::positive("reference.declared_arcsec", declared)?;
        }
        Ok(())
    }

    /// From its own axes to those of the tracker.
    fn to_tracker(&self) -> Rotation3<f64> {
        let axis = Unit::new_normalize(Vector3::from(self.cant_axis));
        Rotation3::from_axis_angle(&axis, Angle::from_deg(self.cant_deg).rad())
    }

    /// What the table says of the error, if anything.
    fn declared(&self) -> Option<[f64; 3]> {
        let squares = |k: usize| self.white_arcsec[k].powi(2) + self.wander_arcsec[k].powi(2);
        let own = Vector3::from_fn(|axis, _| squares(axis));
        let turn = self.to_tracker();
        let covariance = turn * Matrix3::from_diagonal(&own) * turn.inverse();
        let sigma = [0, 1, 2].map(|axis| covariance[(axis, axis)].sqrt());
        self.declared_arcsec.or((own.sum() > 0.0).then_some(sigma))
    }
}

/// Samples that go forward with the frames.
#[derive(Clone, Debug)]
pub(crate) struct References {
    reference: Reference,
    bracket: Bracket,
    node: Option<usize>,
    key: Key,
    first_s: f64,
    step_s: f64,
    /// Number of the next sample.
    next: u64,
    wander: Option<Vector3<f64>>,
}

impl References {
    /// From one step before the first frame.
    pub(crate) fn new(
        reference: &Reference,
        bracket: &Bracket,
        node: Option<usize>,
        key: Key,
        first_s: f64,
        frames_hz: f64,
    ) -> Self {
        let step_s = 1.0 / reference.rate_hz.unwrap_or(frames_hz);
        Self {
            reference: reference.clone(),
            bracket: bracket.clone(),
            node,
            key,
            first_s: first_s - step_s,
            step_s,
            next: 0,
            wander: None,
        }
    }

    pub(crate) fn step_s(&self) -> f64 {
        self.step_s
    }

    /// All samples up to and with the first at or after `until_s`; those outside the motion are left
    /// out.
    pub(crate) fn until(
        &mut self,
        until_s: f64,
        truth: &dyn AttitudeSource,
        temperatures: &Temperatures,
    ) -> ReferenceTable {
        let mut table = ReferenceTable::default();
        let mut rates = Vec::new();
        loop {
            let t_s = self.first_s + self.next as f64 * self.step_s;
            if t_s >= until_s + self.step_s {
                break;
            }
            let error = self.error_rad();
            if let (Some(q), Some(rate)) = (truth.attitude(t_s), truth.rate_rad_s(t_s)) {
                let bent = self.bracket.turn_rad(temperatures, self.node, t_s);
                let rides = rotation_from_vector(&-bent) * q;
                table.t_s.push(t_s);
                table.q.push(rotation_from_vector(&error) * rides);
                rates.push(rate);
            }
        }
        table.sigma_arcsec = self
            .reference
            .declared()
            .map(|sigma| vec![sigma; table.t_s.len()]);
        table.rates_rad_s = self.reference.rates.then_some(rates);
        table
    }

    /// Error of the next sample, rad.
    fn error_rad(&mut self) -> Vector3<f64> {
        let mut rng = self.key.with(self.next).stream();
        self.next += 1;
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let r = &self.reference;
        let before = self.wander;
        let wander = Vector3::from_fn(|axis, _| {
            let n = r.wander_arcsec[axis] * normal();
            match before {
                // stationary from the first sample on
                None => n,
                Some(before) => {
                    let a = (-self.step_s / r.wander_tau_s[axis]).exp();
                    a * before[axis] + (1.0 - a * a).sqrt() * n
                }
            }
        });
        self.wander = Some(wander);
        let white = Vector3::from_fn(|axis, _| r.white_arcsec[axis] * normal());
        (r.to_tracker() * (wander + white)).map(|arcsec| Angle::from_arcsec(arcsec).rad())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// [M23] Section 4.3.1: 124 arcsec about the boresight of a camera canted by 15 deg, and 1.5 across, are
    /// (32, 1.5, 120) about the axes of the tracker, to the digits printed.
    #[test]
    fn a_canted_reference_is_worst_about_its_own_boresight() {
        let canted = Reference {
            cant_deg: 15.0,
            white_arcsec: [1.5, 1.5, 124.0],
            ..Reference::default()
        };
        let declared = canted.declared().unwrap();
        let off = |axis: usize, printed: f64| (declared[axis] - printed).abs();
        assert!(
            off(0, 32.0) < 0.5 && off(1, 1.5) < 0.05 && off(2, 120.0) < 0.5,
            "{declared:?}"
        );
        // about +y: the reference's boresight leans to +x of the tracker
        let boresight = canted.to_tracker() * Vector3::z();
        assert!(boresight.x > 0.25 && boresight.y.abs() < 1e-15);
    }
}
