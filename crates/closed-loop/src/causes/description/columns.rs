//! The columns of a description.
//!
//! Not physics: which columns stand beside which.

use std::ops::Range;
use std::sync::OnceLock;

use block_regression::{BlockGrams, Folds};
use effects::Candidate;

use crate::causes::changing_effect::{Changing, Inner, Way};
use crate::causes::description::{Described, Term};
use crate::error::CloseError;
use crate::search::empirical::Empirical;
use crate::search::selection::costs;
use crate::search::{Found, fit_grams_beside};
use crate::star::evidence::StarEvidence;

/// A term, and in which of two descriptions it is ([`Described::twice`]).
#[derive(Debug)]
pub(crate) struct InTwo {
    pub(crate) term: Empirical,
    pub(crate) is_in: [bool; 2],
}

/// The columns of a description: what was chosen, how it may change, and the terms.
pub(super) struct Columns<'f> {
    found: &'f Found,
    chosen: Vec<&'f dyn Candidate>,
    changing: Vec<Changing<'f>>,
    terms: Vec<Empirical>,
}

impl<'f> Columns<'f> {
    pub(super) fn of(found: &'f Found, terms: Vec<Empirical>, ways: &[Way]) -> Self {
        let only = found.only(&found.selection.chosen);
        let mut changing = Vec::new();
        if let Some(estimate) = found.estimate() {
            let values = only.spread(&estimate.value);
            let mut first = 0;
            for candidate in &only.candidates {
                let end = first + candidate.coefficients().len();
                let own = &values.as_slice()[first..end];
                first = end;
                changing.push(Changing::new(Inner::Lent(*candidate), own, ways.to_vec()));
            }
        }
        Self {
            found,
            chosen: only.candidates,
            changing,
            terms,
        }
    }

    pub(super) fn candidates(&self) -> Vec<&dyn Candidate> {
        let mut all: Vec<&dyn Candidate> = self.chosen.clone();
        all.extend(self.changing.iter().map(|c| c as &dyn Candidate));
        all.extend(self.terms.iter().map(|t| t as &dyn Candidate));
        all
    }

    /// Those of one of two descriptions, of which the first alone has changes, and where its columns stand among these.
    pub(super) fn part(&self, is_in: &[[bool; 2]], which: usize) -> (Self, Vec<usize>) {
        let changes = self.changes();
        let (changing, before) = match which {
            0 => (self.changing.clone(), changes.end),
            _ => (Vec::new(), changes.start),
        };
        let mut at = changes.end;
        let mut places: Vec<usize> = (0..before).collect();
        let mut terms = Vec::new();
        for (term, is_in) in self.terms.iter().zip(is_in) {
            let end = at + term.coefficients().len();
            if is_in[which] {
                places.extend(at..end);
                terms.push(term.clone());
            }
            at = end;
        }
        let part = Self {
            found: self.found,
            chosen: self.chosen.clone(),
            changing,
            terms,
        };
        (part, places)
    }

    /// Where the columns of the changes stand.
    fn changes(&self) -> Range<usize> {
        let start = self.chosen.iter().map(|c| c.coefficients().len()).sum();
        let changes: usize = self.changing.iter().map(|c| c.coefficients().len()).sum();
        start..start + changes
    }

    /// The description that these products give.
    pub(super) fn described(
        self,
        evidence: &StarEvidence<'_>,
        folds: &Folds,
        grams: &BlockGrams,
    ) -> Result<Described, CloseError> {
        let n = self.chosen.len();
        let own: Vec<usize> = (0..n).collect();
        let all = self.candidates();
        let fitted = fit_grams_beside(evidence, grams, folds, &all, &own)?;
        let mut first = self.changes().start;
        let mut changes = vec![Vec::new(); n];
        for (k, changing) in self.changing.iter().enumerate() {
            let seen = &fitted.groups[n + k].columns;
            for (way, columns) in changing.ways() {
                let own = first + columns.start..first + columns.end;
                let columns: Vec<usize> = own.filter(|c| seen.contains(c)).collect();
                if !columns.is_empty() {
                    changes[k].push((way.clone(), columns));
                }
            }
            first += changing.coefficients().len();
        }
        let groups = &fitted.groups[n + self.changing.len()..];
        let mut terms = Vec::new();
        for (term, group) in self.terms.into_iter().zip(groups) {
            let mut parts: Vec<Vec<usize>> = Vec::new();
            for part in term.parts() {
                let part: Vec<usize> = part
                    .into_iter()
                    .map(|k| first + k)
                    .filter(|c| group.columns.contains(c))
                    .collect();
                if !part.is_empty() && !parts.contains(&part) {
                    parts.push(part);
                }
            }
            let own = first;
            first += term.coefficients().len();
            terms.push(Term {
                term,
                first: own,
                parts,
                group: group.clone(),
            });
        }
        let chosen = || self.chosen.iter();
        let channel = |c: &&dyn Candidate| c.selectors().get("channel").cloned();
        let groups = &self.found.fitted.groups;
        let costs = costs(groups, &vec![true; groups.len()]);
        let paid = self.found.selection.chosen.iter().map(|&g| costs[g].ln());
        Ok(Described {
            chosen: own,
            terms,
            changes,
            names: chosen().map(|c| c.id()).collect(),
            channels: chosen().map(channel).collect(),
            turns: chosen().map(|c| c.acts_on_attitude()).collect(),
            paid: paid.collect(),
            fitted,
            rest: OnceLock::new(),
        })
    }
}
