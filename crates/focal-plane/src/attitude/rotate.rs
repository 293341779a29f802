//! Turning columns of vectors by one attitude, or each by its own.
//!
//! ```text
//! v' = v + 2 w (q x v) + 2 q x (q x v)          q = (x, y, z), unit
//! ```
//!
//! Source: Hamilton product `q v q^-1` written out; convention `v_tracker = q v_inertial`.

use nalgebra::UnitQuaternion;

use crate::{Quaternions, Vectors, VectorsMut};

/// Turns many vectors by one attitude: `out = q * v`.
///
/// # Panics
///
/// If the slices differ in length.
pub fn rotate_into(q: &UnitQuaternion<f64>, v: Vectors<'_>, out: VectorsMut<'_>) {
    let n = v.len();
    assert_eq!(n, out.len(), "one result for each vector");
    let matrix = q.to_rotation_matrix();
    let m = matrix.matrix();
    let (m11, m12, m13) = (m.m11, m.m12, m.m13);
    let (m21, m22, m23) = (m.m21, m.m22, m.m23);
    let (m31, m32, m33) = (m.m31, m.m32, m.m33);
    let (vx, vy, vz) = (&v.x[..n], &v.y[..n], &v.z[..n]);
    let (out_x, out_y, out_z) = (&mut out.x[..n], &mut out.y[..n], &mut out.z[..n]);
    for i in 0..n {
        let (x, y, z) = (vx[i], vy[i], vz[i]);
        out_x[i] = m11 * x + m12 * y + m13 * z;
        out_y[i] = m21 * x + m22 * y + m23 * z;
        out_z[i] = m31 * x + m32 * y + m33 * z;
    }
}

/// Turns each vector by its own attitude: `out[i] = q[i] * v[i]`; NaN where the attitude is NaN.
///
/// # Panics
///
/// If the slices differ in length.
pub fn rotate_each_into(q: Quaternions<'_>, v: Vectors<'_>, out: VectorsMut<'_>) {
    let n = v.len();
    assert_eq!(n, q.len(), "one attitude for each vector");
    assert_eq!(n, out.len(), "one result for each vector");
    let (qx, qy, qz, qw) = (&q.x[..n], &q.y[..n], &q.z[..n], &q.w[..n]);
    let (vx, vy, vz) = (&v.x[..n], &v.y[..n], &v.z[..n]);
    let (out_x, out_y, out_z) = (&mut out.x[..n], &mut out.y[..n], &mut out.z[..n]);
    for i in 0..n {
        let (a, b, c, w) = (qx[i], qy[i], qz[i], qw[i]);
        let (x, y, z) = (vx[i], vy[i], vz[i]);
        let tx = 2.0 * (b * z - c * y);
        let ty = 2.0 * (c * x - a * z);
        let tz = 2.0 * (a * y - b * x);
        out_x[i] = x + w * tx + (b * tz - c * ty);
        out_y[i] = y + w * ty + (c * tx - a * tz);
        out_z[i] = z + w * tz + (a * ty - b * tx);
    }
}
