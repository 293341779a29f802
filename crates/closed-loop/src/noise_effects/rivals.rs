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

use effects::StarRows;

use crate::search::empirical::{Scale, Variable};

use super::rows::Row;

/// Nats by which another variable has to explain more.
const MORE: f64 = 4.0;

/// A variable in the place of the rate.
pub(super) struct Rival<'a> {
    /// Its value at a row of the data; squares where it adds.
    value: Box<dyn Fn(usize) -> f64 + Send + Sync + 'a>,
    adds: bool,
}

impl<'a> Rival<'a> {
    /// Noise that grows with these squares.
    pub(super) fn of_squares(value: impl Fn(usize) -> f64 + Send + Sync + 'a) -> Self {
        Self {
            value: Box::new(value),
            adds: true,
        }
    }

    /// Noise that is steeper or less steep with this, -1 to 1.
    fn of_slope(value: impl Fn(usize) -> f64 + Send + Sync + 'a) -> Self {
        Self {
            value: Box::new(value),
            adds: false,
        }
    }

    /// `row` with the rival in the place of the rate, where that adds, or of the magnitude.
    pub(super) fn in_place(&self, row: &Row) -> Row {
        let value = (self.value)(row.at);
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

/// Of `variables` with their ranges: the acceleration across the detector, the place on it and the distance from the
/// middle of where stars are, and every channel.
pub(super) fn rivals<'a>(
    rows: &'a StarRows<'a>,
    variables: &'a [(Variable, [f64; 2])],
) -> Vec<Rival<'a>> {
    // -1 to 1
    let scaled = move |variable: &'a Variable, range: [f64; 2]| {
        let scale = Scale::new(range);
        move |row: usize| scale.of(variable.value(rows, row))
    };
    let mut out = Vec::new();
    let mut places = Vec::new();
    for (variable, range) in variables {
        match variable {
            Variable::Acceleration => {
                let size = scaled(variable, [-range[1], range[1]]);
                out.push(Rival::of_squares(move |row| size(row).powi(2)));
            }
            Variable::Housekeeping(..) => out.push(Rival::of_slope(scaled(variable, *range))),
            Variable::Position(_) => {
                let place = scaled(variable, *range);
                places.push(place);
                out.push(Rival::of_squares(move |row| place(row).powi(2)));
                out.push(Rival::of_slope(place));
            }
            _ => {}
        }
    }
    out.push(Rival::of_squares(move |row| {
        places.iter().map(|place| place(row).powi(2)).sum()
    }));
    out
}
