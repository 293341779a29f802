//! Whether what is put forward has no chance, so that another search is needless.
//!
//! Each is held against the data beside what was found, in the place of each of that, and in the place of all of it;
//! beside a slow error of what turns frames. A search weighs the same, at length.
//!
//! Not physics: a comparison of hypotheses ([`super`]).

use std::sync::Arc;

use block_regression::Folds;
use effects::Candidate;
use rayon::prelude::*;

use super::alone::Begun;
use super::trial::{Trial, taken_out_in_turn};
use super::{Searched, Wander};
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::search::group::Group;
use crate::search::selection::{FAMILY_ALPHA, Trials, costs};
use crate::search::{Found, borrowed, fit_beside, without};
use crate::star::evidence::StarEvidence;

/// Nats that another polish may bring: what is put forward is at its best already.
const POLISH: f64 = 3.0;
/// The same where there is no slow error, which might change with it.
const POLISH_ALONE: f64 = 1.0;

/// Whether with none of `put_forward` the data is worth as much as with what was found.
pub(crate) fn in_vain(
    white: &StarEvidence<'_>,
    folds: &Folds,
    searched: &Searched<'_>,
    put_forward: &[Arc<dyn Candidate>],
) -> Result<bool, CloseError> {
    let held = Held::of(&searched.found, put_forward);
    match &searched.wander {
        Some(wander) => held.beside_slow(white, folds, wander),
        None => held.alone(searched.evidence.as_ref().unwrap_or(white), folds),
    }
}

/// What was found, and behind it what is put forward.
struct Held<'a> {
    found: &'a Found,
    candidates: Vec<Arc<dyn Candidate>>,
    known: Vec<usize>,
    new: Vec<usize>,
}

impl<'a> Held<'a> {
    fn of(found: &'a Found, put_forward: &[Arc<dyn Candidate>]) -> Self {
        let chosen = &found.selection.chosen;
        let known = chosen.iter().map(|&g| &found.candidates[g]);
        let candidates: Vec<_> = known.chain(put_forward).cloned().collect();
        Self {
            found,
            known: (0..chosen.len()).collect(),
            new: (chosen.len()..candidates.len()).collect(),
            candidates,
        }
    }

    /// What all that was tried makes each of `groups` pay.
    fn cost(&self, groups: &[Group]) -> Vec<f64> {
        let mut all = self.found.fitted.groups.clone();
        let first = all.len();
        all.extend_from_slice(&groups[self.known.len()..]);
        let cost = costs(&all, &vec![true; all.len()]);
        let chosen = self.found.selection.chosen.iter().copied();
        chosen.chain(first..all.len()).map(|g| cost[g]).collect()
    }

    /// One of what is put forward beside what was found, and in the place of those of it that are `open`.
    fn sets(&self, open: impl Fn(&usize) -> bool) -> Vec<Vec<usize>> {
        let open = self.known.iter().copied().filter(open);
        let mut sets = Vec::new();
        for out in taken_out_in_turn(open.collect()) {
            let rest = without(&self.known, &out);
            sets.extend(self.new.iter().map(|&at| [&rest[..], &[at]].concat()));
        }
        sets
    }

    /// Where there is no slow error: one that does not stand beside what was found, and fits no better in the place of it.
    fn alone(&self, level: &StarEvidence<'_>, folds: &Folds) -> Result<bool, CloseError> {
        let own = borrowed(&self.candidates);
        let mut fitted = fit_beside(level, folds, &own, &self.known)?;
        fitted.fits.scatter_as(&self.found.fitted.fits);
        let cost = self.cost(&fitted.groups);
        let trials = Trials {
            scalars: self.found.fitted.scalars,
            ..fitted.trials(&cost)
        };
        let before = trials.fit(&self.known).ok_or(CloseError::Singular)?;
        let least = FAMILY_ALPHA * POLISH_ALONE.exp();
        let stands = |&at: &usize| trials.chance(&self.known, at).is_some_and(|p| p < least);
        let pays = |set: &Vec<usize>| {
            let instead = set.len() <= self.known.len();
            instead
                && trials
                    .fit(set)
                    .is_some_and(|fit| fit + POLISH_ALONE >= before)
        };
        Ok(!self.new.iter().any(stands) && !self.sets(|_| true).par_iter().any(pays))
    }

