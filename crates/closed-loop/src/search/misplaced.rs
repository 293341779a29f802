//! How many stars a catalogue may misplace.
//!
//! Double stars and wrong motions are one in some hundred, so that three among a dozen share another cause. What is
//! beyond that is refused ([`crate::causes`]), whatever else is found, and a search that went on would take as long
//! as there are stars.
//!
//! Not physics: a count.

use crate::search::selection::Group;

/// The effect on a single star.
pub(crate) const MISPLACED: &str = "catalogue_position";
/// So many are believed in any case, and one of so many stars.
const MOST: usize = 2;
const ONE_OF: usize = 20;

/// How many of so many stars a catalogue may misplace.
pub(crate) fn most_misplaced(stars: usize) -> usize {
    MOST.max(stars / ONE_OF)
}

/// Whether more are misplaced among `chosen`; a group may stand for several stars that were not tried.
pub(super) fn piled(groups: &[Group], chosen: &[usize]) -> bool {
    let misplaced = |g: &Group| g.kind == MISPLACED;
    let stars: f64 = (groups.iter().filter(|g| misplaced(g)))
        .map(|g| g.stands_for)
        .sum();
    let count = chosen.iter().filter(|&&g| misplaced(&groups[g])).count();
    count as f64 > (stars / ONE_OF as f64).max(MOST as f64)
}
