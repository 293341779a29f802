//! Star measurements of many frames, as columns: the one representation that simulation,
//! residuals and files share.
//!
//! ```text
//! frame k   t_s[k]   rows first_row[k] .. first_row[k + 1]
//! row i     slot[i], star_id[i], x_px[i], y_px[i] (, mag[i], flux[i])
//! ```
//!
//! A frame's rows are contiguous and frames follow one another in time, so that a kernel can run
//! over all rows of a batch at once.
//!
//! Not physics: columns as in table `stars` of a telemetry bundle.

use std::ops::Range;

use crate::Points;

/// What is wrong with columns of measurements.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FramesError {
    /// A column has the wrong length.
    #[error("column {column} has {got} entries, {need} needed")]
    Length {
        /// The column.
        column: &'static str,
        /// Its length.
        got: usize,
        /// The length that fits the others.
        need: usize,
    },
    /// `first_row` does not ascend from 0 to the number of rows.
    #[error("first_row of frame {frame} is {got}, which does not ascend from 0 to {rows}")]
    FirstRow {
        /// Frame, or the number of frames for the last entry.
        frame: usize,
        /// The entry.
        got: usize,
        /// Number of rows.
        rows: usize,
    },
    /// A time is not finite, or not later than the one before.
    #[error("frame {frame} at {t_s} s is not later than the one before, or not finite")]
    Time {
        /// The frame.
        frame: usize,
        /// Its time, s.
        t_s: f64,
    },
    /// A slot appears twice in a frame.
    #[error("frame {frame} at {t_s} s has slot {slot} twice")]
    RepeatedSlot {
        /// The frame.
        frame: usize,
        /// Its time, s.
        t_s: f64,
        /// The slot.
        slot: i32,
    },
}

/// Measured star positions of many frames, centred pixels, structure of arrays.
///
/// ```
/// use focal_plane::StarFrames;
/// let mut frames = StarFrames::new();
/// frames.begin(0.0);
/// frames.push(0, 87937, 12.5, -3.25);
/// frames.push(1, 113963, -200.0, 88.0);
/// frames.begin(0.5);
/// frames.push(0, 87937, 12.6, -3.30);
/// assert_eq!((frames.frames(), frames.rows()), (2, 3));
/// assert_eq!(frames.rows_of(1), 2..3);
/// frames.check()?;
/// # Ok::<(), focal_plane::FramesError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct StarFrames {
    /// Time of each frame, s: the middle of the exposure of row y = 0.
    pub t_s: Vec<f64>,
    /// First row of each frame, and the number of rows: one entry more than frames, from 0.
    pub first_row: Vec<usize>,
    /// Slot of the tracker that follows the star, for each row.
    pub slot: Vec<i32>,
    /// Catalogue id, for each row.
    pub star_id: Vec<i64>,
    /// Position along the columns, px, for each row.
    pub x_px: Vec<f64>,
    /// Position along the rows of the detector, px, for each row.
    pub y_px: Vec<f64>,
    /// Measured magnitude, for each row.
    pub mag: Option<Vec<f64>>,
    /// Measured flux in the unit of the source, for each row.
    pub flux: Option<Vec<f64>>,
}

impl Default for StarFrames {
    fn default() -> Self {
        Self::new()
    }
}

impl StarFrames {
    /// No frames; `first_row` is `[0]`.
    #[must_use]
    pub fn new() -> Self {
        Self::with_capacity(0, 0)
    }

    /// No frames, with memory for some.
    #[must_use]
    pub fn with_capacity(frames: usize, rows: usize) -> Self {
        let mut first_row = Vec::with_capacity(frames + 1);
        first_row.push(0);
        Self {
            t_s: Vec::with_capacity(frames),
            first_row,
            slot: Vec::with_capacity(rows),
            star_id: Vec::with_capacity(rows),
            x_px: Vec::with_capacity(rows),
            y_px: Vec::with_capacity(rows),
            mag: None,
            flux: None,
        }
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.t_s.len()
    }

