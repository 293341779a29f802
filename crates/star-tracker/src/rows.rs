//! What the model is asked to observe, and what it answers: structure of arrays over all rows of a
//! batch of frames.
//!
//! ```text
//! rows of frame k: first_row[k] .. first_row[k + 1],   as in focal_plane::StarFrames
//! ```
//!
//! Source: layout of `focal_plane::StarFrames`; no physics.

use core::ops::Range;

use focal_plane::{Pixel, PointsMut, Vectors};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use quest::FrameStatus;

use crate::StarView;

/// Stars to observe: one row per star and frame, frames contiguous.
///
/// `slot`, `star_id`, `mag` and `bv` matter to disturbances and to magnitude-dependent noise only;
/// each may be empty, and then reads as the row's place in its frame, 0, NaN and NaN.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// Time stamp of each frame, s.
    pub t_s: &'a [f64],
    /// First row of each frame, and the number of rows at the end.
    pub first_row: &'a [usize],
    /// Slot of each row.
    pub slot: &'a [i32],
    /// Star of each row.
    pub star_id: &'a [i64],
    /// Magnitude of each row.
    pub mag: &'a [f64],
    /// Colour B - V of each row.
    pub bv: &'a [f64],
    /// True inertial direction of each row, unit vectors; they are the catalogue of the solution too.
    pub direction: Vectors<'a>,
}

impl Rows<'_> {
    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.t_s.len()
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.direction.x.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Rows of frame `k`.
    pub fn of(&self, k: usize) -> Range<usize> {
        self.first_row[k]..self.first_row[k + 1]
    }

    /// Panics unless all columns fit together.
    pub(crate) fn check(&self) {
        let rows = self.direction.len();
        assert_eq!(
            self.first_row.len(),
            self.t_s.len() + 1,
            "first_row is one longer than t_s"
        );
        assert_eq!(self.first_row[0], 0, "first_row starts at 0");
        assert_eq!(
            self.first_row[self.t_s.len()],
            rows,
            "first_row ends at the number of rows"
        );
        assert!(self.first_row.is_sorted(), "first_row never decreases");
        for (name, got) in [
            ("slot", self.slot.len()),
            ("star_id", self.star_id.len()),
            ("mag", self.mag.len()),
            ("bv", self.bv.len()),
        ] {
            assert!(
                got == rows || got == 0,
                "{name} has {got} entries for {rows} rows"
            );
        }
    }

    /// The star of row `row` of frame `k`, at `at`.
    pub(crate) fn view(&self, k: usize, row: usize, at: Pixel) -> StarView {
        let place = || i32::try_from(row - self.first_row[k]).unwrap_or(i32::MAX);
        StarView {
            t_s: self.t_s[k],
            slot: self.slot.get(row).copied().unwrap_or_else(place),
            star_id: self.star_id.get(row).copied().unwrap_or(0),
            mag: self.mag.get(row).copied().unwrap_or(f64::NAN),
            bv: self.bv.get(row).copied().unwrap_or(f64::NAN),
            at,
        }
    }

    /// Direction of a row.
    pub(crate) fn direction(&self, row: usize) -> Vector3<f64> {
        Vector3::new(
            self.direction.x[row],
            self.direction.y[row],
            self.direction.z[row],
        )
    }
}

/// What the tracker reports for a batch, with what it would have reported without noise.
///
/// Columns are resized by [`Pbm::measure_into`](crate::Pbm::measure_into); a second batch of the same
/// or a smaller size allocates nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Noise-free measured x (Steps 1 to 3), px; NaN for rows left out.
    pub noise_free_x_px: Vec<f64>,
    /// Noise-free measured y, px.
    pub noise_free_y_px: Vec<f64>,
    /// Measured x (Step 4), px; NaN for rows left out.
    pub x_px: Vec<f64>,
    /// Measured y, px.
    pub y_px: Vec<f64>,
    /// Measured attitude of each frame (Step 5), inertial to tracker: x of its vector part. NaN where
    /// `status` is not solved.
    pub qx: Vec<f64>,
    /// y of the vector part.
    pub qy: Vec<f64>,
    /// z of the vector part.
    pub qz: Vec<f64>,
    /// Scalar part.
    pub qw: Vec<f64>,
    /// Whether each frame has an attitude.
    pub status: Vec<FrameStatus>,
    /// Rows left out: behind the camera, or an exposure that leaves the span of the truth.
    pub rows_left_out: usize,
}

impl Measured {
    /// Measured attitude of frame `k`; `None` when its stars could not fix one.
    pub fn attitude(&self, k: usize) -> Option<UnitQuaternion<f64>> {
        let q = Quaternion::new(self.qw[k], self.qx[k], self.qy[k], self.qz[k]);
        (self.status[k] == FrameStatus::Solved).then(|| UnitQuaternion::new_unchecked(q))
    }

    /// The columns of the noise-free positions.
    pub(crate) fn noise_free(&mut self) -> PointsMut<'_> {
        PointsMut {
            x: &mut self.noise_free_x_px,
            y: &mut self.noise_free_y_px,
        }
    }

    pub(crate) fn resize(&mut self, frames: usize, rows: usize) {
        for column in [
            &mut self.noise_free_x_px,
            &mut self.noise_free_y_px,
            &mut self.x_px,
            &mut self.y_px,
        ] {
            column.resize(rows, f64::NAN);
        }
        for column in [&mut self.qx, &mut self.qy, &mut self.qz, &mut self.qw] {
            column.resize(frames, f64::NAN);
        }
        self.status.resize(frames, FrameStatus::Solved);
    }
}
