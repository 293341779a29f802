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
//! Not physics: the order of the steps.

use std::cell::LazyCell;
use std::sync::Arc;

use block_regression::Folds;
use coloured_noise::Foreknown;
use effects::{Candidate, Surroundings};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use telemetry::report::ConsideredEffect;

use crate::declared::OnCentroids;
use crate::error::CloseError;
use crate::figures;
use crate::noise_effects;
use crate::questions::needed::ToExplain;
use crate::search::empirical::Empirical;
use crate::search::group::open_beside;
use crate::search::misplaced::{MISPLACED, piled};
use crate::search::orbits::{has_no_speed, is_too_fast};
use crate::search::refusal::{Refusal, Refused};
use crate::search::selection::{columns_of, costs};
use crate::search::{Found, borrowed, family, fit_beside, joined, without};
use crate::star::evidence::StarEvidence;
use crate::star::landing::Elsewhere;
use crate::star::search::{self, Attempt, Searched, Start, attempt};
use changing_effect::{Changing, Inner, Way};
use commonness::Slow;
use description::{Described, Kept, Part};
use invariance::{Change, changing};
use one_star::is_one_star;
use rest::{keep_whole, looked_for};
use stand_ins::{Known, stand_ins};
use star_constants::Constants;

mod by_channel;
mod changing_effect;
pub(crate) mod commonness;
pub(crate) mod description;
pub(crate) mod invariance;
mod one_star;
mod places;
mod recurrence;
mod rest;
mod stand_ins;
pub(crate) mod star_constants;
mod wanders;

/// Nats by which a slow error of the reference is no likelier than effects in its place: a description that
/// beats it speaks for them.
const TIE: f64 = 2.0;
/// Searches whose outcome is refused before one is taken as it is.
const MOST_REFUSALS: usize = 10;
/// Chance beyond which an effect is doubted beside slow noise of the stars, and one that shows only beside what is
/// described: of that something is always left.
const DOUBT: f64 = 1e-4;
/// The effect of the acceleration.
pub(crate) const SMEAR: &str = "exposure_smear";
/// An effect does not make the squares of the error this many times as large.
const WORSE: f64 = 1.02;
/// Share of what a description gains below which an effect beside it is what it leaves.
const REMAINDER: f64 = 0.05;
/// Slow: over this share of the span.
const SLOW_SHARE: f64 = 0.2;

/// What is looked for.
pub(crate) struct Quest<'a> {
    /// Effects that may be named.
    pub(crate) candidates: &'a dyn Fn() -> Vec<Arc<dyn Candidate>>,
    /// Terms that describe, beside a slow error of the reference or not.
    pub(crate) terms: &'a dyn Fn(bool) -> Vec<Empirical>,
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

/// What a quest ends with.
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
    /// What the first search refused by size alone: a description that is kept since takes its place.
    pub(crate) oversize: Vec<ConsideredEffect>,
    /// What was found and is not named.
    pub(crate) refused: Refused,
}

impl Named<'_> {
    /// Whether something seems to follow a path that holds the error which it would explain: what is left, or an
    /// effect that was refused for it.
    pub(crate) fn follows_own_path(&self) -> bool {
        let refused = self.refused.values().any(|why| *why == Refusal::OwnPath);
        refused || self.described.follows_acceleration()
    }
}

/// The slow error that was found, if it is not the reference's.
fn slow_of_stars(
    level: &StarEvidence<'_>,
    searched: &Searched<'_>,
    inside: Option<&[Vec<f64>]>,
) -> Option<Slow> {
    let wander = searched.wander.as_ref()?;
    let axes = wander.axes();
    let claimed = (0..3).filter(|&a| axes[a]);
    let tau_s = claimed
        .map(|a| wander.noise.reference[a].tau_s)
        .fold(0.0, f64::max);
    let slow = commonness::slow(level.data, inside?, axes, tau_s)?;
    Some(slow).filter(Slow::is_of_the_stars)
}

