//! Reference error: the reference wanders, common to all stars.
//!
//! ```text
//! per axis a stationary first-order Gauss-Markov process:  b[k+1] = e^(-T/tau) b[k] + n,
//! standard deviation sigma, one-sided PSD 4 tau sigma^2 / (1 + (2 pi f tau)^2)
//! ```
//!
//! It is an error of what the tracker is compared with, so it does not act on the tracker's measurement:
//! whoever simulates a reference adds it there ([`crate::Effect::reference_wander`]). It has no
//! regressors: coloured noise is judged by its spectrum.
//!
//! Source: \[M23\] Eq. 15-17 in the consistent one-sided convention (erratum E6).

use star_tracker::{Disturbance, Stages};

use crate::parameters::Reader;
use crate::{
    ActsOn, Effect, EffectError, EffectKind, Parameter, Parameters, ReferenceWander, Surroundings,
};

const ID: &str = "reference_error";
const NAMES: [[&str; 2]; 3] = [
    ["sigma_x_arcsec", "tau_x_s"],
    ["sigma_y_arcsec", "tau_y_s"],
    ["sigma_z_arcsec", "tau_z_s"],
];

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "the reference wanders: coloured noise common to all stars"
    }
    fn needs(&self) -> &'static str {
        "stars and a reference (of an attitude alone, its own slow error cannot be told from the reference's)"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            attitude: true,
            noise: true,
            ..ActsOn::default()
        }
    }
    fn build(
        &self,
        parameters: &Parameters,
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let known = NAMES.concat();
        let reader = Reader::new(ID, parameters, &known)?;
        if !NAMES.iter().any(|[sigma, _]| reader.has(sigma)) {
            return Err(EffectError::MissingParameter {
                effect: ID,
                name: NAMES[0][0],
            });
        }
        let mut wander = ReferenceWander {
            sigma_arcsec: [0.0; 3],
            tau_s: [1.0; 3],
        };
        for (axis, [sigma, tau]) in NAMES.into_iter().enumerate() {
            if !reader.has(sigma) && !reader.has(tau) {
                continue;
            }
            wander.sigma_arcsec[axis] = reader.within(sigma, [0.0, 1e6], "not negative")?;
            wander.tau_s[axis] = reader.within(tau, [1e-9, 1e12], "positive")?;
        }
        Ok(Box::new(ReferenceError { wander }))
    }
}

#[derive(Clone, Debug)]
struct ReferenceError {
    wander: ReferenceWander,
}

impl Disturbance for ReferenceError {
    fn stages(&self) -> Stages {
        Stages::NONE
    }
}

impl Effect for ReferenceError {
    fn id(&self) -> &'static str {
        ID
    }
    fn parameters(&self) -> Vec<Parameter> {
        let ReferenceWander {
            sigma_arcsec,
            tau_s,
        } = self.wander;
        let mut all = Vec::new();
        for (axis, [sigma, tau]) in NAMES.into_iter().enumerate() {
            if sigma_arcsec[axis] > 0.0 {
                all.push(Parameter::new(sigma, sigma_arcsec[axis], "arcsec"));
                all.push(Parameter::new(tau, tau_s[axis], "s"));
            }
        }
        all
    }
    fn reference_wander(&self) -> Option<ReferenceWander> {
        Some(self.wander)
    }
}
