//! The search beside a slow error: forward and backward, each hypothesis at its own best noise.
//!
//! Candidates are put forward twice, by what white evidence and by what the present noise makes of them; the few best of
//! each are scored, and the best that stands is added.
//!
//! Not physics: a search ([`super`] has what hypotheses are held against).

use std::mem;
use std::sync::Arc;

use block_regression::Folds;
use coloured_noise::CommonNoise;
use effects::Candidate;
use rayon::prelude::*;

use super::alone::{Begun, plainly};
use super::on_frames::{OnFrames, in_forms};
use super::trial::{Scored, Trial};
use super::{Searched, Wander};
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::search::near::{self, Likelier};
use crate::search::selection::{Judgement, Selection, costs, price};
use crate::search::{Fitted, Found, borrowed, fit_grams_beside, polish, without};
use crate::star::evidence::StarEvidence;
use crate::star::moments::StarMoments;

/// Candidates of each list that are scored.
const SHORTLIST: usize = 3;
/// Most effects that are added.
const MOST: usize = 8;

/// What the search beside a slow error ends with.
pub(super) struct Coloured<'a> {
    pub(super) searched: Searched<'a>,
    pub(super) wander: Wander,
    /// The same candidates under white noise.
    pub(super) begun: Begun,
    pub(super) worth: f64,
}

/// Where the search stands.
struct Search<'s, 'a> {
    white: &'s StarEvidence<'a>,
    folds: &'s Folds,
    may: &'s [bool],
    /// Were chosen, and fell.
    banned: Vec<bool>,
    candidates: Vec<Arc<dyn Candidate>>,
    chosen: Vec<usize>,
    noise: CommonNoise,
}

/// What becomes of a choice.
enum Looked {
    /// All of it stands.
    Stand(Vec<Judgement>),
    Falls(usize),
}

/// From `begun` and the noise of `start`.
pub(super) fn beside_slow<'a>(
    white: &StarEvidence<'a>,
    folds: &Folds,
    begun: Begun,
    may: &[bool],
    start: CommonNoise,
) -> Result<Coloured<'a>, CloseError> {
    let Begun {
        candidates,
        mut moments,
        plain,
        hopeless,
    } = begun;
    let mut search = Search {
        white,
        folds,
        may,
        banned: vec![false; candidates.len()],
        candidates,
        chosen: Vec::new(),
        noise: start,
    };
    // fits of the same columns, those under the noise of the last choice
    let (mut plain_fit, mut filtered_fit) = (Some(plain), None);
    let mut compared = false;
    loop {
        let plain = match plain_fit.take() {
            Some(plain) => plain,
            None => plainly(white, folds, &search.candidates, &moments)?,
        };
        let plain = search.beside(plain)?;
        let filtered = match filtered_fit.take() {
            Some(filtered) => filtered,
            None => search.fitted(&moments)?,
        };
        let trial = search.trial(&moments, &plain, &filtered);
        let base = trial.score(&search.chosen, &search.noise);
        let base = base.ok_or(CloseError::Singular)?;
        search.noise = base.noise;
        let stands = match search.look_back(&trial, &base)? {
            Looked::Stand(stands) => stands,
            Looked::Falls(fallen) => {
                search.banned[fallen] = true;
                search.chosen.retain(|&g| g != fallen);
                continue;
            }
        };
        let best = search.best(&trial, &base, [&plain, &filtered]);
        if best.is_none() && !compared {
            compared = true;
            if let Some(likelier) = search.likelier(&moments, &filtered)? {
                search.chosen = likelier.set;
                let before = mem::replace(&mut search.candidates, likelier.candidates);
                drop((plain, filtered));
                moments = in_forms(white, folds, moments, &before, &search.candidates);
                continue;
            }
        }
        let Some((added, its_noise)) = best else {
            let (worth, cost) = (trial.worth(&base), trial.cost);
            let found = search.noise;
            if search.turns_frames() {
                search.noise = base.rotations.believed(&found);
            }
            let (fitted, selection) = search.judged(&moments, &cost, stands)?;
            let candidates = search.candidates;
            return Ok(Coloured {
                wander: Wander::of(base.rotations, found),
                begun: Begun {
                    candidates: candidates.clone(),
                    moments,
                    plain,
                    hopeless,
                },
                searched: Searched {
                    found: Found {
                        candidates,
                        fitted,
                        selection,
                    },
                    evidence: Some(white.with_noise(&search.noise)),
                    wander: None,
                },
                worth,
            });
        };
        search.chosen.push(added);
        search.noise = its_noise;
        let fitted = search.fitted(&moments)?;
        let before = search.candidates.clone();
        if search.polished(&moments, &fitted)? {
            drop((plain, filtered, fitted));
            moments = in_forms(white, folds, moments, &before, &search.candidates);
        } else {
            (plain_fit, filtered_fit) = (Some(plain), Some(fitted));
        }
    }
}

