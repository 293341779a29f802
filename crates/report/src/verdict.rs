//! The verdict of a run as a sentence.

use closed_loop::{noise_ratio, times};
use telemetry::report::{Report, Verdict};

/// The verdict in words. Where nothing is left, all of chi-squared is noise: a level far from the declared one
/// is said.
pub(crate) fn sentence(report: &Report) -> String {
    let causes = report.effects.iter().filter(|e| e.id != "empirical");
    let names: Vec<&str> = causes.map(|e| e.id.as_str()).collect();
    let names = names.join(" + ");
    let noise = noise_ratio(report.after.chi2_per_dof, report.rows.used).map(times);
    match (report.verdict, noise) {
        (Verdict::Consistent, None) => match cost_of_another(report) {
            None => "the data follows the declared model; nothing is left to explain".to_owned(),
            Some(cost) => format!(
                "nothing is left to explain, but the error's spectrum is not the declared model's: log-PSD cost {cost:.1} for 1"
            ),
        },
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

/// What a log-PSD cost may be by chance. It is the mean square over the bins of what each is off by in its sigmas: at 5
/// that is 2.2 of them all over the band. Of a draw of the model it scatters by sqrt(2 / bins) around 1, of eight bins by
/// 0.5, so that 5 is eight times that away.
const COST_OF_ANOTHER: f64 = 5.0;

/// The largest log-PSD cost after, where the spectrum is not one of the model.
fn cost_of_another(report: &Report) -> Option<f64> {
    let costs = report.after.log_psd_cost?;
    let most = costs.into_iter().fold(0.0, f64::max);
    (most > COST_OF_ANOTHER).then_some(most)
}

#[cfg(test)]
mod tests {
    use telemetry::report::Errors;

    use super::*;
    use crate::bare;

    fn said(verdict: Verdict, chi2: Option<f64>, used: usize) -> String {
        let errors = || Errors {
            chi2_per_dof: chi2,
            ..Errors::default()
        };
        let mut report = bare::report(verdict);
        report.rows.used = used;
        (report.before, report.after) = (errors(), errors());
        sentence(&report)
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

    /// Nothing that is left is not the same as a spectrum of the model's.
    #[test]
    fn a_spectrum_of_another_model_is_said() {
        let of = |cost: f64| {
            let mut report = bare::report(Verdict::Consistent);
            report.after.log_psd_cost = Some([1.0, cost, 1.1]);
            sentence(&report)
        };
        assert!(of(1.3).contains("follows the declared model"));
        assert!(!of(8.0).contains("follows") && of(8.0).contains("log-PSD cost 8.0"));
    }
}
