//! Sets of effects that come near what was chosen, each at its own best.
//!
//! Forms that follow a parameter non-linearly stand on a grid, and the nearest to the truth lacks a share of its nats:
//! beside a lag of 15 s one of 10 s, so that a line with the heater's period, polished, may explain more; or so that the
//! heater's switch explains what it lacks, and both are polished into each other's place. So what a polish could bring
//! up to the choice is polished, too: another effect in the place of one, or the choice without one. What is likelier then takes
//! part in the next selection in that form.
//!
//! Not physics: a comparison of hypotheses.

use std::sync::Arc;

use block_regression::Folds;
use effects::Candidate;

use super::selection::Trials;
use super::{Fitted, borrowed, fit_whole, polish, without};
use crate::error::CloseError;
use crate::evidence::Evidence;

/// Share of its nats that the nearest form on a grid may lack: a line a quarter of 1/T off has 0.81 of its power, a
/// sinusoid 15 degrees off 0.93.
const OFF_GRID: f64 = 0.2;
/// How many sets are polished, the best first.
const MOST: usize = 4;

/// A set of effects that is likelier than the choice.
pub(crate) struct Likelier {
    pub(crate) set: Vec<usize>,
    /// All candidates, those of the set in the forms that make it so.
    pub(crate) candidates: Vec<Arc<dyn Candidate>>,
    /// Log-likelihood less the price of its parameters.
    fit: f64,
}

/// The likeliest set beside `chosen`, which is polished, if it is likelier. `fitted`: the fits of these candidates.
pub(crate) fn likelier(
    evidence: &dyn Evidence,
    folds: &Folds,
    candidates: &[Arc<dyn Candidate>],
    fitted: &Fitted,
    chosen: &[usize],
    may: &[bool],
) -> Result<Option<Likelier>, CloseError> {
    // a fit pays by parameters, not for having been looked for
    let trials = fitted.trials(&[]);
    let Some(now) = trials.fit(chosen) else {
        return Ok(None);
    };
    let mut near = sets(&trials, chosen, may);
    near.retain(|near| near.fit + OFF_GRID * near.shaped > now);
    near.sort_by(|a, b| b.fit.total_cmp(&a.fit));
    near.truncate(MOST);
    let mut best: Option<Likelier> = None;
    for Near { set, .. } in near {
        let mut candidates = candidates.to_vec();
        polish(evidence, folds, &mut candidates, fitted, &set)?;
        let own: Vec<_> = set.iter().map(|&g| Arc::clone(&candidates[g])).collect();
        let alone = fit_whole(evidence, folds, &borrowed(&own))?;
        let all: Vec<usize> = (0..own.len()).collect();
        let least = best.as_ref().map_or(now, |best| best.fit);
        if let Some(fit) = alone.trials(&[]).fit(&all)
            && fit > least
        {
            best = Some(Likelier {
                set,
                candidates,
                fit,
            });
        }
    }
    Ok(best)
}

/// A set beside the choice.
struct Near {
    set: Vec<usize>,
    /// Log-likelihood less the price of its parameters.
    fit: f64,
    /// The most nats of an effect in it that has a shape.
    shaped: f64,
}

/// The sets that could come near.
fn sets(trials: &Trials<'_>, chosen: &[usize], may: &[bool]) -> Vec<Near> {
    let groups = trials.groups;
    let shaped = |g: usize| groups[g].shapes > 0;
    let all: Vec<usize> = (0..groups.len()).filter(|&g| may[g] && shaped(g)).collect();
    let near = |others: &[usize], (fit, g): (f64, usize)| {
        let set = [others, &[g]].concat();
        let own = set.iter().filter(|&&g| shaped(g));
        let nats = own.filter_map(|&g| Some(fit - trials.fit(&without(&set, &[g]))?));
        let shaped = nats.fold(0.0, f64::max);
        Near { set, fit, shaped }
    };
    let mut out = Vec::new();
    for &c in chosen {
        let others = without(chosen, &[c]);
        let other = |g: usize| groups[g].family != groups[c].family && !chosen.contains(&g);
        let instead = trials.best_of_families(&others, &all, other);
        out.extend(instead.into_iter().map(|best| near(&others, best)));
        // without it, and the forms that others had before they were polished beside it
        for &o in &others {
            let rest = without(&others, &[o]);
            let same = |g: usize| groups[g].family == groups[o].family;
            let fewer = trials.best_of_families(&rest, &all, same);
            out.extend(fewer.into_iter().map(|best| near(&rest, best)));
        }
    }
    out
}
