//! A model: what is believed about a tracker.
//!
//! ```text
//! kind "pbm"   [tracker], [noise], [[effect]]      physics-based, [M23] Fig. 4
//! kind "hem"   [hem.x], [hem.y], [hem.z]           white + FOGM per axis, [M23] Fig. 5
//! ```
//!
//! Sigmas of `[hem]` are true standard deviations of the sampled process (erratum E6).
//!
//! Source: model format (docs/formats/model.md).

mod read;
mod write;

use std::collections::BTreeMap;
use std::path::Path;

use focal_plane::{Camera, CameraError};

use crate::config::Config;
use crate::metadata::read::camera;
use crate::{TelemetryError, TomlError, TrackerMeta};

/// The value of `format` in a model file.
pub const MODEL_FORMAT: &str = "boresight-model/1";

/// A model as its file gives it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Physics-based or high-fidelity error model.
    pub kind: ModelKind,
    /// Free text.
    pub title: Option<String>,
    /// The tracker; what is `None` is taken from the bundle where it has it.
    pub tracker: ModelTracker,
    /// Declared noise and fields.
    pub noise: ModelNoise,
    /// Parameters of `kind = "hem"`.
    pub hem: Option<HemAxes>,
    /// Declared effects, in the order of the file.
    pub effects: Vec<EffectEntry>,
    /// File the model was read from; empty if it was made in memory.
    pub file: String,
}

/// Kind of a model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ModelKind {
    /// Physics-based model.
    #[default]
    Pbm,
    /// High-fidelity error model of the attitude: white noise and FOGM per axis.
    Hem,
}

/// `[tracker]` of a model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelTracker {
    /// Pixels along x and y.
    pub pixels: Option<[u32; 2]>,
    /// Focal length, px; never beside `fov_deg`.
    pub focal_length_px: Option<f64>,
    /// Whole field of view along x and y, deg; never beside `focal_length_px`.
    pub fov_deg: Option<[f64; 2]>,
    /// 0.5 or 0.0, as in a bundle.
    pub pixel_centre: Option<f64>,
    /// Frames per second.
    pub update_rate_hz: Option<f64>,
    /// Stars followed at once.
    pub max_stars: Option<u32>,
    /// Exposure, s. By itself it adds no smear.
    pub exposure_s: Option<f64>,
}

/// `[noise]` of a model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelNoise {
    /// White noise per star, circular, 1 sigma, arcsec.
    pub temporal_arcsec: Option<f64>,
    /// Peak of the centroid error's triangle on each axis (\[M23\] Eq. 10 as printed), arcsec.
    pub centroid_arcsec: Option<f64>,
    /// Circular rms of the unknown distortion, arcsec.
    pub distortion_arcsec: Option<f64>,
    /// Order of its polynomials, 0 to 15; 7 if `None`.
    pub distortion_order: Option<u32>,
    /// 1 sigma of the unknown constant misalignment about x, y, z, arcsec; `None` is free.
    pub bias_arcsec: Option<[f64; 3]>,
}

/// `[hem]` of a model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HemAxes {
    /// About x.
    pub x: HemAxis,
    /// About y.
    pub y: HemAxis,
    /// About z, the boresight.
    pub z: HemAxis,
}

/// One axis of `[hem]`, consistent one-sided convention (erratum E6).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HemAxis {
    /// Standard deviation of the FOGM process, arcsec.
    pub sigma_hsf_arcsec: f64,
    /// Its correlation time, s.
    pub tau_hsf_s: f64,
    /// Standard deviation of the white noise of one frame, arcsec.
    pub sigma_tn_arcsec: f64,
}

/// One `[[effect]]`: its id in the catalogue, and its parameters.
#[derive(Clone, Debug, Default)]
pub struct EffectEntry {
    /// Name in the effects catalogue.
    pub id: String,
    /// Parameters and selectors by name.
    pub parameters: BTreeMap<String, EffectValue>,
    /// Where the entry and its keys stand in the file; empty if made in memory.
    pub at: EffectPlace,
}

/// Entries are equal when they say the same, wherever they stand.
impl PartialEq for EffectEntry {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id && self.parameters == other.parameters
    }
}

