//! Where the light falls at first sight.
//!
//! Fits beside a declared centroid error that is taken where the light does not fall are of no use but for telling
//! where it does. So what white evidence finds first takes the light along before anything is weighed, and the
//! search begins there.
//!
//! Not physics: the order of the steps.

use std::sync::Arc;

use block_regression::Folds;
use effects::Candidate;

use super::Searched;
use crate::declared::OnCentroids;
use crate::error::CloseError;
use crate::search::{Choice, Found, polish};
use crate::star::evidence::StarEvidence;
use crate::star::landing::{Elsewhere, takes_light_along};

/// Where a choice takes the light once it is polished; `None` where it does not seem to take it elsewhere.
pub(super) fn of_choice(
    white: &StarEvidence<'_>,
    folds: &Folds,
    choice: Choice<'_>,
    phase: &OnCentroids,
) -> Result<Option<Box<Elsewhere>>, CloseError> {
    if !seems_to_move_it(white, folds, choice, phase)? {
        return Ok(None);
    }
    let mut polished = choice.candidates.to_vec();
    polish(white, folds, &mut polished, choice.fitted, choice.chosen)?;
    of_forms(white, folds, &polished, choice.chosen, phase)
}

/// The same of what was found, polished, in a part of the data.
pub(super) fn of_part(
    white: &StarEvidence<'_>,
    folds: &Folds,
    searched: &Searched<'_>,
    phase: &OnCentroids,
) -> Result<Option<Box<Elsewhere>>, CloseError> {
    let choice = searched.found.choice();
    // what was fitted beside a slow error is in the unit of its noise
    let level = searched.evidence.as_ref().unwrap_or(white);
    if !seems_to_move_it(level, folds, choice, phase)? {
        return Ok(None);
    }
    of_forms(white, folds, choice.candidates, choice.chosen, phase)
}

/// Whether a choice, as it is, takes the light so far that it is worth polishing for that.
pub(super) fn seems_to_move_it(
    level: &StarEvidence<'_>,
    folds: &Folds,
    choice: Choice<'_>,
    phase: &OnCentroids,
) -> Result<bool, CloseError> {
    Ok(choice.moves_light() && takes_light_along(level, folds, choice, phase)?)
}

/// Where the chosen of `candidates` take the light, fitted as they are.
pub(super) fn of_forms(
    white: &StarEvidence<'_>,
    folds: &Folds,
    candidates: &[Arc<dyn Candidate>],
    chosen: &[usize],
    phase: &OnCentroids,
) -> Result<Option<Box<Elsewhere>>, CloseError> {
    let found = Found::of_chosen(white, folds, candidates, chosen)?;
    let mut elsewhere = Elsewhere::of(white, folds, found.choice(), phase)?;
    if let Some(elsewhere) = &mut elsewhere {
        // their places among all
        for ((place, _), &g) in elsewhere.forms.iter_mut().zip(chosen) {
            *place = g;
        }
    }
    Ok(elsewhere)
}
