//! Effects that stand in for a cause outside the catalogue.
//!
//! A residual that follows variables for a reason that nobody listed is fitted best by
//! these. Effects of the catalogue take some of it: a pile of shifted stars in place of a
//! slope in magnitude, a distortion in place of charge left behind. So once effects are
//! chosen, each of them, each pile of one kind, and all together are held against the best
//! description by up to three terms ([`crate::search::empirical`]), term after term,
//!
//! ```text
//! worth(set) = L(rest + set) - L(rest) - price(set)     L: log-likelihood out of fold
//! ```
//!
//! and a set that a description beats by far is not named: it is said what the leftover
//! follows. A term holds the effects that act through its variable as special cases with
//! more parameters, so that it does not beat an effect that does act.
//!
//! Source: Schwarz 1978 for the price of a parameter.

use crate::causes::description::Described;
use crate::search::selection::{FAMILY_ALPHA, columns_of, each};

/// Nats by which a description must be worth more.
pub(crate) const BY_FAR: f64 = 8.0;
/// Terms of a description.
const MOST_TERMS: usize = 3;
/// Nats that a further term must be worth.
const WORTH: f64 = 3.0;

/// A term and the columns of it, counted from its own first.
pub(crate) type Part = (usize, Vec<usize>);

/// The chosen set (positions among the chosen) that a description beats by most, if one
/// does, and that description.
pub(crate) fn stand_ins(described: &Described) -> Option<(Vec<usize>, Vec<Part>)> {
    let groups = &described.fitted.groups;
    let chosen = &described.chosen;
    let all = described
        .fitted
        .fits
        .out_of_fold(&columns_of(groups, chosen))?;
    let all = all.total_loglik();
    let mut most = None;
    let mut by = BY_FAR;
    for set in sets(described) {
        let rest: Vec<usize> = chosen
            .iter()
            .copied()
            .filter(|g| !set.contains(g))
            .collect();
        let paid: f64 = set.iter().map(|&k| described.paid[k]).sum();
        let Some((worth, parts)) = describe(described, &columns_of(groups, &rest)) else {
            continue;
        };
        if worth - (all - paid) > by {
            by = worth - (all - paid);
            most = Some((set, parts));
        }
    }
    most
}

/// The best description of what `rest` leaves: its likelihood after all prices.
pub(crate) fn describe(described: &Described, rest: &[usize]) -> Option<(f64, Vec<Part>)> {
    let fits = &described.fitted.fits;
    let each = each(described.fitted.scalars);
    let tried: usize = described.terms.iter().map(|t| t.parts.len()).sum();
    let mut with = rest.to_vec();
    let mut worth = fits.out_of_fold(&with)?.total_loglik();
    let mut parts = Vec::new();
    while parts.len() < MOST_TERMS {
        let mut best: Option<(f64, usize, &Vec<usize>)> = None;
        for (k, term) in described.terms.iter().enumerate() {
            for part in &term.parts {
                if part.iter().any(|c| with.contains(c)) {
                    continue;
                }
                let mut trial = with.clone();
                trial.extend(part);
                let Some(fit) = fits.out_of_fold(&trial) else {
                    continue;
                };
                // what is in the description already has been paid for
                let bought = with.len() - rest.len() + part.len();
                let gain = fit.total_loglik() - each * bought as f64;
                let certain = || {
                    let which: Vec<usize> = (with.len()..trial.len()).collect();
                    fits.estimate(&trial)
                        .is_some_and(|e| e.p_value(&which) * (tried as f64) < FAMILY_ALPHA)
                };
                if gain > worth + WORTH
                    && best.as_ref().is_none_or(|(most, ..)| gain > *most)
                    && certain()
                {
                    best = Some((gain, k, part));
                }
            }
        }
        let Some((gain, k, part)) = best else { break };
        worth = gain;
        with.extend(part);
        let first = described.terms[k].first;
        parts.push((k, part.iter().map(|c| c - first).collect()));
    }
    (!parts.is_empty()).then_some((worth, parts))
}

/// Each effect, each pile of one kind, and all.
fn sets(described: &Described) -> Vec<Vec<usize>> {
    let chosen = &described.chosen;
    let mut sets: Vec<Vec<usize>> = chosen.iter().map(|&g| vec![g]).collect();
    for &g in chosen {
        let pile: Vec<usize> = chosen
            .iter()
            .copied()
            .filter(|&c| described.names[c] == described.names[g])
            .collect();
        if pile.len() > 1 && !sets.contains(&pile) {
            sets.push(pile);
        }
    }
    if chosen.len() > 1 && !sets.contains(chosen) {
        sets.push(chosen.clone());
    }
    sets
}
