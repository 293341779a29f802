//! Jumps in series of one number a frame, and the one that several series share.
//!
//! ```text
//! P = M chi2_k of sum over k series of 2 (L(step, its best noise) - L(best noise)) / 1.3
//! ```
//!
//! with M instants. The best instant is looked for under the noise of the series, which may take the
//! step for its own, and under white noise, which may take a wander for a step; the likelihood judges.
//!
//! Source: Wilks 1938 (likelihood ratio).

use std::sync::Arc;

use coloured_noise::Coloured;
use effects::{Candidate, Scene};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{MIN_POINTS, MOST, Series, Track, WORTH_A_SEARCH};
use crate::attitude::spatial_errors::SpatialErrors;
use crate::search::selection::WIDENING;

/// Instants tried before the neighbours of the best are.
const MOST_STEPS: usize = 1200;
/// Points that a level on each side of a jump is of.
const MIN_SIDE: usize = 5;

/// A jump about all axes at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SharedJump {
    pub(crate) at_s: f64,
    /// Instants that were looked at.
    pub(crate) tried: usize,
}

impl SharedJump {
    /// The effect that makes it.
    pub(crate) fn candidate(self, scene: &Scene<'_>) -> Arc<dyn Candidate> {
        effects::step_at(self.at_s, scene.surroundings.span_s, self.tried).into()
    }
}

impl Series {
    /// The jump that the tracker most likely makes, if it is worth a search.
    pub(crate) fn shared_jump(&self) -> Option<SharedJump> {
        let first = &self.each.iter().find(|one| one.means.turns)?.means;
        let turns: Vec<&Track> = self
            .each
            .iter()
            .map(|one| &one.means)
            .filter(|track| track.turns && track.t_s == first.t_s)
            .collect();
        let noises: Vec<Coloured> = turns.iter().map(|t| t.noise()).collect();
        let whites: Vec<Coloured> = noises.iter().map(whole).collect();
        let before: f64 = turns.iter().zip(&noises).map(|(t, n)| t.loglik(n)).sum();
        let (after, at) = [&noises, &whites]
            .into_iter()
            .filter_map(|noises| best_step(&turns, noises))
            .filter_map(|at| {
                let each: Option<Vec<f64>> = turns
                    .iter()
                    .zip(&noises)
                    .map(|(t, n)| Some(t.stepped(at, n)?.loglik))
                    .collect();
                Some((each?.iter().sum::<f64>(), at))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        let tried = first.instants();
        let p = chance(after - before, turns.len()) * tried as f64;
        (p < WORTH_A_SEARCH).then(|| SharedJump {
            at_s: first.before(at),
            tried,
        })
    }
}

/// The instant from which on the image of what is left, by the `tracks` of its stars, is likeliest another size: in white
/// noise, whatever that is.
pub(crate) fn growth(tracks: &[Track]) -> Option<SharedJump> {
    // the first of the stretches
    let track = tracks.iter().find(|t| !t.turns)?.thinned();
    if track.t_s.len() < MIN_POINTS {
        return None;
    }
    let at = best_step(&[&track], &[WHITE])?;
    Some(SharedJump {
        at_s: track.before(at),
        tried: track.instants(),
    })
}

/// Of any size: where a step is best does not depend on it.
const WHITE: Coloured = Coloured {
    slow: 0.0,
    white: 1.0,
    tau_s: 1.0,
};

/// All of it as white noise.
fn whole(noise: &Coloured) -> Coloured {
    Coloured {
        white: noise.white.hypot(noise.slow),
        ..WHITE
    }
}

/// Chance that steps of so many series gain so many nats at one instant.
fn chance(gain: f64, series: usize) -> f64 {
    let ratio = 2.0 * gain / WIDENING;
    ChiSquared::new(series as f64).map_or(1.0, |law| law.sf(ratio.max(0.0)))
}

/// A series with a step taken out.
struct Stepped {
    loglik: f64,
    size: f64,
    left: Track,
}

impl Track {
    /// Instants of jumps: the middle between the points on either side. `noise`: of the series, where it is
    /// known.
    pub(super) fn jumps(&mut self, alpha: f64, mut noise: Option<Coloured>) -> Vec<f64> {
        let mut found = Vec::new();
        while found.len() < MOST {
            let noise = noise.take().unwrap_or_else(|| self.noise());
            let before = self.loglik(&noise);
            let under = |n: Coloured| best_step(&[self], &[n]);
            let coloured = (noise.slow > 0.0).then(|| under(noise)).flatten();
            let white = under(whole(&noise)).filter(|at| coloured != Some(*at));
            let best = [coloured, white]
                .into_iter()
                .flatten()
                .filter_map(|at| Some((at, self.stepped(at, &noise)?)))
                .max_by(|a, b| a.1.loglik.total_cmp(&b.1.loglik));
            let Some((at, Stepped { loglik, size, left })) = best else {
                break;
            };
            let p = chance(loglik - before, 1);
            let change = |(c, axis): &(SpatialErrors, usize)| c.chance_on(*axis, size);
            if p * self.instants() as f64 >= alpha
                || self.changes.as_ref().map_or(0.0, change) >= alpha
            {
                break;
            }
            found.push(self.before(at));
            *self = left;
        }
        found
    }

    /// Instants that are tried.
    fn instants(&self) -> usize {
        self.t_s.len() - 2 * MIN_SIDE
    }

    /// The instant of a step that point `at` is the first to have.
    fn before(&self, at: usize) -> f64 {
        0.5 * (self.t_s[at - 1] + self.t_s[at])
    }

    /// A step before point `at`, and the noise that suits what it leaves.
    fn stepped(&self, at: usize, noise: &Coloured) -> Option<Stepped> {
        let step: Vec<f64> = (0..self.t_s.len())
            .map(|k| f64::from(u8::from(k >= at)))
            .collect();
        let columns = [vec![1.0; step.len()], step];
        let mut its_noise = *noise;
        let (mut size, mut left) = self.take_out(&whole(noise), &columns)?;
        for round in 0..2 {
            its_noise = left.noise();
            if round == 0 && its_noise.slow <= 0.0 {
                // white noise was what it was taken out under
                break;
            }
            (size, left) = self.take_out(&its_noise, &columns)?;
        }
        Some(Stepped {
            loglik: left.loglik(&its_noise),
            size: size[1],
            left,
        })
    }
}

/// What steps beside a constant explain of one series.
struct Scores<'a> {
    track: &'a Track,
    noise: Coloured,
    y: Vec<f64>,
    one: Vec<f64>,
    /// Products of `one` with itself and with `y`.
    constant: [f64; 2],
}

impl<'a> Scores<'a> {
    fn of(track: &'a Track, noise: Coloured) -> Self {
        let y = track.whitened(&noise, &track.value);
        let one = track.whitened(&noise, &vec![1.0; track.t_s.len()]);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let constant = [dot(&one, &one), dot(&one, &y)];
        Self {
            track,
            noise,
            y,
            one,
            constant,
        }
    }

