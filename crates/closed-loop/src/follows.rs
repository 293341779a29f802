//! What a leftover follows: each variable by the part of its term that is worth most, out of fold.
//!
//! Source: docs/formats/report.md (`unattributed`).

use std::collections::BTreeSet;

use block_regression::Fits;
use effects::{Candidate, Surroundings};
use rayon::prelude::*;
use telemetry::report::{Dependence, Unattributed};

use crate::search::Found;
use crate::search::empirical::EMPIRICAL;
use crate::search::group::Group;
use crate::search::selection::{columns_of, each};
use crate::unexplained::SEARCH_ALPHA;

/// Shares within this factor are the same.
const SAME: f64 = 3.0;

/// What the leftover follows, among the empirical terms of `found` beside the chosen
/// effects, that `may` be. `left` is the share of the before variance that is left.
pub(crate) fn unattributed(
    found: &Found,
    left: f64,
    may: impl Fn(&dyn Candidate) -> bool,
) -> Unattributed {
    let set = columns_of(&found.fitted.groups, &found.selection.chosen);
    let terms: Vec<Followed<'_>> = (0..found.candidates.len())
        .filter(|&g| found.candidates[g].id() == EMPIRICAL && found.selection.judged[g].observable)
        .filter(|&g| may(found.candidates[g].as_ref()))
        .filter_map(|g| {
            let name = found.candidates[g].selectors().get("variable")?.clone();
            Some(Followed {
                variable: name,
                parts: vec![found.fitted.groups[g].columns.clone()],
                group: &found.fitted.groups[g],
                of_many: false,
                scanned: 0.0,
            })
        })
        .collect();
    follows(
        &found.fitted.fits,
        &set,
        &terms,
        found.candidates.len(),
        each(found.fitted.scalars),
        left,
    )
}

/// How columns do.
struct Part {
    p_value: f64,
    share: f64,
    worth: f64,
    columns: usize,
}

/// A variable that the leftover may follow.
pub(crate) struct Followed<'a> {
    pub(crate) variable: String,
    /// Columns by which it is judged.
    pub(crate) parts: Vec<Vec<usize>>,
    /// All its columns, and their credible sizes.
    pub(crate) group: &'a Group,
    /// Its parts are single stars or slots, and all.
    pub(crate) of_many: bool,
    /// What it pays beside its columns, nats.
    pub(crate) scanned: f64,
}

