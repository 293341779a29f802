//! The search for causes: candidates, selection, refinement, until it stands.
//!
//! One round accumulates the normal equations of all candidates, selects out of
//! fold, and then polishes what was chosen: a parameter that the columns follow
//! non-linearly is scanned around its value on columns accumulated afresh, and a
//! candidate whose columns are linear only near zero is linearised again at its
//! estimate. Rounds repeat until the choice no longer changes.
//!
//! Source: variable projection (Golub & Pereyra 1973): linear amplitudes are
//! solved for at every trial value of the non-linear ones.

use std::ops::Deref;
use std::sync::Arc;

use block_regression::{Estimate, Folds};
use effects::Candidate;
use nalgebra::DVector;

use crate::error::CloseError;
use crate::evidence::{Amplitudes, Evidence, Residuals};
use crate::parabola::bottom;
pub(crate) use fitted::{
    Fitted, fit, fit_beside, fit_design, fit_grams, fit_grams_beside, fit_whole, layout_of,
};
use group::Group;
use selection::{Selection, columns_of, costs};

pub(crate) mod catalogue;
pub(crate) mod empirical;
mod fitted;
pub(crate) mod forms;
pub(crate) mod group;
pub(crate) mod instants;
pub(crate) mod misplaced;
pub(crate) mod near;
pub(crate) mod orbits;
pub(crate) mod refusal;
pub(crate) mod selection;

/// Values of a non-linear parameter tried at once, and how often the scan shrinks: fewest and most.
const SCAN: usize = 9;
const SCAN_ROUNDS: usize = 3;
const MOST_ROUNDS: usize = 12;
/// Twice the log-likelihood that a neighbouring value loses from which the scan goes on: a strong effect tells more.
const FINE: f64 = 4.0;
/// Rounds of selection and polish; the choice settles in two or three.
const ROUNDS: usize = 4;
/// Columns at an estimate that differ from those it was found with by less than this, in
/// squared sigmas over all data, are the same: no amplitude moves by a tenth of its sigma.
const SAME: f64 = 0.01;

/// Forms and parts of one cause: one id with one selector of what it acts on.
pub(crate) fn family(candidate: &dyn Candidate) -> String {
    let selectors = candidate.selectors();
    let on = ["channel", "star_id", "variable"]
        .iter()
        .filter_map(|key| selectors.get(*key))
        .fold(String::new(), |all, value| all + "/" + value);
    format!("{}{on}", candidate.id())
}

/// What a search ends with.
#[derive(Debug)]
pub(crate) struct Found {
    /// All candidates, those chosen in their polished form.
    pub(crate) candidates: Vec<Arc<dyn Candidate>>,
    /// Fits of exactly these candidates.
    pub(crate) fitted: Fitted,
    /// What was chosen among them.
    pub(crate) selection: Selection,
}

impl Found {
    /// What was chosen.
    pub(crate) fn chosen(&self) -> impl Iterator<Item = &dyn Candidate> {
        let chosen = self.selection.chosen.iter();
        chosen.map(|&g| self.candidates[g].as_ref())
    }

    /// What was chosen alone, fitted to `evidence`.
    pub(crate) fn refitted(
        &self,
        evidence: &dyn Evidence,
        folds: &Folds,
    ) -> Result<Self, CloseError> {
        Self::of_chosen(evidence, folds, &self.candidates, &self.selection.chosen)
    }

    /// The chosen of `candidates` alone, fitted to `evidence`.
    pub(crate) fn of_chosen(
        evidence: &dyn Evidence,
        folds: &Folds,
        candidates: &[Arc<dyn Candidate>],
        chosen: &[usize],
    ) -> Result<Self, CloseError> {
        let candidates: Vec<_> = chosen.iter().map(|&g| Arc::clone(&candidates[g])).collect();
        let chosen: Vec<usize> = (0..candidates.len()).collect();
        let fitted = fit_beside(evidence, folds, &borrowed(&candidates), &chosen)?;
        let selection = Selection {
            chosen,
            judged: Vec::new(),
        };
        Ok(Self {
            candidates,
            fitted,
            selection,
        })
    }

    /// The chosen amplitudes together, in the order of [`columns_of`].
    pub(crate) fn estimate(&self) -> Option<Estimate> {
        let set = columns_of(&self.fitted.groups, &self.selection.chosen);
        self.fitted.fits.estimate(&set)
    }

