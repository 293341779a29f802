//! What the data says of an effect that somebody asks about by name.
//!
//! ```text
//! detectable     5 sigma of the size, everything else estimated beside it
//! needed         needed.rs
//! share          (E_without - E_with) / E_without, E the squared error at the best fit, in sample
//! at most        (sqrt(E_without - E_with) + sqrt(k v chi2_95))^2 / E_without
//! ```
//!
//! `v` is the noise variance, `chi2_95` the 95 % point for the effect's number of coefficients, and `k`
//! how much wider than white noise the coefficients scatter from block to block. All of it is worked out
//! beside the other effects that were added. Sizes are given as the effect's parameter: a smear
//! enters with the square of its exposure, and is told as an exposure.
//!
//! Source: Scheffe 1953 (the largest of all combinations within a confidence ellipsoid).

use block_regression::Estimate;
use effects::{Candidate, EffectKind, Surroundings};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use telemetry::report::{ConsideredEffect, FoundEffect, Hypothesis, HypothesisSize, RefusedSize};

use crate::error::CloseError;
use crate::findings::told;
use crate::noise_level::times;
use crate::questions::needed::ToExplain;
use crate::questions::told::Told;
use crate::search::group::largest;
use crate::search::selection::{FAMILY_ALPHA, columns_of};
use crate::search::{Found, first_column, without};

/// Sigmas that a size takes to be seen.
pub(crate) const SEEN: f64 = 5.0;
/// Below it a chance is told by this bound alone.
pub const NEXT_TO_NEVER: f64 = 1e-300;

/// Effects to be tested by name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Questions {
    ids: Vec<String>,
    /// Whether what is left is to be added as an empirical term.
    pub(crate) empirical: bool,
}

impl Questions {
    /// Asks about effects of the catalogue by id; one that is named twice is asked about once.
    ///
    /// # Errors
    /// [`CloseError::UnknownHypothesis`] with the ids that exist.
    ///
    /// ```
    /// use closed_loop::Questions;
    ///
    /// assert!(Questions::about(["rolling_shutter", "exposure_smear"]).is_ok());
    /// let error = Questions::about(["turn-around"]).unwrap_err().to_string();
    /// assert!(error.contains("`turn-around`") && error.contains("exposure_smear"));
    /// ```
    pub fn about<S: AsRef<str>>(ids: impl IntoIterator<Item = S>) -> Result<Self, CloseError> {
        let mut all: Vec<String> = Vec::new();
        for id in ids {
            let id = id.as_ref();
            if !effects::catalogue().iter().any(|kind| kind.id() == id) {
                let known: Vec<&str> = effects::catalogue().iter().map(|k| k.id()).collect();
                return Err(CloseError::UnknownHypothesis {
                    id: id.to_owned(),
                    known: known.join(", "),
                });
            }
            if !all.iter().any(|known| known == id) {
                all.push(id.to_owned());
            }
        }
        Ok(Self {
            ids: all,
            empirical: false,
        })
    }

    /// Also add what the leftover follows most, as an empirical term: after the verdict, which it does
    /// not change.
    #[must_use]
    pub fn adding_empirical(self, yes: bool) -> Self {
        Self {
            empirical: yes,
            ..self
        }
    }

    /// Whether this effect was asked about.
    pub(crate) fn include(&self, id: &str) -> bool {
        self.ids.iter().any(|known| known == id)
    }
}

/// What the answers are drawn from.
pub(crate) struct Grounds<'a> {
    pub(crate) found: &'a Found,
    pub(crate) surroundings: Surroundings<'a>,
    pub(crate) to_explain: &'a ToExplain<'a>,
    /// Whether the verdict is that something is left.
    pub(crate) something_left: bool,
    /// Noise over the declared, where that is far off.
    pub(crate) noise_ratio: Option<f64>,
    /// Whether the samples tell how the tracker moved between them.
    pub(crate) resolved: bool,
    /// Why the raw windows that there are tell nothing.
    pub(crate) unusable: Option<String>,
    pub(crate) effects: &'a [FoundEffect],
    pub(crate) considered: &'a [ConsideredEffect],
}