/// A parameter of an effect in a model file.
#[derive(Clone, Debug, PartialEq)]
pub enum EffectValue {
    /// A number, whole or not.
    Number(f64),
    /// A selector, such as the name of a channel.
    Text(String),
    /// Several numbers, such as the coefficients of an empirical term.
    Numbers(Vec<f64>),
}

impl EffectEntry {
    /// An entry made in memory.
    #[must_use]
    pub fn new(id: &str, parameters: BTreeMap<String, EffectValue>) -> Self {
        Self {
            id: id.into(),
            parameters,
            at: EffectPlace::default(),
        }
    }
}

/// Where an `[[effect]]` and its keys stand in a file; empty if made in memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EffectPlace {
    /// Its head, as an error without a message.
    head: Option<TomlError>,
    /// Its keys.
    keys: BTreeMap<String, TomlError>,
}

impl EffectPlace {
    /// Line of a key, or of the head if there is no such key, 1-based; 0 if made in memory.
    #[must_use]
    pub fn line(&self, key: &str) -> usize {
        let spot = self.keys.get(key).or(self.head.as_ref());
        spot.map_or(0, |spot| spot.line)
    }
}

impl Model {
    /// Reads a model file.
    ///
    /// # Errors
    ///
    /// The first mistake, with file, line and column.
    pub fn read(path: &Path) -> Result<Self, TelemetryError> {
        let text = std::fs::read_to_string(path)
            .map_err(|e| TelemetryError::io(path.display().to_string(), "read", &e))?;
        Self::parse(&text, &path.display().to_string(), &[])
    }

    /// Reads a model from text; `file` is its name in messages. Tables named in `ignored` are left
    /// to the caller: a scenario is a model plus `["motion", "sky", "run"]`.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn parse(text: &str, file: &str, ignored: &[&str]) -> Result<Self, TelemetryError> {
        read::read(&Config::parse(text, file)?, file, ignored)
    }

    /// The model as a file.
    #[must_use]
    pub fn to_toml(&self) -> String {
        write::write(self)
    }

    /// The camera that the model declares; `None` without pixels or without a focal length.
    ///
    /// # Errors
    ///
    /// Values that were changed after reading and no longer make a camera.
    pub fn camera(&self) -> Result<Option<Camera>, CameraError> {
        self.camera_over(&TrackerMeta::default())
    }

    /// The camera of this model over a bundle that describes itself as `meta`: what the model leaves out is the
    /// bundle's. A focal length and a field of view are one thing here: either of the model replaces both. `None` where
    /// the two together say too little.
    ///
    /// # Errors
    ///
    /// Values of both that make no camera together.
    pub fn camera_over(&self, meta: &TrackerMeta) -> Result<Option<Camera>, CameraError> {
        let own = &self.tracker;
        let of_model = own.focal_length_px.is_some() || own.fov_deg.is_some();
        let (focal_length_px, fov_deg) = if of_model {
            (own.focal_length_px, own.fov_deg)
        } else {
            (meta.focal_length_px, meta.fov_deg)
        };
        camera(&TrackerMeta {
            pixels: own.pixels.or(meta.pixels),
            focal_length_px,
            fov_deg,
            exposure_s: None,
            pixel_centre: own.pixel_centre.or(meta.pixel_centre),
        })
    }

    /// An error in an effect, shown at the value of its key (`id`, a parameter) if the model came
    /// from a file: for what only the effects catalogue can judge.
    pub fn effect_error(&self, index: usize, key: &str, message: &str) -> TelemetryError {
        self.effect_error_in_line(index, key, message)
            .unwrap_or_else(|| TelemetryError::Inconsistent {
                table: "model",
                reason: format!("effect {}: {message}", index + 1),
            })
    }

    /// The same where the model came from a file, and none where it was made in memory.
    pub fn effect_error_in_line(
        &self,
        index: usize,
        key: &str,
        message: &str,
    ) -> Option<TelemetryError> {
        let at = &self.effects.get(index)?.at;
        let spot = at.keys.get(key).or(at.head.as_ref())?;
        Some(TelemetryError::Toml(Box::new(TomlError {
            message: message.into(),
            ..spot.clone()
        })))
    }
}
