//! An effect that changes with something, as columns beside those of the effect itself.
//!
//! ```text
//! z(v) sum_j c_j column_j             z = (v - middle) / half, c: the effect's estimate
//! P_2(z(t)) sum_j c_j column_j        the middle of the run against its ends
//! [star = s] sum_j c_j column_j       a size of its own for every star
//! ```
//!
//! Source: the derivative of an effect by its size, where that is a function of v; Legendre's `P_2`.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use effects::{AttitudeRows, Candidate, Coefficient, Effect, EffectError, StarRows, Surroundings};
use focal_plane::{Camera, PointsMut, VectorsMut};

use crate::search::empirical::Variable;
use crate::star::columns::star_columns_of;

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
    /// The name in the report of what it goes with.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::With(variable, _) | Self::Bent(variable, _) => variable.name(),
            Self::Star(ids) => Variable::Star(ids.clone()).name(),
        }
    }

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
#[derive(Clone, Debug)]
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
