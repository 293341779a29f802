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
//! Rows are taken star by star, twice: a design of millions of rows would not fit.
//!
//! Source: least squares by normal equations.

use std::ops::Range;

use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

use super::Field;
use crate::search::empirical::HARMONICS;

/// Waves along one axis, and all.
const SINGLE: usize = 2 * HARMONICS;
const WAVES: usize = SINGLE + 2;
type Normal = SMatrix<f64, { 2 * WAVES }, { 2 * WAVES }>;
type Score = SMatrix<f64, { 2 * WAVES }, 2>;

impl Field {
    /// Takes it out.
    pub(super) fn take_out_pixel_phase(&mut self) -> Option<()> {
        let waves: [[f64; 2]; WAVES] = std::array::from_fn(|h| {
            let k = (h / 2 + 1) as f64;
            match (h < SINGLE, h % 2 == 0) {
                (true, true) => [k, 0.0],
                (true, false) => [0.0, k],
                (false, same) => [1.0, if same { 1.0 } else { -1.0 }],
            }
        });
        let own = self.own_spots;
        let taken = if own { WAVES } else { SINGLE };
        let design = |star: usize, rows: &Range<usize>| {
            let mut out = vec![[0.0; 2 * WAVES]; rows.len()];
            let mut columns = Vec::new();
            for (h, k) in waves[..taken].iter().enumerate() {
                self.columns(star, *k, &mut columns);
                for (row, c) in out.iter_mut().zip(&columns) {
                    row[2 * h..2 * h + 2].copy_from_slice(c);
                }
            }
            out
        };
        let sums: Vec<(Normal, Score)> = self
            .stars
            .par_iter()
            .enumerate()
            .map(|(star, rows)| {
                let (mut normal, mut score) = (Normal::zeros(), Score::zeros());
                for (row, a) in rows.clone().zip(design(star, rows)) {
                    let a = SVector::from(a);
                    normal.ger(1.0, &a, &a, 1.0);
                    let of = SVector::from([self.residual[0][row], self.residual[1][row]]);
                    score.ger(1.0, &a, &of, 1.0);
                }
                (normal, score)
            })
            .collect();
        let solve = |(normal, score): (Normal, Score), rows: usize| {
            // where stars stand still there is nothing to take out
            let least = 1e-6 * rows as f64;
            normal.svd(true, true).solve(&score, least).ok()
        };
        let beta: Vec<Score> = if own {
            let each = sums.into_iter().zip(&self.stars);
            each.map(|(sums, rows)| solve(sums, rows.len()))
                .collect::<Option<_>>()?
        } else {
            let all = sums
                .into_iter()
                .fold((Normal::zeros(), Score::zeros()), |all, own| {
                    (all.0 + own.0, all.1 + own.1)
                });
            vec![solve(all, self.rows())?; self.stars.len()]
        };
        let left: Vec<[Vec<f64>; 2]> = self
            .stars
            .par_iter()
            .zip(&beta)
            .enumerate()
            .map(|(star, (rows, beta))| {
                let design = design(star, rows);
                [0, 1].map(|axis| {
                    let beta = beta.column(axis);
                    let own = self.residual[axis][rows.clone()].iter().zip(&design);
                    own.map(|(r, a)| r - SVector::from(*a).dot(&beta)).collect()
                })
            })
            .collect();
        for (rows, left) in self.stars.iter().zip(left) {
            for (residual, left) in self.residual.iter_mut().zip(left) {
                residual[rows.clone()].copy_from_slice(&left);
            }
        }
        Some(())
    }
}
