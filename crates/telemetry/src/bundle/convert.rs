//! From columns to tables: every value is judged here, and an error knows its row.
//!
//! Source: telemetry bundle format, "Bad input" (docs/formats/bundle.md).

use std::collections::HashMap;

use focal_plane::{
    Camera, Catalogue, CatalogueError, CatalogueStar, SPEED_OF_LIGHT_M_S, StarFrames,
};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::table::RawTable;
use crate::{AttitudeTable, Housekeeping, RateTable, ReferenceTable, TelemetryError, WindowTable};

/// Largest departure of a quaternion's norm from 1.
const NORM_TOLERANCE: f64 = 1e-6;
/// Departure that rounding alone explains: such quaternions are kept bit for bit.
const ROUNDING: f64 = 1e-15;
/// How far outside the detector a star or a window may lie, as a share of the side: noise and
/// distortion move stars over the edge.
const MARGIN: f64 = 0.05;
/// No spacecraft that looks at stars turns faster, rad/s.
const FASTEST_RAD_S: f64 = 100.0;
/// Magnitudes of everything that a tracker may see.
const MAGNITUDES: [f64; 2] = [-30.0, 30.0];
/// B-V of everything that shines like a star.
const COLOURS: [f64; 2] = [-5.0, 10.0];
/// Absolute zero, deg C.
const ZERO_C: f64 = -273.15;

type Result<T> = std::result::Result<T, TelemetryError>;

const QUATERNION: [&str; 4] = ["qx", "qy", "qz", "qw"];
const RATE: [&str; 3] = ["wx_rad_s", "wy_rad_s", "wz_rad_s"];
const SIGMA: [&str; 3] = ["sx_arcsec", "sy_arcsec", "sz_arcsec"];

pub(super) fn attitude(raw: &mut RawTable) -> Result<AttitudeTable> {
    let (t_s, q) = (times(raw)?, quaternions(raw)?);
    Ok(AttitudeTable { t_s, q })
}

pub(super) fn reference(raw: &mut RawTable) -> Result<ReferenceTable> {
    let (t_s, q) = (times(raw)?, quaternions(raw)?);
    let rates_rad_s = rate_vectors(raw)?;
    let sigma_arcsec = match raw.triple(SIGMA) {
        Some(columns) => {
            for (name, cells) in SIGMA.iter().zip(&columns) {
                within(raw, name, cells, [0.0, f64::INFINITY])?;
            }
            let [x, y, z] = columns;
            Some((0..x.len()).map(|i| [x[i], y[i], z[i]]).collect())
        }
        None => None,
    };
    Ok(ReferenceTable {
        t_s,
        q,
        rates_rad_s,
        sigma_arcsec,
    })
}

pub(super) fn rates(raw: &mut RawTable) -> Result<RateTable> {
    let t_s = times(raw)?;
    let w = rate_vectors(raw)?.unwrap_or_default();
    Ok(RateTable { t_s, w })
}

fn rate_vectors(raw: &mut RawTable) -> Result<Option<Vec<Vector3<f64>>>> {
    let Some(columns) = raw.triple(RATE) else {
        return Ok(None);
    };
    for (name, cells) in RATE.iter().zip(&columns) {
        within(raw, name, cells, [-FASTEST_RAD_S, FASTEST_RAD_S])?;
    }
    let [x, y, z] = columns;
    Ok(Some(
        (0..x.len())
            .map(|i| Vector3::new(x[i], y[i], z[i]))
            .collect(),
    ))
}

pub(super) fn stars(
    raw: &mut RawTable,
    camera: Option<&Camera>,
    catalog: Option<&Catalogue>,
) -> Result<StarFrames> {
    let row_t_s = raw.numbers("t_s");
    let slot = slots(raw)?;
    let star_id = raw.integers("star_id");
    if let Some(catalog) = catalog {
        let unknown = star_id
            .iter()
            .position(|&id| catalog.index_of(id).is_none());
        if let Some(row) = unknown {
            let known = format!("a star of table catalog ({} stars)", catalog.len());
            return Err(raw.error(row, &["star_id"], known, star_id[row].to_string()));
        }
    }
    let (t_s, first_row) = frames(raw, &row_t_s, &slot)?;
    let x_px = on_detector(raw, "x_px", 0, camera)?;
    let y_px = on_detector(raw, "y_px", 1, camera)?;
    let mag = raw.optional("mag");
    if let Some(mag) = &mag {
        within(raw, "mag", mag, MAGNITUDES)?;
    }
    Ok(StarFrames {
        t_s,
        first_row,
        slot,
        star_id,
        x_px,
        y_px,
        mag,
        flux: raw.optional("flux"),
    })
}

