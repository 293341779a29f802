//! What noise that grows with the rate may follow instead.
//!
//! Noise by the acceleration or by how far out a star lies adds in square, as by the rate; by the time, the place or a
//! channel it is steeper or less steep:
//!
//! ```text
//! sigma^2 = s^2 V + (c a)^2,     sigma^2 = s^2 V 10^(0.4 slope z)     in place of  s^2 V + (c rate)^2
//! ```
//!
//! each with one parameter, as the rate has. Of the time, in which everything changes somehow, it is enough to explain
//! as much; another variable has to explain more.
//!
//! Not physics: which variables are tried.

use crate::causes::description;
use crate::search::empirical::Variable;
use crate::situation::Situation;
use crate::star::data::StarData;

use super::rows::Row;

/// Nats by which another variable has to explain more.
const MORE: f64 = 4.0;

/// A variable in the place of the rate.
#[derive(Clone, Debug)]
pub(super) struct Rival {
    /// Its values at all rows of the data; squares where it adds.
    values: Vec<f64>,
    adds: bool,
}

impl Rival {
    /// Noise that grows with these squares of every row.
    pub(super) fn of_squares(values: impl Iterator<Item = f64>) -> Self {
        Self {
            values: values.collect(),
            adds: true,
        }
    }

    /// `row` with the rival in the place of the rate, where that adds, or of the magnitude.
    pub(super) fn in_place(&self, row: &Row) -> Row {
        let value = self.values[row.at];
        let value = if value.is_finite() { value } else { 0.0 };
        if self.adds {
            Row {
                rate: value,
                ..*row
            }
        } else {
            Row { mag: value, ..*row }
        }
    }

    pub(super) fn adds(&self) -> bool {
        self.adds
    }

    /// What is said where it explains enough to be as good a cause as a rate of log-likelihood `rate`, with its own.
    pub(super) fn against(own: f64, rate: f64) -> Option<&'static str> {
        (own >= rate + MORE).then_some("noise that follows another variable explains more")
    }
}

/// The acceleration across the detector, the place on it and the distance from the middle of where stars are, and every
/// channel.
pub(super) fn rivals(situation: &Situation<'_>, data: &StarData) -> Vec<Rival> {
    let rows = data.rows(0..data.t_s.len(), None, None);
    let each = description::of_noise(situation, data);
    // -1 to 1
    let scaled = |variable: &Variable, [low, high]: [f64; 2]| -> Vec<f64> {
        let values = (0..data.t_s.len()).map(|r| variable.value(&rows, r));
        values
            .map(|v| (2.0 * v - low - high) / (high - low))
            .collect()
    };
    let mut out = Vec::new();
    let mut out_of_the_middle = vec![0.0; data.t_s.len()];
    for (variable, range) in &each {
        match variable {
            Variable::Acceleration => {
                let sizes = scaled(variable, [-range[1], range[1]]);
                out.push(Rival::of_squares(sizes.iter().map(|a| a * a)));
            }
            Variable::Housekeeping(..) => out.push(Rival {
                values: scaled(variable, *range),
                adds: false,
            }),
            Variable::Position(_) => {
                let place = scaled(variable, *range);
                for (sum, z) in out_of_the_middle.iter_mut().zip(&place) {
                    *sum += z * z;
                }
                out.push(Rival::of_squares(place.iter().map(|z| z * z)));
                out.push(Rival {
                    values: place,
                    adds: false,
                });
            }
            _ => {}
        }
    }
    out.push(Rival::of_squares(out_of_the_middle.into_iter()));
    out
}
