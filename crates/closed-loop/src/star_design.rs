//! Design rows at star level: nuisance, candidates and residuals, in arcsec.
//!
//! Where every frame's attitude is a free unknown, it is eliminated exactly: each
//! column c of a frame is replaced by what no small rotation can explain,
//!
//! ```text
//! c - A (A^T A)^-1 A^T c,   A = the rotation columns of the frame's stars
//! ```
//!
//! which is the Schur complement of the frame's three angles.
//!
//! Source: the partitioned normal equations of bundle adjustment (Brown 1958).

use std::ops::Range;

use effects::{Candidate, StarRows};
use focal_plane::{ARCSEC_PER_RAD, AttitudeSource, Pixel, PointsMut};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::common_noise::{CommonNoise, STATES, Whitener};
use crate::evidence::{Amplitudes, Evidence, Residuals};
use crate::folds::Folds;
use crate::gram::Design;
use crate::nuisance::StarNuisance;
use crate::star_data::StarData;

/// The columns of one bundle's star rows.
pub(crate) struct StarDesign<'a> {
    pub(crate) data: &'a StarData,
    pub(crate) nuisance: &'a StarNuisance,
    pub(crate) candidates: &'a [&'a dyn Candidate],
    /// Residual variants, each `[x, y]` in arcsec over all rows.
    pub(crate) residuals: &'a [[Vec<f64>; 2]],
    /// The motion that candidates may evaluate.
    pub(crate) motion: Option<&'a dyn AttitudeSource>,
    /// The filter of what all stars of a frame share.
    pub(crate) whitener: Option<&'a Whitener>,
}

impl StarDesign<'_> {
    /// Columns of all candidates.
    pub(crate) fn candidate_columns(candidates: &[&dyn Candidate]) -> usize {
        candidates.iter().map(|c| c.coefficients().len()).sum()
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

    /// Fills rows without mask or projection: x of every row, then y.
    pub(crate) fn fill_raw(&self, frames: Range<usize>, out: &mut DMatrix<f64>) {
        let data = self.data;
        let rows = data.frames.first_row[frames.start]..data.frames.first_row[frames.end];
        let n = rows.len();
        if out.nrows() == 2 * n {
            out.fill(0.0);
        } else {
            *out = DMatrix::zeros(2 * n, self.width());
        }
        let mut scratch = Vec::new();
        for frame in frames {
            for row in data.frames.rows_of(frame) {
                let i = row - rows.start;
                self.nuisance
                    .row(data, frame, row, &mut scratch, &mut |column, dx, dy| {
                        out[(i, column)] = dx;
                        out[(n + i, column)] = dy;
                    });
            }
        }
        let mut column = self.nuisance.columns();
        let seen = self.rows(rows.clone());
        let scale = data.camera.arcsec_per_px();
        let (mut x, mut y) = (Vec::new(), Vec::new());
        for candidate in self.candidates {
            let p = candidate.coefficients().len();
            x.clear();
            x.resize(p * n, 0.0);
            y.clear();
            y.resize(p * n, 0.0);
            if candidate.star_columns(
                &data.camera,
                &seen,
                PointsMut {
                    x: &mut x,
                    y: &mut y,
                },
            ) {
                for j in 0..p {
                    for i in 0..n {
                        out[(i, column + j)] = x[j * n + i] * scale[0];
                        out[(n + i, column + j)] = y[j * n + i] * scale[1];
                    }
                }
            }
            column += p;
        }
        for residual in self.residuals {
            for i in 0..n {
                out[(i, column)] = residual[0][rows.start + i];
                out[(n + i, column)] = residual[1][rows.start + i];
            }
            column += 1;
        }
    }

    /// Masks outliers and eliminates the frames' attitudes in filled rows;
    /// returns the scalars that count.
    pub(crate) fn mask_and_project(&self, frames: Range<usize>, out: &mut DMatrix<f64>) -> usize {
        let data = self.data;
        let first = data.frames.first_row[frames.start];
        let n = out.nrows() / 2;
        self.mask(first, out);
        if !data.free_attitude {
            return 2 * (0..n).filter(|i| !data.outlier[first + i]).count();
        }
        frames
            .map(|frame| project_frame(data, frame, first, out))
            .sum()
    }
}

