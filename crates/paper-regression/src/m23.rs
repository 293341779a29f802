//! The claims of \[M23\] section 4 and of its Table 1, one file a group.
//!
//! Not physics: a list.

mod bands;
mod calibration;
mod geometry;
mod hybrid_cost;
mod mode;
mod readings;
mod specification;
mod terminal;

pub use hybrid_cost::saving;

use crate::{Group, Inputs, PaperError};

type Claims = fn(&Inputs) -> Result<Group, PaperError>;

/// Groups in the order of the paper.
const GROUPS: [Claims; 7] = [
    specification::group,
    geometry::group,
    readings::group,
    mode::group,
    hybrid_cost::group,
    calibration::group,
    terminal::group,
];

/// All rows of \[M23\].
///
/// # Errors
/// A scenario, a spectrum or a fit that fails: none with the default inputs.
pub fn groups(inputs: &Inputs) -> Result<Vec<Group>, PaperError> {
    GROUPS.iter().map(|group| group(inputs)).collect()
}

/// The boresight fits of section 4.1 alone: what follows from the two sigmas most directly.
///
/// # Errors
/// As [`groups`].
pub fn readings(inputs: &Inputs) -> Result<Group, PaperError> {
    readings::group(inputs)
}

/// Table 1 and section 2.1 alone.
///
/// # Errors
/// As [`groups`].
pub fn specification(inputs: &Inputs) -> Result<Group, PaperError> {
    specification::group(inputs)
}
