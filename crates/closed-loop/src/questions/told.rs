//! Coefficients of the fit as the parameters of the catalogue: a smear enters with the square of its exposure, and is told
//! as an exposure.
//!
//! Not physics: names and units.

use effects::{Candidate, Surroundings};

use crate::search::group::largest;

/// The parameter by which a coefficient is told.
pub(crate) struct Told<'a> {
    candidate: &'a dyn Candidate,
    surroundings: &'a Surroundings<'a>,
    j: usize,
    pub(crate) name: String,
    pub(crate) unit: String,
    /// Position among the effect's parameters; `None`: the coefficient is its own parameter.
    parameter: Option<usize>,
}

impl<'a> Told<'a> {
    pub(crate) fn of(
        candidate: &'a dyn Candidate,
        j: usize,
        surroundings: &'a Surroundings<'a>,
    ) -> Self {
        // sine and cosine share one amplitude, which knows no sign
        let magnitude = Self::of_magnitude(candidate, j, surroundings);
        if magnitude.knows_no_sign() {
            return Self {
                name: candidate.coefficients()[j].name.clone(),
                unit: candidate.coefficients()[j].unit.to_owned(),
                parameter: None,
                ..magnitude
            };
        }
        magnitude
    }

    /// Where only the magnitude is asked: the amplitude of a sine is that of its wave.
    pub(crate) fn of_magnitude(
        candidate: &'a dyn Candidate,
        j: usize,
        surroundings: &'a Surroundings<'a>,
    ) -> Self {
        let coefficient = &candidate.coefficients()[j];
        let mut told = Self {
            candidate,
            surroundings,
            j,
            name: coefficient.name.clone(),
            unit: coefficient.unit.to_owned(),
            parameter: None,
        };
        let typical = told.typical();
        if let (Some(small), Some(large)) = (told.realised(0.5 * typical), told.realised(typical)) {
            let moved = small
                .iter()
                .zip(&large)
                .position(|(a, b)| a.unit != "rad" && (a.value - b.value).abs() > 0.0);
            if let Some(k) = moved {
                told.name.clone_from(&large[k].name);
                told.unit = large[k].unit.to_owned();
                told.parameter = Some(k);
            }
        }
        told
    }

    fn typical(&self) -> f64 {
        let plausible = self.candidate.coefficients()[self.j].plausible;
        if plausible.is_finite() {
            plausible
        } else {
            1.0
        }
    }

    /// Whether either sign of the coefficient is one value of the parameter.
    pub(crate) fn knows_no_sign(&self) -> bool {
        let either = self.candidate.coefficients()[self.j].lower < 0.0;
        let at = |value: f64| Some(self.realised(value)?.get(self.parameter?)?.value);
        let [above, below] = [1.0, -1.0].map(|sign| at(sign * self.typical()));
        either && above.zip(below).is_some_and(|(a, b)| (a - b).abs() == 0.0)
    }

    /// What an instrument could have, and a value beyond it. Below what the parameter can be it is as much of the
    /// other sign.
    pub(crate) fn beyond(&self, value: f64, [low, high]: [f64; 2]) -> (f64, [f64; 2]) {
        if self.knows_no_sign() {
            return (
                self.size(value.abs()),
                [0.0, self.size(largest([low, high]))],
            );
        }
        let lower = self.candidate.coefficients()[self.j].lower;
        let told = if value < lower {
            -self.size(-value)
        } else {
            self.size(value)
        };
        (told, [low, high].map(|bound| self.size(bound)))
    }

    fn realised(&self, value: f64) -> Option<Vec<effects::Parameter>> {
        let mut values = vec![0.0; self.candidate.coefficients().len()];
        values[self.j] = value;
        let effect = self.candidate.realise(&values, self.surroundings).ok()?;
        Some(effect.parameters())
    }

    /// A value of the coefficient as the parameter; below its physical range it is 0.
    pub(crate) fn size(&self, value: f64) -> f64 {
        let value = value.max(self.candidate.coefficients()[self.j].lower);
        let told = self
            .parameter
            .and_then(|k| Some(self.realised(value)?.get(k)?.value));
        told.unwrap_or(value)
    }
}