impl StarDesign<'_> {
    /// Zeroes the rows of outliers.
    fn mask(&self, first: usize, out: &mut DMatrix<f64>) {
        let n = out.nrows() / 2;
        for i in (0..n).filter(|i| self.data.outlier[first + i]) {
            out.row_mut(i).fill(0.0);
            out.row_mut(n + i).fill(0.0);
        }
    }
}

impl Design for StarDesign<'_> {
    fn width(&self) -> usize {
        self.nuisance.columns() + Self::candidate_columns(self.candidates) + self.residuals.len()
    }

    fn states(&self) -> usize {
        self.whitener.map_or(0, |_| STATES)
    }

    fn fill_from(
        &self,
        frames: Range<usize>,
        state: &mut DMatrix<f64>,
        out: &mut DMatrix<f64>,
    ) -> usize {
        let Some(whitener) = self.whitener else {
            return self.fill(frames, out);
        };
        let mut raw = DMatrix::zeros(0, 0);
        self.fill_raw(frames.clone(), &mut raw);
        self.mask(self.data.frames.first_row[frames.start], &mut raw);
        whitener.apply(self.data, frames, &raw, state, out)
    }

    fn fill(&self, frames: Range<usize>, out: &mut DMatrix<f64>) -> usize {
        self.fill_raw(frames.clone(), out);
        self.mask_and_project(frames, out)
    }
}

/// Rotation columns of one row, arcsec per arcsec.
pub(crate) fn rotation_row(data: &StarData, row: usize) -> [[f64; 3]; 2] {
    let at = Pixel {
        x: data.modelled[0][row],
        y: data.modelled[1][row],
    };
    let scale = data.camera.arcsec_per_px();
    let mut jacobian = data.camera.rotation_jacobian(at);
    for axis in 0..2 {
        for k in 0..3 {
            jacobian[axis][k] *= scale[axis] / ARCSEC_PER_RAD;
        }
    }
    jacobian
}

/// Inverse normal matrix of a frame's rotation over the rows that count.
pub(crate) fn rotation_inverse(data: &StarData, frame: usize) -> Option<Matrix3<f64>> {
    let mut normal = Matrix3::zeros();
    let mut used = 0;
    for row in data.frames.rows_of(frame).filter(|&r| !data.outlier[r]) {
        for axis in rotation_row(data, row) {
            let a = Vector3::from(axis);
            normal += a * a.transpose();
        }
        used += 1;
    }
    // Two stars give four numbers for three angles; one gives none to spare.
    if used < 2 { None } else { normal.try_inverse() }
}

/// Removes from every column what a rotation of the frame explains; the frame
/// is emptied where its attitude cannot be solved.
fn project_frame(data: &StarData, frame: usize, first: usize, out: &mut DMatrix<f64>) -> usize {
    let rows = data.frames.rows_of(frame);
    let (at, m) = (rows.start - first, rows.len());
    let n = out.nrows() / 2;
    let Some(inverse) = rotation_inverse(data, frame) else {
        out.rows_mut(at, m).fill(0.0);
        out.rows_mut(n + at, m).fill(0.0);
        return 0;
    };
    let jacobian: Vec<[[f64; 3]; 2]> = rows.clone().map(|r| rotation_row(data, r)).collect();
    let used: Vec<bool> = rows.map(|r| !data.outlier[r]).collect();
    for column in 0..out.ncols() {
        let mut whole = out.column_mut(column);
        let mut moment = Vector3::zeros();
        for i in (0..m).filter(|&i| used[i]) {
            for axis in 0..2 {
                moment += Vector3::from(jacobian[i][axis]) * whole[axis * n + at + i];
            }
        }
        let theta = inverse * moment;
        for i in (0..m).filter(|&i| used[i]) {
            for axis in 0..2 {
                whole[axis * n + at + i] -= Vector3::from(jacobian[i][axis]).dot(&theta);
            }
        }
    }
    (2 * used.iter().filter(|u| **u).count()).saturating_sub(3)
}

/// Star measurements as evidence.
pub(crate) struct StarEvidence<'a> {
    pub(crate) data: &'a StarData,
    pub(crate) nuisance: StarNuisance,
    /// Residual variants: one, or one a fold and a last one for all data.
    pub(crate) residuals: Vec<[Vec<f64>; 2]>,
    pub(crate) motion: Option<&'a dyn AttitudeSource>,
    /// First guess of the noise of a centroid, per axis, arcsec.
    pub(crate) sigma_guess_arcsec: f64,
    /// The filter of what all stars of a frame share.
    pub(crate) whitener: Option<Whitener>,
}

