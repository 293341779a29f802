//! Columns at star level: nuisance, candidates and residuals, in arcsec.
//!
//! The distortion of both axes is the same polynomials of position, one axis' columns
//! being zero in the rows of the other. So three matrices stand for the whole design,
//!
//! ```text
//! rows of x: [ D 0 | X ]     rows of y: [ 0 D | Y ]
//! ```
//!
//! and a product of all columns with themselves costs a third of what it would.
//! In a Gram matrix the columns stand as `nuisance | candidates | residuals`.
//!
//! Source: [M23] Eq. 5-8 (the polynomials).

use std::ops::Range;

use effects::{Candidate, StarRows};
use focal_plane::{AttitudeSource, PointsMut};
use nalgebra::{DMatrix, DVector};

use crate::nuisance::StarNuisance;
use crate::star_data::StarData;

/// The columns of one bundle's star rows.
pub(crate) struct StarColumns<'a> {
    pub(crate) data: &'a StarData,
    pub(crate) nuisance: &'a StarNuisance,
    pub(crate) candidates: &'a [&'a dyn Candidate],
    /// Residual variants, each `[x, y]` in arcsec over all rows.
    pub(crate) residuals: &'a [[Vec<f64>; 2]],
    /// The motion that candidates may evaluate.
    pub(crate) motion: Option<&'a dyn AttitudeSource>,
}

/// The columns of some rows.
#[derive(Clone, Debug)]
pub(crate) struct Filled {
    /// D: polynomials of position.
    pub(crate) shared: DMatrix<f64>,
    /// X and Y: everything else.
    pub(crate) own: [DMatrix<f64>; 2],
}

impl Default for Filled {
    fn default() -> Self {
        let empty = || DMatrix::zeros(0, 0);
        Self {
            shared: empty(),
            own: [empty(), empty()],
        }
    }
}

impl Filled {
    /// Some of the rows.
    pub(crate) fn rows(&self, rows: Range<usize>) -> Self {
        let part = |m: &DMatrix<f64>| m.rows(rows.start, rows.len()).into_owned();
        Self {
            shared: part(&self.shared),
            own: self.own.each_ref().map(part),
        }
    }

    /// Rows for the columns of `layout`, all zero.
    fn reset(&mut self, rows: usize, layout: Layout) {
        let clear = |m: &mut DMatrix<f64>, columns: usize| {
            if m.shape() == (rows, columns) {
                m.fill(0.0);
            } else {
                *m = DMatrix::zeros(rows, columns);
            }
        };
        clear(&mut self.shared, layout.shared);
        for own in &mut self.own {
            clear(own, layout.own());
        }
    }
}

/// Where the columns of [`Filled`] stand in a Gram matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    /// Own columns before the distortion: the misalignment.
    before: usize,
    /// Polynomials.
    pub(crate) shared: usize,
    /// Own columns after the distortion.
    after: usize,
}

impl Layout {
    pub(crate) fn own(self) -> usize {
        self.before + self.after
    }

    /// Columns in all.
    pub(crate) fn width(self) -> usize {
        self.own() + 2 * self.shared
    }

    /// Column of polynomial `k` on `axis`.
    pub(crate) fn shared_at(self, k: usize, axis: usize) -> usize {
        self.before + 2 * k + axis
    }

    /// Column of own column `k`.
    pub(crate) fn own_at(self, k: usize) -> usize {
        if k < self.before {
            k
        } else {
            k + 2 * self.shared
        }
    }
}

impl StarColumns<'_> {
    pub(crate) fn layout(&self) -> Layout {
        let (before, shared, directions) = self.nuisance.parts();
        let candidates: usize = self.candidates.iter().map(|c| c.coefficients().len()).sum();
        Layout {
            before,
            shared,
            after: directions + candidates + self.residuals.len(),
        }
    }

    /// The rows of `frames` as effects see them.
    fn rows(&self, rows: Range<usize>) -> StarRows<'_> {
        let d = self.data;
        StarRows {
            t_s: &d.t_s[rows.clone()],
            x_px: &d.modelled[0][rows.clone()],
            y_px: &d.modelled[1][rows.clone()],
            vx_px_s: &d.velocity[0][rows.clone()],
            vy_px_s: &d.velocity[1][rows.clone()],
            ax_px_s2: &d.acceleration[0][rows.clone()],
            ay_px_s2: &d.acceleration[1][rows.clone()],
            mag: &d.mag[rows.clone()],
            bv: &d.bv[rows.clone()],
            slot: &d.frames.slot[rows.clone()],
            star_id: &d.frames.star_id[rows],
            attitude: self.motion,
        }
    }

    /// Fills the rows of `frames`, outliers too.
    pub(crate) fn fill(&self, frames: Range<usize>, out: &mut Filled) {
        let data = self.data;
        let rows = data.frames.first_row[frames.start]..data.frames.first_row[frames.end];
        let n = rows.len();
        out.reset(n, self.layout());
        self.nuisance.fill(data, frames, out);
        let (before, _, directions) = self.nuisance.parts();
        let mut column = before + directions;
        let seen = self.rows(rows.clone());
        let scale = data.camera.arcsec_per_px();
        let [x, y] = &mut out.own;
        for candidate in self.candidates {
            let p = candidate.coefficients().len();
            let at = column * n..(column + p) * n;
            let (x, y) = (
                &mut x.as_mut_slice()[at.clone()],
                &mut y.as_mut_slice()[at],
            );
            if candidate.star_columns(
                &data.camera,
                &seen,
                PointsMut {
                    x: &mut *x,
                    y: &mut *y,
                },
            ) {
                x.iter_mut().for_each(|v| *v *= scale[0]);
                y.iter_mut().for_each(|v| *v *= scale[1]);
            } else {
                x.fill(0.0);
                y.fill(0.0);
            }
            column += p;
        }
        for residual in self.residuals {
            x.column_mut(column)
                .copy_from_slice(&residual[0][rows.clone()]);
            y.column_mut(column)
                .copy_from_slice(&residual[1][rows.clone()]);
            column += 1;
        }
    }

    /// Zeroes the rows of outliers; returns how many of `frames`' rows count.
    pub(crate) fn mask(&self, frames: Range<usize>, out: &mut Filled) -> usize {
        let data = self.data;
        let rows = data.frames.first_row[frames.start]..data.frames.first_row[frames.end];
        let mut used = rows.len();
        for i in (0..rows.len()).filter(|i| data.outlier[rows.start + i]) {
            out.shared.row_mut(i).fill(0.0);
            for own in &mut out.own {
                own.row_mut(i).fill(0.0);
            }
            used -= 1;
        }
        used
    }

    /// What `amplitudes` (nuisance and candidates) shift the filled rows by, arcsec.
    pub(crate) fn shift(&self, filled: &Filled, amplitudes: &DVector<f64>) -> [DVector<f64>; 2] {
        let layout = self.layout();
        let own = DVector::from_fn(layout.own() - self.residuals.len(), |k, _| {
            amplitudes[layout.own_at(k)]
        });
        std::array::from_fn(|axis| {
            let shared =
                DVector::from_fn(layout.shared, |k, _| amplitudes[layout.shared_at(k, axis)]);
            &filled.shared * shared + filled.own[axis].columns(0, own.len()) * &own
        })
    }
}
