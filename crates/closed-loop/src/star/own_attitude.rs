//! The tracker's own attitude beside its stars.
//!
//! ```text
//! error = log(q_meas q_ref^-1) - the rotation that the modelled shifts of the frame's stars amount to
//! ```
//!
//! Source: \[M23\] Fig. 4 for what a residual is.

use std::collections::BTreeMap;

use block_regression::Folds;
use focal_plane::rotation_vector;
use rayon::prelude::*;
use spectra::standing_out;
use telemetry::AttitudeResiduals;

use crate::evidence::Residuals;
use crate::situation::Situation;
use crate::star::data::StarData;
use crate::star::frame_rotation::rotations_of;
use crate::star::settling::Settled;

/// The tracker's own attitude beside the stars: its error against the reference,
/// less the rotation that the modelled star shifts amount to.
pub(crate) fn residuals(
    situation: &Situation<'_>,
    data: &StarData,
    folds: &Folds,
    settled: &Settled,
    before: &Residuals,
    after: &Residuals,
) -> Option<AttitudeResiduals> {
    let table = situation.bundle.attitude.as_ref()?;
    if data.free_attitude {
        return None;
    }
    let scale = data.camera.arcsec_per_px();
    let declared = settled.phase_error.as_ref().unwrap_or(&data.phase_error);
    let fold = folds.column();
    let own: BTreeMap<u64, usize> = table
        .t_s
        .iter()
        .enumerate()
        .map(|(k, t)| (t.to_bits(), k))
        .collect();
    let of_frame = |k: usize| {
        let at = *own.get(&data.frames.t_s[k].to_bits())?;
        // the shifts hold the whole misalignment, and so does the error against the bare reference
        let theta = rotation_vector(&table.q[at], &data.attitude[k]) * focal_plane::ARCSEC_PER_RAD
            + data.misalignment;
        let shifts = |row: usize| {
            let bare = data.bare_projection(k, row);
            let of = |residual: &Residuals, phase_error: &[Vec<f64>; 2]| {
                [0, 1].map(|a| {
                    let by_effects = data.projected[a][row] - bare[a];
                    residual.modelled[a][row] + (phase_error[a][row] + by_effects) * scale[a]
                })
            };
            [of(before, declared), of(after, &data.phase_error)]
        };
        let [b, a] = rotations_of(data, k, shifts)?;
        Some((k, theta - b, theta - a))
    };
    let frames = (0..data.frames.frames()).into_par_iter();
    let known: Vec<_> = frames.filter_map(of_frame).collect();
    let mut out = AttitudeResiduals::default();
    for (k, before, after) in known {
        out.t_s.push(data.frames.t_s[k]);
        for axis in 0..3 {
            out.before_arcsec[axis].push(before[axis]);
            out.after_arcsec[axis].push(after[axis]);
        }
        out.fold.push(fold[k]);
    }
    out.outlier = vec![false; out.t_s.len()];
    for before in &out.before_arcsec {
        standing_out::mark(before, &mut out.outlier);
    }
    (!out.t_s.is_empty()).then_some(out)
}
