//! Pixel phase, taken out of a field: whole cycles per pixel along one axis, which have
//! terms of their own.
//!
//! ```text
//! r_a = sum over h = 1..6 of waves of (h, 0) and (0, h) cycles/px, less the mean of each star
//! ```
//!
//! With spots of their own the stars err with the pixel phase each by itself, and along both axes at once: then
//! every star has amplitudes of its own, and waves of (1, 1) and (1, -1) too.
//!
//! Rows are taken a piece of a star at a time, twice: a design of millions of rows would not fit. The means come
//! off the sums, `sum (a - m)(a - m)' = sum a a' - n m m'`: what a wave loses to them in rounding is far below the
//! least that is solved for.
//!
//! Source: least squares by normal equations.

use std::ops::Range;

use block_regression::Symmetric;
use nalgebra::{DMatrix, MatrixXx2, RowDVector};
use pulp::Arch;
use rayon::prelude::*;

use super::waves::Waves;
use super::{Field, pieces};
use crate::search::empirical::HARMONICS;

/// Waves along one axis, and all.
const SINGLE: usize = 2 * HARMONICS;
const WAVES: usize = SINGLE + 2;

/// Cycles per pixel along x and y.
fn waves() -> [[f64; 2]; WAVES] {
    std::array::from_fn(|h| {
        let k = (h / 2 + 1) as f64;
        match (h < SINGLE, h % 2 == 0) {
            (true, true) => [k, 0.0],
            (true, false) => [0.0, k],
            (false, same) => [1.0, if same { 1.0 } else { -1.0 }],
        }
    })
}

/// Normal equations of the waves' cosines and sines for both axes.
struct Equations {
    normal: DMatrix<f64>,
    score: MatrixXx2<f64>,
}

impl Equations {
    fn solve(self, rows: usize) -> Option<MatrixXx2<f64>> {
        // where stars stand still there is nothing to take out
        let least = 1e-6 * rows as f64;
        let svd = self.normal.svd(true, true);
        svd.solve(&self.score, least).ok()
    }
}

impl Field {
    /// Takes it out.
    pub(super) fn take_out_pixel_phase(&mut self) -> Option<()> {
        let waves = &waves()[..if self.own_spots { WAVES } else { SINGLE }];
        let (each, mean): (Vec<Equations>, Vec<RowDVector<f64>>) =
            self.equations(waves).into_iter().unzip();
        let beta: Vec<MatrixXx2<f64>> = if self.own_spots {
            let of_star = each.into_iter().zip(&self.stars);
            of_star
                .map(|(own, rows)| own.solve(rows.len()))
                .collect::<Option<_>>()?
        } else {
            let all = each.into_iter().reduce(|all, own| Equations {
                normal: all.normal + own.normal,
                score: all.score + own.score,
            })?;
            vec![all.solve(self.rows())?; self.stars.len()]
        };
        let [mut x, mut y] = std::mem::take(&mut self.residual);
        let mut rest = [x.as_mut_slice(), &mut y];
        let pieces = self.pieces_of_stars().into_iter().map(|(star, rows)| {
            let own = rest.each_mut().map(|r| {
                r.split_off_mut(..rows.len())
                    .expect("the rows of the stars follow one another")
            });
            (star, rows, own)
        });
        let pieces: Vec<_> = pieces.collect();
        pieces.into_par_iter().for_each(|(star, rows, own)| {
            let taken = self.waves_at(waves, &rows, 0) * &beta[star];
            let level = &mean[star] * &beta[star];
            for (axis, residual) in own.into_iter().enumerate() {
                let taken = taken.column(axis);
                for (r, taken) in residual.iter_mut().zip(&taken) {
                    *r -= self.weight[star] * (taken - level[axis]);
                }
            }
        });
        self.residual = [x, y];
        Some(())
    }

    /// A star and some of its rows, each.
    fn pieces_of_stars(&self) -> Vec<(usize, Range<usize>)> {
        let stars = self.stars.iter().enumerate();
        stars
            .flat_map(|(star, rows)| pieces(rows).map(move |piece| (star, piece)))
            .collect()
    }

    /// Of every star, and its columns' means.
    fn equations(&self, waves: &[[f64; 2]]) -> Vec<(Equations, RowDVector<f64>)> {
        let n = 2 * waves.len();
        let pieces = self.pieces_of_stars();
        // beside the waves the residuals of both axes and a one
        let products = |(_, rows): &(usize, Range<usize>)| {
            let mut columns = self.waves_at(waves, rows, 3);
            for axis in 0..2 {
                let own = &self.residual[axis][rows.clone()];
                columns.column_mut(n + axis).copy_from_slice(own);
            }
            columns.column_mut(n + 2).fill(1.0);
            Symmetric::of_products(&columns)
        };
        let each: Vec<Symmetric> = pieces.par_iter().map(products).collect();
        let mut sums = vec![Symmetric::zeros(n + 3); self.stars.len()];
        for ((star, _), own) in pieces.iter().zip(&each) {
            sums[*star].add(1.0, own);
        }
        let stars = sums.into_iter().zip(&self.stars).zip(&self.weight);
        stars
            .map(|((sum, rows), weight)| {
                let sum = DMatrix::from(&sum);
                let mean = sum.row(n + 2).columns(0, n) / rows.len() as f64;
                let normal = sum.view((0, 0), (n, n)) - mean.tr_mul(&mean) * rows.len() as f64;
                let of_axes = sum.row(n + 2).columns(n, 2).into_owned();
                let score = sum.view((0, n), (n, 2)) - mean.tr_mul(&of_axes);
                let equations = Equations {
                    normal: normal * (weight * weight),
                    score: score.fixed_columns::<2>(0) * *weight,
                };
                (equations, mean)
            })
            .collect()
    }

    /// Cosines and sines at some rows, not less their means, and room for more columns.
    fn waves_at(&self, waves: &[[f64; 2]], rows: &Range<usize>, more: usize) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(rows.len(), 2 * waves.len() + more);
        let pairs = out.as_mut_slice().chunks_exact_mut(2 * rows.len());
        for (pair, k) in pairs.zip(waves) {
            let (cos, sin) = pair.split_at_mut(rows.len());
            Arch::new().dispatch(Waves {
                at: self.places(rows),
                k: *k,
                cos,
                sin,
            });
        }
        out
    }
}
