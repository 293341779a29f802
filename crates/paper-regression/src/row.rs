//! Rows of the table: one claim, what comes out here, and how the two compare.
//!
//! Not physics: what a row is made of.

use std::fmt;

/// How a claim compares with what is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Verdict {
    /// The same number, or the same shape, comes out.
    Reproduced,
    /// Nothing speaks against it: within the spread of what the paper leaves open, or of a weaker
    /// claim than a number.
    Consistent,
    /// It depends on something that the paper does not print.
    NotReproducible,
    /// It cannot be so.
    Contradicts,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Reproduced => "reproduced",
            Self::Consistent => "consistent",
            Self::NotReproducible => "not reproducible from the paper",
            Self::Contradicts => "contradicts",
        })
    }
}

/// One claim.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Its name, unique in the table.
    pub id: String,
    /// What the paper says.
    pub paper: String,
    /// What comes out here.
    pub ours: String,
    /// Convention and assumptions.
    pub under: String,
    /// What counts as the same, and where that comes from.
    pub tolerance: String,
    /// How the two compare.
    pub verdict: Verdict,
    /// How they compared when the row was written; another verdict is a failure.
    pub expected: Verdict,
}

impl Row {
    /// Whether the verdict is the one that the row was written with.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.verdict == self.expected
    }
}

/// Claims that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Heading.
    pub title: &'static str,
    /// What is common to the rows.
    pub about: String,
    /// The rows.
    pub rows: Vec<Row>,
}

/// Values of what the paper leaves open.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Spread(Vec<f64>);

impl Spread {
    pub(crate) fn new(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        Self(values)
    }

    pub(crate) fn median(&self) -> f64 {
        let n = self.0.len();
        0.5 * (self.0[(n - 1) / 2] + self.0[n / 2])
    }

    pub(crate) fn least(&self) -> f64 {
        self.0[0]
    }

    pub(crate) fn greatest(&self) -> f64 {
        self.0[self.0.len() - 1]
    }

    pub(crate) fn holds(&self, value: f64) -> bool {
        (self.least()..=self.greatest()).contains(&value)
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [middle, least, greatest] = [self.median(), self.least(), self.greatest()].map(digits);
        write!(f, "{middle} ({least} to {greatest})")
    }
}

/// Three digits, two decimals at most; never a negative zero.
pub(crate) fn digits(value: f64) -> String {
    let size = value.abs();
    let text = if size.is_infinite() {
        "∞".to_owned()
    } else if size >= 999.5 {
        let step = 10_f64.powf(size.log10().floor() - 2.0);
        format!("{:.0}", (value / step).round() * step)
    } else if size >= 99.95 {
        format!("{value:.0}")
    } else if size >= 9.995 {
        format!("{value:.1}")
    } else {
        format!("{value:.2}")
    };
    match text.as_str() {
        "-0.00" => "0.00".to_owned(),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_says_its_middle_and_its_ends() {
        let spread = Spread::new(vec![4.0, 100.4, 12.34, 7.0]);
        assert_eq!(spread.to_string(), "9.67 (4.00 to 100)");
        assert!(spread.holds(4.0) && !spread.holds(3.99) && !spread.holds(101.0));
        let odd = [-9.999, 1234.6, 76_911.0, f64::INFINITY, -0.001].map(digits);
        assert_eq!(odd, ["-10.0", "1230", "76900", "∞", "0.00"]);
    }
}
