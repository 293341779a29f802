//! Attitude: rotation vectors, and anything that knows where the tracker points.
//!
//! ```text
//! v_tracker = q v_inertial
//! theta = log(q_meas q_ref^-1)                 error, tracker axes, rad
//! d exp(phi)/dt = (J_l(phi) phi')^x exp(phi)   J_l: left Jacobian of the rotation group
//! omega = -J_l(phi) phi'                       with q(t) = exp(phi(t)) q0
//! ```
//!
//! The last line follows from dv/dt = -omega x v for a star fixed in inertial space.
//!
//! Source: Sola, A micro Lie theory for state estimation in robotics (arXiv:1812.01537), Eqs. 133
//! and 143 to 146 (exponential, left Jacobian and inverse).

mod jacobian;
mod residual;
mod rotate;
mod series;
mod uniform;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::QuaternionsMut;

pub use jacobian::{so3_left_jacobian, so3_left_jacobian_inverse};
pub use residual::AttitudeResidual;
pub use rotate::{rotate_each_into, rotate_into};
pub(crate) use series::locate;
pub use series::{AttitudeCursor, AttitudeError, AttitudeSeries};
pub use uniform::UniformRotation;

/// Something that knows the attitude (inertial to tracker) and the rate over a span of time.
///
/// Never extrapolates: outside [`span_s`](Self::span_s), and inside holes, the answer is `None`.
pub trait AttitudeSource: Send + Sync {
    /// Attitude at a time, s: `v_tracker = q * v_inertial`.
    fn attitude(&self, t_s: f64) -> Option<UnitQuaternion<f64>>;

    /// Rate at a time, s: of the tracker relative to inertial, tracker axes, rad/s, so that
    /// `dv/dt = -omega x v` for a fixed star.
    fn rate_rad_s(&self, t_s: f64) -> Option<Vector3<f64>>;

    /// First and last time with an attitude, s.
    fn span_s(&self) -> [f64; 2];

    /// [`attitude`](Self::attitude) for times that follow one another closely: `hint` is where the last
    /// one was found, and any value is right. The same answer, without a search.
    fn attitude_near(&self, t_s: f64, hint: &mut usize) -> Option<UnitQuaternion<f64>> {
        let _ = hint;
        self.attitude(t_s)
    }

    /// How it turns between `t_s` and `d_s` later, `q(t + d) q(t)^-1`, with a hint as for
    /// [`attitude_near`](Self::attitude_near). A source that knows the motion around each of many
    /// instants by itself tells what it knows around `t_s`.
    fn turn(&self, t_s: f64, d_s: f64, hint: &mut usize) -> Option<UnitQuaternion<f64>> {
        let now = self.attitude_near(t_s, hint)?;
        Some(self.attitude_near(t_s + d_s, hint)? * now.inverse())
    }

    /// [`attitude`](Self::attitude) for many times, all four components NaN where it gives `None`.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn attitude_into(&self, t_s: &[f64], out: QuaternionsMut<'_>) {
        fill_attitudes(t_s, out, |t| self.attitude(t));
    }
}

impl<S: AttitudeSource + ?Sized> AttitudeSource for &S {
    fn attitude(&self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        (**self).attitude(t_s)
    }
    fn rate_rad_s(&self, t_s: f64) -> Option<Vector3<f64>> {
        (**self).rate_rad_s(t_s)
    }
    fn span_s(&self) -> [f64; 2] {
        (**self).span_s()
    }
    fn attitude_near(&self, t_s: f64, hint: &mut usize) -> Option<UnitQuaternion<f64>> {
        (**self).attitude_near(t_s, hint)
    }
    fn turn(&self, t_s: f64, d_s: f64, hint: &mut usize) -> Option<UnitQuaternion<f64>> {
        (**self).turn(t_s, d_s, hint)
    }
    fn attitude_into(&self, t_s: &[f64], out: QuaternionsMut<'_>) {
        (**self).attitude_into(t_s, out);
    }
}

