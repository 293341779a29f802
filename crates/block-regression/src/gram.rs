//! Normal equations, accumulated in one pass, block by block.
//!
//! ```text
//! G_b = sum over the scalars of block b of c c^T,   c = [ nuisance | candidates | residuals ]
//! ```
//!
//! Everything that selection asks afterwards (a fit on four folds, the squared
//! error on the fifth, a cluster-robust variance) is algebra on these matrices,
//! so that the data is read once however many sets of effects are tried. The
//! blocks are summed in parallel, each in its own order: the result does not
//! depend on the number of threads.
//!
//! Not physics: linear least squares.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::folds::Folds;
use crate::symmetric::Symmetric;

/// Scalars handed to the matrix product at once: large enough that the product
/// dominates, small enough to stay in cache.
const CHUNK_FRAMES: usize = 32;

/// A source of design rows: scalars (one per axis of a measurement) by columns.
pub trait Design: Sync {
    /// Columns of each row: nuisance, then candidates, then residuals.
    fn width(&self) -> usize;
    /// Writes the scalars of `frames` into `out`, resized by the callee to
    /// scalars x [`width`](Self::width), and returns how many of them count: a
    /// masked scalar is a row of zeros.
    fn fill(&self, frames: Range<usize>, out: &mut DMatrix<f64>) -> usize;
}

/// A table in memory: one scalar a frame, a row each.
impl Design for DMatrix<f64> {
    fn width(&self) -> usize {
        self.ncols()
    }
    fn fill(&self, frames: Range<usize>, out: &mut DMatrix<f64>) -> usize {
        *out = self.rows(frames.start, frames.len()).into_owned();
        frames.len()
    }
}

/// The Gram matrix of one block,
///
/// ```text
/// G = weight M + E^T E
/// ```
///
/// with a matrix M that fits at several noises share, and a few rows E that are one noise's own.
#[derive(Clone, Debug)]
pub struct Gram {
    weight: f64,
    shared: Arc<Symmetric>,
    rows: Arc<DMatrix<f64>>,
}

impl Gram {
    /// `weight * shared + rows^T rows`; `shared` is width x width, and `rows` any number x width.
    pub fn new(weight: f64, shared: Arc<Symmetric>, rows: DMatrix<f64>) -> Self {
        Self {
            weight,
            shared,
            rows: Arc::new(rows),
        }
    }

    /// A matrix as it is, width x width.
    pub fn whole(shared: impl Into<Arc<Symmetric>>) -> Self {
        let shared = shared.into();
        let rows = DMatrix::zeros(0, shared.size());
        Self::new(1.0, shared, rows)
    }

    pub(crate) fn at(&self, i: usize, j: usize) -> f64 {
        self.weight * self.shared.at(i, j) + self.rows.column(i).dot(&self.rows.column(j))
    }

    /// Products of each of `columns` with column `last` less `beta` times the columns.
    pub(crate) fn less(
        &self,
        last: usize,
        columns: &[usize],
        beta: &DVector<f64>,
        out: &mut DVector<f64>,
    ) {
        let mut left = self.rows.column(last).into_owned();
        for (&c, b) in columns.iter().zip(beta.iter()) {
            left.axpy(-b, &self.rows.column(c), 1.0);
        }
        for (&row, out) in columns.iter().zip(out.iter_mut()) {
            let own = |c: usize| self.shared.at(row, c);
            let each = columns.iter().zip(beta.iter());
            let shared = own(last) - each.map(|(&c, b)| own(c) * b).sum::<f64>();
            *out = self.weight * shared + self.rows.column(row).dot(&left);
        }
    }

    /// `z^T G z`.
    pub(crate) fn quadratic(&self, z: &DVector<f64>) -> f64 {
        let own = (&*self.rows * z).norm_squared();
        self.weight * self.shared.quadratic(z) + own
    }

    /// `G_n W - 2 G_nc` with the first columns n and the columns c.
    pub(crate) fn inner(&self, w: &DMatrix<f64>, columns: &[usize]) -> DMatrix<f64> {
        let n = w.nrows();
        let mut out = self.shared.first_rows(n, columns, -2.0 * self.weight);
        self.shared.add_first_times(self.weight, w, &mut out);
        if self.rows.nrows() > 0 {
            let first = self.rows.columns(0, n);
            let mut left = self.rows.select_columns(columns);
            left.gemm(1.0, &first, w, -2.0);
            out.gemm(1.0, &first.transpose(), &left, 1.0);
        }
        out
    }

    /// Adds it, M only where that is not `known`.
    fn add_to(&self, sum: &mut Symmetric, known: bool) {
        if !known {
            sum.add(self.weight, &self.shared);
        }
        if self.rows.nrows() > 0 {
            sum.add_products(1.0, &self.rows);
        }
    }
}

