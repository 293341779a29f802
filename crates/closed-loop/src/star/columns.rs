//! Columns at star level: nuisance, candidates and residuals, in arcsec.
//!
//! In a Gram matrix they stand as `nuisance | candidates | residuals`; which of them have a form that makes
//! their products cheap is told in [`crate::star::layout`].
//!
//! Not physics: which columns stand beside which.

use std::ops::Range;

use effects::{AttitudeRows, Candidate, PixelWaves, StarRows};
use focal_plane::{ARCSEC_PER_RAD, AttitudeSource, Camera, PointsMut, VectorsMut};
use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

use crate::star::data::StarData;
use crate::star::frame_rotation::rotation_row;
use crate::star::layout::{Filled, Layout};
use crate::star::nuisance::StarNuisance;

/// Frames whose columns are gone through at once where no products are formed.
pub(crate) const CHUNK_FRAMES: usize = 64;
/// Of so many such columns in two forms are compared, or twice as many.
const MOST_COMPARED: usize = 300;

/// The columns of one bundle's star rows.
pub(crate) struct StarColumns<'a> {
    pub(crate) data: &'a StarData,
    pub(crate) nuisance: &'a StarNuisance,
    pub(crate) candidates: &'a [&'a dyn Candidate],
    /// Residual variants, each `[x, y]` in arcsec over all rows.
    pub(crate) residuals: &'a [[Vec<f64>; 2]],
    /// The motion that candidates may evaluate.
    pub(crate) motion: Option<&'a dyn AttitudeSource>,
    /// Weight of each row ([`crate::star::weights`]).
    pub(crate) weight: &'a [f64],
}

