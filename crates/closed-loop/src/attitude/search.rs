//! The search at attitude level: every hypothesis with its own noise.
//!
//! ```text
//! own_noise       a hypothesis at the noise that suits it best
//! judge           what speaks for a candidate, and what against it
//! ```
//!
//! The p-value pays for the whole search; the gain that is reported and ranked is out of fold, each
//! side predicted with amplitudes of the other folds under its own noise.
//!
//! A likelihood of coloured noise may rise where the error itself grows: a step
//! makes the noise look whiter. What is added has to lower the error out of fold,
//! in units of each axis's white noise, and on every axis whose sign was chosen.
//!
//! Source: forward selection with a backward check.

mod judge;
mod own_noise;

use std::sync::Arc;

use block_regression::Folds;
use coloured_noise::{Coloured, Foreknown};
use effects::{CHANNEL, Candidate};
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::attitude::data::{AttitudeData, AttitudeEvidence};
use crate::attitude::motion_terms::is_of_motion;
use crate::attitude::spatial_errors::SpatialErrors;
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::residual_size;
use crate::search::empirical::EMPIRICAL;
use crate::search::group::open_beside;
use crate::search::refusal::{Refusal, Refused};
use crate::search::selection::{Judgement, Selection, costs, price};
use crate::search::{Fitted, Found, amplitudes, borrowed, family, fit, fit_design, polish};

/// Slow noise that a climb starts with: so many sigmas of a row, over this share of the span.
const FAINT: f64 = 0.2;
const FAINT_SHARE: f64 = 0.2;

/// Builds the evidence of one noise.
pub(crate) type WithNoise<'d> = dyn Fn([Coloured; 3]) -> AttitudeEvidence<'d> + Sync + 'd;

/// What the model declares of an attitude's errors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Declared<'a> {
    /// Jumps that are no step, and lines that are the declared model's.
    pub(crate) changes: Option<&'a SpatialErrors>,
    /// The slow noise of each axis.
    pub(crate) noise: [Option<Foreknown>; 3],
}

impl Declared<'_> {
    /// Logarithm of the weight of this noise, nats.
    fn weight(&self, noise: &[Coloured; 3]) -> f64 {
        let each = self.noise.iter().zip(noise);
        each.filter_map(|(known, noise)| Some(known.as_ref()?.log_weight(noise)))
            .sum()
    }
}

/// The search, the noise it ends with, and what it found and did not add; `rows` are the folds of the unbinned rows.
pub(crate) fn search<'d>(
    with_noise: &WithNoise<'d>,
    data: &AttitudeData,
    folds: &Folds,
    rows: &Folds,
    mut candidates: Vec<Arc<dyn Candidate>>,
    declared: Declared<'_>,
    start: [Coloured; 3],
) -> Result<(Found, [Coloured; 3], Refused), CloseError> {
    let mut chosen: Vec<usize> = Vec::new();
    let mut banned = vec![false; candidates.len()];
    let mut refused = Refused::new();
    let mut noise = start;
    loop {
        let binned = with_noise(noise).binned(&borrowed(&candidates));
        let fitted = fit_design(
            &with_noise(noise),
            with_noise(noise).whitened(&binned).as_ref(),
            folds,
            &borrowed(&candidates),
        )?;
        let trial = Trial::new(
            with_noise,
            data,
            folds,
            &candidates,
            &fitted,
            binned,
            noise,
            declared,
        )?;
        let base = trial.score(&chosen).ok_or(CloseError::Singular)?;
        let judged: Vec<Judgement> = (0..candidates.len())
            .into_par_iter()
            .map(|g| trial.judge(&chosen, g, &base))
            .collect();
        if let Some(fallen) = chosen.iter().copied().find(|&g| !judged[g].stands()) {
            banned[fallen] = true;
            refused.insert(family(candidates[fallen].as_ref()), Refusal::Fallen);
            chosen.retain(|&g| g != fallen);
            continue;
        }
        let mut ranked = trial.ranked(&chosen, &banned, &judged);
        while let Some(&g) = ranked.first()
            && !trial.lowers_the_error(rows, &chosen, g)
        {
            banned[g] = true;
            refused.insert(family(candidates[g].as_ref()), Refusal::NoLessError);
            ranked.remove(0);
        }
        if let Some(&g) = ranked.first()
            && trial.is_described(&chosen, g)
        {
            banned[g] = true;
            refused.insert(family(candidates[g].as_ref()), Refusal::StandIn);
            continue;
        }
        noise = base.noise;
        let Some(&added) = ranked.first() else {
            let fitted = fit(&with_noise(noise), folds, &borrowed(&candidates))?;
            return Ok((
                Found {
                    candidates,
                    fitted,
                    selection: Selection { chosen, judged },
                },
                noise,
                refused,
            ));
        };
        chosen.push(added);
        if let Some(score) = trial.score(&chosen) {
            noise = score.noise;
        }
        let fitted = fit(&with_noise(noise), folds, &borrowed(&candidates))?;
        polish(&with_noise(noise), folds, &mut candidates, &fitted, &chosen)?;
    }
}

