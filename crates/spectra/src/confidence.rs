//! Chi-squared confidence bands.
//!
//! ```text
//! truth in [estimate nu / chi2_nu((1 + p)/2), estimate nu / chi2_nu((1 - p)/2)]   with probability p
//! ```
//!
//! Source: Percival & Walden (1993), Eq. 258; quantiles: Wilson-Hilferty (A&S 26.4.17) refined by Newton's
//! method on the incomplete gamma function.

use statrs::function::gamma::{checked_gamma_lr, checked_gamma_ur, ln_gamma};

use crate::SpectraError;

/// A confidence band, one pair of limits for each point of an estimate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Band {
    /// Lower limits, in the unit of the estimate.
    pub lower: Vec<f64>,
    /// Upper limits.
    pub upper: Vec<f64>,
}

/// Above this many degrees of freedom the expansion alone is better than 1e-9.
const MANY: f64 = 1e5;

/// Quantile of the chi-squared distribution: `P(chi2_dof <= result) = probability`.
///
/// Relative error below 1e-12 up to 1e5 degrees of freedom (which may be fractional), below 1e-9
/// beyond.
///
/// ```
/// // two degrees of freedom: an exponential of mean 2
/// let median = spectra::chi_squared_quantile(0.5, 2.0)?;
/// assert!((median - 2.0 * std::f64::consts::LN_2).abs() < 1e-14);
/// # Ok::<(), spectra::SpectraError>(())
/// ```
///
/// # Errors
///
/// [`SpectraError::Probability`] outside (0, 1), [`SpectraError::NotPositive`] for `dof`.
pub fn chi_squared_quantile(probability: f64, dof: f64) -> Result<f64, SpectraError> {
    SpectraError::probability("probability", probability)?;
    SpectraError::positive("dof", dof)?;
    let z = normal_quantile(probability);
    if dof > MANY {
        return Ok(cornish_fisher(z, dof));
    }
    let a = 0.5 * dof;
    // Newton in ln y, y = chi2/2: the steps keep y positive
    let h = 2.0 / (9.0 * dof);
    let wilson_hilferty = (1.0 - h + z * h.sqrt()).powi(3) * a;
    // small probabilities: P(a, y) ~ y^a / Gamma(a + 1)
    let power = ((probability.ln() + ln_gamma(a + 1.0)) / a).exp();
    if power < 1e-14 {
        return Ok(2.0 * power); // the next term of the series is smaller by y
    }
    let mut y = if wilson_hilferty > 0.1 * a && wilson_hilferty > 0.02 {
        wilson_hilferty
    } else {
        power.max(f64::MIN_POSITIVE)
    };
    for _ in 0..100 {
        // the smaller tail keeps its digits
        let excess = if probability < 0.5 {
            checked_gamma_lr(a, y).unwrap_or(0.0) - probability
        } else {
            (1.0 - probability) - checked_gamma_ur(a, y).unwrap_or(1.0)
        };
        let density = (a * y.ln() - y - ln_gamma(a)).exp(); // y times the density of y
        if density <= 0.0 {
            break;
        }
        let step = (excess / density).clamp(-1.0, 1.0);
        y *= (-step).exp();
        if step.abs() < 1e-15 {
            break;
        }
    }
    Ok(2.0 * y)
}

/// The pair of factors by which an estimate with `dof` degrees of freedom is multiplied for its
/// confidence band of probability `level`: below 1, above 1.
///
/// ```
/// let [low, high] = spectra::confidence_factors(0.95, 20.0)?;
/// assert!((low - 0.585).abs() < 1e-3 && (high - 2.085).abs() < 1e-3);
/// # Ok::<(), spectra::SpectraError>(())
/// ```
///
/// # Errors
///
/// As [`chi_squared_quantile`].
pub fn confidence_factors(level: f64, dof: f64) -> Result<[f64; 2], SpectraError> {
    SpectraError::probability("level", level)?;
    Ok([
        dof / chi_squared_quantile(0.5 * (1.0 + level), dof)?,
        dof / chi_squared_quantile(0.5 * (1.0 - level), dof)?,
    ])
}

/// The band around each of `estimate`; `exponent` is 1 for a variance, 1/2 for a deviation.
pub(crate) fn band(
    estimate: &[f64],
    dof: &[f64],
    level: f64,
    exponent: f64,
) -> Result<Band, SpectraError> {
    let mut band = Band::default();
    let mut known = (f64::NAN, [f64::NAN; 2]);
    for (e, d) in estimate.iter().zip(dof) {
        // neighbours mostly share their degrees of freedom
        if known.0.to_bits() != d.to_bits() {
            known = (*d, confidence_factors(level, *d)?.map(|f| f.powf(exponent)));
        }
        band.lower.push(e * known.1[0]);
        band.upper.push(e * known.1[1]);
    }
    Ok(band)
}

/// Quantile of the standard normal distribution.
fn normal_quantile(probability: f64) -> f64 {
    -std::f64::consts::SQRT_2 * statrs::function::erf::erfc_inv(2.0 * probability)
}

/// The expansion in `dof^-1/2` to four terms (A&S 26.4.16 with 26.2.49).
fn cornish_fisher(z: f64, dof: f64) -> f64 {
    let r = (2.0 / dof).sqrt();
    let z2 = z * z;
    dof * (1.0 + r * z + r * r * (z2 - 1.0) / 3.0 + r * r * r * z * (z2 - 7.0) / 36.0
        - r * r * r * r * (6.0 * z2 * z2 + 14.0 * z2 - 32.0) / 1620.0)
}
