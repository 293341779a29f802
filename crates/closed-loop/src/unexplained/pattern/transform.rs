//! The strongest wave vectors of a field, by a transform of its residuals on half pixels: by what is left of their power
//! once they have paid for their octave ([`super`]).
//!
//! ```text
//! F(k) = sum over rows weight (x residual + i y residual) e^(-2 pi i k p)     |X|^2 + |Y|^2 = (|F(k)|^2 + |F(-k)|^2) / 2
//! ```
//!
//! p: the cell of the row, in half pixels; k: cycles/px. Detectors that a transform of the
//! largest size does not resolve twice are transformed at half steps of k too.
//!
//! Source: Cooley and Tukey 1965.

use std::f64::consts::TAU;

use fourier::Complex;
use rayon::prelude::*;

use super::{Field, Own};

/// Cells of the transform in a pixel: waves of up to one cycle per pixel.
const CELLS: f64 = 2.0;
/// Cells of the transform at most, an axis.
const MOST_CELLS: usize = 2048;
/// Peaks of the transform that the exact sums are formed of.
const PEAKS: usize = 16;
/// Columns of the transform, and as many opposite ones, turned over at a time.
const STRIP: usize = 16;

const NOTHING: Complex<f32> = Complex::new(0.0, 0.0);

#[expect(
    clippy::cast_possible_truncation,
    reason = "single precision is plenty to rank peaks"
)]
fn narrow(v: f64) -> f32 {
    v as f32
}

impl Field {
    /// The strongest wave vectors of the transform.
    pub(super) fn peaks(&self, variance: [f64; 2], own: &Own) -> Vec<[f64; 2]> {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "an extent in half pixels, limited"
        )]
        let cells = own.extent.map(|l| {
            let wanted = (2.0 * CELLS * l).min(MOST_CELLS as f64) as usize;
            wanted.next_power_of_two().clamp(64, MOST_CELLS)
        });
        // half steps between the frequencies where the transform alone is too coarse
        let shifts = |axis: usize| -> &[f64] {
            if (cells[axis] as f64) < 2.0 * CELLS * own.extent[axis] {
                &[0.0, 0.5]
            } else {
                &[0.0]
            }
        };
        let mut found: Vec<(f32, [f64; 2])> = Vec::new();
        let mut grid = vec![NOTHING; cells[0] * cells[1]];
        for &sx in shifts(0) {
            for &sy in shifts(1) {
                let lattice = Lattice::new(cells, [sx, sy]);
                found.extend(self.transform(&lattice, variance, own, &mut grid));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut waves: Vec<[f64; 2]> = Vec::new();
        for (_, k) in found {
            let near = |w: &[f64; 2]| (0..2).all(|a| (w[a] - k[a]).abs() * own.extent[a] < 0.75);
            if !waves.iter().any(near) {
                waves.push(k);
            }
            if waves.len() == PEAKS {
                break;
            }
        }
        // half pixels cannot tell one cycle per pixel from minus one
        let mirrored: Vec<[f64; 2]> = waves
            .iter()
            .filter(|k| k[0].abs() > 0.99 || k[1].abs() > 0.99)
            .map(|k| [-k[0], k[1]])
            .collect();
        waves.extend(mirrored);
        waves
    }

    /// Squares of the weights: rows, if each counts alike.
    pub(super) fn weighed_rows(&self) -> f64 {
        let each = self.stars.iter().zip(&self.weight);
        each.map(|(rows, w)| rows.len() as f64 * w * w).sum()
    }

    /// The strongest wave of every column of the transform, with its power less its price.
    fn transform(
        &self,
        lattice: &Lattice,
        variance: [f64; 2],
        own: &Own,
        grid: &mut [Complex<f32>],
    ) -> Vec<(f32, [f64; 2])> {
        let [nx, ny] = lattice.cells;
        let used = self.put_on(lattice, variance, grid);
        let plans = lattice.cells.map(fourier::forward_single);
        grid.par_chunks_mut(nx)
            .zip(&used)
            .filter(|(_, used)| **used)
            .for_each_init(
                || vec![NOTHING; plans[0].get_inplace_scratch_len()],
                |scratch, (line, _)| plans[0].process_with_scratch(line, scratch),
            );
        let grid = &*grid;
        let octaves = self.octaves(own);
        let strongest = |i: usize, line: &[Complex<f32>], other: &[Complex<f32>]| {
            lattice.strongest(i, [line, other], &octaves, own)
        };
        let leading: Vec<usize> = (0..nx).filter(|&i| i <= lattice.opposite(0, i)).collect();
        let mut strong: Vec<(usize, (f32, [f64; 2]))> = leading
            .par_chunks(STRIP)
            .map_init(
                || {
                    let scratch = vec![NOTHING; plans[1].get_inplace_scratch_len()];
                    (scratch, vec![NOTHING; 2 * STRIP * ny])
                },
                |(scratch, columns), strip| {
                    columns.fill(NOTHING);
                    for (j, line) in grid.chunks(nx).enumerate().filter(|(j, _)| used[*j]) {
                        for (pair, &i) in columns.chunks_mut(2 * ny).zip(strip) {
                            (pair[j], pair[ny + j]) = (line[i], line[lattice.opposite(0, i)]);
                        }
                    }
                    let mut found = Vec::new();
                    for (pair, &i) in columns.chunks_mut(2 * ny).zip(strip) {
                        plans[1].process_with_scratch(pair, scratch);
                        let (own, other) = pair.split_at(ny);
                        let back = lattice.opposite(0, i);
                        found.extend(strongest(i, own, other).map(|s| (i, s)));
                        if back != i {
                            found.extend(strongest(back, other, own).map(|s| (back, s)));
                        }
                    }
                    found
                },
            )
            .flatten()
            .collect();
        strong.sort_by_key(|(i, _)| *i);
        strong.into_iter().map(|(_, strongest)| strongest).collect()
    }

    /// Puts the residuals into the cells of `grid`; says which lines hold any: most lie between the stars' paths.
    fn put_on(
        &self,
        lattice: &Lattice,
        variance: [f64; 2],
        grid: &mut [Complex<f32>],
    ) -> Vec<bool> {
        let [nx, ny] = lattice.cells;
        let twists = [lattice.twists(0), lattice.twists(1)];
        let scale = variance.map(|v| 1.0 / v.sqrt());
        let low = [&self.x_px, &self.y_px].map(|v| v.iter().copied().fold(f64::INFINITY, f64::min));
        let cell = |axis: usize, at: f64| -> (usize, Complex<f32>) {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "half pixels from the lowest position"
            )]
            let j = (CELLS * (at - low[axis])) as usize;
            let n = lattice.cells[axis];
            // beyond the grid a half step has turned by pi a period
            let turned = lattice.shift[axis] > 0.0 && (j / n) % 2 == 1;
            let twist = twists[axis][j % n];
            (j % n, if turned { -twist } else { twist })
        };
        grid.fill(NOTHING);
        let mut used = vec![false; ny];
        for (rows, weight) in self.stars.iter().zip(&self.weight) {
            for row in rows.clone() {
                let (i, ti) = cell(0, self.x_px[row]);
                let (j, tj) = cell(1, self.y_px[row]);
                let r = [0, 1].map(|a| narrow(weight * self.residual[a][row] * scale[a]));
                grid[j * nx + i] += Complex::new(r[0], r[1]) * ti * tj;
                used[j] = true;
            }
        }
        used
    }

    /// Up to which scale each octave goes, and what a wave in it pays of its power.
    fn octaves(&self, own: &Own) -> Vec<(f64, f32)> {
        // the square of a wave's residuals is that of noise, a row each, times the power
        let rows = self.weighed_rows();
        let prices = own.prices();
        prices
            .map(|(up_to, trials)| (up_to, narrow(2.0 * rows * trials.ln())))
            .collect()
    }
}

