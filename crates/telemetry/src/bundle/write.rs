//! Writing a bundle, with columns under the format's own names.
//!
//! Source: telemetry bundle format (docs/formats/bundle.md).

use std::fs;
use std::io::{BufWriter, Write as _};
use std::path::Path;

use focal_plane::{Catalogue, StarFrames};
use nalgebra::{UnitQuaternion, Vector3};

use super::read::METADATA;
use super::{Bundle, TableFormat};
use crate::table::write::OutTable;
use crate::{
    Housekeeping, ImagesMeta, Metadata, Output, ReferenceTable, TelemetryError, WindowTable,
    layout, pixel_name,
};

pub(super) fn write(
    bundle: &Bundle,
    dir: &Path,
    format: TableFormat,
) -> Result<(), TelemetryError> {
    let written: Vec<_> = tables(bundle).into_iter().map(|(table, _)| table).collect();
    let stale = stale_tables(&written, dir, format)?;
    let output = Output::new(dir)?;
    write_to(bundle, &output, format)?;
    commit(output, stale, dir)
}

/// Puts everything in its place, and takes away what would be read with it by mistake.
pub(super) fn commit(output: Output, stale: Vec<String>, dir: &Path) -> Result<(), TelemetryError> {
    output.commit()?;
    for name in stale {
        let path = dir.join(name);
        fs::remove_file(&path)
            .map_err(|error| TelemetryError::io(path.display().to_string(), "replace", &error))?;
    }
    Ok(())
}

/// Tables of the bundle that is being replaced, which would be taken for tables of the new one.
pub(super) fn stale_tables(
    written: &[&str],
    dir: &Path,
    format: TableFormat,
) -> Result<Vec<String>, TelemetryError> {
    let written: Vec<String> = written
        .iter()
        .map(|table| format.file_name(table))
        .collect();
    let mut stale = Vec::new();
    for table in layout::TABLES {
        for form in TableFormat::ALL {
            let name = form.file_name(table);
            if dir.join(&name).is_file() && !written.contains(&name) {
                stale.push(name);
            }
        }
    }
    match stale.first() {
        Some(name) if !dir.join(METADATA).exists() => Err(TelemetryError::Inconsistent {
            table: "bundle",
            reason: format!(
                "{} holds {name}, but no {METADATA}: expected an old bundle or another folder",
                dir.display()
            ),
        }),
        _ => Ok(stale),
    }
}

pub(super) fn write_to(
    bundle: &Bundle,
    output: &Output,
    format: TableFormat,
) -> Result<(), TelemetryError> {
    check(bundle)?;
    let mut meta = bundle.meta.clone();
    if let Some(images) = &bundle.images {
        meta.images = Some(images_meta(images));
    }
    metadata(meta, output)?;
    for (table, mut columns) in tables(bundle) {
        if let Some(extra) = bundle.extra.get(table) {
            columns.extra(extra);
        }
        let name = format.file_name(table);
        let label = output.target().join(&name).display().to_string();
        let to = BufWriter::new(output.create(&name)?);
        columns.write(format, to, &label)?;
    }
    Ok(())
}

/// `bundle.toml`; tables are written under the format's own names.
pub(super) fn metadata(meta: Metadata, output: &Output) -> Result<(), TelemetryError> {
    let meta = Metadata {
        columns: std::collections::BTreeMap::new(),
        ..meta
    };
    let text = meta
        .to_toml()
        .map_err(|error| TelemetryError::Inconsistent {
            table: METADATA,
            reason: error.to_string(),
        })?;
    output.write(METADATA, |to| to.write_all(text.as_bytes()))
}

/// All tables that the bundle has.
pub(super) fn tables(bundle: &Bundle) -> Vec<(&'static str, OutTable<'_>)> {
    let mut tables = Vec::new();
    if let Some(attitude) = &bundle.attitude {
        let mut table = OutTable::new(attitude.t_s.len());
        table.numbers("t_s", &attitude.t_s);
        quaternions(&mut table, &attitude.q);
        tables.push(("attitude", table));
    }
    if let Some(stars) = &bundle.stars {
        tables.push(("stars", stars_table(stars)));
    }
    if let Some(images) = &bundle.images {
        tables.push(("images", images_table(images)));
    }
    if let Some(reference) = &bundle.reference {
        tables.push(("reference", reference_table(reference)));
    }
    if let Some(rates) = &bundle.rates {
        let mut table = OutTable::new(rates.t_s.len());
        table.numbers("t_s", &rates.t_s);
        vectors(&mut table, &rates.w);
        tables.push(("rates", table));
    }
    if let Some(catalog) = &bundle.catalog {
        tables.push(("catalog", catalog_table(catalog)));
    }
    if let Some(housekeeping) = &bundle.housekeeping {
        tables.push(("housekeeping", housekeeping_table(housekeeping)));
    }
    tables
}

fn quaternions<'a>(table: &mut OutTable<'a>, q: &'a [UnitQuaternion<f64>]) {
    table.numbers_by("qx", |row| q[row].i);
    table.numbers_by("qy", |row| q[row].j);
    table.numbers_by("qz", |row| q[row].k);
    table.numbers_by("qw", |row| q[row].w);
}

fn vectors<'a>(table: &mut OutTable<'a>, w: &'a [Vector3<f64>]) {
    table.numbers_by("wx_rad_s", |row| w[row].x);
    table.numbers_by("wy_rad_s", |row| w[row].y);
    table.numbers_by("wz_rad_s", |row| w[row].z);
}

