//! The forms in which columns of star rows are held, and where these stand in a Gram matrix.
//!
//! Most columns have a form that makes their products cheap. The distortion of both
//! axes is the same polynomials of position, one axis' columns being zero in the rows of
//! the other; and what turns the camera as a whole is the same rotation for all stars of
//! a frame:
//!
//! ```text
//! rows of x: [ D 0 | X | A_x T ]     rows of y: [ 0 D | Y | A_y T ]     A: columns of a rotation
//! ```
//!
//! Source: [M23] Eq. 5-8 (the polynomials).

use nalgebra::DMatrix;

/// The columns of some frames.
#[derive(Clone, Debug)]
pub(crate) struct Filled {
    /// D: polynomials of position, a column a star.
    pub(crate) shared: DMatrix<f64>,
    /// X and Y: everything that has no special form, a row a star.
    pub(crate) own: [DMatrix<f64>; 2],
    /// T: rotations, arcsec, three rows a frame.
    pub(crate) turn: DMatrix<f64>,
    /// Weight of each row, once they are weighed.
    pub(super) weight: Vec<f64>,
}

impl Default for Filled {
    fn default() -> Self {
        let empty = || DMatrix::zeros(0, 0);
        Self {
            shared: empty(),
            own: [empty(), empty()],
            turn: empty(),
            weight: Vec::new(),
        }
    }
}

impl Filled {
    /// Rows for the columns of `layout`; the first `nuisance` own ones and the turns are zero.
    pub(super) fn reset(&mut self, rows: usize, frames: usize, layout: &Layout, nuisance: usize) {
        let shape = |m: &mut DMatrix<f64>, rows: usize, columns: usize| {
            if m.shape() != (rows, columns) {
                *m = zeros_in(m, rows, columns);
            }
        };
        shape(&mut self.shared, layout.shared, rows);
        for own in &mut self.own {
            shape(own, rows, layout.own.len());
            own.columns_mut(0, nuisance).fill(0.0);
        }
        shape(&mut self.turn, 3 * frames, layout.turn.len());
        self.turn.fill(0.0);
    }
}

/// A matrix of zeros in the memory of another one, which is empty then.
pub(super) fn zeros_in(matrix: &mut DMatrix<f64>, rows: usize, columns: usize) -> DMatrix<f64> {
    let matrix = std::mem::replace(matrix, DMatrix::zeros(0, 0));
    let mut values: Vec<f64> = matrix.data.into();
    values.clear();
    values.resize(rows * columns, 0.0);
    DMatrix::from_vec(rows, columns, values)
}

/// Where the columns of [`Filled`] stand in a Gram matrix.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Layout {
    /// Polynomials, and the place of the first one's x.
    pub(crate) shared: usize,
    pub(super) shared_from: usize,
    /// Places of the columns of X and Y, and of T.
    pub(crate) own: Vec<usize>,
    pub(crate) turn: Vec<usize>,
    /// Candidates whose columns stand among X and Y, and those that are filled by someone else, with the
    /// residuals; none where that is empty.
    pub(super) by_rows: Vec<bool>,
    pub(super) left_out: Vec<bool>,
}

/// Place of polynomial `k` on `axis` where the first one's x stands at `from`.
pub(super) fn shared_at(from: usize, k: usize, axis: usize) -> usize {
    from + 2 * k + axis
}

impl Layout {
    /// Columns in all.
    pub(crate) fn width(&self) -> usize {
        2 * self.shared + self.own.len() + self.turn.len()
    }

    /// Place of polynomial `k` on `axis`.
    pub(crate) fn shared_at(&self, k: usize, axis: usize) -> usize {
        shared_at(self.shared_from, k, axis)
    }

    /// The same without the columns of these candidates, and without the residuals, which someone else fills.
    pub(crate) fn leaving_out(mut self, candidates: &[bool]) -> Self {
        self.left_out = candidates.to_vec();
        self
    }

    /// Places of all columns: D on x, D on y, X and Y, T.
    pub(crate) fn places(&self) -> Vec<usize> {
        (0..2)
            .flat_map(|axis| (0..self.shared).map(move |k| self.shared_at(k, axis)))
            .chain(self.own.iter().copied())
            .chain(self.turn.iter().copied())
            .collect()
    }
}
