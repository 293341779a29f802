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
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::common_noise::{CommonNoise, Rotations};
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::fit::{Estimate, Fits, Layout};
use crate::folds::Folds;
use crate::search::{Fitted, Found, borrowed, fit_grams, polish, search};
use crate::selection::{
    FAMILY_ALPHA, Group, Judgement, Selection, columns_of, judged, price, ranked,
};
use crate::star_evidence::StarEvidence;
use crate::star_moments::StarMoments;

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
/// Chance under white noise below which a slow error is not even a suspicion.
const SUSPICION: f64 = 0.3;
/// What looks like a slow error of the reference has to be this far from chance
/// where one is suspected.
const SUSPECT_ALPHA: f64 = 1e-4;
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

/// One search on `white` evidence, and what of its outcome a slow error of the reference may
/// explain as well. Candidates that may not be chosen are judged.
pub(crate) fn attempt<'a>(
    white: &StarEvidence<'a>,
    folds: &Folds,
    candidates: &dyn Fn() -> Vec<Box<dyn Candidate>>,
    may: &[bool],
    start: Option<CommonNoise>,
) -> Result<(Searched<'a>, Vec<usize>), CloseError> {
    let mut candidates = candidates();
    let (mut suspected, mut begun) = (false, None);
    if let Some(start) = start {
        let Coloured {
            searched,
            wander,
            white: plain,
        } = coloured(white, folds, candidates, may, start)?;
        // Less than that imitates no effect, and would only hide one.
        if wander.axes().contains(&true) {
            let searched = Searched {
                wander: Some(wander),
                ..searched
            };
            return Ok((searched, Vec::new()));
        }
        suspected = chances(&wander.ratio).iter().any(|p| *p < SUSPICION);
        candidates = searched.found.candidates;
        begun = Some(plain);
    }
    let searched = Searched {
        found: search(white, folds, candidates, may, begun)?,
        evidence: None,
        wander: None,
    };
    let found = &searched.found;
    let mut refused: Vec<usize> = found.selection.chosen.clone();
    refused.retain(|&g| {
        suspected
            && found.candidates[g].acts_on_attitude()
            && found.selection.judged[g].p_value > SUSPECT_ALPHA
    });
    Ok((searched, refused))
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
    /// Columns of each candidate within the estimate, and whether its sizes are credible.
    parts: Vec<(std::ops::Range<usize>, bool)>,
}

impl Scored {
    /// Whether this hypothesis does without the slow error that `other` needs;
    /// `white` is what white evidence says of what it adds.
    fn stands_instead(&self, other: &Self, white: &Judgement) -> bool {
        let slow = |s: &Self| significant(&s.rotations.slow_ratio(&s.noise)).contains(&true);
        white.stands()
            && white.p_value < SUSPECT_ALPHA
            && self.loglik > other.loglik + INSTEAD
            && !slow(self)
            && slow(other)
    }
}

/// What scores hypotheses: everything comes from one pass over the data.
struct Trial<'a> {
    moments: &'a StarMoments,
    folds: &'a Folds,
    /// Of the nuisance.
    precision: Vec<f64>,
    /// Of a scalar of white evidence.
    variance: f64,
    groups: &'a [Group],
}

impl Trial<'_> {
    /// Nuisance, the columns of `chosen`, and the residual.
    fn columns(&self, chosen: &[usize]) -> Vec<usize> {
        let n = self.precision.len();
        (0..n)
            .chain(columns_of(self.groups, chosen).into_iter().map(|c| n + c))
            .chain([self.moments.width() - 1])
            .collect()
    }

    fn layout(&self, columns: &[usize]) -> Layout {
        Layout {
            nuisance_precision: self.precision.clone(),
            candidates: columns.len() - self.precision.len() - 1,
            residuals: 1,
        }
    }

    /// Noise of what is left once white evidence has fitted all of `columns`.
    fn taken_out(&self, columns: &[usize]) -> Option<CommonNoise> {
        let grams = self.moments.white_of(columns);
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
        let (noise, rotations, loglik) = [self.taken_out(&columns), Some(*noise)]
            .into_iter()
            .flatten()
            .filter_map(|start| self.climb(&columns, &start))
            .max_by(|a, b| a.2.total_cmp(&b.2))?;
        let layout = self.layout(&columns);
        let grams = self.moments.under(&columns, &noise);
        let fits = Fits::new(&grams, self.folds, &layout, 1.0)?;
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
                (own, credible)
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
            let grams = self.moments.under(columns, &noise);
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

/// What the search beside a slow error ends with.
struct Coloured<'a> {
    searched: Searched<'a>,
    wander: Wander,
    /// The same candidates under white noise.
    white: Fitted,
}

fn coloured<'a>(
    white: &StarEvidence<'a>,
    folds: &Folds,
    mut candidates: Vec<Box<dyn Candidate>>,
    may: &[bool],
    start: CommonNoise,
) -> Result<Coloured<'a>, CloseError> {
    let tried = may.iter().filter(|m| **m).count().max(1);
    let mut banned = vec![false; candidates.len()];
    let mut chosen: Vec<usize> = Vec::new();
    let mut noise = start;
    let mut moments = white.moments(folds, &borrowed(&candidates));
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
        let grams = moments.white_of(&all);
        let plain = fit_grams(white, &grams, folds, &borrowed(&candidates))?;
        let filtered = under(&noise)?;
        let trial = Trial {
            moments: &moments,
            folds,
            precision: white.precision(),
            variance: plain.fits.variance(&[]).unwrap_or(1.0),
            groups: &plain.groups,
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
            if base.stands_instead(&without, &white_alone[g]) {
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
            .into_par_iter()
            .filter_map(|g| {
                let mut with = chosen.clone();
                with.push(g);
                let scored = trial.score(&with, &noise)?;
                let group = &plain.groups[g];
                let mut judgement = trial.judge(&scored, chosen.len(), &base, group.choices, tried);
                if scored.stands_instead(&base, &white_alone[g]) {
                    judgement.p_value = white_alone[g].p_value;
                }
                let rank = judgement.delta_loglik - price(group, plain.scalars);
                judgement.stands().then_some((g, rank, scored.noise))
            })
            .collect::<Vec<_>>()
            .into_iter()
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((added, _, its_noise)) = best else {
            let fitted = under(&noise)?;
            let mut judged = judged(&fitted.fits, &fitted.groups, &chosen, tried);
            for (&g, judgement) in chosen.iter().zip(stands) {
                judged[g] = judgement;
            }
            let ratio = base.rotations.slow_ratio(&noise);
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
                    rotations: base.rotations,
                    ratio,
                },
                white: plain,
            });
        };
        chosen.push(added);
        noise = its_noise;
        let fitted = under(&noise)?;
        let evidence = white.with_noise(&noise);
        polish(&evidence, folds, &mut candidates, &fitted, &chosen)?;
        moments = white.moments(folds, &borrowed(&candidates));
    }
}

impl Wander {
    /// Axes on which the slow error is beyond doubt: two parameters each, three axes.
    pub(crate) fn axes(&self) -> [bool; 3] {
        significant(&self.ratio)
    }
}

fn significant(ratio: &[f64; 3]) -> [bool; 3] {
    chances(ratio).map(|p| p < FAMILY_ALPHA)
}

/// Chance of such a ratio on any of three axes where the noise is white.
fn chances(ratio: &[f64; 3]) -> [f64; 3] {
    ratio.map(|ratio| {
        let p = ChiSquared::new(2.0).map_or(1.0, |law| law.sf(ratio.max(0.0) / WIDENING));
        3.0 * p
    })
}
