//! Exposure smear: the centroid is that of the path averaged over the exposure.
//!
//! ```text
//! forward     P = (1/T) int_{-T/2}^{T/2} P(t + s) ds           8-point Gauss-Legendre
//! stars       dP = T^2 column,   column = (mean of P(t + s) - P(t)) / T0^2 ~ a / 24
//! attitude    theta = T^2 column, the same mean of log( q(t + s) q(t)^-1 )
//! ```
//!
//! Odd orders of s cancel because the exposure is centred on t: at constant image velocity nothing
//! moves, and the leading term is the acceleration of the image, largest where the motion reverses
//! (the turn-around error of \[M23\] Section 4.2.1). The shift grows with T squared, so T^2 is the
//! coefficient that is fitted (it cannot be negative) and `exposure_s`, its root, is what is reported.
//! T0 is the exposure about which the columns are taken: where the motion turns within the exposure
//! the leading term is not enough, and the estimate is re-linearised about itself.
//!
//! Source: \[M23\] Section 4.2.1 names the effect; the series is that of the mean of a path.

use focal_plane::{Camera, PointsMut, VectorsMut};
use star_tracker::{Disturbance, GAUSS_LEGENDRE_8, Stages};

use crate::candidate::check_columns;
use crate::parameters::Reader;
use crate::path::{Path, mean_turn};
use crate::{
    ActsOn, AttitudeRows, Candidate, Coefficient, Effect, EffectError, EffectKind, Parameter,
    Parameters, Scene, StarRows, Surroundings,
};

const ID: &str = "exposure_smear";

/// Exposure about which the columns are first taken, when none is declared, s.
const TYPICAL_S: f64 = 0.1;
/// Longest exposure of frames that are close to each other, s.
const LONGEST_S: f64 = 2.0;

/// Longest exposure that a tracker may have: 2 s, the time between its frames, where it has several, or what is
/// declared, s.
pub fn longest_exposure_s(between_s: Option<f64>, declared_s: Option<f64>) -> f64 {
    let told = between_s.into_iter().chain(declared_s);
    told.fold(LONGEST_S, f64::max)
}

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "the centroid is averaged over an exposure of exposure_s, centred on t"
    }
    fn needs(&self) -> &'static str {
        "stars, or an attitude with a reference, and a motion that the samples resolve"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            stars: true,
            ..ActsOn::default()
        }
    }
    fn build(
        &self,
        parameters: &Parameters,
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let reader = Reader::new(ID, parameters, &["exposure_s"])?;
        let exposure_s = reader.within("exposure_s", [0.0, 1e4], "between 0 and 10000 s")?;
        Ok(Box::new(ExposureSmear { exposure_s }))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        if !(scene.has_stars || scene.has_attitude && scene.has_reference) {
            return Vec::new();
        }
        let about_s = scene.exposure_s.unwrap_or(TYPICAL_S);
        let longest_s = longest_exposure_s(scene.between_s(), scene.exposure_s);
        vec![Box::new(SmearCandidate::about(about_s, longest_s))]
    }
}

#[derive(Clone, Debug)]
struct ExposureSmear {
    exposure_s: f64,
}

impl Disturbance for ExposureSmear {
    fn stages(&self) -> Stages {
        Stages {
            exposure: true,
            ..Stages::NONE
        }
    }
    fn exposure_s(&self) -> f64 {
        self.exposure_s
    }
}

impl Effect for ExposureSmear {
    fn id(&self) -> &'static str {
        ID
    }
    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new("exposure_s", self.exposure_s, "s")]
    }
}

#[derive(Clone, Debug)]
struct SmearCandidate {
    about_s: f64,
    longest_s: f64,
    coefficients: [Coefficient; 1],
}

impl SmearCandidate {
    fn about(about_s: f64, longest_s: f64) -> Self {
        let plausible = (about_s * about_s).max(TYPICAL_S * TYPICAL_S);
        let coefficient = Coefficient::new("exposure_squared_s2", "s^2", plausible)
            .at_least(0.0)
            .at_most(longest_s * longest_s);
        Self {
            about_s,
            longest_s,
            coefficients: [coefficient],
        }
    }
}

impl Candidate for SmearCandidate {
    fn id(&self) -> &'static str {
        ID
    }
    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }
    fn refined(&self, values: &[f64]) -> Option<Box<dyn Candidate>> {
        // an exposure far below a millisecond would only divide rounding by itself
        (values[0] > 1e-6)
            .then(|| Box::new(Self::about(values[0].sqrt(), self.longest_s)) as Box<dyn Candidate>)
    }
    fn acts_on_stars(&self) -> bool {
        true
    }
    fn acts_on_attitude(&self) -> bool {
        true
    }
    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        check_columns(1, rows.len(), out.x.len());
        let mut path = Path::new(camera, rows);
        let squared = self.about_s * self.about_s;
        // the turns of the rows of one frame
        let mut turns = [None; GAUSS_LEGENDRE_8.len()];
        for i in 0..rows.len() {
            if i == 0 || rows.t_s[i].to_bits() != rows.t_s[i - 1].to_bits() {
                turns = GAUSS_LEGENDRE_8.map(|(node, _)| path.turn(i, 0.5 * self.about_s * node));
            }
            let mut mean = [0.0; 2];
            for ((node, weight), turn) in GAUSS_LEGENDRE_8.into_iter().zip(&turns) {
                let [dx, dy] = path.shift_by(i, 0.5 * self.about_s * node, turn.as_ref());
                mean[0] += 0.5 * weight * dx;
                mean[1] += 0.5 * weight * dy;
            }
            out.x[i] = mean[0] / squared;
            out.y[i] = mean[1] / squared;
        }
        true
    }
    fn attitude_columns(&self, rows: &AttitudeRows<'_>, out: VectorsMut<'_>) -> bool {
        check_columns(1, rows.len(), out.x.len());
        let Some(source) = rows.attitude else {
            return false;
        };
        let squared = self.about_s * self.about_s;
        let mut hint = 0;
        for (i, &t_s) in rows.t_s.iter().enumerate() {
            let mean = mean_turn(source, t_s, 0.0, self.about_s, &mut hint);
            // an exposure that leaves the span cannot be told
            let theta = mean.unwrap_or_default() / squared;
            out.x[i] = theta.x;
            out.y[i] = theta.y;
            out.z[i] = theta.z;
        }
        true
    }
    fn realise(
        &self,
        values: &[f64],
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        if values[0] >= 0.0 {
            return Ok(Box::new(ExposureSmear {
                exposure_s: values[0].sqrt(),
            }));
        }
        Err(EffectError::OutOfRange {
            effect: ID,
            name: self.coefficients[0].name.clone(),
            value: values[0],
            expected: "not negative",
        })
    }
}
