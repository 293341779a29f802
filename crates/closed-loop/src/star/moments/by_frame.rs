//! What turns the camera, from the moments of frames.
//!
//! A turn T moves all stars of a frame by three numbers, so that its products with every column, and what other forms of
//! it make of a block, follow from what the pass kept of each frame k, without another one:
//!
//! ```text
//! M_k = A_k^T c    N_k = A_k^T A_k        T^T A^T c = sum_k T_k^T M_k        M_k of A T = N_k T_k
//! ```
//!
//! Source: the partitioned normal equations of [`super`].

use std::sync::Arc;

use block_regression::{BlockGrams, Symmetric};
use nalgebra::{DMatrix, Matrix3, Vector3};
use rayon::prelude::*;

use super::{Block, SINGULAR, StarMoments};

/// M of each frame of a block, three rows a frame, and N.
#[derive(Clone, Debug)]
pub(super) struct ByFrame {
    /// While it is summed, three columns a frame.
    moments: DMatrix<f64>,
    normals: Vec<Matrix3<f64>>,
}

impl ByFrame {
    /// No frames yet of so many.
    pub(super) fn of_none(width: usize, frames: usize) -> Self {
        Self {
            moments: DMatrix::zeros(width, 3 * frames),
            normals: Vec::with_capacity(frames),
        }
    }

    /// Frames with these N and M about each axis, a column a frame from `held` on.
    pub(super) fn push(
        &mut self,
        moments: &[DMatrix<f64>; 3],
        held: usize,
        normals: &[Matrix3<f64>],
    ) {
        for k in 0..normals.len() {
            let first = 3 * (self.normals.len() + k);
            for (axis, moments) in moments.iter().enumerate() {
                let mut into = self.moments.column_mut(first + axis);
                into.copy_from(&moments.column(held + k));
            }
        }
        self.normals.extend_from_slice(normals);
    }

    /// Once all are summed, of columns in this order.
    pub(super) fn in_order(self, order: &[usize]) -> Self {
        Self {
            moments: self.moments.select_rows(order).transpose(),
            ..self
        }
    }

    /// M of columns that turn the camera by `turns`.
    fn of_turns(&self, turns: &DMatrix<f64>) -> DMatrix<f64> {
        let mut moments = turns.clone();
        for mut column in moments.column_iter_mut() {
            let frames = column.as_mut_slice().chunks_exact_mut(3);
            for (turn, normal) in frames.zip(&self.normals) {
                let turned = normal * Vector3::from_column_slice(turn);
                turn.copy_from_slice(turned.as_slice());
            }
        }
        moments
    }

    /// Products of columns that turn the camera by `turns`, with the moments `own`, with all columns and, before the last
    /// `residuals` of these, with themselves.
    fn products(&self, residuals: usize, own: &DMatrix<f64>, turns: &DMatrix<f64>) -> DMatrix<f64> {
        let (first, added) = (self.moments.ncols() - residuals, turns.ncols());
        let (fixed, last) = self.moments.columns_range_pair(..first, first..);
        let flipped = turns.transpose();
        let mut products = DMatrix::zeros(added, self.moments.ncols() + added);
        for (to, from) in [
            (0, fixed),
            (first, own.columns(0, added)),
            (first + added, last),
        ] {
            let mut into = products.columns_mut(to, from.ncols());
            into.gemm(1.0, &flipped, &from, 0.0);
        }
        products
    }
}

/// With columns of zeros from `first` on.
fn widened(m: &DMatrix<f64>, first: usize, added: usize) -> DMatrix<f64> {
    m.clone().insert_columns(first, added, 0.0)
}

impl StarMoments {
    /// Whether every frame's moments are there.
    pub(crate) fn is_by_frame(&self) -> bool {
        self.blocks.iter().all(|b| b.by_frame.is_some())
    }

