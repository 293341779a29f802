//! The tracker that a model declares, one draw of it.
//!
//! ```text
//! kind "pbm"   distortion (drawn), triangle, temporal noise      [M23] Fig. 4
//! kind "hem"   distortion (drawn), a process about each axis     [M23] Fig. 5
//! ```
//!
//! The processes of a hybrid model stand for triangle and temporal noise: it has neither.
//!
//! Source: [M23] Sections 2.6 and 3.2.

use std::sync::Arc;

use centroid::{CentroidError, Triangle};
use distortion::{DistortionField, LsfSigma};
use effects::{ParameterValue, Parameters};
use focal_plane::{Angle, Camera};
use fogm_fit::{Fogm, FogmWhite};
use star_tracker::{Disturbance, Hem, Pbm, Purpose, TemporalNoise, stream};
use telemetry::{EffectEntry, EffectValue, HemAxis, Model, ModelKind};

use crate::ScenarioError;

/// Order of the distortion polynomials where the model does not say: `[M23]` Section 4.2.
const DISTORTION_ORDER: u32 = 7;

/// A model, ready to be flown.
#[derive(Clone, Debug)]
pub struct Declared {
    /// The tracker; of a hybrid model the part that follows the stars.
    pub pbm: Pbm,
    /// The hybrid model, where the model is of that kind.
    pub hem: Option<Hem>,
}

impl Declared {
    /// The tracker of `model` with the distortion of this draw, and with `disturbances` acting in it.
    /// What the model says of a constant misalignment is left to the caller.
    ///
    /// # Errors
    /// A number of the model outside its range, or a hybrid model without its processes.
    pub fn draw(
        model: &Model,
        camera: &Camera,
        disturbances: &[Arc<dyn Disturbance>],
        seed: u64,
        draw: u64,
    ) -> Result<Self, ScenarioError> {
        let noise = &model.noise;
        let mut pbm = Pbm::new(camera.clone());
        if model.kind == ModelKind::Pbm {
            if let Some(sigma_arcsec) = noise.temporal_arcsec {
                pbm = pbm.with_noise(TemporalNoise::circular_arcsec(sigma_arcsec)?);
            }
            if let Some(peak_arcsec) = noise.centroid_arcsec {
                let triangle = Triangle::from_peak(peak_arcsec);
                pbm = pbm.with_centroid_error(CentroidError::Triangle(triangle));
            }
        }
        if let Some(sigma_arcsec) = noise.distortion_arcsec {
            let order = noise.distortion_order.unwrap_or(DISTORTION_ORDER) as usize;
            let sigma = LsfSigma::Circular(Angle::from_arcsec(sigma_arcsec));
            let mut rng = stream(seed, draw, Purpose::Distortion);
            pbm = pbm.with_distortion(DistortionField::draw(order, sigma, &mut rng)?);
        }
        for disturbance in disturbances {
            pbm = pbm.with_disturbance(disturbance.clone());
        }
        let hem = match model.kind {
            ModelKind::Pbm => None,
            ModelKind::Hem => Some(hybrid(model, &pbm)?),
        };
        Ok(Self { pbm, hem })
    }
}

/// The processes about x, y, z of a hybrid model, arcsec.
///
/// # Errors
/// A model without them, or a number outside its range.
pub fn hybrid_processes(model: &Model) -> Result<[FogmWhite; 3], ScenarioError> {
    let axes = model.hem.as_ref().ok_or(ScenarioError::Missing {
        name: "[hem.x], [hem.y] and [hem.z] where kind = \"hem\"",
    })?;
    let process = |axis: &HemAxis| -> Result<FogmWhite, ScenarioError> {
        let fogm = Fogm::new(axis.sigma_hsf_arcsec, axis.tau_hsf_s)?;
        Ok(FogmWhite::new(fogm, axis.sigma_tn_arcsec)?)
    };
    Ok([process(&axes.x)?, process(&axes.y)?, process(&axes.z)?])
}

/// The hybrid model over the optics of `pbm`.
fn hybrid(model: &Model, pbm: &Pbm) -> Result<Hem, ScenarioError> {
    let mut hem = Hem::new(pbm.camera().clone(), hybrid_processes(model)?);
    if model
        .noise
        .distortion_arcsec
        .is_some_and(|sigma| sigma > 0.0)
    {
        hem = hem.with_distortion(pbm.distortion().clone());
    }
    for disturbance in pbm.disturbances() {
        hem = hem.with_disturbance(disturbance.clone());
    }
    Ok(hem)
}

/// What an `[[effect]]` of a model gives the effect to be built with.
pub fn effect_parameters(entry: &EffectEntry) -> Parameters {
    let value = |(name, value): (&String, &EffectValue)| {
        let value = match value {
            EffectValue::Number(number) => ParameterValue::Number(*number),
            EffectValue::Text(text) => ParameterValue::Text(text.clone()),
            EffectValue::Numbers(numbers) => ParameterValue::list(numbers),
        };
        (name.clone(), value)
    };
    entry.parameters.iter().map(value).collect()
}
