//! Where white evidence is all there is, though what is left of the declared model is slow.
//!
//! Hypotheses with a noise of their own need not be gone through where beside what white evidence finds no trace of a
//! slow error is left, and none of it, by itself or with others, could be the work of one:
//!
//! ```text
//! worth(all, white) > worth(all but S, slow) + 10 nats     for every set S of what turns frames, and for all
//! ```
//!
//! What is slow in the declared model's residual is the effects' then.
//!
//! Not physics: a comparison of hypotheses ([`super`]).

use std::sync::Arc;

use block_regression::Folds;
use coloured_noise::CommonNoise;
use effects::Candidate;

use super::on_frames::{OnFrames, in_forms};
use super::trial::{Scored, Trial};
use super::{Wander, first_sight};
use crate::declared::OnCentroids;
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::search::near;
use crate::search::selection::{columns_of, costs};
use crate::search::{Choice, Fitted, Found, borrowed, fit_grams, polish, without};
use crate::star::evidence::StarEvidence;
use crate::star::landing::Elsewhere;
use crate::star::moments::StarMoments;

/// Nats by which effects have to be worth more than a slow error in their place, for it not to be gone into; and the
/// chance of what is slow beside them.
const BY_FAR: f64 = 10.0;
const TRACE: f64 = 0.05;
/// A slow error gains this many times as much, and more, where no polish brings effects in its place up to it.
const HOPELESS: f64 = 1.5;
/// Nats by which effects that were polished are behind a slow error in their place, where no other form and nothing
/// beside them brings them up to it.
const FAR_BEHIND: f64 = 50.0;
/// Effects that turn frames of which every set is held against a slow error: of more there are too many.
const MOST_SETS_OF: usize = 3;
/// Rounds of selection and polish; the choice settles in two.
const ROUNDS: usize = 3;

/// Candidates, their products, and their fits under white noise.
pub(super) struct Begun {
    pub(super) candidates: Vec<Arc<dyn Candidate>>,
    pub(super) moments: StarMoments,
    pub(super) plain: Fitted,
    /// Whether what white evidence chooses of them is known to be far behind a slow error.
    pub(super) hopeless: bool,
}

/// What white evidence comes to.
pub(super) enum Outcome {
    Settled(Box<Found>),
    /// A slow error may be in it.
    Open(Box<Begun>),
    /// What was chosen first takes the light elsewhere.
    Elsewhere(Box<Elsewhere>),
}

impl Begun {
    pub(super) fn on(
        white: &StarEvidence<'_>,
        folds: &Folds,
        candidates: Vec<Arc<dyn Candidate>>,
    ) -> Result<Self, CloseError> {
        let moments = white.moments(folds, &borrowed(&candidates));
        Self::of(white, folds, candidates, moments)
    }

    /// The same with every frame's moments where there is room, for candidates that are to be polished.
    pub(super) fn by_frame(
        white: &StarEvidence<'_>,
        folds: &Folds,
        candidates: Vec<Arc<dyn Candidate>>,
    ) -> Result<Self, CloseError> {
        let moments = white.moments_by_frame(folds, &borrowed(&candidates));
        Self::of(white, folds, candidates, moments)
    }

    fn of(
        white: &StarEvidence<'_>,
        folds: &Folds,
        candidates: Vec<Arc<dyn Candidate>>,
        moments: StarMoments,
    ) -> Result<Self, CloseError> {
        let plain = plainly(white, folds, &candidates, &moments)?;
        Ok(Self {
            candidates,
            moments,
            plain,
            hopeless: false,
        })
    }

    /// The same in other `forms`.
    fn in_forms(
        self,
        white: &StarEvidence<'_>,
        folds: &Folds,
        forms: Vec<Arc<dyn Candidate>>,
    ) -> Result<Self, CloseError> {
        // its fits share the products
        drop(self.plain);
        let moments = in_forms(white, folds, self.moments, &self.candidates, &forms);
        Self::of(white, folds, forms, moments)
    }
}

/// The fits under white noise.
pub(super) fn plainly(
    white: &StarEvidence<'_>,
    folds: &Folds,
    candidates: &[Arc<dyn Candidate>],
    moments: &StarMoments,
) -> Result<Fitted, CloseError> {
    fit_grams(white, &white.under(moments), folds, &borrowed(candidates))
}

