//! Why an effect was not added, in words.
//!
//! Not physics: reasons.

use closed_loop::of_size;
use telemetry::report::{ConsideredEffect, Report};

use crate::number::short;

/// Chance below which an effect counts as seen.
const SIGNIFICANT: f64 = 0.01;

/// What speaks against an effect that the data seem to speak for; `None` where they do not.
pub(crate) fn in_spite_of_its_gain(c: &ConsideredEffect, report: &Report) -> Option<String> {
    if let Some(size) = &c.refused {
        return Some(format!("significant, but {}", of_size(size)));
    }
    if let Some(why) = &c.against {
        return Some(format!("found, but not named: {why}"));
    }
    let gains = c.delta_loglik.is_some_and(|gain| gain > 0.0);
    if !(gains && c.p_value.is_some_and(|p| p < SIGNIFICANT)) {
        return None;
    }
    let why = if report.effects.is_empty() {
        "without less error"
    } else {
        "not worth its parameters beside what was added"
    };
    Some(format!("visible alone, but {why}"))
}

/// Why any effect was not added.
pub(crate) fn why_not(c: &ConsideredEffect, report: &Report) -> String {
    if let Some(why) = in_spite_of_its_gain(c, report) {
        return why;
    }
    let said = match (c.delta_loglik, c.p_value) {
        (None, None) => "looked for, no fit of its own",
        _ => "not significant",
    };
    let left = report.unattributed.present;
    match (c.detectable, c.needed) {
        (Some(d), Some(n)) if left && n > d => format!(
            "{said}; not the cause of what is left: that would show at {}σ",
            short(5.0 * n / d)
        ),
        (Some(_), Some(_)) if left => {
            format!("{said}; still possible: the size needed is below what shows")
        }
        _ => said.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use telemetry::report::Verdict;

    use super::*;

    /// What was never fitted is not said to be insignificant.
    #[test]
    fn what_was_not_fitted_is_not_insignificant() {
        let report = crate::bare::report(Verdict::Consistent);
        let mut c = ConsideredEffect {
            id: "velocity_aberration".to_owned(),
            selectors: std::collections::BTreeMap::new(),
            delta_loglik: None,
            p_value: None,
            observable: true,
            detectable: Some(1758.0),
            needed: None,
            against: None,
            parameter: Some("speed_m_s".to_owned()),
            unit: Some("m/s".to_owned()),
            refused: None,
        };
        assert_eq!(why_not(&c, &report), "looked for, no fit of its own");
        (c.delta_loglik, c.p_value) = (Some(-0.3), Some(0.8));
        assert_eq!(why_not(&c, &report), "not significant");
    }
}