    /// The same with columns `which` such as turn the frames of each block by `turns`, arcsec, three rows a frame:
    /// every frame's moments must be there.
    pub(crate) fn with_turns(self, which: &[usize], turns: &[DMatrix<f64>]) -> Self {
        let frames = &self.frames;
        let first_bins = self.first_bins();
        let each = self.blocks.into_par_iter().zip(turns).zip(first_bins);
        let turned = each.map(|((mut block, turns), first)| {
            block.turn(which, turns, &frames[first..first + block.inverse.len()]);
            block
        });
        Self::of(
            turned.collect(),
            self.t_s,
            self.frames.clone(),
            self.fold_of_block,
        )
    }

    /// The first `fixed` and the last `residuals` columns alone.
    pub(crate) fn narrowed(&self, fixed: usize, residuals: usize) -> Self {
        let last = self.width() - residuals..self.width();
        let columns: Vec<usize> = (0..fixed).chain(last).collect();
        let picked = self.blocks.par_iter().map(|b| b.picked(&columns));
        self.in_blocks(picked.collect())
    }

    /// All columns with others before the last `residuals` that turn the frames of each block by `turns`.
    pub(crate) fn beside_turns(&self, residuals: usize, turns: &[DMatrix<f64>]) -> Self {
        let each = self.blocks.par_iter().zip(turns).zip(self.first_bins());
        let beside = each.map(|((block, turns), first)| {
            let frames = &self.frames[first..first + block.inverse.len()];
            block.beside_turns(residuals, turns, frames)
        });
        self.in_blocks(beside.collect())
    }

    /// The same under white noise, summed over the blocks: every frame's moments must be there.
    pub(crate) fn white_beside_turns(
        &self,
        residuals: usize,
        turns: &[DMatrix<f64>],
    ) -> BlockGrams {
        let first = self.width() - residuals;
        let added = turns.first().map_or(0, DMatrix::ncols);
        let each = self.blocks.par_iter().zip(turns);
        let products = each.filter_map(|(block, turns)| {
            let by_frame = block.by_frame.as_ref()?;
            Some(by_frame.products(residuals, &by_frame.of_turns(turns), turns))
        });
        let products: Vec<DMatrix<f64>> = products.collect();
        let mut sum = self.white_sum().widened(first, added);
        let none = DMatrix::zeros(added, sum.size());
        let all = products.iter().fold(none, |all, part| all + part);
        for (k, products) in all.transpose().column_iter().enumerate() {
            sum.put_column(first + k, products.as_slice());
        }
        self.white_as_one(sum)
    }

    /// Other `blocks` of the same frames.
    fn in_blocks(&self, blocks: Vec<Block>) -> Self {
        let (t_s, frames) = (self.t_s.clone(), self.frames.clone());
        Self::of(blocks, t_s, frames, self.fold_of_block.clone())
    }

    /// The first bin of each block.
    fn first_bins(&self) -> Vec<usize> {
        let mut next = 0;
        let first = self.blocks.iter().map(|block| {
            next += block.inverse.len();
            next - block.inverse.len()
        });
        first.collect()
    }
}

impl Block {
    /// Makes columns `which` such as turn the camera by `turns`; `frames`: how many each bin has.
    fn turn(&mut self, which: &[usize], turns: &DMatrix<f64>, frames: &[usize]) {
        let Some(by_frame) = &mut self.by_frame else {
            return;
        };
        let own = by_frame.of_turns(turns);
        for (from, &to) in own.column_iter().zip(which) {
            by_frame.moments.column_mut(to).copy_from(&from);
        }
        let whole = by_frame.moments.tr_mul(turns);
        let bins = Binned::of(&own, frames, &self.inverse);
        bins.put_theta(which, &mut self.theta);
        bins.put_rest(which, &whole, &self.theta, Arc::make_mut(&mut self.rest));
    }

