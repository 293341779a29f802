//! The machine-readable result of `compare`.
//!
//! Source: report format (docs/formats/report.md).

use serde::{Deserialize, Serialize};

use super::{Rows, nan};

/// The value of `format` of a comparison.
pub const COMPARE_FORMAT: &str = "boresight-compare/1";

/// Models beside what was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CompareReport {
    /// [`COMPARE_FORMAT`].
    pub format: String,
    /// Draws of each model.
    pub draws: u64,
    /// Seed of their random numbers.
    pub seed: u64,
    /// Frames used and left out; an outlier on any axis counts once.
    pub rows: Rows,
    /// Rate of the frames, Hz; the mean one if they are irregular.
    pub sample_rate_hz: f64,
    /// From the first frame used to the last, s.
    pub span_s: f64,
    /// Standard deviation of the measured residual about x, y, z, arcsec.
    pub measured_std_arcsec: [f64; 3],
    /// The model that was asked for.
    pub model: ComparedModel,
    /// Models beside it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<ComparedModel>,
    /// What a reader should know, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// A model against the measurement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ComparedModel {
    /// Its title or file.
    pub name: String,
    /// `pbm` or `hem`.
    pub kind: ComparedKind,
    /// Where its stars come from.
    pub stars: StarSource,
    /// The tracker's axes.
    pub axes: ComparedAxes,
}

/// Kind of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ComparedKind {
    /// Physics-based.
    Pbm,
    /// Hybrid empirical.
    Hem,
}

/// Where the stars of an ensemble come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StarSource {
    /// The stars of the bundle, frame by frame.
    Telemetry,
    /// The brightest of the bundle's catalogue in the field.
    Catalogue,
    /// Made up, with the replacement rule of \[M23\] Step 1.
    Generated,
    /// The model needs none.
    None,
}

/// The tracker's axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ComparedAxes {
    /// About x.
    pub x: ComparedAxis,
    /// About y.
    pub y: ComparedAxis,
    /// About z, the boresight.
    pub z: ComparedAxis,
}

/// One axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ComparedAxis {
    /// Standard deviation of the model's residual in its first draw, arcsec.
    pub model_std_arcsec: f64,
    /// Eq. 19 per degree of freedom: 1 for a residual that is a draw of the model.
    #[serde(deserialize_with = "nan")]
    pub log_psd_cost: f64,
    /// Share of bins above the model's 3 sigma bound.
    #[serde(deserialize_with = "nan")]
    pub above_3_sigma: f64,
    /// From low to high frequency.
    pub bands: Vec<ComparedBand>,
}

/// The log-PSD error in a band. Without a bin in it, everything but its ends is `null`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ComparedBand {
    /// Lower end, Hz; 0 is open.
    pub from_hz: f64,
    /// Upper end, Hz; `null` is half the rate.
    pub to_hz: Option<f64>,
    /// Bins in it.
    pub bins: usize,
    /// Mean of measured over modelled, dB (`10 log10` of the density): 0 for a model that is right.
    pub error_db: Option<f64>,
    /// Its standard deviation, if the residual were a draw of the model, dB.
    pub sigma_db: Option<f64>,
    /// Root mean square over the bins, dB.
    pub rms_db: Option<f64>,
    /// Eq. 19 per bin.
    pub cost: Option<f64>,
}
