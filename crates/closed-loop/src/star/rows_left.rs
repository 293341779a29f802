//! Whether any rows are left once the declared effects have put the stars somewhere, and outliers are out.
//!
//! Not physics: a run on no rows follows any model.

use effects::Effect;
use spectra::robust;
use std::sync::Arc;

use crate::error::CloseError;
use crate::star::data::StarData;

/// Refuses rows of which fewer than `least_frames` frames have any left, and says where the others went.
pub(super) fn check(
    data: &StarData,
    effects: &[Arc<dyn Effect>],
    least_frames: usize,
) -> Result<(), CloseError> {
    let has_rows = |frame: &usize| data.frames.rows_of(*frame).any(|r| !data.outlier[r]);
    let frames = (0..data.frames.frames()).filter(has_rows).count();
    if frames >= least_frames {
        return Ok(());
    }
    let rows = data.outlier.len() + data.outside_reference - data.unplaced;
    let outliers = data.outlier.len() - data.counted() - data.unplaced - data.unformed;
    let mut parts = Vec::new();
    if data.outside_reference > 0 {
        parts.push(format!(
            "{} have no place: the motion is not known there, or not during their exposure, or their stars are behind the camera",
            data.outside_reference
        ));
    }
    if outliers > 0 {
        parts.push(format!("{outliers} stand out from all others"));
    }
    if !effects.is_empty() {
        let ids: Vec<&str> = effects.iter().map(|e| e.id()).collect();
        let declared = ids.join(", ");
        parts.push(match moved_px(data) {
            Some(by) => {
                format!("what the model declares ({declared}) moves the stars by {by:.3e} px")
            }
            None => format!("what the model declares ({declared}) leaves no star in sight"),
        });
    }
    Err(CloseError::NoRowsLeft {
        rows,
        frames,
        need: least_frames,
        where_to: parts.join("; "),
    })
}

/// Median distance, px, to which the declared effects move the stars that they leave before the camera.
fn moved_px(data: &StarData) -> Option<f64> {
    let [x, y] = &data.projected;
    let bare = data.bare_projections();
    let each = bare.iter().zip(x.iter().zip(y));
    let mut moved = each
        .map(|(at, (x, y))| (x - at[0]).hypot(y - at[1]))
        .collect();
    robust::median(&mut moved)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::star::harness::at_rest;

    #[test]
    fn rows_that_are_all_set_aside_are_refused_in_words() {
        let mut data = at_rest((0..40).map(f64::from).collect());
        assert!(check(&data, &[], 2).is_ok());
        data.outlier.fill(true);
        let refused = check(&data, &[], 2).unwrap_err().to_string();
        assert!(
            refused.contains("table stars") && refused.contains("240 stand out"),
            "{refused}"
        );
        data.unplaced = 240;
        data.outside_reference = 240;
        let refused = check(&data, &[], 2).unwrap_err().to_string();
        assert!(
            refused.contains("240 have no place") && !refused.contains("stand out"),
            "{refused}"
        );
    }
}
