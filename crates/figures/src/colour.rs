//! Colours that stay apart for colour-blind eyes, and scales of colour for values.
//!
//! Not physics: Okabe and Ito's palette; a sequential and a diverging scale of their ends.

/// A colour of a mark: red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour(pub [u8; 3]);

impl Colour {
    /// What was measured.
    pub const MEASURED: Self = Self([0, 114, 178]);
    /// A model, or the mean of its draws.
    pub const MODEL: Self = Self([213, 94, 0]);
    /// A bound.
    pub const BOUND: Self = Self([135, 60, 150]);
    /// Single draws, and what stays in the background.
    pub const DRAWS: Self = Self([185, 190, 196]);
    /// Before something was added.
    pub const BEFORE: Self = Self([120, 126, 134]);
    /// After something was added.
    pub const AFTER: Self = Self([0, 128, 96]);
    /// A second model.
    pub const OTHER: Self = Self([0, 158, 115]);
    /// A third model.
    pub const THIRD: Self = Self([230, 159, 0]);
    /// Text and rules.
    pub const INK: Self = Self([32, 36, 42]);

    /// Colours of models beside the first, in turn.
    #[must_use]
    pub const fn of_other(index: usize) -> Self {
        const TURN: [Colour; 4] = [
            Colour::OTHER,
            Colour::THIRD,
            Colour([86, 180, 233]),
            Colour([190, 90, 140]),
        ];
        TURN[index % TURN.len()]
    }

    pub(crate) fn hex(self) -> String {
        let [r, g, b] = self.0;
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}

/// Colours of values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// From light at the first value to dark at the second.
    Sequential([f64; 2]),
    /// Blue below zero, white at zero, vermilion above; full at this value.
    Diverging(f64),
}

impl Scale {
    /// A sequential scale from the 1st to the 99th percentile of the finite values.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let mut finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        finite.sort_by(f64::total_cmp);
        let at = |part: f64| -> f64 {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "an index"
            )]
            let k = (part * finite.len().saturating_sub(1) as f64).round() as usize;
            finite.get(k).copied().unwrap_or(0.0)
        };
        let (low, high) = (at(0.01), at(0.99));
        Self::Sequential([low, if high > low { high } else { low + 1.0 }])
    }

    /// Smallest and largest value with a colour of its own.
    #[must_use]
    pub fn ends(self) -> [f64; 2] {
        match self {
            Self::Sequential(ends) => ends,
            Self::Diverging(full) => [-full, full],
        }
    }

    pub(crate) fn colour(self, value: f64) -> Colour {
        let [low, high] = self.ends();
        let part = ((value - low) / (high - low)).clamp(0.0, 1.0);
        let stops: &[[f64; 3]] = match self {
            Self::Sequential(_) => &[
                [247.0, 244.0, 226.0],
                [253.0, 190.0, 110.0],
                [200.0, 70.0, 80.0],
                [70.0, 20.0, 90.0],
            ],
            Self::Diverging(_) => &[
                [0.0, 84.0, 158.0],
                [250.0, 250.0, 250.0],
                [200.0, 74.0, 0.0],
            ],
        };
        let place = part * (stops.len() - 1) as f64;
        let first = (0..stops.len() - 1)
            .rev()
            .find(|k| *k as f64 <= place)
            .unwrap_or(0);
        let rest = place - first as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and 255"
        )]
        let mixed = [0, 1, 2].map(|c| {
            (stops[first][c] + rest * (stops[first + 1][c] - stops[first][c])).round() as u8
        });
        Colour(mixed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_diverging_scale_is_white_at_zero_and_saturates() {
        let scale = Scale::Diverging(2.0);
        assert_eq!(scale.colour(0.0), Colour([250, 250, 250]));
        assert_eq!(scale.colour(7.0), scale.colour(2.0));
        assert_ne!(scale.colour(-2.0), scale.colour(2.0));
    }

    #[test]
    fn one_outlier_does_not_take_the_scale() {
        let mut values: Vec<f64> = (0..1000).map(f64::from).collect();
        values.push(1e9);
        values.push(f64::NAN);
        let [low, high] = Scale::of(&values).ends();
        assert!((0.0..20.0).contains(&low) && (980.0..1000.0).contains(&high));
    }
}