impl<S: AttitudeSource + ?Sized> AttitudeSource for Box<S> {
    fn attitude(&self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        (**self).attitude(t_s)
    }
    fn rate_rad_s(&self, t_s: f64) -> Option<Vector3<f64>> {
        (**self).rate_rad_s(t_s)
    }
    fn span_s(&self) -> [f64; 2] {
        (**self).span_s()
    }
    fn attitude_near(&self, t_s: f64, hint: &mut usize) -> Option<UnitQuaternion<f64>> {
        (**self).attitude_near(t_s, hint)
    }
    fn turn(&self, t_s: f64, d_s: f64, hint: &mut usize) -> Option<UnitQuaternion<f64>> {
        (**self).turn(t_s, d_s, hint)
    }
    fn attitude_into(&self, t_s: &[f64], out: QuaternionsMut<'_>) {
        (**self).attitude_into(t_s, out);
    }
}

fn fill_attitudes(
    t_s: &[f64],
    out: QuaternionsMut<'_>,
    mut attitude: impl FnMut(f64) -> Option<UnitQuaternion<f64>>,
) {
    assert_eq!(t_s.len(), out.len(), "one attitude for each time");
    for (i, &t) in t_s.iter().enumerate() {
        let [x, y, z, w] = attitude(t).map_or([f64::NAN; 4], |q| [q.i, q.j, q.k, q.w]);
        out.x[i] = x;
        out.y[i] = y;
        out.z[i] = z;
        out.w[i] = w;
    }
}

/// Small or large rotation from `reference` to `meas`: `log(meas * reference^-1)`, tracker axes,
/// rad, at most pi long. The signs of the quaternions do not matter.
///
/// Accurate to the rounding of the quaternions themselves (a few 1e-16 rad) at every angle: the
/// half angle is `atan2` of vector and scalar part, which an arc cosine would lose near zero and
/// an arc sine near 180 deg.
///
/// ```
/// use focal_plane::{rotation_from_vector, rotation_vector};
/// use nalgebra::{UnitQuaternion, Vector3};
/// let reference = rotation_from_vector(&Vector3::new(0.3, -0.2, 0.9));
/// let theta = Vector3::new(1e-9, -2e-9, 3e-9);
/// let meas = rotation_from_vector(&theta) * reference;
/// assert!((rotation_vector(&meas, &reference) - theta).norm() < 1e-15);
/// ```
#[must_use]
pub fn rotation_vector(
    meas: &UnitQuaternion<f64>,
    reference: &UnitQuaternion<f64>,
) -> Vector3<f64> {
    let q = meas.quaternion() * reference.quaternion().conjugate();
    // q and -q are one rotation: take the one with the smaller angle
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let (v, w) = (q.imag() * sign, q.w * sign);
    let n2 = v.norm_squared();
    let scale = if n2 < SERIES_BELOW {
        let t = n2 / (w * w);
        let bent = 1.0 / 5.0 - t * (1.0 / 7.0 - t * (1.0 / 9.0 - t / 11.0));
        2.0 / w * (1.0 - t * (1.0 / 3.0 - t * bent))
    } else {
        let n = n2.sqrt();
        2.0 * n.atan2(w) / n
    };
    v * scale
}

/// Square of the half angle below which the series of sine, cosine and arc tangent are used: the steps between
/// samples. Their first left-out terms, `h2^4/9!`, `h2^5/10!` and `h2^6/13`, are below 1e-16.
const SERIES_BELOW: f64 = 0.002;

/// The rotation `exp(theta)`, theta in rad: `v' = v + theta x v + ...`. Inverse of
/// [`rotation_vector`]; exact to rounding for the smallest angles.
#[must_use]
pub fn rotation_from_vector(theta: &Vector3<f64>) -> UnitQuaternion<f64> {
    let h2 = 0.25 * theta.norm_squared();
    let (sinc, cos) = if h2 < SERIES_BELOW {
        (
            1.0 - h2 * (1.0 / 6.0 - h2 * (1.0 / 120.0 - h2 / 5040.0)),
            1.0 - h2 * (0.5 - h2 * (1.0 / 24.0 - h2 * (1.0 / 720.0 - h2 / 40_320.0))),
        )
    } else {
        let half = h2.sqrt();
        (half.sin() / half, half.cos())
    };
    let v = theta * (0.5 * sinc);
    UnitQuaternion::new_unchecked(Quaternion::new(cos, v.x, v.y, v.z))
}
