//! `report.json` and the machine-readable results of the other commands.
//!
//! A key that the data cannot give is `null` in the file and `None` (or NaN inside an array) here.
//!
//! Source: report format (docs/formats/report.md).

mod axes;
mod compare;

use std::collections::BTreeMap;
use std::fmt;
use std::io::Write as _;

use serde::{Deserialize, Deserializer, Serialize};

use crate::{Output, TelemetryError};

pub use axes::{
    ASSESS_FORMAT, AssessMethod, AssessReport, AxisFit, AxisPrinted, FIT_FORMAT, FitAxes,
    FitReport, PreferredModel, WithSigma,
};

pub use compare::{
    COMPARE_FORMAT, CompareReport, ComparedAxes, ComparedAxis, ComparedBand, ComparedKind,
    ComparedModel, StarSource,
};

/// The value of `format` in `report.json`.
pub const REPORT_FORMAT: &str = "boresight-report/1";

/// What a run of the closed loop found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`REPORT_FORMAT`].
    pub format: String,
    /// The finding in one word.
    pub verdict: Verdict,
    /// Number of blocks of time for out-of-fold prediction.
    pub folds: usize,
    /// Rows used and left out.
    pub rows: Rows,
    /// What became of the raw windows, where the bundle has them beside stars.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub windows: Option<Windows>,
    /// The declared model at its best.
    pub before: Errors,
    /// With the effects listed.
    pub after: Errors,
    /// What was added, in order.
    pub effects: Vec<FoundEffect>,
    /// What was not added.
    pub considered: Vec<ConsideredEffect>,
    /// What was asked about by name, in the order asked.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hypotheses: Vec<Hypothesis>,
    /// What is left.
    pub unattributed: Unattributed,
}

/// The finding in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing added, nothing left.
    Consistent,
    /// At least one catalogue effect, and nothing left.
    Explained,
    /// At least one catalogue effect, and something left.
    PartlyExplained,
    /// No catalogue effect, and something left.
    Unexplained,
}

/// Rows used and left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rows {
    /// Rows in the figures.
    pub used: usize,
    /// Rows beyond 8 robust sigma of the before residual.
    pub outliers: usize,
    /// Rows outside the span of the reference, or around which too little of it is known.
    pub outside_reference: usize,
}

/// What became of the raw windows beside the star rows.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Windows {
    /// Windows with the time and slot of a star row.
    pub used: usize,
    /// Windows that could not be used: of no star row, off the detector, or without values in most pixels.
    pub unused: usize,
    /// Star rows that have no window that can be used.
    pub rows_without: usize,
    /// Rows left out of search and figures because the others' centroids were formed anew and theirs could not be.
    pub rows_left_out: usize,
    /// Why no centroids were formed anew, in words; `None` where they were.
    pub not_formed: Option<String>,
}

/// Size of the residuals under a model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Star residual along x and y, rms over all stars and rows, arcsec.
    #[serde(deserialize_with = "nan_pair")]
    pub star_rms_arcsec: Option<[f64; 2]>,
    /// Attitude residual about x, y, z, rms, arcsec.
    #[serde(deserialize_with = "nan_triple")]
    pub attitude_rms_arcsec: Option<[f64; 3]>,
    /// \[M23\] Eq. 19 between measured and model PSD of the attitude residual, per degree of freedom.
    #[serde(deserialize_with = "nan_triple")]
    pub log_psd_cost: Option<[f64; 3]>,
    /// Chi-squared per degree of freedom.
    pub chi2_per_dof: Option<f64>,
    /// Out-of-fold log-likelihood per frame, nats.
    pub loglik_per_frame: Option<f64>,
}

/// An estimated parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Value.
    #[serde(deserialize_with = "nan")]
    pub value: f64,
    /// 1 sigma.
    pub sigma: Option<f64>,
    /// Unit.
    pub unit: String,
    /// Where the error is not Gaussian (an instant): bounds that hold the truth with 95 %.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<[f64; 2]>,
}

