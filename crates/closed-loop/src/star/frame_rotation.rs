//! The rotation that the stars of a frame agree on.
//!
//! ```text
//! theta = (A^T A)^-1 A^T r        A: columns of a small rotation, arcsec per arcsec
//! ```
//!
//! Of stars with noise s/w, in all frames, also what of these rotations is the reference's:
//!
//! ```text
//! theta = C sum w^2 A' r,   C = (sum w^2 A' A)^-1
//! S     = sum over frames (theta^2 / C - s^2) / sum 1 / C      axis by axis, at least 0
//! ```
//!
//! Source: linearised least squares of the projection ([M23] Fig. 4); moments of a random effect.

use focal_plane::{ARCSEC_PER_RAD, Pixel};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

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
    rotations_of(data, frame, |row| [[0, 1].map(|axis| shift[axis][row])]).map(|[theta]| theta)
}

/// The rotations that several shifts of the same stars amount to.
pub(crate) fn rotations_of<const N: usize>(
    data: &StarData,
    frame: usize,
    shifts: impl Fn(usize) -> [[f64; 2]; N],
) -> Option<[Vector3<f64>; N]> {
    let inverse = rotation_inverse(data, frame)?;
    let mut moments = [Vector3::zeros(); N];
    for row in data.frames.rows_of(frame).filter(|&r| !data.outlier[r]) {
        let jacobian = rotation_row(data, row).map(Vector3::from);
        for (moment, shift) in moments.iter_mut().zip(shifts(row)) {
            for (turns, shift) in jacobian.iter().zip(shift) {
                *moment += turns * shift;
            }
        }
    }
    Some(moments.map(|moment| inverse * moment))
}

/// What the stars of one frame say of its rotation.
pub(crate) struct Turn {
    /// Sums of w^2 A' A and of w^2 A' r over the rows that count.
    pub(crate) normal: Matrix3<f64>,
    pub(crate) moment: Vector3<f64>,
    /// The rotation, and its variances where a row of weight 1 has variance 1.
    pub(crate) theta: Vector3<f64>,
    pub(crate) variance: Vector3<f64>,
    /// Weighted squares that it leaves, and their degrees of freedom.
    squares: f64,
    pub(crate) freedom: f64,
}

/// What the stars of all frames say.
pub(crate) struct Turns {
    /// `None` for a frame whose rotation they do not tell.
    pub(crate) frames: Vec<Option<Turn>>,
    /// Variance of a row of weight 1, arcsec^2.
    pub(crate) noise: f64,
    /// Variance of the rotations beyond that of the stars: the reference's, arcsec^2.
    pub(crate) reference: [f64; 3],
}

impl Turns {
    /// Of `residual` by rows of `weight`; rows that are outliers, not finite or of weight 0 do not count.
    pub(crate) fn of(data: &StarData, residual: [&[f64]; 2], weight: &[f64]) -> Self {
        let frames: Vec<Option<Turn>> = (0..data.frames.frames())
            .into_par_iter()
            .map(|k| Turn::of(data, k, residual, weight))
            .collect();
        let known = || frames.iter().flatten();
        let freedom: f64 = known().map(|t| t.freedom).sum();
        let noise = known().map(|t| t.squares).sum::<f64>() / freedom.max(1.0);
        let reference: [f64; 3] = std::array::from_fn(|a| {
            let beyond: f64 = known()
                .map(|t| t.theta[a].powi(2) / t.variance[a] - noise)
                .sum();
            (beyond / information(&frames, a)).max(0.0)
        });
        Self {
            frames,
            noise,
            reference,
        }
    }

    /// Sigma of the reference's variance about an axis where all there is is the stars' own noise, arcsec^2.
    pub(crate) fn chance(&self, axis: usize) -> f64 {
        let known = self.frames.iter().flatten().count();
        self.noise * (2.0 * known as f64).sqrt() / information(&self.frames, axis)
    }
}

/// What the stars of all frames say of an axis where a row of weight 1 has variance 1.
fn information(frames: &[Option<Turn>], axis: usize) -> f64 {
    let known = frames.iter().flatten();
    known.map(|t| t.variance[axis].recip()).sum()
}

/// Whether a row says anything of its frame's rotation.
pub(crate) fn counts(data: &StarData, residual: [&[f64]; 2], row: usize) -> bool {
    !data.outlier[row] && residual.iter().all(|axis| axis[row].is_finite())
}

impl Turn {
    /// Of one frame, as [`Turns::of`] of all.
    pub(crate) fn of(
        data: &StarData,
        frame: usize,
        residual: [&[f64]; 2],
        weight: &[f64],
    ) -> Option<Self> {
        let rows = data.frames.rows_of(frame);
        let (mut normal, mut moment) = (Matrix3::zeros(), Vector3::zeros());
        let (mut whole, mut count) = (0.0, 0_u32);
        for r in rows.filter(|&r| counts(data, residual, r) && weight[r] > 0.0) {
            let w = weight[r] * weight[r];
            for (axis, a) in rotation_row(data, r).map(Vector3::from).iter().enumerate() {
                normal += a * a.transpose() * w;
                moment += a * (w * residual[axis][r]);
                whole += w * residual[axis][r].powi(2);
            }
            count += 1;
        }
        let covariance = normal.try_inverse()?;
        let theta = covariance * moment;
        (count > 1).then(|| Self {
            normal,
            moment,
            theta,
            variance: covariance.diagonal(),
            squares: whole - theta.dot(&moment),
            freedom: 2.0 * f64::from(count) - 3.0,
        })
    }
}