    /// The columns of candidate `g` that the data show, counted from its own first.
    pub(crate) fn own_columns(&self, g: usize) -> Vec<usize> {
        let first = first_column(&self.candidates, g);
        let columns = self.fitted.groups[g].columns.iter();
        columns.map(|c| c - first).collect()
    }

    /// What `chosen` leave out of fold.
    pub(crate) fn left_out_of_fold(
        &self,
        level: &dyn Evidence,
        folds: &Folds,
        chosen: &[usize],
    ) -> Result<Residuals, CloseError> {
        let only = self.only(chosen);
        let amplitudes = amplitudes_as(&self.fitted, folds, chosen, |beta| only.spread(beta));
        let amplitudes = amplitudes.ok_or(CloseError::Singular)?;
        Ok(level.residuals(folds, &only.candidates, &amplitudes))
    }

    /// Whether one of the candidates put forward last, `count` at the end of the list, was chosen.
    pub(crate) fn names_one_of_the_last(&self, count: usize) -> bool {
        let first = self.candidates.len() - count;
        self.selection.chosen.iter().any(|g| *g >= first)
    }

    /// Some of the candidates, and where their amplitudes stand among theirs alone:
    /// one place for each of [`columns_of`] them.
    pub(crate) fn only(&self, chosen: &[usize]) -> Only<'_> {
        Only::of(&self.candidates, &self.fitted.groups, chosen)
    }

    pub(crate) fn choice(&self) -> Choice<'_> {
        Choice {
            candidates: &self.candidates,
            fitted: &self.fitted,
            chosen: &self.selection.chosen,
        }
    }
}

/// What was chosen of some candidates, by fits of exactly these.
#[derive(Clone, Copy)]
pub(crate) struct Choice<'a> {
    pub(crate) candidates: &'a [Arc<dyn Candidate>],
    pub(crate) fitted: &'a Fitted,
    pub(crate) chosen: &'a [usize],
}

impl<'a> Choice<'a> {
    pub(crate) fn moves_light(&self) -> bool {
        self.chosen
            .iter()
            .any(|&g| self.candidates[g].moves_light())
    }

    pub(crate) fn only(&self) -> Only<'a> {
        Only::of(self.candidates, &self.fitted.groups, self.chosen)
    }

    /// What was chosen, with its places among the candidates.
    pub(crate) fn forms(&self) -> Vec<(usize, Arc<dyn Candidate>)> {
        let chosen = self.chosen.iter();
        let forms = chosen.map(|&g| (g, Arc::clone(&self.candidates[g])));
        forms.collect()
    }
}

/// Leading columns by which a term of one variable is judged, beside all of them: a
/// straight line, before what bends.
pub(crate) const LEADING: [usize; 2] = [2, 4];

/// See [`Found::only`].
pub(crate) struct Only<'a> {
    pub(crate) candidates: Vec<&'a dyn Candidate>,
    places: Vec<usize>,
    columns: usize,
}

impl<'a> Only<'a> {
    fn of(candidates: &'a [Arc<dyn Candidate>], groups: &[Group], chosen: &[usize]) -> Self {
        let mut only = Self {
            candidates: Vec::new(),
            places: Vec::new(),
            columns: 0,
        };
        for &g in chosen {
            let first = first_column(candidates, g);
            let columns = &groups[g].columns;
            only.places
                .extend(columns.iter().map(|c| only.columns + c - first));
            only.columns += candidates[g].coefficients().len();
            only.candidates.push(candidates[g].as_ref());
        }
        only
    }

    /// The `groups` of the `chosen`, their columns among those of the chosen alone.
    pub(crate) fn groups(&self, groups: &[Group], chosen: &[usize]) -> Vec<Group> {
        let mut places = self.places.iter().copied();
        let of = |&g: &usize| Group {
            columns: places.by_ref().take(groups[g].columns.len()).collect(),
            ..groups[g].clone()
        };
        chosen.iter().map(of).collect()
    }

    /// `beta` of the observable columns among all columns of the candidates.
    pub(crate) fn spread(&self, beta: &DVector<f64>) -> DVector<f64> {
        let mut all = DVector::zeros(self.columns);
        for (&place, b) in self.places.iter().zip(beta.iter()) {
            all[place] = *b;
        }
        all
    }
}

