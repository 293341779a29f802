//! Limit cycle of a thruster controller that keeps each axis inside a deadband.
//!
//! ```text
//! every cycle, per control axis:    fire if |theta| > deadband and the rate points outward
//! a firing:                         w -> -sign(theta) r,    r uniform in rate (1 -+ spread)
//!                                   the two other axes: w += coupling dw n,   n ~ N(0, 1)
//! between firings:                  dw/dt = torque
//! body rate:                        drift + C w,   C from control to tracker axes
//! ```
//!
//! The rate goes linearly from one cycle to the next, so that a firing lasts one cycle and the rate is
//! continuous. Angles are the integrals of the rates about the control axes: turns about different axes
//! commute to second order, 4e-6 rad for a deadband of 0.11 deg. The control frame is the tracker's,
//! turned about `cant_axis` by `cant_deg`. The drift moves the commanded attitude: it is the migration
//! that remains when the cycles average out. The attitude at t = 0 is the start; where in its deadband
//! each axis is then, is drawn.
//!
//! Source: [M23] Section 4.3: a phase-plane controller with one deadband across and one about a canted
//! boresight, stars that cross it in short tracks of random direction and migrate by some pixels. Rates,
//! spread and coupling are not printed: assumptions of the scenario that uses it.

use focal_plane::Angle;
use nalgebra::{Rotation3, Unit, Vector3};
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Deserialize;

use super::hold::drift_rad_s;
use super::jitter::unit_axis;
use super::turning::{Samples, Turning};
use super::{Pointing, STEP_S};
use crate::ScenarioError;

/// `[motion]` with `kind = "phase_plane"`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhasePlane {
    /// Attitude at t = 0.
    #[serde(default)]
    pub start: Pointing,
    /// Rate of the commanded attitude, arcsec/s, tracker axes; default 0.
    #[serde(default)]
    pub drift_arcsec_s: [f64; 3],
    /// Axis of the cant between tracker and control frame; its length does not matter; default y.
    #[serde(default = "y_axis")]
    pub cant_axis: [f64; 3],
    /// Angle of the cant, deg; default 0.
    #[serde(default)]
    pub cant_deg: f64,
    /// Half width of the deadband about each control axis, deg.
    pub deadband_deg: [f64; 3],
    /// Mean rate after a firing, arcsec/s, about each control axis.
    pub rate_arcsec_s: [f64; 3],
    /// Rates after firings are spread evenly over this part of their mean on either side, 0 to 1;
    /// default 0.5.
    #[serde(default = "half")]
    pub rate_spread: f64,
    /// Part of a firing that the other axes feel, 1 sigma; default 0.
    #[serde(default)]
    pub coupling: f64,
    /// Steady torque, as an acceleration about each control axis, arcsec/s^2; default 0.
    #[serde(default)]
    pub torque_arcsec_s2: [f64; 3],
    /// Cycle of the controller, s; default 1.
    #[serde(default = "one")]
    pub cycle_s: f64,
}

pub(crate) fn y_axis() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

fn half() -> f64 {
    0.5
}

fn one() -> f64 {
    1.0
}