/// An effect that was added.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundEffect {
    /// Name in the catalogue, or `empirical`.
    pub id: String,
    /// What is not a number to estimate: `star_id`, `channel`, `slot`.
    pub selectors: BTreeMap<String, Selector>,
    /// Parameters by name, estimated jointly with all others.
    pub parameters: BTreeMap<String, Estimate>,
    /// Gain in out-of-fold log-likelihood, nats.
    #[serde(deserialize_with = "nan")]
    pub delta_loglik: f64,
    /// Chance of such a gain without the effect, the whole search paid for.
    #[serde(deserialize_with = "nan")]
    pub p_value: f64,
    /// Share of the before variance, out of fold.
    pub variance_explained: Option<f64>,
    /// Effects that this data can hardly tell from it.
    pub confusable_with: Vec<Confusable>,
}

/// The value of a selector.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Selector {
    /// A whole number: a star or a slot.
    Integer(i64),
    /// A name: a channel or a file.
    Text(String),
}

impl fmt::Display for Selector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Integer(i) => i.fmt(f),
            Self::Text(t) => t.fmt(f),
        }
    }
}

/// `selectors` in a row: `channel = bracket_c`.
pub fn listed(selectors: &BTreeMap<String, Selector>) -> String {
    let each = selectors.iter().map(|(k, v)| format!("{k} = {v}"));
    each.collect::<Vec<_>>().join(", ")
}

impl From<&str> for Selector {
    /// Whole numbers become numbers.
    fn from(text: &str) -> Self {
        text.parse()
            .map_or_else(|_| Self::Text(text.into()), Self::Integer)
    }
}

/// An effect that looks alike in this data: another one, or the same on another channel or star.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Confusable {
    /// Name in the catalogue.
    pub id: String,
    /// What it acts on, where it acts on one of several.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub selectors: BTreeMap<String, Selector>,
    /// Largest correlation of the two estimates.
    #[serde(deserialize_with = "nan")]
    pub correlation: f64,
    /// What it gains in place of the effect, nats, out of fold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delta_loglik: Option<f64>,
    /// Sigmas by which this data tells the two apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub separation_sigma: Option<f64>,
    /// A motion that would tell them apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub manoeuvre: Option<Manoeuvre>,
}

/// A motion, and how far it tells two effects apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manoeuvre {
    /// `slew`, `to_and_fro` or `drift`.
    pub kind: String,
    /// Axis in the tracker, unit.
    pub axis: [f64; 3],
    /// Greatest rate, deg/s.
    pub rate_deg_s: f64,
    /// From rest to rest, s.
    pub duration_s: f64,
    /// Of each rise and fall of the rate, s; 0: the rate is constant.
    pub ramp_s: f64,
    /// Sigmas by which it tells the two apart; below 5 it is the best of those tried.
    #[serde(deserialize_with = "nan")]
    pub sigma: f64,
    /// The same as a sentence.
    pub text: String,
}

/// One effect that was asked about.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hypothesis {
    /// Name in the catalogue.
    pub id: String,
    /// Of its forms the one that fits best.
    pub selectors: BTreeMap<String, Selector>,
    /// Whether it was added.
    pub added: bool,
    /// Whether it stands beside what was added.
    pub significant: bool,
    /// Whether this data can show it at all.
    pub observable: bool,
    /// Why not.
    pub reason: Option<String>,
    /// Gain in out-of-fold log-likelihood beside the other effects added, nats.
    pub delta_loglik: Option<f64>,
    /// Chance of such a gain without the effect, the whole search paid for.
    pub p_value: Option<f64>,
    /// The size for which it was refused although it is significant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<RefusedSize>,
    /// Its sizes, one a coefficient.
    pub sizes: Vec<HypothesisSize>,
    /// Share of the squared residual beside the other effects added that its best fit takes away, in sample.
    pub variance_share: Option<f64>,
    /// The most that it could take away, with 95 %.
    pub variance_share_at_most: Option<f64>,
    /// The answer as a sentence.
    pub finding: String,
}