/// The cells of a transform, a power of two an axis, and the share of a step by which its frequencies are shifted.
struct Lattice {
    cells: [usize; 2],
    shift: [f64; 2],
    /// Indices along the second axis whose frequencies rise from zero.
    upwards: Vec<usize>,
}

impl Lattice {
    fn new(cells: [usize; 2], shift: [f64; 2]) -> Self {
        Self {
            cells,
            shift,
            upwards: (0..=cells[1] / 2).collect(),
        }
    }

    /// What turns each cell, so that frequencies are shifted.
    fn twists(&self, axis: usize) -> Vec<Complex<f32>> {
        let n = self.cells[axis];
        let twist = |j: usize| {
            let (s, c) = (-TAU * self.shift[axis] * j as f64 / n as f64).sin_cos();
            Complex::new(narrow(c), narrow(s))
        };
        (0..n).map(twist).collect()
    }

    /// The frequency of an index, cycles/px.
    fn frequency(&self, axis: usize, i: usize) -> f64 {
        let (n, i) = (self.cells[axis] as f64, i as f64);
        (if i < 0.5 * n { i } else { i - n } + self.shift[axis]) * CELLS / n
    }

    /// The index of minus that frequency.
    fn opposite(&self, axis: usize, i: usize) -> usize {
        let first = usize::from(self.shift[axis] > 0.0);
        (2 * self.cells[axis] - i - first) & (self.cells[axis] - 1)
    }

    /// The strongest wave of column `i`, of the transform there and at the opposite one.
    fn strongest(
        &self,
        i: usize,
        [line, other]: [&[Complex<f32>]; 2],
        octaves: &[(f64, f32)],
        own: &Own,
    ) -> Option<(f32, [f64; 2])> {
        let wave = |j: usize| [self.frequency(0, i), self.frequency(1, j)];
        let mut best: Option<(f32, [f64; 2])> = None;
        let mut rest = self.upwards.as_slice();
        for (up_to, price) in octaves {
            let within = rest.partition_point(|&j| own.scale(wave(j)) < *up_to);
            let (octave, longer) = rest.split_at(within);
            rest = longer;
            for &j in octave {
                let power = line[j].norm_sqr() + other[self.opposite(1, j)].norm_sqr();
                let worth = power - price;
                // few are higher than all before them: others need not be asked whose they are
                if best.is_none_or(|(most, _)| worth >= most) && !own.excludes(wave(j)) {
                    best = Some((worth, wave(j)));
                }
            }
        }
        best
    }
}
