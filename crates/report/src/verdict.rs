//! The verdict of a run as a sentence.

use telemetry::report::{Report, Verdict};

/// What a declared noise level may be off by without a word: by 20 % either way it usually is.
const NOMINAL: f64 = 1.25;
/// Standard deviations by which the level must be off, too: few rows do not tell it.
const BEYOND_DOUBT: f64 = 5.0;

/// The verdict in words. Where nothing is left, all of chi-squared is noise: a level far from the declared one
/// is said.
pub(crate) fn sentence(report: &Report) -> String {
    let causes = report.effects.iter().filter(|e| e.id != "empirical");
    let names: Vec<&str> = causes.map(|e| e.id.as_str()).collect();
    let names = names.join(" + ");
    let noise = noise_ratio(report).map(times);
    match (report.verdict, noise) {
        (Verdict::Consistent, None) => {
            "the data follows the declared model; nothing is left to explain".to_owned()
        }
        (Verdict::Consistent, Some(noise)) => format!(
            "the data follows the declared model with {noise} its noise; nothing else is left"
        ),
        (Verdict::Explained, None) => format!("explained by {names}; nothing is left"),
        (Verdict::Explained, Some(noise)) => {
            format!("explained by {names}; nothing is left, but noise is {noise} the declared")
        }
        (Verdict::PartlyExplained, _) => {
            format!("partly explained by {names}; something is left")
        }
        (Verdict::Unexplained, _) => {
            "something is left that no effect of the catalogue explains".to_owned()
        }
    }
}

/// Noise over the declared, sigma over sigma, where that is far off: of n values chi-squared per degree of
/// freedom scatters by sqrt(2 / n).
fn noise_ratio(report: &Report) -> Option<f64> {
    let chi2 = report.after.chi2_per_dof.filter(|c| *c > 0.0)?;
    let ratio = chi2.sqrt();
    let values = 2.0 * report.rows.used as f64;
    let far = ratio.max(1.0 / ratio) > NOMINAL;
    let sure = chi2.ln().abs() > BEYOND_DOUBT * (2.0 / values).sqrt();
    (far && sure).then_some(ratio)
}

fn times(ratio: f64) -> String {
    let digits = if ratio < 1.0 { 2 } else { 1 };
    format!("{ratio:.digits$} times")
}

#[cfg(test)]
mod tests {
    use telemetry::report::{Errors, REPORT_FORMAT, Rows, Unattributed};

    use super::*;

    fn said(verdict: Verdict, chi2: Option<f64>, used: usize) -> String {
        let errors = || Errors {
            chi2_per_dof: chi2,
            ..Errors::default()
        };
        sentence(&Report {
            format: REPORT_FORMAT.to_owned(),
            verdict,
            folds: 5,
            rows: Rows {
                used,
                ..Rows::default()
            },
            windows: None,
            before: errors(),
            after: errors(),
            effects: vec![],
            considered: vec![],
            hypotheses: vec![],
            unattributed: Unattributed::default(),
        })
    }

    /// Twenty percent either way is as declared, and few rows prove nothing; four times is not.
    #[test]
    fn noise_far_from_the_declared_is_said() {
        let quiet = "the data follows the declared model; nothing is left to explain";
        let consistent = |chi2, used| said(Verdict::Consistent, chi2, used);
        for chi2 in [None, Some(1.0), Some(1.2 * 1.2), Some(0.8 * 0.8 + 1e-9)] {
            assert_eq!(consistent(chi2, 50_000), quiet, "{chi2:?}");
        }
        assert_eq!(consistent(Some(2.0), 20), quiet);
        assert!(consistent(Some(16.0), 1000).contains("with 4.0 times its noise"));
        assert!(consistent(Some(1.0 / 16.0), 1000).contains("with 0.25 times its noise"));
        let explained = said(Verdict::Explained, Some(16.0), 1000);
        assert!(explained.ends_with("nothing is left, but noise is 4.0 times the declared"));
        // where something is left nobody knows what of it is noise
        assert!(!said(Verdict::Unexplained, Some(16.0), 1000).contains("noise"));
    }
}
