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

/// Residuals of both axes over all rows, arcsec, less rotations of their frames.
#[derive(Clone, Debug)]
pub(crate) struct Turned {
    /// Less as much as a reference with white noise turns a frame by.
    pub(crate) known: [Vec<f64>; 2],
    /// Less all that the stars of a frame share.
    pub(crate) whole: [Vec<f64>; 2],
}

impl Turned {
    /// See the module; rows count by their `weight`.
    pub(crate) fn of(data: &StarData, residual: [&[f64]; 2], weight: &[f64]) -> Self {
        let turns = Turns::of(data, residual, weight);
        let start = || residual.map(<[f64]>::to_vec);
        let (mut known, mut whole) = (start(), start());
        for (k, turn) in turns.frames.iter().enumerate() {
            let Some(turn) = turn else { continue };
            let of_reference = turns.reference;
            let drawn = Vector3::from_fn(|a, _| {
                let share = of_reference[a] / (of_reference[a] + turns.noise * turn.variance[a]);
                turn.theta[a] * if share.is_finite() { share } else { 0.0 }
            });
            for row in data.frames.rows_of(k) {
                for (axis, a) in rotation_row(data, row).into_iter().enumerate() {
                    let a = Vector3::from(a);
                    known[axis][row] -= a.dot(&drawn);
                    whole[axis][row] -= a.dot(&turn.theta);
                }
            }
        }
        Self { known, whole }
    }
}
