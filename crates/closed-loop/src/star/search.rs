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
//! is added. What white evidence finds by itself competes with that as a whole, each
//! with its own noise and all that its freedom costs,
//!
//! ```text
//! worth = L - sum over effects ( ln cost + k/2 (1 + ln(q/k)) ) - sum over slow errors ( 4 )
//! ```
//!
//! k parameters (instant, frequency and lag too), q the square of the amplitudes over
//! their errors: the evidence if effects are spread like what was found. One slow error may act about X and Y
//! alike; what differs about them, or acts about one alone, pays ln 2 more. Without a slow
//! error the noise is white, so that what such an error would add is taken off. The
//! likelier explanation is named; an effect that is worth less than a slow error in its
//! place is not, even if that error would not be named either. The log-odds of a step of
//! q = 40 in white noise are about 4 +- 2.5, of a wander's best step -2 +- 2 or less:
//! neither is ever certain. Where the rotations of the declared model's residual are
//! white, the plain search is all there is.
//!
//! Source: Wilks 1938 (likelihood ratio); George & Foster 2000 (empirical Bayes selection).

use std::sync::Arc;

use block_regression::{Estimate, Fits, Folds, Layout};
use coloured_noise::{CommonNoise, Rotations, SlowGains};
use effects::Candidate;
use nalgebra::DMatrix;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::search::selection::{
    FAMILY_ALPHA, Group, Judgement, SLOW_PRICE, Selection, WIDENING, columns_of, costs, price,
};
use crate::search::{Fitted, Found, borrowed, fit_grams, polish, search};
use crate::star::evidence::StarEvidence;
use crate::star::moments::StarMoments;

/// Candidates of each list that are scored.
const SHORTLIST: usize = 3;
/// Rounds of generalised least squares and noise fit.
const ALTERNATIONS: usize = 2;
/// What slow errors pay beside that if they are not the same about X and Y, nats: every other one is so.
const APART: f64 = std::f64::consts::LN_2;
/// Most effects that are added.
const MOST: usize = 8;
/// Parts of a long run of which one is searched before the whole is.
const PARTS: usize = 8;

/// The slow error of the reference as it was found.
#[derive(Clone, Debug)]
pub(crate) struct Wander {
    pub(crate) noise: CommonNoise,
    pub(crate) rotations: Rotations,
    /// Twice the gain in log-likelihood of each axis.
    pub(crate) ratio: [f64; 3],
    /// The same of X and Y together with one size and time.
    pub(crate) alike: f64,
    /// Nats by which effects in its place are less likely, where there are any.
    pub(crate) behind: Option<f64>,
}

/// What the search ends with.
pub(crate) struct Searched<'a> {
    pub(crate) found: Found,
    /// The evidence under the noise that was found; `None`: as it was given.
    pub(crate) evidence: Option<StarEvidence<'a>>,
    pub(crate) wander: Option<Wander>,
}

/// One search on `white` evidence, and what of its outcome a slow error of the reference explains
/// better. Candidates that may not be chosen are judged.
pub(crate) fn attempt<'a>(
    white: &StarEvidence<'a>,
    folds: &Folds,
    candidates: &dyn Fn() -> Vec<Arc<dyn Candidate>>,
    may: &[bool],
    start: Option<CommonNoise>,
) -> Result<(Searched<'a>, Vec<usize>), CloseError> {
    let candidates = prepared(white, folds, candidates(), may, start);
    let Some(start) = start else {
        let found = search(white, folds, candidates, may, None)?;
        return Ok((Searched::plain(found), Vec::new()));
    };
    let Coloured {
        searched,
        wander,
        white: begun,
        moments,
        worth,
    } = coloured(white, folds, candidates, may, start)?;
    // from the forms that were polished beside the slow error: nearly those that suit white noise
    let candidates = searched.found.candidates.clone();
    let found = search(white, folds, candidates, may, begun)?;
    let polished = &searched.found.candidates;
    let same = |(a, b): (&Arc<dyn Candidate>, &Arc<dyn Candidate>)| Arc::ptr_eq(a, b);
    let known = polished.iter().zip(&found.candidates).all(same);
    let known = known.then_some(moments);
    let instead = Instead::of(white, folds, &found, may, &wander.noise, known)?;
    // Less than that imitates no effect, and would only hide one.
    if wander.axes().contains(&true) {
        let better = |i: &Instead| i.refused.is_empty() && i.worth > worth;
        if !instead.as_ref().is_some_and(better) {
            let behind = instead.map(|i| worth - i.worth);
            let searched = Searched {
                wander: Some(Wander { behind, ..wander }),
                ..searched
            };
            return Ok((searched, Vec::new()));
        }
        return Ok((Searched::plain(found), Vec::new()));
    }
    // forms of one cause (steps at other instants) are no better
    let family = |g: usize| found.fitted.groups[g].family.as_str();
    let causes: Vec<&str> = instead
        .iter()
        .flat_map(|i| i.refused.iter().map(|&g| family(g)))
        .collect();
    let refused = (0..found.candidates.len())
        .filter(|&g| causes.contains(&family(g)))
        .collect();
    Ok((Searched::plain(found), refused))
}