/// Answers in the order asked.
pub(crate) fn answer(questions: &Questions, grounds: &Grounds<'_>) -> Vec<Hypothesis> {
    effects::catalogue()
        .iter()
        .filter_map(|kind| {
            let at = questions.ids.iter().position(|id| id == kind.id())?;
            Some((at, grounds.about(*kind)))
        })
        .collect::<std::collections::BTreeMap<_, _>>()
        .into_values()
        .collect()
}

impl Grounds<'_> {
    fn about(&self, kind: &dyn EffectKind) -> Hypothesis {
        let id = kind.id();
        let mut answer = match self.best(id) {
            Some(g) => self.judged(g),
            None => self.listed(kind),
        };
        answer.id = id.to_owned();
        let considered = self.considered.iter().find(|c| c.id == id);
        if let Some((c, size)) = considered.and_then(|c| Some((c, c.refused.clone()?))) {
            answer.refused = Some(size);
            (answer.observable, answer.reason) = (true, None);
            (answer.delta_loglik, answer.p_value) = (c.delta_loglik, c.p_value);
        }
        answer.added = self.effects.iter().any(|e| e.id == id);
        let against = considered.and_then(|c| c.against.as_deref());
        let unseen = !answer.added && considered.is_some_and(|c| !c.observable);
        if let Some(why) = against.filter(|_| unseen) {
            (answer.observable, answer.reason) = (false, Some(why.to_owned()));
        }
        answer.finding = finding(&answer, against, !self.effects.is_empty(), &self.rest());
        answer
    }

    /// Why an effect has nothing to explain, in the words of the verdict.
    fn rest(&self) -> String {
        match (self.something_left, self.noise_ratio) {
            (false, None) => "nothing is left that it could explain".to_owned(),
            (false, Some(ratio)) => format!(
                "nothing is left that it could explain: only the noise is {} the declared",
                times(ratio)
            ),
            (true, _) => "it could explain none of what is left".to_owned(),
        }
    }

    /// The form of an effect that was added, or that gains most.
    fn best(&self, id: &str) -> Option<usize> {
        let found = self.found;
        let chosen = &found.selection.chosen;
        let judged = &found.selection.judged;
        (0..found.candidates.len())
            .filter(|&g| found.candidates[g].id() == id && judged[g].observable)
            .max_by(|&a, &b| {
                let key = |g: usize| (chosen.contains(&g), judged[g].delta_loglik);
                let (a, b) = (key(a), key(b));
                a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
            })
    }

    /// An effect with columns in this data.
    fn judged(&self, g: usize) -> Hypothesis {
        let found = self.found;
        let candidate = found.candidates[g].as_ref();
        let judged = &found.selection.judged[g];
        let chosen = found.selection.chosen.contains(&g);
        let mut answer = Hypothesis {
            selectors: told(&candidate.selectors()),
            significant: judged.stands(),
            observable: true,
            delta_loglik: Some(judged.delta_loglik),
            p_value: Some(judged.p_value),
            ..Hypothesis::default()
        };
        let fits = &found.fitted.fits;
        let group = &found.fitted.groups[g];
        let others = without(&found.selection.chosen, &[g]);
        let beside = columns_of(&found.fitted.groups, &others);
        let mut with = beside.clone();
        with.extend(&group.columns);
        let (Some(estimate), Some(e0), Some(e1), Some(variance)) = (
            fits.estimate(&with),
            fits.error(&beside),
            fits.error(&with),
            fits.variance(&with),
        ) else {
            return answer;
        };
        let own = beside.len();
        let taken = (e0 - e1).max(0.0);
        let p = with.len() - own;
        let widening = (own..with.len())
            .map(|i| estimate.sigma(i).powi(2) / estimate.white[(i, i)])
            .fold(1.0, f64::max);
        let chi2 = ChiSquared::new(p as f64).map_or(0.0, |law| law.inverse_cdf(0.95));
        let most = (taken.sqrt() + (widening * variance * chi2).sqrt()).powi(2);
        // of what was added all that it explains is told, and nothing of what is left
        answer.variance_share = Some(taken / e0);
        answer.variance_share_at_most = Some((most / e0).min(1.0));
        let first = first_column(&found.candidates, g);
        answer.sizes = group
            .columns
            .iter()
            .enumerate()
            .map(|(k, &column)| {
                let at = (column, column - first, own + k);
                let bounds = group.bounds[k];
                self.size(
                    candidate,
                    at,
                    bounds,
                    &estimate,
                    (!chosen).then_some(beside.as_slice()),
                )
            })
            .collect();
        if !chosen && !answer.significant && !group.could_show(&estimate, own) {
            answer.observable = false;
            answer.reason = answer.sizes.first().map(unseen);
        }
        answer
    }

    /// The sizes of coefficient `j` of a candidate, whose column is `column` and whose estimate is number `at`; `beside`
    /// are the columns that leave what it is to explain.
    fn size(
        &self,
        candidate: &dyn Candidate,
        (column, j, at): (usize, usize, usize),
        bounds: [f64; 2],
        estimate: &Estimate,
        beside: Option<&[usize]>,
    ) -> HypothesisSize {
        let coefficient = &candidate.coefficients()[j];
        let told = Told::of(candidate, j, &self.surroundings);
        let (value, sigma) = (estimate.value[at], estimate.sigma(at));
        let most = largest(bounds);
        let left = beside.and_then(|added| self.to_explain.needed(column, added));
        let alone = self.to_explain.needed_alone(column);
        HypothesisSize {
            parameter: told.name.clone(),
            unit: told.unit.clone(),
            value: Some(told.size(value)),
            sigma: Some(0.5 * (told.size(value + sigma) - told.size(value - sigma))),
            detectable: Some(told.size(SEEN * sigma)),
            needed: left.map(|n| told.size(n)),
            needed_alone: alone.map(|n| told.size(n)),
            plausible: coefficient
                .plausible
                .is_finite()
                .then(|| told.size(coefficient.plausible)),
            believed_to: most.is_finite().then(|| told.size(most)),
            needed_is_plausible: left.or(alone).map(|n| n <= most),
        }
    }

    /// An effect without columns: it acts on images or on the noise, or is not to be seen.
    fn listed(&self, kind: &dyn EffectKind) -> Hypothesis {
        let id = kind.id();
        if let Some(effect) = self.effects.iter().find(|e| e.id == id) {
            return Hypothesis {
                selectors: effect.selectors.clone(),
                significant: true,
                observable: true,
                delta_loglik: Some(effect.delta_loglik),
                p_value: Some(effect.p_value),
                variance_share: effect.variance_explained,
                sizes: effect
                    .parameters
                    .iter()
                    .map(|(name, e)| HypothesisSize {
                        parameter: name.clone(),
                        unit: e.unit.clone(),
                        value: Some(e.value),
                        sigma: e.sigma,
                        detectable: e.sigma.map(|s| SEEN * s),
                        ..HypothesisSize::default()
                    })
                    .collect(),
                ..Hypothesis::default()
            };
        }
        if let Some(c) = self.considered.iter().find(|c| c.id == id && c.observable) {
            return Hypothesis {
                observable: true,
                delta_loglik: c.delta_loglik,
                p_value: c.p_value,
                sizes: c
                    .parameter
                    .iter()
                    .map(|parameter| HypothesisSize {
                        parameter: parameter.clone(),
                        unit: c.unit.clone().unwrap_or_default(),
                        detectable: c.detectable,
                        needed: c.needed,
                        ..HypothesisSize::default()
                    })
                    .collect(),
                ..Hypothesis::default()
            };
        }
        let candidates: Vec<usize> = (0..self.found.candidates.len())
            .filter(|&g| self.found.candidates[g].id() == id)
            .collect();
        let reason = if !self.resolved && kind.needs().contains("the samples resolve") {
            "the motion between the samples is not known: they do not predict each other".to_owned()
        } else if let Some(why) = self.unusable.as_ref().filter(|_| kind.acts_on().images) {
            why.clone()
        } else if candidates.is_empty() {
            format!("the bundle lacks what it needs: {}", kind.needs())
        } else if candidates
            .iter()
            .all(|&g| self.found.fitted.groups[g].columns.is_empty())
        {
            "in this motion it shifts nothing, or only what the declared unknowns (misalignment, \
             attitude, distortion) take up"
                .to_owned()
        } else if self.effects.is_empty() {
            "in this motion it cannot be told from what describes the residual".to_owned()
        } else {
            "in this motion it cannot be told from what was added".to_owned()
        };
        Hypothesis {
            reason: Some(reason),
            ..Hypothesis::default()
        }
    }
}

