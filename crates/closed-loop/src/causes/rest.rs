//! What is left beside the effects that were chosen: its best description, and that as terms for every fit.
//!
//! Not physics: which terms.

use std::sync::Arc;

use effects::Candidate;

use crate::causes::description::{Described, Kept, Part};
use crate::causes::stand_ins::describe;
use crate::search::empirical::Empirical;
use crate::search::refusal::{Refusal, Refused};
use crate::search::selection::columns_of;

/// The effect that bends the camera with a channel.
const HEATER: &str = "thermal_misalignment";

/// Terms for every fit from now on, and what bends as well.
pub(super) fn whole(described: &Described, parts: Vec<Part>) -> Vec<Arc<dyn Candidate>> {
    let mut kept: Vec<Arc<dyn Candidate>> = Vec::new();
    for (term, part) in parts {
        let term = &described.terms[term].term;
        let columns = term.bending(&part);
        kept.push(Arc::new(Kept::new(Arc::new(term.clone()), columns)));
    }
    kept
}

impl Described {
    /// What describes best what is left beside the chosen effects, and its likelihood after all prices, if anything
    /// does.
    pub(super) fn rest(&self) -> Option<&(f64, Vec<Part>)> {
        let set = || columns_of(&self.fitted.groups, &self.chosen);
        self.rest.get_or_init(|| describe(self, &set())).as_ref()
    }

    /// What else than the time does of that, first.
    pub(super) fn left(&self) -> Option<Vec<Part>> {
        self.rest().map(|(_, parts)| self.before_time(parts))
    }

    /// All of it as terms; none where nothing does.
    pub(crate) fn terms_left(&self) -> Vec<Arc<dyn Candidate>> {
        self.terms_left_that(|_| true)
    }

    /// The same without what stands at an instant or a place that was looked for.
    pub(crate) fn smooth_terms_left(&self) -> Vec<Arc<dyn Candidate>> {
        self.terms_left_that(|term| !term.is_looked_for())
    }

    fn terms_left_that(&self, may: impl Fn(&Empirical) -> bool) -> Vec<Arc<dyn Candidate>> {
        let parts = self.rest().into_iter().flat_map(|(_, parts)| parts);
        let parts = parts.filter(|(k, _)| may(&self.terms[*k].term));
        whole(self, parts.cloned().collect())
    }

    /// Whether these are of the time alone.
    pub(super) fn is_of_time(&self, parts: &[Part]) -> bool {
        parts.iter().all(|(k, _)| self.terms[*k].term.is_of_time())
    }

    /// Whether these are of housekeeping channels alone, with which a heater bends the camera.
    pub(super) fn is_of_channels(&self, parts: &[Part]) -> bool {
        let channel = |(k, _): &Part| self.terms[*k].term.is_of_channel();
        parts.iter().all(channel)
    }

    /// Whether one of these channels, which are all there is, is that of a heater that was refused for a slow error of the
    /// reference.
    pub(super) fn is_of_heaters(&self, parts: &[Part], refused: &Refused) -> bool {
        let heater = |(k, _): &Part| {
            let channel = self.terms[*k].term.channel_name();
            let family = channel.map(|channel| format!("{HEATER}/{channel}"));
            family.is_some_and(|family| refused.get(&family) == Some(&Refusal::Wander))
        };
        self.is_of_channels(parts) && parts.iter().any(heater)
    }

    /// `parts` but for the time, where that is not alone: a step looks like it, and is looked for beside the others.
    pub(super) fn before_time(&self, parts: &[Part]) -> Vec<Part> {
        let alone = self.is_of_time(parts);
        let first = |(k, _): &&Part| alone || !self.terms[*k].term.is_of_time();
        parts.iter().filter(first).cloned().collect()
    }
}

/// The terms of a description that were looked for.
pub(super) fn looked_for(described: &Described, parts: &[Part]) -> Vec<Empirical> {
    let terms = parts.iter().map(|(k, _)| &described.terms[*k].term);
    terms.filter(|t| t.is_looked_for()).cloned().collect()
}
