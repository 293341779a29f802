//! Magnitude noise: faint stars are noisier than declared.
//!
//! ```text
//! sigma' = sigma 10^(0.2 slope (m - 5))        per axis; slope 1: photons, 2: background
//! ```
//!
//! A star of unknown magnitude keeps its sigma. It has no regressors: it moves no centroid.
//!
//! Source: photon statistics, flux falls by 10^-0.4 per magnitude.

use star_tracker::{Disturbance, Stages, StarView};

use crate::parameters::Reader;
use crate::{ActsOn, Effect, EffectError, EffectKind, Parameter, Parameters, Surroundings};

const ID: &str = "magnitude_noise";
const REFERENCE_MAG: f64 = 5.0;

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "noise grows with magnitude as 10^(0.2 slope (m - 5))"
    }
    fn needs(&self) -> &'static str {
        "at least four stars of different magnitudes, three or more in a frame, and 500 rows"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            noise: true,
            ..ActsOn::default()
        }
    }
    fn build(
        &self,
        parameters: &Parameters,
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let reader = Reader::new(ID, parameters, &["slope"])?;
        Ok(Box::new(MagnitudeNoise {
            slope: reader.within("slope", [-10.0, 10.0], "between -10 and 10")?,
        }))
    }
}

#[derive(Clone, Debug)]
struct MagnitudeNoise {
    slope: f64,
}

impl Disturbance for MagnitudeNoise {
    fn stages(&self) -> Stages {
        Stages {
            noise: true,
            ..Stages::NONE
        }
    }
    fn noise_sigma_arcsec(&self, star: &StarView, _: f64, sigma_arcsec: f64) -> f64 {
        if star.mag.is_finite() {
            sigma_arcsec * 10_f64.powf(0.2 * self.slope * (star.mag - REFERENCE_MAG))
        } else {
            sigma_arcsec
        }
    }
}

impl Effect for MagnitudeNoise {
    fn id(&self) -> &'static str {
        ID
    }
    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new("slope", self.slope, "")]
    }
}