impl StarEvidence<'_> {
    /// The same evidence under a noise that frames share.
    pub(crate) fn with_noise(&self, noise: &CommonNoise) -> Self {
        Self {
            data: self.data,
            nuisance: self.nuisance.clone(),
            residuals: self.residuals.clone(),
            motion: self.motion,
            sigma_guess_arcsec: 1.0,
            whitener: Some(Whitener::new(self.data, noise)),
        }
    }

    /// The residual variant of a fold.
    fn residual(&self, fold: usize) -> &[Vec<f64>; 2] {
        &self.residuals[if self.residuals.len() == 1 { 0 } else { fold }]
    }
}

impl Evidence for StarEvidence<'_> {
    fn precision(&self) -> Vec<f64> {
        self.nuisance.precision()
    }

    fn residual_columns(&self) -> usize {
        self.residuals.len()
    }

    fn variance_guess(&self) -> f64 {
        self.sigma_guess_arcsec * self.sigma_guess_arcsec
    }

    fn design<'a>(&'a self, candidates: &'a [&'a dyn Candidate]) -> Box<dyn Design + 'a> {
        Box::new(StarDesign {
            data: self.data,
            nuisance: &self.nuisance,
            candidates,
            residuals: &self.residuals,
            motion: self.motion,
            whitener: self.whitener.as_ref(),
        })
    }

    fn log_scale(&self) -> f64 {
        self.whitener.as_ref().map_or(0.0, |w| w.log_scale)
    }

    fn residuals(
        &self,
        folds: &Folds,
        candidates: &[&dyn Candidate],
        amplitudes: &Amplitudes,
    ) -> Residuals {
        let data = self.data;
        let design = StarDesign {
            data,
            nuisance: &self.nuisance,
            candidates,
            residuals: &[],
            motion: self.motion,
            whitener: None,
        };
        let rows = data.t_s.len();
        let mut out = Residuals {
            axes: vec![vec![0.0; rows]; 2],
            modelled: vec![vec![0.0; rows]; 2],
        };
        let mut filled = DMatrix::zeros(0, design.width());
        for (frame, fold) in folds.fold_of_frame().into_iter().enumerate() {
            let (nuisance, candidate) = (&amplitudes.nuisance[fold], &amplitudes.candidates[fold]);
            let whole = DVector::from_iterator(
                nuisance.len() + candidate.len(),
                nuisance.iter().chain(candidate.iter()).copied(),
            );
            design.fill_raw(frame..frame + 1, &mut filled);
            let shift = &filled * whole;
            let at = data.frames.rows_of(frame);
            let m = at.len();
            for (i, row) in at.enumerate() {
                for axis in 0..2 {
                    let s = shift[axis * m + i];
                    out.modelled[axis][row] = s;
                    out.axes[axis][row] = self.residual(fold)[axis][row] - s;
                }
            }
            if data.free_attitude {
                remove_attitude(data, frame, &mut out.axes);
            }
        }
        out
    }
}

/// Takes from a frame's residuals the rotation that its stars (outliers aside)
/// agree on; a frame whose attitude cannot be solved has no residual: NaN.
fn remove_attitude(data: &StarData, frame: usize, residual: &mut [Vec<f64>]) {
    let theta = rotation_of(data, frame, residual);
    for row in data.frames.rows_of(frame) {
        let jacobian = rotation_row(data, row);
        for axis in 0..2 {
            residual[axis][row] = theta.map_or(f64::NAN, |t| {
                residual[axis][row] - Vector3::from(jacobian[axis]).dot(&t)
            });
        }
    }
}

/// The rotation, arcsec, that a frame's star shifts amount to, by least squares.
pub(crate) fn rotation_of(
    data: &StarData,
    frame: usize,
    shift: &[Vec<f64>],
) -> Option<Vector3<f64>> {
    let inverse = rotation_inverse(data, frame)?;
    let mut moment = Vector3::zeros();
    for row in data.frames.rows_of(frame).filter(|&r| !data.outlier[r]) {
        let jacobian = rotation_row(data, row);
        for axis in 0..2 {
            moment += Vector3::from(jacobian[axis]) * shift[axis][row];
        }
    }
    Some(inverse * moment)
}