/// Rounds of selection and polish on white evidence, while that looks as if it were all: see the module.
pub(super) fn without_slow(
    white: &StarEvidence<'_>,
    folds: &Folds,
    mut begun: Begun,
    may: &[bool],
    start: CommonNoise,
    mut sight: Option<&OnCentroids>,
) -> Result<Outcome, CloseError> {
    if white.drawn.is_some() {
        // white evidence is another one then
        return Ok(Outcome::Open(Box::new(begun)));
    }
    let mut before: Vec<usize> = Vec::new();
    // what was chosen before, in the forms that it has now, by itself
    let mut known: Option<Scored> = None;
    let (mut rounds, mut compared) = (ROUNDS, false);
    while rounds > 0 {
        rounds -= 1;
        let (chosen, quieter) = begun.plain.chosen(folds, &begun.candidates, may)?;
        let fitted = quieter.as_ref().unwrap_or(&begun.plain);
        let turns = |g: &&usize| begun.candidates[**g].acts_on_attitude();
        if chosen.is_empty() || chosen.iter().filter(turns).count() > MOST_SETS_OF {
            break;
        }
        let cost = costs(&fitted.groups, may);
        if before.is_empty()
            && Alone::new(white, folds, &begun, fitted, &chosen, cost.clone())
                .is_hopeless(fitted, &start)
        {
            break;
        }
        let choice = Choice {
            candidates: &begun.candidates,
            fitted,
            chosen: &chosen,
        };
        let moved = match sight.take() {
            Some(phase) if first_sight::seems_to_move_it(white, folds, choice, phase)? => {
                Some(phase)
            }
            _ => None,
        };
        let mut polished = begun.candidates.clone();
        let changed = chosen != before && {
            let on_frames = OnFrames::of(white, &begun.moments);
            polish(&on_frames, folds, &mut polished, fitted, &chosen)?
        };
        if let Some(phase) = moved
            && let Some(to) = first_sight::of_forms(white, folds, &polished, &chosen, phase)?
        {
            return Ok(Outcome::Elsewhere(to));
        }
        if !changed && !compared {
            compared = true;
            let on_frames = OnFrames::of(white, &begun.moments);
            let likelier = near::likelier(&on_frames, folds, &polished, fitted, &chosen, may)?;
            if let Some(likelier) = likelier {
                (rounds, known) = (ROUNDS, None);
                before.clear();
                drop(quieter);
                begun = begun.in_forms(white, folds, likelier.candidates)?;
                continue;
            }
        }
        if !changed {
            let alone = Alone::new(white, folds, &begun, fitted, &chosen, cost);
            let known = known.filter(|_| chosen == before);
            let whole = known.or_else(|| alone.held_against(&start)?.likely());
            if !whole.is_some_and(|whole| alone.stands(&whole, &start)) {
                break;
            }
            let fitted = quieter.unwrap_or(begun.plain);
            return Ok(Outcome::Settled(Box::new(Found {
                candidates: begun.candidates,
                selection: fitted.selection(chosen, may),
                fitted,
            })));
        }
        // by themselves first, which costs little
        let own = chosen.iter().map(|&g| Arc::clone(&polished[g])).collect();
        let own = Begun::on(white, folds, own)?;
        let all: Vec<usize> = (0..chosen.len()).collect();
        let cost = chosen.iter().map(|&g| cost[g]).collect();
        let alone = Alone::new(white, folds, &own, &own.plain, &all, cost);
        let held = alone.held_against(&start);
        begun.hopeless = held.as_ref().is_some_and(Held::is_hopeless);
        known = held.and_then(Held::likely);
        if known.is_none() {
            break;
        }
        before = chosen;
        drop(quieter);
        begun = begun.in_forms(white, folds, polished)?;
    }
    Ok(Outcome::Open(Box::new(begun)))
}

/// Whether what white evidence chooses of candidates in the forms that they have, and would polish, is far behind a
/// slow error like `noise`.
pub(super) fn is_hopeless(
    white: &StarEvidence<'_>,
    folds: &Folds,
    begun: &Begun,
    may: &[bool],
    noise: &CommonNoise,
) -> Result<bool, CloseError> {
    if begun.hopeless {
        return Ok(true);
    }
    let (chosen, quieter) = begun.plain.chosen(folds, &begun.candidates, may)?;
    let fitted = quieter.as_ref().unwrap_or(&begun.plain);
    let cost = costs(&fitted.groups, may);
    let alone = Alone::new(white, folds, begun, fitted, &chosen, cost);
    Ok(alone.is_hopeless(fitted, noise))
}

