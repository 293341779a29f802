//! Symmetric matrices in half of the room.
//!
//! ```text
//! panel 0   all rows, PANEL columns           | 0       |
//! panel 1   rows from PANEL on                | 0  1    |
//! panel 2   rows from 2 PANEL on, and so on   | 0  1  2 |
//! ```
//!
//! Each panel is a matrix in memory like any other, columns together, so that products of matrices stay such. The
//! square in which a panel begins is kept whole.
//!
//! Not physics: where numbers lie.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, DVector};

/// Columns of a panel: enough for products of panels to pay, few enough for their squares to be a small share.
const PANEL: usize = 64;
/// Columns that are turned over at once.
const TURNED: usize = 8;
/// Rows and columns of a tile of them.
const TILE: usize = 32;

/// A symmetric matrix of which what lies on the diagonal and below is kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Symmetric {
    size: usize,
    values: Vec<f64>,
}

/// A part of a symmetric matrix: the places of its rows and columns, and what is there. Of one whose rows are its columns
/// what lies on its diagonal and below counts.
#[derive(Clone, Copy, Debug)]
pub struct Part<'p> {
    /// As many rows and columns as there are places for.
    pub values: &'p DMatrix<f64>,
    /// Places of its rows.
    pub rows: &'p [usize],
    /// Places of its columns.
    pub columns: &'p [usize],
}

impl Part<'_> {
    /// Puts it into what is kept of a matrix whose columns would begin at `places` if they began with the first row.
    fn put(&self, places: &[usize], kept: &mut [f64]) {
        let Self {
            values,
            rows,
            columns,
        } = *self;
        let square = rows == columns;
        assert_eq!(values.shape(), (rows.len(), columns.len()), "places");
        let outside = |place: &usize| *place >= places.len();
        assert!(!rows.iter().chain(columns).any(outside), "a place outside");
        for start in (0..columns.len()).step_by(TURNED) {
            let some = start..(start + TURNED).min(columns.len());
            for (i, &row) in rows.iter().enumerate().skip(if square { start } else { 0 }) {
                for j in some.clone().filter(|&j| !square || j <= i) {
                    let column = columns[j];
                    kept[places[row.min(column)] + row.max(column)] = values[(i, j)];
                }
            }
        }
    }
}

/// A panel: where it lies in the matrix and in memory.
struct Panel {
    /// Its columns; its rows begin where these do.
    columns: Range<usize>,
    values: Range<usize>,
}

/// The panels of a matrix of this size.
fn panels(size: usize) -> impl Iterator<Item = Panel> {
    let mut next = 0;
    (0..size).step_by(PANEL).map(move |start| {
        let columns = start..(start + PANEL).min(size);
        let first = next;
        next += (size - start) * columns.len();
        Panel {
            columns,
            values: first..next,
        }
    })
}

impl Symmetric {
    /// `size` rows and columns of zeros.
    pub fn zeros(size: usize) -> Self {
        let room = panels(size).last().map_or(0, |p| p.values.end);
        Self {
            size,
            values: vec![0.0; room],
        }
    }

    /// `E^T E`; `rows` is E, any number x size.
    pub fn of_products(rows: &DMatrix<f64>) -> Self {
        let mut out = Self::zeros(rows.ncols());
        out.add_products(1.0, rows);
        out
    }