/// Three digits, the way a sentence wants them.
pub(crate) fn short(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        return "unknown".to_owned();
    }
    if size == 0.0 {
        return "0".to_owned();
    }
    if (1e-3..1e4).contains(&size) {
        let steps = [1e-2, 1e-1, 1.0, 10.0, 100.0];
        let digits = 5 - steps.iter().filter(|s| size >= **s).count();
        let text = format!("{value:.digits$}");
        return match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
            false => text,
        };
    }
    format!("{value:.2e}")
}

fn with_unit(value: f64, unit: &str) -> String {
    let between = if unit.is_empty() { "" } else { " " };
    format!("{}{between}{unit}", short(value))
}

/// Why an effect whose believed sizes are lost in the noise does not show.
fn unseen(size: &HypothesisSize) -> String {
    let told = |value: Option<f64>| with_unit(value.unwrap_or(f64::NAN), &size.unit);
    format!(
        "in this data only {} = {} would show at 5 sigma, and no more than {} is believed",
        size.parameter,
        told(size.detectable),
        told(size.believed_to)
    )
}

/// Why an effect was refused by its size.
#[must_use]
pub fn of_size(size: &RefusedSize) -> String {
    let [least, most] = size.believed;
    format!(
        "of a size that nature does not make, {} = {}, believed from {} to {}",
        size.parameter,
        with_unit(size.value, &size.unit),
        short(least),
        with_unit(most, &size.unit),
    )
}

