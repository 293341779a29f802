//! Residuals before and after, row by row, and the dark map.
//!
//! Not physics: the columns of tables.

use telemetry::{AttitudeResiduals, DarkMap, StarResiduals};

use crate::evidence::Residuals;
use crate::residual_size;
use crate::star::finish::Finish;
use crate::star::own_attitude;

/// The tracker's own attitude beside its stars.
pub(super) fn attitude(
    f: &Finish<'_>,
    before: &Residuals,
    after: &Residuals,
    nothing_added: bool,
) -> Option<AttitudeResiduals> {
    let mut attitude =
        own_attitude::residuals(f.situation, f.data, f.folds, f.settled, before, after);
    if let Some(attitude) = attitude.as_mut().filter(|_| nothing_added) {
        attitude.after_arcsec.clone_from(&attitude.before_arcsec);
    }
    attitude
}

/// Its rms before and after, arcsec.
pub(super) fn attitude_rms(attitude: Option<&AttitudeResiduals>) -> [Option<[f64; 3]>; 2] {
    let rms = |series: &[Vec<f64>; 3], outlier: &[bool]| {
        std::array::from_fn(|a| residual_size::rms(&series[a], outlier).unwrap_or(f64::NAN))
    };
    [
        attitude.map(|a| rms(&a.before_arcsec, &a.outlier)),
        attitude.map(|a| rms(&a.after_arcsec, &a.outlier)),
    ]
}

/// The residuals of the stars.
pub(super) fn stars(f: &Finish<'_>, before: &Residuals, after: &Residuals) -> StarResiduals {
    let axes = |residual: &Residuals| [0, 1].map(|a| residual.axes[a].clone());
    let fold_of_frame = f.folds.column();
    let frames = &f.data.frames;
    let fold = (0..frames.frames())
        .flat_map(|k| std::iter::repeat_n(fold_of_frame[k], frames.rows_of(k).len()))
        .collect();
    StarResiduals {
        t_s: f.data.t_s.clone(),
        slot: frames.slot.clone(),
        star_id: frames.star_id.clone(),
        x_px: frames.x_px.clone(),
        y_px: frames.y_px.clone(),
        before_arcsec: axes(before),
        after_arcsec: axes(after),
        fold,
        outlier: f.data.outlier.clone(),
    }
}

/// The dark map, where it was adopted.
pub(super) fn dark_map(f: &Finish<'_>) -> Option<DarkMap> {
    let adopted = f.image.is_some_and(|level| level.dark_map.stands);
    let pixels = &f.formed.filter(|_| adopted)?.map.pixels;
    Some(DarkMap {
        x_px: pixels.iter().map(|p| p.x_px).collect(),
        y_px: pixels.iter().map(|p| p.y_px).collect(),
        dn: pixels.iter().map(|p| p.dn).collect(),
        sigma_dn: pixels.iter().map(|p| p.sigma_dn).collect(),
    })
}
