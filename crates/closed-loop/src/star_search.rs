//! The search at star level where the reference itself may err.
//!
//! White evidence takes the slow error of a reference for steps, lines and
//! heaters; noise fitted to everything takes slow effects for an error of the
//! reference. So each hypothesis is held against the data at its own best noise,
//!
//! ```text
//! L(H) = max over noise, amplitudes of ln p(data | H)       2 (L(H1) - L(H0)) ~ chi2_p
//! ```
//!
//! Candidates are put forward twice, by what white evidence and by what the present
//! noise makes of them; the few best of each are scored, and the best that stands
//! is added. An effect beside which the reference needs no slow error competes with
//! that error as a whole: it stands if white evidence says so and it is the likelier
//! of the two. Where the rotations of the declared model's residual are white, the
//! plain search is all there is.
//!
//! Source: Wilks 1938 (likelihood ratio).

use effects::Candidate;
use nalgebra::DVector;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::common_noise::{CommonNoise, Rotations};
use crate::error::CloseError;
use crate::evidence::{Amplitudes, Evidence};
use crate::fit::Estimate;
use crate::folds::Folds;
use crate::search::{Fitted, Found, borrowed, fit, polish, search};
use crate::selection::{FAMILY_ALPHA, Judgement, Selection, columns_of, judged, price, ranked};
use crate::star_design::StarEvidence;

/// Candidates of each list that are scored.
const SHORTLIST: usize = 3;
/// Rounds of generalised least squares and noise fit.
const ALTERNATIONS: usize = 2;
/// The ratio of a noise model that is only nearly right runs this much wider than
/// chi-squared (as at attitude level).
pub(crate) const WIDENING: f64 = 1.3;
/// An effect that leaves no slow error behind explains the residual in its place:
/// it has to be this many times likelier (natural logarithm).
const INSTEAD: f64 = 6.0;
/// ... and beyond doubt under white noise: a wandering reference looks like a step
/// or a heater at 1e-3 in one of three runs of ten minutes, at 1e-5 in one of thirty.
const INSTEAD_ALPHA: f64 = 1e-7;
/// Most effects that are added.
const MOST: usize = 8;

/// The slow error of the reference as it was found.
#[derive(Clone, Debug)]
pub(crate) struct Wander {
    pub(crate) noise: CommonNoise,
    pub(crate) rotations: Rotations,
    /// Twice the gain in log-likelihood of each axis.
    pub(crate) ratio: [f64; 3],
}

/// What the search ends with.
pub(crate) struct Searched<'a> {
    pub(crate) found: Found,
    /// The evidence under the noise that was found; `None`: as it was given.
    pub(crate) evidence: Option<StarEvidence<'a>>,
    pub(crate) wander: Option<Wander>,
}

/// Runs the search on `white` evidence. Candidates for which `eligible` is false
/// are judged but never chosen.
pub(crate) fn run<'a>(
    white: &StarEvidence<'a>,
    folds: &Folds,
    candidates: &dyn Fn() -> Vec<Box<dyn Candidate>>,
    eligible: &dyn Fn(&dyn Candidate) -> bool,
) -> Result<Searched<'a>, CloseError> {
    let alone = white.data.free_attitude || white.residuals.len() != 1;
    let start = if alone {
        None
    } else {
        declared_noise(white, folds)?
    };
    if let Some(start) = start {
        let searched = coloured(white, folds, candidates(), eligible, start)?;
        // Less than that imitates no effect, and would only hide one.
        if searched
            .wander
            .as_ref()
            .is_some_and(|w| w.axes().contains(&true))
        {
            return Ok(searched);
        }
    }
    Ok(Searched {
        found: search(white, folds, candidates(), eligible)?,
        evidence: None,
        wander: None,
    })
}

/// Noise of the declared model's residual, where it may hold a slow error. How much
/// of one shows only later: what is fitted here (a distortion under drifting stars)
/// takes some of it along.
fn declared_noise(
    white: &StarEvidence<'_>,
    folds: &Folds,
) -> Result<Option<CommonNoise>, CloseError> {
    let fitted = fit(white, folds, &[])?;
    let noise = rotations(white, folds, &fitted, &[], None).map(|r| r.noise(None));
    Ok(noise.filter(|n| n.reference.iter().any(|r| r.slow > 0.0)))
}

