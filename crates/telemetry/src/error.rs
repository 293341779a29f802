//! What can be wrong with a file, said so that the culprit can be found: file, line, column, what
//! was expected and what was found.
//!
//! Source: telemetry bundle format, "Bad input" (docs/formats/bundle.md).

use std::fmt;

/// Where a row of a table stands in its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a CSV file, 1-based; the header is line 1.
    Line(u64),
    /// Row of a Parquet file, 1-based.
    Row(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Row(row) => write!(f, "row {row}"),
        }
    }
}

/// A cell, or several cells of one row, whose value cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}, {place}, column {column}: expected {expected}, found {found}")]
pub struct CellError {
    /// File.
    pub file: String,
    /// Line or row.
    pub place: Place,
    /// Column in the file's own naming, or several separated by commas.
    pub column: String,
    /// What the format asks for.
    pub expected: String,
    /// What the file holds.
    pub found: String,
}

/// Something wrong in a TOML file, with the line it stands in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TomlError {
    /// File.
    pub file: String,
    /// Line, 1-based.
    pub line: usize,
    /// Column in characters, 1-based.
    pub column: usize,
    /// Length of the culprit in characters, at least 1, within its line.
    pub width: usize,
    /// The whole line.
    pub text: String,
    /// What is wrong with it.
    pub message: String,
}

impl fmt::Display for TomlError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            file,
            line,
            column,
            text,
            message,
            ..
        } = self;
        writeln!(f, "{file}, line {line}, column {column}: {message}")?;
        let number = line.to_string();
        let margin = " ".repeat(number.len());
        // tabs stay tabs, so that the marker stands under the culprit in any editor
        let blank: String = text
            .chars()
            .take(column.saturating_sub(1))
            .map(|c| if c == '\t' { '\t' } else { ' ' })
            .collect();
        let marker = "^".repeat(self.width.max(1));
        writeln!(f, " {margin} |")?;
        writeln!(f, " {number} | {text}")?;
        write!(f, " {margin} | {blank}{marker}")
    }
}

impl std::error::Error for TomlError {}

/// Why a bundle, a model or a result cannot be read or written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TelemetryError {
    /// The operating system refused.
    #[error("{file}: cannot {what}: {reason}")]
    Io {
        /// File or folder.
        file: String,
        /// What was tried: `read`, `write`, ...
        what: &'static str,
        /// Kind of the refusal.
        kind: std::io::ErrorKind,
        /// The system's own words.
        reason: String,
    },
    /// A TOML file with a mistake.
    #[error(transparent)]
    Toml(#[from] Box<TomlError>),
    /// What is wrong with a file as a whole.
    #[error("{file}: {reason}")]
    InFile {
        /// The file.
        file: String,
        /// What is wrong.
        reason: String,
    },
    /// A cell with a mistake.
    #[error(transparent)]
    Cell(#[from] Box<CellError>),
    /// The header lacks a column.
    #[error("{file}, line 1 (header), column {column}: expected this column, found {header}{hint}")]
    MissingColumn {
        /// File.
        file: String,
        /// The column that is needed.
        column: String,
        /// The columns that are there.
        header: String,
        /// A rename that may help, or nothing.
        hint: String,
    },
    /// The header has a column twice.
    #[error(
        "{file}, line 1 (header), column {column}: expected each name once, found it as columns {first} and {second}"
    )]
    DuplicateColumn {
        /// File.
        file: String,
        /// The name.
        column: String,
        /// Its first place, 1-based.
        first: usize,
        /// Its second place, 1-based.
        second: usize,
    },
    /// A row with too few or too many cells.
    #[error("{file}, {place}, column {column}: expected {need} cells, found {got}")]
    RowLength {
        /// File.
        file: String,
        /// Line or row.
        place: Place,
        /// The first column without a cell, or the last one of the header.
        column: String,
        /// Columns of the header.
        need: usize,
        /// Cells of the row.
        got: usize,
    },
    /// A table without rows.
    #[error("{file}, line 2: expected at least one row below the header, found none")]
    EmptyTable {
        /// File.
        file: String,
    },
    /// A compressed or columnar file that breaks off or is damaged.
    #[error("{file}, after {place}: expected a whole {what}, found {reason}")]
    Broken {
        /// File.
        file: String,
        /// Last line or row that could be read.
        place: Place,
        /// `gzip stream`, `Parquet file`, ...
        what: &'static str,
        /// What is wrong with it.
        reason: String,
    },
    /// A Parquet file whose compression is not read.
    #[error(
        "{file}, column {column}: expected snappy, zstd, gzip or LZ4 compression or none, found {found}; write the file anew with one of them"
    )]
    Compression {
        /// File.
        file: String,
        /// The column.
        column: String,
        /// Its compression.
        found: String,
    },
    /// One table in two files.
    #[error("table {table}: expected one file, found both {first} and {second}")]
    TwoForms {
        /// The table.
        table: &'static str,
        /// One file.
        first: String,
        /// The other.
        second: String,
    },
    /// A file that must be there is not.
    #[error("{file}: expected this file, found none{hint}")]
    MissingFile {
        /// File, with its folder.
        file: String,
        /// What may have been meant, or nothing.
        hint: String,
    },
    /// Nothing was measured.
    #[error("{bundle}: expected a table `attitude` or `stars`, found {found}")]
    NoMeasurement {
        /// The bundle.
        bundle: String,
        /// The tables that are there.
        found: String,
    },
    /// Values in memory that do not make a valid file.
    #[error("{table}: {reason}")]
    Inconsistent {
        /// Table or file to be written.
        table: &'static str,
        /// What does not fit.
        reason: String,
    },
}

impl TelemetryError {
    pub(crate) fn io(file: impl Into<String>, what: &'static str, error: &std::io::Error) -> Self {
        Self::Io {
            file: file.into(),
            what,
            kind: error.kind(),
            reason: error.to_string(),
        }
    }

    pub(crate) fn cell(
        file: &str,
        place: Place,
        column: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Cell(Box::new(CellError {
            file: file.into(),
            place,
            column: column.into(),
            expected: expected.into(),
            found: found.into(),
        }))
    }
}
