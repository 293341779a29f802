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

use std::sync::Arc;

use block_regression::{BlockGrams, Design, Estimate, Fits, Folds, Layout};
use effects::{Candidate, Coefficient};
use nalgebra::{DMatrix, DVector};

use crate::error::CloseError;
use crate::evidence::{Amplitudes, Evidence, Residuals};
use group::Group;
use selection::{Selection, Trials, columns_of, costs};

pub(crate) mod catalogue;
pub(crate) mod empirical;
pub(crate) mod forms;
pub(crate) mod group;
pub(crate) mod instants;
pub(crate) mod misplaced;
pub(crate) mod orbits;
pub(crate) mod refusal;
pub(crate) mod selection;

/// Amplitudes beyond this many plausible sigmas are not credible.
const CREDIBLE: f64 = 20.0;
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
/// Noise beside what was chosen that is this much less than the noise which priors were weighed against
/// asks for another fit: what a large effect adds would squeeze the declared unknowns, and what these may
/// not be any more shows up as other effects.
const LOUDER: f64 = 1.5;

/// Fits of one list of candidates, with the groups that selection moves.
#[derive(Debug)]
pub(crate) struct Fitted {
    pub(crate) fits: Fits,
    pub(crate) groups: Vec<Group>,
    /// Independent scalars in the data.
    pub(crate) scalars: f64,
    /// Noise variance that the priors are weighed against.
    variance: f64,
    /// What the log-likelihood of the scalars lacks to that of the measurements in
    /// arcsec, nats.
    pub(crate) log_scale: f64,
}

impl Fitted {
    /// What its groups are tried on, each of which pays its `cost` for the search.
    pub(crate) fn trials<'a>(&'a self, cost: &'a [f64]) -> Trials<'a> {
        Trials {
            fits: &self.fits,
            groups: &self.groups,
            cost,
            scalars: self.scalars,
        }
    }

    /// What the log-likelihood gains where the squared error falls from `before` to `after`, nats.
    pub(crate) fn nats(&self, before: f64, after: f64) -> f64 {
        0.5 * self.scalars * (before / after).ln()
    }

    /// Noise variance beside `chosen`.
    pub(crate) fn variance_beside(&self, chosen: &[usize]) -> Option<f64> {
        self.fits.variance(&columns_of(&self.groups, chosen))
    }

    /// Log-likelihood of the measurements in arcsec out of fold, beside these columns.
    pub(crate) fn data_loglik(&self, columns: &[usize]) -> Option<f64> {
        let out_of_fold = self.fits.out_of_fold(columns)?;
        Some(out_of_fold.data_loglik() + self.log_scale)
    }

    /// These fits with priors weighed against the noise beside `chosen`, where that is much less.
    pub(crate) fn beside(
        self,
        folds: &Folds,
        candidates: &[&dyn Candidate],
        chosen: &[usize],
    ) -> Result<Self, CloseError> {
        let quieter = self.quieter(folds, candidates, chosen)?;
        Ok(quieter.unwrap_or(self))
    }

    /// As [`beside`](Self::beside); `None` where the noise is not much less.
    fn quieter(
        &self,
        folds: &Folds,
        candidates: &[&dyn Candidate],
        chosen: &[usize],
    ) -> Result<Option<Self>, CloseError> {
        let left = self.variance_beside(chosen);
        let Some(variance) = left.filter(|v| is_much_less(*v, self.variance)) else {
            return Ok(None);
        };
        let fits = self.fits.reweighed(folds, variance);
        let fits = fits.ok_or(CloseError::Singular)?;
        Ok(Some(Self {
            groups: grouped(&fits, candidates),
            fits,
            variance,
            ..*self
        }))
    }

    /// Chooses, and again where what was chosen leaves much less noise than the priors were weighed against: on other
    /// fits then.
    pub(crate) fn chosen(
        &self,
        folds: &Folds,
        candidates: &[Arc<dyn Candidate>],
        may: &[bool],
    ) -> Result<(Vec<usize>, Option<Self>), CloseError> {
        let choose = |f: &Self| f.trials(&costs(&f.groups, may)).choose(may);
        let chosen = choose(self);
        let quieter = self.quieter(folds, &borrowed(candidates), &chosen)?;
        let chosen = quieter.as_ref().map_or(chosen, choose);
        Ok((chosen, quieter))
    }

    /// What was `chosen` of those that `may` be, with the standing of all beside it.
    pub(crate) fn selection(&self, chosen: Vec<usize>, may: &[bool]) -> Selection {
        let judged = self.trials(&costs(&self.groups, may)).judged(&chosen);
        Selection { chosen, judged }
    }
}

