//! The declared model's own parts: centroid error and declared effects.
//!
//! Source: [M23] Eq. 10 for the triangle; effects as their files have them.

use std::sync::Arc;

use centroid::{CentroidError, Triangle};
use effects::{Effect, ParameterValue, Parameters};
use telemetry::{EffectValue, Model};

use crate::error::CloseError;
use crate::situation::Situation;

/// The declared centroid error, arcsec: the triangle of [M23] Eq. 10, its peak as printed.
pub(crate) fn centroid_error(model: &Model) -> CentroidError {
    match model.noise.centroid_arcsec {
        Some(peak) if peak > 0.0 => CentroidError::Triangle(Triangle::from_peak(peak)),
        _ => CentroidError::None,
    }
}

/// The effects that the model declares, built for this data. Those that act on
/// raw images are not among them: they act where centroids are formed.
pub(crate) fn effects(situation: &Situation<'_>) -> Result<Vec<Arc<dyn Effect>>, CloseError> {
    let surroundings = situation.surroundings();
    let mut built = Vec::new();
    for entry in &situation.model.effects {
        let acts = effects::kind(&entry.id)?.acts_on();
        if acts.images {
            continue;
        }
        let mut parameters = Parameters::new();
        for (name, value) in &entry.parameters {
            let value = match value {
                EffectValue::Number(number) => ParameterValue::Number(*number),
                EffectValue::Text(text) => ParameterValue::Text(text.clone()),
                EffectValue::Numbers(numbers) => ParameterValue::Text(
                    numbers
                        .iter()
                        .map(f64::to_string)
                        .collect::<Vec<_>>()
                        .join(","),
                ),
            };
            parameters.insert(name.clone(), value);
        }
        built.push(effects::build(&entry.id, &parameters, &surroundings)?.into());
    }
    Ok(built)
}

/// Refuses a declared effect on raw images where these are there: to go on as if it were not declared
/// would be wrong. Without images centroids stand as they are, and there is nothing to take it off from.
pub(crate) fn refuse_on_images(situation: &Situation<'_>) -> Result<(), CloseError> {
    if situation.bundle.images.is_none() || situation.bundle.stars.is_none() {
        return Ok(());
    }
    for entry in &situation.model.effects {
        if effects::kind(&entry.id)?.acts_on().images {
            let id = entry.id.clone();
            return Err(CloseError::DeclaredOnImages { id });
        }
    }
    Ok(())
}
