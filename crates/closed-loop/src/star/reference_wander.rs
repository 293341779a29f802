//! The reference's slow error as a finding of its own.
//!
//! ```text
//! delta loglik   gain over a reference with white noise alone, less one nat a
//!                parameter: what the same noise would gain on other data (Akaike)
//! ```
//!
//! It lowers no residual: it says what part of the residual is not the tracker's.
//!
//! White noise of the samples of a slow reference is carried between them, and so lasts for about a step h: of values
//! interpolated by straight lines
//!
//! ```text
//! rho(h/2) = 23/32    rho(h) = 1/4    as of exp(-t/tau) with tau = 1.5 h and 0.7 h
//! ```
//!
//! A slow error whose time may be as short as a step (the lower end of its interval) is noise like any other white
//! noise, and is not named.
//!
//! Source: Akaike 1974; docs/effects.md (`reference_error`).

use std::collections::BTreeMap;

use spectra::robust::median_step;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use telemetry::report::{ConsideredEffect, Estimate, FoundEffect};
use telemetry::{EffectEntry, EffectValue};

use crate::questions::hypothesis::SEEN;
use crate::search::selection::WIDENING;
use crate::star::data::StarData;
use crate::star::frame_rotation::rotation_of;
use crate::star::search::Wander;

/// Identity in the catalogue.
pub(crate) const REFERENCE_ERROR: &str = "reference_error";
const NAMES: [[&str; 2]; 3] = [
    ["sigma_x_arcsec", "tau_x_s"],
    ["sigma_y_arcsec", "tau_y_s"],
    ["sigma_z_arcsec", "tau_z_s"],
];

/// Correlation time for which a size that would have shown is given, s.
const TYPICAL_TAU_S: f64 = 20.0;

/// What this data would have shown of a wander that was not claimed: `left` is the residual, `excess`
/// its square beyond the noise. `None` without a reference, or with too few attitudes.
///
/// ```text
/// var(s^2) = w^4 (1 - r^2) / (N r^2)      r = exp(-dt/tau): information of the correlations alone
/// ```
pub(crate) fn consider(
    data: &StarData,
    left: &[Vec<f64>],
    excess: f64,
) -> Option<ConsideredEffect> {
    if data.free_attitude {
        return None;
    }
    let theta: Vec<f64> = (0..data.frames.frames())
        .filter_map(|frame| Some(rotation_of(data, frame, left)?.x))
        .collect();
    let step_s = median_step(&data.frames.t_s)?;
    let pairs = theta.len().checked_sub(1).filter(|n| *n > 1)?;
    let squares: f64 = theta.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    let white = squares / (2.0 * pairs as f64);
    let decay = (-step_s / TYPICAL_TAU_S).exp();
    // correlations below the rounding of what they are sums of are none
    let observable = decay * decay > f64::EPSILON;
    let sigma = white * ((1.0 - decay * decay) / (theta.len() as f64 * decay * decay)).sqrt();
    let rows = data.counted().max(1) as f64;
    Some(ConsideredEffect {
        selectors: BTreeMap::new(),
        against: None,
        id: REFERENCE_ERROR.to_owned(),
        delta_loglik: None,
        p_value: None,
        observable,
        detectable: observable.then(|| (SEEN * sigma).sqrt()),
        // about X and Y alike
        needed: (excess > 0.0).then(|| (0.5 * excess / rows).sqrt()),
        parameter: Some(NAMES[0][0].to_owned()),
        unit: Some("arcsec".to_owned()),
        refused: None,
    })
}

/// What an error that is beyond doubt about at least one axis comes to.
pub(crate) enum Finding {
    Named(Box<FoundEffect>, EffectEntry),
    /// What speaks against naming it.
    Against(&'static str),
}

/// What there is beyond doubt, beside a reference with samples `step_s` apart.
pub(crate) fn finding(wander: &Wander, step_s: f64) -> Option<Finding> {
    let claimed = wander.axes();
    let bounds_of = |axis: usize| wander.rotations.slow_bounds(&wander.noise, axis);
    let mut axes: Vec<_> = (0..3)
        .filter(|&axis| claimed[axis])
        .map(|axis| (axis, bounds_of(axis)))
        .collect();
    if axes.is_empty() {
        return None;
    }
    axes.retain(|(axis, bounds)| {
        let tau_s = wander.noise.reference[*axis].tau_s;
        bounds.map_or(tau_s, |b| b.tau_s.interval[0].min(tau_s)) > step_s
    });
    if axes.is_empty() {
        return Some(Finding::Against(
            "white noise of the reference's samples lasts as long as it does, from each to the next",
        ));
    }
    let mut parameters = BTreeMap::new();
    let mut written = BTreeMap::new();
    for &(axis, bounds) in &axes {
        let slow = wander.noise.reference[axis];
        let values = [
            (slow.slow, "arcsec", bounds.map(|b| b.slow)),
            (slow.tau_s, "s", bounds.map(|b| b.tau_s)),
        ];
        for (k, (likeliest, unit, bounds)) in values.into_iter().enumerate() {
            let value = bounds.map_or(likeliest, |b| b.middle);
            let name = NAMES[axis][k].to_owned();
            written.insert(name.clone(), EffectValue::Number(value));
            let estimate = Estimate {
                value,
                sigma: bounds.map(|b| b.sigma()),
                unit: unit.to_owned(),
                interval: bounds.map(|b| b.interval),
            };
            parameters.insert(name, estimate);
        }
    }
    let ratio: f64 = axes.iter().map(|(axis, _)| wander.ratio[*axis]).sum();
    let freedom = 2.0 * axes.len() as f64;
    let p = ChiSquared::new(freedom).map_or(1.0, |law| law.sf(ratio / WIDENING));
    let found = FoundEffect {
        id: REFERENCE_ERROR.to_owned(),
        selectors: BTreeMap::new(),
        parameters,
        delta_loglik: 0.5 * ratio - freedom,
        // three axes were looked at
        p_value: (3.0 * p).min(wander.p_value()),
        variance_explained: None,
        confusable_with: Vec::new(),
    };
    let entry = EffectEntry::new(REFERENCE_ERROR, written);
    Some(Finding::Named(Box::new(found), entry))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::star::harness::at_rest;

    /// Frames that are hours apart have no correlations left of a minute's error.
    #[test]
    fn frames_far_apart_show_no_slow_error() {
        let shown = |step_s: f64| {
            let data = at_rest((0..60).map(|k| step_s * f64::from(k)).collect());
            let row = |r: usize| [1.0, -1.0][(r / 6 + r % 6) % 2];
            let left = vec![(0..data.t_s.len()).map(row).collect::<Vec<f64>>(); 2];
            let shown = consider(&data, &left, 1.0).unwrap();
            (shown.observable, shown.detectable)
        };
        assert!(matches!(shown(0.5), (true, Some(size)) if size.is_finite()));
        assert_eq!(shown(7200.0), (false, None));
    }
}
