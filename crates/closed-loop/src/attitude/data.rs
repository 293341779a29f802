//! Attitude measurements against a reference: the residual rotation per axis.
//!
//! ```text
//! theta = log(q_measured q_reference^-1)       rad, tracker axes; arcsec here
//! ```
//!
//! Each axis is whitened by its own noise, so that a noisy boresight axis does not
//! drown the others and a slow error of the reference is no trend.
//!
//! Source: [M23] Section 4 (residuals by differencing quaternions).

use std::ops::Range;

use block_regression::{BlockGrams, Design, Folds};
use coloured_noise::Coloured;
use effects::{AttitudeRows, Candidate};
use focal_plane::{ARCSEC_PER_RAD, AttitudeResidual, AttitudeSeries, AttitudeSource, VectorsMut};
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};
use spectra::robust::median_step;

use crate::attitude::mixing::Mixing;
use crate::bins::{Bins, MOST};
use crate::evidence::{Amplitudes, Evidence, Residuals};

/// Rows of attitude residuals, structure of arrays.
#[derive(Clone, Debug)]
pub(crate) struct AttitudeData {
    pub(crate) t_s: Vec<f64>,
    /// Residual per axis, arcsec.
    pub(crate) theta: [Vec<f64>; 3],
    /// Rate per axis, rad/s; zero where unknown.
    pub(crate) rate: [Vec<f64>; 3],
    /// Rows left out, per axis.
    pub(crate) outlier: [Vec<bool>; 3],
    /// How the rows are averaged for the search.
    pub(crate) bins: Bins,
    /// Rows that count in each bin, per axis; fresh after [`Self::rebin`].
    pub(crate) count: [Vec<f64>; 3],
    /// Noise that the axes share.
    pub(crate) mixing: Mixing,
    /// Rows set aside because the reference does not cover them.
    pub(crate) outside_reference: usize,
}

impl AttitudeData {
    /// Differences `q` (at `t_s`) against the reference.
    pub(crate) fn against(
        t_s: &[f64],
        q: &[UnitQuaternion<f64>],
        reference: &AttitudeSeries,
    ) -> Self {
        let mut data = Self {
            t_s: Vec::new(),
            theta: Default::default(),
            rate: Default::default(),
            outlier: Default::default(),
            bins: Bins::cut(&[], &Folds::cut(0), MOST),
            count: Default::default(),
            mixing: Mixing::default(),
            outside_reference: 0,
        };
        let residual = AttitudeResidual::against(t_s, q, reference);
        for &t in &residual.t_s {
            let rate = reference.rate_rad_s(t).unwrap_or_default();
            for axis in 0..3 {
                data.rate[axis].push(rate[axis]);
                data.outlier[axis].push(false);
            }
        }
        data.theta = residual
            .theta_rad
            .map(|axis| axis.iter().map(|theta| theta * ARCSEC_PER_RAD).collect());
        data.t_s = residual.t_s;
        data.outside_reference = residual.outside_reference;
        data
    }

    /// Takes off a rotation of each time, arcsec.
    pub(crate) fn subtract(&mut self, rotation: impl Fn(f64) -> Vector3<f64>) {
        for (k, &t) in self.t_s.iter().enumerate() {
            let theta = rotation(t);
            for axis in 0..3 {
                self.theta[axis][k] -= theta[axis];
            }
        }
    }

    /// Cuts about `most` bins at most, and counts what counts in them.
    pub(crate) fn rebin(&mut self, folds: &Folds, most: usize) {
        self.bins = Bins::cut(&self.t_s, folds, most);
        self.count = std::array::from_fn(|axis| {
            let kept =
                |rows: &Range<usize>| rows.clone().filter(|&k| !self.outlier[axis][k]).count();
            self.bins
                .rows
                .iter()
                .map(|rows| kept(rows) as f64)
                .collect()
        });
    }

    /// How many bins there are at most where a line at this frequency survives the means.
    pub(crate) fn bins_for(&self, frequency_hz: f64) -> usize {
        let step = median_step(&self.t_s).unwrap_or(f64::INFINITY);
        // a little finer than the Nyquist frequency
        let rows = 0.45 / (frequency_hz * step);
        let rows = (1..self.t_s.len()).take_while(|&n| n as f64 <= rows);
        self.t_s.len().div_ceil(rows.count().max(1))
    }

    /// Means over the bins of one axis of a series of rows; 0 where nothing counts.
    pub(crate) fn binned(&self, axis: usize, values: &[f64]) -> Vec<f64> {
        let mean = |rows: &Range<usize>, count: f64| {
            let sum: f64 = rows
                .clone()
                .filter(|&k| !self.outlier[axis][k])
                .map(|k| values[k])
                .sum();
            if count > 0.0 { sum / count } else { 0.0 }
        };
        self.bins
            .rows
            .iter()
            .zip(&self.count[axis])
            .map(|(rows, &count)| mean(rows, count))
            .collect()
    }

