//! What every column says by itself of the noise, in one pass over the blocks.
//!
//! ```text
//! score_b = M_cr - beta M_cc     M = T^T G_b T     width = sum score_b^2 B/(B - 1) / (S_cc variance)
//! ```
//!
//! B: blocks that hold the column's information. [`Fits::scatter`] says the same of any few columns together;
//! here many columns go through a block at a time.
//!
//! Source: Liang & Zeger 1986 (cluster-robust variance).

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::moderation::Usual;
use super::{Fits, Shares};
use crate::gram::Gram;

/// What all columns say counts for no more than this many times the blocks that there are.
const MOST_BLOCKS: f64 = 2.0;
/// Columns that are asked at a time.
const TOGETHER: usize = 16;

/// Sums over the blocks of one column by itself.
struct Alone {
    column: usize,
    value: f64,
    information: f64,
    /// Squares of the blocks' scores.
    spread: f64,
    shares: Shares,
}

impl Alone {
    /// The one of two cuts of which more blocks hold the information.
    fn with_more_blocks(self, other: Self) -> Self {
        if other.shares.blocks() > self.shares.blocks() {
            other
        } else {
            self
        }
    }
}

impl Fits {
    /// What all columns, each alone, say of the noise.
    pub(super) fn usual(&self) -> Usual {
        let shown: Vec<usize> = (0..self.layout.candidates)
            .filter(|&c| self.shows(c))
            .collect();
        let some = shown.par_chunks(TOGETHER);
        let columns: Vec<(f64, f64)> = some.flat_map_iter(|some| self.each_alone(some)).collect();
        let blocks = self.cuts().map(|(blocks, _)| blocks.len()).max();
        Usual::of(&columns, MOST_BLOCKS * blocks.unwrap_or(0) as f64)
    }

    /// How much wider than white noise each of `columns` scatters by itself, and the blocks less one that say so: as
    /// [`scatter`](Self::scatter) of each, in one pass over the blocks.
    pub(super) fn each_alone(&self, columns: &[usize]) -> Vec<(f64, f64)> {
        let cuts = self.cuts().map(|cut| self.sums_alone(cut, columns));
        let alone = cuts.reduce(|first, other| {
            let both = first.into_iter().zip(other);
            both.map(|(first, other)| first.with_more_blocks(other))
                .collect()
        });
        let widths = alone.into_iter().flatten().filter_map(|own| {
            let variance = self.variance(&[own.column])?;
            let nuisance = self.all.nuisance.column(own.column);
            let of_prior = nuisance.dot(&(&self.all.prior * nuisance)) * variance;
            let spread = own.spread * own.shares.widening() + of_prior;
            Some((
                spread / (own.information * variance),
                own.shares.blocks() - 1.0,
            ))
        });
        widths.collect()
    }

    /// The sums over the blocks of a cut, of each column that has an amplitude.
    fn sums_alone(
        &self,
        (blocks, inner): (&[Gram], &[DMatrix<f64>]),
        columns: &[usize],
    ) -> Vec<Alone> {
        let n = self.layout.nuisance_precision.nrows();
        let residual = self.layout.residual(None);
        let w = &self.all.nuisance;
        let last = w.ncols() - 1;
        let mut alone: Vec<Alone> = columns.iter().filter_map(|&c| self.alone(c)).collect();
        for (gram, inner) in blocks.iter().zip(inner) {
            for own in &mut alone {
                let (nuisance, within) = (w.column(own.column), inner.column(own.column));
                let a = nuisance.dot(&within);
                let b = nuisance.dot(&inner.column(last)) + within.dot(&w.column(last));
                let square = gram.at(n + own.column, n + own.column);
                let product = gram.at(n + own.column, residual);
                let score = product + 0.5 * b - own.value * (square + a);
                own.spread += score * score;
                own.shares.add((square + a).max(0.0) / own.information);
            }
        }
        alone
    }

    fn alone(&self, column: usize) -> Option<Alone> {
        let (value, _) = self.all.amplitudes(&[column])?;
        Some(Alone {
            column,
            value: value[0],
            information: self.information(column),
            spread: 0.0,
            shares: Shares::default(),
        })
    }
}
