//! A table that was read: its columns, and the line of each row.
//!
//! Source: telemetry bundle format, "Bad input" (docs/formats/bundle.md).

use std::collections::BTreeMap;

use super::PixelBlock;
use crate::{ExtraColumn, Place, TelemetryError};

/// Lines or rows of the rows of a table, compactly: most files have one line a row.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    /// `(first row, its line less its index)`, wherever the difference changes.
    steps: Vec<(usize, u64)>,
    rows_not_lines: bool,
}

impl Places {
    pub(super) fn push(&mut self, row: usize, place: Place) {
        let number = match place {
            Place::Line(line) => line,
            Place::Row(row) => {
                self.rows_not_lines = true;
                row
            }
        };
        let less = number.saturating_sub(row as u64);
        if self.steps.last().is_none_or(|&(_, last)| last != less) {
            self.steps.push((row, less));
        }
    }

    pub(super) fn of(&self, row: usize) -> Place {
        let after = self.steps.partition_point(|&(first, _)| first <= row);
        let less = after.checked_sub(1).map_or(2, |at| self.steps[at].1);
        let number = row as u64 + less;
        if self.rows_not_lines {
            Place::Row(number)
        } else {
            Place::Line(number)
        }
    }
}

/// A table that was read, before its values are judged.
#[derive(Debug)]
pub(crate) struct RawTable {
    pub(crate) file: String,
    pub(super) numbers: BTreeMap<String, Vec<f64>>,
    pub(super) integers: BTreeMap<String, Vec<i64>>,
    pub(crate) channels: BTreeMap<String, Vec<f64>>,
    pub(crate) extra: Vec<ExtraColumn>,
    pub(crate) pixels: Option<PixelBlock>,
    pub(super) places: Places,
    pub(super) source_names: BTreeMap<String, String>,
}

impl RawTable {
    /// A column that the layout requires.
    pub(crate) fn numbers(&mut self, name: &str) -> Vec<f64> {
        self.numbers.remove(name).unwrap_or_default()
    }

    /// A column that may be absent.
    pub(crate) fn optional(&mut self, name: &str) -> Option<Vec<f64>> {
        self.numbers.remove(name)
    }

    /// Three columns that come together, or not at all.
    pub(crate) fn triple(&mut self, names: [&str; 3]) -> Option<[Vec<f64>; 3]> {
        let [a, b, c] = names.map(|name| self.optional(name));
        Some([a?, b?, c?])
    }

    /// A column of whole numbers that the layout requires.
    pub(crate) fn integers(&mut self, name: &str) -> Vec<i64> {
        self.integers.remove(name).unwrap_or_default()
    }

    /// Line or row of a row counted from 0.
    pub(crate) fn place(&self, row: usize) -> Place {
        self.places.of(row)
    }

    /// An error in a row, in columns by our names.
    pub(crate) fn error(
        &self,
        row: usize,
        columns: &[&str],
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> TelemetryError {
        let theirs = |name: &&str| {
            let source = self.source_names.get(*name);
            source.map_or_else(|| (*name).to_owned(), Clone::clone)
        };
        let columns: Vec<String> = columns.iter().map(theirs).collect();
        TelemetryError::cell(
            &self.file,
            self.place(row),
            columns.join(", "),
            expected,
            found,
        )
    }
}
