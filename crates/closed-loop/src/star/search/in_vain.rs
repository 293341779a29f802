//! Whether what is put forward beside a slow error has no chance, so that another search is needless.
//!
//! Each is held against the data beside what was found, in the place of each of those that turn frames, and in the
//! place of all of them. A search weighs the same, at length.
//!
//! Not physics: a comparison of hypotheses ([`super`]).

use std::sync::Arc;

use block_regression::Folds;
use effects::Candidate;
use rayon::prelude::*;

use super::Searched;
use super::alone::Begun;
use super::trial::{Trial, taken_out_in_turn};
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::search::selection::costs;
use crate::search::without;
use crate::star::evidence::StarEvidence;

/// Nats that another polish may bring: what is put forward is at its best already.
const POLISH: f64 = 3.0;

/// Whether with none of `put_forward` the data is worth as much as with what was found. Without a slow error that is
/// left to the search, which is cheap then.
pub(crate) fn in_vain(
    white: &StarEvidence<'_>,
    folds: &Folds,
    searched: &Searched<'_>,
    put_forward: &[Arc<dyn Candidate>],
) -> Result<bool, CloseError> {
    let Some(wander) = &searched.wander else {
        return Ok(false);
    };
    let found = &searched.found;
    let chosen = &found.selection.chosen;
    let own = chosen.iter().map(|&g| &found.candidates[g]);
    let own: Vec<_> = own.chain(put_forward).cloned().collect();
    let own = Begun::on(white, folds, own)?;
    let known: Vec<usize> = (0..chosen.len()).collect();
    let new: Vec<usize> = (chosen.len()..own.candidates.len()).collect();

    let groups = &own.plain.groups;
    // what all that was tried makes each pay
    let mut all = found.fitted.groups.clone();
    let first = all.len();
    all.extend_from_slice(&groups[chosen.len()..]);
    let cost = costs(&all, &vec![true; all.len()]);
    let places = chosen.iter().copied().chain(first..all.len());
    let every: Vec<usize> = (0..groups.len()).collect();
    let trial = Trial {
        moments: &own.moments,
        folds,
        precision: white.precision(),
        variance: own.plain.variance_beside(&every).unwrap_or(1.0),
        slow_price: white.slow_price,
        groups,
        cost: places.map(|g| cost[g]).collect(),
        all: None,
        single: false,
    };
    trial.sum_up();
    let worth = |set: &[usize]| Some(trial.worth(&trial.score(set, &wander.noise)?));

    let turns = known.iter().copied();
    let turns = turns.filter(|&at| own.candidates[at].acts_on_attitude());
    let mut sets = Vec::new();
    for out in taken_out_in_turn(turns.collect()) {
        let rest = without(&known, &out);
        sets.extend(new.iter().map(|&at| [&rest[..], &[at]].concat()));
    }
    let before = worth(&known).ok_or(CloseError::Singular)?;
    // what cannot be told from what is there (a jump where a step was found already) brings nothing
    let pays = |set: &Vec<usize>| worth(set).is_some_and(|with| with + POLISH >= before);
    Ok(!sets.par_iter().any(pays))
}
