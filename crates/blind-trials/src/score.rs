//! One report held against what acts.
//!
//! An effect that was found is right if its id is that of an effect that acts, or one that the truth takes
//! for as right, and every selector of the truth (a channel, a star) is the same. Each effect that acts
//! answers for one that was found; a second of its kind is extra, as is any other. Parameters are held
//! against the truth by name: z is their error over the reported sigma. Where an interval of 95 % is
//! reported instead (an instant, whose errors are not Gaussian), it holds the truth or not.
//!
//! Not physics: counting.

use imager::{Acting, Truth};
use telemetry::report::{Estimate, FoundEffect, Report, Selector, Verdict};

use crate::floor::Floor;

/// Largest |z| of a value that is right: 5 sigma.
const RIGHT: f64 = 5.0;
/// Id of terms that are no explanation.
const EMPIRICAL: &str = "empirical";

/// An effect that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Claim {
    /// Its id.
    pub id: String,
    /// Which of the effects that act it is; `None`: extra.
    pub right: Option<usize>,
}

/// A parameter of a right effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Which of the effects that act.
    pub acting: usize,
    /// Name of the parameter.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// As estimated.
    pub value: f64,
    /// Error over sigma; NaN where there is no sigma.
    pub z: f64,
    /// Whether the truth lies within the bounds; `None` where there are none.
    pub held: Option<bool>,
}

/// A report, scored.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// What the report says in one word.
    pub verdict: Verdict,
    /// What was found, in the order of the report, without empirical terms.
    pub claims: Vec<Claim>,
    /// For each effect that acts, whether it was found.
    pub found: Vec<bool>,
    /// Parameters of the right effects.
    pub drawn: Vec<Drawn>,
    /// What the leftover follows most.
    pub leftover: Option<String>,
    /// Whether that is one of the variables that it may name.
    pub follows: bool,
    /// Error before, after, and with perfect knowledge, arcsec (x and y together).
    pub before: f64,
    /// After.
    pub after: f64,
    /// With perfect knowledge; NaN where that is not known.
    pub floor: f64,
}

impl Score {
    /// Whether the effect named first is one that acts.
    #[must_use]
    pub fn first_right(&self) -> bool {
        self.claims.first().is_some_and(|c| c.right.is_some())
    }

    /// Whether everything that acts was found.
    #[must_use]
    pub fn all_found(&self) -> bool {
        self.found.iter().all(|f| *f)
    }

    /// What was found and does not act.
    pub fn extra(&self) -> impl Iterator<Item = &str> {
        let extra = self.claims.iter().filter(|c| c.right.is_none());
        extra.map(|c| c.id.as_str())
    }

    /// Whether all parameters are right within 5 sigma.
    #[must_use]
    pub fn values_right(&self) -> bool {
        // a value without sigma cannot be held against anything
        self.drawn
            .iter()
            .all(|d| d.z.is_nan() || d.z.abs() <= RIGHT)
    }

    /// Whether the report says no more than is true of something that no catalogue has: something is
    /// left, it follows what it may follow, and nothing that does not act is named.
    #[must_use]
    pub fn honest(&self) -> bool {
        let left = matches!(
            self.verdict,
            Verdict::Unexplained | Verdict::PartlyExplained
        );
        left && self.follows && self.extra().next().is_none()
    }
}

/// Scores a report.
#[must_use]
pub fn score(report: &Report, truth: &Truth, floor: Option<Floor>) -> Score {
    let mut found = vec![false; truth.effect.len()];
    let (mut claims, mut drawn) = (Vec::new(), Vec::new());
    for effect in report.effects.iter().filter(|e| e.id != EMPIRICAL) {
        let free = |(k, acting): (usize, &Acting)| (!found[k] && is(effect, acting)).then_some(k);
        let right = truth.effect.iter().enumerate().find_map(free);
        if let Some(k) = right {
            found[k] = true;
            for (name, &value) in &truth.effect[k].values {
                if let Some(estimate) = effect.parameters.get(name) {
                    drawn.push(Drawn {
                        acting: k,
                        name: name.clone(),
                        unit: estimate.unit.clone(),
                        value: estimate.value,
                        z: (estimate.value - value) / sigma(estimate),
                        held: (estimate.interval).map(|[low, high]| low <= value && value <= high),
                    });
                }
            }
        }
        claims.push(Claim {
            id: effect.id.clone(),
            right,
        });
    }
    let leftover = (report.unattributed.present)
        .then(|| report.unattributed.depends_on.first())
        .flatten()
        .map(|d| d.variable.clone());
    let both = |pair: Option<[f64; 2]>| pair.map_or(f64::NAN, |[x, y]| x.hypot(y));
    Score {
        verdict: report.verdict,
        claims,
        found,
        drawn,
        follows: leftover.as_ref().is_some_and(|v| truth.follows.contains(v)),
        leftover,
        before: both(report.before.star_rms_arcsec),
        after: both(report.after.star_rms_arcsec),
        floor: both(floor.map(|Floor(rms)| rms)),
    }
}

