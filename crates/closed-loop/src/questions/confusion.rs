//! What else could have explained the residual, and what would tell.
//!
//! ```text
//! gain in place    ln L out of fold with the other effect instead, less that without either
//! separation       sigmas by which the other, alone, misses what was found (manoeuvre.rs)
//! ```
//!
//! Both on this data, and the separation on the manoeuvre that is recommended.
//!
//! Source: Fisher 1925 (information).

use std::collections::BTreeMap;

use effects::Candidate;
use nalgebra::{DMatrix, UnitQuaternion};
use telemetry::report::{FoundEffect, Selector, listed};

use crate::findings::{amplitudes_of, most_alike, told};
use crate::questions::manoeuvre::{Flown, Pair, recommend};
use crate::search::selection::columns_of;
use crate::search::{Found, without};

/// Pairs of effects: which effect, which of its confusable ones, and the columns of both among those
/// of `candidates`.
pub(crate) struct Confusion<'a> {
    at: Vec<[usize; 2]>,
    pairs: Vec<Pair>,
    pub(crate) candidates: Vec<&'a dyn Candidate>,
}

/// Lists the pairs and tells what this data says of them. `effects` are those of the selection, in
/// its order.
pub(crate) fn compare<'a>(found: &'a Found, effects: &mut [FoundEffect]) -> Confusion<'a> {
    let mut out = Confusion {
        at: Vec::new(),
        pairs: Vec::new(),
        candidates: Vec::new(),
    };
    let fits = &found.fitted.fits;
    let chosen = &found.selection.chosen;
    let set = columns_of(&found.fitted.groups, chosen);
    let (Some(estimate), Some(variance)) = (fits.estimate(&set), fits.variance(&set)) else {
        return out;
    };
    let starts = starts(found);
    // positions of candidates in the list that is flown
    let mut listed: Vec<usize> = Vec::new();
    let mut width = 0;
    let mut firsts: Vec<usize> = Vec::new();
    for (k, (&g, effect)) in chosen.iter().zip(effects.iter_mut()).enumerate() {
        let others = without(chosen, &[g]);
        let without = columns_of(&found.fitted.groups, &others);
        let base = fits.out_of_fold(&without).map(|o| o.total_loglik());
        let (amplitudes, _) = amplitudes_of(found, g, &set, &estimate);
        for (i, confusable) in effect.confusable_with.iter_mut().enumerate() {
            let Some((other, _)) = most_alike(found, g, &confusable.id) else {
                continue;
            };
            if told(&found.candidates[other].selectors()) != confusable.selectors {
                // a twin: no column of its own
                continue;
            }
            let mut instead = without.clone();
            instead.extend(&found.fitted.groups[other].columns);
            confusable.delta_loglik = fits
                .out_of_fold(&instead)
                .zip(base)
                .map(|(o, base)| o.total_loglik() - base);
            let mut columns = |g: usize| -> Vec<usize> {
                let at = listed.iter().position(|&l| l == g).unwrap_or_else(|| {
                    listed.push(g);
                    firsts.push(width);
                    width += found.candidates[g].coefficients().len();
                    listed.len() - 1
                });
                let p = found.candidates[g].coefficients().len();
                (firsts[at]..firsts[at] + p).collect()
            };
            let pair = Pair {
                columns: columns(g),
                amplitudes: amplitudes.clone(),
                other: columns(other),
                names: [
                    effect.id.clone(),
                    called(&confusable.id, &confusable.selectors, &effect.id),
                ],
            };
            out.at.push([k, i]);
            out.pairs.push(pair);
        }
    }
    out.candidates = listed
        .iter()
        .map(|&g| found.candidates[g].as_ref())
        .collect();
    // information of this data on the listed columns, the declared unknowns eliminated
    let columns: Vec<usize> = listed
        .iter()
        .flat_map(|&g| starts[g]..starts[g] + found.candidates[g].coefficients().len())
        .collect();
    let here = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
        let (a, b) = (columns[i], columns[j]);
        let size = (fits.information(a).max(0.0) * fits.information(b).max(0.0)).sqrt();
        fits.likeness(a, b) * size / variance
    });
    for (pair, [k, i]) in out.pairs.iter().zip(&out.at) {
        effects[*k].confusable_with[*i].separation_sigma = Some(pair.sigma(&here));
    }
    out
}

impl Confusion<'_> {
    /// Finds a manoeuvre for each pair and writes it to the effects.
    pub(crate) fn tell(
        &self,
        effects: &mut [FoundEffect],
        start_s: f64,
        from: UnitQuaternion<f64>,
        fly: &(dyn Fn(&Flown) -> Option<DMatrix<f64>> + Sync),
    ) {
        let manoeuvres = recommend(&self.pairs, start_s, from, fly);
        for (manoeuvre, [k, i]) in manoeuvres.into_iter().zip(&self.at) {
            effects[*k].confusable_with[*i].manoeuvre = manoeuvre;
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }
}

/// What `id` is called beside an effect called `own`: the same of another channel or star with what it acts on.
fn called(id: &str, selectors: &BTreeMap<String, Selector>, own: &str) -> String {
    if id != own {
        return id.to_owned();
    }
    format!("{id} of {}", listed(selectors))
}

/// First column of each candidate.
fn starts(found: &Found) -> Vec<usize> {
    found
        .candidates
        .iter()
        .scan(0, |next, c| {
            let first = *next;
            *next += c.coefficients().len();
            Some(first)
        })
        .collect()
}
