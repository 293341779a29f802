//! The declared model's own parts: what it does to centroids, and declared effects.
//!
//! What acts on a centroid acts where the light falls, distortion and all; where that is known to a variance v only,
//! as its mean over it. Of effects that is the five-point rule of Gauss and Hermite, along the diagonal: x and y have
//! errors of their own, and an effect on x hardly asks for y.
//!
//! ```text
//! c(P) -> sum_j w_j c(P + z_j sqrt(v))      exp(-2 pi^2 k^2 v) of a wave, to 1 % of it for k sqrt(v) < 0.3
//! ```
//!
//! Source: [M23] Eq. 10 for the triangle, Fig. 4 for where it acts; effects as their files have them.

use std::sync::Arc;

use centroid::{CentroidError, GAUSS_HERMITE_5, Triangle};
use coloured_noise::Foreknown;
use effects::{Effect, EffectError, ParameterValue, Parameters};
use focal_plane::Pixel;
use star_tracker::StarView;
use telemetry::{EffectValue, Model};

use crate::error::CloseError;
use crate::situation::Situation;

/// A position that is known to less than this is known, px.
const KNOWN_PX: f64 = 1e-3;

/// What the declared model does to a centroid where the light falls.
#[derive(Clone, Debug, Default)]
pub(crate) struct OnCentroids {
    /// The declared centroid error, arcsec.
    pub(crate) error: CentroidError,
    /// Those of the declared effects that act on centroids.
    effects: Vec<Arc<dyn Effect>>,
}

impl OnCentroids {
    pub(crate) fn of(situation: &Situation<'_>) -> Result<Self, CloseError> {
        let mut effects = effects(situation)?;
        effects.retain(|e| e.stages().centroid);
        Ok(Self {
            effects,
            ..Self::from(situation.model)
        })
    }

    /// Whether any effect is among them.
    pub(crate) fn has_effects(&self) -> bool {
        !self.effects.is_empty()
    }

    /// What the effects shift a centroid by, px, where the light falls `at` a place known to `variance_px2`.
    pub(crate) fn effects_px(&self, star: &StarView, variance_px2: [f64; 2]) -> [f64; 2] {
        let shift = |star: &StarView| {
            let each = self.effects.iter().map(|e| e.centroid_shift_px(star));
            each.fold([0.0; 2], |[x, y], [dx, dy]| [x + dx, y + dy])
        };
        let sigma = variance_px2.map(f64::sqrt);
        if sigma.iter().all(|s| *s < KNOWN_PX) {
            return shift(star);
        }
        let (mut x, mut y) = (0.0, 0.0);
        for (z, weight) in GAUSS_HERMITE_5 {
            let at = Pixel {
                x: star.at.x + z * sigma[0],
                y: star.at.y + z * sigma[1],
            };
            let [dx, dy] = shift(&StarView { at, ..*star });
            (x, y) = (x + weight * dx, y + weight * dy);
        }
        [x, y]
    }
}

impl From<&Model> for OnCentroids {
    /// Without the effects.
    fn from(model: &Model) -> Self {
        Self {
            error: centroid_error(model),
            effects: Vec::new(),
        }
    }
}

/// The declared centroid error, arcsec: the triangle of [M23] Eq. 10, its peak as printed.
fn centroid_error(model: &Model) -> CentroidError {
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
    for (index, entry) in situation.model.effects.iter().enumerate() {
        let wrong = |error| in_line(situation.model, index, error);
        let acts = effects::kind(&entry.id).map_err(wrong)?.acts_on();
        if acts.images {
            continue;
        }
        let mut parameters = Parameters::new();
        for (name, value) in &entry.parameters {
            let value = match value {
                EffectValue::Number(number) => ParameterValue::Number(*number),
                EffectValue::Text(text) => ParameterValue::Text(text.clone()),
                EffectValue::Numbers(numbers) => ParameterValue::list(numbers),
            };
            parameters.insert(name.clone(), value);
        }
        let effect = effects::build(&entry.id, &parameters, &surroundings);
        built.push(effect.map_err(wrong)?.into());
    }
    Ok(built)
}

/// What these effects tell of the reference's slow error, axis by axis.
pub(crate) fn reference(effects: &[Arc<dyn Effect>]) -> [Option<Foreknown>; 3] {
    let mut known: [Option<Foreknown>; 3] = [None; 3];
    for wander in effects.iter().filter_map(|e| e.reference_wander()) {
        for (axis, known) in known.iter_mut().enumerate() {
            let (slow, tau_s) = (wander.sigma_arcsec[axis], wander.tau_s[axis]);
            if slow > known.map_or(0.0, |k| k.slow) {
                *known = Some(Foreknown { slow, tau_s });
            }
        }
    }
    known
}

/// An error of a declared effect, in its line where the model came from a file.
fn in_line(model: &Model, index: usize, error: EffectError) -> CloseError {
    let located = model.effect_error_in_line(index, error.key(), &error.to_string());
    located.map_or_else(|| error.into(), Into::into)
}

/// Refuses a declared effect on raw images where these are there: to go on as if it were not declared
/// would be wrong. Without images centroids stand as they are, and there is nothing to take it off from.
pub(crate) fn refuse_on_images(situation: &Situation<'_>) -> Result<(), CloseError> {
    if situation.bundle.images.is_none() || situation.bundle.stars.is_none() {
        return Ok(());
    }
    for (index, entry) in situation.model.effects.iter().enumerate() {
        let kind = effects::kind(&entry.id);
        let kind = kind.map_err(|error| in_line(situation.model, index, error))?;
        if kind.acts_on().images {
            let id = entry.id.clone();
            return Err(CloseError::DeclaredOnImages { id });
        }
    }
    Ok(())
}
