//! What speaks for a candidate, and what against it.
//!
//! ```text
//! 2 (L(H1) - L(H0)) ~ chi2_p          L: at the own best noise of each
//! ```
//!
//! What does not stand so is held as a whole against slow noise in its place, each with all that its freedom costs.
//! What stands is held against what the declared model makes along this motion, and a line against the noise around it.
//!
//! Source: Wilks 1938 (likelihood ratio).

use block_regression::beyond;
use focal_plane::{ARCSEC_PER_RAD, SPEED_OF_LIGHT_M_S};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use super::own_noise::{LITTLE, Scored, Start};
use super::{Trial, follows_a_channel, is_a_description};
use crate::attitude::likeness::likeness;
use crate::attitude::line_level::line_level;
use crate::attitude::motion_terms::is_of_motion;
use crate::search::empirical::EMPIRICAL;
use crate::search::selection::{
    FAMILY_ALPHA, Judgement, SLOW_PRICE, WIDENING, columns_of, or_across,
};
use crate::search::{Fitted, without};
use crate::unexplained::SEARCH_ALPHA;

/// The effects that a change of stars looks like, and stars that come by again.
const STEP: &str = "step_misalignment";
const LINE: &str = "periodic_misalignment";
/// Those that go with the motion.
const BY_MOTION: [&str; 2] = ["time_tag_offset", "exposure_smear"];
/// The effect of an orbit.
const ABERRATION: &str = "velocity_aberration";

/// Nats by which an effect has to be worth more than slow noise in its place. The best step of a wander is worth
/// 2 +- 2 less.
const BY_FAR: f64 = 2.5;
/// Nats by which a channel without a cause has to predict better than an effect, and more than which that adds
/// nothing beside it.
const DESCRIBED: f64 = 5.0;

impl Trial<'_, '_> {
    /// Whether a channel or a motion without a cause predicts better, alone, what `g` explains beside `chosen`.
    pub(super) fn is_described(&self, chosen: &[usize], g: usize) -> bool {
        if follows_a_channel(self.candidates[g].as_ref()) {
            return false;
        }
        let gain = |more: &[usize]| {
            let score = self.score(&[chosen, more].concat());
            score.map_or(f64::NEG_INFINITY, |s| s.out_of_fold)
        };
        let itself = gain(&[g]);
        // what goes with the motion by a cause is no other form of it
        let moves = BY_MOTION.contains(&self.candidates[g].id());
        let descriptions = (0..self.candidates.len()).filter(|&c| {
            let candidate = self.candidates[c].as_ref();
            let seen = !self.fitted.groups[c].columns.is_empty();
            let open = is_a_description(candidate) && !(moves && is_of_motion(candidate));
            seen && open && !self.is_slight(chosen, c)
        });
        let mut better = descriptions.map(|c| (c, gain(&[c])));
        better.any(|(c, told)| {
            // that a line goes with the motion by chance is less likely than that it comes of it
            let by_chance =
                self.candidates[g].id() == LINE && is_of_motion(self.candidates[c].as_ref());
            let more = if by_chance { -DESCRIBED } else { DESCRIBED };
            told > itself + more && gain(&[c, g]) < told + DESCRIBED
        })
    }

    /// Whether a motion gains little beside `others`, under white noise and under the present one: not worth a climb.
    fn is_slight(&self, others: &[usize], g: usize) -> bool {
        let gain = |fitted: &Fitted| {
            let error = |set: &[usize]| fitted.fits.error(&columns_of(&fitted.groups, set));
            let (without, with) = (error(others)?, error(&[others, &[g]].concat())?);
            Some(fitted.nats(without, with))
        };
        let is_little = |fitted: &Fitted| gain(fitted).is_none_or(|nats| nats < LITTLE);
        is_of_motion(self.candidates[g].as_ref())
            && is_little(&self.plain)
            && is_little(self.fitted)
    }

    /// Standing of group `g` beside the others of `chosen`.
    pub(super) fn judge(&self, chosen: &[usize], g: usize, base: &Scored) -> Judgement {
        let group = &self.fitted.groups[g];
        if group.columns.is_empty() {
            return Judgement::UNSEEN;
        }
        let others = without(chosen, &[g]);
        if self.is_slight(&others, g) {
            return Judgement {
                p_value: 1.0,
                observable: true,
                ..Judgement::UNSEEN
            };
        }
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
        let chance = |columns: usize, ratio: f64| {
            self.beside_its_neighbours(g, columns, &with, ratio)
                .unwrap_or_else(|| self.chance(g, columns, ratio))
        };
        let across = || {
            let gain = |axis: usize| with.of_axis[axis] - without.of_axis[axis];
            chance(group.across, 2.0 * (gain(0) + gain(1)))
        };
        let mut p = or_across(chance(group.columns.len(), ratio), across, group.across).min(1.0);
        let alpha = if self.candidates[g].id() == EMPIRICAL {
            SEARCH_ALPHA
        } else {
            FAMILY_ALPHA
        };
        if p >= alpha && with.loglik() - without.loglik() > LITTLE {
            p = p.min(self.instead_of_slow(&others, &set, g, &without));
        }
        if p < alpha {
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

    /// Chance that so many `columns` of a line gain such a `ratio`, times what the search costs: held against what `with`
    /// leaves at the frequencies around it. `None` for what is no line, or too slow to have so many.
    fn beside_its_neighbours(
        &self,
        g: usize,
        columns: usize,
        with: &Scored,
        ratio: f64,
    ) -> Option<f64> {
        let candidate = self.candidates[g].as_ref();
        let frequency_hz = (candidate.id() == LINE).then(|| candidate.nonlinear()[0].value)?;
        let t_s = &self.data.bins.t_s;
        let around = line_level(t_s, &with.left, &self.data.count, &with.noise, frequency_hz)?;
        let k = columns as f64;
        let law = FisherSnedecor::new(k, around.freedom).ok()?;
        let p = beyond(&law, ratio.max(0.0) / k / around.level.max(1.0));
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
}
