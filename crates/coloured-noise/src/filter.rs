//! The filter that takes common noise out of the rotations of frames.
//!
//! The Kalman filter of the three states of [`CommonNoise`] turns rotations into innovations that are
//! independent and, times the inverse root of their covariance, of unit variance; what no rotation
//! explains is divided by sigma. Columns go through the same linear filter, so
//! that least squares afterwards is generalised least squares. The log-likelihood
//! in the unit of the residuals then lacks, frame by frame,
//!
//! ```text
//! -1/2 ln det F_k - 1/2 ln det N_k - (2 m_k - 3) ln sigma,    F_k: covariance of the innovation
//! ```
//!
//! Source: Brown & Hwang 2012, ch. 5 (Kalman filter).

use std::ops::Range;

use nalgebra::{DMatrix, Matrix3, Vector3};
use rayon::prelude::*;

use crate::coloured::Coloured;
use crate::common_noise::CommonNoise;

/// Columns that one thread filters at a time.
const TOGETHER: usize = 32;

/// One bin of the filter.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) decay: Vector3<f64>,
    pub(crate) gain: Matrix3<f64>,
    /// L^-1 with F = L L^T; `None`: the bin has no attitude.
    pub(crate) whitening: Option<Matrix3<f64>>,
}

/// The filter with its gains: they depend on times and stars alone.
#[derive(Clone, Debug)]
pub struct Filter {
    pub(crate) steps: Vec<Step>,
    /// What the log-likelihood of the innovations lacks to that of what the stars of each bin share, nats:
    /// `-1/2 ln det F - 1/2 ln det N` summed over the bins, F the covariance of an innovation and N the normal
    /// matrix of a rotation.
    pub log_scale: f64,
}

impl Filter {
    /// For bins at `t_s`, s, of so many `frames`, with the inverse normal matrix `(A^T A)^-1` of each
    /// bin's rotation; `None` where its stars fix none.
    pub fn new(
        noise: &CommonNoise,
        t_s: &[f64],
        frames: &[usize],
        inverse: &[Option<Matrix3<f64>>],
    ) -> Self {
        let per_axis =
            |f: fn(&Coloured) -> f64| Vector3::from_iterator(noise.reference.iter().map(f));
        let slow = per_axis(|r| r.slow * r.slow);
        let white = Matrix3::from_diagonal(&per_axis(|r| r.white * r.white));
        let variance = noise.centroid * noise.centroid;
        let mut covariance = Matrix3::from_diagonal(&slow);
        let mut log_scale = 0.0;
        let mut steps = Vec::with_capacity(t_s.len());
        for (bin, inverse) in inverse.iter().enumerate() {
            let decay = if bin == 0 {
                Vector3::zeros()
            } else {
                let step = t_s[bin] - t_s[bin - 1];
                per_axis(|r| r.tau_s).map(|tau| (-step / tau).exp())
            };
            let d = Matrix3::from_diagonal(&decay);
            let fresh = slow.zip_map(&decay, |s, d| s * (1.0 - d * d));
            covariance = d * covariance * d + Matrix3::from_diagonal(&fresh);
            let mut step = Step {
                decay,
                gain: Matrix3::zeros(),
                whitening: None,
            };
            if let Some(inverse) = inverse
                && let Some(factor) =
                    (covariance + inverse * variance + white / frames[bin] as f64).cholesky()
                && let Some(whitening) = factor.l().try_inverse()
            {
                step.gain = covariance * factor.inverse();
                covariance -= step.gain * covariance;
                covariance = 0.5 * (covariance + covariance.transpose());
                log_scale += whitening.determinant().ln() + 0.5 * inverse.determinant().ln();
                step.whitening = Some(whitening);
            }
            steps.push(step);
        }
        Self { steps, log_scale }
    }

    /// Whitened innovations of `columns` of `theta` (three rows a bin) at the bins `steps`, which are all that
    /// `theta` holds; `state` is where the filter stands for each of `columns`, zero at first, and goes on
    /// from block to block.
    pub fn innovations(
        &self,
        steps: Range<usize>,
        theta: &DMatrix<f64>,
        columns: &[usize],
        state: &mut [Vector3<f64>],
    ) -> DMatrix<f64> {
        let rows = theta.nrows();
        let mut out = DMatrix::zeros(rows, columns.len());
        let some = out.as_mut_slice().par_chunks_mut(TOGETHER * rows.max(1));
        let some = some.zip(columns.par_chunks(TOGETHER));
        some.zip(state.par_chunks_mut(TOGETHER))
            .for_each(|((out, columns), state)| {
                let each = columns.iter().zip(state);
                for ((&column, state), out) in each.zip(out.chunks_exact_mut(rows)) {
                    self.follow(steps.clone(), theta.column(column).as_slice(), state, out);
                }
            });
        out
    }

    /// Whitened innovations of one column at the bins `steps`, three values a bin.
    fn follow(
        &self,
        steps: Range<usize>,
        theta: &[f64],
        state: &mut Vector3<f64>,
        out: &mut [f64],
    ) {
        let each = self.steps[steps].iter().zip(theta.chunks_exact(3));
        for ((step, theta), out) in each.zip(out.chunks_exact_mut(3)) {
            let mut mean = state.component_mul(&step.decay);
            if let Some(whitening) = &step.whitening {
                let innovation = Vector3::from_column_slice(theta) - mean;
                out.copy_from_slice((whitening * innovation).as_slice());
                mean += step.gain * innovation;
            }
            *state = mean;
        }
    }
}
