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
//! Source: docs/formats/report.md for what *before*, *after*, the folds and the figures mean.

use telemetry::{Bundle, Model};

use crate::attitude;
use crate::conventions;
use crate::declared;
use crate::error::CloseError;
use crate::outcome::Closed;
use crate::questions::hypothesis::Questions;
use crate::situation::Situation;
use crate::star;
use crate::undetermined;

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
    let closed = if bundle.stars.is_some() {
        star::run(&situation, progress)
    } else {
        attitude::run(&situation, progress)
    };
    closed.map_err(|error| undetermined::in_words(error, model, bundle))
}