/// Runs rounds of selection and polish, the first on `start` where there is one.
/// Candidates that may not be chosen are judged.
pub(crate) fn search(
    evidence: &dyn Evidence,
    folds: &Folds,
    mut candidates: Vec<Arc<dyn Candidate>>,
    may: &[bool],
    mut start: Option<Fitted>,
) -> Result<Found, CloseError> {
    let mut before: Vec<usize> = Vec::new();
    let (mut last, mut compared) = (ROUNDS, false);
    for round in 1.. {
        let fitted = match start.take() {
            Some(fitted) => fitted,
            None => fit(evidence, folds, &borrowed(&candidates))?,
        };
        let (chosen, quieter) = fitted.chosen(folds, &candidates, may)?;
        let fitted = quieter.unwrap_or(fitted);
        let settled = chosen.is_empty() || chosen == before || round == last;
        if settled || !polish(evidence, folds, &mut candidates, &fitted, &chosen)? {
            if !compared && round < last {
                compared = true;
                if let Some(likelier) =
                    near::likelier(evidence, folds, &candidates, &fitted, &chosen, may)?
                {
                    candidates = likelier.candidates;
                    last = round + ROUNDS;
                    before.clear();
                    continue;
                }
            }
            return Ok(Found {
                selection: fitted.selection(chosen, may),
                candidates,
                fitted,
            });
        }
        before = chosen;
    }
    Err(CloseError::Singular)
}

/// The same with the parts of one effect that were chosen as one, in the place of the first of them.
pub(crate) fn joined(
    evidence: &dyn Evidence,
    folds: &Folds,
    found: Found,
    may: &[bool],
) -> Result<Found, CloseError> {
    let part_of = |g: usize| {
        let candidate = found.candidates[g].as_ref();
        candidate.part().map(|_| family(candidate))
    };
    let mut candidates = found.candidates.clone();
    let mut chosen = Vec::new();
    for &g in &found.selection.chosen {
        let effect = part_of(g);
        if effect.is_some() && chosen.iter().any(|&c| part_of(c) == effect) {
            continue;
        }
        let same = found.selection.chosen.iter().copied();
        let same = same.filter(|&c| part_of(c) == effect);
        let mut parts: Vec<u32> = same.filter_map(|c| found.candidates[c].part()).collect();
        parts.sort_unstable();
        if parts.len() > 1
            && let Some(whole) = candidates[g].of_parts(&parts)
        {
            candidates[g] = whole.into();
        }
        chosen.push(g);
    }
    if chosen.len() == found.selection.chosen.len() {
        return Ok(found);
    }
    let fitted = fit_beside(evidence, folds, &borrowed(&candidates), &chosen)?;
    let cost = costs(&fitted.groups, may);
    let judged = fitted.trials(&cost).judged(&chosen);
    Ok(Found {
        candidates,
        fitted,
        selection: Selection { chosen, judged },
    })
}

/// The place of the first column of candidate `g` among those of all.
pub(crate) fn first_column<'c, C>(candidates: &[C], g: usize) -> usize
where
    C: Deref<Target = dyn Candidate + 'c>,
{
    candidates[..g].iter().map(|c| c.coefficients().len()).sum()
}

/// What of `chosen` is not taken `out`.
pub(crate) fn without(chosen: &[usize], out: &[usize]) -> Vec<usize> {
    let kept = chosen.iter().copied();
    kept.filter(|g| !out.contains(g)).collect()
}

/// The candidates as the pipeline borrows them.
pub(crate) fn borrowed(candidates: &[Arc<dyn Candidate>]) -> Vec<&dyn Candidate> {
    candidates.iter().map(AsRef::as_ref).collect()
}

/// Improves each chosen candidate beside the others; returns whether any differs from what was fitted.
pub(crate) fn polish(
    evidence: &dyn Evidence,
    folds: &Folds,
    candidates: &mut [Arc<dyn Candidate>],
    fitted: &Fitted,
    chosen: &[usize],
) -> Result<bool, CloseError> {
    let set = columns_of(&fitted.groups, chosen);
    let Some(estimate) = fitted.fits.estimate(&set) else {
        return Ok(false);
    };
    let same = SAME * fitted.fits.variance(&set).unwrap_or(0.0);
    let mut changed = false;
    let mut first = 0;
    for &g in chosen {
        let columns = &fitted.groups[g].columns;
        let values: Vec<f64> = estimate
            .value
            .rows(first, columns.len())
            .iter()
            .copied()
            .collect();
        first += columns.len();
        let before = Arc::clone(&candidates[g]);
        let whole = columns.len() == before.coefficients().len();
        let better = whole.then(|| before.refined(&values)).flatten();
        let scanned = before.nonlinear().len();
        if better.is_none() && scanned == 0 {
            continue;
        }
        if let Some(better) = better {
            candidates[g] = better.into();
        }
        for k in 0..scanned {
            scan(evidence, folds, candidates, chosen, g, k)?;
        }
        let now = candidates[g].as_ref();
        if whole && evidence.distance(before.as_ref(), now, &values) <= same {
            candidates[g] = before;
        } else {
            changed = true;
            forms::along(candidates, g);
        }
    }
    Ok(changed)
}