/// Whether it is a housekeeping channel without a cause.
pub(crate) fn is_a_channel(candidate: &dyn Candidate) -> bool {
    let selectors = candidate.selectors();
    let variable = selectors.get("variable");
    candidate.id() == EMPIRICAL && variable.is_some_and(|v| v.starts_with(CHANNEL))
}

/// Whether it describes at its own best noise: a channel, or a motion.
pub(crate) fn is_a_description(candidate: &dyn Candidate) -> bool {
    is_a_channel(candidate) || is_of_motion(candidate)
}

/// Whether it follows a housekeeping channel, with a cause or without.
pub(crate) fn follows_a_channel(candidate: &dyn Candidate) -> bool {
    is_a_channel(candidate) || candidate.selectors().contains_key("channel")
}

/// How what was chosen first compares with each rival of these as the cause: alone, and
/// beside the best empirical one. Groups of candidates with their out-of-fold gain over
/// the declared model, nats; the first entry is that model itself.
pub(crate) fn rivals(
    with_noise: &WithNoise<'_>,
    data: &AttitudeData,
    folds: &Folds,
    found: &Found,
    declared: Declared<'_>,
    noise: [Coloured; 3],
    is_rival: fn(&dyn Candidate) -> bool,
) -> Result<Vec<(Vec<usize>, f64)>, CloseError> {
    let candidates = &found.candidates;
    let binned = with_noise(noise).binned(&borrowed(candidates));
    let trial = Trial::new(
        with_noise,
        data,
        folds,
        candidates,
        &found.fitted,
        binned,
        noise,
        Declared {
            changes: None,
            ..declared
        },
    )?;
    let mut sets: Vec<Vec<usize>> = vec![Vec::new()];
    sets.extend(found.selection.chosen.first().map(|&g| vec![g]));
    let channels = (0..candidates.len()).filter(|&g| {
        is_rival(candidates[g].as_ref()) && !found.fitted.groups[g].columns.is_empty()
    });
    sets.extend(channels.map(|g| vec![g]));
    let mut scored: Vec<(Vec<usize>, f64)> = sets
        .into_par_iter()
        .filter_map(|set| trial.score(&set).map(|s| (set, s.out_of_fold)))
        .collect();
    let best = scored
        .iter()
        .filter(|(set, _)| {
            set.first()
                .is_some_and(|&g| candidates[g].id() == EMPIRICAL)
        })
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(set, _)| set.clone());
    if let (Some(&first), Some(best)) = (found.selection.chosen.first(), best) {
        let both = vec![first, best[0]];
        scored.extend(trial.score(&both).map(|s| (both, s.out_of_fold)));
    }
    let zero = scored.first().map_or(0.0, |s| s.1);
    for entry in &mut scored {
        entry.1 -= zero;
    }
    Ok(scored)
}

/// What the p-value of each candidate is multiplied by: descriptions are no causes, and pay for each other.
fn cost(fitted: &Fitted, candidates: &[Arc<dyn Candidate>]) -> Vec<f64> {
    let may: Vec<bool> = candidates.iter().map(|c| c.id() != EMPIRICAL).collect();
    let seen = fitted.groups.iter().zip(&may);
    let described = seen.filter(|(g, may)| !**may && !g.columns.is_empty());
    let each = described.count() as f64;
    let of_causes = costs(&fitted.groups, &may).into_iter().zip(&may);
    of_causes
        .map(|(cost, may)| if *may { cost } else { each })
        .collect()
}