/// Rotations of what the fit leaves, in sample.
fn rotations(
    white: &StarEvidence<'_>,
    folds: &Folds,
    fitted: &Fitted,
    candidates: &[&dyn Candidate],
    estimate: Option<&Estimate>,
) -> Option<Rotations> {
    let all: Vec<usize> = (0..fitted.groups.len()).collect();
    let set = columns_of(&fitted.groups, &all);
    let columns = candidates.iter().map(|c| c.coefficients().len()).sum();
    let mut beta = DVector::zeros(columns);
    let value = estimate.map_or_else(|| DVector::zeros(0), |e| e.value.clone());
    for (i, &c) in set.iter().enumerate() {
        beta[c] = value[i];
    }
    let amplitudes = Amplitudes {
        nuisance: vec![fitted.fits.nuisance(None, &set, &value)],
        candidates: vec![beta],
    };
    let whole = Folds::whole(white.data.frames.frames());
    let left = white.residuals(&whole, candidates, &amplitudes);
    let freedom = white.nuisance.columns() + set.len();
    Rotations::of(white.data, &left.axes, folds, freedom)
}

/// A hypothesis at its best noise.
#[derive(Clone, Debug)]
struct Scored {
    noise: CommonNoise,
    rotations: Rotations,
    loglik: f64,
    out_of_fold: f64,
    estimate: Estimate,
    /// Columns of each candidate within the estimate, and whether its sizes are credible.
    parts: Vec<(std::ops::Range<usize>, bool)>,
}

impl Scored {
    /// Whether this hypothesis does without the slow error that `other` needs;
    /// `white_p` is what white evidence says of what it adds.
    fn stands_instead(&self, other: &Self, white_p: f64) -> bool {
        let slow = |s: &Self| significant(&s.rotations.slow_ratio(&s.noise)).contains(&true);
        white_p < INSTEAD_ALPHA
            && self.loglik > other.loglik + INSTEAD
            && !slow(self)
            && slow(other)
    }
}

/// The list of candidates, and what scores them.
struct Trial<'a, 'd> {
    white: &'a StarEvidence<'d>,
    folds: &'a Folds,
    candidates: &'a [Box<dyn Candidate>],
}

impl Trial<'_, '_> {
    /// `chosen` at the better of two starts: all that fits taken out, or `noise`.
    fn score(&self, chosen: &[usize], noise: &CommonNoise) -> Option<Scored> {
        let list: Vec<&dyn Candidate> = chosen
            .iter()
            .map(|&g| self.candidates[g].as_ref())
            .collect();
        let taken_out = {
            let fitted = fit(self.white, self.folds, &list).ok()?;
            let all: Vec<usize> = (0..list.len()).collect();
            let estimate = fitted.fits.estimate(&columns_of(&fitted.groups, &all))?;
            rotations(self.white, self.folds, &fitted, &list, Some(&estimate))?.noise(None)
        };
        [taken_out, *noise]
            .iter()
            .filter_map(|start| self.climb(&list, start))
            .max_by(|a, b| a.loglik.total_cmp(&b.loglik))
    }

    fn climb(&self, list: &[&dyn Candidate], start: &CommonNoise) -> Option<Scored> {
        let mut noise = *start;
        for round in 0..=ALTERNATIONS {
            let evidence = self.white.with_noise(&noise);
            let fitted = fit(&evidence, self.folds, list).ok()?;
            let all: Vec<usize> = (0..list.len()).collect();
            let set = columns_of(&fitted.groups, &all);
            let estimate = fitted.fits.estimate(&set)?;
            let rotations = rotations(self.white, self.folds, &fitted, list, Some(&estimate))?;
            let better = rotations.noise(Some(&noise));
            if round < ALTERNATIONS && !better.is_like(&noise) {
                noise = better;
                continue;
            }
            let mut first = 0;
            let parts = fitted
                .groups
                .iter()
                .map(|group| {
                    let own = first..first + group.columns.len();
                    first = own.end;
                    let credible = own
                        .clone()
                        .zip(&group.bounds)
                        .all(|(i, [low, high])| (*low..=*high).contains(&estimate.value[i]));
                    (own, credible)
                })
                .collect();
            return Some(Scored {
                noise,
                rotations,
                loglik: fitted.fits.log_marginal(&set)? + evidence.log_scale(),
                out_of_fold: fitted.fits.out_of_fold(&set)?.total_loglik() + evidence.log_scale(),
                estimate,
                parts,
            });
        }
        None
    }

    /// What the last of the candidates of `with` adds to `without`.
    fn judge(
        &self,
        with: &Scored,
        at: usize,
        without: &Scored,
        choices: usize,
        tried: usize,
    ) -> Judgement {
        let (columns, credible) = &with.parts[at];
        let freedom = columns.len() + choices;
        let ratio = 2.0 * (with.loglik - without.loglik) / WIDENING;
        let likely = ChiSquared::new(freedom as f64).map_or(1.0, |law| law.sf(ratio.max(0.0)));
        let which: Vec<usize> = columns.clone().collect();
        let p = likely.max(with.estimate.p_value(&which));
        Judgement {
            delta_loglik: with.out_of_fold - without.out_of_fold,
            p_value: (p * tried as f64).min(1.0),
            credible: *credible,
            observable: !columns.is_empty(),
        }
    }
}