/// The candidates in the forms that a part of a long run gives them: of the whole, each other form costs a
/// pass.
fn prepared(
    white: &StarEvidence<'_>,
    folds: &Folds,
    candidates: Vec<Arc<dyn Candidate>>,
    may: &[bool],
    start: Option<CommonNoise>,
) -> Vec<Arc<dyn Candidate>> {
    let Some(coarse) = white.coarser(folds) else {
        return candidates;
    };
    let part = coarse.thinned(PARTS);
    let found = match start {
        Some(start) => {
            coloured(white, &part, candidates.clone(), may, start).map(|c| c.searched.found)
        }
        None => search(white, &part, candidates.clone(), may, None),
    };
    found.map_or(candidates, |found| found.candidates)
}

impl Searched<'_> {
    /// Of white evidence alone.
    fn plain(found: Found) -> Self {
        Self {
            found,
            evidence: None,
            wander: None,
        }
    }
}

/// What white evidence chose, as an explanation in place of a slow error.
struct Instead {
    /// Beside a reference that has white noise alone.
    worth: f64,
    /// What a slow error is worth more than.
    refused: Vec<usize>,
}

impl Instead {
    /// `None`: nothing that a slow error could imitate. `known`: the products of the candidates, where they
    /// are there already.
    fn of(
        white: &StarEvidence<'_>,
        folds: &Folds,
        found: &Found,
        may: &[bool],
        noise: &CommonNoise,
        known: Option<StarMoments>,
    ) -> Result<Option<Self>, CloseError> {
        let chosen = &found.selection.chosen;
        let turns = |g: &usize| found.candidates[*g].acts_on_attitude();
        if !chosen.iter().any(turns) {
            return Ok(None);
        }
        let moments = known.unwrap_or_else(|| white.moments(folds, &borrowed(&found.candidates)));
        let trial = Trial {
            moments: &moments,
            folds,
            precision: white.precision(),
            variance: found.fitted.variance_beside(chosen).unwrap_or(1.0),
            groups: &found.fitted.groups,
            cost: costs(&found.fitted.groups, may),
            all: None,
        };
        let score = |set: &[usize]| trial.score(set, noise).ok_or(CloseError::Singular);
        let whole = score(chosen)?;
        let worth = trial.worth(&whole, f64::INFINITY);
        let mut sets: Vec<Vec<usize>> = chosen
            .iter()
            .copied()
            .filter(turns)
            .map(|g| vec![g])
            .collect();
        if sets.len() > 1 {
            sets.push(sets.concat());
        }
        let mut refused = Vec::new();
        for set in sets {
            let rest: Vec<usize> = chosen
                .iter()
                .copied()
                .filter(|g| !set.contains(g))
                .collect();
            let rest = score(&rest)?;
            if trial.worth(&rest, SLOW_PRICE) > worth {
                refused.extend(set);
            }
        }
        refused.sort_unstable();
        refused.dedup();
        Ok(Some(Self { worth, refused }))
    }
}

/// Noise of the declared model's residual, where it may hold a slow error. How much
/// of one shows only later: what is fitted here (a distortion under drifting stars)
/// takes some of it along.
pub(crate) fn declared_noise(
    white: &StarEvidence<'_>,
    folds: &Folds,
) -> Result<Option<CommonNoise>, CloseError> {
    let moments = white.moments(folds, &[]);
    let trial = Trial {
        moments: &moments,
        folds,
        precision: white.precision(),
        variance: white.variance_guess(),
        groups: &[],
        cost: Vec::new(),
        all: None,
    };
    let noise = trial.taken_out(&trial.columns(&[]));
    Ok(noise.filter(|n| n.reference.iter().any(|r| r.slow > 0.0)))
}

