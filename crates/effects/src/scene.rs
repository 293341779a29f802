//! What an effect may look at: camera, time span, housekeeping, frames, stars.
//!
//! Not physics: what is on hand, nothing computed.

use std::collections::BTreeMap;

use focal_plane::{Camera, Series};
use nalgebra::Vector3;

use crate::WarmPixels;

/// Frame in which housekeeping vectors are given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VectorFrame {
    /// Spacecraft body: the frame of the boresights of [`FrameGeometry`].
    Body,
    /// ICRF/J2000.
    Inertial,
    /// Tracker axes.
    Tracker,
}

/// How housekeeping vectors and the reference relate to the tracker (`[frames]` of a bundle).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameGeometry {
    /// The tracker's boresight in the frame of the vectors, unit.
    pub tracker_boresight: Option<Vector3<f64>>,
    /// The reference camera's boresight in the frame of the vectors, unit; `None` when the reference
    /// is not another camera.
    pub reference_boresight: Option<Vector3<f64>>,
    /// Frame of the vectors.
    pub vectors_in: VectorFrame,
    /// Sign of each quaternion axis against that frame; `None` when unknown.
    pub quaternion_signs: Option<[f64; 3]>,
}

/// What an effect may look at when it is built from its parameters.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    /// The tracker's camera.
    pub camera: &'a Camera,
    /// First and last time of the data or run, s.
    pub span_s: [f64; 2],
    /// Housekeeping channels by name.
    pub channels: &'a BTreeMap<String, Series>,
    /// Relation of vectors to the tracker, if known.
    pub frames: Option<FrameGeometry>,
}

impl Surroundings<'_> {
    /// Middle of the span, s.
    pub fn middle_s(&self) -> f64 {
        0.5 * (self.span_s[0] + self.span_s[1])
    }

    /// Length of the span, s.
    pub fn length_s(&self) -> f64 {
        self.span_s[1] - self.span_s[0]
    }
}

/// A star as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StarFacts {
    /// Identity in the bundle.
    pub star_id: i64,
    /// Magnitude; NaN unknown.
    pub mag: f64,
    /// Colour B - V; NaN unknown.
    pub bv: f64,
    /// How far its mean residual is from nothing: square over that of its sigma, but for a unit that all
    /// stars share. Of many stars, those with most are tried by themselves.
    pub remarkable: f64,
}

/// The data that candidates are to explain.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// Camera, span, channels, frames.
    pub surroundings: Surroundings<'a>,
    /// Whether there are centroids.
    pub has_stars: bool,
    /// Whether stars have catalogue directions (otherwise each direction is a constant unknown).
    pub has_catalogue: bool,
    /// Whether there is a reference attitude (given, or made from rates).
    pub has_reference: bool,
    /// Whether the tracker's own attitude is there.
    pub has_attitude: bool,
    /// Stars seen, each once.
    pub stars: &'a [StarFacts],
    /// Declared exposure, s, if the bundle or model names one.
    pub exposure_s: Option<f64>,
    /// Median step between frames, s; infinite for one frame.
    pub step_s: f64,
    /// Pixels that may be warm, of those that stars have been on.
    pub warm: Option<&'a WarmPixels>,
}

impl Scene<'_> {
    /// Time between frames, s; none of one frame.
    pub(crate) fn between_s(&self) -> Option<f64> {
        Some(self.step_s).filter(|s| s.is_finite())
    }

    /// Whether a rotation of the whole tracker shows: against a reference only, because otherwise every
    /// frame's attitude is free.
    pub fn sees_misalignment(&self) -> bool {
        self.has_reference && (self.has_stars || self.has_attitude)
    }
}
