//! Mass of the standard normal distribution between two limits.
//!
//! ```text
//! Phi(b) - Phi(a) = 1/2 [erf(b/sqrt 2) - erf(a/sqrt 2)]
//! ```
//!
//! With both limits on one side of zero the complements are subtracted instead, so that a far
//! tail keeps its relative accuracy.
//!
//! Source: Abramowitz & Stegun, Handbook of Mathematical Functions, 26.2.29 and 7.1.2.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Mass between `a` and `b`, a <= b.
pub(crate) fn mass(a: f64, b: f64) -> f64 {
    let (a, b) = (a * FRAC_1_SQRT_2, b * FRAC_1_SQRT_2);
    if a > 0.0 {
        0.5 * (libm::erfc(a) - libm::erfc(b))
    } else if b < 0.0 {
        0.5 * (libm::erfc(-b) - libm::erfc(-a))
    } else {
        0.5 * (libm::erf(b) - libm::erf(a))
    }
}

/// Density at `z`.
pub(crate) fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * PI).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tables: Phi(1) - Phi(-1) = 0.6826894921370859; 1 - Phi(6) = 9.865876450376946e-10.
    #[test]
    fn known_masses() {
        assert!((mass(-1.0, 1.0) - 0.682_689_492_137_085_9).abs() < 1e-15);
        for tail in [mass(6.0, 40.0), mass(-40.0, -6.0)] {
            assert!((tail / 9.865_876_450_376_946e-10 - 1.0).abs() < 1e-13);
        }
    }
}