/// A hypothesis at its best noise.
#[derive(Clone, Debug)]
struct Scored {
    noise: CommonNoise,
    rotations: Rotations,
    loglik: f64,
    out_of_fold: f64,
    estimate: Estimate,
    parts: Vec<Part>,
}

/// A candidate within an estimate.
#[derive(Clone, Debug)]
struct Part {
    columns: std::ops::Range<usize>,
    /// Parameters that its columns follow non-linearly.
    shapes: usize,
    /// What its p-value is multiplied by.
    cost: f64,
    /// Its sizes are such as nature makes.
    credible: bool,
}

/// What scores hypotheses: everything comes from one pass over the data.
struct Trial<'a> {
    moments: &'a StarMoments,
    folds: &'a Folds,
    /// Of the nuisance.
    precision: DMatrix<f64>,
    /// Of a scalar of white evidence.
    variance: f64,
    groups: &'a [Group],
    /// What the p-value of each group is multiplied by.
    cost: Vec<f64>,
    /// Fits of all groups: what their scatter says of the noise.
    all: Option<&'a Fits>,
}

impl Trial<'_> {
    /// Nuisance, the columns of `chosen`, and the residual.
    fn columns(&self, chosen: &[usize]) -> Vec<usize> {
        let n = self.precision.nrows();
        (0..n)
            .chain(columns_of(self.groups, chosen).into_iter().map(|c| n + c))
            .chain([self.moments.width() - 1])
            .collect()
    }

    fn layout(&self, columns: &[usize]) -> Layout {
        Layout {
            nuisance_precision: self.precision.clone(),
            candidates: columns.len() - self.precision.nrows() - 1,
            residuals: 1,
        }
    }

    /// Noise of what is left once white evidence has fitted all of `columns`.
    fn taken_out(&self, columns: &[usize]) -> Option<CommonNoise> {
        let grams = self.moments.white_in_all(columns);
        let layout = self.layout(columns);
        let fits = Fits::whole(&grams, &layout, self.variance)?;
        let all: Vec<usize> = (0..layout.candidates).collect();
        let solution = fits.solution(&all)?;
        let rotations = self.moments.rotations(columns, &solution, solution.len())?;
        Some(rotations.noise(None))
    }

    /// `chosen` at the better of two starts: all that fits taken out, or `noise`.
    fn score(&self, chosen: &[usize], noise: &CommonNoise) -> Option<Scored> {
        let columns = self.columns(chosen);
        self.moments.sum_up();
        let (out, given) = rayon::join(
            || self.climb(&columns, &self.taken_out(&columns)?),
            || self.climb(&columns, noise),
        );
        let (noise, rotations, loglik) = [out, given]
            .into_iter()
            .flatten()
            .max_by(|a, b| a.2.total_cmp(&b.2))?;
        let layout = self.layout(&columns);
        let grams = self.moments.under(&columns, &noise);
        let mut fits = Fits::new(&grams, self.folds, &layout, 1.0)?;
        if let Some(all) = self.all {
            fits.scatter_as(all);
        }
        let all: Vec<usize> = (0..layout.candidates).collect();
        let estimate = fits.estimate(&all)?;
        let mut first = 0;
        let parts = chosen
            .iter()
            .map(|&g| {
                let group = &self.groups[g];
                let own = first..first + group.columns.len();
                first = own.end;
                let credible = own
                    .clone()
                    .zip(&group.bounds)
                    .all(|(i, [low, high])| (*low..=*high).contains(&estimate.value[i]));
                Part {
                    columns: own,
                    shapes: group.shapes,
                    cost: self.cost[g],
                    credible,
                }
            })
            .collect();
        Some(Scored {
            noise,
            rotations,
            loglik,
            out_of_fold: fits.out_of_fold(&all)?.total_loglik() + grams.log_scale,
            estimate,
            parts,
        })
    }

    /// Noise, rotations and log-likelihood of the fit of `columns`, from `start` uphill.
    fn climb(
        &self,
        columns: &[usize],
        start: &CommonNoise,
    ) -> Option<(CommonNoise, Rotations, f64)> {
        let layout = self.layout(columns);
        let all: Vec<usize> = (0..layout.candidates).collect();
        let mut noise = *start;
        for round in 0..=ALTERNATIONS {
            let grams = self.moments.under_in_all(columns, &noise);
            let fits = Fits::whole(&grams, &layout, 1.0)?;
            let solution = fits.solution(&all)?;
            let rotations = self.moments.rotations(columns, &solution, solution.len())?;
            let better = rotations.noise(Some(&noise));
            if round < ALTERNATIONS && !better.is_like(&noise) {
                noise = better;
                continue;
            }
            return Some((noise, rotations, fits.log_marginal(&all)? + grams.log_scale));
        }
        None
    }

    /// Log-likelihood less what the freedom of a hypothesis buys where nothing acts:
    /// for amplitudes the evidence under the spread that suits them best, for a slow
    /// error of an axis `slow_price`, or its absence where that costs less.
    fn worth(&self, scored: &Scored, slow_price: f64) -> f64 {
        let slow = scored.rotations.slow_gains(&scored.noise);
        let without = paid_by_slow(&slow, slow_price);
        let effects: f64 = scored
            .parts
            .iter()
            .map(|part| {
                let which: Vec<usize> = part.columns.clone().collect();
                let shapes = part.shapes;
                let square = scored.estimate.square(&which).unwrap_or(0.0);
                // what is scanned is fitted too
                let k = (which.len() + shapes) as f64;
                part.cost.ln() + 0.5 * k * (1.0 + (square / k.max(1.0)).max(1.0).ln())
            })
            .sum();
        scored.loglik - without - effects
    }

    /// What the last of the candidates of `with` adds to `without`.
    fn judge(&self, with: &Scored, at: usize, without: &Scored, choices: usize) -> Judgement {
        let Part {
            columns, credible, ..
        } = &with.parts[at];
        let freedom = columns.len() + choices;
        let ratio = 2.0 * (with.loglik - without.loglik) / WIDENING;
        let likely = ChiSquared::new(freedom as f64).map_or(1.0, |law| law.sf(ratio.max(0.0)));
        let which: Vec<usize> = columns.clone().collect();
        let p = likely.max(with.estimate.p_value(&which));
        Judgement {
            delta_loglik: with.out_of_fold - without.out_of_fold,
            p_value: (p * with.parts[at].cost).min(1.0),
            credible: *credible,
            observable: !columns.is_empty(),
        }
    }
}

