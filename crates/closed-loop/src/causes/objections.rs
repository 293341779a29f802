//! What speaks against an outcome, question by question.
//!
//! Each refuses what it speaks against, or keeps what describes it, for the next search; and says whether there has to be
//! one.
//!
//! Not physics: the order of the questions.

use block_regression::Folds;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::causes::case::Case;
use crate::causes::commonness::Slow;
use crate::causes::description::Described;
use crate::causes::rest::looked_for;
use crate::causes::round::Round;
use crate::causes::so_far::SoFar;
use crate::causes::stand_ins::{Known, stand_ins};
use crate::causes::star_constants::Constants;
use crate::causes::{DOUBT, SMEAR, wanders};
use crate::error::CloseError;
use crate::residual_size;
use crate::search::empirical::Empirical;
use crate::search::misplaced::{MISPLACED, piled};
use crate::search::refusal::Refusal;
use crate::search::selection::{columns_of, costs};
use crate::search::{Found, family, without};
use crate::star::evidence::StarEvidence;
use crate::star::search::{Attempt, Searched, Start, attempt};

/// Nats by which a slow error of the reference is no likelier than effects in its place: a description that
/// beats it speaks for them.
const TIE: f64 = 2.0;
/// An effect does not make the squares of the error this many times as large.
const WORSE: f64 = 1.02;

/// What needs no description.
pub(super) fn to_search(round: &Round<'_, '_>, so_far: &mut SoFar) -> Result<bool, CloseError> {
    let (searched, found) = (&round.searched, &round.searched.found);
    let outdone = round.outdone.iter();
    let outdone = outdone.map(|&g| family(found.candidates[g].as_ref()));
    let refused = so_far.refuse(outdone.collect(), &Refusal::Wander)
        || so_far.refuse(of_own_path(&round.beside, searched), &Refusal::OwnPath)
        || so_far.refuse(pile(found, round.beside.data.stars.len()), &Refusal::Pile);
    if refused || searched.evidence.is_none() {
        return Ok(refused);
    }
    let worse = worse(round.level(), round.folds, found)?;
    Ok(so_far.refuse(worse, &Refusal::NoLessError))
}

/// The stars follow something in the place of a slow error of the reference.
pub(super) fn in_place_of_wander(
    case: &Case<'_, '_>,
    so_far: &mut SoFar,
) -> Result<bool, CloseError> {
    let round = case.round;
    let (Some(wander), Some(plain)) = (&round.searched.wander, &case.plain) else {
        return Ok(false);
    };
    let axes = wander.axes().iter().filter(|a| **a).count();
    let Some(instead) = wanders::in_place(&case.described, plain, axes) else {
        return Ok(false);
    };
    let tie = wander.behind.is_some_and(|nats| nats < TIE);
    let heaters = plain.is_of_channels(&instead);
    let forms: Vec<Empirical> = case.channel_forms().cloned().collect();
    // what it beats speaks against no effect
    if so_far.reinstates() || (tie || heaters) && suffice(round, &forms)? {
        so_far.start = Start::White;
        so_far.found_terms.extend(looked_for(plain, &instead));
    } else {
        so_far.keep_whole(plain, instead);
    }
    Ok(true)
}

/// Stars have `slow` noise of their own.
pub(super) fn by_slow_stars(case: &Case<'_, '_>, slow: Option<Slow>, so_far: &mut SoFar) -> bool {
    let Some(slow) = slow else {
        return false;
    };
    let (found, may) = (&case.round.searched.found, &case.round.may);
    let doubtful = doubtful(&case.described, found, slow.inflation(), may);
    // what is slow may be what is described
    if !doubtful.is_empty()
        && let Some(left) = case.left()
    {
        so_far.keep_whole(&case.described, left);
        return true;
    }
    so_far.refuse(doubtful, &Refusal::SlowStars)
}

/// A description explains the same and more.
pub(super) fn by_description(case: &Case<'_, '_>, so_far: &mut SoFar) -> bool {
    let Some((set, instead)) = case.stand_in() else {
        return false;
    };
    let families = set.iter().map(|&k| family(case.round.chosen(k)));
    so_far.refuse(families.collect(), &Refusal::StandIn);
    so_far.keep_whole(&case.described, instead);
    true
}

/// An effect is not the same everywhere.
pub(super) fn by_change(case: &Case<'_, '_>, so_far: &mut SoFar) -> bool {
    let change = case.change();
    let changes = change.is_some();
    if let Some(change) = change {
        so_far.keep_changing(&case.round.searched.found, change);
    }
    changes
}

/// Stars that rest do not agree.
pub(super) fn by_constants(case: &Case<'_, '_>, so_far: &mut SoFar) -> bool {
    let Some(constants) = &case.constants else {
        return false;
    };
    so_far.refuse(disputed(constants, case.round), &Refusal::StarConstants)
}

