//! Chances beyond what was seen.
//!
//! Not physics: laws that do not answer for every number.

use statrs::distribution::ContinuousCDF;

/// Ratios beyond which no law has a chance that f64 holds; products with a law's freedom, of up to the rows of a table,
/// stay finite below it.
const BEYOND_ALL: f64 = 1e200;

/// Chance of `law` beyond `value`: one where that is no number, as of nothing over nothing, which tells nothing.
#[must_use]
pub fn beyond(law: &impl ContinuousCDF<f64, f64>, value: f64) -> f64 {
    if value.is_nan() {
        1.0
    } else if value > BEYOND_ALL {
        0.0
    } else {
        law.sf(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{FisherSnedecor, StudentsT};

    #[test]
    fn what_is_no_number_tells_nothing() {
        let f = FisherSnedecor::new(4.0, 100.0).unwrap();
        let t = StudentsT::new(0.0, 1.0, 5.0).unwrap();
        assert_eq!((beyond(&f, f64::NAN), beyond(&t, f64::NAN)), (1.0, 1.0));
        for value in [f64::MAX, f64::INFINITY] {
            assert_eq!((beyond(&f, value), beyond(&t, value)), (0.0, 0.0));
        }
        assert!((beyond(&f, 2.0) - f.sf(2.0)).abs() < 1e-15);
    }
}
