//! Columns that stand twice are formed once.
//!
//! A wave in the pixel phase is a candidate of its order and one of all orders. Of such a pair the pass
//! takes the larger alone, and the products of the other are copies:
//!
//! ```text
//! c = S d     sum c c^T = S (sum d d^T) S^T     S: rows of the unit matrix, some of them twice
//! ```
//!
//! Not physics: copies.

use effects::Candidate;
use std::sync::Arc;

use super::{Block, pick};
use crate::star::columns::StarColumns;

/// Candidates of which no column is another's, and where all others find theirs.
pub(super) struct Distinct<'a> {
    pub(super) candidates: Vec<&'a dyn Candidate>,
    /// The distinct column that each column of all is.
    of: Vec<usize>,
}

impl<'a> Distinct<'a> {
    /// `None`: no column stands twice.
    pub(super) fn of(columns: &StarColumns<'a>) -> Option<Self> {
        let all = columns.candidates;
        let within: Vec<Option<usize>> = (0..all.len()).map(|c| larger(all, c)).collect();
        if within.iter().all(Option::is_none) {
            return None;
        }
        let (misalignment, shared, directions) = columns.nuisance.parts();
        let nuisance = misalignment + 2 * shared + directions;
        let mut first = vec![0; all.len()];
        let mut candidates = Vec::new();
        let mut end = nuisance;
        for (c, candidate) in all.iter().enumerate().filter(|(c, _)| within[*c].is_none()) {
            first[c] = end;
            end += candidate.coefficients().len();
            candidates.push(*candidate);
        }
        let mut of: Vec<usize> = (0..nuisance).collect();
        for (c, candidate) in all.iter().enumerate() {
            let Some(larger) = within[c] else {
                of.extend(first[c]..first[c] + candidate.coefficients().len());
                continue;
            };
            for coefficient in candidate.coefficients() {
                let place = named(all[larger], &coefficient.name);
                of.extend(place.map(|place| first[larger] + place));
            }
        }
        of.extend(end..end + columns.residuals.len());
        Some(Self { candidates, of })
    }

    /// The products of all columns.
    pub(super) fn spread(&self, block: Block) -> Block {
        Block {
            rest: Arc::new(pick(&block.rest, &self.of)),
            lost: block.lost.as_ref().map(|lost| pick(lost, &self.of)),
            theta: block.theta.select_columns(&self.of),
            ..block
        }
    }
}

/// The candidate in which every column of candidate `c` is found: of several the one of most columns, of
/// these the first. It is in no other itself.
fn larger(all: &[&dyn Candidate], c: usize) -> Option<usize> {
    let rank = |d: usize| (all[d].coefficients().len(), std::cmp::Reverse(d));
    let holds = |d: usize| {
        all[d].columns_by_name()
            && all[d].id() == all[c].id()
            && all[d].selectors() == all[c].selectors()
            && rank(d) > rank(c)
            && all[c]
                .coefficients()
                .iter()
                .all(|coefficient| named(all[d], &coefficient.name).is_some())
    };
    if !all[c].columns_by_name() {
        return None;
    }
    (0..all.len())
        .filter(|d| holds(*d))
        .max_by_key(|d| rank(*d))
}

fn named(candidate: &dyn Candidate, name: &str) -> Option<usize> {
    let mut names = candidate.coefficients().iter();
    names.position(|coefficient| coefficient.name == name)
}
