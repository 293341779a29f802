//! One search of the inquiry, beside what is kept.
//!
//! Not physics: what a search was given, and what came of it.

use block_regression::Folds;
use effects::Candidate;

use crate::causes::Inquiry;
use crate::causes::commonness::{self, Slow};
use crate::error::CloseError;
use crate::search::Found;
use crate::search::group::open_beside;
use crate::search::orbits::is_too_fast;
use crate::search::selection::costs;
use crate::star::evidence::StarEvidence;
use crate::star::landing::Elsewhere;
use crate::star::search::Searched;

/// A search that was made.
pub(super) struct Round<'r, 'a> {
    pub(super) white: &'r StarEvidence<'a>,
    /// The same with what is kept.
    pub(super) beside: StarEvidence<'a>,
    pub(super) folds: &'r Folds,
    pub(super) inquiry: &'r Inquiry<'r>,
    /// Whether its outcome is taken as it is.
    pub(super) last: bool,
    /// Which candidates may be named.
    pub(super) may: Vec<bool>,
    /// Candidates that a slow error of the reference outdoes.
    pub(super) outdone: Vec<usize>,
    pub(super) searched: Searched<'a>,
}

impl<'a> Round<'_, 'a> {
    /// What the outcome was fitted to.
    pub(super) fn level(&self) -> &StarEvidence<'a> {
        self.searched.evidence.as_ref().unwrap_or(&self.beside)
    }

    /// The effect in this place among the chosen.
    pub(super) fn chosen(&self, place: usize) -> &dyn Candidate {
        let found = &self.searched.found;
        found.candidates[found.selection.chosen[place]].as_ref()
    }

    /// Whether that is an orbit that nature does not have.
    pub(super) fn is_too_fast(&self, place: usize) -> bool {
        is_too_fast(self.chosen(place), &self.inquiry.surroundings)
    }

    /// Where what was found takes the light, if the inquiry is to follow it.
    pub(super) fn elsewhere(&self) -> Result<Option<Box<Elsewhere>>, CloseError> {
        let choice = self.searched.found.choice();
        match self.inquiry.lands.filter(|_| choice.moves_light()) {
            Some(phase) => Elsewhere::of(self.level(), self.folds, choice, phase),
            None => Ok(None),
        }
    }

    /// The slow error that was found, if it is not the reference's; `inside`: what is left in sample.
    pub(super) fn slow_of_stars(&self, inside: Option<&[Vec<f64>]>) -> Option<Slow> {
        let wander = self.searched.wander.as_ref()?;
        let axes = wander.axes();
        let claimed = (0..3).filter(|&a| axes[a]);
        let tau_s = claimed
            .map(|a| wander.noise.reference[a].tau_s)
            .fold(0.0, f64::max);
        let slow = commonness::slow(self.level().data, inside?, axes, tau_s)?;
        Some(slow).filter(Slow::is_of_the_stars)
    }

    /// What having looked for each chosen effect among those that may be named costs, nats.
    pub(super) fn paid(&self) -> Vec<f64> {
        let found = &self.searched.found;
        let cost = costs(&found.fitted.groups, &self.may);
        let chosen = found.selection.chosen.iter();
        chosen.map(|&g| cost[g].ln()).collect()
    }
}

/// What the best effect that `may` be named would gain out of fold beside the chosen.
pub(super) fn best_beside(found: &Found, may: &[bool]) -> f64 {
    let groups = &found.fitted.groups;
    let chosen = &found.selection.chosen;
    let new = |g: usize| open_beside(groups, chosen, g);
    let judged = found.selection.judged.iter().zip(may).enumerate();
    let open = judged.filter(|(g, (j, may))| **may && j.credible && j.observable && new(*g));
    open.map(|(_, (j, _))| j.delta_loglik).fold(0.0, f64::max)
}
