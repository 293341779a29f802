//! The loop: residual, cause, better model, residual again.
//!
//! One pipeline for every kind of bundle. Stars are the measurement where there
//! are any, the attitude otherwise; a reference, a catalogue and raw images are
//! each optional and only change what is unknown.
//!
//! ```text
//! measurement -> before residual -> outliers -> candidates -> search -> after residual -> leftover
//! ```
//!
//! Source: formats.md of the design notes (`close` writes) for what *before*,
//! *after*, the folds and the figures mean.

use std::sync::Arc;

use effects::Candidate;
use telemetry::report::Report;
use telemetry::{AttitudeResiduals, Bundle, DarkMap, Model, StarResiduals};

use crate::attitude;
use crate::conventions;
use crate::declared;
use crate::error::CloseError;
use crate::questions::hypothesis::Questions;
use crate::situation::Situation;
use crate::star;

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

/// Closes the loop between `model` and `bundle`. `progress` hears what is being
/// done, in words.
///
/// # Errors
/// When model and bundle do not fit together, nothing can be compared, or too
/// little data is left; see [`CloseError`].
pub fn close(
    model: &Model,
    bundle: &Bundle,
    progress: &dyn Fn(&str),
) -> Result<Closed, CloseError> {
    close_asking(model, bundle, &Questions::default(), progress)
}

/// As [`close`], and answers `questions` about effects of the catalogue: `hypotheses` of the report.
///
/// # Errors
/// Those of [`close`].
pub fn close_asking(
    model: &Model,
    bundle: &Bundle,
    questions: &Questions,
    progress: &dyn Fn(&str),
) -> Result<Closed, CloseError> {
    let situation = Situation::join(model, bundle, questions)?;
    conventions::check(&situation)?;
    declared::refuse_on_images(&situation)?;
    if bundle.stars.is_some() {
        star::run(&situation, progress)
    } else {
        attitude::run(&situation, progress)
    }
}

/// Candidates of every effect of the catalogue that the scene allows.
pub(crate) fn catalogue_candidates(scene: &effects::Scene<'_>) -> Vec<Arc<dyn Candidate>> {
    effects::catalogue()
        .iter()
        .flat_map(|kind| kind.candidates(scene))
        .map(Arc::from)
        .collect()
}
