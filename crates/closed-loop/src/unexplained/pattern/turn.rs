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
use crate::star::frame_rotation::{Turns, rotation_row};

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
    let turns = Turns::of(data, residual, weight);
    let mut out = residual.map(<[f64]>::to_vec);
    for (k, turn) in turns.frames.iter().enumerate() {
        let Some(turn) = turn else { continue };
        let of_reference = turns.reference;
        let share = |a: usize| of_reference[a] / (of_reference[a] + turns.noise * turn.variance[a]);
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