    /// Of parts, each at its places, a later one in the place of what an earlier one has there.
    ///
    /// # Panics
    ///
    /// Where a part has another shape than its places, or one of these lies outside.
    pub fn of_parts<'p>(size: usize, parts: impl IntoIterator<Item = Part<'p>>) -> Self {
        let mut out = Self::zeros(size);
        let places: Vec<usize> = (0..size).map(|j| place_of(j, size)).collect();
        for part in parts {
            part.put(&places, &mut out.values);
        }
        out.complete();
        out
    }

    /// Of a square matrix, by what lies on its diagonal and below.
    ///
    /// # Panics
    ///
    /// Where the matrix is not square.
    pub fn of_lower(matrix: &DMatrix<f64>) -> Self {
        assert!(matrix.is_square(), "only a square matrix is symmetric");
        let mut out = Self::zeros(matrix.nrows());
        for panel in panels(out.size) {
            let start = panel.columns.start;
            let from = matrix.view((start, start), (out.size - start, panel.columns.len()));
            out.view_mut(&panel).copy_from(&from);
        }
        out.complete();
        out
    }

    /// Rows, and columns.
    pub fn size(&self) -> usize {
        self.size
    }

    /// One element.
    ///
    /// # Panics
    ///
    /// Where it lies outside.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        let (row, column) = (i.max(j), i.min(j));
        assert!(row < self.size, "row {row} of {}", self.size);
        self.values[place_of(column, self.size) + row]
    }

    /// Makes it symmetric by what lies below the diagonal, where more is kept than that.
    fn complete(&mut self) {
        for panel in panels(self.size) {
            let mut square = self.view_mut(&panel);
            for j in 0..panel.columns.len() {
                for i in j + 1..panel.columns.len() {
                    square[(j, i)] = square[(i, j)];
                }
            }
        }
    }

    /// Adds `factor E^T E`; `rows` is E, any number x [`size`](Self::size).
    ///
    /// # Panics
    ///
    /// Where E has another number of columns.
    pub fn add_products(&mut self, factor: f64, rows: &DMatrix<f64>) {
        assert_eq!(rows.ncols(), self.size, "columns");
        let flipped = rows.transpose();
        for panel in panels(self.size) {
            let start = panel.columns.start;
            let below = flipped.rows(start, self.size - start);
            let columns = rows.columns(start, panel.columns.len());
            self.view_mut(&panel).gemm(factor, &below, &columns, 1.0);
        }
        self.complete();
    }

    /// Adds `factor` times another of its size.
    ///
    /// # Panics
    ///
    /// Where the other is of another size.
    pub fn add(&mut self, factor: f64, other: &Self) {
        assert_eq!(self.size, other.size, "of another size");
        for (own, other) in self.values.iter_mut().zip(&other.values) {
            *own += factor * other;
        }
    }

    /// Adds `factor` times its first rows and columns, as many as `right` has rows, times `right` to `out`.
    pub(crate) fn add_first_times(
        &self,
        factor: f64,
        right: &DMatrix<f64>,
        out: &mut DMatrix<f64>,
    ) {
        let n = right.nrows();
        for panel in panels(self.size).take_while(|p| p.columns.start < n) {
            let start = panel.columns.start;
            let width = panel.columns.end.min(n) - start;
            let own = self.view(&panel);
            let own = own.view((0, 0), (n - start, width));
            let mut into = out.rows_mut(start, n - start);
            into.gemm(factor, &own, &right.rows(start, width), 1.0);
            let below = n - start - width;
            let turned = own.rows(width, below).transpose();
            let mut into = out.rows_mut(start, width);
            into.gemm(factor, &turned, &right.rows(start + width, below), 1.0);
        }
    }

    /// Its first `rows` of these columns, none of which is among the first `rows`, times `factor`.
    pub(crate) fn first_rows(&self, rows: usize, columns: &[usize], factor: f64) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(rows, columns.len());
        for row in 0..rows {
            // a row of what lies above the diagonal is a column of what lies below
            let first = place_of(row, self.size);
            for (into, &column) in out.row_mut(row).iter_mut().zip(columns) {
                *into = factor * self.values[first + column];
            }
        }
        out
    }

    /// `z^T M z`.
    pub fn quadratic(&self, z: &DVector<f64>) -> f64 {
        let mut sum = 0.0;
        for (j, &own) in z.iter().enumerate().filter(|(_, own)| **own != 0.0) {
            let first = place_of(j, self.size) + j;
            let column = &self.values[first..first + self.size - j];
            let below = column[1..].iter().zip(z.iter().skip(j + 1));
            let below: f64 = below.map(|(m, z)| m * z).sum();
            sum += own * (column[0] * own + 2.0 * below);
        }
        sum
    }

    /// Its diagonal.
    pub fn diagonal(&self) -> DVector<f64> {
        DVector::from_fn(self.size, |k, _| self.at(k, k))
    }

    /// Some of its rows and columns, in any order.
    #[must_use]
    pub fn picked(&self, which: &[usize]) -> Self {
        let mut out = Self::zeros(which.len());
        for panel in panels(which.len()) {
            let mut into = out.view_mut(&panel);
            let start = panel.columns.start;
            for (mut into, &column) in into.column_iter_mut().zip(&which[panel.columns]) {
                let rows = &which[start..];
                into.iter_mut()
                    .zip(rows)
                    .for_each(|(into, &row)| *into = self.at(row, column));
            }
        }
        out
    }

    /// With rows and columns of zeros from `first` on.
    #[must_use]
    pub fn widened(&self, first: usize, added: usize) -> Self {
        let mut out = Self::zeros(self.size + added);
        let moved = |k: usize| if k < first { k } else { k + added };
        for column in 0..self.size {
            let own = place_of(column, self.size);
            let into = place_of(moved(column), out.size);
            for row in column..self.size {
                out.values[into + moved(row)] = self.values[own + row];
            }
        }
        out.complete();
        out
    }

    /// Makes a row and column zero.
    ///
    /// # Panics
    ///
    /// Where there is no such column.
    pub fn clear(&mut self, column: usize) {
        self.put_column(column, &vec![0.0; self.size]);
    }

    /// Puts numbers in the place of a column, and of the same row.
    ///
    /// # Panics
    ///
    /// Unless there is such a column, and a number for each row.
    pub fn put_column(&mut self, column: usize, values: &[f64]) {
        assert!(column < self.size, "column {column} of {}", self.size);
        assert_eq!(values.len(), self.size, "a number for each row");
        for (row, &value) in values.iter().enumerate() {
            let (i, j) = (row.max(column), row.min(column));
            let below = place_of(j, self.size) + i;
            self.values[below] = value;
            // the square in which a panel begins is kept whole
            if i / PANEL == j / PANEL {
                let above = place_of(i, self.size) + j;
                self.values[above] = value;
            }
        }
    }

    fn view(&self, panel: &Panel) -> DMatrixView<'_, f64> {
        let values = &self.values[panel.values.clone()];
        DMatrixView::from_slice(values, self.size - panel.columns.start, panel.columns.len())
    }

    fn view_mut(&mut self, panel: &Panel) -> DMatrixViewMut<'_, f64> {
        let values = &mut self.values[panel.values.clone()];
        let rows = self.size - panel.columns.start;
        DMatrixViewMut::from_slice(values, rows, panel.columns.len())
    }
}