    /// Means over the bins of all axes of a series of rows, each without the noise that it shares.
    pub(crate) fn unshared(&self, axes: [&[f64]; 3]) -> [Vec<f64>; 3] {
        let binned = std::array::from_fn(|axis| self.binned(axis, axes[axis]));
        self.mixing.mix(binned)
    }

    /// The same of the residual.
    pub(crate) fn unshared_theta(&self) -> [Vec<f64>; 3] {
        self.unshared(self.theta.each_ref().map(Vec::as_slice))
    }

    /// All rows as effects see them.
    fn rows<'a>(&'a self, attitude: Option<&'a dyn AttitudeSource>) -> AttitudeRows<'a> {
        let [wx_rad_s, wy_rad_s, wz_rad_s] = &self.rate;
        AttitudeRows {
            t_s: &self.t_s,
            wx_rad_s,
            wy_rad_s,
            wz_rad_s,
            attitude,
        }
    }
}

/// Attitude residuals as evidence: a constant an axis, coloured noise an axis.
pub(crate) struct AttitudeEvidence<'a> {
    pub(crate) data: &'a AttitudeData,
    /// 1 sigma of each constant, arcsec; infinite = free.
    pub(crate) constant_sigma: [f64; 3],
    /// Noise of each axis: rows are whitened with it.
    pub(crate) noise: [Coloured; 3],
    pub(crate) motion: Option<&'a dyn AttitudeSource>,
}

impl AttitudeEvidence<'_> {
    /// Binned residuals beside `constant` and the amplitudes `beta`, as the
    /// whitening filter wants them, arcsec. `raw` is [`Self::binned`] of the
    /// candidates that the amplitudes belong to.
    pub(crate) fn left(
        &self,
        raw: &DMatrix<f64>,
        constant: &DVector<f64>,
        beta: &DVector<f64>,
    ) -> [Vec<f64>; 3] {
        let m = self.data.bins.rows.len();
        let mut all = self.data.unshared_theta();
        for (axis, series) in all.iter_mut().enumerate() {
            for (k, value) in series.iter_mut().enumerate() {
                let row = raw.row(axis * m + k);
                let shift: f64 = (0..beta.len()).map(|j| row[3 + j] * beta[j]).sum();
                let constants: f64 = (0..3).map(|j| row[j] * constant[j]).sum();
                *value -= constants + shift;
            }
        }
        all
    }

    /// Columns of one candidate in all rows, arcsec, about x, y and z, one after another; false where it shows nothing.
    fn fill(&self, candidate: &dyn Candidate, columns: &mut [Vec<f64>; 3]) -> bool {
        let n = self.data.t_s.len();
        for axis in &mut *columns {
            axis.clear();
            axis.resize(candidate.coefficients().len() * n, 0.0);
        }
        let seen = self.data.rows(self.motion);
        let [x, y, z] = &mut *columns;
        let shows = candidate.attitude_columns(&seen, VectorsMut { x, y, z });
        let values = columns.iter_mut().flatten();
        values.for_each(|value| *value *= ARCSEC_PER_RAD);
        shows
    }
}

impl AttitudeEvidence<'_> {
    /// Whitens binned columns, with the residual as the last.
    pub(crate) fn whitened(&self, binned: &DMatrix<f64>) -> Box<dyn Design + '_> {
        let (m, width) = (self.data.bins.rows.len(), binned.ncols());
        let mut columns = binned.clone().insert_column(width, 0.0);
        for (axis, theta) in self.data.unshared_theta().iter().enumerate() {
            columns
                .view_mut((axis * m, width), (m, 1))
                .copy_from_slice(theta);
        }
        self.whiten(&mut columns);
        Box::new(WhitenedDesign {
            data: self.data,
            columns,
        })
    }

    /// Whitens columns of x, y and z of every bin.
    pub(crate) fn whiten(&self, columns: &mut DMatrix<f64>) {
        let m = self.data.bins.rows.len();
        for axis in 0..3 {
            let mut slices: Vec<&mut [f64]> = columns
                .as_mut_slice()
                .chunks_exact_mut(3 * m)
                .map(|column| &mut column[axis * m..(axis + 1) * m])
                .collect();
            self.noise[axis].whiten(&self.data.bins.t_s, &self.data.count[axis], &mut slices);
        }
    }

    /// [`plain`](Self::plain) without the noise that the axes share.
    pub(crate) fn binned(&self, candidates: &[&dyn Candidate]) -> DMatrix<f64> {
        let mut out = self.plain(candidates);
        self.data.mixing.mix_columns(&mut out);
        out
    }

    /// Constants and candidates averaged over the bins: x, y, z of every bin by
    /// three constants and the candidates' columns, arcsec. One candidate after another: of a long run, all rows of all
    /// would not fit.
    pub(crate) fn plain(&self, candidates: &[&dyn Candidate]) -> DMatrix<f64> {
        let (n, m) = (self.data.t_s.len(), self.data.bins.rows.len());
        let sizes = candidates.iter().map(|c| c.coefficients().len());
        let mut out = DMatrix::zeros(3 * m, 3 + sizes.sum::<usize>());
        for axis in 0..3 {
            let counts = self.data.count[axis].iter();
            let ones: Vec<f64> = counts.map(|n| f64::from(u8::from(*n > 0.0))).collect();
            out.view_mut((axis * m, axis), (m, 1))
                .copy_from_slice(&ones);
        }
        let mut columns: [Vec<f64>; 3] = Default::default();
        let mut first = 3;
        for candidate in candidates {
            let size = candidate.coefficients().len();
            if self.fill(*candidate, &mut columns) {
                for (axis, values) in columns.iter().enumerate() {
                    for (j, rows) in values.chunks_exact(n).enumerate() {
                        let means = self.data.binned(axis, rows);
                        out.view_mut((axis * m, first + j), (m, 1))
                            .copy_from_slice(&means);
                    }
                }
            }
            first += size;
        }
        out
    }

    /// What candidates of these amplitudes, fold by fold, do to each row, arcsec: x, y and z of all rows.
    fn shifts(&self, candidates: &[&dyn Candidate], amplitudes: &Amplitudes) -> Vec<Vec<f64>> {
        let n = self.data.t_s.len();
        let mut shifts = vec![vec![0.0; 3 * n]; amplitudes.candidates.len()];
        let mut columns: [Vec<f64>; 3] = Default::default();
        let mut first = 0;
        for candidate in candidates {
            let own = first..first + candidate.coefficients().len();
            first = own.end;
            let acts =
                |of_fold: &DVector<f64>| of_fold.as_slice()[own.clone()].iter().any(|b| *b != 0.0);
            if !amplitudes.candidates.iter().any(acts) || !self.fill(*candidate, &mut columns) {
                continue;
            }
            for (shift, of_fold) in shifts.iter_mut().zip(&amplitudes.candidates) {
                for (shift, values) in shift.chunks_exact_mut(n).zip(&columns) {
                    for (values, j) in values.chunks_exact(n).zip(own.clone()) {
                        let all = shift.iter_mut().zip(values);
                        all.for_each(|(shift, value)| *shift += of_fold[j] * value);
                    }
                }
            }
        }
        shifts
    }
}

