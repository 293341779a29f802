//! A bundle: what was measured.
//!
//! Source: telemetry bundle format (docs/formats/bundle.md).

use std::path::Path;

use focal_plane::{Camera, Catalogue, StarFrames};

use crate::{
    AttitudeTable, ExtraColumns, Files, Folder, Housekeeping, Metadata, RateTable, ReferenceTable,
    TelemetryError, WindowTable,
};

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

    /// Reads a bundle from any set of files.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn read_from(files: &dyn Files) -> Result<Self, TelemetryError> {
        Err(TelemetryError::NoMeasurement {
            bundle: files.label(),
            found: "none".into(),
        })
    }

    /// Writes a folder, all or nothing.
    ///
    /// # Errors
    ///
    /// Tables that do not fit together, or what the operating system says.
    pub fn write(&self, dir: &Path, format: TableFormat) -> Result<(), TelemetryError> {
        let _ = format;
        Err(TelemetryError::NoMeasurement {
            bundle: dir.display().to_string(),
            found: "none".into(),
        })
    }
}