impl From<&Symmetric> for DMatrix<f64> {
    fn from(matrix: &Symmetric) -> Self {
        let n = matrix.size;
        let mut out = Self::zeros(n, n);
        for panel in panels(n) {
            let start = panel.columns.start;
            let mut into = out.view_mut((start, start), (n - start, panel.columns.len()));
            into.copy_from(&matrix.view(&panel));
        }
        let values = out.as_mut_slice();
        for first in (0..n).step_by(TILE) {
            for start in (first..n).step_by(TILE) {
                for j in first..(first + TILE).min(n) {
                    for i in start.max(j + 1)..(start + TILE).min(n) {
                        values[i * n + j] = values[j * n + i];
                    }
                }
            }
        }
        out
    }
}

/// Where column `j` of a matrix of this size would begin if it began with the first row.
fn place_of(j: usize, size: usize) -> usize {
    let panel = j / PANEL;
    let start = panel * PANEL;
    // the panels before: PANEL columns each, of `size` rows less those that lie above
    let before = PANEL * panel * size - PANEL * PANEL * (panel * panel.saturating_sub(1) / 2);
    before + (j - start) * (size - start) - start
}

#[cfg(test)]
mod tests {
    use super::*;

    /// More than two panels, the last of them narrow.
    const SIZE: usize = 2 * PANEL + 7;

