//! Covariance of the attitude error of a QUEST solution.
//!
//! ```text
//! P = s^2 [I - s^2 sum s_i^-2 w_i w_i^T]^-1,   s^-2 = sum s_i^-2
//! ```
//!
//! in rad^2, for the small rotation theta in tracker axes with `v_meas = v + theta x v`. `s_i` is
//! the error of star i in rad, per axis across the line of sight, measurement and catalogue together.
//!
//! Source: \[M23\] Eq. 14, with its sum normalised (erratum E4): the printed form lacks the `s^2`
//! before the sum, and is negative for any real tracker.

use nalgebra::{Matrix3, Vector3};

use crate::error::QuestError;
use crate::gap_limits::MIN_GAP;
use crate::polish::least_eigenvalue;
use crate::unit_vectors::{check, inverse_length};

/// Covariance of the attitude error, rad^2, tracker axes; `sigma_rad[i]` per axis of star i.
///
/// # Errors
///
/// As [`quest`](crate::quest) for `measured`, with `sigma_rad` in place of weights.
///
/// ```
/// use nalgebra::Vector3;
/// // two stars at right angles: each pins two axes, their common normal both of them
/// let p = quest::covariance(&[Vector3::x(), Vector3::y()], &[1e-5, 1e-5])?;
/// assert!((p[(2, 2)] / 0.5e-10 - 1.0).abs() < 1e-14);
/// assert!((p[(0, 0)] / 1e-10 - 1.0).abs() < 1e-14);
/// # Ok::<(), quest::QuestError>(())
/// ```
pub fn covariance(
    measured: &[Vector3<f64>],
    sigma_rad: &[f64],
) -> Result<Matrix3<f64>, QuestError> {
    let weights = weights_of(measured, sigma_rad)?;
    check("measured", measured)?;
    let total: f64 = weights.iter().sum();
    let information = information(measured, &weights, total);
    spread_checked(&information)?;
    of_information(&information, total).ok_or(QuestError::Parallel {
        set: "measured",
        spread_rad: 0.0,
    })
}

/// \[M23\] Eq. 14 as printed, `s^2 [I - sum s_i^-2 w_i w_i^T]^-1`: not a covariance (erratum E4), kept
/// to compare with numbers made by it.
///
/// # Errors
///
/// As [`covariance`], except that parallel vectors pass.
pub fn covariance_as_printed(
    measured: &[Vector3<f64>],
    sigma_rad: &[f64],
) -> Result<Matrix3<f64>, QuestError> {
    let weights = weights_of(measured, sigma_rad)?;
    check("measured", measured)?;
    let total: f64 = weights.iter().sum();
    let mut m = Matrix3::identity();
    for (w, a) in measured.iter().zip(&weights) {
        m -= w * w.transpose() * *a;
    }
    Ok(m.try_inverse().unwrap_or_else(Matrix3::zeros) / total)
}

fn weights_of(measured: &[Vector3<f64>], sigma_rad: &[f64]) -> Result<Vec<f64>, QuestError> {
    if measured.len() != sigma_rad.len() {
        return Err(QuestError::LengthMismatch {
            measured: measured.len(),
            reference: measured.len(),
            weights: sigma_rad.len(),
        });
    }
    if measured.len() < 2 {
        return Err(QuestError::TooFewStars {
            got: measured.len(),
        });
    }
    let weight = |(index, &sigma): (usize, &f64)| {
        let weight = 1.0 / (sigma * sigma);
        if sigma > 0.0 && weight.is_normal() {
            Ok(weight)
        } else {
            Err(QuestError::NotPositive {
                name: "sigma_rad",
                index,
                value: sigma,
            })
        }
    };
    sigma_rad.iter().enumerate().map(weight).collect()
}

/// `sum a_i (I - w w^T) / sum a_i`, summed as `y^2 + z^2` and the like: near the boresight `1 - z^2` would
/// cancel, and that is the weak axis.
pub(crate) fn information(measured: &[Vector3<f64>], weights: &[f64], total: f64) -> [f64; 6] {
    let unit = 1.0 / total;
    let mut m = [0.0; 6];
    for (w, &a) in measured.iter().zip(weights) {
        let scale = inverse_length(w);
        let a = a * unit * scale * scale;
        m[0] += a * (w.y * w.y + w.z * w.z);
        m[1] += a * (w.x * w.x + w.z * w.z);
        m[2] += a * (w.x * w.x + w.y * w.y);
        m[3] -= a * w.x * w.y;
        m[4] -= a * w.x * w.z;
        m[5] -= a * w.y * w.z;
    }
    m
}

/// Error if all vectors lie on one line: the mean square distance from it is the least eigenvalue
/// of the information at unit weight, and half the gap of exact data.
fn spread_checked(information: &[f64; 6]) -> Result<(), QuestError> {
    let spread = least_eigenvalue(*information);
    if 2.0 * spread >= MIN_GAP {
        return Ok(());
    }
    Err(QuestError::Parallel {
        set: "measured",
        spread_rad: spread.max(0.0).sqrt(),
    })
}

/// Inverse of the information, if it is positive definite.
pub(crate) fn of_information(m: &[f64; 6], total: f64) -> Option<Matrix3<f64>> {
    let [xx, yy, zz, xy, xz, yz] = *m;
    let (cxx, cyy, czz) = (yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy);
    let (cxy, cxz, cyz) = (xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz);
    let det = xx * cxx + xy * cxy + xz * cxz;
    let full = Matrix3::new(cxx, cxy, cxz, cxy, cyy, cyz, cxz, cyz, czz) / det / total;
    (det > 0.0 && xx > 0.0 && czz > 0.0).then_some(full)
}
