//! What `fit --json` and `assess --json` print.
//!
//! Source: report format (docs/formats/report.md).

use serde::{Deserialize, Serialize};

use super::{Rows, nan, nan_triple};

/// The value of `format` of a fit.
pub const FIT_FORMAT: &str = "boresight-fit/1";
/// The value of `format` of an assessment.
pub const ASSESS_FORMAT: &str = "boresight-assess/1";

/// White noise and FOGM fitted to each axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitReport {
    /// [`FIT_FORMAT`].
    pub format: String,
    /// The tracker's axes.
    pub axes: FitAxes,
    /// Frames used and left out; an outlier on any axis counts once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<Rows>,
    /// Rate of the frames, Hz; the mean one if they are irregular.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample_rate_hz: Option<f64>,
    /// From the first frame used to the last, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub span_s: Option<f64>,
    /// What a reader should know, in words: what the data cannot tell and why.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// The tracker's axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitAxes {
    /// About x.
    pub x: AxisFit,
    /// About y.
    pub y: AxisFit,
    /// About z, the boresight.
    pub z: AxisFit,
}

/// A value with its 1-sigma uncertainty; `None` where the data cannot give it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WithSigma {
    /// Value.
    pub value: Option<f64>,
    /// 1 sigma.
    pub sigma: Option<f64>,
    /// What remains possible with 95 %; an open end is `null`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<[Option<f64>; 2]>,
    /// Why there is no value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// One axis: true standard deviations of the sampled process (erratum E6).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisFit {
    /// Standard deviation of the FOGM process, arcsec.
    pub sigma_hsf_arcsec: WithSigma,
    /// Its correlation time, s.
    pub tau_hsf_s: WithSigma,
    /// Standard deviation of the white noise of one frame, arcsec.
    pub sigma_tn_arcsec: WithSigma,
    /// What \[M23\] Eq. 17-20 as printed return.
    pub as_printed: AxisPrinted,
    /// \[M23\] Eq. 19 at the minimum, per degree of freedom.
    #[serde(deserialize_with = "nan")]
    pub log_psd_cost: f64,
    /// The model that the data ask for.
    pub preferred: PreferredModel,
    /// Frames beyond 8 robust sigma on this axis, left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outliers: Option<usize>,
    /// Standard deviation of the residual, arcsec.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_arcsec: Option<f64>,
}

/// Parameters in the convention of the paper.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AxisPrinted {
    /// As [`AxisFit::sigma_hsf_arcsec`].
    pub sigma_hsf_arcsec: Option<f64>,
    /// As [`AxisFit::tau_hsf_s`].
    pub tau_hsf_s: Option<f64>,
    /// As [`AxisFit::sigma_tn_arcsec`].
    pub sigma_tn_arcsec: Option<f64>,
}

/// Which terms the data ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PreferredModel {
    /// FOGM and white noise.
    FogmWhite,
    /// White noise alone.
    White,
    /// FOGM alone.
    Fogm,
}

/// Noise of an orbit without a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AssessReport {
    /// [`ASSESS_FORMAT`].
    pub format: String,
    /// 1 sigma of everything about x, y, z, arcsec.
    #[serde(deserialize_with = "nan_triple")]
    pub total_arcsec: Option<[f64; 3]>,
    /// White noise, 1 sigma of one frame, arcsec.
    #[serde(deserialize_with = "nan_triple")]
    pub inherent_arcsec: Option<[f64; 3]>,
    /// Its uncertainty, arcsec.
    #[serde(deserialize_with = "nan_triple")]
    pub inherent_sigma_arcsec: Option<[f64; 3]>,
    /// What stood in for the truth.
    pub method: AssessMethod,
    /// Spans over which the noise stays level, s.
    pub plateau_s: Option<[f64; 2]>,
    /// White noise from the Allan deviation, arcsec.
    #[serde(deserialize_with = "nan_triple")]
    pub allan_white_arcsec: Option<[f64; 3]>,
}

/// What stood in for the truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AssessMethod {
    /// A torque-free rigid body.
    RigidRotator,
    /// Propagated gyro rates.
    Gyro,
    /// The table `reference`.
    Reference,
}