/// Gram matrices per block.
#[derive(Clone, Debug)]
pub struct BlockGrams {
    /// One a block, width x width.
    pub gram: Vec<Gram>,
    /// How many scalars each block holds.
    pub scalars: Vec<f64>,
    /// What the log-likelihood of the scalars lacks to that of the measurements in their own unit, nats: scalars
    /// may have been whitened. No fit uses it.
    pub log_scale: f64,
    /// Where it is known, the sum of M over the blocks of each fold; the weight is then the same in all blocks.
    pub known: Option<Arc<Vec<Symmetric>>>,
    /// The same in all, cut by what was measured and not by when: parts whose noise is each its own however long it
    /// lasts. None where the data is not cut so.
    pub by_source: Vec<Gram>,
}

/// Sums of Gram matrices and scalars over the blocks of each fold, and over all.
#[derive(Clone, Debug)]
pub struct FoldSums {
    /// Gram matrix and number of scalars of each fold.
    pub fold: Vec<(DMatrix<f64>, f64)>,
    /// The same of all folds.
    pub all: (DMatrix<f64>, f64),
}

impl FoldSums {
    /// The sum over all folds but one: a sum, not a difference, so that a column which lives in that fold
    /// alone is exactly nothing.
    pub(crate) fn without(&self, fold: usize) -> (DMatrix<f64>, f64) {
        let others = self.fold.iter().enumerate().filter(|(f, _)| *f != fold);
        sum(self.all.0.nrows(), others.map(|(_, s)| s))
    }
}

fn sum<'a>(
    width: usize,
    parts: impl Iterator<Item = &'a (DMatrix<f64>, f64)>,
) -> (DMatrix<f64>, f64) {
    let mut out = (DMatrix::zeros(width, width), 0.0);
    for (gram, scalars) in parts {
        out.0 += gram;
        out.1 += scalars;
    }
    out
}

impl BlockGrams {
    /// One block that is there already, in the unit of the measurements.
    pub fn whole(gram: Symmetric, scalars: f64) -> Self {
        Self {
            gram: vec![Gram::whole(gram)],
            scalars: vec![scalars],
            log_scale: 0.0,
            known: None,
            by_source: Vec::new(),
        }
    }

    /// One pass over `design`, blocks in parallel.
    pub fn accumulate(design: &dyn Design, folds: &Folds) -> Self {
        let width = design.width();
        let blocks = folds.blocks.par_iter().map(|block| {
            let mut gram = Symmetric::zeros(width);
            let mut rows = DMatrix::zeros(0, width);
            let mut scalars = 0;
            let mut at = block.start;
            while at < block.end {
                let end = (at + CHUNK_FRAMES).min(block.end);
                scalars += design.fill(at..end, &mut rows);
                gram.add_products(1.0, &rows);
                at = end;
            }
            (Gram::whole(gram), scalars as f64)
        });
        let (gram, scalars) = blocks.unzip();
        Self {
            gram,
            scalars,
            log_scale: 0.0,
            known: None,
            by_source: Vec::new(),
        }
    }

    fn width(&self) -> usize {
        self.gram.first().map_or(0, |g| g.shared.size())
    }

    /// The sums over the folds.
    pub fn by_fold(&self, folds: &Folds) -> FoldSums {
        let of = &folds.fold_of_block;
        let fold: Vec<_> = (0..folds.count)
            .into_par_iter()
            .map(|f| {
                let known = self.known.as_ref().map(|known| &known[f]);
                self.sum(|b| of[b] == f, known)
            })
            .collect();
        FoldSums {
            all: sum(self.width(), fold.iter()),
            fold,
        }
    }

    /// The same summed over all blocks, as one.
    #[must_use]
    pub fn in_all(&self, folds: &Folds) -> Self {
        let (gram, scalars) = self.by_fold(folds).all;
        Self {
            log_scale: self.log_scale,
            ..Self::whole(Symmetric::of_lower(&gram), scalars)
        }
    }

    /// The sum over all blocks.
    pub fn total(&self) -> (DMatrix<f64>, f64) {
        self.sum(|_| true, None)
    }

    /// The sum over the blocks for which `wanted` is true, over which the sum of M may be `known`.
    fn sum(
        &self,
        wanted: impl Fn(usize) -> bool,
        known: Option<&Symmetric>,
    ) -> (DMatrix<f64>, f64) {
        let mut gram = Symmetric::zeros(self.width());
        if let (Some(known), Some(first)) = (known, self.gram.first()) {
            // the blocks are of one noise
            gram.add(first.weight, known);
        }
        let mut scalars = 0.0;
        for b in (0..self.gram.len()).filter(|&b| wanted(b)) {
            self.gram[b].add_to(&mut gram, known.is_some());
            scalars += self.scalars[b];
        }
        (DMatrix::from(&gram), scalars)
    }
}
