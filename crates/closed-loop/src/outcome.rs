//! What a run of the loop hands back.
//!
//! Not physics: the form of an outcome.

use telemetry::report::Report;
use telemetry::{AttitudeResiduals, DarkMap, Model, StarResiduals};

/// Everything a run of the loop finds.
#[derive(Clone, Debug)]
pub struct Closed {
    /// The finished report.
    pub report: Report,
    /// The model with what was added.
    pub model: Model,
    /// Star residuals before and after, a row each.
    pub stars: Option<StarResiduals>,
    /// Attitude residuals before and after, a row each.
    pub attitude: Option<AttitudeResiduals>,
    /// The dark map, where one was estimated and adopted.
    pub dark_map: Option<DarkMap>,
    /// How rival explanations of the same leftover compare, each by itself.
    pub rivals: Vec<Rival>,
}

/// One explanation of a leftover beside others.
#[derive(Clone, Debug, PartialEq)]
pub struct Rival {
    /// What was tried: one effect, or several joined by `+`.
    pub what: String,
    /// Out-of-fold rms of each axis, arcsec: x and y of stars, or X, Y, Z of attitudes.
    pub rms_arcsec: Vec<f64>,
    /// Gain in out-of-fold log-likelihood over the declared model, nats.
    pub delta_loglik: f64,
}