/// Whitened columns of the whole binned series, handed out by bins.
struct WhitenedDesign<'a> {
    data: &'a AttitudeData,
    columns: DMatrix<f64>,
}

impl Design for WhitenedDesign<'_> {
    fn width(&self) -> usize {
        self.columns.ncols()
    }

    fn fill(&self, rows: Range<usize>, out: &mut DMatrix<f64>) -> usize {
        let (n, all) = (rows.len(), self.data.bins.rows.len());
        *out = DMatrix::zeros(3 * n, self.width());
        let mut scalars = 0;
        for axis in 0..3 {
            out.rows_mut(axis * n, n)
                .copy_from(&self.columns.rows(axis * all + rows.start, n));
            scalars += rows
                .clone()
                .filter(|&k| self.data.count[axis][k] > 0.0)
                .count();
        }
        scalars
    }
}

impl Evidence for AttitudeEvidence<'_> {
    fn precision(&self) -> DMatrix<f64> {
        let own = self.constant_sigma.iter().map(|s| s.powi(-2));
        DMatrix::from_diagonal(&DVector::from_iterator(self.constant_sigma.len(), own))
    }

    fn residual_columns(&self) -> usize {
        1
    }

    fn variance_guess(&self) -> f64 {
        1.0
    }

    fn grams(&self, folds: &Folds, candidates: &[&dyn Candidate]) -> BlockGrams {
        BlockGrams::accumulate(self.whitened(&self.binned(candidates)).as_ref(), folds)
    }

    /// The constants of the figures are plain means over the other folds: those
    /// of a generalised fit would carry the slow noise of a distant fold along.
    fn residuals(
        &self,
        folds: &Folds,
        candidates: &[&dyn Candidate],
        amplitudes: &Amplitudes,
    ) -> Residuals {
        let n = self.data.t_s.len();
        let fold = folds.fold_of_frame();
        let mut out = Residuals {
            axes: vec![vec![0.0; n]; 3],
            modelled: vec![vec![0.0; n]; 3],
        };
        for (f, shift) in self.shifts(candidates, amplitudes).iter().enumerate() {
            for axis in 0..3 {
                let left = |k: usize| self.data.theta[axis][k] - shift[axis * n + k];
                let train: Vec<f64> = (0..n)
                    .filter(|&k| fold[k] != f && !self.data.outlier[axis][k])
                    .map(left)
                    .collect();
                let count = train.len().max(1) as f64;
                let free = train.iter().sum::<f64>() / count;
                // A declared spread pulls the mean toward zero as far as the data is poor.
                let noise = self.noise[axis];
                let variance = (noise.white.powi(2) + noise.slow.powi(2)) / count;
                let prior = self.constant_sigma[axis].powi(2);
                let constant = if prior.is_finite() {
                    free * prior / (prior + variance)
                } else {
                    free
                };
                for k in (0..n).filter(|&k| fold[k] == f) {
                    out.axes[axis][k] = left(k) - constant;
                    out.modelled[axis][k] = shift[axis * n + k] + constant;
                }
            }
        }
        out
    }
}
