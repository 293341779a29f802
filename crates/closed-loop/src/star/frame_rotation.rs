//! The rotation that the stars of a frame agree on.
//!
//! ```text
//! theta = (A^T A)^-1 A^T r        A: columns of a small rotation, arcsec per arcsec
//! ```
//!
//! Source: linearised least squares of the projection ([M23] Fig. 4).

use focal_plane::{ARCSEC_PER_RAD, Pixel};
use nalgebra::{Matrix3, Vector3};

use crate::star::data::StarData;

/// Rotation columns of one row, arcsec per arcsec.
pub(crate) fn rotation_row(data: &StarData, row: usize) -> [[f64; 3]; 2] {
    let at = Pixel {
        x: data.modelled[0][row],
        y: data.modelled[1][row],
    };
    let scale = data.camera.arcsec_per_px();
    let mut jacobian = data.camera.rotation_jacobian(at);
    for axis in 0..2 {
        for k in 0..3 {
            jacobian[axis][k] *= scale[axis] / ARCSEC_PER_RAD;
        }
    }
    jacobian
}

/// Inverse normal matrix of a frame's rotation over the rows that count.
pub(crate) fn rotation_inverse(data: &StarData, frame: usize) -> Option<Matrix3<f64>> {
    let mut normal = Matrix3::zeros();
    let mut used = 0;
    for row in data.frames.rows_of(frame).filter(|&r| !data.outlier[r]) {
        for axis in rotation_row(data, row) {
            let a = Vector3::from(axis);
            normal += a * a.transpose();
        }
        used += 1;
    }
    // Two stars give four numbers for three angles; one gives none to spare.
    if used < 2 { None } else { normal.try_inverse() }
}

/// The rotation, arcsec, that a frame's star shifts amount to, by least squares.
pub(crate) fn rotation_of(
    data: &StarData,
    frame: usize,
    shift: &[Vec<f64>],
) -> Option<Vector3<f64>> {
    let inverse = rotation_inverse(data, frame)?;
    let mut moment = Vector3::zeros();
    for row in data.frames.rows_of(frame).filter(|&r| !data.outlier[r]) {
        let jacobian = rotation_row(data, row);
        for axis in 0..2 {
            moment += Vector3::from(jacobian[axis]) * shift[axis][row];
        }
    }
    Some(inverse * moment)
}
