//! Whether what is put forward has no chance, so that another search is needless.
//!
//! Beside a slow error each is held against the data beside what was found, in the place of each of those that turn
//! frames, and in the place of all of them. Without one that is asked only where nothing was found that turns the camera,
//! in whose place it could be: then beside it all, and in the place of each. A search weighs the same, at length.
//!
//! Not physics: a comparison of hypotheses ([`super`]).

use std::sync::Arc;

use block_regression::Folds;
use effects::Candidate;
use rayon::prelude::*;

use super::Wander;
use super::alone::Begun;
use super::trial::{Trial, taken_out_in_turn};
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::search::group::Group;
use crate::search::selection::{FAMILY_ALPHA, costs};
use crate::search::{Found, borrowed, fit_beside, without};
use crate::star::evidence::StarEvidence;

/// Nats that another polish, and another noise for it, may bring.
const POLISH: f64 = 1.0;

/// What was found, and behind it what is put forward.
struct PutForward<'a> {
    found: &'a Found,
    candidates: Vec<Arc<dyn Candidate>>,
    known: Vec<usize>,
    new: Vec<usize>,
}

impl<'a> PutForward<'a> {
    fn behind(found: &'a Found, put_forward: &[Arc<dyn Candidate>]) -> Self {
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

    /// Each of what is put forward beside what was found less what is taken `out`.
    fn beside_less(&self, out: &[usize]) -> Vec<Vec<usize>> {
        let rest = without(&self.known, out);
        let new = self.new.iter();
        new.map(|&at| [&rest[..], &[at]].concat()).collect()
    }
}

/// Whether what was found without a slow error, and nothing described, is worth more than with any of `put_forward`; `false`,
/// too, where something may be in the place of what was found.
pub(crate) fn without_slow(
    white: &StarEvidence<'_>,
    folds: &Folds,
    found: &Found,
    put_forward: &[Arc<dyn Candidate>],
) -> Result<bool, CloseError> {
    // frames that turn freely know an orbit by what it stretches, as other effects do
    let is_rival = |c: &dyn Candidate| c.turns_camera() || white.data.free_attitude;
    if found.chosen().any(is_rival) {
        return Ok(false);
    }
    let behind = PutForward::behind(found, put_forward);
    let own = borrowed(&behind.candidates);
    let fitted = fit_beside(white, folds, &own, &behind.known)?;
    let cost = behind.cost(&fitted.groups);
    let trials = fitted.trials(&cost);
    // in sample and out of fold: what acts in one fold alone is more in one than in the other
    let worth = |set: &[usize]| Some([trials.fit(set)?, trials.worth(set)?]);
    let Some(before) = worth(&behind.known).filter(|w| w.iter().all(|w| w.is_finite())) else {
        return Ok(false);
    };
    let least = FAMILY_ALPHA * POLISH.exp();
    let stands = |&at: &usize| {
        let chance = trials.white_chance(&behind.known, at);
        chance.is_some_and(|p| p < least)
    };
    let pays = |set: &Vec<usize>| {
        let with = worth(set);
        with.is_some_and(|with| (0..2).any(|k| with[k] + POLISH >= before[k]))
    };
    let out = behind.known.iter();
    let instead: Vec<_> = out.flat_map(|&out| behind.beside_less(&[out])).collect();
    Ok(!behind.new.iter().any(stands) && !instead.iter().any(pays))
}

/// Whether what was found beside a slow error is worth more than with any of `put_forward`.
pub(crate) fn beside_slow(
    white: &StarEvidence<'_>,
    folds: &Folds,
    found: &Found,
    wander: &Wander,
    put_forward: &[Arc<dyn Candidate>],
) -> Result<bool, CloseError> {
    let behind = PutForward::behind(found, put_forward);
    let own = Begun::on(white, folds, behind.candidates.clone())?;
    let groups = &own.plain.groups;
    let every: Vec<usize> = (0..groups.len()).collect();
    let trial = Trial {
        moments: &own.moments,
        folds,
        precision: white.precision(),
        variance: own.plain.variance_beside(&every).unwrap_or(1.0),
        slow_price: white.slow_price,
        groups,
        cost: behind.cost(groups),
        all: None,
        single: false,
    };
    trial.sum_up();
    let worth = |set: &[usize]| Some(trial.worth(&trial.score(set, &wander.noise)?));
    let before = worth(&behind.known).ok_or(CloseError::Singular)?;
    // what cannot be told from what is there (a jump where a step was found already) brings nothing
    let pays = |set: &Vec<usize>| worth(set).is_some_and(|with| with + POLISH >= before);
    let turns = |at: &usize| behind.candidates[*at].acts_on_attitude();
    let turns = behind.known.iter().copied().filter(turns);
    let sets: Vec<_> = taken_out_in_turn(turns.collect())
        .iter()
        .flat_map(|out| behind.beside_less(out))
        .collect();
    Ok(!sets.par_iter().any(pays))
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use telemetry::Model;

    use super::*;
    use crate::search::empirical::{Empirical, Variable};
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
        let found = Found::of_chosen(&white, &folds, found, &all).unwrap();
        without_slow(&white, &folds, &found, &[put_forward.into()]).unwrap()
    }

    /// Six stars in 600 frames tell a line to sqrt(2/3600) = 0.024": one of 0.2" is 8.5 sigma, chance e^-33. Of none, which
    /// pays for 300 frequencies, a draw in a thousand has a chance below 0.027.
    #[test]
    fn a_line_that_is_there_is_worth_a_search_and_one_that_is_not_is_none() {
        let line = || effects::line_at(0.0711, SPAN_S, 300);
        let wave = |size: f64| move |t: f64| size * (std::f64::consts::TAU * 0.0711 * t).sin();
        for seed in 0..20 {
            assert!(!is_in_vain(&[], line(), wave(0.2), seed), "seed {seed}");
            assert!(is_in_vain(&[], line(), wave(0.0), seed), "seed {seed}");
        }
    }

    /// Beside a step, in the place of which a line could be, it is searched for whatever it is worth; beside a star that
    /// lies elsewhere only if it is worth anything.
    #[test]
    fn what_may_be_in_the_place_of_what_was_found_is_worth_a_search() {
        let line = || effects::line_at(0.0711, SPAN_S, 300);
        let nothing = |_: f64| 0.0;
        let step: Arc<dyn Candidate> = effects::step_at(120.0, SPAN_S, 1).into();
        assert!(!is_in_vain(&[step], line(), nothing, 3));
        let star = Variable::Star(vec![2]);
        let star = Empirical::new(star, [0.0, 1.0], true).unwrap();
        assert!(is_in_vain(&[Arc::new(star)], line(), nothing, 3));
    }
}
