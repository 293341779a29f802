//! Writing a bundle piece by piece: what is held in memory does not depend on how long it gets.
//!
//! Source: telemetry bundle format (docs/formats/bundle.md).

use std::collections::BTreeMap;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use super::{Bundle, TableFormat, write};
use crate::table::write::TableWriter;
use crate::{ImagesMeta, Metadata, Output, TelemetryError};

/// A bundle that is being written; it appears whole with [`finish`](Self::finish), or not at all.
///
/// ```
/// use telemetry::{AttitudeTable, Bundle, BundleWriter, Metadata, TableFormat};
/// use nalgebra::UnitQuaternion;
/// let dir = std::env::temp_dir().join(format!("telemetry-stream-{}", std::process::id()));
/// let mut writer = BundleWriter::new(&dir, TableFormat::Csv)?;
/// for t_s in [0.0, 0.5] {
///     let attitude = AttitudeTable { t_s: vec![t_s], q: vec![UnitQuaternion::identity()] };
///     writer.append(&Bundle { attitude: Some(attitude), ..Bundle::default() })?;
/// }
/// writer.finish(Metadata::default())?;
/// let rows = Bundle::read(&dir)?.attitude.map(|attitude| attitude.t_s.len());
/// assert_eq!(rows, Some(2));
/// # std::fs::remove_dir_all(&dir).expect("can be removed");
/// # Ok::<(), telemetry::TelemetryError>(())
/// ```
pub struct BundleWriter {
    dir: PathBuf,
    format: TableFormat,
    output: Output,
    tables: BTreeMap<&'static str, TableWriter<'static>>,
    images: Option<ImagesMeta>,
}

impl std::fmt::Debug for BundleWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BundleWriter")
            .field("output", &self.output)
            .field("tables", &self.tables.keys())
            .finish_non_exhaustive()
    }
}

impl BundleWriter {
    /// Begins a folder, as [`Bundle::write`] does.
    ///
    /// # Errors
    ///
    /// A place where no folder can be made, or one that holds tables but no `bundle.toml`.
    pub fn new(dir: &Path, format: TableFormat) -> Result<Self, TelemetryError> {
        write::stale_tables(&[], dir, format)?;
        Ok(Self {
            dir: dir.to_owned(),
            format,
            output: Output::new(dir)?,
            tables: BTreeMap::new(),
            images: None,
        })
    }

    /// The folder that is being written, for files beside the tables.
    #[must_use]
    pub fn output(&self) -> &Output {
        &self.output
    }

    /// Adds the rows of a piece to each table that it has. Its metadata and extra columns are not
    /// looked at; the order of time between pieces is the caller's duty.
    ///
    /// # Errors
    ///
    /// Columns of a piece that do not fit together, a table with other columns than in the pieces
    /// before, or what the operating system says.
    pub fn append(&mut self, piece: &Bundle) -> Result<(), TelemetryError> {
        write::check(piece)?;
        if let (None, Some(images)) = (&self.images, &piece.images) {
            self.images = Some(write::images_meta(images));
        }
        for (name, table) in write::tables(piece) {
            if !self.tables.contains_key(name) {
                let file = self.format.file_name(name);
                let label = self.output.target().join(&file).display().to_string();
                let to = Box::new(BufWriter::new(self.output.create(&file)?));
                let writer = TableWriter::begin(&table, self.format, to, &label)?;
                self.tables.insert(name, writer);
            }
            if let Some(writer) = self.tables.get_mut(name) {
                writer.append(&table)?;
            }
        }
        Ok(())
    }

    /// Writes `bundle.toml` and puts everything in its place. Tables of an older bundle are replaced,
    /// or removed where this one has none.
    ///
    /// # Errors
    ///
    /// What the operating system says; then the folder is as it was.
    pub fn finish(self, meta: Metadata) -> Result<(), TelemetryError> {
        let written: Vec<&str> = self.tables.keys().copied().collect();
        let stale = write::stale_tables(&written, &self.dir, self.format)?;
        for writer in self.tables.into_values() {
            writer.finish()?;
        }
        let meta = Metadata {
            images: self.images.or(meta.images),
            ..meta
        };
        write::metadata(meta, &self.output)?;
        write::commit(self.output, stale, &self.dir)
    }
}