/// What slow errors pay of what they gain, `price` each, or all of it where that costs less: none across the
/// boresight, one that is the same about X and Y, or one about each that has one; and that about Z.
fn paid_by_slow(slow: &SlowGains, price: f64) -> f64 {
    let paid = slow.axes.map(|gain| gain.min(price));
    let alike = slow.across - slow.alike + price;
    let apart = paid[0] + paid[1] + APART;
    slow.across.min(alike.max(0.0)).min(apart) + paid[2]
}

/// What the search beside a slow error ends with.
struct Coloured<'a> {
    searched: Searched<'a>,
    wander: Wander,
    /// The same candidates under white noise, but where rotations have a prior.
    white: Option<Fitted>,
    /// The products of the candidates.
    moments: StarMoments,
    worth: f64,
}

fn coloured<'a>(
    white: &StarEvidence<'a>,
    folds: &Folds,
    mut candidates: Vec<Arc<dyn Candidate>>,
    may: &[bool],
    start: CommonNoise,
) -> Result<Coloured<'a>, CloseError> {
    let mut banned = vec![false; candidates.len()];
    let mut chosen: Vec<usize> = Vec::new();
    let mut noise = start;
    let mut moments = white.moments(folds, &borrowed(&candidates));
    // fits of the same columns, those under the noise of the last choice
    let mut known: Option<[Fitted; 2]> = None;
    loop {
        let all: Vec<usize> = (0..moments.width()).collect();
        let under = |noise: &CommonNoise| {
            fit_grams(
                &white.with_noise(noise),
                &moments.under(&all, noise),
                folds,
                &borrowed(&candidates),
            )
        };
        let beside = |fitted: Fitted| fitted.beside(folds, &borrowed(&candidates), &chosen);
        let [plain, filtered] = match known.take() {
            Some([plain, filtered]) => [beside(plain)?, filtered],
            None => {
                let grams = moments.white_of(&all);
                let plain = fit_grams(white, &grams, folds, &borrowed(&candidates))?;
                [beside(plain)?, beside(under(&noise)?)?]
            }
        };
        let trial = Trial {
            moments: &moments,
            folds,
            precision: white.precision(),
            variance: plain.variance_beside(&chosen).unwrap_or(1.0),
            groups: &plain.groups,
            cost: costs(&plain.groups, may),
            all: Some(&filtered.fits),
        };
        let base = trial.score(&chosen, &noise).ok_or(CloseError::Singular)?;
        noise = base.noise;
        let mut stands = Vec::new();
        let mut fallen = None;
        for (at, &g) in chosen.iter().enumerate() {
            let others: Vec<usize> = chosen.iter().copied().filter(|&c| c != g).collect();
            let without = trial.score(&others, &noise).ok_or(CloseError::Singular)?;
            let judgement = trial.judge(&base, at, &without, plain.groups[g].choices);
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
                let tried = fitted.trials(&trial.cost).tried(&open, &chosen).into_iter();
                let standing = tried.filter(|t| t.judgement.stands());
                shortlist.extend(standing.map(|t| t.group).take(SHORTLIST));
            }
        }
        shortlist.sort_unstable();
        shortlist.dedup();
        let best = shortlist
            .into_par_iter()
            .filter_map(|g| {
                let mut with = chosen.clone();
                with.push(g);
                let scored = trial.score(&with, &noise)?;
                let group = &plain.groups[g];
                let judgement = trial.judge(&scored, chosen.len(), &base, group.choices);
                let rank = judgement.delta_loglik - price(group, plain.scalars);
                judgement.stands().then_some((g, rank, scored.noise))
            })
            .collect::<Vec<_>>()
            .into_iter()
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((added, _, its_noise)) = best else {
            let fitted = beside(under(&noise)?)?;
            let mut judged = fitted.trials(&trial.cost).judged(&chosen);
            for (&g, judgement) in chosen.iter().zip(stands) {
                judged[g] = judgement;
            }
            let ratio = base.rotations.slow_ratio(&noise);
            let worth = trial.worth(&base, SLOW_PRICE);
            return Ok(Coloured {
                searched: Searched {
                    found: Found {
                        candidates,
                        fitted,
                        selection: Selection { chosen, judged },
                    },
                    evidence: Some(white.with_noise(&noise)),
                    wander: None,
                },
                wander: Wander {
                    noise,
                    alike: base.rotations.alike_ratio(&noise),
                    rotations: base.rotations,
                    ratio,
                    behind: None,
                },
                white: white.drawn.is_none().then_some(plain),
                moments,
                worth,
            });
        };
        chosen.push(added);
        noise = its_noise;
        let fitted = under(&noise)?;
        let fitted = fitted.beside(folds, &borrowed(&candidates), &chosen)?;
        let evidence = white.with_noise(&noise);
        if polish(&evidence, folds, &mut candidates, &fitted, &chosen)? {
            // there is no room for the old products beside the new
            drop((plain, filtered, fitted, moments));
            moments = white.moments(folds, &borrowed(&candidates));
        } else {
            known = Some([plain, fitted]);
        }
    }
}

