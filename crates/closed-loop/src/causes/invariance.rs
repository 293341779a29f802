//! Whether an effect is the same wherever it acts.
//!
//! An effect of the catalogue that truly acts has the same size at all times, on all stars
//! and all over the detector. A cause outside the catalogue that it stands in for has not:
//! stray light that rises pulls on bright stars less than on faint ones, and more every
//! minute. So of each chosen effect, at its estimate, the part that changes with v is
//! fitted beside it ([`crate::causes::changing_effect`]),
//!
//! ```text
//! r = sum_j c_j column_j + g z(v) sum_j c_j column_j
//! ```
//!
//! and beside it also a part g of its own for every star. An effect is not constant if g is
//! beyond chance (all tests of one bundle are paid for) and the part that changes holds at
//! least a tenth of the effect's own square: a third of its size. What a second effect of the
//! catalogue does beside it changes it, too: where the change does not gain more by far than
//! one would, it is not the catalogue that lacks something. And where a description of what is left gains
//! twenty times as much as the change, there is another cause, of which the change is a part: it is judged beside that.
//!
//! Source: Hausman 1978 (an estimate that differs between parts of the data has the wrong
//! model behind it), as a test of an added variable.

use crate::causes::REMAINDER;
use crate::causes::changing_effect::Way;
use crate::causes::description::Described;
use crate::causes::stand_ins::BY_FAR;
use crate::search::selection::columns_of;

/// Chance that any effect of a bundle is called changing although it is constant.
const ALPHA: f64 = 0.003;
/// Least square of what changes, over that of the effect.
const LEAST_SHARE: f64 = 0.1;

/// A chosen effect that is not the same everywhere.
#[derive(Clone, Debug)]
pub(crate) struct Change {
    /// Position among the chosen.
    pub(crate) chosen: usize,
    pub(crate) values: Vec<f64>,
    pub(crate) way: Way,
    pub(crate) p_value: f64,
}

/// The chosen effect that changes most certainly, if one does. No change counts that does not gain more by
/// far than `instead` out of fold, what the best effect of the catalogue beside the chosen would, and the share of
/// what a description does that no effect may lack.
pub(crate) fn changing(described: &Described, instead: f64) -> Option<Change> {
    let groups = &described.fitted.groups;
    let fits = &described.fitted.fits;
    let set = columns_of(groups, &described.chosen);
    let alone = fits.estimate(&set)?;
    let before = fits.out_of_fold(&set)?.total_loglik();
    let left = described.rest().map_or(0.0, |(worth, _)| worth - before);
    let instead = instead.max(REMAINDER * left);
    let tried: usize = described.changes.iter().map(Vec::len).sum();
    let mut worst: Option<Change> = None;
    let mut first = 0;
    for (k, ways) in described.changes.iter().enumerate() {
        let own: Vec<usize> = (first..first + groups[k].columns.len()).collect();
        first += own.len();
        let whole = alone.square(&own)?;
        for (way, columns) in ways {
            // the effect itself is one of the sizes of its stars
            let free = match way {
                Way::With(..) | Way::Bent(..) => columns.len(),
                Way::Star(_) => columns.len().saturating_sub(1),
            };
            let mut with = set.clone();
            with.extend(&columns[..free]);
            let which: Vec<usize> = (set.len()..with.len()).collect();
            let Some(estimate) = fits.estimate(&with).filter(|_| free > 0) else {
                continue;
            };
            let p_value = estimate.p_value(&which) * tried as f64;
            let share = (estimate.square(&which).unwrap_or(0.0) - free as f64) / whole;
            if p_value < ALPHA
                && share > LEAST_SHARE
                && fits
                    .out_of_fold(&with)
                    .is_some_and(|o| o.total_loglik() - before > instead + BY_FAR)
                && worst.as_ref().is_none_or(|w| p_value < w.p_value)
            {
                worst = Some(Change {
                    chosen: k,
                    values: own.iter().map(|&i| alone.value[i]).collect(),
                    way: way.clone(),
                    p_value,
                });
            }
        }
    }
    worst
}