/// One list of candidates, ready to be tried in any combination.
struct Trial<'a, 'd> {
    with_noise: &'a WithNoise<'d>,
    data: &'a AttitudeData,
    folds: &'a Folds,
    fitted: &'a Fitted,
    /// The same under white noise.
    plain: Fitted,
    candidates: &'a [Arc<dyn Candidate>],
    /// Columns of all candidates, averaged over the bins.
    binned: DMatrix<f64>,
    declared: Declared<'a>,
    noise: [Coloured; 3],
    /// Its white part alone, and beside little slow noise.
    white: [Coloured; 3],
    faint: [Coloured; 3],
    /// What the p-value of each candidate is multiplied by.
    cost: Vec<f64>,
}

impl<'a, 'd> Trial<'a, 'd> {
    /// `fitted` and `binned` are of the candidates under `noise`.
    fn new(
        with_noise: &'a WithNoise<'d>,
        data: &'a AttitudeData,
        folds: &'a Folds,
        candidates: &'a [Arc<dyn Candidate>],
        fitted: &'a Fitted,
        binned: DMatrix<f64>,
        noise: [Coloured; 3],
        declared: Declared<'a>,
    ) -> Result<Self, CloseError> {
        let t_s = &data.bins.t_s;
        let span_s = t_s.last().zip(t_s.first()).map_or(0.0, |(l, f)| l - f);
        let white = noise.map(|n| Coloured { slow: 0.0, ..n });
        let faint = std::array::from_fn(|axis| {
            let rows: f64 = data.count[axis].iter().sum();
            let usual = (rows / t_s.len().max(1) as f64).max(1.0);
            Coloured {
                white: noise[axis].white,
                slow: FAINT * noise[axis].white / usual.sqrt(),
                tau_s: FAINT_SHARE * span_s,
            }
        });
        let evidence = with_noise(white);
        let list = borrowed(candidates);
        let design = evidence.whitened(&binned);
        Ok(Self {
            with_noise,
            data,
            folds,
            fitted,
            plain: fit_design(&evidence, design.as_ref(), folds, &list)?,
            candidates,
            binned,
            declared,
            noise,
            white,
            faint,
            cost: cost(fitted, candidates),
        })
    }

    /// Candidates that may be added, best first: by the gain out of fold after a
    /// price for every parameter and choice.
    fn ranked(&self, chosen: &[usize], banned: &[bool], judged: &[Judgement]) -> Vec<usize> {
        let groups = &self.fitted.groups;
        let score = |g: usize| judged[g].delta_loglik - price(&groups[g], self.fitted.scalars);
        let mut ranked: Vec<usize> = (0..self.candidates.len())
            .filter(|g| !chosen.contains(g) && !banned[*g] && judged[*g].stands())
            .filter(|&g| self.candidates[g].id() != EMPIRICAL)
            .filter(|&g| open_beside(groups, chosen, g))
            .collect();
        ranked.sort_by(|&a, &b| score(b).total_cmp(&score(a)));
        ranked
    }

    /// Whether the residual out of fold is smaller with `g` than without.
    fn lowers_the_error(&self, rows: &Folds, chosen: &[usize], g: usize) -> bool {
        let mut with = chosen.to_vec();
        with.push(g);
        let (Some(without), Some(with)) = (
            self.mean_squares(rows, chosen),
            self.mean_squares(rows, &with),
        ) else {
            return false;
        };
        let rise: f64 = (0..3)
            .map(|a| (with[a] - without[a]) / self.noise[a].white.powi(2).max(f64::MIN_POSITIVE))
            .sum();
        let claimed = self.fitted.groups[g].choices > 0;
        rise < 0.0 && !(claimed && (0..3).any(|a| with[a] > without[a]))
    }

    /// Mean square of the residual per axis, out of fold, arcsec².
    fn mean_squares(&self, rows: &Folds, chosen: &[usize]) -> Option<[f64; 3]> {
        let columns = self.candidates.iter().map(|c| c.coefficients().len()).sum();
        let amplitudes = amplitudes(self.fitted, self.folds, chosen, columns)?;
        let evidence = (self.with_noise)(self.noise);
        let residual = evidence.residuals(rows, &borrowed(self.candidates), &amplitudes);
        let rms = |a: usize| residual_size::rms(&residual.axes[a], &self.data.outlier[a]);
        Some([rms(0)?, rms(1)?, rms(2)?].map(|r| r * r))
    }
}
