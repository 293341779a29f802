//! A hypothesis held against the data at its own best noise.
//!
//! ```text
//! L(H) = max over noise, amplitudes of ln p(data | H)
//! worth = L - sum over effects ( ln cost + k/2 (1 + ln(q/k)) ) - sum over slow errors ( 4 )
//! ```
//!
//! (k parameters, q the square of the amplitudes over their errors: [`super`].)
//!
//! Source: Wilks 1938 (likelihood ratio); George & Foster 2000 (empirical Bayes selection).

use block_regression::{BlockGrams, Estimate, Fits, Folds, Layout};
use coloured_noise::{CommonNoise, Foreknown, Rotations, SlowGains};
use nalgebra::DMatrix;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::search::group::Group;
use crate::search::selection::{Judgement, WIDENING, columns_of};
use crate::star::moments::StarMoments;
use crate::star::slow_price::SlowPrice;

/// Rounds of generalised least squares and noise fit.
const ALTERNATIONS: usize = 2;
/// What slow errors pay beside that if they are not the same about X and Y, nats: every other one is so.
const APART: f64 = std::f64::consts::LN_2;

/// A hypothesis at its best noise.
#[derive(Clone, Debug)]
pub(super) struct Scored {
    pub(super) noise: CommonNoise,
    pub(super) rotations: Rotations,
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
pub(super) struct Trial<'a> {
    pub(super) moments: &'a StarMoments,
    pub(super) folds: &'a Folds,
    /// Of the nuisance.
    pub(super) precision: DMatrix<f64>,
    /// Of a scalar of white evidence.
    pub(super) variance: f64,
    /// What a slow error pays.
    pub(super) slow_price: SlowPrice,
    pub(super) groups: &'a [Group],
    /// What the p-value of each group is multiplied by.
    pub(super) cost: Vec<f64>,
    /// Fits of all groups: what their scatter says of the noise.
    pub(super) all: Option<&'a Fits>,
    /// Whether it scores a few hypotheses of few columns each: white sums of all columns are then not worth their while.
    pub(super) single: bool,
}

impl Trial<'_> {
    /// Nuisance, the columns of `chosen`, and the residual.
    pub(super) fn columns(&self, chosen: &[usize]) -> Vec<usize> {
        let n = self.precision.nrows();
        (0..n)
            .chain(columns_of(self.groups, chosen).into_iter().map(|c| n + c))
            .chain([self.moments.width() - 1])
            .collect()
    }

    fn layout(&self, columns: &[usize]) -> Layout {
        Layout {
            nuisance_precision: self.precision.clone(),
            // the attitudes are the reference's
            relative: 0..0,
            candidates: columns.len() - self.precision.nrows() - 1,
            residuals: 1,
        }
    }

    /// Noise of what is left once white evidence has fitted all of `columns`.
    pub(super) fn taken_out(&self, columns: &[usize]) -> Option<CommonNoise> {
        let grams = if self.single {
            self.moments.white_of(columns)
        } else {
            self.moments.white_in_all(columns)
        };
        Some(self.left(columns, &grams, self.variance)?.noise(None))
    }

    /// Rotations that the fit of `columns` by these sums leaves.
    fn left(&self, columns: &[usize], grams: &BlockGrams, variance: f64) -> Option<Rotations> {
        let layout = self.layout(columns);
        let fits = Fits::whole(grams, &layout, variance)?;
        let all: Vec<usize> = (0..layout.candidates).collect();
        let solution = fits.solution(&all)?;
        self.moments.rotations(columns, &solution, solution.len())
    }

    /// What is scored side by side has to find there.
    pub(super) fn sum_up(&self) {
        self.moments.sum_up(!self.single);
    }

    /// `chosen` at the better of two starts: all that fits taken out, or `noise`.
    pub(super) fn score(&self, chosen: &[usize], noise: &CommonNoise) -> Option<Scored> {
        let columns = self.columns(chosen);
        self.sum_up();
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
                Part {
                    credible: group.believes(&group.columns, &estimate, own.start),
                    columns: own,
                    shapes: group.shapes,
                    cost: self.cost[g],
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
    pub(super) fn climb(
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

    /// Noise of what the fit of `columns` leaves, near what is `known` of it before.
    pub(super) fn near(
        &self,
        columns: &[usize],
        known: &[Option<Foreknown>; 3],
    ) -> Option<CommonNoise> {
        let white = self.moments.white_of(columns);
        let mut noise = self.left(columns, &white, self.variance)?.noise_near(known);
        for _ in 0..ALTERNATIONS {
            let grams = self.moments.under(columns, &noise);
            let better = self.left(columns, &grams, 1.0)?.noise_near(known);
            let settled = better.is_like(&noise);
            noise = better;
            if settled {
                break;
            }
        }
        Some(noise)
    }

    /// Log-likelihood less what the freedom of a hypothesis buys where nothing acts:
    /// for amplitudes the evidence under the spread that suits them best, for a slow
    /// error of an axis its price, or its absence where that costs less.
    pub(super) fn worth(&self, scored: &Scored) -> f64 {
        self.worth_less(scored, self.paid_by_slow(&scored.rotations, &scored.noise))
    }

    /// The same without a slow error.
    pub(super) fn worth_of_white(&self, scored: &Scored) -> f64 {
        let slow = scored.rotations.slow_gains(&scored.noise);
        self.worth_less(scored, paid_by_slow(&slow, [f64::INFINITY; 3]))
    }

    /// What slow errors of this `noise` pay, nats.
    pub(super) fn paid_by_slow(&self, rotations: &Rotations, noise: &CommonNoise) -> f64 {
        let price = self.slow_price.of_axes(noise);
        paid_by_slow(&rotations.slow_gains(noise), price)
    }

    /// Log-likelihood less what the effects pay and so much.
    fn worth_less(&self, scored: &Scored, paid_by_slow: f64) -> f64 {
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
        scored.loglik - paid_by_slow - effects
    }

    /// What the candidate of `with` in place `at` adds to `without`.
    pub(super) fn judge(
        &self,
        with: &Scored,
        at: usize,
        without: &Scored,
        choices: usize,
    ) -> Judgement {
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

/// What is taken out of a choice for another hypothesis: nothing, then each of `some`, then all of them.
pub(super) fn taken_out_in_turn(some: Vec<usize>) -> Vec<Vec<usize>> {
    let mut out = vec![Vec::new()];
    out.extend(some.iter().map(|&g| vec![g]));
    if some.len() > 1 {
        out.push(some);
    }
    out
}

/// What slow errors pay of what they gain, each its `price`, or all of it where that costs less: none across the
/// boresight, one that is the same about X and Y, or one about each that has one; and that about Z.
fn paid_by_slow(slow: &SlowGains, price: [f64; 3]) -> f64 {
    let paid: [f64; 3] = std::array::from_fn(|axis| slow.axes[axis].min(price[axis]));
    let alike = slow.across - slow.alike + price[0].max(price[1]);
    let apart = paid[0] + paid[1] + APART;
    slow.across.min(alike.max(0.0)).min(apart) + paid[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::selection::SLOW_PRICE;

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
            paid_by_slow(&gains, [SLOW_PRICE; 3])
        };
        assert!((of([0.0, 18.6, 0.0], 18.6, 15.0) - 4.0 - APART).abs() < 1e-12);
        assert!((of([20.0, 25.0, 0.0], 45.0, 45.0) - 4.0).abs() < 1e-12);
        // no more than it gains, and the one about Z by itself
        assert!((of([0.0, 2.0, 30.0], 2.0, 1.0) - 6.0).abs() < 1e-12);
    }
}
