//! The reference's slow error as a finding of its own.
//!
//! ```text
//! delta loglik   gain over a reference with white noise alone, less one nat a
//!                parameter: what the same noise would gain on other data (Akaike)
//! ```
//!
//! It lowers no residual: it says what part of the residual is not the tracker's.
//!
//! Source: Akaike 1974; effects.md of the design notes (`reference_error`).

use std::collections::BTreeMap;

use statrs::distribution::{ChiSquared, ContinuousCDF};
use telemetry::report::{Estimate, FoundEffect};
use telemetry::{EffectEntry, EffectValue};

use crate::star_search::{WIDENING, Wander};

/// Identity in the catalogue.
pub(crate) const REFERENCE_ERROR: &str = "reference_error";
const NAMES: [[&str; 2]; 3] = [
    ["sigma_x_arcsec", "tau_x_s"],
    ["sigma_y_arcsec", "tau_y_s"],
    ["sigma_z_arcsec", "tau_z_s"],
];

/// The effect, where at least one axis is beyond doubt.
pub(crate) fn effect(wander: &Wander) -> Option<(FoundEffect, EffectEntry)> {
    let axes: Vec<usize> = (0..3).filter(|&a| wander.axes()[a]).collect();
    if axes.is_empty() {
        return None;
    }
    let mut parameters = BTreeMap::new();
    let mut written = BTreeMap::new();
    for &axis in &axes {
        let slow = wander.noise.reference[axis];
        let sigma = wander.rotations.slow_sigma(&wander.noise, axis);
        let values = [(slow.slow, "arcsec"), (slow.tau_s, "s")];
        for (k, (value, unit)) in values.into_iter().enumerate() {
            let name = NAMES[axis][k].to_owned();
            written.insert(name.clone(), EffectValue::Number(value));
            let estimate = Estimate {
                value,
                sigma: sigma.map(|s| s[k] * value),
                unit: unit.to_owned(),
                interval: None,
            };
            parameters.insert(name, estimate);
        }
    }
    let ratio: f64 = axes.iter().map(|&a| wander.ratio[a]).sum();
    let freedom = 2.0 * axes.len() as f64;
    let p = ChiSquared::new(freedom).map_or(1.0, |law| law.sf(ratio / WIDENING));
    let found = FoundEffect {
        id: REFERENCE_ERROR.to_owned(),
        selectors: BTreeMap::new(),
        parameters,
        delta_loglik: 0.5 * ratio - freedom,
        // three axes were looked at
        p_value: (3.0 * p).min(1.0),
        variance_explained: None,
        confusable_with: Vec::new(),
    };
    Some((found, EffectEntry::new(REFERENCE_ERROR, written)))
}
