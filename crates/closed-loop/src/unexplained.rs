//! What is left when every effect is found: described, as no effect explains it.
//!
//! ```text
//! leftover        lines and jumps in time, of what all rows of a frame share
//! star_series     lines and steps in time, of each star by itself
//! star_freedom    how many numbers those stars tell
//! pattern         a wave on the detector, of any direction and pitch, or rings about the boresight
//! ```
//!
//! What it follows among the measured variables is described while causes are named
//! ([`crate::causes`]).
//!
//! Every search may find something where nothing is left, so that they share the chance of it: the three of
//! what rows follow, of waves on the detector, and of lines and jumps have a quarter each, and all of the stars'
//! own wanders, lines and steps and of what the noise follows have the rest.
//!
//! Not physics: the contents of a folder.

use crate::search::selection::FAMILY_ALPHA;

mod around;
mod grid;
pub(crate) mod leftover;
pub(crate) mod pattern;
mod star_freedom;
pub(crate) mod star_series;

/// Chance that one of the larger searches tells something that is not left.
pub(crate) const SEARCH_ALPHA: f64 = FAMILY_ALPHA / 4.0;