pub(super) fn images(raw: &mut RawTable, camera: Option<&Camera>) -> Result<WindowTable> {
    let t_s = raw.numbers("t_s");
    let slot = slots(raw)?;
    frames(raw, &t_s, &slot)?;
    let x0_px = on_detector(raw, "x0_px", 0, camera)?;
    let y0_px = on_detector(raw, "y0_px", 1, camera)?;
    let background = raw.numbers("background");
    let Some(pixels) = raw.pixels.take() else {
        return Ok(WindowTable::default());
    };
    Ok(WindowTable {
        t_s,
        slot,
        x0_px,
        y0_px,
        background,
        pixels: pixels.values,
        size: pixels.size,
        unread: pixels.unread,
    })
}

pub(super) fn catalog(raw: &mut RawTable, epoch_year: Option<f64>) -> Result<Catalogue> {
    let id = raw.integers("star_id");
    let mut first: HashMap<i64, usize> = HashMap::with_capacity(id.len());
    for (row, &star) in id.iter().enumerate() {
        if let Some(before) = first.insert(star, row) {
            let expected = format!("each star once (it is at {} already)", raw.place(before));
            return Err(raw.error(row, &["star_id"], expected, star.to_string()));
        }
    }
    let ra_deg = checked(raw, "ra_deg", [0.0, 360.0])?;
    let dec_deg = checked(raw, "dec_deg", [-90.0, 90.0])?;
    let mag = checked(raw, "mag", MAGNITUDES)?;
    let bv = checked(raw, "bv", COLOURS)?;
    let zeros = || vec![0.0; id.len()];
    let pm_ra = raw.optional("pm_ra_mas_yr").unwrap_or_else(zeros);
    let pm_dec = raw.optional("pm_dec_mas_yr").unwrap_or_else(zeros);
    let parallax = raw.optional("parallax_mas").unwrap_or_else(zeros);
    let stars = (0..id.len())
        .map(|i| CatalogueStar {
            id: id[i],
            ra_deg: ra_deg[i],
            dec_deg: dec_deg[i],
            mag: mag[i],
            bv: bv[i],
            pm_ra_mas_yr: pm_ra[i],
            pm_dec_mas_yr: pm_dec[i],
            parallax_mas: parallax[i],
        })
        .collect();
    // what the catalogue itself refuses is one of the columns that have no range of their own
    Catalogue::new(epoch_year.unwrap_or(2000.0), stars).map_err(|error| match error {
        CatalogueError::OutOfRange {
            id: star,
            name,
            value,
            range,
        } => {
            let row = first.get(&star).copied().unwrap_or(0);
            raw.error(row, &[name], range, value.to_string())
        }
        other => raw.error(0, &["star_id"], "a catalogue", other.to_string()),
    })
}

pub(super) fn housekeeping(raw: &mut RawTable) -> Result<Housekeeping> {
    let t_s = times(raw)?;
    let channels = std::mem::take(&mut raw.channels);
    for (name, cells) in &channels {
        let range = if name.ends_with("_km_s") {
            let limit = SPEED_OF_LIGHT_M_S * 1e-3;
            [-limit, limit]
        } else if name.ends_with("_m_s") {
            [-SPEED_OF_LIGHT_M_S, SPEED_OF_LIGHT_M_S]
        } else if name.ends_with("_on") {
            [0.0, 1.0]
        } else if name.ends_with("_c") {
            [ZERO_C, f64::INFINITY]
        } else if name.ends_with("_k") {
            [0.0, f64::INFINITY]
        } else {
            continue;
        };
        within(raw, name, cells, range)?;
    }
    Ok(Housekeeping { t_s, channels })
}

/// The times of a table with one row an instant.
fn times(raw: &mut RawTable) -> Result<Vec<f64>> {
    let t_s = raw.numbers("t_s");
    if let Some(at) = t_s.windows(2).position(|pair| pair[1] <= pair[0]) {
        let (before, place) = (t_s[at], raw.place(at));
        let expected = format!("a time later than {before} of {place}");
        return Err(raw.error(at + 1, &["t_s"], expected, t_s[at + 1].to_string()));
    }
    Ok(t_s)
}

