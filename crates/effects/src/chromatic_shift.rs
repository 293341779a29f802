//! Chromatic shift: the scale of a star's image follows its colour.
//!
//! ```text
//! dP = 1e-6 ppm_per_mag ((B - V) - 0.6) P
//! ```
//!
//! outward for red stars when positive. 0.6 is a sunlike star; a star of unknown colour does not move.
//!
//! Source: \[M23\] Section 2.1 names chromatic refraction among the causes of LSFE; lateral colour is
//! proportional to the field angle in the paraxial limit.

use star_tracker::StarView;

use crate::parameters::Reader;
use crate::shift::{Shift, ShiftCandidate, Shifted};
use crate::{
    ActsOn, Candidate, Coefficient, Effect, EffectError, EffectKind, Parameters, Scene,
    Surroundings,
};

const ID: &str = "chromatic_shift";
const NEUTRAL_BV: f64 = 0.6;

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "radial shift that follows the star's colour"
    }
    fn needs(&self) -> &'static str {
        "stars, and a catalogue with the colours of at least two of them"
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
        let reader = Reader::new(ID, parameters, &["ppm_per_mag"])?;
        Ok(Box::new(Shifted::new(
            Chromatic,
            vec![reader.required("ppm_per_mag")?],
        )))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        let coloured = scene
            .stars
            .iter()
            .filter(|star| star.bv.is_finite())
            .count();
        if !scene.has_stars || coloured < 2 {
            return Vec::new();
        }
        vec![ShiftCandidate::boxed(Chromatic)]
    }
}

#[derive(Clone, Debug)]
struct Chromatic;

impl Shift for Chromatic {
    fn id(&self) -> &'static str {
        ID
    }
    fn coefficients(&self) -> Vec<Coefficient> {
        vec![Coefficient::new("ppm_per_mag", "ppm/mag", 100.0)]
    }
    fn terms(&self, star: &StarView, out: &mut [[f64; 2]]) {
        let colour = if star.bv.is_finite() {
            star.bv - NEUTRAL_BV
        } else {
            0.0
        };
        out[0] = [1e-6 * colour * star.at.x, 1e-6 * colour * star.at.y];
    }
}
