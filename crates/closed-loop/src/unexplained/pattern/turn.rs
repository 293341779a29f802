//! Residuals less what their frame's rotation is known to be.
//!
//! A reference with noise of its own turns all stars of a frame alike. Taking the whole
//! rotation off costs a wave as much as the rotation takes of its stars, a third where a few
//! bright ones hold most of the information; leaving it in costs what the reference does.
//! Of stars with noise s/w and a rotation of variance S,
//!
//! ```text
//! V^-1 r ~ w^2 (r - A K theta)      K = S / (S + s^2 C),   theta = C sum w^2 A' r,   C = (sum w^2 A' A)^-1
//! S = sum over frames (theta^2 / C - s^2) / sum 1 / C      axis by axis, at least 0
//! ```
//!
//! are the scores' residuals, whatever the wave.
//!
//! Source: Henderson 1975 (best linear unbiased prediction), per axis.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::star::data::StarData;
use crate::star::frame_rotation::rotation_row;

/// Of a frame: its rotation, the variance of it where stars of weight 1 have 1, the squares
/// that it leaves, and their degrees of freedom.
struct Turn {
    theta: Vector3<f64>,
    variance: Vector3<f64>,
    squares: f64,
    freedom: f64,
}

/// What is taken off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rotation {
    /// As much as a reference with white noise turns a frame by.
    Known,
    /// All that the stars of a frame share.
    Whole,
}

/// See the module.
pub(crate) fn less_rotation(
    data: &StarData,
    residual: [&[f64]; 2],
    weight: &[f64],
    rotation: Rotation,
) -> [Vec<f64>; 2] {
    let turns: Vec<Option<Turn>> = (0..data.frames.frames())
        .into_par_iter()
        .map(|k| turn(data, k, residual, weight))
        .collect();
    let known = || turns.iter().flatten();
    let freedom: f64 = known().map(|t| t.freedom).sum();
    let noise = known().map(|t| t.squares).sum::<f64>() / freedom.max(1.0);
    let of_reference: [f64; 3] = std::array::from_fn(|a| {
        let beyond: f64 = known()
            .map(|t| t.theta[a].powi(2) / t.variance[a] - noise)
            .sum();
        let information: f64 = known().map(|t| t.variance[a].recip()).sum();
        (beyond / information).max(0.0)
    });
    let mut out = residual.map(<[f64]>::to_vec);
    for (k, turn) in turns.iter().enumerate() {
        let Some(turn) = turn else { continue };
        let share = |a: usize| of_reference[a] / (of_reference[a] + noise * turn.variance[a]);
        let theta = Vector3::from_fn(|a, _| {
            let share = match rotation {
                Rotation::Known => share(a),
                Rotation::Whole => 1.0,
            };
            turn.theta[a] * if share.is_finite() { share } else { 0.0 }
        });
        for row in data.frames.rows_of(k) {
            for (axis, a) in rotation_row(data, row).into_iter().enumerate() {
                out[axis][row] -= Vector3::from(a).dot(&theta);
            }
        }
    }
    out
}

fn turn(data: &StarData, frame: usize, residual: [&[f64]; 2], weight: &[f64]) -> Option<Turn> {
    let counts = |r: &usize| !data.outlier[*r] && residual.iter().all(|a| a[*r].is_finite());
    let rows: Vec<usize> = data.frames.rows_of(frame).filter(counts).collect();
    let (mut normal, mut moment) = (Matrix3::zeros(), Vector3::zeros());
    let mut whole = 0.0;
    for &r in &rows {
        let w = weight[r] * weight[r];
        for (axis, a) in rotation_row(data, r).map(Vector3::from).iter().enumerate() {
            normal += a * a.transpose() * w;
            moment += a * (w * residual[axis][r]);
            whole += w * residual[axis][r].powi(2);
        }
    }
    let covariance = normal.try_inverse()?;
    let theta = covariance * moment;
    (rows.len() > 1).then(|| Turn {
        theta,
        variance: covariance.diagonal(),
        squares: whole - theta.dot(&moment),
        freedom: 2.0 * rows.len() as f64 - 3.0,
    })
}
