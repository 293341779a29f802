//! The search at attitude level: every hypothesis with its own noise.
//!
//! Coloured noise fitted with an effect still in the data takes a slow effect for
//! noise, and noise fitted after removing whatever fits takes noise for an effect.
//! So each hypothesis is scored at its own best noise,
//!
//! ```text
//! L(H) = max over noise, amplitudes of ln p(data | H)       2 (L(H1) - L(H0)) ~ chi2_p
//! ```
//!
//! by alternating generalised least squares and the noise fit, which what is declared of slow noise weighs
//! ([`coloured_noise::Foreknown`]). That climb ends on the hill it starts on:
//! an effect that the noise has swallowed stays swallowed. So there are two, from the noise of the last
//! choice and from little slow noise, and the likelier counts. What even so does not stand is held as a whole against
//! slow noise in its place, each with all that its freedom costs. The p-value pays
//! for the whole search; the gain that is reported and ranked is out of fold, each
//! side predicted with amplitudes of the other folds under its own noise.
//!
//! A likelihood of coloured noise may rise where the error itself grows: a step
//! makes the noise look whiter. What is added has to lower the error out of fold,
//! in units of each axis's white noise, and on every axis whose sign was chosen.
//!
//! Source: Wilks 1938 (likelihood ratio); Cochrane & Orcutt 1949 (the alternation).

use std::sync::Arc;

use block_regression::Folds;
use coloured_noise::{Coloured, Foreknown};
use effects::Candidate;
use focal_plane::{ARCSEC_PER_RAD, SPEED_OF_LIGHT_M_S};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use crate::attitude::data::{AttitudeData, AttitudeEvidence};
use crate::attitude::likeness::likeness;
use crate::attitude::line_level::line_level;
use crate::attitude::spatial_errors::SpatialErrors;
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::figures;
use crate::search::empirical::EMPIRICAL;
use crate::search::group::open_beside;
use crate::search::refusal::{Refusal, Refused};
use crate::search::selection::{
    FAMILY_ALPHA, Judgement, SLOW_PRICE, Selection, WIDENING, columns_of, costs, price,
};
use crate::search::{
    Fitted, Found, amplitudes, borrowed, family, first_column, fit, fit_design, polish, without,
};

/// The effects that a change of stars looks like, and stars that come by again.
const STEP: &str = "step_misalignment";
const LINE: &str = "periodic_misalignment";
/// The effect of an orbit.
const ABERRATION: &str = "velocity_aberration";

/// Rounds of generalised least squares and noise fit.
const ALTERNATIONS: usize = 3;
/// Slow noise that a climb starts with: so many sigmas of a row, over this share of the span.
const FAINT: f64 = 0.2;
const FAINT_SHARE: f64 = 0.2;
/// Nats that two parameters of slow noise have to be worth.
const EARNED: f64 = 2.0;
/// Nats that an effect gains under white noise below which no noise makes it significant.
const LITTLE: f64 = 8.0;
/// Nats by which an effect has to be worth more than slow noise in its place. The best step of a wander is worth
/// 2 +- 2 less.
const BY_FAR: f64 = 2.5;

/// Nats by which a channel without a cause has to predict better than an effect, and more than which that adds
/// nothing beside it.
const DESCRIBED: f64 = 5.0;

/// Where the climb to a hypothesis' own noise starts.
#[derive(Clone, Copy, Debug)]
enum Start {
    Given,
    Faint,
    /// No slow noise at all.
    White,
}

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

/// A hypothesis at its best noise.
#[derive(Clone, Debug)]
struct Scored {
    noise: [Coloured; 3],
    /// Log-likelihood of each axis at the maximum, nats.
    of_axis: [f64; 3],
    /// Weight of the noise by what is declared of it, nats.
    weight: f64,
    /// Log-likelihood predicted out of fold, nats.
    out_of_fold: f64,
    /// Amplitudes and their robust standard errors are within credible bounds.
    credible: bool,
    /// Amplitudes of all columns of the candidates, in order; zero where not observable.
    amplitudes: Vec<f64>,
    /// What is left of each axis, bin by bin, arcsec.
    left: [Vec<f64>; 3],
}