    /// Of steps before the points `at`.
    fn at(&self, at: &[usize]) -> Vec<f64> {
        let (t_s, weight, [oo, oy]) = (&self.track.t_s, &self.track.weight, self.constant);
        let products = self.noise.steps(t_s, weight, at, [&self.one, &self.y]);
        let scores = products.into_iter().map(|[ss, so, sy]| {
            let ss = ss - so * so / oo;
            let score = sy - so * oy / oo;
            if ss > 0.0 { score * score / ss } else { 0.0 }
        });
        scores.collect()
    }
}

/// Where a step explains most of all `tracks`, which have the same times, under their `noises`.
fn best_step(tracks: &[&Track], noises: &[Coloured]) -> Option<usize> {
    let n = tracks.first()?.t_s.len();
    let each: Vec<Scores<'_>> = tracks
        .iter()
        .zip(noises)
        .map(|(track, noise)| Scores::of(track, *noise))
        .collect();
    let best = |at: &[usize]| -> Option<usize> {
        let mut sums = vec![0.0; at.len()];
        for scores in &each {
            for (sum, score) in sums.iter_mut().zip(scores.at(at)) {
                *sum += score;
            }
        }
        let all = at.iter().zip(sums);
        all.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(at, _)| *at)
    };
    // coarse first: a step is seen from near by
    let stride = n.div_ceil(MOST_STEPS);
    let all: Vec<usize> = (MIN_SIDE..=n - MIN_SIDE).step_by(stride).collect();
    let coarse = best(&all)?;
    let first = coarse.saturating_sub(2 * stride).max(MIN_SIDE);
    let fine: Vec<usize> = (first..=(coarse + 2 * stride).min(n - MIN_SIDE)).collect();
    best(&fine)
}
