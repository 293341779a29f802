//! Columns that the format does not know: kept as they are, and written again.
//!
//! Source: telemetry bundle format, "Extra columns are kept" (docs/formats/bundle.md).

use std::collections::BTreeMap;

/// The extra columns of each table, by the name of the table.
pub type ExtraColumns = BTreeMap<String, Vec<ExtraColumn>>;

/// A column beside those of the format.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtraColumn {
    /// Its name.
    pub name: String,
    /// Its cells, one for each row.
    pub cells: ExtraCells,
}

/// Cells of an extra column.
#[derive(Clone, Debug, PartialEq)]
pub enum ExtraCells {
    /// Numbers of a Parquet file; NaN is missing.
    Numbers(Vec<f64>),
    /// Text, or anything of a CSV file, cell by cell as it stood there.
    Text(TextCells),
}

impl ExtraCells {
    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Numbers(cells) => cells.len(),
            Self::Text(cells) => cells.len(),
        }
    }

    /// Whether there is no cell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The cells as numbers, empty ones as NaN; `None` if one is neither number nor empty.
    #[must_use]
    pub fn numbers(&self) -> Option<Vec<f64>> {
        match self {
            Self::Numbers(cells) => Some(cells.clone()),
            Self::Text(cells) => cells
                .iter()
                .map(|cell| match cell.trim() {
                    "" => Some(f64::NAN),
                    text => text.parse().ok(),
                })
                .collect(),
        }
    }
}

/// Many short texts in one piece of memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TextCells {
    text: String,
    end: Vec<usize>,
}

impl TextCells {
    /// Adds a cell.
    pub fn push(&mut self, cell: &str) {
        self.text.push_str(cell);
        self.end.push(self.text.len());
    }

    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.end.len()
    }

    /// Whether there is no cell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.end.is_empty()
    }

    /// One cell.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<&str> {
        let end = *self.end.get(index)?;
        let start = index.checked_sub(1).map_or(0, |before| self.end[before]);
        Some(&self.text[start..end])
    }

    /// All cells in order.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        (0..self.len()).filter_map(|index| self.get(index))
    }
}
