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
    let mut forms = Forms::in_white(white, folds, candidates, may)?;
    for round in 1.. {
        let level = white.with_noise(&noise);
        let found = forms.searched(white, &level, folds, may)?;
        let better = noise_of(white, folds, Some(&found), known)?;
        if round == ROUNDS || better.is_like(&noise) {
            return Ok(Searched {
                found,
                evidence: Some(level),
                wander: None,
            });
        }
        forms.are_now(found.candidates);
        noise = better;
    }
    Err(CloseError::Singular)
}

/// Candidates in the forms that a search leaves them in, and their products if they are there.
struct Forms {
    candidates: Vec<Arc<dyn Candidate>>,
    moments: Option<StarMoments>,
}

impl Forms {
    /// Those that suit white noise.
    fn in_white(
        white: &StarEvidence<'_>,
        folds: &Folds,
        candidates: Vec<Arc<dyn Candidate>>,
        may: &[bool],
    ) -> Result<Self, CloseError> {
        if white.drawn.is_some() {
            // white evidence is another one then
            let found = search(white, folds, candidates, may, None)?;
            return Ok(Self {
                candidates: found.candidates,
                moments: None,
            });
        }
        let Begun {
            candidates,
            moments,
            plain,
            ..
        } = Begun::on(white, folds, candidates)?;
        let mut forms = Self {
            moments: (!white.data.is_long()).then_some(moments),
            candidates: candidates.clone(),
        };
        let found = search(white, folds, candidates, may, Some(plain))?;
        forms.are_now(found.candidates);
        Ok(forms)
    }

    /// One search from these under the noise of `level`, of `white` evidence otherwise.
    fn searched(
        &mut self,
        white: &StarEvidence<'_>,
        level: &StarEvidence<'_>,
        folds: &Folds,
        may: &[bool],
    ) -> Result<Found, CloseError> {
        let all = borrowed(&self.candidates);
        let kept = self.moments.take();
        let moments = kept.unwrap_or_else(|| white.moments(folds, &all));
        let grams = level.under(&moments);
        // of a long run there is no room for these beside those of other forms
        self.moments = (!white.data.is_long()).then_some(moments);
        let fitted = fit_grams(level, &grams, folds, &all)?;
        drop(grams);
        search(level, folds, self.candidates.clone(), may, Some(fitted))
    }

    /// Products of other forms are none of these.
    fn are_now(&mut self, forms: Vec<Arc<dyn Candidate>>) {
        let same = |(a, b)| Arc::ptr_eq(a, b);
        if !forms.iter().zip(&self.candidates).all(same) {
            self.moments = None;
        }
        self.candidates = forms;
    }
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
        slow_price: white.slow_price,
        groups: &groups,
        cost: vec![1.0; groups.len()],
        all: None,
        single: true,
    };
    let all: Vec<usize> = (0..groups.len()).collect();
    let noise = trial.near(&trial.columns(&all), known);
    noise.ok_or(CloseError::Singular)
}
