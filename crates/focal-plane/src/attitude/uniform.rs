//! Rotation at a constant rate, in closed form.
//!
//! ```text
//! q(t) = exp(-omega (t - t0)) q0
//! ```
//!
//! which solves dv/dt = -omega x v: the simplest true attitude, and what tests compare against.
//!
//! Source: exponential of a constant rate; signs as in `attitude`.

use nalgebra::{UnitQuaternion, Vector3};

use crate::{AttitudeSource, rotation_from_vector};

/// A tracker that turns at a constant rate, at any time.
///
/// ```
/// use focal_plane::{AttitudeSource, UniformRotation};
/// use nalgebra::{UnitQuaternion, Vector3};
/// let slew = UniformRotation {
///     rate_rad_s: Vector3::new(0.0, 0.01, 0.0),
///     ..UniformRotation::default()
/// };
/// let star = slew.attitude(1.0).expect("any time") * Vector3::z();
/// assert!((star.x + 0.01_f64.sin()).abs() < 1e-15); // stars move against the rate
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UniformRotation {
    /// Time at which the attitude is `at_start`, s.
    pub start_s: f64,
    /// Attitude then, inertial to tracker.
    pub at_start: UnitQuaternion<f64>,
    /// Rate of the tracker relative to inertial, tracker axes, rad/s.
    pub rate_rad_s: Vector3<f64>,
}

impl Default for UniformRotation {
    /// Tracker axes along inertial axes, at rest.
    fn default() -> Self {
        Self {
            start_s: 0.0,
            at_start: UnitQuaternion::identity(),
            rate_rad_s: Vector3::zeros(),
        }
    }
}

impl AttitudeSource for UniformRotation {
    fn attitude(&self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        let turned = rotation_from_vector(&(self.rate_rad_s * (self.start_s - t_s)));
        t_s.is_finite().then(|| turned * self.at_start)
    }

    fn rate_rad_s(&self, t_s: f64) -> Option<Vector3<f64>> {
        t_s.is_finite().then_some(self.rate_rad_s)
    }

    fn span_s(&self) -> [f64; 2] {
        [f64::NEG_INFINITY, f64::INFINITY]
    }
}