fn stars_table(stars: &StarFrames) -> OutTable<'_> {
    let frame = stars.frame_of_rows();
    let mut table = OutTable::new(stars.rows());
    table.numbers_by("t_s", move |row| stars.t_s[frame[row] as usize]);
    table.integers_by("slot", |row| i64::from(stars.slot[row]));
    table.integers_by("star_id", |row| stars.star_id[row]);
    table.numbers("x_px", &stars.x_px);
    table.numbers("y_px", &stars.y_px);
    if let Some(mag) = &stars.mag {
        table.numbers("mag", mag);
    }
    if let Some(flux) = &stars.flux {
        table.numbers("flux", flux);
    }
    table
}

fn images_table(images: &WindowTable) -> OutTable<'_> {
    let mut table = OutTable::new(images.len());
    table.numbers("t_s", &images.t_s);
    table.integers_by("slot", |row| i64::from(images.slot[row]));
    table.numbers("x0_px", &images.x0_px);
    table.numbers("y0_px", &images.y0_px);
    table.numbers("background", &images.background);
    let stride = images.pixels_per_window();
    for offset in 0..stride {
        let pixel = [offset / images.size[0], offset % images.size[0]];
        table.numbers_by(pixel_name::of(pixel), move |row| {
            images.pixels[row * stride + offset]
        });
    }
    table
}

pub(super) fn images_meta(images: &WindowTable) -> ImagesMeta {
    let unread = images
        .unread
        .iter()
        .enumerate()
        .filter(|(_, unread)| **unread);
    ImagesMeta {
        size: images.size,
        unread: unread
            .map(|(offset, _)| [offset / images.size[0], offset % images.size[0]])
            .collect(),
    }
}

fn reference_table(reference: &ReferenceTable) -> OutTable<'_> {
    let mut table = OutTable::new(reference.t_s.len());
    table.numbers("t_s", &reference.t_s);
    quaternions(&mut table, &reference.q);
    if let Some(rates) = &reference.rates_rad_s {
        vectors(&mut table, rates);
    }
    if let Some(sigma) = &reference.sigma_arcsec {
        for (axis, name) in ["sx_arcsec", "sy_arcsec", "sz_arcsec"]
            .into_iter()
            .enumerate()
        {
            table.numbers_by(name, move |row| sigma[row][axis]);
        }
    }
    table
}

fn catalog_table(catalog: &Catalogue) -> OutTable<'_> {
    let stars = catalog.stars();
    let mut table = OutTable::new(stars.len());
    table.integers_by("star_id", |row| stars[row].id);
    table.numbers_by("ra_deg", |row| stars[row].ra_deg);
    table.numbers_by("dec_deg", |row| stars[row].dec_deg);
    table.numbers_by("mag", |row| stars[row].mag);
    table.numbers_by("bv", |row| stars[row].bv);
    table.numbers_by("pm_ra_mas_yr", |row| stars[row].pm_ra_mas_yr);
    table.numbers_by("pm_dec_mas_yr", |row| stars[row].pm_dec_mas_yr);
    let known = stars.iter().any(|star| star.parallax_mas != 0.0);
    if known {
        table.numbers_by("parallax_mas", |row| stars[row].parallax_mas);
    }
    table
}

fn housekeeping_table(housekeeping: &Housekeeping) -> OutTable<'_> {
    let mut table = OutTable::new(housekeeping.t_s.len());
    table.numbers("t_s", &housekeeping.t_s);
    for (name, cells) in &housekeeping.channels {
        table.numbers(name.as_str(), cells);
    }
    table
}

/// Columns of one length, so that writing cannot fail half-way for a reason known before.
pub(super) fn check(bundle: &Bundle) -> Result<(), TelemetryError> {
    let mut lengths: Vec<(&'static str, &str, usize, usize)> = Vec::new();
    if let Some(attitude) = &bundle.attitude {
        lengths.push(("attitude", "q", attitude.q.len(), attitude.t_s.len()));
    }
    if let Some(reference) = &bundle.reference {
        let rows = reference.t_s.len();
        lengths.push(("reference", "q", reference.q.len(), rows));
        if let Some(rates) = &reference.rates_rad_s {
            lengths.push(("reference", "rates_rad_s", rates.len(), rows));
        }
        if let Some(sigma) = &reference.sigma_arcsec {
            lengths.push(("reference", "sigma_arcsec", sigma.len(), rows));
        }
    }
    if let Some(rates) = &bundle.rates {
        lengths.push(("rates", "w", rates.w.len(), rates.t_s.len()));
    }
    if let Some(images) = &bundle.images {
        let (rows, window) = (images.len(), images.pixels_per_window());
        lengths.extend([
            ("images", "slot", images.slot.len(), rows),
            ("images", "x0_px", images.x0_px.len(), rows),
            ("images", "y0_px", images.y0_px.len(), rows),
            ("images", "background", images.background.len(), rows),
            ("images", "pixels", images.pixels.len(), rows * window),
            ("images", "unread", images.unread.len(), window),
        ]);
    }
    if let Some(housekeeping) = &bundle.housekeeping {
        let rows = housekeeping.t_s.len();
        for (name, cells) in &housekeeping.channels {
            lengths.push(("housekeeping", name, cells.len(), rows));
        }
    }
    for (table, column, got, need) in lengths {
        if got != need {
            let reason = format!("column {column} has {got} entries, expected {need}");
            return Err(TelemetryError::Inconsistent { table, reason });
        }
    }
    if let Some(stars) = &bundle.stars {
        stars
            .check()
            .map_err(|error| TelemetryError::Inconsistent {
                table: "stars",
                reason: error.to_string(),
            })?;
    }
    Ok(())
}