fn coloured<'a>(
    white: &StarEvidence<'a>,
    folds: &Folds,
    mut candidates: Vec<Box<dyn Candidate>>,
    eligible: &dyn Fn(&dyn Candidate) -> bool,
    start: CommonNoise,
) -> Result<Searched<'a>, CloseError> {
    let may: Vec<bool> = candidates.iter().map(|c| eligible(c.as_ref())).collect();
    let tried = may.iter().filter(|m| **m).count().max(1);
    let mut banned = vec![false; candidates.len()];
    let mut chosen: Vec<usize> = Vec::new();
    let mut noise = start;
    loop {
        let plain = fit(white, folds, &borrowed(&candidates))?;
        let filtered = fit(&white.with_noise(&noise), folds, &borrowed(&candidates))?;
        let trial = Trial {
            white,
            folds,
            candidates: &candidates,
        };
        let base = trial.score(&chosen, &noise).ok_or(CloseError::Singular)?;
        noise = base.noise;
        let mut stands = Vec::new();
        let mut fallen = None;
        let white_alone = judged(&plain.fits, &plain.groups, &chosen, tried);
        for (at, &g) in chosen.iter().enumerate() {
            let others: Vec<usize> = chosen.iter().copied().filter(|&c| c != g).collect();
            let without = trial.score(&others, &noise).ok_or(CloseError::Singular)?;
            let mut judgement = trial.judge(&base, at, &without, plain.groups[g].choices, tried);
            if base.stands_instead(&without, white_alone[g].p_value) {
                judgement.p_value = white_alone[g].p_value;
            }
            if !judgement.stands() {
                fallen = Some(g);
            }
            stands.push(judgement);
        }
        if let Some(g) = fallen {
            banned[g] = true;
            chosen.retain(|&c| c != g);
            continue;
        }
        let open: Vec<bool> = (0..candidates.len())
            .map(|g| may[g] && !banned[g])
            .collect();
        let mut shortlist: Vec<usize> = Vec::new();
        if chosen.len() < MOST {
            for fitted in [&plain, &filtered] {
                let list = ranked(
                    &fitted.fits,
                    &fitted.groups,
                    &open,
                    &chosen,
                    fitted.scalars,
                    tried,
                );
                shortlist.extend(list.into_iter().take(SHORTLIST));
            }
        }
        shortlist.sort_unstable();
        shortlist.dedup();
        let best = shortlist
            .into_iter()
            .filter_map(|g| {
                let mut with = chosen.clone();
                with.push(g);
                let scored = trial.score(&with, &noise)?;
                let group = &plain.groups[g];
                let mut judgement = trial.judge(&scored, chosen.len(), &base, group.choices, tried);
                if scored.stands_instead(&base, white_alone[g].p_value) {
                    judgement.p_value = white_alone[g].p_value;
                }
                let rank = judgement.delta_loglik - price(group, plain.scalars);
                judgement.stands().then_some((g, rank, scored.noise))
            })
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((added, _, its_noise)) = best else {
            let evidence = white.with_noise(&noise);
            let fitted = fit(&evidence, folds, &borrowed(&candidates))?;
            let mut judged = judged(&fitted.fits, &fitted.groups, &chosen, tried);
            for (&g, judgement) in chosen.iter().zip(stands) {
                judged[g] = judgement;
            }
            let ratio = base.rotations.slow_ratio(&noise);
            return Ok(Searched {
                found: Found {
                    candidates,
                    fitted,
                    selection: Selection { chosen, judged },
                },
                evidence: Some(evidence),
                wander: Some(Wander {
                    noise,
                    rotations: base.rotations,
                    ratio,
                }),
            });
        };
        chosen.push(added);
        noise = its_noise;
        let evidence = white.with_noise(&noise);
        let fitted = fit(&evidence, folds, &borrowed(&candidates))?;
        polish(&evidence, folds, &mut candidates, &fitted, &chosen)?;
    }
}

impl Wander {
    /// Axes on which the slow error is beyond doubt: two parameters each, three axes.
    pub(crate) fn axes(&self) -> [bool; 3] {
        significant(&self.ratio)
    }
}

fn significant(ratio: &[f64; 3]) -> [bool; 3] {
    ratio.map(|ratio| {
        let p = ChiSquared::new(2.0).map_or(1.0, |law| law.sf(ratio.max(0.0) / WIDENING));
        3.0 * p < FAMILY_ALPHA
    })
}