impl<'s> Search<'s, '_> {
    fn turns_frames(&self) -> bool {
        let mut chosen = self.chosen.iter();
        chosen.any(|&g| self.candidates[g].acts_on_attitude())
    }

    fn beside(&self, fitted: Fitted) -> Result<Fitted, CloseError> {
        fitted.beside(self.folds, &borrowed(&self.candidates), &self.chosen)
    }

    /// Fits under the present noise.
    fn fitted(&self, moments: &StarMoments) -> Result<Fitted, CloseError> {
        let level = self.white.with_noise(&self.noise);
        let grams = level.under(moments);
        let candidates = borrowed(&self.candidates);
        fit_grams_beside(&level, &grams, self.folds, &candidates, &self.chosen)
    }

    fn trial<'t>(
        &self,
        moments: &'t StarMoments,
        plain: &'t Fitted,
        filtered: &'t Fitted,
    ) -> Trial<'t>
    where
        's: 't,
    {
        Trial {
            moments,
            folds: self.folds,
            precision: self.white.precision(),
            variance: plain.variance_beside(&self.chosen).unwrap_or(1.0),
            slow_price: self.white.slow_price,
            groups: &plain.groups,
            cost: costs(&plain.groups, self.may),
            all: Some(&filtered.fits),
            single: false,
        }
    }

    /// Each of the choice against the choice without it.
    fn look_back(&self, trial: &Trial<'_>, base: &Scored) -> Result<Looked, CloseError> {
        let mut stands = Vec::new();
        let mut fallen = None;
        for (at, &g) in self.chosen.iter().enumerate() {
            let others = trial.score(&without(&self.chosen, &[g]), &self.noise);
            let others = others.ok_or(CloseError::Singular)?;
            let judgement = trial.judge(base, at, &others, trial.groups[g].choices);
            if !judgement.stands() {
                fallen = Some(g);
            }
            stands.push(judgement);
        }
        Ok(fallen.map_or(Looked::Stand(stands), Looked::Falls))
    }

    /// What each of two fits puts forward.
    fn shortlist(&self, trial: &Trial<'_>, fits: [&Fitted; 2]) -> Vec<usize> {
        if self.chosen.len() >= MOST {
            return Vec::new();
        }
        let open = self.open();
        let mut shortlist: Vec<usize> = Vec::new();
        for fitted in fits {
            let tried = fitted.trials(&trial.cost).tried(&open, &self.chosen);
            let standing = tried.into_iter().filter(|t| t.judgement.stands());
            shortlist.extend(standing.map(|t| t.group).take(SHORTLIST));
        }
        shortlist.sort_unstable();
        shortlist.dedup();
        shortlist
    }

    /// The best that stands beside the choice, and the noise that suits both.
    fn best(
        &self,
        trial: &Trial<'_>,
        base: &Scored,
        fits: [&Fitted; 2],
    ) -> Option<(usize, CommonNoise)> {
        let scalars = fits[0].scalars;
        let scored = self.shortlist(trial, fits).into_par_iter().filter_map(|g| {
            let mut with = self.chosen.clone();
            with.push(g);
            let scored = trial.score(&with, &self.noise)?;
            let group = &trial.groups[g];
            let judgement = trial.judge(&scored, self.chosen.len(), base, group.choices);
            let rank = judgement.delta_loglik - price(group, scalars);
            judgement.stands().then_some((g, rank, scored.noise))
        });
        let scored: Vec<_> = scored.collect();
        let best = scored.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        best.map(|(g, _, noise)| (g, noise))
    }

    /// All candidates beside the choice, which is judged by what became of it at its own noise.
    fn judged(
        &self,
        moments: &StarMoments,
        cost: &[f64],
        stands: Vec<Judgement>,
    ) -> Result<(Fitted, Selection), CloseError> {
        let fitted = self.fitted(moments)?;
        let mut judged = fitted.trials(cost).judged(&self.chosen);
        for (&g, judgement) in self.chosen.iter().zip(stands) {
            judged[g] = judgement;
        }
        let chosen = self.chosen.clone();
        Ok((fitted, Selection { chosen, judged }))
    }

    /// Effects that are likelier than the choice once they are polished, under the present noise.
    fn likelier(
        &self,
        moments: &StarMoments,
        fitted: &Fitted,
    ) -> Result<Option<Likelier>, CloseError> {
        let level = self.white.with_noise(&self.noise);
        let evidence = OnFrames::of(&level, moments);
        let (candidates, chosen) = (&self.candidates, &self.chosen);
        near::likelier(
            &evidence,
            self.folds,
            candidates,
            fitted,
            chosen,
            &self.open(),
        )
    }

    /// Candidates that may be added.
    fn open(&self) -> Vec<bool> {
        let may = self.may.iter().zip(&self.banned);
        may.map(|(may, banned)| *may && !banned).collect()
    }

    /// Whether the choice has other forms now.
    fn polished(&mut self, moments: &StarMoments, fitted: &Fitted) -> Result<bool, CloseError> {
        let level = self.white.with_noise(&self.noise);
        let evidence = OnFrames::of(&level, moments);
        let (candidates, chosen) = (&mut self.candidates, &self.chosen);
        polish(&evidence, self.folds, candidates, fitted, chosen)
    }
}
