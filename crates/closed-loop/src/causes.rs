//! Which causes may be named: the search, and what speaks against its outcome.
//!
//! What the search chose is refused where it stands in for a cause that is in no catalogue:
//!
//! - a description by variables explains the same and more ([`crate::causes::stand_ins`]),
//! - or an effect is not the same wherever it acts ([`crate::causes::invariance`]),
//! - or stars that rest do not agree on it ([`crate::causes::star_constants`]),
//! - or more stars are misplaced than a catalogue has: something moves them all,
//! - or it is next to nothing beside what no effect explains.
//!
//! What refused an effect is kept in every fit from then on, described but not named, and
//! the search is made anew: what is named has to stand beside it. So is what is left beside no effect at all:
//! it may hide one.
//!
//! ```text
//! so_far        what earlier searches leave to the next
//! round         one search, beside what is kept
//! case          its outcome, described
//! objections    what speaks against it, in the order of the questions
//! undescribed   what stands without what is only described
//! ```
//!
//! Not physics: the order of the steps.

use std::sync::Arc;

use block_regression::Folds;
use coloured_noise::Foreknown;
use effects::{Candidate, Surroundings};
use telemetry::report::ConsideredEffect;

use crate::declared::OnCentroids;
use crate::error::CloseError;
use crate::noise_effects;
use crate::search::empirical::Empirical;
use crate::search::joined;
use crate::search::refusal::{Refused, for_own_path};
use crate::star::evidence::StarEvidence;
use crate::star::landing::Elsewhere;
use crate::star::search::{Attempt, Searched, Start, attempt};
use case::Case;
use changing_effect::Way;
use commonness::Slow;
use description::Described;
use round::Round;
use so_far::SoFar;

mod by_channel;
mod case;
pub(crate) mod changing_effect;
mod channel_forms;
pub(crate) mod commonness;
pub(crate) mod description;
pub(crate) mod invariance;
mod objections;
mod one_star;
mod places;
mod recurrence;
mod rest;
mod round;
mod so_far;
mod stand_ins;
pub(crate) mod star_constants;
pub(crate) mod terms;
mod undescribed;
mod wanders;

/// Searches whose outcome is refused before one is taken as it is.
const MOST_REFUSALS: usize = 10;
/// Chance beyond which an effect is doubted beside slow noise of the stars, and one that shows only beside what is
/// described: of that something is always left.
const DOUBT: f64 = 1e-4;
/// The effect of the acceleration.
pub(crate) const SMEAR: &str = "exposure_smear";
/// Share of what a description gains below which an effect beside it is what it leaves.
const REMAINDER: f64 = 0.05;
/// Slow: over this share of the span.
const SLOW_SHARE: f64 = 0.2;

/// What is looked for.
pub(crate) struct Inquiry<'a> {
    /// Effects that may be named.
    pub(crate) candidates: &'a dyn Fn() -> Vec<Arc<dyn Candidate>>,
    /// Terms that describe.
    pub(crate) terms: &'a dyn Fn() -> Vec<Empirical>,
    /// Whether one of them does beside a slow error of the reference, too.
    pub(crate) beside_slow: &'a dyn Fn(&Empirical) -> bool,
    /// What effects may change with.
    pub(crate) ways: &'a [Way],
    /// What the model declares of the reference's slow error, axis by axis.
    pub(crate) reference: [Option<Foreknown>; 3],
    /// What sizes are told in.
    pub(crate) surroundings: Surroundings<'a>,
    /// What the model declares of centroids, if the light is to be followed to where it falls before anything is
    /// described.
    pub(crate) lands: Option<&'a OnCentroids>,
    /// The same, if it is to be followed at first sight.
    pub(crate) sight: Option<&'a OnCentroids>,
}

impl Inquiry<'_> {
    /// Whether a term describes, beside a slow error of the reference or not.
    fn describes(&self, term: &Empirical, slow: bool) -> bool {
        !slow || (self.beside_slow)(term)
    }

    /// Terms that do.
    fn terms_beside(&self, slow: bool) -> Vec<Empirical> {
        let mut terms = (self.terms)();
        terms.retain(|term| self.describes(term, slow));
        terms
    }
}

/// What an inquiry ends with.
pub(crate) enum Outcome<'a> {
    Named(Box<Named<'a>>),
    /// What was found takes the light elsewhere, whatever may speak against it.
    Elsewhere(Box<Elsewhere>),
}

