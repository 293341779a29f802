//! Whether the noise is as loud as declared, where nothing else is left.
//!
//! Source: chi-squared per degree of freedom scatters by sqrt(2 / n).

/// What a declared noise level may be off by without a word: by 20 % either way it usually is.
const NOMINAL: f64 = 1.25;
/// Standard deviations by which the level must be off, too: few rows do not tell it.
const BEYOND_DOUBT: f64 = 5.0;

/// Noise over the declared, sigma over sigma, where that is far off: of `rows` with two numbers each.
#[must_use]
pub fn noise_ratio(chi2_per_dof: Option<f64>, rows: usize) -> Option<f64> {
    let chi2 = chi2_per_dof.filter(|c| *c > 0.0)?;
    let ratio = chi2.sqrt();
    let values = 2.0 * rows as f64;
    let far = ratio.max(1.0 / ratio) > NOMINAL;
    let sure = chi2.ln().abs() > BEYOND_DOUBT * (2.0 / values).sqrt();
    (far && sure).then_some(ratio)
}

/// The same in words.
#[must_use]
pub fn times(ratio: f64) -> String {
    let digits = if ratio < 1.0 { 2 } else { 1 };
    format!("{ratio:.digits$} times")
}