/// What the leftover beside columns `set` follows: of `terms`, each by the part that is worth
/// most after a price of `each` nats a column, or is most certain where none is worth it. `tried`
/// terms are paid for.
pub(crate) fn follows(
    fits: &Fits,
    set: &[usize],
    terms: &[Followed<'_>],
    tried: usize,
    each: f64,
    left: f64,
) -> Unattributed {
    let (base, before) = fits
        .out_of_fold(set)
        .map_or((0.0, 0.0), |o| (o.total_sse(), o.total_loglik()));
    let judge = |part: &[usize], term: &Followed<'_>| -> Option<Part> {
        let mut with = set.to_vec();
        with.extend(part);
        let which: Vec<usize> = (set.len()..with.len()).collect();
        let fold = fits.out_of_fold(&with)?;
        let estimate = fits.estimate(&with)?;
        if !term.group.believes(part, &estimate, set.len()) {
            return None;
        }
        let p = estimate.p_value(&which);
        let tried = (term.parts.len() * tried) as f64 * term.scanned.exp();
        let share = if base > 0.0 {
            1.0 - fold.total_sse() / base
        } else {
            0.0
        };
        let worth = fold.total_loglik() - before - each * part.len() as f64 - term.scanned;
        Some(Part {
            p_value: (p * tried).min(1.0),
            share,
            worth,
            columns: part.len(),
        })
    };
    fits.ask_all();
    // whether it is one of many, too
    let mut judged: Vec<(Dependence, f64, bool)> = terms
        .par_iter()
        .filter_map(|term| {
            let all = term.parts.iter();
            let all: Vec<Part> = all.filter_map(|part| judge(part, term)).collect();
            let worthy = all
                .iter()
                .filter(|p| p.p_value < SEARCH_ALPHA && p.worth > 0.0);
            let best = worthy
                .max_by(|a, b| a.worth.total_cmp(&b.worth))
                .or_else(|| all.iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value)))?;
            let entry = Dependence {
                variable: term.variable.clone(),
                variance_explained: best.share,
                p_value: best.p_value,
            };
            let whole = all.iter().map(|p| p.columns).max()?;
            Some((entry, best.worth, term.of_many && best.columns < whole))
        })
        .collect();
    // of two terms in the same variable the one that is certain, or worth more
    judged.sort_by(|a, b| {
        (is_beyond_chance(&b.0).cmp(&is_beyond_chance(&a.0))).then(b.1.total_cmp(&a.1))
    });
    judged = first_of_each(judged, |(d, ..)| &d.variable);
    // one star never wins against one slope that explains the same
    let slopes: Vec<Dependence> = judged
        .iter()
        .filter(|(d, _, one)| !one && is_beyond_chance(d))
        .map(|(d, ..)| d.clone())
        .collect();
    judged.retain(|(d, _, one)| {
        let same = |s: &Dependence| {
            s.p_value < d.p_value && SAME * s.variance_explained > d.variance_explained
        };
        !(*one && slopes.iter().any(same))
    });
    if judged
        .iter()
        .any(|(d, worth, _)| is_beyond_chance(d) && *worth > 0.0)
    {
        // a dozen columns follow anything a little
        judged.retain(|(d, worth, _)| is_beyond_chance(d) && *worth > 0.0);
    }
    // by what they are worth: squares out of fold know nothing of the priors of what is fitted beside them
    let mut depends_on: Vec<Dependence> = judged.into_iter().map(|(d, ..)| d).collect();
    let told = depends_on.iter().any(is_beyond_chance);
    if told {
        // what chance does as well is not named beside what it does not
        depends_on.retain(is_beyond_chance);
    }
    let share = if told { largest(&depends_on) } else { 0.0 };
    Unattributed {
        present: share > 0.0,
        variance_fraction: Some(share * left),
        depends_on,
        ..Unattributed::default()
    }
}

/// Of entries in order those that are the first of their variable.
pub(crate) fn first_of_each<T>(entries: Vec<T>, variable: impl Fn(&T) -> &String) -> Vec<T> {
    let mut told = BTreeSet::new();
    let first = entries.into_iter();
    first
        .filter(|entry| told.insert(variable(entry).clone()))
        .collect()
}

/// Whether what is left follows that beyond chance: where it follows nothing, `unattributed.depends_on` lists what comes
/// nearest.
#[must_use]
pub fn is_beyond_chance(d: &Dependence) -> bool {
    d.p_value < SEARCH_ALPHA && d.variance_explained > 0.0
}

/// The largest share among these, 0 where there is none.
pub(crate) fn largest(list: &[Dependence]) -> f64 {
    let shares = list.iter().map(|d| d.variance_explained);
    shares.fold(0.0, f64::max)
}

/// The empirical term that explains most of what is left, if one that a model can declare does, and stands as an effect
/// has to.
pub(crate) fn best_empirical(
    found: &Found,
    unattributed: &Unattributed,
    surroundings: &Surroundings<'_>,
) -> Option<usize> {
    let certain = unattributed
        .depends_on
        .iter()
        .filter(|d| is_beyond_chance(d));
    certain.filter_map(|d| term_of(found, d)).find(|&g| {
        let candidate = found.candidates[g].as_ref();
        let one = vec![1.0; candidate.coefficients().len()];
        found.selection.judged[g].stands_but_for_size()
            && candidate.realise(&one, surroundings).is_ok()
    })
}

/// The term of `found` in that variable: of several the one that gains most.
pub(crate) fn term_of(found: &Found, dependence: &Dependence) -> Option<usize> {
    let gain = |g: &usize| found.selection.judged[*g].delta_loglik;
    let terms = (0..found.candidates.len()).filter(|&g| {
        let candidate = found.candidates[g].as_ref();
        candidate.id() == EMPIRICAL
            && candidate.selectors().get("variable") == Some(&dependence.variable)
    });
    terms.max_by(|a, b| gain(a).total_cmp(&gain(b)))
}
