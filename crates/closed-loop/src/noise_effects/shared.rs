//! The noise that all stars of a frame share, beside a reference: what it follows.
//!
//! ```text
//! theta = C sum w^2 A' r,   C = (sum w^2 A' A)^-1     w^-2 = declared variance, what is claimed of it, own levels
//! ```
//!
//! C times the noise of the stars is known of its variance ([`super::turning`]); rates and accelerations are the rotations
//! that the stars' motions amount to.
//!
//! Source: as [`crate::star::frame_rotation`].

use block_regression::Folds;
use nalgebra::Vector3;
use rayon::prelude::*;
use spectra::robust::median_step;

use super::squares::Judged;
use super::turning::{Motion, Turning, Varies};
use crate::situation::Situation;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use crate::star::frame_rotation::{Turns, rotations_of};

/// The chances of what the noise that frames share may follow, not yet paid for; `residual` per row and axis, arcsec,
/// whose stars have this `variance`, arcsec^2.
pub(super) fn shared_noise(
    situation: &Situation<'_>,
    level: &StarEvidence<'_>,
    residual: [&[f64]; 2],
    variance: &[f64],
    folds: &Folds,
) -> Vec<(String, Judged)> {
    let data = level.data;
    if data.free_attitude {
        return Vec::new();
    }
    let weight: Vec<f64> = variance.iter().map(|v| v.sqrt().recip()).collect();
    let turns = Turns::of(data, residual, &weight);
    let of_axis = |of: &dyn Fn(&Vector3<f64>, &Vector3<f64>) -> f64| {
        let each = turns.frames.iter().map(|turn| {
            turn.as_ref()
                .map_or(f64::NAN, |t| of(&t.theta, &t.variance))
        });
        each.collect::<Vec<f64>>()
    };
    let turning = Turning {
        t_s: &data.frames.t_s,
        theta: std::array::from_fn(|a| of_axis(&|theta, _| theta[a])),
        known: std::array::from_fn(|a| of_axis(&|_, variance| turns.noise * variance[a])),
        folds,
    };
    turning.judged(&variables(situation, level))
}

/// What it may follow, frame by frame.
fn variables(situation: &Situation<'_>, level: &StarEvidence<'_>) -> Vec<(String, Varies)> {
    let data = level.data;
    let mut out = vec![("time".to_owned(), Varies::Time)];
    if level.resolved {
        // rates that come along may be made of the same attitudes
        let path = situation.reference.as_ref();
        let step_s = path.and_then(|path| median_step(path.t_s()));
        let motions = about_axes(data, [&data.velocity, &data.acceleration]);
        let kinds = [("rate", 1), ("acceleration", 2)];
        for ((name, order), axes) in kinds.into_iter().zip(motions) {
            let of_attitudes = step_s.map_or(0.0, |step_s| Motion::error(order, step_s));
            let motion = Motion { axes, of_attitudes };
            out.push((name.to_owned(), Varies::Motion(motion)));
        }
    }
    out.extend(Varies::channels(&situation.channels, &data.frames.t_s));
    out
}

/// The rotations that motions of the stars, px/s and px/s^2, amount to frame by frame, arcsec/s and arcsec/s^2; NaN where
/// too few tell them.
fn about_axes(data: &StarData, motions: [&[Vec<f64>; 2]; 2]) -> [[Vec<f64>; 3]; 2] {
    let scale = data.camera.arcsec_per_px();
    let shifts = |row: usize| motions.map(|motion| [0, 1].map(|a| motion[a][row] * scale[a]));
    let unknown = [Vector3::repeat(f64::NAN); 2];
    let each: Vec<[Vector3<f64>; 2]> = (0..data.frames.frames())
        .into_par_iter()
        .map(|k| rotations_of(data, k, shifts).unwrap_or(unknown))
        .collect();
    [0, 1].map(|m| std::array::from_fn(|a| each.iter().map(|turns| turns[m][a]).collect()))
}
