//! Fits of a list of candidates, with the groups that selection moves.
//!
//! Priors are weighed against a noise that is estimated, never taken as declared: that of the data with no candidate in the
//! model, or that beside what was chosen where this is much less.
//!
//! Source: ordinary least squares under priors ([`block_regression`]).

use std::sync::Arc;

use block_regression::{BlockGrams, Design, Fits, Folds, Layout};
use effects::{Candidate, Coefficient};
use nalgebra::DMatrix;

use super::group::Group;
use super::selection::{Selection, Trials, columns_of, costs};
use super::{borrowed, family, first_column};
use crate::error::CloseError;
use crate::evidence::Evidence;

/// Amplitudes beyond this many plausible sigmas are not credible.
const CREDIBLE: f64 = 20.0;
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
            let first = first_column(candidates, g);
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
