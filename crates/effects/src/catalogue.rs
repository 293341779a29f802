//! The list of effects.
//!
//! Not physics: a list.

use crate::parameters::nearest;
use crate::{
    Effect, EffectError, EffectKind, Parameters, Surroundings, catalogue_position, chromatic_shift,
    empirical, exposure_smear, focal_length_drift, hot_pixel, image_effects, magnitude_noise,
    optical_distortion, outliers, periodic_misalignment, pixel_phase_harmonics, rate_noise,
    reference_error, rolling_shutter, step_misalignment, thermal_misalignment, time_tag_offset,
    velocity_aberration,
};

static CATALOGUE: [&dyn EffectKind; 19] = [
    &thermal_misalignment::Kind,
    &step_misalignment::Kind,
    &periodic_misalignment::Kind,
    &time_tag_offset::Kind,
    &rolling_shutter::Kind,
    &exposure_smear::Kind,
    &velocity_aberration::Kind,
    &focal_length_drift::Kind,
    &chromatic_shift::Kind,
    &pixel_phase_harmonics::Kind,
    &image_effects::DARK_MAP,
    &image_effects::EFFECTIVE_PSF,
    &hot_pixel::Kind,
    &catalogue_position::Kind,
    &optical_distortion::Kind,
    &magnitude_noise::Kind,
    &rate_noise::Kind,
    &reference_error::Kind,
    &outliers::Kind,
];

/// Every effect, in the order of the documentation.
pub fn catalogue() -> &'static [&'static dyn EffectKind] {
    &CATALOGUE
}

/// The kind of that id; beside those of the catalogue there is `empirical`, a term without a cause that
/// a model may declare.
///
/// # Errors
/// [`EffectError::UnknownEffect`] with the nearest id.
pub fn kind(id: &str) -> Result<&'static dyn EffectKind, EffectError> {
    catalogue()
        .iter()
        .copied()
        .chain([&empirical::Kind as &'static dyn EffectKind])
        .find(|kind| kind.id() == id)
        .ok_or_else(|| EffectError::UnknownEffect {
            id: id.to_owned(),
            nearest: nearest(id, catalogue().iter().map(|kind| kind.id()))
                .unwrap_or_default()
                .to_owned(),
        })
}

/// The effect of that id with these parameters.
///
/// # Errors
/// An unknown id, or what [`EffectKind::build`] finds.
///
/// ```
/// use std::collections::BTreeMap;
/// use effects::{EffectError, Parameters, Surroundings, build};
/// use focal_plane::Camera;
///
/// let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0])?;
/// let channels = BTreeMap::new();
/// let surroundings =
///     Surroundings { camera: &camera, span_s: [0.0, 60.0], channels: &channels, frames: None };
/// let given = Parameters::from([("line_time_s".to_owned(), 30e-6.into())]);
/// let shutter = build("rolling_shutter", &given, &surroundings)?;
/// assert_eq!(shutter.parameters()[0].value, 30e-6);
///
/// let typo = build("roling_shutter", &given, &surroundings).unwrap_err();
/// assert!(typo.to_string().contains("rolling_shutter"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn build(
    id: &str,
    parameters: &Parameters,
    surroundings: &Surroundings<'_>,
) -> Result<Box<dyn Effect>, EffectError> {
    kind(id)?.build(parameters, surroundings)
}