    /// Beside a slow error.
    fn beside_slow(
        &self,
        white: &StarEvidence<'_>,
        folds: &Folds,
        wander: &Wander,
    ) -> Result<bool, CloseError> {
        let own = Begun::on(white, folds, self.candidates.clone())?;
        let groups = &own.plain.groups;
        let every: Vec<usize> = (0..groups.len()).collect();
        let trial = Trial {
            moments: &own.moments,
            folds,
            precision: white.precision(),
            variance: own.plain.variance_beside(&every).unwrap_or(1.0),
            slow_price: white.slow_price,
            groups,
            cost: self.cost(groups),
            all: None,
            single: false,
        };
        trial.sum_up();
        let worth = |set: &[usize]| Some(trial.worth(&trial.score(set, &wander.noise)?));
        let before = worth(&self.known).ok_or(CloseError::Singular)?;
        // what cannot be told from what is there (a jump where a step was found already) brings nothing
        let pays = |set: &Vec<usize>| worth(set).is_some_and(|with| with + POLISH >= before);
        let turns = |at: &usize| self.candidates[*at].acts_on_attitude();
        Ok(!self.sets(turns).par_iter().any(pays))
    }
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use telemetry::Model;

    use super::*;
    use crate::star::data::StarData;
    use crate::star::harness::{at_rest, silent};

    const SPAN_S: [f64; 2] = [0.0, 299.5];

    /// Whether `put_forward` is in vain beside `found`, of 600 frames that `shift`, arcsec along x, acts on beside
    /// noise of 1".
    fn is_in_vain(
        found: &[Arc<dyn Candidate>],
        put_forward: Box<dyn Candidate>,
        shift: impl Fn(f64) -> f64,
        seed: u64,
    ) -> bool {
        let data: StarData = at_rest((0..600).map(|k| 0.5 * f64::from(k)).collect());
        let mut draws = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut noise = || -> f64 { StandardNormal.sample(&mut draws) };
        let residual = [1.0, 0.0].map(|along| {
            let rows = data.t_s.iter();
            rows.map(|&t| noise() + along * shift(t)).collect()
        });
        let white = StarEvidence {
            residuals: Arc::new(vec![residual]),
            ..silent(&data, &Model::default())
        };
        let folds = Folds::cut(data.frames.t_s.len());
        let all: Vec<usize> = (0..found.len()).collect();
        let searched = Searched::plain(Found::of_chosen(&white, &folds, found, &all).unwrap());
        in_vain(&white, &folds, &searched, &[put_forward.into()]).unwrap()
    }

    /// Six stars in 600 frames tell a line to sqrt(2/3600) = 0.024": one of 0.2" is 8.5 sigma, chance e^-33. Of none a
    /// draw in a hundred tells 2.6 sigma about the three axes.
    #[test]
    fn a_line_that_is_there_is_worth_a_search_and_one_that_is_not_is_none() {
        let line = || effects::line_at(0.0711, SPAN_S, 300);
        let wave = |size: f64| move |t: f64| size * (std::f64::consts::TAU * 0.0711 * t).sin();
        for seed in 0..20 {
            assert!(!is_in_vain(&[], line(), wave(0.2), seed), "seed {seed}");
            assert!(is_in_vain(&[], line(), wave(0.0), seed), "seed {seed}");
        }
    }

    /// A step of 0.2" in the middle is 6 sigma. Found at 120 s for 150 it leaves a third of their square, 1 - (0.4/0.5)
    /// (0.5/0.6): 6 nats, no effect of its own among thousands, but what is put forward is better in its place.
    #[test]
    fn what_fits_better_in_the_place_of_what_was_found_is_worth_a_search() {
        let step = |at_s: f64, of: usize| effects::step_at(at_s, SPAN_S, of);
        let shift = |t: f64| if t < 150.0 { 0.0 } else { 0.2 };
        let found: [Arc<dyn Candidate>; 1] = [step(120.0, 1).into()];
        let better = (0..20).filter(|&seed| !is_in_vain(&found, step(150.0, 100_000), shift, seed));
        assert!(better.count() >= 18);
        let found: [Arc<dyn Candidate>; 1] = [step(150.0, 1).into()];
        let worse = (0..20).filter(|&seed| is_in_vain(&found, step(120.0, 100_000), shift, seed));
        assert!(worse.count() >= 18);
    }
}