/// Runs searches until nothing speaks against the outcome.
pub(crate) fn run<'a>(
    white: &StarEvidence<'a>,
    folds: &Folds,
    quest: &Quest<'_>,
) -> Result<Outcome<'a>, CloseError> {
    let alone = white.data.free_attitude || white.residuals.len() != 1;
    let mut start = if alone {
        Start::White
    } else {
        search::start(white, folds, &quest.reference)?
    };
    let mut refused = Refused::new();
    let mut kept: Vec<Arc<dyn Candidate>> = Vec::new();
    // what was found before anything was described
    let mut seen: Vec<String> = Vec::new();
    let mut oversize = Vec::new();
    // terms that every round must have: beside what is kept they are not found again
    let mut found_terms: Vec<Empirical> = Vec::new();
    for round in 0.. {
        let beside = white.keeping(&kept);
        let candidates = (quest.candidates)();
        let may: Vec<bool> = candidates
            .iter()
            .map(|c| !refused.contains_key(&family(c.as_ref())))
            .collect();
        let sight = quest.sight.filter(|_| round == 0);
        let (mut searched, wander) = match attempt(&beside, folds, candidates, &may, start, sight)?
        {
            Attempt::Searched(searched, wander) => (*searched, wander),
            Attempt::Elsewhere(elsewhere) => return Ok(Outcome::Elsewhere(elsewhere)),
        };
        let level = searched.evidence.as_ref().unwrap_or(&beside);
        searched.found = joined(level, folds, searched.found, &may)?;
        if kept.is_empty() {
            seen.extend(searched.found.chosen().map(family));
        }
        let last = round == MOST_REFUSALS;
        if round == 0 {
            let nothing = ToExplain::NOTHING;
            oversize = figures::considered(
                &searched.found,
                &nothing,
                &Refused::new(),
                &quest.surroundings,
            );
            oversize.retain(|c| c.refused.is_some());
        }
        let all = &searched.found.candidates;
        let wander: Vec<String> = wander.iter().map(|&g| family(all[g].as_ref())).collect();
        let own = || of_own_path(&beside, &searched);
        let pile = || pile(&searched.found, white.data.stars.len());
        if !last
            && (refuse(&mut refused, wander, Refusal::Wander)
                || refuse(&mut refused, own(), Refusal::OwnPath)
                || refuse(&mut refused, pile(), Refusal::Pile))
        {
            continue;
        }
        let level = searched.evidence.as_ref().unwrap_or(&beside);
        if !last
            && searched.evidence.is_some()
            && let worse = worse(level, folds, &searched.found)?
            && refuse(&mut refused, worse, Refusal::NoLessError)
        {
            continue;
        }
        let inside = noise_effects::in_sample(level, &searched.found);
        if slow_of_stars(level, &searched, inside.as_deref()).is_some() {
            start = Start::White;
            reinstated(&mut refused);
            continue;
        }
        let constants = Constants::of(level, &searched.found, inside.as_deref());
        if let Some(phase) = quest.lands
            && searched.found.choice().moves_light()
            && let Some(elsewhere) = Elsewhere::of(level, folds, searched.found.choice(), phase)?
        {
            return Ok(Outcome::Elsewhere(elsewhere));
        }
        let too_fast = |k: usize| {
            let chosen = searched.found.selection.chosen[k];
            let orbit = searched.found.candidates[chosen].as_ref();
            is_too_fast(orbit, &quest.surroundings)
        };
        // what such an orbit is held against
        let turns = found_terms.iter().any(Empirical::turns_to_and_fro);
        if !turns && (0..searched.found.selection.chosen.len()).any(too_fast) {
            found_terms.extend(description::turning(white.data));
        }
        let usual = (quest.terms)(searched.wander.is_some());
        let sought = inside.as_deref().map_or_else(Vec::new, |inside| {
            description::sought(level, inside, &usual)
        });
        let with_sought = |mut terms: Vec<Empirical>| {
            terms.extend(sought.iter().chain(&found_terms).cloned());
            terms
        };
        let all = with_sought(usual);
        let described = Described::new(level, folds, &searched.found, all, quest.ways)?;
        let estimate = LazyCell::new(|| searched.found.estimate());
        let is_no_orbit = |k: usize| {
            let chosen = &searched.found.selection.chosen;
            let first = columns_of(&searched.found.fitted.groups, &chosen[..k]).len();
            let orbit = searched.found.candidates[chosen[k]].as_ref();
            let told = estimate.as_ref();
            too_fast(k) || told.is_some_and(|told| has_no_speed(orbit, told, first))
        };
        let one_star = |k: usize, (term, columns): &Part| {
            let chosen = searched.found.selection.chosen[k];
            let selectors = searched.found.candidates[chosen].selectors();
            let id = selectors.get("star_id").and_then(|id| id.parse().ok());
            let slope = &described.terms[*term].term;
            id.is_some_and(|id| is_one_star(white.data, slope, columns, id))
        };
        let known = Known {
            is_no_orbit: &is_no_orbit,
            one_star: &one_star,
        };
        let agreed = |set: &[usize], instead: &[Part]| {
            constants
                .as_ref()
                .is_some_and(|constants| constants.say_as_much(&described, set, instead))
        };
        // constants of the stars are in no fit, and half a dozen of them follow any variable
        let left = || {
            let left = described.left()?;
            let left = match &constants {
                Some(constants) => constants.beyond(&described, left),
                None => left,
            };
            (!left.is_empty()).then_some(left)
        };
        if let Some(wander) = searched.wander.as_ref().filter(|_| !last) {
            let mut all = (quest.terms)(false);
            let residual = inside.as_deref();
            all.extend(wanders::terms(white.data, wander, residual, &beside.weight));
            let plain = Described::new(&beside, folds, &searched.found, all, &[])?;
            let axes = wander.axes().iter().filter(|a| **a).count();
            if let Some(instead) = wanders::in_place(&described, &plain, axes) {
                let tie = wander.behind.is_some_and(|nats| nats < TIE);
                let heaters = plain.is_of_channels(&instead);
                // what it beats speaks against no effect
                if reinstated(&mut refused)
                    || (tie || heaters) && suffice(&beside, folds, quest, &may)?
                {
                    start = Start::White;
                    found_terms.extend(looked_for(&plain, &instead));
                } else {
                    keep_whole(&mut kept, &mut found_terms, &plain, instead);
                }
                continue;
            }
        }
        let slow = slow_left(level, inside.as_deref());
        if let Some(slow) = slow.filter(|_| !last) {
            let doubtful = doubtful(&described, &searched.found, slow.inflation(), &may);
            // what is slow may be what is described
            if !doubtful.is_empty()
                && let Some(left) = left()
            {
                keep_whole(&mut kept, &mut found_terms, &described, left);
                continue;
            }
            if refuse(&mut refused, doubtful, Refusal::SlowStars) {
                continue;
            }
        }
        if !last {
            if let Some((set, instead)) = stand_ins(&described, &agreed, &known) {
                let chosen = &searched.found.selection.chosen;
                let families = set
                    .iter()
                    .map(|&k| family(searched.found.candidates[chosen[k]].as_ref()));
                refused.extend(families.map(|f| (f, Refusal::StandIn)));
                keep_whole(&mut kept, &mut found_terms, &described, instead);
                continue;
            }
            if let Some(change) = changing(&described, best_beside(&searched.found, &may)) {
                let g = searched.found.selection.chosen[change.chosen];
                refused.insert(
                    family(searched.found.candidates[g].as_ref()),
                    Refusal::Change(change.way.name()),
                );
                kept.extend(keep(&searched.found, g, change));
                continue;
            }
            if let Some(constants) = &constants
                && let disputed = disputed(constants, &searched.found, &may)
                && refuse(&mut refused, disputed, Refusal::StarConstants)
            {
                continue;
            }
            // what is named has to stand beside what is left, and may stand there alone
            let named = !described.chosen.is_empty() || searched.wander.is_some();
            if (named || kept.is_empty())
                && let Some(left) = left()
            {
                // no slow error that is not even claimed goes with a channel
                let unclaimed = searched.wander.is_none();
                if unclaimed && described.is_of_heaters(&left, &refused) && reinstated(&mut refused)
                {
                    start = Start::White;
                    continue;
                }
                keep_whole(&mut kept, &mut found_terms, &described, left);
                continue;
            }
        }
        if last {
            // nothing that is still spoken against is named
            let chosen = searched.found.selection.chosen.clone();
            let spoken =
                stand_ins(&described, &agreed, &known).map(|(set, _)| (set, Refusal::StandIn));
            let beside = best_beside(&searched.found, &may);
            let changes = changing(&described, beside)
                .map(|c| (vec![c.chosen], Refusal::Change(c.way.name())));
            let disputed = constants.as_ref().map(|constants| {
                let paid = paid(&searched.found, &may);
                (constants.disputed(&paid), Refusal::StarConstants)
            });
            let spoken = spoken.or(changes).or(disputed);
            let (spoken, why) = spoken.unwrap_or((Vec::new(), Refusal::StandIn));
            for k in spoken {
                let g = chosen[k];
                refused.insert(family(searched.found.candidates[g].as_ref()), why.clone());
                searched.found.selection.chosen.retain(|c| *c != g);
            }
        }
        if kept.is_empty() && !last {
            return Ok(Outcome::Named(Box::new(Named {
                searched,
                described,
                inside,
                slow,
                oversize,
                refused,
            })));
        }
        // without what is only described
        let Searched {
            found,
            evidence,
            wander,
        } = searched;
        let evidence = evidence.map(|e| e.keeping(&[]));
        let level = evidence.as_ref().unwrap_or(white);
        let all = borrowed(&found.candidates);
        let fitted = fit_beside(level, folds, &all, &found.selection.chosen)?;
        let found = Found { fitted, ..found };
        let described = Described::new(
            level,
            folds,
            &found,
            with_sought((quest.terms)(wander.is_some())),
            quest.ways,
        )?;
        // how an effect changes may be among what is described
        let beside = best_beside(&found, &may);
        if let Some(change) = changing(&described, beside).filter(|_| !last) {
            let g = found.selection.chosen[change.chosen];
            refused.insert(
                family(found.candidates[g].as_ref()),
                Refusal::Change(change.way.name()),
            );
            kept.extend(keep(&found, g, change));
            continue;
        }
        let least = next_to_nothing(&described);
        let doubted = |g: usize| {
            let unseen = !seen.contains(&family(found.candidates[g].as_ref()));
            unseen && found.selection.judged[g].p_value > DOUBT
        };
        let small = chosen_that(&found, |g, gains| gains < least || doubted(g));
        if !last && refuse(&mut refused, small, Refusal::Remainder) {
            continue;
        }
        // nor without the description, which is not in the model
        let found = judged_alone(found, &mut refused);
        let small = chosen_that(&found, |_, gains| gains <= least);
        if !last && refuse(&mut refused, small, Refusal::Remainder) {
            continue;
        }
        let wander = wander.filter(|w| last || w.nats() > least);
        let searched = Searched {
            found,
            evidence: evidence.clone(),
            wander,
        };
        let inside = noise_effects::in_sample(level, &searched.found);
        return Ok(Outcome::Named(Box::new(Named {
            slow: slow_left(level, inside.as_deref()),
            described,
            inside,
            searched,
            oversize,
            refused,
        })));
    }
    Err(CloseError::Singular)
}

