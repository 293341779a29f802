//! Where on the detector what is left is another: beyond an edge, or on a patch; and when.
//!
//! A detector of several parts shifts on one side of their border, a blemish within itself; polynomials of the place have
//! neither. The likeliest of each is looked for in the residuals r of the stars that come by, and is a term among others:
//!
//! ```text
//! u = sum over stars w^2 (sum of r in S - share_S sum of r)     N = sum w^2 n (share_S - share_S^2)     (u_x^2 + u_y^2)/N most
//! ```
//!
//! S: all cells of a grid beyond one of its lines, or a square of an eighth or a quarter of its length. What a star keeps
//! all the time tells nothing, nor does it cost anything but an exact place: the pass that judges the term has all that
//! this leaves out.
//!
//! Frames may be turned for a while, as by one blow, and then back: the stretch is looked for in the same way, in all stars
//! at once, in stretches of a half to a thirty-second of the time.
//!
//! Not physics: where to look.

use crate::search::empirical::{Empirical, Variable, range};
use crate::star::data::StarData;
use crate::star::frame_rotation::counts;

/// Cells of the grid along an axis.
const CELLS: usize = 32;
/// Cells of a patch along an axis; each begins at every half of its length.
const PATCHES: [usize; 2] = [4, 8];
/// Cells of the time.
const STRETCHES: usize = 64;
/// Squares in units of the variance below which a place is not worth a term.
const LEAST: f64 = 12.0;

/// What is summed of a set of cells: squares of weights, and of these times the residuals.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    rows: f64,
    residual: [f64; 2],
}

impl Sum {
    fn of(weight: f64, residual: [f64; 2]) -> Self {
        let square = weight * weight;
        Self {
            rows: square,
            residual: residual.map(|r| square * r),
        }
    }

    fn add(&mut self, other: &Self) {
        self.rows += other.rows;
        for (sum, more) in self.residual.iter_mut().zip(other.residual) {
            *sum += more;
        }
    }
}

/// What is left of the rows, arcsec, and how much each counts.
pub(super) struct Left<'a> {
    data: &'a StarData,
    pub(super) residual: [&'a [f64]; 2],
    weight: &'a [f64],
}

impl<'a> Left<'a> {
    /// `None` where the residual has not two axes.
    pub(super) fn of(
        data: &'a StarData,
        residual: &'a [Vec<f64>],
        weight: &'a [f64],
    ) -> Option<Self> {
        let [x, y] = residual else { return None };
        Some(Self {
            data,
            residual: [x, y],
            weight,
        })
    }

    /// Those that count.
    pub(super) fn rows(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.data.t_s.len()).filter(|&row| counts(self.data, self.residual, row))
    }

    /// Mean square of an axis, weighed; NaN where no row counts.
    pub(super) fn variance(&self) -> f64 {
        let (count, squares) = self.rows().fold((0.0, 0.0), |(n, sum), row| {
            let [x, y] = self.residual.map(|r| r[row].powi(2));
            (n + 2.0, sum + self.weight[row].powi(2) * (x + y))
        });
        squares / count
    }

    fn sum(&self, row: usize) -> Sum {
        Sum::of(self.weight[row], self.residual.map(|r| r[row]))
    }
}

/// Score and information of a shift of a set of cells.
#[derive(Clone, Copy, Debug, Default)]
struct Shift {
    score: [f64; 2],
    information: f64,
}

impl Shift {
    /// Adds a star, of which `of` all lie in the set.
    fn add(&mut self, of: &Sum, all: &Sum) {
        let share = of.rows / all.rows;
        for axis in 0..2 {
            self.score[axis] += of.residual[axis] - share * all.residual[axis];
        }
        self.information += of.rows * (1.0 - share);
    }

    /// The squares that it takes.
    fn power(&self) -> f64 {
        let [x, y] = self.score;
        if self.information > 0.0 {
            (x * x + y * y) / self.information
        } else {
            0.0
        }
    }
}

