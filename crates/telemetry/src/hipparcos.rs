//! The new reduction of the Hipparcos catalogue, as a CSV table.
//!
//! ```text
//! hip, ra_deg_icrs_ep1991.25, dec_deg_icrs_ep1991.25, plx_mas, pmra_cosdec_mas_yr, pmdec_mas_yr, hpmag, b_v
//! ```
//!
//! Positions are ICRS at epoch J1991.25; magnitudes are Hp, not V.
//!
//! Source: F. van Leeuwen, Astron. Astrophys. 474 (2007) 653; CDS catalogue I/311.

use std::io::{self, Read};

use focal_plane::{Catalogue, CatalogueStar};

use crate::{Place, TelemetryError};

/// Julian year of the catalogue's positions.
pub const EPOCH_YEAR: f64 = 1991.25;

const COLUMNS: [&str; 8] = [
    "hip",
    "ra_deg_icrs_ep1991.25",
    "dec_deg_icrs_ep1991.25",
    "plx_mas",
    "pmra_cosdec_mas_yr",
    "pmdec_mas_yr",
    "hpmag",
    "b_v",
];

/// Reads the table. Star ids are Hipparcos numbers; a colour that is absent is NaN.
///
/// ```
/// let table = "hip,ra_deg_icrs_ep1991.25,dec_deg_icrs_ep1991.25,plx_mas,pmra_cosdec_mas_yr,\
///     pmdec_mas_yr,hpmag,b_v\n32349,101.288541,-16.713143,379.21,-546.01,-1223.07,-1.0876,0.009\n";
/// let catalogue = telemetry::hipparcos::read(table.as_bytes())?;
/// assert_eq!(catalogue.index_of(32349), Some(0));
/// # Ok::<(), telemetry::TelemetryError>(())
/// ```
///
/// # Errors
///
/// A missing column, a cell that is no number, or a value that no star has.
pub fn read(reader: impl Read) -> Result<Catalogue, TelemetryError> {
    const FILE: &str = "Hipparcos table";
    let mut csv = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(reader);
    let refuse = |error: csv::Error| TelemetryError::io(FILE, "read", &io::Error::other(error));
    let header = csv.headers().map_err(refuse)?.clone();
    let mut at = [0; COLUMNS.len()];
    for (at, column) in at.iter_mut().zip(COLUMNS) {
        let found = header.iter().position(|name| name == column);
        *at = found.ok_or_else(|| TelemetryError::MissingColumn {
            file: FILE.into(),
            column: column.into(),
            header: header.iter().collect::<Vec<_>>().join(", "),
            hint: String::new(),
        })?;
    }
    let mut stars = Vec::new();
    for (row, record) in csv.records().enumerate() {
        let record = record.map_err(refuse)?;
        let number = |column: usize| {
            let cell = record.get(at[column]).unwrap_or("");
            let blank = column == COLUMNS.len() - 1 && cell.is_empty();
            let number = if blank {
                Some(f64::NAN)
            } else {
                cell.parse().ok()
            };
            number.ok_or_else(|| {
                let place = Place::Line(row as u64 + 2);
                TelemetryError::cell(
                    FILE,
                    place,
                    COLUMNS[column],
                    "a number",
                    format!("{cell:?}"),
                )
            })
        };
        let hip = record.get(at[0]).unwrap_or("");
        stars.push(CatalogueStar {
            id: hip.parse().map_err(|_| {
                let place = Place::Line(row as u64 + 2);
                TelemetryError::cell(FILE, place, "hip", "a whole number", format!("{hip:?}"))
            })?,
            ra_deg: number(1)?,
            dec_deg: number(2)?,
            parallax_mas: number(3)?,
            pm_ra_mas_yr: number(4)?,
            pm_dec_mas_yr: number(5)?,
            mag: number(6)?,
            bv: number(7)?,
        });
    }
    Catalogue::new(EPOCH_YEAR, stars).map_err(|error| TelemetryError::Inconsistent {
        table: FILE,
        reason: error.to_string(),
    })
}