/// One size of an effect that was asked about, in `unit`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HypothesisSize {
    /// The parameter whose size is meant.
    pub parameter: String,
    /// Its unit.
    pub unit: String,
    /// Best fit.
    pub value: Option<f64>,
    /// 1 sigma of it; where the size enters in square, half the interval of 1 sigma.
    pub sigma: Option<f64>,
    /// What this data would have shown at 5 sigma.
    pub detectable: Option<f64>,
    /// At which it would explain by itself what is left beside the other effects added.
    pub needed: Option<f64>,
    /// At which it would explain by itself all that the declared model leaves: what the effects added explain, and
    /// what is left.
    pub needed_alone: Option<f64>,
    /// 1 sigma of the sizes that nature makes.
    pub plausible: Option<f64>,
    /// The largest size that is believed: the effect is named up to it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub believed_to: Option<f64>,
    /// Whether `needed` (or `needed_alone`) is believed.
    pub needed_is_plausible: Option<bool>,
}

/// An effect that was not added.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConsideredEffect {
    /// Name in the catalogue.
    pub id: String,
    /// Of its forms the one that fits best.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub selectors: BTreeMap<String, Selector>,
    /// Gain in out-of-fold log-likelihood, nats.
    pub delta_loglik: Option<f64>,
    /// Chance of such a gain without the effect.
    pub p_value: Option<f64>,
    /// Whether this motion can show it at all.
    pub observable: bool,
    /// Size that this data would have shown at 5 sigma, in `unit`.
    pub detectable: Option<f64>,
    /// Size at which it would explain the residual by itself, in `unit`.
    pub needed: Option<f64>,
    /// What speaks against it, where the search found it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub against: Option<String>,
    /// The parameter whose size is meant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parameter: Option<String>,
    /// Its unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// The size for which it was refused although it is significant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<RefusedSize>,
}

/// A size that no instrument has: its columns stand in for something else.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RefusedSize {
    /// The parameter whose size is meant.
    pub parameter: String,
    /// Its unit.
    pub unit: String,
    /// Best fit.
    pub value: f64,
    /// Least and largest that are believed.
    pub believed: [f64; 2],
}

/// What no effect explains.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Unattributed {
    /// Whether something is left.
    pub present: bool,
    /// Its share of the before variance.
    pub variance_fraction: Option<f64>,
    /// What it follows, what the data say most for first.
    pub depends_on: Vec<Dependence>,
    /// Frequencies of lines, Hz.
    pub lines_hz: Vec<f64>,
    /// Times of jumps, s.
    pub jumps_s: Vec<f64>,
    /// What the noise level follows, most certain first; shares are rms changes of its variance.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub noise_depends_on: Vec<Dependence>,
    /// The same of the noise that all stars of a frame share: the reference's, or that of time tags.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shared_noise_depends_on: Vec<Dependence>,
}

/// A variable that the leftover follows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dependence {
    /// Name from the list in the format, or two joined by `*`.
    pub variable: String,
    /// Share of the leftover's variance.
    #[serde(deserialize_with = "nan")]
    pub variance_explained: f64,
    /// Chance without dependence.
    #[serde(deserialize_with = "nan")]
    pub p_value: f64,
}

/// Writes `report.json`. Numbers that are not finite become `null`.
///
/// # Errors
///
/// What the operating system says.
pub fn write(report: &Report, output: &Output) -> Result<(), TelemetryError> {
    output.write("report.json", |to| {
        serde_json::to_writer_pretty(&mut *to, report)?;
        to.write_all(b"\n")
    })
}

/// Reads `null` as NaN: JSON has no other way to say it.
fn nan<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

fn nan_pair<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f64; 2]>, D::Error> {
    let read: Option<[Option<f64>; 2]> = Option::deserialize(from)?;
    Ok(read.map(|pair| pair.map(|x| x.unwrap_or(f64::NAN))))
}

fn nan_triple<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f64; 3]>, D::Error> {
    let read: Option<[Option<f64>; 3]> = Option::deserialize(from)?;
    Ok(read.map(|triple| triple.map(|x| x.unwrap_or(f64::NAN))))
}