/// The likeliest edge, and the likeliest patch, in `residual` (arcsec, per axis over all rows), as terms; those that are
/// worth one.
pub(super) fn places(data: &StarData, residual: &[Vec<f64>], weight: &[f64]) -> Vec<Empirical> {
    let Some(left) = Left::of(data, residual, weight) else {
        return Vec::new();
    };
    let grid = Grid::of(data);
    let variance = left.variance();
    if variance.is_nan() || variance <= 0.0 {
        return Vec::new();
    }
    let mut rows_of = vec![0; data.stars.len()];
    left.rows().for_each(|row| rows_of[data.star[row]] += 1);
    let mut of_star: Vec<Vec<usize>> = rows_of.into_iter().map(Vec::with_capacity).collect();
    left.rows()
        .for_each(|row| of_star[data.star[row]].push(row));
    let mut edges = vec![Shift::default(); 2 * CELLS];
    let mut patches = vec![Shift::default(); PATCHES.map(|n| Patch::along(n).pow(2)).iter().sum()];
    let mut cells = vec![Sum::default(); CELLS * CELLS];
    for rows in of_star.iter().filter(|rows| rows.len() > 1) {
        cells.fill(Sum::default());
        let mut all = Sum::default();
        for &row in rows {
            let one = left.sum(row);
            cells[grid.cell([data.modelled[0][row], data.modelled[1][row]])].add(&one);
            all.add(&one);
        }
        for axis in 0..2 {
            let mut before = Sum::default();
            for line in 0..CELLS - 1 {
                for k in 0..CELLS {
                    before.add(&cells[Grid::at([line, k][axis], [k, line][axis])]);
                }
                edges[axis * CELLS + line].add(&before, &all);
            }
        }
        for (patch, shift) in Patch::all().zip(&mut patches) {
            let mut within = Sum::default();
            for y in patch.from[1]..patch.from[1] + patch.cells {
                for x in patch.from[0]..patch.from[0] + patch.cells {
                    within.add(&cells[Grid::at(x, y)]);
                }
            }
            if within.rows > 0.0 {
                shift.add(&within, &all);
            }
        }
    }
    let edge = likeliest(&edges, variance).map(|(at, tried)| {
        let axis = at / CELLS;
        let at_px = grid.line_px(axis, at % CELLS + 1);
        (Variable::Beyond { axis, at_px }, tried)
    });
    let patch = likeliest(&patches, variance).and_then(|(at, tried)| {
        let patch = Patch::all().nth(at)?;
        let bounds = |more: usize| [0, 1].map(|axis| grid.line_px(axis, patch.from[axis] + more));
        let [from_px, to_px] = [bounds(0), bounds(patch.cells)];
        Some((Variable::Patch { from_px, to_px }, tried))
    });
    let found = edge.into_iter().chain(patch);
    found
        .filter_map(|(variable, tried)| term(variable, tried))
        .collect()
}

/// The likeliest stretch of time in which all stars are shifted alike, as a term, if it is worth one.
pub(super) fn stretch(data: &StarData, residual: &[Vec<f64>], weight: &[f64]) -> Option<Empirical> {
    let left = Left::of(data, residual, weight)?;
    let [from, to] = range(data.t_s.iter().copied());
    let cell_s = (to - from) / STRETCHES as f64;
    let mut cells = vec![Sum::default(); STRETCHES];
    let mut all = Sum::default();
    for row in left.rows() {
        let one = left.sum(row);
        cells[cell((data.t_s[row] - from) / cell_s, STRETCHES)].add(&one);
        all.add(&one);
    }
    let lengths = (1..).map(|k| 1 << k).take_while(|n| *n < STRETCHES);
    let stretches: Vec<[usize; 2]> = lengths
        .flat_map(|n| {
            (0..=STRETCHES - n)
                .step_by(n / 2)
                .map(move |at| [at, at + n])
        })
        .collect();
    let shifts: Vec<Shift> = stretches
        .iter()
        .map(|&[start, end]| {
            let mut within = Sum::default();
            cells[start..end].iter().for_each(|cell| within.add(cell));
            let mut shift = Shift::default();
            if within.rows > 0.0 {
                shift.add(&within, &all);
            }
            shift
        })
        .collect();
    let (at, tried) = likeliest(&shifts, left.variance())?;
    let [from_s, to_s] = stretches[at].map(|cell| from + cell_s * cell as f64);
    term(Variable::During { from_s, to_s }, tried)
}

