//! The other orbit that explains the same: what is not known of which it is.
//!
//! Of a velocity along the boresight the stars tell little: it stretches the field. Without it an orbit and its mirror
//! image behind the focal plane turn a camera that looks one way alike, and of less than a turn others do. Each has an
//! error by itself, and lies many of these from the other. So errors are those about the orbit that is told,
//!
//! ```text
//! sigma^2 = (1 - w) s1^2 + w (s2^2 + (p2 - p1)^2)        w = L2 / (L1 + L2)
//! ```
//!
//! with the parameters p, errors s and likelihoods L of the one that is told, 1, and of the other.
//!
//! Source: the mean square of a mixture of two.

use std::sync::Arc;

use block_regression::Folds;
use effects::{Candidate, Parameter, Surroundings, free_orbit, nearest_circles};
use telemetry::report::FoundEffect;

use super::{ABERRATION, period_s, velocities};
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::findings::amplitudes_from;
use crate::search::selection::columns_of;
use crate::search::{Found, fit, without};

/// Fits about a circle.
const ROUNDS: usize = 6;

/// Widens the errors of an orbit among the effects of the selection, in its order.
pub(crate) fn complete(
    evidence: &dyn Evidence,
    folds: &Folds,
    found: &Found,
    surroundings: &Surroundings<'_>,
    effects: &mut [FoundEffect],
) -> Result<(), CloseError> {
    let chosen = &found.selection.chosen;
    let orbit = |g: usize| {
        let own = found.candidates[g].id() == ABERRATION;
        own && found.fitted.groups[g].slopes > 0
    };
    for (effect, &g) in effects.iter_mut().zip(chosen) {
        if !orbit(g) {
            continue;
        }
        let rest = without(chosen, &[g]);
        let rest = rest.iter().map(|&other| found.candidates[other].as_ref());
        let among = Among {
            evidence,
            folds,
            surroundings,
            rest: rest.collect(),
        };
        let told = Arc::clone(&found.candidates[g]);
        if let Some(period_s) = period_s(told.as_ref(), surroundings)
            && let Some(told) = among.at_its_best(told, 1)?
            && let Some(other) = among.other_than(&told, period_s)?
        {
            mix(effect, &told, &other);
        }
    }
    Ok(())
}

/// An orbit fitted beside all else.
struct Fit {
    parameters: Vec<(Parameter, f64)>,
    /// Nats, but for a constant.
    loglik: f64,
}

/// What an orbit is fitted beside.
struct Among<'a> {
    evidence: &'a dyn Evidence,
    folds: &'a Folds,
    surroundings: &'a Surroundings<'a>,
    rest: Vec<&'a dyn Candidate>,
}

impl Among<'_> {
    /// Of the circles near to any velocity of this period the one farther from `told`, at its best.
    fn other_than(&self, told: &Fit, period_s: f64) -> Result<Option<Fit>, CloseError> {
        let span_s = self.surroundings.span_s;
        let free = free_orbit(period_s, span_s);
        let mut all = vec![free.as_ref()];
        all.extend(&self.rest);
        let fitted = fit(self.evidence, self.folds, &all)?;
        let every: Vec<usize> = (0..all.len()).collect();
        let Some((values, information)) = velocities(&fitted, 0, &every) else {
            return Ok(None);
        };
        let mut farther: Option<(f64, Fit)> = None;
        for (_, circle) in nearest_circles(period_s, span_s, &values, &information, 1) {
            let Some(other) = self.at_its_best(circle.into(), ROUNDS)? else {
                continue;
            };
            let far = far_from(told, &other);
            if farther.as_ref().is_none_or(|(known, _)| far > *known) {
                farther = Some((far, other));
            }
        }
        Ok(farther.map(|(_, other)| other))
    }

    /// `orbit` after fits about itself.
    fn at_its_best(
        &self,
        mut orbit: Arc<dyn Candidate>,
        rounds: usize,
    ) -> Result<Option<Fit>, CloseError> {
        let mut best = None;
        for _ in 0..rounds {
            let mut all: Vec<&dyn Candidate> = vec![orbit.as_ref()];
            all.extend(&self.rest);
            let fitted = fit(self.evidence, self.folds, &all)?;
            let every: Vec<usize> = (0..all.len()).collect();
            let set = columns_of(&fitted.groups, &every);
            let (Some(estimate), Some(error)) =
                (fitted.fits.estimate(&set), fitted.fits.error(&set))
            else {
                break;
            };
            let count = orbit.coefficients().len();
            let (values, covariance) = amplitudes_from(0, count, &set, &estimate);
            let candidate = orbit.as_ref();
            let parameters =
                effects::reported(candidate, &values, covariance.as_view(), self.surroundings)?;
            let loglik = fitted.nats(1.0, error);
            best = Some(Fit { parameters, loglik });
            let Some(better) = orbit.refined(&values) else {
                break;
            };
            orbit = better.into();
        }
        Ok(best)
    }
}

