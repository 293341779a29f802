//! Reading and checking `bundle.toml`.
//!
//! Source: telemetry bundle format (docs/formats/bundle.md).

use std::collections::BTreeMap;

use focal_plane::{Camera, CameraError};
use nalgebra::Vector3;

use super::{
    BUNDLE_FORMAT, Frames, ImagesMeta, Metadata, QuaternionSigns, TrackerMeta, VectorFrame,
};
use crate::config::{Config, Entry, Section, nearest};
use crate::time::{Epoch, TimeScale};
use crate::{TelemetryError, layout, pixel_name};

const TOP: &[&str] = &[
    "format",
    "title",
    "source",
    "licence",
    "epoch",
    "epoch_offset_s",
    "time_scale",
    "sample_rate_hz",
    "catalog_epoch_year",
    "tracker",
    "images",
    "frames",
    "columns",
];
const TRACKER: &[&str] = &[
    "pixels",
    "focal_length_px",
    "fov_deg",
    "exposure_s",
    "pixel_centre",
];
const IMAGES: &[&str] = &["size", "unread"];
const FRAMES: &[&str] = &[
    "tracker_boresight",
    "reference_boresight",
    "vectors_in",
    "quaternion_signs",
];

/// Where a key that stands in the wrong table belongs.
const PLACES: &[(&str, &[&str])] = &[
    ("[tracker]", TRACKER),
    ("[images]", IMAGES),
    ("[frames]", FRAMES),
    ("the top of the file, above the first [table]", TOP),
];

/// Largest departure of a given boresight's length from 1: four digits, as people write them.
const UNIT_TOLERANCE: f64 = 1e-3;

pub(crate) fn read(config: &Config) -> Result<Metadata, TelemetryError> {
    let top = config.root();
    top.allow_or_point(TOP, PLACES)?;
    format(&top, BUNDLE_FORMAT)?;
    Ok(Metadata {
        title: top.text("title")?,
        source: top.text("source")?,
        licence: top.text("licence")?,
        epoch: top.entry("epoch").map(|e| epoch(&e)).transpose()?,
        epoch_offset_s: top.number("epoch_offset_s")?.unwrap_or(0.0),
        time_scale: top
            .entry("time_scale")
            .map(|e| e.choice(&TimeScale::NAMES))
            .transpose()?,
        sample_rate_hz: top.positive("sample_rate_hz")?,
        catalog_epoch_year: top.entry("catalog_epoch_year").map(year).transpose()?,
        tracker: match top.section("tracker")? {
            Some(section) => tracker(&section)?,
            None => TrackerMeta::default(),
        },
        images: top.section("images")?.map(|s| images(&s)).transpose()?,
        frames: top.section("frames")?.map(|s| frames(&s)).transpose()?,
        columns: match top.section("columns")? {
            Some(section) => columns(&section)?,
            None => BTreeMap::new(),
        },
    })
}

/// The key `format` must be there and say this.
pub(crate) fn format(top: &Section<'_>, format: &str) -> Result<(), TelemetryError> {
    let entry = top.require("format")?;
    if entry.text()? == format {
        Ok(())
    } else {
        Err(entry.expected(&format!("{format:?}")))
    }
}

fn epoch(entry: &Entry<'_>) -> Result<Epoch, TelemetryError> {
    entry
        .text()
        .ok()
        .and_then(Epoch::parse)
        .ok_or_else(|| entry.expected("a date and time such as \"2018-07-25T12:00:00\""))
}

fn year(entry: Entry<'_>) -> Result<f64, TelemetryError> {
    entry
        .number()
        .ok()
        .filter(|year| (1800.0..=2200.0).contains(year))
        .ok_or_else(|| entry.expected("a Julian year from 1800 to 2200, such as 2000.0"))
}

fn tracker(section: &Section<'_>) -> Result<TrackerMeta, TelemetryError> {
    section.allow_or_point(TRACKER, PLACES)?;
    let optics = optics(section)?;
    Ok(TrackerMeta {
        exposure_s: section.non_negative("exposure_s")?,
        ..optics
    })
}

/// The keys that describe a camera, the same in bundles and models; `exposure_s` is left out.
pub(crate) fn optics(section: &Section<'_>) -> Result<TrackerMeta, TelemetryError> {
    if let (Some(_), Some(second)) = (section.entry("focal_length_px"), section.entry("fov_deg")) {
        return Err(second
            .error_at_key("expected either `focal_length_px` or `fov_deg`, found both of them"));
    }
    let optics = TrackerMeta {
        pixels: section
            .entry("pixels")
            .map(|e| pair(&e, 1, "pixels"))
            .transpose()?,
        focal_length_px: section.positive("focal_length_px")?,
        fov_deg: section.numbers("fov_deg")?,
        exposure_s: None,
        pixel_centre: section.number("pixel_centre")?,
    };
    // what cannot be a camera is an error here, where its line is known
    let pixels = optics.pixels.unwrap_or([1024, 1024]);
    let blame = |key: &str, error: CameraError| match section.entry(key) {
        Some(entry) => entry.error(format!("`{key}`: {error}")),
        None => section.error(error.to_string()),
    };
    if let Some(fov_deg) = optics.fov_deg
        && (optics.pixels.is_some() || fov_deg.iter().any(|f| !(*f > 0.0 && *f < 180.0)))
    {
        Camera::from_fov_deg(pixels, fov_deg).map_err(|e| blame("fov_deg", e))?;
    }
    if let Some(centre) = optics.pixel_centre {
        Camera::from_focal_length_px(pixels, 1.0)
            .and_then(|camera| camera.with_pixel_centre(centre))
            .map_err(|e| blame("pixel_centre", e))?;
    }
    Ok(optics)
}

