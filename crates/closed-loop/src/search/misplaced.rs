//! How many stars a catalogue may misplace.
//!
//! Double stars and wrong motions are one in some hundred, so that three among a dozen share another cause. What is
//! beyond that is refused ([`crate::causes`]), whatever else is found, and a search that went on would take as long
//! as there are stars.
//!
//! Not physics: a count.

use crate::search::group::Group;

/// The effect on a single star.
pub(crate) const MISPLACED: &str = "catalogue_position";
/// So many are believed in any case, and one of so many stars.
const MOST: f64 = 2.0;
const ONE_OF: f64 = 20.0;

/// Whether more of so many `stars` are misplaced among `chosen` than a catalogue misplaces.
pub(crate) fn piled(groups: &[Group], chosen: &[usize], stars: f64) -> bool {
    let count = chosen.iter().filter(|&&g| groups[g].kind == MISPLACED);
    count.count() as f64 > (stars / ONE_OF).max(MOST)
}

/// Stars that the groups stand for: one may for several that were not tried.
pub(super) fn stars_of(groups: &[Group]) -> f64 {
    let misplaced = groups.iter().filter(|g| g.kind == MISPLACED);
    misplaced.map(|g| g.stands_for).sum()
}