/// Errors of the parameters of `effect`, `told`, where it might be the other.
fn mix(effect: &mut FoundEffect, told: &Fit, other: &Fit) {
    let share = 1.0 / (1.0 + (told.loglik - other.loglik).exp());
    for (one, two) in told.parameters.iter().zip(&other.parameters) {
        let Some(sigma) = effect
            .parameters
            .get_mut(&one.0.name)
            .and_then(|told| told.sigma.as_mut())
        else {
            continue;
        };
        let beyond = two.1.powi(2) + apart(one, two).powi(2);
        let both = (1.0 - share) * sigma.powi(2) + share * beyond;
        // what the other tells better makes this one no better known
        *sigma = both.sqrt().max(*sigma);
    }
}

/// From one parameter to the same of another orbit.
fn apart(one: &(Parameter, f64), two: &(Parameter, f64)) -> f64 {
    one.0.shorter(two.0.value - one.0.value)
}

/// How far the other is, in the errors that each has by itself.
fn far_from(told: &Fit, other: &Fit) -> f64 {
    let pairs = told.parameters.iter().zip(&other.parameters);
    let squares = pairs.map(|(one, two)| {
        let noise = one.1.powi(2) + two.1.powi(2);
        apart(one, two).powi(2) / noise.max(f64::MIN_POSITIVE)
    });
    squares.sum()
}

#[cfg(test)]
mod tests {
    use telemetry::report::Estimate;

    use super::*;

    fn fit(node_deg: f64, loglik: f64) -> Fit {
        Fit {
            parameters: vec![(Parameter::new("node_deg", node_deg, "deg"), 3.0)],
            loglik,
        }
    }

    fn told(sigma: f64) -> FoundEffect {
        let estimate = Estimate {
            value: 350.0,
            sigma: Some(sigma),
            unit: "deg".to_owned(),
            interval: None,
        };
        FoundEffect {
            id: ABERRATION.to_owned(),
            selectors: [].into(),
            parameters: [("node_deg".to_owned(), estimate)].into(),
            delta_loglik: 100.0,
            p_value: 1e-20,
            variance_explained: None,
            confusable_with: Vec::new(),
        }
    }

    fn widened(other: &Fit) -> f64 {
        let mut effect = told(3.0);
        mix(&mut effect, &fit(350.0, -200.0), other);
        effect.parameters["node_deg"].sigma.unwrap()
    }

    /// From 350 to 50 deg it is 60, not 300. Of two alike each is right in half of the cases: sqrt(9 + 60^2/2).
    #[test]
    fn of_two_alike_the_error_is_that_of_not_knowing_which() {
        let sigma = widened(&fit(50.0, -200.0));
        assert!((sigma - (9.0_f64 + 1800.0).sqrt()).abs() < 1e-9, "{sigma}");
        // ten nats behind it is one in 22000, and itself it is no other
        let far = 3600.0 / (1.0 + 10.0_f64.exp());
        let sigma = widened(&fit(50.0, -210.0));
        assert!((sigma - (9.0 + far).sqrt()).abs() < 1e-9, "{sigma}");
        let sigma = widened(&fit(350.0, -200.0));
        assert!((sigma - 3.0).abs() < 1e-9, "{sigma}");
    }
}