/// What was chosen at its best noise, and the nats that it is worth more than a slow error in the place of all of it
/// that such an error could be.
struct Held {
    whole: Scored,
    lead: f64,
}

impl Held {
    fn likely(self) -> Option<Scored> {
        (self.lead > BY_FAR).then_some(self.whole)
    }

    fn is_hopeless(&self) -> bool {
        self.lead < -FAR_BEHIND
    }
}

/// What white evidence chose, held against slow errors in its place.
struct Alone<'a> {
    trial: Trial<'a>,
    chosen: &'a [usize],
    /// Those of them that turn frames.
    turns: Vec<usize>,
}

impl<'a> Alone<'a> {
    /// `fitted`: the fits that chose.
    fn new(
        white: &StarEvidence<'_>,
        folds: &'a Folds,
        begun: &'a Begun,
        fitted: &'a Fitted,
        chosen: &'a [usize],
        cost: Vec<f64>,
    ) -> Self {
        let turns = chosen.iter().copied();
        let turns = turns.filter(|&g| begun.candidates[g].acts_on_attitude());
        let trial = Trial {
            moments: &begun.moments,
            folds,
            precision: white.precision(),
            variance: fitted.variance_beside(chosen).unwrap_or(1.0),
            slow_price: white.slow_price,
            groups: &fitted.groups,
            cost,
            all: None,
            single: true,
        };
        trial.sum_up();
        Self {
            turns: turns.collect(),
            trial,
            chosen,
        }
    }

    fn held_against(&self, start: &CommonNoise) -> Option<Held> {
        let (whole, rest) = rayon::join(
            || self.trial.score(self.chosen, start),
            || self.instead_of(self.most(), start),
        );
        let whole = whole?;
        let lead = self.trial.worth_of_white(&whole) - rest?;
        Some(Held { whole, lead })
    }

    /// Whether those that turn frames, as they are, explain so much less than a slow error in their place that no
    /// polish makes up for it. `fitted`: the fits that chose.
    fn is_hopeless(&self, fitted: &Fitted, start: &CommonNoise) -> bool {
        let rest = without(self.chosen, &self.turns);
        let error = |set: &[usize]| fitted.fits.error(&columns_of(&fitted.groups, set));
        let Some((before, with)) = error(&rest).zip(error(self.chosen)) else {
            return false;
        };
        let gain = fitted.nats(before, with);
        let slow = self.trial.climb(&self.trial.columns(&rest), start);
        let slow = slow.map_or(0.0, |(noise, rotations, _)| {
            0.5 * rotations.slow_ratio(&noise).iter().sum::<f64>()
        });
        slow > HOPELESS * gain + BY_FAR
    }

    /// All that a slow error could be in the place of.
    fn most(&self) -> &[usize] {
        match self.turns.is_empty() {
            true => self.chosen,
            false => &self.turns,
        }
    }

    /// Whether `whole`, which is likely, is all there is.
    fn stands(&self, whole: &Scored, start: &CommonNoise) -> bool {
        if Wander::of(whole.rotations.clone(), whole.noise).p_value() <= TRACE {
            return false;
        }
        // all of them together have been held against one
        let mut sets: Vec<Vec<usize>> = (1..(1_usize << self.turns.len()).saturating_sub(1))
            .map(|bits| {
                let places = (0..self.turns.len()).filter(|k| bits >> k & 1 == 1);
                places.map(|k| self.turns[k]).collect()
            })
            .collect();
        if self.most().len() < self.chosen.len() {
            sets.push(self.chosen.to_vec());
        }
        sets.iter()
            .all(|set| self.is_by_far(whole, self.instead_of(set, start)))
    }

    /// What the rest is worth with a slow error in the place of `out`, nats.
    fn instead_of(&self, out: &[usize], start: &CommonNoise) -> Option<f64> {
        let rest = without(self.chosen, out);
        if !rest.is_empty() {
            let rest = self.trial.score(&rest, start)?;
            return Some(self.trial.worth(&rest));
        }
        let columns = self.trial.columns(&[]);
        let (noise, rotations, loglik) = self.trial.climb(&columns, start)?;
        Some(loglik - self.trial.paid_by_slow(&rotations, &noise))
    }

    fn is_by_far(&self, whole: &Scored, instead: Option<f64>) -> bool {
        let white = self.trial.worth_of_white(whole);
        instead.is_some_and(|worth| white > worth + BY_FAR)
    }
}
