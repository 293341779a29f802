//! `bundle.toml`: what the tables mean.
//!
//! ```text
//! instant of a row = epoch + epoch_offset_s + t_s      in time_scale
//! ```
//!
//! Source: telemetry bundle format (docs/formats/bundle.md).

pub(crate) mod read;

use std::collections::BTreeMap;

use focal_plane::Camera;
use nalgebra::Vector3;
use serde::Serialize;

use crate::time::{Epoch, TimeScale};

/// The value of `format` in `bundle.toml`.
pub const BUNDLE_FORMAT: &str = "boresight-bundle/1";

/// Everything in `bundle.toml`. Keys that are absent are `None`, unless a default is named.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Metadata {
    /// Free text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Where the data come from: free text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// Terms of use: free text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub licence: Option<String>,
    /// Date from which times count.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub epoch: Option<Epoch>,
    /// Seconds to add to every time; default 0.
    pub epoch_offset_s: f64,
    /// Time scale of the epoch.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_scale: Option<TimeScale>,
    /// Rate of the frames; `None` for unrelated snapshots.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample_rate_hz: Option<f64>,
    /// Julian year of the positions in table `catalog`; default 2000.0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub catalog_epoch_year: Option<f64>,
    /// The tracker's camera.
    #[serde(skip_serializing_if = "TrackerMeta::is_default")]
    pub tracker: TrackerMeta,
    /// The windows of table `images`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub images: Option<ImagesMeta>,
    /// How housekeeping vectors relate to the tracker.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<Frames>,
    /// Renamed columns: table, our name, the source's name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: BTreeMap<String, BTreeMap<String, String>>,
}

impl Metadata {
    /// The metadata as a file.
    pub(crate) fn to_toml(&self) -> Result<String, toml::ser::Error> {
        #[derive(Serialize)]
        struct File<'a> {
            format: &'static str,
            #[serde(flatten)]
            meta: &'a Metadata,
        }
        toml::to_string(&File {
            format: BUNDLE_FORMAT,
            meta: self,
        })
    }

    /// Julian year at time `t_s` of the tables, in the bundle's own time scale (a minute more or
    /// less moves no star); `None` without an epoch.
    #[must_use]
    pub fn julian_year(&self, t_s: f64) -> Option<f64> {
        Some(self.epoch?.julian_year(self.epoch_offset_s + t_s))
    }
}

/// `[tracker]` of a bundle.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TrackerMeta {
    /// Pixels along x and y.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixels: Option<[u32; 2]>,
    /// Focal length, px; never beside `fov_deg`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal_length_px: Option<f64>,
    /// Whole field of view along x and y, deg; never beside `focal_length_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fov_deg: Option<[f64; 2]>,
    /// Exposure, s. Metadata: by itself it adds no smear.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure_s: Option<f64>,
    /// 0.5 (default): whole numbers are pixel edges; 0.0: whole numbers are pixel centres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_centre: Option<f64>,
}

impl TrackerMeta {
    /// Describes a camera.
    #[must_use]
    pub fn of_camera(camera: &Camera, exposure_s: Option<f64>) -> Self {
        let [x_px, y_px] = camera.focal_length_px();
        // a fov with two slightly different focal lengths can only be given as a fov
        #[expect(clippy::float_cmp, reason = "either one number was given, or two")]
        let single = x_px == y_px;
        Self {
            pixels: Some(camera.pixels()),
            focal_length_px: single.then_some(x_px),
            fov_deg: (!single).then(|| camera.fov().map(focal_plane::Angle::deg)),
            exposure_s,
            pixel_centre: Some(camera.pixel_centre()),
        }
    }

    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// `[images]` of a bundle.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ImagesMeta {
    /// Columns (along x) and rows (along y) of a window.
    pub size: [usize; 2],
    /// Row and column of each pixel that is never read out, counted from 0.
    #[serde(serialize_with = "crate::pixel_name::serialize_all")]
    pub unread: Vec<[usize; 2]>,
}

/// `[frames]` of a bundle: how housekeeping vectors relate to the tracker.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Frames {
    /// The tracker's boresight in the frame of the vectors, unit.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "vector")]
    pub tracker_boresight: Option<Vector3<f64>>,
    /// The reference camera's boresight in the frame of the vectors, unit.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "vector")]
    pub reference_boresight: Option<Vector3<f64>>,
    /// Frame of vectors in housekeeping.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vectors_in: Option<VectorFrame>,
    /// Sign of each quaternion axis against that frame.
    pub quaternion_signs: QuaternionSigns,
}

fn vector<S: serde::Serializer>(v: &Option<Vector3<f64>>, to: S) -> Result<S::Ok, S::Error> {
    v.map(|v| [v.x, v.y, v.z]).serialize(to)
}

/// The frame in which housekeeping gives its vectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum VectorFrame {
    /// Spacecraft body.
    Body,
    /// ICRF/J2000.
    Inertial,
    /// Tracker axes.
    Tracker,
}

/// Sign of each quaternion axis against the frame of the vectors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum QuaternionSigns {
    /// The source does not say.
    #[default]
    Unknown,
    /// 1 or -1 for each axis.
    Known([f64; 3]),
}

impl QuaternionSigns {
    /// The signs, if they are known.
    #[must_use]
    pub fn known(self) -> Option<[f64; 3]> {
        match self {
            Self::Unknown => None,
            Self::Known(signs) => Some(signs),
        }
    }
}

impl Serialize for QuaternionSigns {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Unknown => to.serialize_str("unknown"),
            Self::Known(signs) => signs
                .map(|sign| if sign < 0.0 { -1 } else { 1 })
                .serialize(to),
        }
    }
}