/// A chance in plain text; of a large effect's next to none is left.
#[must_use]
pub fn p_is(p: f64) -> String {
    if p < NEXT_TO_NEVER {
        format!("p < {NEXT_TO_NEVER:e}")
    } else if p < 0.01 {
        format!("p = {p:.1e}")
    } else {
        format!("p = {p:.2}")
    }
}

/// The answer in a sentence or three. `against`: what speaks against it; `others`: something was added; `rest`: why it
/// has nothing to explain, where it has not.
fn finding(h: &Hypothesis, against: Option<&str>, others: bool, rest: &str) -> String {
    if let Some(reason) = &h.reason {
        return format!("not observable: {reason}");
    }
    let mut said = Vec::new();
    said.push(match (h.added, h.significant, h.p_value) {
        (true, _, Some(p)) => format!("added: it predicts the residual out of fold ({})", p_is(p)),
        (true, _, None) => "added".to_owned(),
        (false, true, Some(p)) => {
            let why = match (against, others) {
                (Some(why), _) => why,
                (None, true) => "not worth its parameters beside what was added",
                (None, false) => "the search did not end with it",
            };
            format!("significant ({}), but {why}", p_is(p))
        }
        (false, false, Some(p)) => match (&h.refused, against) {
            (Some(size), _) => format!("refused ({}): {}", p_is(p), of_size(size)),
            (None, Some(why)) => format!("found, but {why}; beside that p = {p:.2}"),
            (None, None) if p < FAMILY_ALPHA => {
                format!("{}, but it predicts nothing out of fold", p_is(p))
            }
            (None, None) => format!("not significant (p = {p:.2})"),
        },
        (false, _, None) => "not significant".to_owned(),
    });
    // of several sizes, the one that would have to grow least
    let reach = |s: &HypothesisSize| {
        let needed = s.needed.or(s.needed_alone)?;
        Some(needed / s.plausible.or(s.detectable)?)
    };
    let told = h.sizes.iter().min_by(|a, b| {
        let key = |s: &HypothesisSize| reach(s).unwrap_or(f64::INFINITY);
        key(a).total_cmp(&key(b))
    });
    if let Some(size) = told {
        said.extend(told_size(h, size));
    }
    if !h.added && h.sizes.iter().all(|size| size.needed.is_none()) {
        said.push(rest.to_owned());
    }
    if let Some(most) = h.variance_share_at_most {
        said.push(format!(
            "beside what the declared unknowns imitate it accounts for at most {} % of the squared residual",
            short(100.0 * most)
        ));
    }
    said.join("; ")
}

