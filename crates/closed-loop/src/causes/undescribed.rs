//! What stands without what is only described, which is not in the model.
//!
//! Not physics: the last questions.

use crate::causes::description::Described;
use crate::causes::invariance::changing;
use crate::causes::round::{Round, best_beside};
use crate::causes::so_far::SoFar;
use crate::causes::{DOUBT, REMAINDER, Standing, slow_left};
use crate::error::CloseError;
use crate::noise_effects;
use crate::search::empirical::Empirical;
use crate::search::refusal::{Refusal, Refused};
use crate::search::selection::{columns_of, costs};
use crate::search::{Found, borrowed, family, fit_beside};
use crate::star::search::Searched;

/// The outcome of `round` without what was kept; `None` where something speaks against that, so that another search
/// has to be made.
pub(super) fn standing<'a>(
    round: Round<'_, 'a>,
    sought: &[Empirical],
    so_far: &mut SoFar,
) -> Result<Option<Standing<'a>>, CloseError> {
    let Round {
        white,
        folds,
        inquiry,
        last,
        may,
        searched,
        ..
    } = round;
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
    let terms = so_far.with_found(inquiry.terms_beside(wander.is_some()), sought);
    let described = Described::new(level, folds, &found, terms, inquiry.ways)?;
    // how an effect changes may be among what is described
    let beside = best_beside(&found, &may);
    if let Some(change) = changing(&described, beside).filter(|_| !last) {
        so_far.keep_changing(&found, change);
        return Ok(None);
    }
    let least = next_to_nothing(&described);
    let doubted = |g: usize| {
        let unseen = !so_far.seen.contains(&family(found.candidates[g].as_ref()));
        unseen && found.selection.judged[g].p_value > DOUBT
    };
    let small = chosen_that(&found, |g, gains| gains < least || doubted(g));
    if !last && so_far.refuse(small, &Refusal::Remainder) {
        return Ok(None);
    }
    // nor without the description, which is not in the model
    let found = judged_alone(found, &mut so_far.refused);
    let small = chosen_that(&found, |_, gains| gains <= least);
    if !last && so_far.refuse(small, &Refusal::Remainder) {
        return Ok(None);
    }
    let wander = wander.filter(|w| last || w.nats() > least);
    let searched = Searched {
        found,
        evidence: evidence.clone(),
        wander,
    };
    let inside = noise_effects::in_sample(level, &searched.found);
    Ok(Some(Standing {
        slow: slow_left(level, inside.as_deref()),
        described,
        inside,
        searched,
    }))
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