/// What may be named, and what is left beside it.
pub(crate) struct Named<'a> {
    pub(crate) searched: Searched<'a>,
    pub(crate) described: Described,
    /// What is left in sample, where that is known, arcsec.
    pub(crate) inside: Option<Vec<Vec<f64>>>,
    /// What is left of the stars themselves, and slow.
    pub(crate) slow: Option<Slow>,
    /// Whether something is described beside it in every fit.
    pub(crate) keeps: bool,
    /// What the first search refused by size alone: a description that is kept since takes its place.
    pub(crate) oversize: Vec<ConsideredEffect>,
    /// What was found and is not named.
    pub(crate) refused: Refused,
}

impl Named<'_> {
    /// Whether something seems to follow a path that holds the error which it would explain: what is left, or an
    /// effect that was refused for it.
    pub(crate) fn follows_own_path(&self) -> bool {
        for_own_path(&self.refused) || self.described.follows_acceleration()
    }
}

/// What stands at the end of a search, and what is left beside it.
struct Standing<'a> {
    searched: Searched<'a>,
    described: Described,
    inside: Option<Vec<Vec<f64>>>,
    slow: Option<Slow>,
}

/// Runs searches until nothing speaks against the outcome.
pub(crate) fn run<'a>(
    white: &StarEvidence<'a>,
    folds: &Folds,
    inquiry: &Inquiry<'_>,
) -> Result<Outcome<'a>, CloseError> {
    let mut so_far = SoFar::begin(white, folds, inquiry)?;
    for number in 0.. {
        let last = number >= MOST_REFUSALS;
        let beside = white.keeping(&so_far.kept);
        let candidates = (inquiry.candidates)();
        let may = so_far.may_be_named(&candidates);
        let sight = inquiry.sight.filter(|_| number == 0);
        let start = so_far.start;
        let (mut searched, outdone) = match attempt(&beside, folds, candidates, &may, start, sight)?
        {
            Attempt::Searched(searched, outdone) => (*searched, outdone),
            Attempt::Elsewhere(elsewhere) => return Ok(Outcome::Elsewhere(elsewhere)),
        };
        let level = searched.evidence.as_ref().unwrap_or(&beside);
        searched.found = joined(level, folds, searched.found, &may)?;
        so_far.see(&searched.found, number, &inquiry.surroundings);
        let mut round = Round {
            white,
            beside,
            folds,
            inquiry,
            last,
            may,
            outdone,
            searched,
        };
        if !last && objections::to_search(&round, &mut so_far)? {
            continue;
        }
        let inside = noise_effects::in_sample(round.level(), &round.searched.found);
        if round.slow_of_stars(inside.as_deref()).is_some() {
            so_far.start = Start::White;
            so_far.reinstates();
            continue;
        }
        if let Some(elsewhere) = round.elsewhere()? {
            return Ok(Outcome::Elsewhere(elsewhere));
        }
        let case = Case::of(&round, inside.as_deref(), &mut so_far)?;
        if !last && objections::in_place_of_wander(&case, &mut so_far)? {
            continue;
        }
        let slow = slow_left(round.level(), inside.as_deref());
        if !last
            && (objections::by_slow_stars(&case, slow, &mut so_far)
                || objections::by_description(&case, &mut so_far)
                || objections::by_change(&case, &mut so_far)
                || objections::by_constants(&case, &mut so_far)
                || objections::by_what_is_left(&case, &mut so_far))
        {
            continue;
        }
        // what is spoken against without another search is not named
        let spoken = if last { case.spoken_against() } else { None };
        let Case {
            described, sought, ..
        } = case;
        if let Some((places, why)) = spoken {
            so_far.take_out(&mut round.searched.found, &places, &why);
        }
        if so_far.kept.is_empty() && !last {
            return Ok(so_far.named(Standing {
                searched: round.searched,
                described,
                inside,
                slow,
            }));
        }
        if let Some(standing) = undescribed::standing(round, &sought, &mut so_far)? {
            return Ok(so_far.named(standing));
        }
    }
    Err(CloseError::Singular)
}

/// Slow noise that is left of the stars themselves.
pub(crate) fn slow_left(level: &StarEvidence<'_>, inside: Option<&[Vec<f64>]>) -> Option<Slow> {
    let span = level.data.frames.t_s.last()? - level.data.frames.t_s.first()?;
    commonness::slow(level.data, inside?, [true; 3], SLOW_SHARE * span)
}
