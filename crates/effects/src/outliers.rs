//! Outliers: spikes of single rows, from particle hits or mixed-up stars.
//!
//! ```text
//! with probability rate:  dP = size (r cos a, r sin a),  a uniform, r^2/2 ~ Exp(1)
//! ```
//!
//! that is, normal with standard deviation `size_arcsec` on each axis (Box-Muller), independent between
//! rows. It has no regressors: robust estimation deals with it.
//!
//! Source: Box & Muller, Annals of Mathematical Statistics 29 (1958) 610; the mixture is Tukey's
//! contaminated normal.

use core::f64::consts::TAU;

use star_tracker::{Disturbance, Stages, StarView};

use crate::parameters::Reader;
use crate::{ActsOn, Effect, EffectError, EffectKind, Parameter, Parameters, Surroundings};

const ID: &str = "outliers";

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "spikes of single rows: particle hits, star mix-ups"
    }
    fn needs(&self) -> &'static str {
        "three or more stars in a frame, and 500 rows"
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
        surroundings: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let reader = Reader::new(ID, parameters, &["rate", "size_arcsec"])?;
        Ok(Box::new(Outliers {
            rate: reader.within("rate", [0.0, 1.0], "a share of rows between 0 and 1")?,
            size_arcsec: reader.within("size_arcsec", [0.0, 1e6], "not negative")?,
            arcsec_per_px: surroundings.camera.arcsec_per_px(),
        }))
    }
}

#[derive(Clone, Debug)]
struct Outliers {
    rate: f64,
    size_arcsec: f64,
    arcsec_per_px: [f64; 2],
}

impl Disturbance for Outliers {
    fn stages(&self) -> Stages {
        Stages {
            spike: true,
            ..Stages::NONE
        }
    }
    fn spike_px(&self, _: &StarView, uniform: &mut dyn FnMut() -> f64) -> [f64; 2] {
        // always three numbers, so that the rate does not shift the stream of later rows
        let (hit, length, angle) = (uniform(), uniform(), uniform());
        if hit >= self.rate {
            return [0.0; 2];
        }
        // 1 - u is in (0, 1]: its logarithm is finite
        let radius = self.size_arcsec * (-2.0 * (-length).ln_1p()).sqrt();
        let (sin, cos) = (TAU * angle).sin_cos();
        [
            radius * cos / self.arcsec_per_px[0],
            radius * sin / self.arcsec_per_px[1],
        ]
    }
}

impl Effect for Outliers {
    fn id(&self) -> &'static str {
        ID
    }
    fn parameters(&self) -> Vec<Parameter> {
        vec![
            Parameter::new("rate", self.rate, ""),
            Parameter::new("size_arcsec", self.size_arcsec, "arcsec"),
        ]
    }
}
