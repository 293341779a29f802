//! Which star rows have raw windows, and what became of both.
//!
//! A centroid of the table and one formed anew do not err alike: the one has what the detector did to it, and another
//! noise. So ways to form centroids are compared on the rows that have all of them, and where one is adopted the
//! others are left out, counted. Where none is, every row counts, as if there were no windows.
//!
//! Not physics: bookkeeping.

use focal_plane::StarFrames;
use star_images::Unusable;
use telemetry::WindowTable;
use telemetry::report::Windows;

use crate::error::CloseError;
use crate::image_level::ImageLevel;

/// Why the centroids of the table stay.
#[derive(Debug)]
pub(super) enum AsMeasured {
    /// None could be formed anew: in words.
    Unusable(String),
    /// Others do not predict better.
    Compared(ImageLevel),
}

impl From<Unusable> for AsMeasured {
    fn from(why: Unusable) -> Self {
        Self::Unusable(why.to_string())
    }
}

/// Star rows beside the windows.
pub(super) struct Seen {
    /// Whether each row has one.
    has: Vec<bool>,
    pub(super) count: Windows,
}

impl Seen {
    pub(super) fn of(frames: &StarFrames, table: &WindowTable) -> Self {
        let window = star_images::windows_of_rows(frames, table);
        let has: Vec<bool> = window.iter().map(Option::is_some).collect();
        let used = has.iter().filter(|h| **h).count();
        Self {
            count: Windows {
                used,
                unused: table.len() - used,
                rows_without: has.len() - used,
                ..Windows::default()
            },
            has,
        }
    }

    /// The rows that have windows, where others have none.
    pub(super) fn some(&self, frames: &StarFrames) -> Option<StarFrames> {
        (self.count.rows_without > 0).then(|| rows_of(frames, &self.has))
    }
}

/// Some rows, and the frames that have any.
fn rows_of(all: &StarFrames, kept: &[bool]) -> StarFrames {
    let mut out = StarFrames::new();
    let mut rows = Vec::new();
    for k in 0..all.frames() {
        let before = rows.len();
        rows.extend(all.rows_of(k).filter(|&r| kept[r]));
        if rows.len() > before {
            out.t_s.push(all.t_s[k]);
            out.first_row.push(rows.len());
        }
    }
    let pick = |values: &Vec<f64>| rows.iter().map(|&r| values[r]).collect();
    out.slot = rows.iter().map(|&r| all.slot[r]).collect();
    out.star_id = rows.iter().map(|&r| all.star_id[r]).collect();
    (out.x_px, out.y_px) = (pick(&all.x_px), pick(&all.y_px));
    (out.mag, out.flux) = (all.mag.as_ref().map(pick), all.flux.as_ref().map(pick));
    out
}

/// Why the stars that have windows are not enough by themselves, if that is what an error says.
pub(super) fn too_few(error: &CloseError) -> Option<AsMeasured> {
    match error {
        CloseError::TooFewFrames { .. } | CloseError::NoRowsLeft { .. } | CloseError::Singular => {
            Some(AsMeasured::Unusable(format!(
                "the rows that have windows do not suffice by themselves: {error}"
            )))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_without_a_row_go() {
        let mut frames = StarFrames::new();
        for k in 0..3 {
            frames.begin(f64::from(k));
            frames.push(0, 10, f64::from(k), 0.5);
            frames.push(1, 11, f64::from(k), 1.5);
        }
        frames.mag = Some(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let some = rows_of(&frames, &[true, true, false, false, false, true]);
        assert_eq!((some.t_s.as_slice(), some.rows()), (&[0.0, 2.0][..], 3));
        assert_eq!(some.first_row, [0, 2, 3]);
        assert_eq!((some.slot, some.star_id), (vec![0, 1, 1], vec![10, 11, 11]));
        assert_eq!(
            (some.x_px, some.y_px),
            (vec![0.0, 0.0, 2.0], vec![0.5, 1.5, 1.5])
        );
        assert_eq!(some.mag, Some(vec![1.0, 2.0, 6.0]));
    }
}