    /// Some of the columns.
    fn picked(&self, columns: &[usize]) -> Self {
        Self {
            rest: Arc::new(self.rest.picked(columns)),
            lost: self.lost.as_ref().map(|lost| lost.picked(columns)),
            theta: self.theta.select_columns(columns),
            inverse: self.inverse.clone(),
            by_frame: self.by_frame.as_ref().map(|by_frame| ByFrame {
                moments: by_frame.moments.select_columns(columns),
                normals: by_frame.normals.clone(),
            }),
            ..*self
        }
    }

    /// All columns with others before the last `residuals` that turn the camera by `turns`; every frame's moments are
    /// not kept.
    fn beside_turns(&self, residuals: usize, turns: &DMatrix<f64>, frames: &[usize]) -> Self {
        let first = self.rest.size() - residuals;
        let added = turns.ncols();
        let mut block = Self {
            rest: Arc::new(self.rest.widened(first, added)),
            lost: None,
            theta: widened(&self.theta, first, added),
            inverse: self.inverse.clone(),
            by_frame: None,
            ..*self
        };
        let Some(by_frame) = &self.by_frame else {
            return block;
        };
        let own = by_frame.of_turns(turns);
        let whole = by_frame.products(residuals, &own, turns).transpose();
        let which: Vec<usize> = (first..first + added).collect();
        let bins = Binned::of(&own, frames, &block.inverse);
        bins.put_theta(&which, &mut block.theta);
        bins.put_rest(&which, &whole, &block.theta, Arc::make_mut(&mut block.rest));
        block
    }
}

/// M of columns that turn the camera, three rows a bin, and the mean rotations that it makes; zero without an attitude.
struct Binned {
    moments: DMatrix<f64>,
    theta: DMatrix<f64>,
}

impl Binned {
    /// Of M by frames, of which each bin has so many.
    fn of(by_frame: &DMatrix<f64>, frames: &[usize], inverse: &[Option<Matrix3<f64>>]) -> Self {
        let zeros = DMatrix::zeros(3 * frames.len(), by_frame.ncols());
        let (mut moments, mut theta) = (zeros.clone(), zeros);
        let columns = moments.column_iter_mut().zip(theta.column_iter_mut());
        for (from, (mut moments, mut theta)) in by_frame.column_iter().zip(columns) {
            let mut of_frames = from
                .as_slice()
                .chunks_exact(3)
                .map(Vector3::from_column_slice);
            for (bin, (&count, inverse)) in frames.iter().zip(inverse).enumerate() {
                let sum: Vector3<f64> = of_frames.by_ref().take(count).sum();
                if let Some(inverse) = inverse {
                    moments.fixed_rows_mut::<3>(3 * bin).copy_from(&sum);
                    theta
                        .fixed_rows_mut::<3>(3 * bin)
                        .copy_from(&(inverse * sum));
                }
            }
        }
        Self { moments, theta }
    }

    fn put_theta(&self, which: &[usize], theta: &mut DMatrix<f64>) {
        for (from, &to) in self.theta.column_iter().zip(which) {
            theta.column_mut(to).copy_from(&from);
        }
    }

    /// Puts their products with all columns, `whole`, into R, less what rotations of the bins explain.
    fn put_rest(
        &self,
        which: &[usize],
        whole: &DMatrix<f64>,
        theta: &DMatrix<f64>,
        rest: &mut Symmetric,
    ) {
        let mut left = whole.clone();
        left.gemm(-1.0, &theta.transpose(), &self.moments, 1.0);
        // what rounding leaves of rotations of every bin
        for (k, &column) in which.iter().enumerate() {
            if left[(column, k)] < SINGULAR * whole[(column, k)] {
                left[(column, k)] = 0.0;
            }
        }
        for (left, &column) in left.column_iter().zip(which) {
            rest.put_column(column, left.as_slice());
        }
        for c in 0..rest.size() {
            if rest.at(c, c) == 0.0 {
                rest.clear(c);
            }
        }
    }
}