/// What is named has to stand beside what is left, and may stand there alone.
pub(super) fn by_what_is_left(case: &Case<'_, '_>, so_far: &mut SoFar) -> bool {
    let unclaimed = case.round.searched.wander.is_none();
    let named = !case.described.chosen.is_empty() || !unclaimed;
    if !named && !so_far.kept.is_empty() {
        return false;
    }
    let Some(left) = case.left() else {
        return false;
    };
    // no slow error that is not even claimed goes with a channel
    if unclaimed && case.described.is_of_heaters(&left, &so_far.refused) && so_far.reinstates() {
        so_far.start = Start::White;
    } else {
        so_far.keep_whole(&case.described, left);
    }
    true
}

/// Families of the chosen effects that see the acceleration, where it comes from the samples of a reference
/// that errs slowly: such a path follows the error, and what it makes of it goes with the error itself.
fn of_own_path(level: &StarEvidence<'_>, searched: &Searched<'_>) -> Vec<String> {
    if searched.slow_error().is_none() || !level.own_paths {
        return Vec::new();
    }
    let chosen = searched.found.selection.chosen.iter();
    let chosen = chosen.map(|&g| searched.found.candidates[g].as_ref());
    chosen.filter(|c| c.id() == SMEAR).map(family).collect()
}

/// Families of misplaced stars, if more of `stars` are than a catalogue has.
fn pile(found: &Found, stars: usize) -> Vec<String> {
    let groups = &found.fitted.groups;
    if !piled(groups, &found.selection.chosen, stars as f64) {
        return Vec::new();
    }
    let all = (0..groups.len()).filter(|&g| groups[g].kind == MISPLACED);
    all.map(|g| family(found.candidates[g].as_ref())).collect()
}

/// Effects with which the error out of fold is larger than without them: white noise would have seen that, but beside
/// a slow error of the reference likelihoods are those of changes.
fn worse(
    level: &StarEvidence<'_>,
    folds: &Folds,
    found: &Found,
) -> Result<Vec<String>, CloseError> {
    let chosen = &found.selection.chosen;
    if chosen.is_empty() {
        return Ok(Vec::new());
    }
    let power = |set: &[usize]| -> Result<f64, CloseError> {
        let left = found.left_out_of_fold(level, folds, set)?;
        Ok(residual_size::star_power(&left, level.data))
    };
    let all = power(chosen)?;
    if all < WORSE * power(&[])? {
        return Ok(Vec::new());
    }
    let mut families = Vec::new();
    for g in chosen {
        let others = without(chosen, &[*g]);
        if all > WORSE * power(&others)? {
            families.push(family(found.candidates[*g].as_ref()));
        }
    }
    Ok(families)
}

/// Whether the effects that are found without a slow error of the reference explain as much as any
/// description, of which a part may be in `forms` of channels.
fn suffice(round: &Round<'_, '_>, forms: &[Empirical]) -> Result<bool, CloseError> {
    let (level, folds, inquiry) = (&round.beside, round.folds, round.inquiry);
    let candidates = (inquiry.candidates)();
    let Attempt::Searched(searched, _) =
        attempt(level, folds, candidates, &round.may, Start::White, None)?
    else {
        return Ok(false);
    };
    let mut terms = (inquiry.terms)();
    terms.extend(forms.iter().cloned());
    let described = Described::new(level, folds, &searched.found, terms, &[])?;
    let nothing = Known {
        is_no_orbit: &|_| false,
        one_star: &|_, _| false,
    };
    Ok(!described.chosen.is_empty() && stand_ins(&described, &|_, _| false, &nothing).is_none())
}

/// Families of chosen effects that slow noise of the stars makes as well.
fn doubtful(described: &Described, found: &Found, inflation: f64, may: &[bool]) -> Vec<String> {
    let set = columns_of(&described.fitted.groups, &described.chosen);
    let Some(estimate) = described.fitted.fits.estimate(&set) else {
        return Vec::new();
    };
    let cost = costs(&found.fitted.groups, may);
    let mut first = 0;
    let mut doubtful = Vec::new();
    for (&g, &k) in found.selection.chosen.iter().zip(&described.chosen) {
        let own: Vec<usize> = (first..first + described.fitted.groups[k].columns.len()).collect();
        first += own.len();
        let square = estimate.square(&own).unwrap_or(0.0) / inflation;
        let law = ChiSquared::new(own.len().max(1) as f64);
        let p = law.map_or(1.0, |law| law.sf(square)) * cost[g];
        if inflation > 1.0 && p > DOUBT {
            doubtful.push(family(found.candidates[g].as_ref()));
        }
    }
    doubtful
}

/// Families of effects on which resting stars do not agree; of stars and pixels all of a kind, where none of it stands.
fn disputed(constants: &Constants<'_>, round: &Round<'_, '_>) -> Vec<String> {
    let found = &round.searched.found;
    let groups = &found.fitted.groups;
    let chosen = &found.selection.chosen;
    let disputed = constants.disputed(&round.paid());
    let disputed: Vec<usize> = disputed.into_iter().map(|k| chosen[k]).collect();
    let standing = || chosen.iter().filter(|g| !disputed.contains(g));
    let fallen = |kind: &str| {
        disputed.iter().any(|&d| groups[d].kind == kind)
            && standing().all(|&g| groups[g].kind != kind)
    };
    let all = (0..groups.len()).filter(|g| disputed.contains(g) || fallen(groups[*g].kind));
    all.map(|g| family(found.candidates[g].as_ref())).collect()
}
