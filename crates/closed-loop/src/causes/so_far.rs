//! What earlier searches leave to the next.
//!
//! Not physics: lists that grow.

use std::sync::Arc;

use block_regression::Folds;
use effects::{Candidate, Surroundings};
use telemetry::report::ConsideredEffect;

use crate::causes::changing_effect::{Changing, Inner};
use crate::causes::description::{Described, Kept, Part};
use crate::causes::invariance::Change;
use crate::causes::rest::{looked_for, whole};
use crate::causes::{Inquiry, Named, Outcome, Standing};
use crate::error::CloseError;
use crate::findings;
use crate::questions::needed::ToExplain;
use crate::search::empirical::Empirical;
use crate::search::refusal::{Refusal, Refused};
use crate::search::{Found, family};
use crate::star::evidence::StarEvidence;
use crate::star::search::{self, Start};

/// What is known when a search begins.
pub(super) struct SoFar {
    pub(super) start: Start,
    pub(super) refused: Refused,
    /// In every fit, described but not named.
    pub(super) kept: Vec<Arc<dyn Candidate>>,
    /// Families of what was found before anything was described.
    pub(super) seen: Vec<String>,
    /// What the first search refused by size alone.
    oversize: Vec<ConsideredEffect>,
    /// Terms that every round must have: beside what is kept they are not found again.
    pub(super) found_terms: Vec<Empirical>,
}

impl SoFar {
    fn new(start: Start) -> Self {
        Self {
            start,
            refused: Refused::new(),
            kept: Vec::new(),
            seen: Vec::new(),
            oversize: Vec::new(),
            found_terms: Vec::new(),
        }
    }

    /// Before the first search.
    pub(super) fn begin(
        white: &StarEvidence<'_>,
        folds: &Folds,
        inquiry: &Inquiry<'_>,
    ) -> Result<Self, CloseError> {
        let alone = white.data.free_attitude || white.residuals.len() != 1;
        let start = if alone {
            Start::White
        } else {
            search::start(white, folds, &inquiry.reference)?
        };
        Ok(Self::new(start))
    }

    pub(super) fn may_be_named(&self, candidates: &[Arc<dyn Candidate>]) -> Vec<bool> {
        candidates
            .iter()
            .map(|c| !self.refused.contains_key(&family(c.as_ref())))
            .collect()
    }

    /// Remembers what search `number` found beside no description.
    pub(super) fn see(&mut self, found: &Found, number: usize, surroundings: &Surroundings<'_>) {
        if self.kept.is_empty() {
            self.seen.extend(found.chosen().map(family));
        }
        if number == 0 {
            let nothing = ToExplain::NOTHING;
            self.oversize = findings::considered(found, &nothing, &Refused::new(), surroundings);
            self.oversize.retain(|c| c.refused.is_some());
        }
    }

    /// These `terms`, those that were `sought` this time, and those found before.
    pub(super) fn with_found(
        &self,
        mut terms: Vec<Empirical>,
        sought: &[Empirical],
    ) -> Vec<Empirical> {
        terms.extend(sought.iter().chain(&self.found_terms).cloned());
        terms
    }

    /// Refuses `families`; whether there are any.
    pub(super) fn refuse(&mut self, families: Vec<String>, why: &Refusal) -> bool {
        let any = !families.is_empty();
        self.refused
            .extend(families.into_iter().map(|f| (f, why.clone())));
        any
    }

    /// Whether any effect had been refused for a slow error of the reference: that is none, and they may be
    /// named again.
    pub(super) fn reinstates(&mut self) -> bool {
        let before = self.refused.len();
        self.refused.retain(|_, why| *why != Refusal::Wander);
        self.refused.len() < before
    }

    /// Refuses those of the chosen that stand in these `places`, without another search.
    pub(super) fn take_out(&mut self, found: &mut Found, places: &[usize], why: &Refusal) {
        let chosen = found.selection.chosen.clone();
        for &k in places {
            let g = chosen[k];
            let family = family(found.candidates[g].as_ref());
            self.refused.insert(family, why.clone());
            found.selection.chosen.retain(|c| *c != g);
        }
    }

    /// Keeps these parts as terms for every fit from now on; those that were looked for are not found beside
    /// themselves.
    pub(super) fn keep_whole(&mut self, described: &Described, parts: Vec<Part>) {
        self.found_terms.extend(looked_for(described, &parts));
        self.kept.extend(whole(described, parts));
    }

    /// Refuses the effect that changes, and keeps it and its change for every fit from now on.
    pub(super) fn keep_changing(&mut self, found: &Found, change: Change) {
        let g = found.selection.chosen[change.chosen];
        let effect = Arc::clone(&found.candidates[g]);
        self.refused
            .insert(family(effect.as_ref()), Refusal::Change(change.way.name()));
        let columns = found.own_columns(g);
        let mut values = vec![0.0; effect.coefficients().len()];
        for (&column, value) in columns.iter().zip(&change.values) {
            values[column] = *value;
        }
        let own = Changing::new(Inner::Own(Arc::clone(&effect)), &values, vec![change.way]);
        self.kept.push(Arc::new(Kept::new(effect, columns)));
        self.kept.push(Arc::new(own));
    }

    /// The end of all searches.
    pub(super) fn named(self, standing: Standing<'_>) -> Outcome<'_> {
        Outcome::Named(Box::new(Named {
            searched: standing.searched,
            described: standing.described,
            inside: standing.inside,
            slow: standing.slow,
            keeps: !self.kept.is_empty(),
            oversize: self.oversize,
            refused: self.refused,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Only what a slow error of the reference had taken the place of comes back, and once.
    #[test]
    fn what_was_refused_for_a_wander_may_be_named_again() {
        let mut so_far = SoFar::new(Start::White);
        so_far.refuse(vec!["step_misalignment".to_owned()], &Refusal::Wander);
        so_far.refuse(vec!["catalogue_position/7".to_owned()], &Refusal::Pile);
        assert!(so_far.reinstates());
        let left: Vec<&String> = so_far.refused.keys().collect();
        assert_eq!(left, ["catalogue_position/7"]);
        assert!(!so_far.reinstates(), "nothing else was refused for it");
    }
}