/// Times and first rows of frames: rows that share a time, each slot once.
fn frames(raw: &RawTable, row_t_s: &[f64], slot: &[i32]) -> Result<(Vec<f64>, Vec<usize>)> {
    let mut t_s: Vec<f64> = Vec::new();
    let mut first_row = Vec::new();
    let mut seen: HashMap<i32, usize> = HashMap::new();
    let mut frame_start = 0;
    for (row, &time) in row_t_s.iter().enumerate() {
        match t_s.last() {
            Some(&last) if time < last => {
                let place = raw.place(row - 1);
                let expected = format!("a time not before {last} of {place}");
                return Err(raw.error(row, &["t_s"], expected, time.to_string()));
            }
            Some(&last) if time <= last => {}
            _ => {
                t_s.push(time);
                first_row.push(row);
                frame_start = row;
            }
        }
        if let Some(before) = seen.insert(slot[row], row)
            && before >= frame_start
        {
            let place = raw.place(before);
            let expected = format!("each slot once at {time} s (it is at {place} already)");
            return Err(raw.error(
                row,
                &["t_s", "slot"],
                expected,
                format!("slot {}", slot[row]),
            ));
        }
    }
    first_row.push(row_t_s.len());
    Ok((t_s, first_row))
}

fn quaternions(raw: &mut RawTable) -> Result<Vec<UnitQuaternion<f64>>> {
    let [x, y, z, w] = QUATERNION.map(|name| raw.numbers(name));
    let mut q = Vec::with_capacity(x.len());
    for row in 0..x.len() {
        let quaternion = Quaternion::new(w[row], x[row], y[row], z[row]);
        let norm = quaternion.norm();
        if (norm - 1.0).abs() > NORM_TOLERANCE {
            let expected = "a quaternion of norm 1 within 1e-6";
            return Err(raw.error(row, &QUATERNION, expected, format!("norm {norm}")));
        }
        q.push(if (norm - 1.0).abs() <= ROUNDING {
            UnitQuaternion::new_unchecked(quaternion)
        } else {
            UnitQuaternion::new_normalize(quaternion)
        });
    }
    Ok(q)
}

fn slots(raw: &mut RawTable) -> Result<Vec<i32>> {
    let slots = raw.integers("slot");
    let mut narrow = Vec::with_capacity(slots.len());
    for (row, &slot) in slots.iter().enumerate() {
        narrow.push(
            i32::try_from(slot)
                .map_err(|_| raw.error(row, &["slot"], "a number of 32 bits", slot.to_string()))?,
        );
    }
    Ok(narrow)
}

/// A column that the layout requires, with its range.
fn checked(raw: &mut RawTable, name: &str, range: [f64; 2]) -> Result<Vec<f64>> {
    let cells = raw.numbers(name);
    within(raw, name, &cells, range)?;
    Ok(cells)
}

/// Positions along one axis, which lie on the detector or close to it.
fn on_detector(
    raw: &mut RawTable,
    name: &str,
    axis: usize,
    camera: Option<&Camera>,
) -> Result<Vec<f64>> {
    let most = camera.map_or(f64::INFINITY, |camera| {
        camera.half_size_px()[axis] * (1.0 + 2.0 * MARGIN)
    });
    let cells = raw.numbers(name);
    let outside = |&&x: &&f64| x.abs() > most;
    if let Some(row) = cells.iter().position(|x| outside(&x)) {
        let half = camera.map_or(f64::INFINITY, |camera| camera.half_size_px()[axis]);
        let most = (100.0 * most).round() / 100.0;
        let expected = format!(
            "a place on the detector or near it, within {most} px of its centre ({half} px to the edge, and {} % of the side beyond)",
            100.0 * MARGIN
        );
        return Err(raw.error(row, &[name], expected, cells[row].to_string()));
    }
    Ok(cells)
}

/// Values within physical bounds; NaN is a missing value where it got this far.
fn within(raw: &RawTable, name: &str, cells: &[f64], [low, high]: [f64; 2]) -> Result<()> {
    match cells.iter().position(|&x| x < low || x > high) {
        None => Ok(()),
        Some(row) => {
            let expected = if high.is_finite() {
                format!("a value from {low} to {high}")
            } else {
                format!("a value not below {low}")
            };
            Err(raw.error(row, &[name], expected, cells[row].to_string()))
        }
    }
}
