//! Tables that a run of the closed loop leaves beside its report.
//!
//! ```text
//! residuals_stars.parquet      t_s, slot, star_id, x_px, y_px, before_*, after_*, fold, outlier
//! residuals_attitude.parquet   t_s, before_*, after_*, fold, outlier
//! dark_map.csv                 x_px, y_px, dn, sigma_dn
//! ```
//!
//! Residuals in arcsec; a value that does not exist is null.
//!
//! Source: report format (docs/formats/report.md).

use std::io::BufWriter;

use crate::table::write::OutTable;
use crate::{Output, TableFormat, TelemetryError};

/// Star residuals, one entry a row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StarResiduals {
    /// Times, s.
    pub t_s: Vec<f64>,
    /// Slots.
    pub slot: Vec<i32>,
    /// Stars.
    pub star_id: Vec<i64>,
    /// Measured position along x, px.
    pub x_px: Vec<f64>,
    /// Measured position along y, px.
    pub y_px: Vec<f64>,
    /// Residual along x and y under the declared model, arcsec.
    pub before_arcsec: [Vec<f64>; 2],
    /// Residual along x and y with the effects found, arcsec.
    pub after_arcsec: [Vec<f64>; 2],
    /// Block of time in which the row was predicted from the others.
    pub fold: Vec<u32>,
    /// Rows left out of the rms figures.
    pub outlier: Vec<bool>,
}

/// Attitude residuals, one entry a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AttitudeResiduals {
    /// Times, s.
    pub t_s: Vec<f64>,
    /// Residual about x, y, z under the declared model, arcsec.
    pub before_arcsec: [Vec<f64>; 3],
    /// Residual about x, y, z with the effects found, arcsec.
    pub after_arcsec: [Vec<f64>; 3],
    /// Block of time in which the frame was predicted from the others.
    pub fold: Vec<u32>,
    /// Frames left out of the rms figures.
    pub outlier: Vec<bool>,
}

/// Dark level of single pixels, detector coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DarkMap {
    /// Centre of the pixel along x, px.
    pub x_px: Vec<f64>,
    /// Centre of the pixel along y, px.
    pub y_px: Vec<f64>,
    /// Level, in the unit of the images.
    pub dn: Vec<f64>,
    /// Its 1 sigma.
    pub sigma_dn: Vec<f64>,
}

impl StarResiduals {
    /// Writes `residuals_stars.parquet`.
    ///
    /// # Errors
    ///
    /// What the operating system says.
    ///
    /// # Panics
    ///
    /// If columns differ in length.
    pub fn write(&self, output: &Output) -> Result<(), TelemetryError> {
        let rows = self.t_s.len();
        assert_eq!((self.slot.len(), self.star_id.len()), (rows, rows));
        let mut table = OutTable::new(rows);
        table.numbers("t_s", &self.t_s);
        table.integers_by("slot", |row| i64::from(self.slot[row]));
        table.integers_by("star_id", |row| self.star_id[row]);
        table.numbers("x_px", &self.x_px);
        table.numbers("y_px", &self.y_px);
        residuals(&mut table, "before", &self.before_arcsec);
        residuals(&mut table, "after", &self.after_arcsec);
        folds(&mut table, &self.fold, &self.outlier);
        write(
            &table,
            output,
            "residuals_stars.parquet",
            TableFormat::Parquet,
        )
    }
}

impl AttitudeResiduals {
    /// Writes `residuals_attitude.parquet`.
    ///
    /// # Errors
    ///
    /// What the operating system says.
    ///
    /// # Panics
    ///
    /// If columns differ in length.
    pub fn write(&self, output: &Output) -> Result<(), TelemetryError> {
        let mut table = OutTable::new(self.t_s.len());
        table.numbers("t_s", &self.t_s);
        residuals(&mut table, "before", &self.before_arcsec);
        residuals(&mut table, "after", &self.after_arcsec);
        folds(&mut table, &self.fold, &self.outlier);
        write(
            &table,
            output,
            "residuals_attitude.parquet",
            TableFormat::Parquet,
        )
    }
}

impl DarkMap {
    /// Writes `dark_map.csv`.
    ///
    /// # Errors
    ///
    /// What the operating system says.
    ///
    /// # Panics
    ///
    /// If columns differ in length.
    pub fn write(&self, output: &Output) -> Result<(), TelemetryError> {
        let mut table = OutTable::new(self.x_px.len());
        table.numbers("x_px", &self.x_px);
        table.numbers("y_px", &self.y_px);
        table.numbers("dn", &self.dn);
        table.numbers("sigma_dn", &self.sigma_dn);
        write(&table, output, "dark_map.csv", TableFormat::Csv)
    }
}

fn residuals<'a>(table: &mut OutTable<'a>, when: &str, axes: &'a [Vec<f64>]) {
    for (axis, cells) in ["x", "y", "z"].into_iter().zip(axes) {
        table.numbers(format!("{when}_{axis}_arcsec"), cells);
    }
}

fn folds<'a>(table: &mut OutTable<'a>, fold: &'a [u32], outlier: &'a [bool]) {
    table.integers_by("fold", |row| i64::from(fold[row]));
    table.flags("outlier", outlier);
}

fn write(
    table: &OutTable<'_>,
    output: &Output,
    name: &str,
    format: TableFormat,
) -> Result<(), TelemetryError> {
    let label = output.target().join(name).display().to_string();
    table.write(format, BufWriter::new(output.create(name)?), &label)
}
