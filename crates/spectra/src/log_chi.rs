//! Mean and variance of the logarithm of a spectral estimate.
//!
//! An estimate with `nu` degrees of freedom of a true density `S` is distributed as `S chi2_nu / nu`, so that
//!
//! ```text
//! E[ln(estimate / S)]   = psi(nu/2) - ln(nu/2)      (-0.577 for nu = 2)
//! Var[ln(estimate / S)] = psi'(nu/2)                (pi^2/6 for nu = 2)
//! ```
//!
//! with `psi` the digamma and `psi'` the trigamma function. A fit to a logarithmic spectrum that
//! leaves the first out returns every amplitude low by half of it (25 % for `nu = 2`): erratum E9.
//!
//! Source: Abramowitz & Stegun 6.3.5, 6.3.18 and 6.4.12; Bartlett & Kendall, J. R. Stat. Soc. Suppl. 8 (1946) 128.

/// `B_2n / (2n)` for n = 1..8, the coefficients of the asymptotic series of `ln x - 1/(2x) - psi(x)`.
const DIGAMMA: [f64; 8] = [
    1.0 / 12.0,
    -1.0 / 120.0,
    1.0 / 252.0,
    -1.0 / 240.0,
    1.0 / 132.0,
    -691.0 / 32_760.0,
    1.0 / 12.0,
    -3617.0 / 8160.0,
];

/// `B_2n` for n = 1..8, the coefficients of the asymptotic series of `psi'(x)`.
const TRIGAMMA: [f64; 8] = [
    1.0 / 6.0,
    -1.0 / 30.0,
    1.0 / 42.0,
    -1.0 / 30.0,
    5.0 / 66.0,
    -691.0 / 2730.0,
    7.0 / 6.0,
    -3617.0 / 510.0,
];

/// From here on the eight terms of the series are good to 1e-16: the ninth is `3.1 x^-18`.
const ASYMPTOTIC_FROM: f64 = 10.0;

/// Expectation of `ln(estimate / truth)` for an estimate with `dof` degrees of freedom: `psi(nu/2) - ln(nu/2)`.
///
/// Subtract it from a logarithmic spectrum to make it unbiased. Accurate to a few units of the last
/// place for all `dof`, also where the two terms nearly cancel; NaN unless `dof > 0`, and 0 for
/// infinitely many. Erratum E9.
///
/// ```
/// // a raw periodogram has two degrees of freedom: minus Euler's constant
/// assert!((spectra::log_bias(2.0) + 0.577_215_664_901_532_9).abs() < 1e-15);
/// ```
#[must_use]
pub fn log_bias(dof: f64) -> f64 {
    if dof.is_nan() || dof <= 0.0 {
        return f64::NAN;
    }
    let start = 0.5 * dof;
    let mut x = start;
    // psi(x) = psi(x + 1) - 1/x
    let mut steps = 0.0;
    while x < ASYMPTOTIC_FROM {
        steps -= 1.0 / x;
        x += 1.0;
    }
    let r = 1.0 / (x * x);
    let series = DIGAMMA.iter().rev().fold(0.0, |sum, c| (sum + c) * r);
    let logarithm = if x > start { (x / start).ln() } else { 0.0 };
    -0.5 / x - series + steps + logarithm
}

/// Variance of `ln(estimate)` for an estimate with `dof` degrees of freedom: `psi'(nu/2)`.
///
/// Its inverse is the weight of a bin in a fit of logarithms. NaN unless `dof > 0`, and 0 for
/// infinitely many. Erratum E9.
///
/// ```
/// use std::f64::consts::PI;
/// assert!((spectra::log_variance(2.0) - PI * PI / 6.0).abs() < 1e-15);
/// ```
#[must_use]
pub fn log_variance(dof: f64) -> f64 {
    if dof.is_nan() || dof <= 0.0 {
        return f64::NAN;
    }
    let mut x = 0.5 * dof;
    // psi'(x) = psi'(x + 1) + 1/x^2
    let mut steps = 0.0;
    while x < ASYMPTOTIC_FROM {
        steps += 1.0 / (x * x);
        x += 1.0;
    }
    let r = 1.0 / (x * x);
    let series = TRIGAMMA.iter().rev().fold(0.0, |sum, c| (sum + c) * r);
    steps + (1.0 + 0.5 / x + series) / x
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{LN_2, PI};

    const EULER: f64 = 0.577_215_664_901_532_9;

    /// Closed forms at half-integers and integers (A&S 6.3.2, 6.3.3, 6.4.2, 6.4.4).
    #[test]
    fn closed_forms() {
        let cases = [
            (1.0, -EULER - 2.0 * LN_2 + LN_2, PI * PI / 2.0),
            (2.0, -EULER, PI * PI / 6.0),
            (
                3.0,
                2.0 - EULER - 2.0 * LN_2 - 1.5_f64.ln(),
                PI * PI / 2.0 - 4.0,
            ),
            (4.0, 1.0 - EULER - LN_2, PI * PI / 6.0 - 1.0),
        ];
        for (dof, bias, variance) in cases {
            assert!((log_bias(dof) - bias).abs() < 4e-15, "bias {dof}");
            assert!(
                (log_variance(dof) - variance).abs() < 4e-15,
                "variance {dof}"
            );
        }
    }

    /// Where both terms are near 14, the difference keeps its digits: -1/nu - 1/(3 nu^2) to order nu^-4.
    #[test]
    fn many_degrees_of_freedom_keep_their_digits() {
        let dof = 2e6;
        let expected = -1.0 / dof - 1.0 / (3.0 * dof * dof);
        assert!((log_bias(dof) / expected - 1.0).abs() < 1e-14);
        let variance = 2.0 / dof + 2.0 / (dof * dof) + 4.0 / (3.0 * dof * dof * dof);
        assert!((log_variance(dof) / variance - 1.0).abs() < 1e-14);
        assert!(
            log_bias(0.0).is_nan() && log_variance(-1.0).is_nan() && log_bias(f64::NAN).is_nan()
        );
    }
}