    /// Number of rows of all frames.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.x_px.len()
    }

    /// Rows of frame `k`.
    ///
    /// # Panics
    ///
    /// If there is no frame `k`.
    #[must_use]
    pub fn rows_of(&self, k: usize) -> Range<usize> {
        self.first_row[k]..self.first_row[k + 1]
    }

    /// Frame of each row.
    ///
    /// # Panics
    ///
    /// With more than 2^32 frames, or if `first_row` has too few entries.
    #[must_use]
    pub fn frame_of_rows(&self) -> Vec<u32> {
        let mut frame = Vec::with_capacity(self.rows());
        for k in 0..self.frames() {
            let number = u32::try_from(k).expect("fewer than 2^32 frames");
            frame.resize(self.first_row[k + 1], number);
        }
        frame
    }

    /// Time of each row, s: that of its frame.
    ///
    /// # Panics
    ///
    /// If `first_row` has too few entries.
    #[must_use]
    pub fn t_of_rows_s(&self) -> Vec<f64> {
        let mut t_s = Vec::with_capacity(self.rows());
        for k in 0..self.frames() {
            t_s.resize(self.first_row[k + 1], self.t_s[k]);
        }
        t_s
    }

    /// All positions, centred pixels.
    #[must_use]
    pub fn positions(&self) -> Points<'_> {
        Points {
            x: &self.x_px,
            y: &self.y_px,
        }
    }

    /// Begins an empty frame; what is pushed next belongs to it.
    pub fn begin(&mut self, t_s: f64) {
        self.t_s.push(t_s);
        self.first_row.push(self.rows());
    }

    /// Adds a star to the last frame; magnitude and flux, where kept, are NaN.
    ///
    /// # Panics
    ///
    /// Before the first [`begin`](Self::begin).
    pub fn push(&mut self, slot: i32, star_id: i64, x_px: f64, y_px: f64) {
        self.push_measured(slot, star_id, x_px, y_px, None, None);
    }

    /// Adds a star with its measured magnitude and flux to the last frame. A column exists from the
    /// first value given; rows without one hold NaN.
    ///
    /// # Panics
    ///
    /// Before the first [`begin`](Self::begin).
    pub fn push_measured(
        &mut self,
        slot: i32,
        star_id: i64,
        x_px: f64,
        y_px: f64,
        mag: Option<f64>,
        flux: Option<f64>,
    ) {
        assert!(!self.t_s.is_empty(), "begin a frame before its stars");
        let rows = self.rows();
        push_optional(&mut self.mag, mag, rows);
        push_optional(&mut self.flux, flux, rows);
        self.slot.push(slot);
        self.star_id.push(star_id);
        self.x_px.push(x_px);
        self.y_px.push(y_px);
        if let Some(end) = self.first_row.last_mut() {
            *end = rows + 1;
        }
    }

    /// Checks that columns fit together, frames ascend in time, and no slot repeats in a frame.
    /// Positions may be NaN (flagged rows).
    ///
    /// # Errors
    ///
    /// The first thing that is wrong.
    pub fn check(&self) -> Result<(), FramesError> {
        self.check_lengths()?;
        self.check_rows()?;
        let mut last_s = f64::NEG_INFINITY;
        let mut slots = Vec::new();
        for (frame, &t_s) in self.t_s.iter().enumerate() {
            if !t_s.is_finite() || t_s <= last_s {
                return Err(FramesError::Time { frame, t_s });
            }
            last_s = t_s;
            slots.clear();
            slots.extend_from_slice(&self.slot[self.rows_of(frame)]);
            slots.sort_unstable();
            if let Some(pair) = slots.windows(2).find(|pair| pair[0] == pair[1]) {
                let slot = pair[0];
                return Err(FramesError::RepeatedSlot { frame, t_s, slot });
            }
        }
        Ok(())
    }

    fn check_lengths(&self) -> Result<(), FramesError> {
        let (rows, frames) = (self.rows(), self.frames());
        let optional = |column: &Option<Vec<f64>>| column.as_ref().map_or(rows, Vec::len);
        for (column, got, need) in [
            ("first_row", self.first_row.len(), frames + 1),
            ("slot", self.slot.len(), rows),
            ("star_id", self.star_id.len(), rows),
            ("y_px", self.y_px.len(), rows),
            ("mag", optional(&self.mag), rows),
            ("flux", optional(&self.flux), rows),
        ] {
            if got != need {
                return Err(FramesError::Length { column, got, need });
            }
        }
        Ok(())
    }

    fn check_rows(&self) -> Result<(), FramesError> {
        let (rows, frames) = (self.rows(), self.frames());
        let mut last = 0;
        for (frame, &got) in self.first_row.iter().enumerate() {
            let wrong_end = (frame == 0 && got != 0) || (frame == frames && got != rows);
            if got < last || got > rows || wrong_end {
                return Err(FramesError::FirstRow { frame, got, rows });
            }
            last = got;
        }
        Ok(())
    }
}

fn push_optional(column: &mut Option<Vec<f64>>, value: Option<f64>, rows: usize) {
    match (column.as_mut(), value) {
        (Some(column), value) => column.push(value.unwrap_or(f64::NAN)),
        (None, Some(value)) => {
            let mut fresh = vec![f64::NAN; rows];
            fresh.push(value);
            *column = Some(fresh);
        }
        (None, None) => {}
    }
}