impl StarColumns<'_> {
    pub(crate) fn layout(&self) -> Layout {
        self.layout_with(|_| false)
    }

    /// Where all that these candidates turn has a row a star.
    pub(crate) fn layout_with(&self, by_rows: impl Fn(usize) -> bool) -> Layout {
        let (misalignment, shared, directions) = self.nuisance.parts();
        let each = self.candidates.iter().enumerate();
        let mut layout = Layout {
            shared,
            shared_from: misalignment,
            own: (0..misalignment).collect(),
            turn: Vec::new(),
            by_rows: each.map(|(c, k)| !k.turns_camera() || by_rows(c)).collect(),
            left_out: Vec::new(),
        };
        let mut place = misalignment + 2 * shared;
        layout.own.extend(place..place + directions);
        place += directions;
        for (candidate, by_rows) in self.candidates.iter().zip(&layout.by_rows) {
            let end = place + candidate.coefficients().len();
            if *by_rows {
                layout.own.extend(place..end);
            } else {
                layout.turn.extend(place..end);
            }
            place = end;
        }
        layout.own.extend(place..place + self.residuals.len());
        layout
    }

    /// Fills the rows of `frames`, outliers too.
    pub(crate) fn fill(&self, frames: Range<usize>, layout: &Layout, out: &mut Filled) {
        let data = self.data;
        let rows = data.frames.first_row[frames.start]..data.frames.first_row[frames.end];
        let n = rows.len();
        let (misalignment, _, directions) = self.nuisance.parts();
        let mut column = misalignment + directions;
        out.reset(n, frames.len(), layout, column);
        self.nuisance.fill(data, frames.clone(), out);
        self.fill_turns(&data.frames.t_s[frames], layout, &mut out.turn);
        let waves = PixelWaves::default();
        let seen = data.rows(rows.clone(), self.motion, Some(&waves));
        let scale = data.camera.arcsec_per_px();
        let [x, y] = &mut out.own;
        for (c, candidate) in self.candidates.iter().enumerate() {
            if !layout.by_rows[c] {
                continue;
            }
            let p = candidate.coefficients().len();
            if layout.left_out.get(c) == Some(&true) {
                column += p;
                continue;
            }
            let at = column * n..(column + p) * n;
            let (x, y) = (&mut x.as_mut_slice()[at.clone()], &mut y.as_mut_slice()[at]);
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
        for residual in self.residuals.iter().filter(|_| layout.left_out.is_empty()) {
            x.column_mut(column)
                .copy_from_slice(&residual[0][rows.clone()]);
            y.column_mut(column)
                .copy_from_slice(&residual[1][rows.clone()]);
            column += 1;
        }
    }

    /// What candidates that all turn the camera turn `frames` by, arcsec: three rows a frame.
    pub(crate) fn turns(&self, frames: Range<usize>) -> DMatrix<f64> {
        let layout = self.layout();
        let mut turns = DMatrix::zeros(3 * frames.len(), layout.turn.len());
        self.fill_turns(&self.data.frames.t_s[frames], &layout, &mut turns);
        turns
    }

    fn fill_turns(&self, t_s: &[f64], layout: &Layout, out: &mut DMatrix<f64>) {
        let frames = t_s.len();
        let mut column = 0;
        let mut scratch: [Vec<f64>; 3] = Default::default();
        let turning = self.candidates.iter().zip(&layout.by_rows);
        for candidate in turning.filter(|(_, by_rows)| !**by_rows).map(|(c, _)| c) {
            let p = candidate.coefficients().len();
            for axis in &mut scratch {
                axis.clear();
                axis.resize(p * frames, 0.0);
            }
            let [x, y, z] = &mut scratch;
            let seen = AttitudeRows {
                t_s,
                wx_rad_s: &[],
                wy_rad_s: &[],
                wz_rad_s: &[],
                attitude: self.motion,
            };
            if candidate.attitude_columns(&seen, VectorsMut { x, y, z }) {
                for j in 0..p {
                    for k in 0..frames {
                        for (axis, values) in scratch.iter().enumerate() {
                            out[(3 * k + axis, column + j)] =
                                values[j * frames + k] * ARCSEC_PER_RAD;
                        }
                    }
                }
            }
            column += p;
        }
    }

    /// What a row counts for: nothing if it is an outlier.
    pub(crate) fn weight_of(&self, row: usize) -> f64 {
        if self.data.outlier[row] {
            0.0
        } else {
            self.weight[row]
        }
    }

    /// Weighs the rows; returns how many of `frames`' rows count.
    pub(crate) fn weigh(&self, frames: Range<usize>, out: &mut Filled) -> usize {
        let data = self.data;
        let rows = data.frames.first_row[frames.start]..data.frames.first_row[frames.end];
        let weight = &mut out.weight;
        weight.clear();
        weight.extend(rows.clone().map(|row| self.weight_of(row)));
        let shared = out.shared.nrows().max(1);
        let rows_of_shared = out.shared.as_mut_slice().chunks_exact_mut(shared);
        for (values, &w) in rows_of_shared.zip(&*weight) {
            values.iter_mut().for_each(|v| *v = weighed(*v, w));
        }
        for own in out.own.iter_mut().filter(|m| !m.is_empty()) {
            for column in own.as_mut_slice().chunks_exact_mut(weight.len()) {
                for (v, &w) in column.iter_mut().zip(&*weight) {
                    *v = weighed(*v, w);
                }
            }
        }
        rows.filter(|&row| !data.outlier[row]).count()
    }

    /// Weighed squares of what the first two candidates, at the same `values`, shift the rows apart by,
    /// arcsec^2, of a long run as some of its frames tell; infinite where one of them does not act.
    pub(crate) fn distance(&self, values: &[f64]) -> f64 {
        let data = self.data;
        let arcsec = data.camera.arcsec_per_px();
        let frames = data.frames.frames();
        let chunks = frames.div_ceil(CHUNK_FRAMES);
        let every = (chunks / MOST_COMPARED).max(1);
        let compared = (0..chunks).into_par_iter().step_by(every);
        let squares: Vec<f64> = compared
            .map(|chunk| {
                let end = ((chunk + 1) * CHUNK_FRAMES).min(frames);
                let first_row = &data.frames.first_row;
                let rows = first_row[chunk * CHUNK_FRAMES]..first_row[end];
                let seen = data.rows(rows.clone(), self.motion, None);
                let both = [0, 1].map(|k| star_columns_of(self.candidates[k], &data.camera, &seen));
                let [Some(one), Some(other)] = &both else {
                    return f64::INFINITY;
                };
                let mut sum = 0.0;
                for (i, row) in rows.clone().enumerate().filter(|(_, r)| !data.outlier[*r]) {
                    for axis in 0..2 {
                        let each = values.iter().enumerate();
                        let apart: f64 = each
                            .map(|(j, v)| {
                                let at = j * rows.len() + i;
                                v * (one[axis][at] - other[axis][at])
                            })
                            .sum();
                        sum += (self.weight[row] * arcsec[axis] * apart).powi(2);
                    }
                }
                sum
            })
            .collect();
        squares.iter().sum::<f64>() * every as f64
    }

    /// What `amplitudes` (nuisance and candidates) shift the filled rows of `frames`
    /// by, arcsec.
    pub(crate) fn shift(
        &self,
        frames: Range<usize>,
        layout: &Layout,
        filled: &Filled,
        amplitudes: &DVector<f64>,
    ) -> [DVector<f64>; 2] {
        let of = |places: &[usize]| {
            DVector::from_iterator(places.len(), places.iter().map(|&p| amplitudes[p]))
        };
        let own = of(&layout.own[..layout.own.len() - self.residuals.len()]);
        let mut shift: [DVector<f64>; 2] = std::array::from_fn(|axis| {
            let shared =
                DVector::from_fn(layout.shared, |k, _| amplitudes[layout.shared_at(k, axis)]);
            filled.shared.tr_mul(&shared) + filled.own[axis].columns(0, own.len()) * &own
        });
        if !layout.turn.is_empty() {
            let turn = &filled.turn * of(&layout.turn);
            let first = self.data.frames.first_row[frames.start];
            for (k, frame) in frames.enumerate() {
                let theta: Vector3<f64> = turn.fixed_rows::<3>(3 * k).into_owned();
                for row in self.data.frames.rows_of(frame) {
                    let jacobian = rotation_row(self.data, row);
                    for axis in 0..2 {
                        shift[axis][row - first] += Vector3::from(jacobian[axis]).dot(&theta);
                    }
                }
            }
        }
        shift
    }
}

/// `value` by its weight; what does not count is zero, whatever it was.
fn weighed(value: f64, weight: f64) -> f64 {
    if weight > 0.0 { value * weight } else { 0.0 }
}

/// The columns of `candidate` on stars, x and y; `None` where it does not act on these rows.
pub(crate) fn star_columns_of(
    candidate: &dyn Candidate,
    camera: &Camera,
    rows: &StarRows<'_>,
) -> Option<[Vec<f64>; 2]> {
    let all = rows.len() * candidate.coefficients().len();
    let (mut x, mut y) = (vec![0.0; all], vec![0.0; all]);
    let out = PointsMut {
        x: &mut x,
        y: &mut y,
    };
    candidate.star_columns(camera, rows, out).then_some([x, y])
}
