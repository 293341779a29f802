//! Reading a bundle: find the tables, read each, judge its values, and check them against one
//! another.
//!
//! Source: telemetry bundle format (docs/formats/bundle.md).

use std::collections::HashSet;
use std::io::Read;

use super::{Bundle, TableFormat, convert};
use crate::config::{Config, nearest};
use crate::layout::{self, Layout};
use crate::metadata::read as metadata;
use crate::table::{RawTable, Setting, csv, parquet};
use crate::tables::median_step;
use crate::{ExtraColumns, Files, Metadata, Source, TelemetryError};

/// Name of the metadata's file.
pub(crate) const METADATA: &str = "bundle.toml";

/// Largest departure of the median step from the declared one.
const STEP_TOLERANCE: f64 = 0.01;

pub(super) fn read(files: &dyn Files) -> Result<Bundle, TelemetryError> {
    let reader = Reader::open(files)?;
    let mut extra = ExtraColumns::new();
    let meta = &reader.meta;
    let camera = metadata::camera(&meta.tracker)
        .map_err(|error| reader.config.error_at("tracker", error.to_string()))?;

    let attitude = reader.table(&layout::ATTITUDE, &mut extra, convert::attitude)?;
    let catalog = reader.table(&layout::CATALOG, &mut extra, |raw| {
        convert::catalog(raw, meta.catalog_epoch_year)
    })?;
    let stars = reader.table(&layout::STARS, &mut extra, |raw| {
        convert::stars(raw, camera.as_ref(), catalog.as_ref())
    })?;
    let bundle = Bundle {
        images: reader.table(&layout::IMAGES, &mut extra, |raw| {
            convert::images(raw, camera.as_ref())
        })?,
        reference: reader.table(&layout::REFERENCE, &mut extra, convert::reference)?,
        rates: reader.table(&layout::RATES, &mut extra, convert::rates)?,
        housekeeping: reader.table(&layout::HOUSEKEEPING, &mut extra, convert::housekeeping)?,
        meta: reader.meta.clone(),
        camera,
        attitude,
        stars,
        catalog,
        extra,
    };
    reader.check_camera(&bundle)?;
    if let Some(attitude) = &bundle.attitude {
        reader.check_rate("attitude", &attitude.t_s)?;
    }
    if let Some(stars) = &bundle.stars {
        reader.check_rate("stars", &stars.t_s)?;
    }
    Ok(bundle)
}

struct Reader<'a> {
    files: &'a dyn Files,
    names: HashSet<String>,
    config: Config,
    meta: Metadata,
}

impl<'a> Reader<'a> {
    fn open(files: &'a dyn Files) -> Result<Self, TelemetryError> {
        let names: HashSet<String> = files
            .names()
            .map_err(|error| TelemetryError::io(files.label(), "read the folder", &error))?
            .into_iter()
            .collect();
        let label = files.file_label(METADATA);
        if !names.contains(METADATA) {
            let all: Vec<&str> = names.iter().map(String::as_str).collect();
            let toml: Vec<&str> = all.into_iter().filter(|n| n.ends_with(".toml")).collect();
            let hint = nearest(METADATA, &toml)
                .map_or_else(String::new, |near| format!(" (there is {near})"));
            return Err(TelemetryError::MissingFile { file: label, hint });
        }
        let config = Config::parse(&text(files, METADATA)?, &label)?;
        let meta = metadata::read(&config)?;
        let reader = Self {
            files,
            names,
            config,
            meta,
        };
        if reader.find("attitude")?.is_none() && reader.find("stars")?.is_none() {
            let mut found: Vec<&str> = reader.names.iter().map(String::as_str).collect();
            found.sort_unstable();
            return Err(TelemetryError::NoMeasurement {
                bundle: files.label(),
                found: found.join(", "),
            });
        }
        Ok(reader)
    }

    /// The file of a table.
    fn find(&self, table: &'static str) -> Result<Option<(String, TableFormat)>, TelemetryError> {
        let mut found = TableFormat::ALL
            .into_iter()
            .map(|form| (form.file_name(table), form))
            .filter(|(name, _)| self.names.contains(name));
        let first = found.next();
        if let (Some((first, _)), Some((second, _))) = (&first, found.next()) {
            return Err(TelemetryError::TwoForms {
                table,
                first: self.files.file_label(first),
                second: self.files.file_label(&second),
            });
        }
        Ok(first)
    }

    /// Reads a table, if it is there.
    fn table<T>(
        &self,
        layout: &'static Layout,
        extra: &mut ExtraColumns,
        convert: impl FnOnce(&mut RawTable) -> Result<T, TelemetryError>,
    ) -> Result<Option<T>, TelemetryError> {
        let Some((name, form)) = self.find(layout.table)? else {
            return Ok(None);
        };
        let label = self.files.file_label(&name);
        let opened = self.files.open(&name);
        let source = opened.map_err(|error| TelemetryError::io(&label, "read", &error))?;
        let setting = Setting {
            layout,
            renamed: self.meta.columns.get(layout.table),
            images: self.meta.images.as_ref(),
        };
        let mut raw = match form {
            TableFormat::Csv => csv::read(&label, source, false, setting)?,
            TableFormat::CsvGz => csv::read(&label, source, true, setting)?,
            TableFormat::Parquet => parquet::read(&label, source, setting)?,
        };
        let table = convert(&mut raw)?;
        if !raw.extra.is_empty() {
            extra.insert(layout.table.into(), raw.extra);
        }
        Ok(Some(table))
    }

    /// Pixels mean nothing without a camera: half of one is a mistake.
    fn check_camera(&self, bundle: &Bundle) -> Result<(), TelemetryError> {
        let tracker = &self.meta.tracker;
        let focal = tracker.focal_length_px.is_some() || tracker.fov_deg.is_some();
        let (missing, beside) = match (tracker.pixels, focal) {
            (Some(_), false) => ("`focal_length_px` or `fov_deg`", "`pixels`"),
            (None, true) => ("`pixels`", "the focal length"),
            _ => return Ok(()),
        };
        if bundle.stars.is_none() && bundle.images.is_none() {
            return Ok(());
        }
        let message =
            format!("expected {missing} beside {beside} in [tracker], found neither of them");
        let message = match tracker.pixels {
            Some(_) => message,
            None => message.replace("neither of them", "none"),
        };
        Err(self.config.error_at("tracker", message))
    }

    /// The declared rate against the median step of a table.
    fn check_rate(&self, table: &str, t_s: &[f64]) -> Result<(), TelemetryError> {
        let (Some(rate_hz), Some(step_s)) = (self.meta.sample_rate_hz, median_step(t_s)) else {
            return Ok(());
        };
        if (rate_hz * step_s - 1.0).abs() <= STEP_TOLERANCE {
            return Ok(());
        }
        Err(self.config.error_at(
            "sample_rate_hz",
            format!(
                "`sample_rate_hz`: expected {:.9} within 1 %, from the median step of {step_s:.9} s in table {table}, column t_s; found {rate_hz}; the key may be left out, as where lost frames move that step",
                1.0 / step_s
            ),
        ))
    }
}

fn text(files: &dyn Files, name: &str) -> Result<String, TelemetryError> {
    let refuse = |error: std::io::Error| TelemetryError::io(files.file_label(name), "read", &error);
    let mut text = String::new();
    match files.open(name).map_err(refuse)? {
        Source::File(mut file) => file.read_to_string(&mut text).map_err(refuse)?,
        Source::Memory(bytes) => bytes.as_ref().read_to_string(&mut text).map_err(refuse)?,
    };
    Ok(text)
}