impl Scored {
    /// Of all axes, weighed by what is declared of their noise.
    fn loglik(&self) -> f64 {
        self.of_axis.iter().sum::<f64>() + self.weight
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
    candidate.id() == EMPIRICAL && variable.is_some_and(|v| v.starts_with("housekeeping:"))
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

/// What the p-value of each candidate is multiplied by: descriptions are not tried.
fn cost(fitted: &Fitted, candidates: &[Arc<dyn Candidate>]) -> Vec<f64> {
    let may: Vec<bool> = candidates.iter().map(|c| c.id() != EMPIRICAL).collect();
    costs(&fitted.groups, &may)
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
        let rms = |a: usize| figures::rms(&residual.axes[a], &self.data.outlier[a]);
        Some([rms(0)?, rms(1)?, rms(2)?].map(|r| r * r))
    }

    /// Whether a channel without a cause predicts better, alone, what `g` explains beside `chosen`.
    fn is_described(&self, chosen: &[usize], g: usize) -> bool {
        if follows_a_channel(self.candidates[g].as_ref()) {
            return false;
        }
        let gain = |more: &[usize]| {
            let score = self.score(&[chosen, more].concat());
            score.map_or(f64::NEG_INFINITY, |s| s.out_of_fold)
        };
        let itself = gain(&[g]);
        let channels = (0..self.candidates.len()).filter(|&c| {
            is_a_channel(self.candidates[c].as_ref()) && !self.fitted.groups[c].columns.is_empty()
        });
        let mut better = channels.map(|c| (c, gain(&[c])));
        better.any(|(c, told)| told > itself + DESCRIBED && gain(&[c, g]) < told + DESCRIBED)
    }

    /// Standing of group `g` beside the others of `chosen`.
    fn judge(&self, chosen: &[usize], g: usize, base: &Scored) -> Judgement {
        let group = &self.fitted.groups[g];
        if group.columns.is_empty() {
            return Judgement::UNSEEN;
        }
        let others = without(chosen, &[g]);
        let mut set = others.clone();
        set.push(g);
        let scores = if others.len() == chosen.len() {
            self.score(&set).map(|s| (s, base.clone()))
        } else {
            set = chosen.to_vec();
            self.score(&others).map(|s| (base.clone(), s))
        };
        let Some((with, without)) = scores else {
            return Judgement::UNSEEN;
        };
        let ratio = 2.0 * (with.loglik() - without.loglik());
        let mut p = self
            .beside_its_neighbours(g, &with, ratio)
            .unwrap_or_else(|| self.chance(g, group.columns.len(), ratio));
        if p >= FAMILY_ALPHA && with.loglik() - without.loglik() > LITTLE {
            p = p.min(self.instead_of_slow(&others, &set, g, &without));
        }
        if p < FAMILY_ALPHA {
            p = p.max(self.as_declared(&set, g, &with));
        }
        Judgement {
            delta_loglik: with.out_of_fold - without.out_of_fold,
            p_value: p,
            credible: with.credible,
            observable: true,
        }
    }

    /// Chance of `g` beside `others` under white noise, where it is likelier by far than slow noise in its place. A slow
    /// effect makes any noise look slow, so that fitted beside such noise hardly one is beyond chance: each is held
    /// against the other as a whole, with all that its freedom costs.
    fn instead_of_slow(&self, others: &[usize], set: &[usize], g: usize, slow: &Scored) -> f64 {
        let climbs = [others, set].map(|set| self.climb(set, Start::White));
        let [Some(without), Some(with)] = climbs else {
            return 1.0;
        };
        let group = &self.fitted.groups[g];
        let square = 2.0 * (with.loglik() - without.loglik());
        let k = (group.columns.len() + group.choices + group.shapes) as f64;
        let worth = 0.5 * square - 0.5 * k * (1.0 + (square / k).max(1.0).ln()) - self.cost[g].ln();
        let gain: [f64; 3] = std::array::from_fn(|a| slow.of_axis[a] - without.of_axis[a]);
        // one slow error may act about X and Y alike
        let in_its_place =
            (gain[0] + gain[1] - SLOW_PRICE).max(0.0) + (gain[2] - SLOW_PRICE).max(0.0);
        if worth - in_its_place < BY_FAR {
            return 1.0;
        }
        self.chance(g, group.columns.len(), square)
    }

    /// Chance that a line gains such a `ratio`, times what the search costs: held against what `with` leaves at the
    /// frequencies around it. `None` for what is no line, or too slow to have so many.
    fn beside_its_neighbours(&self, g: usize, with: &Scored, ratio: f64) -> Option<f64> {
        let candidate = self.candidates[g].as_ref();
        let frequency_hz = (candidate.id() == LINE).then(|| candidate.nonlinear()[0].value)?;
        let t_s = &self.data.bins.t_s;
        let around = line_level(t_s, &with.left, &self.data.count, &with.noise, frequency_hz)?;
        let k = self.fitted.groups[g].columns.len() as f64;
        let law = FisherSnedecor::new(k, around.freedom).ok()?;
        let p = law.sf(ratio.max(0.0) / k / around.level.max(1.0));
        Some((p * self.cost[g]).min(1.0))
    }

    /// Chance that so many `columns` of `g` gain such a `ratio`, times what the search costs.
    fn chance(&self, g: usize, columns: usize, ratio: f64) -> f64 {
        let freedom = (columns + self.fitted.groups[g].choices) as f64;
        let p = ChiSquared::new(freedom).map_or(1.0, |law| law.sf(ratio.max(0.0) / WIDENING));
        (p * self.cost[g]).min(1.0)
    }

    /// Chance that the declared errors along this motion explain as much as `g` does beside the others of `set`.
    fn by_likeness(&self, set: &[usize], g: usize, scored: &Scored) -> f64 {
        let imagined = self.declared.changes.and_then(|c| c.imagined.as_deref());
        let order: Vec<usize> = set.iter().copied().filter(|&c| c != g).chain([g]).collect();
        let own = self.candidates[g].coefficients().len();
        let evidence = (self.with_noise)(scored.noise);
        let told = imagined.and_then(|i| likeness(i, &evidence, &self.columns(&order), own));
        told.map_or(0.0, |told| {
            self.chance(g, told.columns, told.square / told.excess)
        })
    }

    /// Chance that `g` of `set` is what the declared model makes: a change of stars, stars that come by again, or that
    /// go on.
    fn as_declared(&self, set: &[usize], g: usize, scored: &Scored) -> f64 {
        let Some(changes) = self.declared.changes else {
            return 0.0;
        };
        let width = |c: &usize| self.candidates[*c].coefficients().len();
        let first: usize = set.iter().take_while(|c| **c != g).map(width).sum();
        let size = |k: usize| scored.amplitudes.get(first + k).copied().unwrap_or(0.0);
        let candidate = self.candidates[g].as_ref();
        match candidate.id() {
            STEP => changes.chance([size(0), size(1), size(2)]),
            LINE => {
                // cosine and sine, axis by axis
                let frequency = candidate.nonlinear()[0].value;
                let t_s = &self.data.bins.t_s;
                let span_s = t_s.last().zip(t_s.first()).map_or(0.0, |(l, f)| l - f);
                let is_more = |axis: usize| {
                    let amplitude = size(2 * axis).hypot(size(2 * axis + 1));
                    let rows = self.data.count[axis].iter().sum::<f64>() / span_s;
                    changes.is_line(frequency, axis, amplitude, &scored.noise[axis], rows)
                };
                f64::from(u8::from(!(0..3).any(is_more)))
            }
            // an orbit of which part of a turn is seen looks like a slow error
            ABERRATION if self.fitted.groups[g].slopes > 0 => {
                let amplitude = size(0) / SPEED_OF_LIGHT_M_S * ARCSEC_PER_RAD;
                let slow = changes.slow_arcsec[0].max(changes.slow_arcsec[1]);
                let little = amplitude / std::f64::consts::SQRT_2 <= slow;
                f64::from(u8::from(little)).max(self.by_likeness(set, g, scored))
            }
            _ => self.by_likeness(set, g, scored),
        }
    }

    /// `chosen` at its own best noise: the likelier of two climbs, from the present noise and, where
    /// white noise would believe all of it, from little slow noise beside it.
    fn score(&self, chosen: &[usize]) -> Option<Scored> {
        let (given, faint) = rayon::join(
            || self.climb(chosen, Start::Given),
            || {
                self.believed(chosen)
                    .then(|| self.climb(chosen, Start::Faint))?
            },
        );
        let both = [given, faint].into_iter().flatten();
        both.max_by(|a, b| a.loglik().total_cmp(&b.loglik()))
    }

    /// Whether each of `chosen` explains something beside the others if the noise is white.
    fn believed(&self, chosen: &[usize]) -> bool {
        let fits = &self.plain.fits;
        let error = |set: &[usize]| fits.error(&columns_of(&self.plain.groups, set));
        let Some(all) = error(chosen) else {
            return false;
        };
        chosen.iter().all(|g| {
            let others = without(chosen, &[*g]);
            error(&others).is_some_and(|e| 0.5 * self.plain.scalars * (e / all).ln() > LITTLE)
        })
    }

    /// `chosen`, and its noise uphill from the present one, or each time from little slow noise.
    fn climb(&self, chosen: &[usize], start: Start) -> Option<Scored> {
        let candidates: Vec<&dyn Candidate> = chosen
            .iter()
            .map(|&g| self.candidates[g].as_ref())
            .collect();
        let columns = candidates.iter().map(|c| c.coefficients().len()).sum();
        let all: Vec<usize> = (0..candidates.len()).collect();
        let binned = self.columns(chosen);
        let mut noise = match start {
            Start::Given => self.noise,
            Start::Faint | Start::White => self.white,
        };
        let mut last = None;
        for _ in 0..ALTERNATIONS {
            let evidence = (self.with_noise)(noise);
            let design = evidence.whitened(&binned);
            let fitted = fit_design(&evidence, design.as_ref(), self.folds, &candidates).ok()?;
            let set = columns_of(&fitted.groups, &all);
            let estimate = fitted.fits.estimate(&set)?;
            let residual = self.left(&evidence, &binned, &fitted, &set, &estimate.value);
            noise = std::array::from_fn(|axis| {
                let (t_s, count) = (&self.data.bins.t_s, &self.data.count[axis]);
                match (start, &self.declared.noise[axis]) {
                    (Start::White, _) => self.white_of(axis, &residual[axis]),
                    (_, Some(known)) => noise[axis].refit_near(known, t_s, &residual[axis], count),
                    (Start::Given, None) => noise[axis].refit(t_s, &residual[axis], count),
                    (Start::Faint, None) => self.climbing_from_faint(axis, &residual[axis]),
                }
            });
            let credible = fitted.groups.iter().all(|group| {
                group
                    .columns
                    .iter()
                    .zip(&group.bounds)
                    .all(|(c, [low, high])| {
                        set.iter()
                            .position(|s| s == c)
                            .is_some_and(|i| (*low..=*high).contains(&estimate.value[i]))
                    })
            });
            let mut all = vec![0.0; columns];
            for (value, &c) in estimate.value.iter().zip(&set) {
                all[c] = *value;
            }
            last = Some((self.logliks(&noise, &residual), credible, all, residual));
        }
        let (of_axis, credible, values, left) = last?;
        let evidence = (self.with_noise)(noise);
        let design = evidence.whitened(&binned);
        let fitted = fit_design(&evidence, design.as_ref(), self.folds, &candidates).ok()?;
        let set = columns_of(&fitted.groups, &all);
        let out_of_fold = fitted.fits.out_of_fold(&set)?.total_loglik();
        Some(Scored {
            noise,
            of_axis,
            weight: match start {
                Start::White => 0.0,
                Start::Given | Start::Faint => self.declared.weight(&noise),
            },
            out_of_fold: out_of_fold + self.log_scale(&noise),
            credible,
            amplitudes: values,
            left,
        })
    }

    /// Noise of a residual: white, unless slow noise beside it earns its two parameters (Akaike).
    fn climbing_from_faint(&self, axis: usize, residual: &[f64]) -> Coloured {
        let (t_s, count) = (&self.data.bins.t_s, &self.data.count[axis]);
        let white = self.white_of(axis, residual);
        let found = self.faint[axis].refit(t_s, residual, count);
        let loglik = |noise: &Coloured| noise.log_likelihood(t_s, residual, count);
        if loglik(&found) > loglik(&white) + EARNED {
            found
        } else {
            white
        }
    }

    /// White noise of a residual.
    fn white_of(&self, axis: usize, residual: &[f64]) -> Coloured {
        let count = &self.data.count[axis];
        let rows = count.iter().filter(|n| **n > 0.0).count().max(1) as f64;
        let square: f64 = residual.iter().zip(count).map(|(y, n)| n * y * y).sum();
        Coloured {
            white: (square / rows).sqrt().max(f64::MIN_POSITIVE),
            ..self.white[axis]
        }
    }

    /// Binned columns of some candidates, constants first.
    fn columns(&self, chosen: &[usize]) -> DMatrix<f64> {
        let mut pick = vec![0, 1, 2];
        for &g in chosen {
            let before = first_column(self.candidates, g);
            pick.extend((0..self.candidates[g].coefficients().len()).map(|j| 3 + before + j));
        }
        self.binned.select_columns(&pick)
    }

    /// What is left in sample.
    fn left(
        &self,
        evidence: &AttitudeEvidence<'_>,
        binned: &DMatrix<f64>,
        fitted: &Fitted,
        set: &[usize],
        value: &DVector<f64>,
    ) -> [Vec<f64>; 3] {
        let mut beta = DVector::zeros(binned.ncols() - 3);
        for (i, &c) in set.iter().enumerate() {
            beta[c] = value[i];
        }
        evidence.left(binned, &fitted.fits.nuisance(None, set, value), &beta)
    }

    /// What the log-likelihood of whitened values lacks to that of the values themselves, nats.
    fn log_scale(&self, noise: &[Coloured; 3]) -> f64 {
        let nothing = std::array::from_fn(|_| vec![0.0; self.data.bins.t_s.len()]);
        let all = self.data.count.iter().flatten();
        let scalars = all.filter(|n| **n > 0.0).count() as f64;
        self.loglik(noise, &nothing) + 0.5 * scalars * std::f64::consts::TAU.ln()
    }

    fn loglik(&self, noise: &[Coloured; 3], residual: &[Vec<f64>; 3]) -> f64 {
        self.logliks(noise, residual).iter().sum()
    }

    fn logliks(&self, noise: &[Coloured; 3], residual: &[Vec<f64>; 3]) -> [f64; 3] {
        std::array::from_fn(|a| {
            noise[a].log_likelihood(&self.data.bins.t_s, &residual[a], &self.data.count[a])
        })
    }
}