    fn made(rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |i, j| {
            (1.3 * i as f64 + 0.7 * (j * j) as f64).sin()
        })
    }

    fn dense() -> DMatrix<f64> {
        let rows = made(SIZE + 3, SIZE);
        rows.tr_mul(&rows)
    }

    fn close(ours: &DMatrix<f64>, other: &DMatrix<f64>) {
        assert_eq!(ours.shape(), other.shape());
        let off = (ours - other).norm();
        assert!(off <= 1e-12 * other.norm(), "off by {off}");
    }

    #[test]
    fn half_of_a_matrix_is_all_of_it() {
        let dense = dense();
        let half = Symmetric::of_lower(&dense);
        assert_eq!(half.size(), SIZE);
        assert!(half.values.len() < SIZE * (SIZE + 2 * PANEL) / 2);
        for (i, j) in [(0, 0), (3, 90), (90, 3), (SIZE - 1, 0), (70, 71), (71, 70)] {
            let kept = dense[(i.max(j), i.min(j))];
            assert_eq!(half.at(i, j).to_bits(), kept.to_bits());
        }
        close(&DMatrix::from(&half), &dense);
        assert_eq!(half.diagonal(), dense.diagonal());
        for size in [0, 1, PANEL - 1, PANEL, PANEL + 1, 2 * PANEL] {
            let some = dense.view((0, 0), (size, size)).into_owned();
            close(&DMatrix::from(&Symmetric::of_lower(&some)), &some);
        }
    }

    #[test]
    fn products_and_sums_are_those_of_the_whole() {
        let dense = dense();
        let mut half = Symmetric::of_lower(&dense);
        let rows = made(5, SIZE);
        half.add_products(-0.3, &rows);
        half.add(2.0, &Symmetric::of_lower(&dense));
        let dense = 3.0 * dense - 0.3 * rows.tr_mul(&rows);
        close(&DMatrix::from(&half), &dense);
        let z = DVector::from_fn(SIZE, |k, _| if k % 3 == 0 { 0.0 } else { (k as f64).cos() });
        let [ours, other] = [half.quadratic(&z), z.dot(&(&dense * &z))];
        assert!((ours - other).abs() < 1e-10 * other.abs());
        // first rows that end within a panel, with one, and beyond one
        for n in [5, PANEL, PANEL + 9, SIZE] {
            let right = made(n, 4);
            let mut ours = made(n, 4);
            half.add_first_times(0.7, &right, &mut ours);
            close(
                &ours,
                &(made(n, 4) + 0.7 * dense.view((0, 0), (n, n)) * &right),
            );
        }
        let columns = [SIZE - 1, PANEL + 4, SIZE - 3];
        let other = 2.0 * dense.select_columns(&columns).rows(0, PANEL);
        close(&half.first_rows(PANEL, &columns, 2.0), &other);
    }

    /// Squares that are kept whole stay symmetric whatever is put into them.
    #[test]
    fn columns_are_moved_put_and_cleared() {
        let dense = dense();
        let half = Symmetric::of_lower(&dense);
        let which: Vec<usize> = (0..SIZE).rev().step_by(2).collect();
        let some = dense.select_columns(&which).select_rows(&which);
        close(&DMatrix::from(&half.picked(&which)), &some);
        let wider = dense
            .clone()
            .insert_columns(67, 3, 0.0)
            .insert_rows(67, 3, 0.0);
        let mut ours = half.widened(67, 3);
        close(&DMatrix::from(&ours), &wider);
        for (column, clear) in [(68, false), (2, false), (65, true)] {
            let mut wider = DMatrix::from(&ours);
            let values = if clear {
                ours.clear(column);
                DVector::zeros(SIZE + 3)
            } else {
                let values = DVector::from_fn(SIZE + 3, |k, _| k as f64);
                ours.put_column(column, values.as_slice());
                values
            };
            wider.set_column(column, &values);
            wider.set_row(column, &values.transpose());
            close(&DMatrix::from(&ours), &wider);
            assert_eq!(ours, Symmetric::of_lower(&wider));
        }
    }

    #[test]
    fn parts_stand_where_they_are_put() {
        let dense = dense();
        let order: Vec<usize> = (0..SIZE).map(|k| (k * 2) % SIZE).collect();
        let turned = dense.select_columns(&order).select_rows(&order);
        let (first, last) = order.split_at(80);
        let parts = [(first, first), (last, first), (last, last)];
        let parts = parts.map(|(rows, columns)| {
            let values = dense.select_rows(rows).select_columns(columns);
            (values, rows, columns)
        });
        let parts = parts.each_ref().map(|(values, rows, columns)| Part {
            values,
            rows,
            columns,
        });
        let ours = Symmetric::of_parts(SIZE, parts);
        close(&DMatrix::from(&ours), &dense);
        let whole = Symmetric::of_lower(&turned);
        let part = Part {
            values: &DMatrix::from(&whole),
            rows: &order,
            columns: &order,
        };
        let back = Symmetric::of_parts(SIZE, [part]);
        assert_eq!(back, Symmetric::of_lower(&dense));
    }
}