/// Scans non-linear parameter `k` of candidate `g`, ever finer, and ends between values where the likelihood is a parabola.
fn scan(
    evidence: &dyn Evidence,
    folds: &Folds,
    candidates: &mut [Arc<dyn Candidate>],
    chosen: &[usize],
    g: usize,
    k: usize,
) -> Result<(), CloseError> {
    let parameter = candidates[g].nonlinear().swap_remove(k);
    let half = (SCAN / 2) as f64;
    let mut step = parameter.step / half;
    let moved = |form: &dyn Candidate, by: f64| -> Option<Arc<dyn Candidate>> {
        let mut values: Vec<f64> = form.nonlinear().iter().map(|n| n.value).collect();
        values[k] += by;
        form.with_nonlinear(&values).map(Arc::from)
    };
    for round in 1..=MOST_ROUNDS {
        let now = candidates[g].as_ref();
        let mut trial: Vec<Arc<dyn Candidate>> = (0..SCAN)
            .filter_map(|i| moved(now, step * (i as f64 - half)))
            .collect();
        let variants = trial.len();
        // The others stay in the fit beside each variant.
        let mut tried = borrowed(&trial);
        let others = chosen.iter().filter(|&&c| c != g);
        tried.extend(others.map(|&c| candidates[c].as_ref()));
        let fitted = fit_whole(evidence, folds, &tried)?;
        let with = |v: usize| {
            let set: Vec<usize> = std::iter::once(v)
                .chain(variants..fitted.groups.len())
                .collect();
            fitted.fits.variance(&columns_of(&fitted.groups, &set))
        };
        // twice what each loses in log-likelihood, up to a constant
        let lost: Vec<Option<f64>> = (0..variants)
            .map(|v| with(v).map(|variance| fitted.scalars * variance.ln()))
            .collect();
        let best = (0..variants)
            .filter_map(|v| Some((v, lost[v]?)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((v, least)) = best else {
            return Ok(());
        };
        candidates[g] = trial.swap_remove(v);
        let at = |n: Option<usize>| (*lost.get(n?)?).filter(|lost| lost.is_finite());
        let sides = [at(v.checked_sub(1)), at(Some(v + 1))];
        // the nearer one decides
        let nearer = sides.iter().flatten().copied().min_by(f64::total_cmp);
        if round >= SCAN_ROUNDS && nearer.is_none_or(|lost| lost - least <= FINE) {
            if parameter.difference.is_some()
                && let [Some(before), Some(behind)] = sides
                && let between = step * bottom([before, least, behind])
                && let Some(best) = moved(candidates[g].as_ref(), between)
            {
                candidates[g] = best;
            }
            break;
        }
        step *= 0.3;
    }
    Ok(())
}

/// Amplitudes of `chosen`, each fold from the others.
pub(crate) fn amplitudes(
    found: &Fitted,
    folds: &Folds,
    chosen: &[usize],
    columns: usize,
) -> Option<Amplitudes> {
    let set = columns_of(&found.groups, chosen);
    amplitudes_as(found, folds, chosen, |beta| {
        let mut all = DVector::zeros(columns);
        for (&c, b) in set.iter().zip(beta.iter()) {
            all[c] = *b;
        }
        all
    })
}

/// As [`amplitudes`], `spread` over the columns that are to be evaluated.
pub(crate) fn amplitudes_as(
    found: &Fitted,
    folds: &Folds,
    chosen: &[usize],
    spread: impl Fn(&DVector<f64>) -> DVector<f64>,
) -> Option<Amplitudes> {
    let set = columns_of(&found.groups, chosen);
    let mut out = Amplitudes {
        nuisance: Vec::new(),
        candidates: Vec::new(),
    };
    for f in 0..folds.count {
        let beta = found.fits.amplitudes_without(f, &set)?;
        out.nuisance.push(found.fits.nuisance(Some(f), &set, &beta));
        out.candidates.push(spread(&beta));
    }
    Some(out)
}