/// Whether a noise variance is so much less than another that priors are to be weighed against it.
fn is_much_less(variance: f64, than: f64) -> bool {
    variance > 0.0 && LOUDER * variance < than
}

/// Accumulates and eliminates; the noise variance that weighs the priors is
/// estimated, never taken as declared.
pub(crate) fn fit(
    evidence: &dyn Evidence,
    folds: &Folds,
    candidates: &[&dyn Candidate],
) -> Result<Fitted, CloseError> {
    fit_grams(
        evidence,
        &evidence.grams(folds, candidates),
        folds,
        candidates,
    )
}

/// As [`fit`], with priors weighed against the noise beside `chosen` ([`Fitted::beside`]).
pub(crate) fn fit_beside(
    evidence: &dyn Evidence,
    folds: &Folds,
    candidates: &[&dyn Candidate],
    chosen: &[usize],
) -> Result<Fitted, CloseError> {
    let grams = evidence.grams(folds, candidates);
    fit_grams_beside(evidence, &grams, folds, candidates, chosen)
}

/// As [`fit`], on columns that are there already.
pub(crate) fn fit_design(
    evidence: &dyn Evidence,
    design: &dyn Design,
    folds: &Folds,
    candidates: &[&dyn Candidate],
) -> Result<Fitted, CloseError> {
    let grams = BlockGrams::accumulate(design, folds);
    fit_grams(evidence, &grams, folds, candidates)
}

/// As [`fit`], on normal equations that are there already.
pub(crate) fn fit_grams(
    evidence: &dyn Evidence,
    grams: &BlockGrams,
    folds: &Folds,
    candidates: &[&dyn Candidate],
) -> Result<Fitted, CloseError> {
    fit_grams_beside(evidence, grams, folds, candidates, &[])
}

/// As [`fit_beside`], on normal equations that are there already.
pub(crate) fn fit_grams_beside(
    evidence: &dyn Evidence,
    grams: &BlockGrams,
    folds: &Folds,
    candidates: &[&dyn Candidate],
    chosen: &[usize],
) -> Result<Fitted, CloseError> {
    let sums = grams.by_fold(folds);
    let of = |layout: &Layout, v| Fits::of(grams, &sums, folds, layout, v);
    fitted(evidence, candidates, chosen, &sums.all, grams.log_scale, of)
}

/// As [`fit`], for what asks nothing of folds and blocks ([`Fits::whole`]).
pub(crate) fn fit_whole(
    evidence: &dyn Evidence,
    folds: &Folds,
    candidates: &[&dyn Candidate],
) -> Result<Fitted, CloseError> {
    let grams = evidence.grams_in_all(folds, candidates);
    let of = |layout: &Layout, v| Fits::whole(&grams, layout, v);
    fitted(
        evidence,
        candidates,
        &[],
        &grams.total(),
        grams.log_scale,
        of,
    )
}

/// The fits that `of` makes of normal equations whose sum is `total`: by the columns, and the variance that priors are
/// weighed against, that beside `chosen` where it is much less than with no candidate.
fn fitted(
    evidence: &dyn Evidence,
    candidates: &[&dyn Candidate],
    chosen: &[usize],
    total: &(DMatrix<f64>, f64),
    log_scale: f64,
    of: impl FnOnce(&Layout, f64) -> Option<Fits>,
) -> Result<Fitted, CloseError> {
    let layout = layout_of(evidence, candidates);
    let guess = evidence.variance_guess();
    let alone = Fits::noise_beside(total, &layout, &[], guess);
    let alone = alone.unwrap_or(guess).max(f64::MIN_POSITIVE);
    let beside = || {
        let columns = |&g: &usize| {
            let first: usize = candidates[..g].iter().map(|c| c.coefficients().len()).sum();
            first..first + candidates[g].coefficients().len()
        };
        let own: Vec<usize> = chosen.iter().flat_map(columns).collect();
        Fits::noise_beside(total, &layout, &own, alone)
    };
    let beside = (!chosen.is_empty()).then(beside).flatten();
    let variance = beside.filter(|v| is_much_less(*v, alone)).unwrap_or(alone);
    let fits = of(&layout, variance).ok_or(CloseError::Singular)?;
    Ok(Fitted {
        groups: grouped(&fits, candidates),
        fits,
        scalars: total.1,
        variance,
        log_scale,
    })
}

