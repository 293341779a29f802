//! Left Jacobian of the rotation group, and its inverse.
//!
//! ```text
//! J_l(phi) v    = v + (1 - cos a)/a^2  phi x v + (a - sin a)/a^3  phi x (phi x v),   a = |phi|
//! J_l^-1(phi) v = v - 1/2 phi x v + (1 - (a/2) cot(a/2))/a^2  phi x (phi x v)
//! ```
//!
//! Both coefficients of the double product lose digits as a^2 shrinks, but the product itself is of
//! size a^2: the result stays good to rounding. Below 0.01 their series are used.
//!
//! Source: Sola, A micro Lie theory for state estimation in robotics (arXiv:1812.01537), Eqs. 145
//! and 146.

use nalgebra::Vector3;

/// Below this angle, rad, the series' first left-out terms are under 1e-16 of the result.
const SERIES_BELOW_RAD: f64 = 0.01;

/// `J_l(phi) v`: turns the derivative of a rotation vector into an angular velocity in the frame
/// that is turned into (`d exp(phi)/dt = (J_l(phi) phi') x exp(phi)`); phi in rad.
#[must_use]
pub fn so3_left_jacobian(phi: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    let a2 = phi.norm_squared();
    let a = a2.sqrt();
    let (first, second) = if a < SERIES_BELOW_RAD {
        (
            0.5 - a2 * (1.0 / 24.0 - a2 / 720.0),
            1.0 / 6.0 - a2 * (1.0 / 120.0 - a2 / 5040.0),
        )
    } else {
        let half_sine = (0.5 * a).sin();
        (2.0 * half_sine * half_sine / a2, (a - a.sin()) / (a2 * a))
    };
    let once = phi.cross(v);
    v + once * first + phi.cross(&once) * second
}

/// `J_l^-1(phi) v`, the inverse of [`so3_left_jacobian`]; finite up to 2 pi.
#[must_use]
pub fn so3_left_jacobian_inverse(phi: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    let a2 = phi.norm_squared();
    let a = a2.sqrt();
    let second = if a < SERIES_BELOW_RAD {
        1.0 / 12.0 + a2 * (1.0 / 720.0 + a2 / 30_240.0)
    } else {
        (1.0 - 0.5 * a / (0.5 * a).tan()) / a2
    };
    let once = phi.cross(v);
    v - once * 0.5 + phi.cross(&once) * second
}