fn is(effect: &FoundEffect, acting: &Acting) -> bool {
    let named = effect.id == acting.id || acting.or.contains(&effect.id);
    named
        && acting.selectors.iter().all(|(name, wanted)| {
            effect.selectors.get(name).is_some_and(|s| match s {
                Selector::Integer(n) => n.to_string() == *wanted,
                Selector::Text(text) => text == wanted,
            })
        })
}

fn sigma(estimate: &Estimate) -> f64 {
    match (estimate.interval, estimate.sigma) {
        (None, Some(sigma)) => sigma,
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use telemetry::report::{Dependence, Errors, Rows, Unattributed};

    fn effect(
        id: &str,
        selector: Option<(&str, &str)>,
        parameters: &[(&str, f64, f64)],
    ) -> FoundEffect {
        let estimate = |&(name, value, sigma): &(&str, f64, f64)| {
            let estimate = Estimate {
                value,
                sigma: Some(sigma),
                unit: "s".into(),
                interval: None,
            };
            (name.to_owned(), estimate)
        };
        FoundEffect {
            id: id.into(),
            selectors: selector
                .iter()
                .map(|(k, v)| ((*k).to_owned(), (*v).into()))
                .collect(),
            parameters: parameters.iter().map(estimate).collect(),
            delta_loglik: 20.0,
            p_value: 1e-6,
            variance_explained: None,
            confusable_with: Vec::new(),
        }
    }

    fn report(verdict: Verdict, effects: Vec<FoundEffect>, follows: Option<&str>) -> Report {
        let errors = |rms| Errors {
            star_rms_arcsec: Some([rms, 0.0]),
            ..Errors::default()
        };
        let depends = |variable: &str| Dependence {
            variable: variable.into(),
            variance_explained: 0.1,
            p_value: 1e-4,
        };
        Report {
            format: String::new(),
            verdict,
            folds: 5,
            rows: Rows::default(),
            windows: None,
            before: errors(2.0),
            after: errors(1.5),
            effects,
            considered: Vec::new(),
            hypotheses: Vec::new(),
            unattributed: Unattributed {
                present: follows.is_some(),
                depends_on: follows.map(depends).into_iter().collect(),
                ..Unattributed::default()
            },
        }
    }

    fn acts(id: &str, selector: Option<(&str, &str)>, values: &[(&str, f64)]) -> Acting {
        let text = |(k, v): &(&str, &str)| ((*k).to_owned(), (*v).to_owned());
        Acting {
            id: id.into(),
            or: Vec::new(),
            selectors: selector.iter().map(text).collect(),
            values: values
                .iter()
                .map(|(k, v)| ((*k).to_owned(), *v))
                .collect::<BTreeMap<_, _>>(),
        }
    }

    fn truth(effect: Vec<Acting>) -> Truth {
        Truth {
            effect,
            ..Truth::default()
        }
    }

    #[test]
    fn the_right_effect_with_its_value() {
        let truth = truth(vec![acts("time_tag_offset", None, &[("offset_s", 1.0)])]);
        let found = effect(
            "time_tag_offset",
            None,
            &[("offset_s", 1.3, 0.2), ("other", 9.0, 0.1)],
        );
        let scored = score(
            &report(Verdict::Explained, vec![found], None),
            &truth,
            Some(Floor([1.5, 0.0])),
        );
        assert!(scored.first_right() && scored.all_found() && scored.values_right());
        assert_eq!(scored.extra().count(), 0);
        assert_eq!(scored.drawn.len(), 1);
        assert!((scored.drawn[0].z - 1.5).abs() < 1e-12);
        assert!((scored.before - 2.0).abs() < 1e-12 && (scored.after - scored.floor).abs() < 1e-12);
        let far = effect("time_tag_offset", None, &[("offset_s", 2.1, 0.2)]);
        let scored = score(&report(Verdict::Explained, vec![far], None), &truth, None);
        assert!(scored.all_found() && !scored.values_right() && scored.floor.is_nan());
    }

    #[test]
    fn a_wrong_effect_first_a_wrong_selector_and_a_second_of_its_kind() {
        let truth = truth(vec![acts(
            "catalogue_position",
            Some(("star_id", "7")),
            &[],
        )]);
        let wrong = || effect("exposure_smear", None, &[]);
        let right = || effect("catalogue_position", Some(("star_id", "7")), &[]);
        let other_star = effect("catalogue_position", Some(("star_id", "8")), &[]);
        let scored = score(
            &report(Verdict::Explained, vec![wrong(), right()], None),
            &truth,
            None,
        );
        assert!(!scored.first_right() && scored.all_found());
        assert_eq!(scored.extra().collect::<Vec<_>>(), ["exposure_smear"]);
        let scored = score(
            &report(Verdict::Explained, vec![other_star], None),
            &truth,
            None,
        );
        assert!(!scored.first_right() && !scored.all_found() && scored.extra().count() == 1);
        let twice = report(Verdict::Explained, vec![right(), right()], None);
        let scored = score(&twice, &truth, None);
        assert!(scored.first_right());
        assert_eq!(scored.extra().count(), 1);
    }

    #[test]
    fn a_pair_needs_both_in_either_order_and_an_alias_counts() {
        let mut both = truth(vec![
            acts("a", None, &[("k", 1.0)]),
            acts("b", None, &[("k", 5.0)]),
        ]);
        let reversed = vec![
            effect("b", None, &[("k", 5.0, 1.0)]),
            effect("a", None, &[("k", 1.0, 1.0)]),
        ];
        let scored = score(&report(Verdict::Explained, reversed, None), &both, None);
        assert!(scored.first_right() && scored.all_found());
        assert!(
            scored.drawn.iter().all(|d| d.z.abs() < 1e-12),
            "{:?}",
            scored.drawn
        );
        let one = report(
            Verdict::PartlyExplained,
            vec![effect("b", None, &[])],
            Some("time"),
        );
        assert_eq!(score(&one, &both, None).found, [false, true]);
        both.effect[0].or = vec!["c".into()];
        let alias = vec![effect("c", None, &[]), effect("b", None, &[])];
        assert!(score(&report(Verdict::Explained, alias, None), &both, None).all_found());
    }

    #[test]
    fn a_null_has_nothing_to_find() {
        let quiet = score(
            &report(Verdict::Consistent, Vec::new(), None),
            &truth(Vec::new()),
            None,
        );
        assert!(quiet.all_found() && !quiet.first_right() && quiet.extra().count() == 0);
        let alarm = report(
            Verdict::Explained,
            vec![effect("hot_pixel", None, &[])],
            None,
        );
        assert_eq!(score(&alarm, &truth(Vec::new()), None).extra().count(), 1);
        // an empirical term is a description, not a claim
        let term = report(
            Verdict::Unexplained,
            vec![effect("empirical", None, &[])],
            Some("mag"),
        );
        assert_eq!(score(&term, &truth(Vec::new()), None).extra().count(), 0);
    }

    #[test]
    fn something_outside_is_told_honestly_or_not() {
        let truth = Truth {
            outside: vec!["x".into()],
            follows: vec!["mag".into(), "star".into()],
            ..Truth::default()
        };
        let said =
            |verdict, effects, follows| score(&report(verdict, effects, follows), &truth, None);
        assert!(said(Verdict::Unexplained, Vec::new(), Some("mag")).honest());
        assert!(!said(Verdict::Unexplained, Vec::new(), Some("rate")).honest());
        assert!(!said(Verdict::Consistent, Vec::new(), None).honest());
        let claim = vec![effect("hot_pixel", None, &[])];
        assert!(!said(Verdict::PartlyExplained, claim, Some("mag")).honest());
    }

    #[test]
    fn an_interval_holds_the_truth_or_not() {
        let truth = truth(vec![acts("step_misalignment", None, &[("at_s", 10.0)])]);
        let held = |interval: [f64; 2]| {
            let mut found = effect("step_misalignment", None, &[("at_s", 14.0, 1.0)]);
            for estimate in found.parameters.values_mut() {
                estimate.interval = Some(interval);
            }
            let scored = score(&report(Verdict::Explained, vec![found], None), &truth, None);
            // an instant has no sigma, whatever stands beside its bounds
            assert!(scored.drawn[0].z.is_nan() && scored.values_right());
            scored.drawn[0].held
        };
        assert_eq!(held([9.0, 15.0]), Some(true));
        assert_eq!(held([11.0, 15.0]), Some(false));
        assert_eq!(held([9.0, 9.5]), Some(false));
    }
}
