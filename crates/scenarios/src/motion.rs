//! Motion of the tracker: the truth that everything else of a simulation follows.
//!
//! Every kind gives the body rate as a function of time; [`whole`](integrate::whole) turns it
//! into an attitude that starts, at t = 0, from the pointing
//!
//! ```text
//! Z -> (ra, dec);   roll = 0: X -> east, Y -> north;   roll > 0 turns the tracker about its +Z
//! ```
//!
//! A recorded attitude is taken as it is. A new kind is a variant of [`Motion`] and a file beside this
//! one.
//!
//! Source: `dv/dt = -omega x v` for a fixed star, the convention of `focal_plane::AttitudeSource`.

mod hold;
mod integrate;
mod jitter;
mod long;
pub(crate) mod phase_plane;
mod recorded;
mod rotator;
mod slews;
mod turning;

use std::path::Path;

use focal_plane::{Angle, AttitudeSeries, AttitudeSource, unit_vector};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Deserialize;

use crate::ScenarioError;
use integrate::whole;
use long::Long;
use turning::Turning;

pub use hold::Hold;
pub use jitter::{ClosedLoop, Sinusoid};
pub use phase_plane::PhasePlane;
pub use recorded::{Recorded, RecordedTable};
pub use rotator::Rotator;
pub use slews::{Slew, Slews};

/// Longest step of the integration, s.
pub(crate) const STEP_S: f64 = 0.05;

/// How the tracker moves: `[motion]`, told apart by `kind`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Motion {
    /// `hold`: a constant drift with jitter.
    Hold(Hold),
    /// `slews`: smooth slews with holds between them.
    Slews(Slews),
    /// `phase_plane`: the limit cycle of a thruster controller.
    PhasePlane(PhasePlane),
    /// `rotator`: a rigid body that spins without torque.
    Rotator(Rotator),
    /// `recorded`: the attitude of another bundle.
    Recorded(Recorded),
}

impl Motion {
    /// The true attitude over `span_s`, which holds t = 0.
    ///
    /// `folder` is where relative paths start.
    ///
    /// # Errors
    /// A number outside its range, or a recorded attitude that cannot be read. A recording shorter
    /// than the span is no error: its own span is returned.
    pub fn truth(
        &self,
        span_s: [f64; 2],
        folder: &Path,
        rng: &Xoshiro256PlusPlus,
    ) -> Result<AttitudeSeries, ScenarioError> {
        let from_s = span_s[0];
        match self {
            Self::Hold(hold) => whole(hold.turning(from_s, rng)?, hold.start.attitude()?, span_s),
            Self::Slews(slews) => {
                whole(slews.turning(from_s, rng)?, slews.start.attitude()?, span_s)
            }
            Self::PhasePlane(cycle) => {
                whole(cycle.turning(from_s, rng)?, cycle.start.attitude()?, span_s)
            }
            Self::Rotator(rotator) => rotator.truth(span_s),
            Self::Recorded(recorded) => recorded.truth(folder),
        }
    }

    /// The same attitude, to the last bit, in memory that does not depend on the span: for whoever goes
    /// through it once. A rotator and a recording are held whole.
    ///
    /// # Errors
    /// As [`truth`](Self::truth).
    pub fn long_truth(
        &self,
        span_s: [f64; 2],
        folder: &Path,
        rng: &Xoshiro256PlusPlus,
    ) -> Result<Box<dyn AttitudeSource>, ScenarioError> {
        fn long<T: Turning + Sync>(
            turning: T,
            start: Pointing,
            span_s: [f64; 2],
        ) -> Result<Box<dyn AttitudeSource>, ScenarioError> {
            Ok(Box::new(Long::new(turning, start.attitude()?, span_s)?))
        }
        let from_s = span_s[0];
        match self {
            Self::Hold(hold) => long(hold.turning(from_s, rng)?, hold.start, span_s),
            Self::Slews(slews) => long(slews.turning(from_s, rng)?, slews.start, span_s),
            Self::PhasePlane(cycle) => long(cycle.turning(from_s, rng)?, cycle.start, span_s),
            Self::Rotator(_) | Self::Recorded(_) => Ok(Box::new(self.truth(span_s, folder, rng)?)),
        }
    }
}

/// Where the tracker points at t = 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Pointing {
    /// Right ascension of the boresight, deg, J2000; default 0.
    pub ra_deg: f64,
    /// Declination of the boresight, deg, J2000; default 0.
    pub dec_deg: f64,
    /// Turn about the boresight, deg; at 0 the columns (x) run east and the rows (y) north; default 0.
    pub roll_deg: f64,
}

impl Pointing {
    /// Inertial to tracker.
    ///
    /// # Errors
    /// A number that is not finite, or a declination beyond 90 deg.
    pub fn attitude(&self) -> Result<UnitQuaternion<f64>, ScenarioError> {
        ScenarioError::check_finite("motion.start.ra_deg", self.ra_deg)?;
        let dec_fits = self.dec_deg.abs() <= 90.0;
        ScenarioError::check(
            "motion.start.dec_deg",
            self.dec_deg,
            dec_fits,
            "from -90 to 90",
        )?;
        ScenarioError::check_finite("motion.start.roll_deg", self.roll_deg)?;
        let (ra, dec) = (Angle::from_deg(self.ra_deg), Angle::from_deg(self.dec_deg));
        let boresight = unit_vector(ra, dec);
        let east = Vector3::new(-ra.rad().sin(), ra.rad().cos(), 0.0);
        let north = boresight.cross(&east);
        let axes =
            Matrix3::from_rows(&[east.transpose(), north.transpose(), boresight.transpose()]);
        let level = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        // turning the tracker by +roll turns what it sees by -roll
        let roll = UnitQuaternion::from_axis_angle(
            &Vector3::z_axis(),
            -Angle::from_deg(self.roll_deg).rad(),
        );
        Ok(roll * level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A star north of the boresight is at +y, one to the east at +x; after a roll of +90 deg the x
    /// axis points north, so that the northern star is at +x.
    #[test]
    fn north_is_up_and_roll_turns_the_tracker() {
        let north_of = unit_vector(Angle::from_deg(40.0), Angle::from_deg(31.0));
        let east_of = unit_vector(Angle::from_deg(41.0), Angle::from_deg(30.0));
        let level = Pointing {
            ra_deg: 40.0,
            dec_deg: 30.0,
            roll_deg: 0.0,
        }
        .attitude()
        .unwrap();
        let v = level * north_of;
        assert!(v.x.abs() < 1e-15 && (v.y - 1_f64.to_radians().sin()).abs() < 1e-15);
        let v = level * east_of;
        assert!(v.x > 0.01 && v.y.abs() < 1e-4);
        let rolled = Pointing {
            ra_deg: 40.0,
            dec_deg: 30.0,
            roll_deg: 90.0,
        }
        .attitude()
        .unwrap();
        let v = rolled * north_of;
        assert!(v.y.abs() < 1e-15 && (v.x - 1_f64.to_radians().sin()).abs() < 1e-15);
    }

    #[test]
    fn a_declination_beyond_the_pole_is_an_error() {
        let pointing = Pointing {
            dec_deg: 91.0,
            ..Pointing::default()
        };
        assert!(matches!(
            pointing.attitude(),
            Err(ScenarioError::OutOfRange {
                name: "motion.start.dec_deg",
                ..
            })
        ));
    }
}