/// A shift where `variable` is 1, which was looked for among so many.
fn term(variable: Variable, tried: usize) -> Option<Empirical> {
    Some(Empirical::new(variable, [0.0, 1.0], true)?.looked_for_among(tried))
}

/// The one of `shifts` that takes most, and how many there are, where it is worth a term.
fn likeliest(shifts: &[Shift], variance: f64) -> Option<(usize, usize)> {
    let tried = shifts.iter().filter(|s| s.information > 0.0).count();
    let powers = shifts.iter().map(Shift::power).enumerate();
    let best = powers.max_by(|a, b| a.1.total_cmp(&b.1))?;
    (best.1 > LEAST * variance).then_some((best.0, tried))
}

/// The cell of what lies so many cells from the first.
fn cell(along: f64, cells: usize) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "cells from the lowest"
    )]
    let cell = along.max(0.0) as usize;
    cell.min(cells - 1)
}

/// Cells of the part of the detector that the rows cover.
struct Grid {
    from_px: [f64; 2],
    cell_px: [f64; 2],
}

impl Grid {
    fn of(data: &StarData) -> Self {
        let ranges = [0, 1].map(|axis| range(data.modelled[axis].iter().copied()));
        Self {
            from_px: ranges.map(|r| r[0]),
            cell_px: ranges.map(|[from, to]| (to - from) / CELLS as f64),
        }
    }

    fn at(x: usize, y: usize) -> usize {
        CELLS * y + x
    }

    fn cell(&self, at_px: [f64; 2]) -> usize {
        let [x, y] = [0, 1].map(|axis| {
            let along = (at_px[axis] - self.from_px[axis]) / self.cell_px[axis];
            cell(along, CELLS)
        });
        Self::at(x, y)
    }

    /// Where a cell begins.
    fn line_px(&self, axis: usize, line: usize) -> f64 {
        self.from_px[axis] + self.cell_px[axis] * line as f64
    }
}

/// A square of cells.
#[derive(Clone, Copy, Debug)]
struct Patch {
    from: [usize; 2],
    cells: usize,
}

impl Patch {
    /// Squares of so many cells along an axis.
    const fn along(cells: usize) -> usize {
        2 * CELLS / cells - 1
    }

    fn all() -> impl Iterator<Item = Self> {
        PATCHES.into_iter().flat_map(|cells| {
            let n = Self::along(cells);
            (0..n * n).map(move |k| Self {
                from: [k % n, k / n].map(|at| at * cells / 2),
                cells,
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three rows of a star at 0 and one at 4 in the set: 4 is 3/4 of n (share - share^2) d^2 = 3/4 * 16 = 12, whatever it
    /// keeps all the time; a star that never leaves the set tells nothing.
    #[test]
    fn what_a_star_keeps_tells_nothing() {
        for constant in [0.0, 7.0] {
            let row = |shift: f64| Sum::of(1.0, [constant + shift, -constant]);
            let mut all = row(4.0);
            (0..3).for_each(|_| all.add(&row(0.0)));
            let mut shift = Shift::default();
            shift.add(&row(4.0), &all);
            assert!((shift.power() - 12.0).abs() < 1e-12, "{shift:?}");
            shift.add(&all, &all);
            assert!((shift.power() - 12.0).abs() < 1e-12, "{shift:?}");
        }
    }

    /// Squares of an eighth begin at every sixteenth, of a quarter at every eighth, and none goes beyond the grid.
    #[test]
    fn patches_cover_the_grid() {
        let all: Vec<Patch> = Patch::all().collect();
        assert_eq!(all.len(), 15 * 15 + 7 * 7);
        let ends = all.iter().flat_map(|p| p.from.map(|from| from + p.cells));
        assert_eq!(ends.max(), Some(CELLS));
        assert_eq!(cell(-0.5, 4), 0);
        assert_eq!(cell(4.0, 4), 3, "the last place is in the last cell");
    }
}
