//! The list of effects.

use crate::parameters::nearest;
use crate::{Effect, EffectError, EffectKind, Parameters, Surroundings};

/// Every effect, in the order of the documentation.
pub fn catalogue() -> &'static [&'static dyn EffectKind] {
    &[]
}

/// The effect of that id.
///
/// # Errors
/// [`EffectError::UnknownEffect`] with the nearest id.
pub fn kind(id: &str) -> Result<&'static dyn EffectKind, EffectError> {
    catalogue().iter().copied().find(|kind| kind.id() == id).ok_or_else(|| EffectError::UnknownEffect {
        id: id.to_owned(),
        nearest: nearest(id, catalogue().iter().map(|kind| kind.id())).unwrap_or_default().to_owned(),
    })
}

/// The effect of that id with these parameters.
///
/// # Errors
/// An unknown id, or what [`EffectKind::build`] finds.
pub fn build(id: &str, parameters: &Parameters, surroundings: &Surroundings<'_>) -> Result<Box<dyn Effect>, EffectError> {
    kind(id)?.build(parameters, surroundings)
}
