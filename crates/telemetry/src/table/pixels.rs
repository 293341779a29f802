//! The pixel columns of table `images` as one block.
//!
//! ```text
//! values[row of the table * n + row of the window * columns + column of the window]
//! ```
//!
//! Source: telemetry bundle format, table `images` (docs/formats/bundle.md).

use crate::{ImagesMeta, TelemetryError, pixel_name};

/// Pixels of all rows.
#[derive(Debug)]
pub(crate) struct PixelBlock {
    /// Columns (along x) and rows (along y).
    pub(crate) size: [usize; 2],
    pub(crate) unread: Vec<bool>,
    pub(crate) values: Vec<f64>,
}

impl PixelBlock {
    /// Settles the shape: the columns of the table must fill a window of the declared size, other
    /// than pixels that are never read out. A size written as rows, columns is understood when
    /// the names of the columns leave no doubt.
    pub(crate) fn new(
        file: &str,
        names: &[String],
        header: &[String],
        meta: Option<&ImagesMeta>,
    ) -> Result<Self, TelemetryError> {
        let found: Vec<[usize; 2]> = names.iter().filter_map(|n| pixel_name::parse(n)).collect();
        let unread = meta.map_or(&[][..], |meta| &meta.unread);
        let missing = |[columns, rows]: [usize; 2]| {
            (0..rows)
                .flat_map(|row| (0..columns).map(move |column| [row, column]))
                .find(|pixel| !found.contains(pixel) && !unread.contains(pixel))
        };
        let beyond = |[columns, rows]: [usize; 2]| {
            let outside = |pixel: &&[usize; 2]| pixel[0] >= rows || pixel[1] >= columns;
            found.iter().find(outside).copied()
        };
        let spanned = [1, 0].map(|axis| found.iter().map(|p| p[axis] + 1).max().unwrap_or(0));
        let declared = meta.map_or(spanned, |meta| meta.size);
        let [a, b] = declared;
        let fits = |size| missing(size).is_none() && beyond(size).is_none();
        let size = if !fits(declared) && fits([b, a]) {
            [b, a]
        } else {
            declared
        };
        let wrong = |column: String, hint: String| TelemetryError::MissingColumn {
            file: file.into(),
            column,
            header: header.join(", "),
            hint,
        };
        let shape = format!("{} columns and {} rows", size[0], size[1]);
        if found.is_empty() {
            return Err(wrong("p00".into(), String::new()));
        }
        if let Some(pixel) = missing(size) {
            let hint = format!(" (a window has {shape})");
            return Err(wrong(pixel_name::of(pixel), hint));
        }
        if let Some(pixel) = beyond(size) {
            let last = pixel_name::of([size[1] - 1, size[0] - 1]);
            let hint = format!(
                " as the last pixel, but also {} (bundle.toml, [images] size: a window has {shape})",
                pixel_name::of(pixel)
            );
            return Err(wrong(last, hint));
        }
        let mut block = Self {
            size,
            unread: vec![false; size[0] * size[1]],
            values: Vec::new(),
        };
        for &pixel in unread {
            if let Some(offset) = block.offset(pixel) {
                block.unread[offset] = true;
            }
        }
        Ok(block)
    }

    /// Index of a pixel `[row, column]` in its window.
    pub(crate) fn offset(&self, pixel: [usize; 2]) -> Option<usize> {
        let ([row, column], [columns, rows]) = (pixel, self.size);
        (row < rows && column < columns).then_some(row * columns + column)
    }

    pub(crate) fn begin_rows(&mut self, count: usize) {
        let more = count * self.unread.len();
        self.values.resize(self.values.len() + more, 0.0);
    }

    pub(crate) fn set(&mut self, row: usize, offset: usize, value: f64) {
        self.values[row * self.unread.len() + offset] = value;
    }
}