/// Turns vectors of a canted frame into tracker axes: that frame is the tracker's, turned about `axis`
/// by `deg`.
pub(crate) fn cant(
    names: [&'static str; 2],
    axis: [f64; 3],
    deg: f64,
) -> Result<Rotation3<f64>, ScenarioError> {
    let axis = Unit::new_normalize(unit_axis(names[0], axis)?);
    ScenarioError::check_finite(names[1], deg)?;
    Ok(Rotation3::from_axis_angle(
        &axis,
        Angle::from_deg(deg).rad(),
    ))
}

impl PhasePlane {
    pub(super) fn turning(
        &self,
        from_s: f64,
        rng: &Xoshiro256PlusPlus,
    ) -> Result<Cycling, ScenarioError> {
        self.check()?;
        let names = ["motion.cant_axis", "motion.cant_deg"];
        Ok(Cycling {
            to_tracker: cant(names, self.cant_axis, self.cant_deg)?,
            drift_rad_s: drift_rad_s(self.drift_arcsec_s)?,
            track: self.track(from_s, rng.clone()),
        })
    }

    fn check(&self) -> Result<(), ScenarioError> {
        for axis in 0..3 {
            ScenarioError::check_positive("motion.deadband_deg", self.deadband_deg[axis])?;
            ScenarioError::check_positive("motion.rate_arcsec_s", self.rate_arcsec_s[axis])?;
            ScenarioError::check_finite("motion.torque_arcsec_s2", self.torque_arcsec_s2[axis])?;
        }
        let spread = self.rate_spread;
        let fits = (0.0..1.0).contains(&spread);
        ScenarioError::check("motion.rate_spread", spread, fits, "from 0 to below 1")?;
        ScenarioError::check_not_negative("motion.coupling", self.coupling)?;
        ScenarioError::check_positive("motion.cycle_s", self.cycle_s)
    }

    /// The controller before its first cycle.
    fn track(&self, from_s: f64, mut rng: Xoshiro256PlusPlus) -> Track {
        let deadband = self.deadband_deg.map(|deg| Angle::from_deg(deg).rad());
        let arcsec = |values: [f64; 3]| values.map(|v| Angle::from_arcsec(v).rad());
        let (mean, torque) = (arcsec(self.rate_arcsec_s), arcsec(self.torque_arcsec_s2));
        let cycle_s = self.cycle_s;
        let theta = Vector3::from_fn(|a, _| deadband[a] * symmetric(&mut rng));
        let w = Vector3::from_fn(|a, _| {
            let size = mean[a] * (1.0 + self.rate_spread * symmetric(&mut rng));
            size * symmetric(&mut rng).signum()
        });
        let start_s = (from_s / cycle_s).floor() * cycle_s;
        let mut samples = Samples::new(start_s, cycle_s);
        samples.push(w);
        Track {
            start_s,
            samples,
            theta,
            w,
            deadband,
            mean,
            torque: Vector3::from(torque),
            rate_spread: self.rate_spread,
            coupling: self.coupling,
            rng,
        }
    }
}

/// Evenly spread over -1 to 1.
fn symmetric(rng: &mut Xoshiro256PlusPlus) -> f64 {
    let u: f64 = StandardUniform.sample(rng);
    2.0 * u - 1.0
}

/// Rate about the control axes at each cycle, and the controller behind it.
#[derive(Clone, Debug)]
struct Track {
    start_s: f64,
    samples: Samples<Vector3<f64>>,
    theta: Vector3<f64>,
    w: Vector3<f64>,
    deadband: [f64; 3],
    mean: [f64; 3],
    torque: Vector3<f64>,
    rate_spread: f64,
    coupling: f64,
    rng: Xoshiro256PlusPlus,
}

impl Track {
    /// Runs the controller one cycle beyond this time.
    fn extend(&mut self, to_s: f64) {
        let cycle_s = self.samples.step_s();
        while self.samples.end_s() - 2.0 * cycle_s < to_s {
            let mut next = self.w + self.torque * cycle_s;
            for a in 0..3 {
                let (theta, w) = (self.theta[a], self.w[a]);
                if theta.abs() <= self.deadband[a] || theta * w <= 0.0 {
                    continue;
                }
                let size = self.mean[a] * (1.0 + self.rate_spread * symmetric(&mut self.rng));
                let change = -theta.signum() * size - w;
                for b in 0..3 {
                    let share: f64 = if a == b {
                        1.0
                    } else {
                        let normal: f64 = StandardNormal.sample(&mut self.rng);
                        self.coupling * normal
                    };
                    next[b] += share * change;
                }
            }
            self.theta += (self.w + next) * (0.5 * cycle_s);
            self.w = next;
            self.samples.push(next);
        }
    }

    fn rate_rad_s(&self, t_s: f64) -> Vector3<f64> {
        let (before, after, share) = self.samples.around(t_s);
        before.lerp(&after, share)
    }
}

/// A controller's cycles in tracker axes, and the drift.
#[derive(Clone, Debug)]
pub(super) struct Cycling {
    to_tracker: Rotation3<f64>,
    drift_rad_s: Vector3<f64>,
    track: Track,
}

impl Turning for Cycling {
    fn rate_rad_s(&self, t_s: f64) -> Vector3<f64> {
        self.drift_rad_s + self.to_tracker * self.track.rate_rad_s(t_s)
    }

    fn step_s(&self) -> f64 {
        STEP_S
    }

    fn next_break_s(&self, from_s: f64, backwards: bool) -> Option<f64> {
        let (start_s, cycle_s) = (self.track.start_s, self.track.samples.step_s());
        let near = ((from_s - start_s) / cycle_s).round();
        let at = |cycles: f64| start_s + cycles * cycle_s;
        let beside = [-1.0, 0.0, 1.0].map(|k| at(near + k));
        if backwards {
            beside.into_iter().rev().find(|&t| t < from_s)
        } else {
            beside.into_iter().find(|&t| t > from_s)
        }
    }

    fn extend(&mut self, to_s: f64) {
        self.track.extend(to_s);
    }

    fn forget(&mut self, before_s: f64) {
        self.track.samples.forget(before_s);
    }
}

#[cfg(test)]
mod tests {
    use focal_plane::{AttitudeSource, rotation_vector};
    use star_tracker::{Purpose, stream};

    use super::super::integrate::whole;
    use super::*;

    fn cycle() -> PhasePlane {
        PhasePlane {
            start: Pointing::default(),
            drift_arcsec_s: [0.0; 3],
            cant_axis: y_axis(),
            cant_deg: 15.0,
            deadband_deg: [0.11, 0.11, 0.27],
            rate_arcsec_s: [15.0; 3],
            rate_spread: 0.5,
            coupling: 0.2,
            torque_arcsec_s2: [0.0; 3],
            cycle_s: 1.0,
        }
    }

    /// Angles about the control axes, deg, each second: the attitude error is minus the turn, and the
    /// control axes are the tracker's turned by the cant.
    fn angles_deg(given: &PhasePlane, seed: u64) -> Vec<Vector3<f64>> {
        let span = [-5.0, 10_000.0];
        let turning = given.turning(span[0], &stream(seed, 0, Purpose::Motion));
        let start = given.start.attitude().unwrap();
        let truth = whole(turning.unwrap(), start, span).unwrap();
        let cant = Rotation3::from_axis_angle(&Vector3::y_axis(), 15_f64.to_radians());
        let angle = |k: u32| {
            let q = truth.attitude(f64::from(k)).unwrap();
            cant.inverse() * -rotation_vector(&q, &start) * 1_f64.to_degrees()
        };
        (0..10_000).map(angle).collect()
    }

    /// Every axis uses its deadband and leaves it by no more than the rate lets it within the two cycles
    /// that a firing takes. With a coupling of 0.2 a rate of 22.5 arcsec/s can gain a few times
    /// 0.2 x 45 arcsec/s: 60 arcsec/s x 2 s on either side bounds it, and second order (see the header)
    /// adds 0.27^2 deg^2 / 2 = 2 arcsec.
    #[test]
    fn each_axis_stays_in_its_deadband_and_fills_it() {
        let angle = angles_deg(&cycle(), 1);
        for (axis, width) in [(0, 0.22), (1, 0.22), (2, 0.54)] {
            let max = angle.iter().map(|v| v[axis]).fold(f64::MIN, f64::max);
            let min = angle.iter().map(|v| v[axis]).fold(f64::MAX, f64::min);
            let used = max - min;
            assert!(
                used > width && used < width + 2.0 * 122.0 / 3600.0,
                "axis {axis}: {used} deg"
            );
        }
    }

    /// What the drift adds is the drift: the same draw with and without it differs by drift x time,
    /// to second order in both.
    #[test]
    fn the_drift_is_the_migration() {
        let still = cycle();
        let moving = PhasePlane {
            drift_arcsec_s: [0.03, -0.04, 0.0],
            ..still.clone()
        };
        let cant = Rotation3::from_axis_angle(&Vector3::y_axis(), 15_f64.to_radians());
        let (a, b) = (angles_deg(&still, 3), angles_deg(&moving, 3));
        let expected = cant.inverse() * Vector3::new(0.03, -0.04, 0.0) * (9999.0 / 3600.0);
        let got = b[9999] - a[9999];
        // 0.14 deg x 0.3 deg in rad is 1.3e-5 rad
        assert!((got - expected).norm() < 2e-3, "{got} {expected}");
    }

    /// Directions change at random and rates are those of the firings: without coupling the rate about
    /// an axis between firings lies within the spread.
    #[test]
    fn rates_are_those_of_firings() {
        let given = PhasePlane {
            coupling: 0.0,
            ..cycle()
        };
        let mut track = given.track(0.0, stream(2, 0, Purpose::Motion));
        track.extend(20_000.0);
        let rates: Vec<_> = track.samples.iter().collect();
        let mut sizes = Vec::new();
        for pair in rates.windows(2).filter(|p| p[0] == p[1]) {
            sizes.push(Angle::from_rad(pair[0].x.abs()).arcsec());
        }
        assert!(sizes.iter().all(|r| (7.5 - 1e-9..22.5 + 1e-9).contains(r)));
        let slow = sizes.iter().filter(|r| **r < 12.0).count();
        let fast = sizes.iter().filter(|r| **r > 18.0).count();
        assert!(slow > 0 && fast > 0, "both slow and fast tracks");
        let reversals = rates.windows(2).filter(|p| p[0].x * p[1].x < 0.0).count();
        // 792 arcsec at 7.5 to 22.5 arcsec/s: 20 000 s hold between 189 and 568 crossings
        assert!((180..580).contains(&reversals), "{reversals}");
    }

    /// A steady torque is countered: the attitude stays, at the side the torque pushes it to.
    #[test]
    fn a_torque_is_countered() {
        let given = PhasePlane {
            torque_arcsec_s2: [0.05, 0.0, 0.0],
            ..cycle()
        };
        let angle = angles_deg(&given, 4);
        let max = angle.iter().map(|v| v.x.abs()).fold(0.0, f64::max);
        assert!(max < 0.4, "{max} deg");
    }

    #[test]
    fn a_deadband_of_zero_is_an_error() {
        let given = PhasePlane {
            deadband_deg: [0.1, 0.0, 0.1],
            ..cycle()
        };
        let got = given.turning(0.0, &stream(1, 0, Purpose::Motion));
        let name = "motion.deadband_deg";
        assert!(matches!(got, Err(ScenarioError::OutOfRange { name: n, .. }) if n == name));
    }
}
