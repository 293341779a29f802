//! Rate noise: sigma grows with the star's rate across the detector.
//!
//! ```text
//! sigma'^2 = sigma^2 + (arcsec_per_deg_s rate)^2        per axis, rate in deg/s
//! ```
//!
//! It has no regressors: it moves no centroid.
//!
//! Source: \[M23\] Table 1 quotes the random error at 0.1 deg/s.

use star_tracker::{Disturbance, Stages, StarView};

use crate::parameters::Reader;
use crate::{ActsOn, Effect, EffectError, EffectKind, Parameter, Parameters, Surroundings};

const ID: &str = "rate_noise";

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "noise grows with the star's rate across the detector"
    }
    fn needs(&self) -> &'static str {
        "three or more stars in a frame, a rate that changes, and 500 rows"
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
        let reader = Reader::new(ID, parameters, &["arcsec_per_deg_s"])?;
        Ok(Box::new(RateNoise {
            arcsec_per_deg_s: reader.within("arcsec_per_deg_s", [0.0, 1e9], "not negative")?,
        }))
    }
}

#[derive(Clone, Debug)]
struct RateNoise {
    arcsec_per_deg_s: f64,
}

impl Disturbance for RateNoise {
    fn stages(&self) -> Stages {
        Stages {
            noise: true,
            ..Stages::NONE
        }
    }
    fn noise_sigma_arcsec(&self, _: &StarView, speed_arcsec_s: f64, sigma_arcsec: f64) -> f64 {
        sigma_arcsec.hypot(self.arcsec_per_deg_s * speed_arcsec_s / 3600.0)
    }
}

impl Effect for RateNoise {
    fn id(&self) -> &'static str {
        ID
    }
    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(
            "arcsec_per_deg_s",
            self.arcsec_per_deg_s,
            "arcsec/(deg/s)",
        )]
    }
}
