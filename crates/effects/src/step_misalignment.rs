//! Step misalignment: the tracker shifts against the reference once and stays there.
//!
//! ```text
//! theta(t) = (x, y, z) arcsec for t >= at_s, 0 before        tracker axes
//! ```
//!
//! Source: definition; a mechanical shift.

use crate::bending::{Bending, BendingCandidate, Bent};
use crate::parameters::Reader;
use crate::{
    ActsOn, Candidate, Coefficient, Effect, EffectError, EffectKind, Nonlinear, Parameter,
    Parameters, Scene, Surroundings,
};

const ID: &str = "step_misalignment";

/// Instants that the catalogue proposes, evenly inside the span; whoever searches refines them.
const INSTANTS: u32 = 24;

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "the tracker shifts against the reference at at_s"
    }
    fn needs(&self) -> &'static str {
        "a reference"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            attitude: true,
            ..ActsOn::default()
        }
    }
    fn build(
        &self,
        parameters: &Parameters,
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let reader = Reader::new(
            ID,
            parameters,
            &["at_s", "x_arcsec", "y_arcsec", "z_arcsec"],
        )?;
        let at_s = reader.required("at_s")?;
        let values = reader.axes(["x_arcsec", "y_arcsec", "z_arcsec"])?;
        Ok(Box::new(Bent {
            bending: Step {
                at_s,
                range: [at_s, at_s],
                picked_from: 1,
            },
            values: values.to_vec(),
        }))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        let span = scene.surroundings.span_s;
        if !scene.sees_misalignment() || span[1] <= span[0] {
            return Vec::new();
        }
        (1..=INSTANTS)
            .map(|k| f64::from(k) / f64::from(INSTANTS + 1))
            .map(|share| step_at(span[0] + share * (span[1] - span[0]), span, 1))
            .collect()
    }
}

/// A step of unknown size at `at_s`, inside the data's `span_s`, picked from so many instants by looking
/// at the data.
pub fn step_at(at_s: f64, span_s: [f64; 2], picked_from: usize) -> Box<dyn Candidate> {
    BendingCandidate::boxed(Step {
        at_s,
        range: span_s,
        picked_from,
    })
}

#[derive(Clone, Debug)]
struct Step {
    at_s: f64,
    range: [f64; 2],
    picked_from: usize,
}

impl Bending for Step {
    fn id(&self) -> &'static str {
        ID
    }
    fn coefficients(&self) -> Vec<Coefficient> {
        ["x_arcsec", "y_arcsec", "z_arcsec"]
            .map(|n| Coefficient::new(n, "arcsec", 10.0).as_misalignment())
            .into()
    }
    fn functions(&self) -> usize {
        1
    }
    fn at(&self, t_s: f64, out: &mut [f64]) {
        out[0] = if t_s >= self.at_s { 1.0 } else { 0.0 };
    }
    fn fixed(&self) -> Vec<Parameter> {
        vec![Parameter::new("at_s", self.at_s, "s")]
    }
    fn nonlinear(&self) -> Vec<Nonlinear> {
        let step = (self.range[1] - self.range[0]) / f64::from(INSTANTS + 1);
        vec![Nonlinear {
            name: "at_s",
            unit: "s",
            value: self.at_s,
            range: self.range,
            step,
            difference: None,
        }]
    }
    fn stands_for(&self) -> f64 {
        self.picked_from as f64
    }
    fn with_nonlinear(&self, values: &[f64]) -> Option<Self> {
        let [low, high] = self.range;
        (low..=high).contains(&values[0]).then(|| Self {
            at_s: values[0],
            ..self.clone()
        })
    }
}