impl Wander {
    /// Axes on which the slow error is beyond doubt: by themselves, or X and Y together.
    pub(crate) fn axes(&self) -> [bool; 3] {
        let both = chance(self.alike) < FAMILY_ALPHA;
        std::array::from_fn(|axis| {
            let alone = chance(self.ratio[axis]) < FAMILY_ALPHA;
            // of the two, those whose own slow part earns its keep (Akaike)
            alone || both && axis < 2 && self.ratio[axis] > 4.0
        })
    }

    /// Chance of the likeliest of these where the noise is white.
    pub(crate) fn p_value(&self) -> f64 {
        let all = self.ratio.iter().copied().chain([self.alike]);
        chance(all.fold(0.0, f64::max)).min(1.0)
    }
}

/// Chance of such a ratio of two parameters where the noise is white: three axes are tried, and X and Y
/// together.
fn chance(ratio: f64) -> f64 {
    4.0 * ChiSquared::new(2.0).map_or(1.0, |law| law.sf(ratio.max(0.0) / WIDENING))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a step about Y alone makes of a slow error (18.6 nats about Y, nothing about X), and a reference that
    /// wanders about both alike. One about Y alone pays for that as well.
    #[test]
    fn a_slow_error_about_one_axis_pays_for_that() {
        let of = |axes: [f64; 3], across: f64, alike: f64| {
            let gains = SlowGains {
                axes,
                across,
                alike,
            };
            paid_by_slow(&gains, SLOW_PRICE)
        };
        assert!((of([0.0, 18.6, 0.0], 18.6, 15.0) - 4.0 - APART).abs() < 1e-12);
        assert!((of([20.0, 25.0, 0.0], 45.0, 45.0) - 4.0).abs() < 1e-12);
        // no more than it gains, and the one about Z by itself
        assert!((of([0.0, 2.0, 30.0], 2.0, 1.0) - 6.0).abs() < 1e-12);
    }
}
