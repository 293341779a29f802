//! Effects that stand in for a cause outside the catalogue.
//!
//! A residual that follows one variable for a reason that nobody listed is fitted best by
//! that variable. Effects of the catalogue take some of it: a pile of shifted stars in
//! place of a slope in magnitude, a distortion in place of charge left behind. So once
//! effects are chosen, each of them, each pile of one kind, and all together are held
//! against the terms of one variable ([`crate::empirical`]),
//!
//! ```text
//! worth(set) = L(rest + set) - L(rest) - price(set)     L: log-likelihood out of fold
//! ```
//!
//! and a set that a term beats by far is not named: it is said what the leftover follows.
//! A term holds the effects that act through its variable as special cases with more
//! parameters, so that it does not beat an effect that does act.
//!
//! Source: Schwarz 1978 for the price of a parameter.

use crate::empirical::EMPIRICAL;
use crate::search::{Found, LEADING};
use crate::selection::{FAMILY_ALPHA, columns_of, price};

/// Nats by which a term must be worth more.
const BY_FAR: f64 = 8.0;

/// The chosen set that a term of one variable beats by most, if any does.
pub(crate) fn stand_ins(found: &Found) -> Vec<usize> {
    let (groups, fits) = (&found.fitted.groups, &found.fitted.fits);
    let chosen = &found.selection.chosen;
    let each = 0.5 * found.fitted.scalars.max(2.0).ln();
    let terms: Vec<usize> = (0..groups.len())
        .filter(|&g| found.candidates[g].id() == EMPIRICAL && !groups[g].columns.is_empty())
        .collect();
    let Some(all) = fits.out_of_fold(&columns_of(groups, chosen)) else {
        return Vec::new();
    };
    let all = all.total_loglik();
    let mut most = (BY_FAR, Vec::new());
    for set in sets(found) {
        let rest: Vec<usize> = chosen
            .iter()
            .copied()
            .filter(|g| !set.contains(g))
            .collect();
        let paid: f64 = set
            .iter()
            .map(|&g| price(&groups[g], found.fitted.scalars))
            .sum();
        for &term in &terms {
            for part in found.parts(term, &LEADING) {
                let mut with = columns_of(groups, &rest);
                let own = with.len();
                with.extend(part);
                let Some(instead) = fits.out_of_fold(&with) else {
                    continue;
                };
                let more = instead.total_loglik() - each * part.len() as f64 - (all - paid);
                let certain = || {
                    let which: Vec<usize> = (own..with.len()).collect();
                    let tried = (terms.len() * (LEADING.len() + 1)) as f64;
                    fits.estimate(&with)
                        .is_some_and(|e| e.p_value(&which) * tried < FAMILY_ALPHA)
                };
                if more > most.0 && certain() {
                    most = (more, set.clone());
                }
            }
        }
    }
    most.1
}

/// Each effect, each pile of one kind, and all.
fn sets(found: &Found) -> Vec<Vec<usize>> {
    let chosen = &found.selection.chosen;
    let mut sets: Vec<Vec<usize>> = chosen.iter().map(|&g| vec![g]).collect();
    for &g in chosen {
        let id = found.candidates[g].id();
        let pile: Vec<usize> = chosen
            .iter()
            .copied()
            .filter(|&c| found.candidates[c].id() == id)
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