fn told_size(h: &Hypothesis, size: &HypothesisSize) -> Vec<String> {
    let (name, unit) = (&size.parameter, &size.unit);
    let mut said = Vec::new();
    if let (true, Some(value), Some(sigma)) = (h.added, size.value, size.sigma) {
        said.push(format!(
            "{name} = {} +- {}",
            short(value),
            with_unit(sigma, unit)
        ));
    }
    if let Some(d) = size.detectable {
        said.push(format!(
            "{name} = {} would have shown at 5 sigma",
            with_unit(d, unit)
        ));
    }
    let plausible = match (size.needed_is_plausible, size.believed_to) {
        (Some(true), Some(most)) => {
            format!(", plausible: up to {} is believed", with_unit(most, unit))
        }
        (Some(false), Some(most)) => {
            format!(
                ", not plausible: no more than {} is believed",
                with_unit(most, unit)
            )
        }
        _ => String::new(),
    };
    match (size.needed, size.needed_alone) {
        (Some(n), _) => {
            said.push(format!(
                "to explain what is left by itself it would have to be {}{plausible}",
                with_unit(n, unit)
            ));
            // what showed in another way is no question of size
            let showed = h.significant || h.refused.is_some();
            let so = match size.detectable {
                Some(d) if n > d => {
                    "so it is not the cause of what is left: at that size it would have shown"
                }
                _ => "so it could be the cause: this data would not have shown that size",
            };
            said.extend((!showed).then(|| so.to_owned()));
        }
        (None, Some(n)) if h.added => said.push(format!(
            "to explain by itself all that the declared model leaves it would have to be {}{plausible}",
            with_unit(n, unit)
        )),
        _ => {}
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nothing is "beside what was added" where nothing was; what speaks against an effect is said.
    #[test]
    fn the_reason_is_the_true_one() {
        let of = |significant: bool| Hypothesis {
            significant,
            observable: true,
            p_value: Some(0.002),
            ..Hypothesis::default()
        };
        let beside = "beside what was added";
        assert!(finding(&of(true), None, true, "").contains(beside));
        assert!(!finding(&of(true), None, false, "").contains(beside));
        for (significant, others) in [(true, false), (true, true), (false, false), (false, true)] {
            let said = finding(&of(significant), Some("the stars wander"), others, "");
            assert!(said.contains("the stars wander"), "{said}");
            assert!(!said.contains(beside), "{said}");
        }
    }

    /// No chance is told as 0.
    #[test]
    fn the_chance_of_a_large_effect_is_told_by_a_bound() {
        let of = |p: f64| Hypothesis {
            added: true,
            significant: true,
            observable: true,
            p_value: Some(p),
            ..Hypothesis::default()
        };
        assert!(finding(&of(0.0), None, false, "").contains("(p < 1e-300)"));
        assert!(finding(&of(2.4e-9), None, false, "").contains("(p = 2.4e-9)"));
    }

    /// What the search would name is plausible, and what it would refuse is not.
    #[test]
    fn plausible_is_what_is_believed() {
        let said = |needed: f64| {
            let size = HypothesisSize {
                parameter: "offset_s".to_owned(),
                unit: "s".to_owned(),
                needed_alone: Some(needed),
                plausible: Some(0.05),
                believed_to: Some(1.0),
                needed_is_plausible: Some(needed <= 1.0),
                ..HypothesisSize::default()
            };
            let h = Hypothesis {
                added: true,
                observable: true,
                p_value: Some(1e-9),
                sizes: vec![size],
                ..Hypothesis::default()
            };
            finding(&h, None, true, "nothing is left")
        };
        assert!(said(0.3).contains("0.3 s, plausible: up to 1 s is believed"));
        assert!(said(1.4).contains("1.4 s, not plausible: no more than 1 s is believed"));
        assert!(!said(0.3).contains("nothing is left"));
    }
}
