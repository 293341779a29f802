//! Forms of one effect are made linear at one place.
//!
//! Not physics: bookkeeping.

use std::sync::Arc;

use effects::Candidate;

/// Makes the other forms of candidate `g` linear where it is: else what is bent would speak for it against each.
pub(crate) fn along(candidates: &mut [Arc<dyn Candidate>], g: usize) {
    let (id, about) = (candidates[g].id(), candidates[g].linear_about());
    if about.is_empty() {
        return;
    }
    for (_, other) in candidates
        .iter_mut()
        .enumerate()
        .filter(|(h, c)| *h != g && c.id() == id)
    {
        if let Some(moved) = other.beside_form(&about) {
            *other = moved.into();
        }
    }
}