/// Refuses `families`; whether there are any.
fn refuse(refused: &mut Refused, families: Vec<String>, why: Refusal) -> bool {
    let any = !families.is_empty();
    refused.extend(families.into_iter().map(|f| (f, why.clone())));
    any
}

/// Whether the effects that are found without a slow error of the reference explain as much as any
/// description.
fn suffice(
    level: &StarEvidence<'_>,
    folds: &Folds,
    quest: &Quest<'_>,
    may: &[bool],
) -> Result<bool, CloseError> {
    let Attempt::Searched(searched, _) =
        attempt(level, folds, (quest.candidates)(), may, Start::White, None)?
    else {
        return Ok(false);
    };
    let described = Described::new(level, folds, &searched.found, (quest.terms)(false), &[])?;
    let nothing = Known {
        is_no_orbit: &|_| false,
        one_star: &|_, _| false,
    };
    Ok(!described.chosen.is_empty() && stand_ins(&described, &|_, _| false, &nothing).is_none())
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

/// Whether any effect had been refused for a slow error of the reference: that is none, and they may be
/// named again.
fn reinstated(refused: &mut Refused) -> bool {
    let before = refused.len();
    refused.retain(|_, why| *why != Refusal::Wander);
    refused.len() < before
}

/// Judges every effect anew without what is only described: beside it, an effect that it stands for
/// cannot be seen. What would stand then has been refused. A chosen one gains what the model does, in which no
/// description is; its chance stays that beside the description, whose scatter would hide it.
fn judged_alone(mut found: Found, refused: &mut Refused) -> Found {
    let groups = &found.fitted.groups;
    let chosen = &found.selection.chosen;
    let cost = costs(groups, &vec![true; groups.len()]);
    let mut judged = found.fitted.trials(&cost).judged(chosen);
    for (g, judged) in judged.iter_mut().enumerate() {
        if chosen.contains(&g) {
            judged.p_value = found.selection.judged[g].p_value;
        } else if judged.stands() {
            let family = family(found.candidates[g].as_ref());
            refused.entry(family).or_insert(Refusal::Described);
        }
    }
    found.selection.judged = judged;
    found
}

/// What the best effect that `may` be named would gain out of fold beside the chosen.
fn best_beside(found: &Found, may: &[bool]) -> f64 {
    let groups = &found.fitted.groups;
    let chosen = &found.selection.chosen;
    let new = |g: usize| open_beside(groups, chosen, g);
    let judged = found.selection.judged.iter().zip(may).enumerate();
    let open = judged.filter(|(g, (j, may))| **may && j.credible && j.observable && new(*g));
    open.map(|(_, (j, _))| j.delta_loglik).fold(0.0, f64::max)
}

/// Nats that are next to nothing beside what no effect explains: what a description leaves of it is fitted by
/// anything.
fn next_to_nothing(described: &Described) -> f64 {
    let set = columns_of(&described.fitted.groups, &described.chosen);
    let alone = described.fitted.fits.out_of_fold(&set);
    let gain = described.rest().zip(alone);
    let gain = gain.map_or(0.0, |((worth, _), alone)| worth - alone.total_loglik());
    REMAINDER * gain.max(0.0)
}

/// Families of the chosen effects for whose place and gain, nats, this holds.
fn chosen_that(found: &Found, holds: impl Fn(usize, f64) -> bool) -> Vec<String> {
    let chosen = found.selection.chosen.iter();
    chosen
        .filter(|&&g| holds(g, found.selection.judged[g].delta_loglik))
        .map(|&g| family(found.candidates[g].as_ref()))
        .collect()
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

/// What having looked for each chosen effect costs, nats.
fn paid(found: &Found, may: &[bool]) -> Vec<f64> {
    let cost = costs(&found.fitted.groups, may);
    let chosen = found.selection.chosen.iter();
    chosen.map(|&g| cost[g].ln()).collect()
}

/// Families of effects on which resting stars do not agree; of stars and pixels all of a kind, where none of it stands.
fn disputed(constants: &Constants<'_>, found: &Found, may: &[bool]) -> Vec<String> {
    let groups = &found.fitted.groups;
    let chosen = &found.selection.chosen;
    let disputed = constants.disputed(&paid(found, may));
    let disputed: Vec<usize> = disputed.into_iter().map(|k| chosen[k]).collect();
    let standing = || chosen.iter().filter(|g| !disputed.contains(g));
    let fallen = |kind: &str| {
        disputed.iter().any(|&d| groups[d].kind == kind)
            && standing().all(|&g| groups[g].kind != kind)
    };
    let all = (0..groups.len()).filter(|g| disputed.contains(g) || fallen(groups[*g].kind));
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
        Ok(figures::star_power(&left, level.data))
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

/// Slow noise that is left of the stars themselves.
pub(crate) fn slow_left(level: &StarEvidence<'_>, inside: Option<&[Vec<f64>]>) -> Option<Slow> {
    let span = level.data.frames.t_s.last()? - level.data.frames.t_s.first()?;
    commonness::slow(level.data, inside?, [true; 3], SLOW_SHARE * span)
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

/// The effect and its change, for every fit from now on.
fn keep(found: &Found, g: usize, change: Change) -> Vec<Arc<dyn Candidate>> {
    let columns = found.own_columns(g);
    let effect = Arc::clone(&found.candidates[g]);
    let mut values = vec![0.0; effect.coefficients().len()];
    for (&column, value) in columns.iter().zip(&change.values) {
        values[column] = *value;
    }
    let own = Changing::new(Inner::Own(Arc::clone(&effect)), &values, vec![change.way]);
    vec![Arc::new(Kept::new(effect, columns)), Arc::new(own)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Only what a slow error of the reference had taken the place of comes back, and once.
    #[test]
    fn what_was_refused_for_a_wander_may_be_named_again() {
        let mut refused = Refused::new();
        refused.insert("step_misalignment".to_owned(), Refusal::Wander);
        refused.insert("catalogue_position/7".to_owned(), Refusal::Pile);
        assert!(reinstated(&mut refused));
        let left: Vec<&String> = refused.keys().collect();
        assert_eq!(left, ["catalogue_position/7"]);
        assert!(!reinstated(&mut refused), "nothing else was refused for it");
    }
}
