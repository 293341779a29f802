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

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::folds::Folds;

/// Scalars handed to the matrix product at once: large enough that the product
/// dominates, small enough to stay in cache.
const CHUNK_FRAMES: usize = 32;

/// A source of design rows: scalars (one per axis of a measurement) by columns.
pub(crate) trait Design: Sync {
    /// Columns of each row: nuisance, then candidates, then residuals.
    fn width(&self) -> usize;
    /// Writes the scalars of `frames` into `out`, resized by the callee to
    /// scalars x [`width`](Self::width), and returns how many of them count: a
    /// masked scalar is a row of zeros.
    fn fill(&self, frames: Range<usize>, out: &mut DMatrix<f64>) -> usize;
}

/// Gram matrices per block.
#[derive(Clone, Debug)]
pub(crate) struct BlockGrams {
    /// One width x width matrix a block.
    pub(crate) gram: Vec<DMatrix<f64>>,
    /// How many scalars each block holds.
    pub(crate) scalars: Vec<f64>,
    /// What the log-likelihood of the scalars lacks to that of the measurements in
    /// arcsec, nats.
    pub(crate) log_scale: f64,
}

impl BlockGrams {
    /// One pass over `design`.
    pub(crate) fn accumulate(design: &dyn Design, folds: &Folds) -> Self {
        let width = design.width();
        let blocks = folds.blocks.par_iter().map(|block| {
            let mut gram = DMatrix::zeros(width, width);
            let mut rows = DMatrix::zeros(0, width);
            let mut scalars = 0;
            let mut at = block.start;
            while at < block.end {
                let end = (at + CHUNK_FRAMES).min(block.end);
                scalars += design.fill(at..end, &mut rows);
                gram.gemm(1.0, &rows.transpose(), &rows, 1.0);
                at = end;
            }
            (gram, scalars as f64)
        });
        let (gram, scalars) = blocks.unzip();
        Self {
            gram,
            scalars,
            log_scale: 0.0,
        }
    }

    /// The sum over the blocks for which `wanted` is true.
    pub(crate) fn sum(&self, wanted: impl Fn(usize) -> bool) -> (DMatrix<f64>, f64) {
        let width = self.gram[0].nrows();
        let mut gram = DMatrix::zeros(width, width);
        let mut scalars = 0.0;
        for b in (0..self.gram.len()).filter(|&b| wanted(b)) {
            gram += &self.gram[b];
            scalars += self.scalars[b];
        }
        (gram, scalars)
    }
}
