//! The search beside a slow error that the model declares of the reference.
//!
//! What is declared is no finding, and no hypothesis: in a run as short as its correlation time it is told from a step or
//! a drift by nothing but the declaration. So everything is held against noise near the declared
//! ([`coloured_noise::Foreknown`]), fitted again beside what was chosen until that settles.
//!
//! Source: Aitken 1935 (generalised least squares).

use std::sync::Arc;

use block_regression::Folds;
use coloured_noise::{CommonNoise, Foreknown};
use effects::Candidate;

use super::Searched;
use super::alone::Begun;
use super::trial::Trial;
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::search::{Found, borrowed, fit_grams, search};
use crate::star::evidence::StarEvidence;
use crate::star::moments::StarMoments;

/// Rounds of search and noise.
const ROUNDS: usize = 4;

/// One search beside what is `known` of the reference's slow error.
pub(super) fn beside<'a>(
    white: &StarEvidence<'a>,
    folds: &Folds,
    candidates: Vec<Arc<dyn Candidate>>,
    may: &[bool],
    known: &[Option<Foreknown>; 3],
) -> Result<Searched<'a>, CloseError> {
    let mut noise = noise_of(white, folds, None, known)?;
    // beside slow noise an instant shows at itself alone, which no grid has: in the forms that suit white noise
    let (mut candidates, mut products) = in_white(white, folds, candidates, may)?;
    for round in 1.. {
        let level = white.with_noise(&noise);
        let moments = match products.take() {
            Some(products) => products,
            None => white.moments(folds, &borrowed(&candidates)),
        };
        let all: Vec<usize> = (0..moments.width()).collect();
        let grams = moments.under(&all, &noise);
        products = there_is_room(white, folds).then_some(moments);
        let fitted = fit_grams(&level, &grams, folds, &borrowed(&candidates))?;
        drop(grams);
        let found = search(&level, folds, candidates.clone(), may, Some(fitted))?;
        products.take_if(|_| !are_the_same(&found.candidates, &candidates));
        let better = noise_of(white, folds, Some(&found), known)?;
        if round == ROUNDS || better.is_like(&noise) {
            return Ok(Searched {
                found,
                evidence: Some(level),
                wander: None,
            });
        }
        candidates = found.candidates;
        noise = better;
    }
    Err(CloseError::Singular)
}

/// The forms in which a search on white evidence leaves the candidates, and their products if it has them.
fn in_white(
    white: &StarEvidence<'_>,
    folds: &Folds,
    candidates: Vec<Arc<dyn Candidate>>,
    may: &[bool],
) -> Result<(Vec<Arc<dyn Candidate>>, Option<StarMoments>), CloseError> {
    if white.drawn.is_some() {
        // white evidence is another one then
        let found = search(white, folds, candidates, may, None)?;
        return Ok((found.candidates, None));
    }
    let Begun {
        candidates,
        moments,
        plain,
    } = Begun::on(white, folds, candidates)?;
    let mut products = there_is_room(white, folds).then_some(moments);
    let found = search(white, folds, candidates.clone(), may, Some(plain))?;
    products.take_if(|_| !are_the_same(&found.candidates, &candidates));
    Ok((found.candidates, products))
}

/// Whether there is room for the products of some forms beside those of others.
fn there_is_room(white: &StarEvidence<'_>, folds: &Folds) -> bool {
    white.coarser(folds).is_none()
}

/// Whether no form is another one.
fn are_the_same(some: &[Arc<dyn Candidate>], others: &[Arc<dyn Candidate>]) -> bool {
    some.iter().zip(others).all(|(a, b)| Arc::ptr_eq(a, b))
}

/// The noise of what `found` leaves, or the declared model.
fn noise_of(
    white: &StarEvidence<'_>,
    folds: &Folds,
    found: Option<&Found>,
    known: &[Option<Foreknown>; 3],
) -> Result<CommonNoise, CloseError> {
    let chosen = found.map_or(&[][..], |f| &f.selection.chosen);
    let only = found.map(|f| f.only(chosen));
    let groups = found
        .zip(only.as_ref())
        .map_or_else(Vec::new, |(f, only)| only.groups(&f.fitted.groups, chosen));
    let moments = white.moments(
        folds,
        only.as_ref().map_or(&[][..], |only| &only.candidates),
    );
    let trial = Trial {
        moments: &moments,
        folds,
        precision: white.precision(),
        variance: white.variance_guess(),
        groups: &groups,
        cost: vec![1.0; groups.len()],
        all: None,
        single: true,
    };
    let all: Vec<usize> = (0..groups.len()).collect();
    let noise = trial.near(&trial.columns(&all), known);
    noise.ok_or(CloseError::Singular)
}
