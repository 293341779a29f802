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
//! A design that filters its columns carries states from frame to frame. Each block
//! is filtered from zero states and, as further columns, from unit ones; the filter
//! is linear, so that what the block before left enters afterwards, exactly:
//!
//! ```text
//! rows(M) = rows(0) + rows_s M      G(M) = [I; M]^T G [I; M]      M' = E + E_s M
//! ```
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
    /// States carried from one frame to the next.
    fn states(&self) -> usize {
        0
    }
    /// As [`fill`](Self::fill) with [`states`](Self::states) further columns, which
    /// start from one unit state each, going on from `state` (states x columns).
    fn fill_from(
        &self,
        frames: Range<usize>,
        state: &mut DMatrix<f64>,
        out: &mut DMatrix<f64>,
    ) -> usize {
        debug_assert!(state.is_empty(), "a design with states fills from them");
        self.fill(frames, out)
    }
}

/// Gram matrices per block.
#[derive(Clone, Debug)]
pub(crate) struct BlockGrams {
    /// One width x width matrix a block.
    pub(crate) gram: Vec<DMatrix<f64>>,
    /// How many scalars each block holds.
    pub(crate) scalars: Vec<f64>,
}

impl BlockGrams {
    /// One pass over `design`.
    pub(crate) fn accumulate(design: &dyn Design, folds: &Folds) -> Self {
        let (width, states) = (design.width(), design.states());
        let blocks: Vec<(DMatrix<f64>, DMatrix<f64>, f64)> = folds
            .blocks
            .par_iter()
            .map(|block| {
                let mut gram = DMatrix::zeros(width + states, width + states);
                let mut rows = DMatrix::zeros(0, width + states);
                let mut state = DMatrix::zeros(states, width + states);
                state.columns_mut(width, states).fill_with_identity();
                let mut scalars = 0;
                let mut at = block.start;
                while at < block.end {
                    let end = (at + CHUNK_FRAMES).min(block.end);
                    scalars += design.fill_from(at..end, &mut state, &mut rows);
                    gram.gemm(1.0, &rows.transpose(), &rows, 1.0);
                    at = end;
                }
                (gram, state, scalars as f64)
            })
            .collect();
        let mut carried = DMatrix::zeros(states, width);
        let mut out = Self {
            gram: Vec::new(),
            scalars: Vec::new(),
        };
        for (gram, end, scalars) in blocks {
            out.gram.push(continued(&gram, &carried));
            out.scalars.push(scalars);
            carried = end.columns(0, width) + end.columns(width, states) * &carried;
        }
        out
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

/// The Gram of a block that was filtered from zero states, had it been `carried`.
fn continued(gram: &DMatrix<f64>, carried: &DMatrix<f64>) -> DMatrix<f64> {
    let (states, width) = carried.shape();
    let own = gram.view((0, 0), (width, width)).into_owned();
    if states == 0 {
        return own;
    }
    let cross = gram.view((0, width), (width, states)) * carried;
    let whole = gram.view((width, width), (states, states)) * carried;
    own + &cross + cross.transpose() + carried.transpose() * whole
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two columns through `e = y - m`, `m' = a (m + g e)`.
    struct Filtered {
        rows: usize,
    }

    impl Filtered {
        fn value(row: usize, column: usize) -> f64 {
            let at = row as f64 + 1.0;
            (at * (0.7 + column as f64)).sin() + 0.01 * at
        }
    }

    impl Design for Filtered {
        fn width(&self) -> usize {
            2
        }
        fn states(&self) -> usize {
            1
        }
        fn fill(&self, frames: Range<usize>, out: &mut DMatrix<f64>) -> usize {
            self.fill_from(frames, &mut DMatrix::zeros(1, 3), out)
        }
        fn fill_from(
            &self,
            frames: Range<usize>,
            state: &mut DMatrix<f64>,
            out: &mut DMatrix<f64>,
        ) -> usize {
            *out = DMatrix::zeros(frames.len(), 3);
            for (at, row) in frames.enumerate() {
                for column in 0..3 {
                    let y = if column < 2 {
                        Self::value(row, column)
                    } else {
                        0.0
                    };
                    let e = y - state[(0, column)];
                    out[(at, column)] = e;
                    state[(0, column)] = 0.95 * (state[(0, column)] + 0.2 * e);
                }
            }
            out.nrows()
        }
    }

    /// Blocks filtered apart and joined afterwards equal one filter over everything,
    /// to the rounding of some thousand sums.
    #[test]
    fn a_filter_goes_on_across_blocks() {
        let design = Filtered { rows: 1000 };
        let folds = Folds::cut(design.rows);
        assert!(folds.blocks.len() > 10);
        let (whole, scalars) = BlockGrams::accumulate(&design, &folds).sum(|_| true);
        let mut rows = DMatrix::zeros(0, 3);
        let mut state = DMatrix::zeros(1, 3);
        design.fill_from(0..design.rows, &mut state, &mut rows);
        let direct = rows.columns(0, 2).transpose() * rows.columns(0, 2);
        assert!((whole - &direct).norm() < 1e-11 * direct.norm());
        assert!((scalars - 1000.0).abs() < 0.5);
    }
}
