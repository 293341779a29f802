//! The axisymmetric body without torque, in closed form.
//!
//! ```text
//! q(t) = exp(-w_p t e_z) exp(-w_l t u) q0,    u = L0 / |L0|, body axes at t = 0
//! w_p  = (1 - I3/IT) w3                       nutation rate in the body
//! w_l  = |L| / IT = I3 w_p / ((IT - I3) cos theta)    inertial nutation rate, cos theta = L3 / |L|
//! ```
//!
//! because `w = (L/IT) u + (1 - I3/IT) w3 e_z`. The printed form of [A01] is the same motion, in the
//! convention of its Ref. 4: quaternions there are conjugate to these, `q' = [u sin(beta) ...]`.
//!
//! Source: [A01] Eq. 3, with the definitions of alpha and beta below it.

use focal_plane::rotation_from_vector;
use nalgebra::{UnitQuaternion, Vector3};

use super::Body;

/// Rates of the nutation of an axisymmetric body, rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NutationRates {
    /// In the body: `(1 - I3/IT) w3`.
    pub body_rad_s: f64,
    /// Against inertial space: `|L| / IT`.
    pub inertial_rad_s: f64,
}

/// Nutation rates of a body, its triaxiality left out.
#[must_use]
pub fn nutation_rates(body: &Body) -> NutationRates {
    let inertia = body.inertia.axisymmetric();
    let l = inertia.tensor() * body.rate_rad_s;
    NutationRates {
        body_rad_s: (1.0 - inertia.axial_ratio) * body.rate_rad_s.z,
        inertial_rad_s: l.norm(),
    }
}

/// Attitude at a time, s, inertial to body; triaxiality and torque are left out.
#[must_use]
pub fn axisymmetric(body: &Body, t_s: f64) -> UnitQuaternion<f64> {
    let inertia = body.inertia.axisymmetric();
    // |L|/IT times u: no direction to normalise, so a body at rest stays
    let inertial = inertia.tensor() * body.rate_rad_s;
    let nutation = nutation_rates(body).body_rad_s;
    rotation_from_vector(&(Vector3::z() * (-nutation * t_s)))
        * rotation_from_vector(&(inertial * -t_s))
        * body.epoch
}