/// What the columns of normal equations with `candidates` in them are.
pub(crate) fn layout_of(evidence: &dyn Evidence, candidates: &[&dyn Candidate]) -> Layout {
    Layout {
        nuisance_precision: evidence.precision(),
        relative: evidence.relative(),
        candidates: candidates.iter().map(|c| c.coefficients().len()).sum(),
        residuals: evidence.residual_columns(),
    }
}

/// The columns that the data shows, candidate by candidate.
fn grouped(fits: &Fits, candidates: &[&dyn Candidate]) -> Vec<Group> {
    let mut groups = Vec::new();
    let mut column = 0;
    for candidate in candidates {
        let p = candidate.coefficients().len();
        let columns: Vec<usize> = (column..column + p).filter(|&c| fits.shows(c)).collect();
        let bounds = columns
            .iter()
            .map(|c| credible(&candidate.coefficients()[c - column]))
            .collect();
        // axis by axis
        let about_z = |c: &usize| candidate.turns_camera() && c - column >= 2 * p / 3;
        let across = columns.iter().filter(|&c| !about_z(c)).count() % columns.len().max(1);
        groups.push(Group {
            columns,
            bounds,
            choices: candidate.choices(),
            across,
            shapes: candidate.nonlinear().len(),
            slopes: candidate.slopes(),
            family: match candidate.part() {
                Some(part) => format!("{}/part {part}", family(*candidate)),
                None => family(*candidate),
            },
            reach: candidate.reach_px(),
            kind: candidate.id(),
            stands_for: candidate.stands_for(),
            credit: candidate.credit(),
        });
        column += p;
    }
    groups
}

/// Sizes of a coefficient that are still credible.
fn credible(coefficient: &Coefficient) -> [f64; 2] {
    let most = CREDIBLE * coefficient.plausible;
    let or = |limit: f64, most: f64| if limit.is_finite() { limit } else { most };
    [or(coefficient.lower, -most), or(coefficient.upper, most)]
}

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
    for round in 1.. {
        let fitted = match start.take() {
            Some(fitted) => fitted,
            None => fit(evidence, folds, &borrowed(&candidates))?,
        };
        let (chosen, quieter) = fitted.chosen(folds, &candidates, may)?;
        let fitted = quieter.unwrap_or(fitted);
        let settled = chosen.is_empty() || chosen == before || round == ROUNDS;
        if settled || !polish(evidence, folds, &mut candidates, &fitted, &chosen)? {
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
pub(crate) fn first_column(candidates: &[Arc<dyn Candidate>], g: usize) -> usize {
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

/// Scans non-linear parameter `k` of candidate `g`, ever finer.
fn scan(
    evidence: &dyn Evidence,
    folds: &Folds,
    candidates: &mut [Arc<dyn Candidate>],
    chosen: &[usize],
    g: usize,
    k: usize,
) -> Result<(), CloseError> {
    let mut step = candidates[g].nonlinear()[k].step;
    for round in 1..=MOST_ROUNDS {
        let now: Vec<f64> = candidates[g].nonlinear().iter().map(|n| n.value).collect();
        let half = (SCAN / 2) as f64;
        let mut trial: Vec<Arc<dyn Candidate>> = Vec::new();
        for i in 0..SCAN {
            let mut value = now.clone();
            value[k] += step * (i as f64 - half) / half;
            trial.extend(candidates[g].with_nonlinear(&value).map(Arc::from));
        }
        let variants = trial.len();
        // The others stay in the fit beside each variant.
        let mut tried = borrowed(&trial);
        tried.extend(
            chosen
                .iter()
                .filter(|&&c| c != g)
                .map(|&c| candidates[c].as_ref()),
        );
        let fitted = fit_whole(evidence, folds, &tried)?;
        let with = |v: usize| {
            let set: Vec<usize> = std::iter::once(v)
                .chain(variants..fitted.groups.len())
                .collect();
            fitted.fits.variance(&columns_of(&fitted.groups, &set))
        };
        let each: Vec<Option<f64>> = (0..variants).map(with).collect();
        let best = (0..variants)
            .filter_map(|v| Some((v, each[v]?)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((v, least)) = best else {
            return Ok(());
        };
        // twice what a neighbour loses in log-likelihood: the nearer one decides
        let lost = [v.checked_sub(1), Some(v + 1)]
            .into_iter()
            .flatten()
            .filter_map(|n| *each.get(n)?)
            .map(|variance| fitted.scalars * (variance / least).ln())
            .filter(|lost| lost.is_finite())
            .min_by(f64::total_cmp);
        candidates[g] = trial.swap_remove(v);
        step *= 0.3;
        if round >= SCAN_ROUNDS && lost.is_none_or(|lost| lost <= FINE) {
            break;
        }
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