/// The camera that the keys describe; `None` without pixels or without a focal length.
pub(crate) fn camera(optics: &TrackerMeta) -> Result<Option<Camera>, CameraError> {
    let Some(pixels) = optics.pixels else {
        return Ok(None);
    };
    let camera = match (optics.focal_length_px, optics.fov_deg) {
        (Some(focal_length_px), _) => Camera::from_focal_length_px(pixels, focal_length_px)?,
        (None, Some(fov_deg)) => Camera::from_fov_deg(pixels, fov_deg)?,
        (None, None) => return Ok(None),
    };
    match optics.pixel_centre {
        Some(centre) => camera.with_pixel_centre(centre).map(Some),
        None => Ok(Some(camera)),
    }
}

/// Two counts, each at least `least`.
fn pair(entry: &Entry<'_>, least: u32, of: &str) -> Result<[u32; 2], TelemetryError> {
    let items = entry.array::<2>(&format!("counts of {of}"))?;
    Ok([items[0].count(least)?, items[1].count(least)?])
}

fn images(section: &Section<'_>) -> Result<ImagesMeta, TelemetryError> {
    section.allow_or_point(IMAGES, PLACES)?;
    let entry = section.require("size")?;
    let size = pair(&entry, 1, "pixels")?.map(|n| n as usize);
    if size[0] * size[1] > MOST_WINDOW_PIXELS {
        return Err(entry.expected(&format!("a window of at most {MOST_WINDOW_PIXELS} pixels")));
    }
    let largest = size[0].max(size[1]);
    let mut unread = Vec::new();
    if let Some(entry) = section.entry("unread") {
        for item in entry.items()? {
            let pixel = item
                .text()
                .ok()
                .and_then(pixel_name::parse)
                .filter(|pixel| pixel.iter().all(|&index| index < largest))
                .ok_or_else(|| {
                    item.expected("the name of a pixel of the window, such as \"p05\"")
                })?;
            unread.push(pixel);
        }
    }
    Ok(ImagesMeta { size, unread })
}

/// Windows are small; a detector is not a window.
const MOST_WINDOW_PIXELS: usize = 10_000;

fn frames(section: &Section<'_>) -> Result<Frames, TelemetryError> {
    section.allow_or_point(FRAMES, PLACES)?;
    let signs = section.entry("quaternion_signs").map(|e| signs(&e));
    Ok(Frames {
        tracker_boresight: boresight(section, "tracker_boresight")?,
        reference_boresight: boresight(section, "reference_boresight")?,
        vectors_in: section
            .entry("vectors_in")
            .map(|e| e.choice(VECTOR_FRAMES))
            .transpose()?,
        quaternion_signs: signs.transpose()?.unwrap_or_default(),
    })
}

const VECTOR_FRAMES: &[(&str, VectorFrame)] = &[
    ("body", VectorFrame::Body),
    ("inertial", VectorFrame::Inertial),
    ("tracker", VectorFrame::Tracker),
];

fn boresight(section: &Section<'_>, key: &str) -> Result<Option<Vector3<f64>>, TelemetryError> {
    let Some(entry) = section.entry(key) else {
        return Ok(None);
    };
    let v = Vector3::from(entry.numbers::<3>()?);
    if (v.norm() - 1.0).abs() > UNIT_TOLERANCE {
        let norm = v.norm();
        return Err(entry.expected(&format!("a unit vector (this one has length {norm:.6})")));
    }
    Ok(Some(v.normalize()))
}

fn signs(entry: &Entry<'_>) -> Result<QuaternionSigns, TelemetryError> {
    if entry.text().is_ok_and(|text| text == "unknown") {
        return Ok(QuaternionSigns::Unknown);
    }
    entry
        .numbers::<3>()
        .ok()
        .filter(|signs| signs.iter().all(|&sign| [1.0, -1.0].contains(&sign)))
        .map(QuaternionSigns::Known)
        .ok_or_else(|| entry.expected("\"unknown\" or three signs such as [1, 1, -1]"))
}

fn columns(
    section: &Section<'_>,
) -> Result<BTreeMap<String, BTreeMap<String, String>>, TelemetryError> {
    section.allow(&layout::TABLES)?;
    let mut columns = BTreeMap::new();
    for entry in section.entries() {
        let table = entry.key();
        let mut renamed = BTreeMap::new();
        for entry in entry.table()?.entries() {
            let ours = entry.key();
            if !layout::has_column(table, ours) {
                let near = nearest(ours, &layout::column_names(table)).unwrap_or("none");
                return Err(entry.error_at_key(format!(
                    "table `{table}` has no column `{ours}`; the nearest that it has is `{near}`"
                )));
            }
            renamed.insert(ours.to_owned(), entry.text()?.to_owned());
        }
        columns.insert(table.to_owned(), renamed);
    }
    Ok(columns)
}
