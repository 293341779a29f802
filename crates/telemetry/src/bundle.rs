//! A bundle: what was measured.
//!
//! Source: telemetry bundle format (docs/formats/bundle.md).

mod convert;
mod names;
mod owner;
mod read;
mod stream;
mod write;

use std::path::Path;

use focal_plane::{Camera, Catalogue, StarFrames};

use crate::{
    AttitudeTable, ExtraColumns, Files, Folder, Housekeeping, Metadata, Output, RateTable,
    ReferenceTable, TelemetryError, WindowTable, layout,
};

pub use names::TableFiles;
pub use owner::{bundle_files, foreign_file, made_here};
pub use stream::BundleWriter;

/// How tables are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TableFormat {
    /// `.csv`
    Csv,
    /// `.csv.gz`
    #[default]
    CsvGz,
    /// `.parquet`
    Parquet,
}

impl TableFormat {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Csv, Self::CsvGz, Self::Parquet];

    /// The end of a file's name, with its dot.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Csv => ".csv",
            Self::CsvGz => ".csv.gz",
            Self::Parquet => ".parquet",
        }
    }

    /// Name of a table's file.
    #[must_use]
    pub fn file_name(self, table: &str) -> String {
        format!("{table}{}", self.extension())
    }
}

/// Names that the files of tables may have, in the order of the tables.
fn table_files() -> impl Iterator<Item = String> {
    let forms = |table| TableFormat::ALL.map(|form| form.file_name(table));
    layout::TABLES.into_iter().flat_map(forms)
}

/// A telemetry bundle, read and checked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bundle {
    /// `bundle.toml`.
    pub meta: Metadata,
    /// From `[tracker]`; `None` without pixels and focal length.
    pub camera: Option<Camera>,
    /// The tracker's own attitude.
    pub attitude: Option<AttitudeTable>,
    /// Measured star positions, centred pixels.
    pub stars: Option<StarFrames>,
    /// Raw windows.
    pub images: Option<WindowTable>,
    /// The better estimate.
    pub reference: Option<ReferenceTable>,
    /// Gyro.
    pub rates: Option<RateTable>,
    /// Directions of the stars.
    pub catalog: Option<Catalogue>,
    /// Numeric channels.
    pub housekeeping: Option<Housekeeping>,
    /// Columns that the format does not know.
    pub extra: ExtraColumns,
}

impl Bundle {
    /// Reads a folder.
    ///
    /// # Errors
    ///
    /// The first thing that is wrong, with file, line and column.
    pub fn read(path: &Path) -> Result<Self, TelemetryError> {
        Self::read_from(&Folder::at(path))
    }

    /// Reads a bundle from any set of files. Files of other names are not opened.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn read_from(files: &dyn Files) -> Result<Self, TelemetryError> {
        read::read(files)
    }

    /// Writes a folder, all or nothing. Tables of an older bundle in that folder are replaced, or
    /// removed where this one has none. Renamed columns get the format's names.
    ///
    /// # Errors
    ///
    /// Tables that do not fit together, a folder that holds tables but no `bundle.toml`, or what
    /// the operating system says.
    pub fn write(&self, dir: &Path, format: TableFormat) -> Result<(), TelemetryError> {
        write::write(self, dir, format)
    }

    /// Writes the files of the bundle into a folder that gets others as well.
    ///
    /// # Errors
    ///
    /// As [`write`](Self::write), other than for older tables, which stay.
    pub fn write_to(&self, output: &Output, format: TableFormat) -> Result<(), TelemetryError> {
        write::write_to(self, output, format)
    }
}
