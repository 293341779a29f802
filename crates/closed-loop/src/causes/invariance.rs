//! Whether an effect is the same wherever it acts.
//!
//! An effect of the catalogue that truly acts has the same size at all times, on all stars
//! and all over the detector. A cause outside the catalogue that it stands in for has not:
//! stray light that rises pulls on bright stars less than on faint ones, and more every
//! minute. So of each chosen effect, at its estimate, the part that changes with v is
//! fitted beside it,
//!
//! ```text
//! r = sum_j c_j column_j + g z(v) sum_j c_j column_j,     z = (v - middle) / half
//!                          g P_2(z(t)) sum_j c_j column_j      the middle of the run against its ends
//! ```
//!
//! and beside it also a part g of its own for every star. An effect is not constant if g is
//! beyond chance (all tests of one bundle are paid for) and the part that changes holds at
//! least a tenth of the effect's own square: a third of its size. What a second effect of the
//! catalogue does beside it changes it, too: where the change does not gain more by far than
//! one would, it is not the catalogue that lacks something.
//!
//! Source: Hausman 1978 (an estimate that differs between parts of the data has the wrong
//! model behind it), as a test of an added variable.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use effects::{AttitudeRows, Candidate, Coefficient, Effect, EffectError, StarRows, Surroundings};
use focal_plane::{Camera, PointsMut, VectorsMut};

use crate::causes::description::Described;
use crate::causes::stand_ins::BY_FAR;
use crate::search::empirical::Variable;
use crate::search::selection::columns_of;
use crate::star::columns::star_columns_of;

/// Chance that any effect of a bundle is called changing although it is constant.
const ALPHA: f64 = 0.003;
/// Least square of what changes, over that of the effect.
const LEAST_SHARE: f64 = 0.1;

/// What an effect may change with.
#[derive(Clone, Debug)]
pub(crate) enum Way {
    /// A variable of one number, and its range.
    With(Variable, [f64; 2]),
    /// The same, in the middle against both ends.
    Bent(Variable, [f64; 2]),
    /// Each star has a size of its own.
    Star(Vec<i64>),
}

impl Way {
    fn columns(&self) -> usize {
        match self {
            Self::With(..) | Self::Bent(..) => 1,
            Self::Star(ids) => ids.len(),
        }
    }
}

/// Lent or owned.
#[derive(Clone, Debug)]
pub(crate) enum Inner<'a> {
    Lent(&'a dyn Candidate),
    Own(Arc<dyn Candidate>),
}

impl Inner<'_> {
    fn get(&self) -> &dyn Candidate {
        match self {
            Self::Lent(candidate) => *candidate,
            Self::Own(candidate) => candidate.as_ref(),
        }
    }
}

/// An effect at its estimate, times how it changes: columns of one way behind those of another.
#[derive(Debug)]
pub(crate) struct Changing<'a> {
    inner: Inner<'a>,
    values: Vec<f64>,
    ways: Vec<Way>,
    coefficients: Vec<Coefficient>,
}

impl<'a> Changing<'a> {
    pub(crate) fn new(inner: Inner<'a>, values: &[f64], ways: Vec<Way>) -> Self {
        let columns = ways.iter().map(Way::columns).sum();
        Self {
            inner,
            values: values.to_vec(),
            coefficients: (0..columns)
                .map(|k| Coefficient::new(format!("g{k}"), "", f64::INFINITY))
                .collect(),
            ways,
        }
    }

    /// The ways, and where the columns of each stand.
    pub(crate) fn ways(&self) -> impl Iterator<Item = (&Way, Range<usize>)> {
        self.ways.iter().scan(0, |end, way| {
            let first = *end;
            *end += way.columns();
            Some((way, first..*end))
        })
    }
}

impl Candidate for Changing<'_> {
    fn id(&self) -> &'static str {
        self.inner.get().id()
    }
    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }
    fn describes(&self) -> bool {
        true
    }
    fn acts_on_stars(&self) -> bool {
        true
    }
    fn acts_on_attitude(&self) -> bool {
        false
    }
    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        let n = rows.len();
        let Some(inner) = star_columns_of(self.inner.get(), camera, rows) else {
            return false;
        };
        let [x, y] = inner.map(|columns| -> Vec<f64> {
            let each = |i: usize| {
                self.values
                    .iter()
                    .enumerate()
                    .map(move |(j, v)| (j * n + i, v))
            };
            (0..n)
                .map(|i| each(i).map(|(at, v)| v * columns[at]).sum())
                .collect()
        });
        out.x.fill(0.0);
        out.y.fill(0.0);
        for (way, columns) in self.ways() {
            let values = match way {
                Way::With(variable, _) | Way::Bent(variable, _) => variable.values(rows),
                Way::Star(_) => Vec::new(),
            };
            for i in 0..n {
                let within = |[low, high]: &[f64; 2]| (2.0 * values[i] - low - high) / (high - low);
                let (k, z) = match way {
                    Way::With(_, range) => (columns.start, within(range)),
                    Way::Bent(_, range) => (columns.start, 1.5 * within(range).powi(2) - 0.5),
                    Way::Star(ids) => match ids.iter().position(|&id| id == rows.star_id[i]) {
                        Some(k) => (columns.start + k, 1.0),
                        None => continue,
                    },
                };
                // where the variable is not known nothing changes
                let z = if z.is_finite() { z } else { 0.0 };
                out.x[k * n + i] = z * x[i];
                out.y[k * n + i] = z * y[i];
            }
        }
        true
    }
    fn attitude_columns(&self, _: &AttitudeRows<'_>, _: VectorsMut<'_>) -> bool {
        false
    }
    fn selectors(&self) -> BTreeMap<String, String> {
        self.inner.get().selectors()
    }
    fn realise(
        &self,
        values: &[f64],
        surroundings: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        self.inner.get().realise(values, surroundings)
    }
}

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
/// far than `instead` out of fold, what the best effect of the catalogue beside the chosen would.
pub(crate) fn changing(described: &Described, instead: f64) -> Option<Change> {
    let groups = &described.fitted.groups;
    let fits = &described.fitted.fits;
    let set = columns_of(groups, &described.chosen);
    let alone = fits.estimate(&set)?;
    let before = fits.out_of_fold(&set)?.total_loglik();
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
