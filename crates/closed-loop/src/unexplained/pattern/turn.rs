//! Residuals less what their frame's rotation is known to be.
//!
//! A reference with noise of its own turns all stars of a frame alike. Taking the whole
//! rotation off costs a wave as much as the rotation takes of its stars, a third where a few
//! bright ones hold most of the information; leaving it in costs what the reference does.
//! With the rotation theta of variance s^2 C as its stars have it, and S of the reference
//! ([`crate::star::frame_rotation`]),
//!
//! ```text
//! V^-1 r ~ w^2 (r - A K theta)      K = S / (S + s^2 C)
//! ```
//!
//! are the scores' residuals, whatever the wave.
//!
//! Source: Henderson 1975 (best linear unbiased prediction), per axis.

use nalgebra::Vector3;

use crate::star::data::StarData;
use crate::star::frame_rotation::{Turns, counts, rotation_row};

/// Residuals of both axes over all rows, arcsec, less rotations of their frames.
#[derive(Clone, Debug)]
pub(crate) struct Turned<'a> {
    data: &'a StarData,
    residual: [&'a [f64]; 2],
    /// Less as much as a reference with white noise turns a frame by.
    pub(crate) known: [Vec<f64>; 2],
    /// What the stars of a frame share, arcsec.
    shared: Vec<Vector3<f64>>,
}

impl<'a> Turned<'a> {
    /// See the module; rows count by their `weight`.
    pub(crate) fn of(data: &'a StarData, residual: [&'a [f64]; 2], weight: &[f64]) -> Self {
        let turns = Turns::of(data, residual, weight);
        let of_reference = turns.reference;
        let each = turns.frames.iter().map(|turn| {
            let Some(turn) = turn else {
                return (Vector3::zeros(), Vector3::zeros());
            };
            let drawn = Vector3::from_fn(|a, _| {
                let share = of_reference[a] / (of_reference[a] + turns.noise * turn.variance[a]);
                turn.theta[a] * if share.is_finite() { share } else { 0.0 }
            });
            (drawn, turn.theta)
        });
        let (drawn, shared): (Vec<_>, Vec<_>) = each.unzip();
        Self {
            data,
            residual,
            known: less(data, residual, &drawn),
            shared,
        }
    }

    /// The share of the residuals' squares that goes with what the reference is known to turn frames by.
    pub(crate) fn share(&self) -> f64 {
        let squares = |axes: [&[f64]; 2]| -> f64 {
            let rows = (0..self.data.outlier.len()).filter(|&r| counts(self.data, axes, r));
            rows.map(|r| axes[0][r].powi(2) + axes[1][r].powi(2)).sum()
        };
        1.0 - squares(self.known.each_ref().map(Vec::as_slice)) / squares(self.residual)
    }

    /// Less all that the stars of a frame share: formed when it is asked for.
    pub(crate) fn whole(&self) -> [Vec<f64>; 2] {
        less(self.data, self.residual, &self.shared)
    }
}

/// Residuals less what their frames are `turned` by, arcsec.
fn less(data: &StarData, residual: [&[f64]; 2], turned: &[Vector3<f64>]) -> [Vec<f64>; 2] {
    let mut left = residual.map(<[f64]>::to_vec);
    for (k, turned) in turned.iter().enumerate() {
        for row in data.frames.rows_of(k) {
            for (left, a) in left.iter_mut().zip(rotation_row(data, row)) {
                left[row] -= Vector3::from(a).dot(turned);
            }
        }
    }
    left
}
