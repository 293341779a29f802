//! What the search starts from: every effect of the catalogue.
//!
//! Not physics: a list.

use std::sync::Arc;

use effects::{Candidate, Scene};

/// Candidates of every effect of the catalogue that the scene allows.
pub(crate) fn candidates(scene: &Scene<'_>) -> Vec<Arc<dyn Candidate>> {
    effects::catalogue()
        .iter()
        .flat_map(|kind| kind.candidates(scene))
        .map(Arc::from)
        .collect()
}
