//! Noise that all stars of a frame share: the error of the reference.
//!
//! A frame's residuals split into the rotation that its stars agree on and what no
//! rotation explains. The centroids' white noise shows in both; an error of the
//! reference shows in the rotation alone, and follows from frame to frame:
//!
//! ```text
//! r_k = A_k theta_k + e_k      theta^_k = N_k^-1 A_k^T r_k,   N_k = A_k^T A_k
//! theta^_k = b_k + w_k         cov w_k = sigma^2 N_k^-1 + diag(white^2)
//! b_k+1 = D_k b_k + n_k        per axis first-order Gauss-Markov (coloured.rs)
//! ```
//!
//! The Kalman filter of these three states turns theta^ into innovations that are
//! independent and, times the inverse root of their covariance, of unit variance;
//! the rest is divided by sigma. Columns go through the same linear filter, so
//! that least squares afterwards is generalised least squares. The log-likelihood
//! in the unit of the residuals then lacks, frame by frame,
//!
//! ```text
//! -1/2 ln det F_k - 1/2 ln det N_k - (2 m_k - 3) ln sigma,    F_k: covariance of the innovation
//! ```
//!
//! Source: Brown & Hwang 2012, ch. 4 and 5 (Gauss-Markov process, Kalman filter);
//! statistics.md of the design notes, point 9.

use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::bins::Bins;
use crate::coloured::Coloured;
use crate::folds::Folds;
use crate::star_data::StarData;
use crate::star_design::{rotation_inverse, rotation_row};

/// Whiter than this over the centroids' own noise and the reference has white noise.
const WHITE_EXCESS: f64 = 1.03;

/// Half the relative difference of two noises that serve a fit alike.
const ALIKE: f64 = 0.02;

/// What the residuals of stars against a reference are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CommonNoise {
    /// White noise of a centroid per axis, arcsec.
    pub(crate) centroid: f64,
    /// The reference's error per axis: `white` is its own, beside the centroids'.
    pub(crate) reference: [Coloured; 3],
}

/// The frames' rotations as three series, and the noise of the centroids.
#[derive(Clone, Debug)]
pub(crate) struct Rotations {
    bins: Bins,
    /// Mean rotation of each bin per axis, arcsec.
    mean: [Vec<f64>; 3],
    /// Stars' worth of each bin: the centroid variance over it is the mean's.
    count: [Vec<f64>; 3],
    centroid: f64,
}

impl Rotations {
    /// Of residuals (arcsec, per axis over all rows). `freedom` is what was fitted.
    /// `None` where hardly any frame has an attitude of its own.
    pub(crate) fn of(
        data: &StarData,
        residual: &[Vec<f64>],
        folds: &Folds,
        freedom: usize,
    ) -> Option<Self> {
        let frames = data.frames.frames();
        let mut theta = vec![None; frames];
        let (mut sse, mut rest) = (0.0, 0);
        for (frame, place) in theta.iter_mut().enumerate() {
            let Some(inverse) = rotation_inverse(data, frame) else {
                continue;
            };
            let (mut moment, mut square, mut used) = (Vector3::zeros(), 0.0, 0);
            for row in data.frames.rows_of(frame).filter(|&r| !data.outlier[r]) {
                let jacobian = rotation_row(data, row);
                for axis in 0..2 {
                    moment += Vector3::from(jacobian[axis]) * residual[axis][row];
                    square += residual[axis][row].powi(2);
                    used += 1;
                }
            }
            let rotation = inverse * moment;
            sse += square - rotation.dot(&moment);
            rest += used - 3;
            *place = Some((rotation, inverse.diagonal()));
        }
        if rest <= freedom {
            return None;
        }
        let bins = Bins::cut(&data.frames.t_s, folds);
        let series = |axis: usize| -> (Vec<f64>, Vec<f64>) {
            bins.rows
                .iter()
                .map(|rows| {
                    let (mut sum, mut count) = (0.0, 0.0);
                    for (rotation, variance) in theta[rows.clone()].iter().flatten() {
                        sum += rotation[axis] / variance[axis];
                        count += 1.0 / variance[axis];
                    }
                    (if count > 0.0 { sum / count } else { 0.0 }, count)
                })
                .unzip()
        };
        let [x, y, z] = std::array::from_fn(series);
        Some(Self {
            mean: [x.0, y.0, z.0],
            count: [x.1, y.1, z.1],
            bins,
            centroid: (sse / (rest - freedom) as f64).sqrt(),
        })
    }

    /// The noise of greatest likelihood; started from `near` where there is one.
    pub(crate) fn noise(&self, near: Option<&CommonNoise>) -> CommonNoise {
        let reference = std::array::from_fn(|axis| {
            let (y, count) = (&self.mean[axis], &self.count[axis]);
            let fitted = match near.map(|n| n.reference[axis]) {
                Some(known) if known.slow > 0.0 => Coloured {
                    white: self.total_white(axis, known.white),
                    ..known
                }
                .refit(&self.bins.t_s, y, count),
                _ => Coloured::fit(&self.bins.t_s, y, count),
            };
            self.beside_centroids(axis, fitted)
        });
        CommonNoise {
            centroid: self.centroid,
            reference,
        }
    }

    /// How much more likely each axis's rotations are with the slow error than
    /// without: twice the gain in log-likelihood.
    pub(crate) fn slow_ratio(&self, noise: &CommonNoise) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let (y, count) = (&self.mean[axis], &self.count[axis]);
            let known = noise.reference[axis];
            let with = Coloured {
                white: self.total_white(axis, known.white),
                ..known
            };
            let kept = count.iter().filter(|c| **c > 0.0).count().max(1) as f64;
            let variance = y.iter().zip(count).map(|(y, c)| y * y * c).sum::<f64>() / kept;
            let without = Coloured {
                white: variance.sqrt(),
                slow: 0.0,
                tau_s: 1.0,
            };
            let t_s = &self.bins.t_s;
            2.0 * (with.log_likelihood(t_s, y, count) - without.log_likelihood(t_s, y, count))
        })
    }

    /// Standard errors of the slow part of an axis, relative: of sigma and of tau.
    pub(crate) fn slow_sigma(&self, noise: &CommonNoise, axis: usize) -> Option<[f64; 2]> {
        let known = noise.reference[axis];
        Coloured {
            white: self.total_white(axis, known.white),
            ..known
        }
        .relative_sigma(&self.bins.t_s, &self.mean[axis], &self.count[axis])
    }

    /// White noise of a rotation in the unit of a centroid.
    fn total_white(&self, axis: usize, reference: f64) -> f64 {
        self.centroid
            .hypot(reference * self.usual_count(axis).sqrt())
    }

    fn beside_centroids(&self, axis: usize, fitted: Coloured) -> Coloured {
        let excess = fitted.white.powi(2) - self.centroid.powi(2);
        let has_own = fitted.white > WHITE_EXCESS * self.centroid;
        Coloured {
            white: if has_own {
                (excess / self.usual_count(axis)).sqrt()
            } else {
                0.0
            },
            ..fitted
        }
    }

    fn usual_count(&self, axis: usize) -> f64 {
        let kept = self.count[axis].iter().filter(|c| **c > 0.0).count().max(1);
        // a bin averages the reference's white noise as it does the centroids'
        let rows = self
            .bins
            .rows
            .iter()
            .map(ExactSizeIterator::len)
            .sum::<usize>();
        self.count[axis].iter().sum::<f64>() / kept as f64 * self.bins.rows.len() as f64
            / rows.max(1) as f64
    }
}

impl CommonNoise {
    /// Alike within what makes no difference to a fit.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        let close = |a: f64, b: f64| (a - b).abs() <= ALIKE * (a + b);
        self.reference
            .iter()
            .zip(&other.reference)
            .all(|(a, b)| close(a.slow, b.slow) && (a.slow <= 0.0 || close(a.tau_s, b.tau_s)))
    }
}

/// One frame of the filter.
#[derive(Clone, Debug)]
struct Step {
    decay: Vector3<f64>,
    gain: Matrix3<f64>,
    /// L^-1 with F = L L^T.
    whitening: Matrix3<f64>,
    inverse: Matrix3<f64>,
    /// The frame has an attitude.
    solved: bool,
}

/// The filter with its gains: they depend on times and stars alone.
#[derive(Clone, Debug)]
pub(crate) struct Whitener {
    steps: Vec<Step>,
    pub(crate) centroid: f64,
    /// What the log-likelihood of the whitened scalars lacks, nats.
    pub(crate) log_scale: f64,
}

/// States that the filter carries.
pub(crate) const STATES: usize = 3;

impl Whitener {
    pub(crate) fn new(data: &StarData, noise: &CommonNoise) -> Self {
        let per_axis =
            |f: fn(&Coloured) -> f64| Vector3::from_iterator(noise.reference.iter().map(f));
        let slow = per_axis(|r| r.slow * r.slow);
        let white = Matrix3::from_diagonal(&per_axis(|r| r.white * r.white));
        let variance = noise.centroid * noise.centroid;
        let mut covariance = Matrix3::from_diagonal(&slow);
        let mut log_scale = 0.0;
        let mut steps = Vec::with_capacity(data.frames.frames());
        for frame in 0..data.frames.frames() {
            let decay = if frame == 0 {
                Vector3::zeros()
            } else {
                let step = data.frames.t_s[frame] - data.frames.t_s[frame - 1];
                per_axis(|r| r.tau_s).map(|tau| (-step / tau).exp())
            };
            let d = Matrix3::from_diagonal(&decay);
            let fresh = slow.zip_map(&decay, |s, d| s * (1.0 - d * d));
            covariance = d * covariance * d + Matrix3::from_diagonal(&fresh);
            let mut step = Step {
                decay,
                gain: Matrix3::zeros(),
                whitening: Matrix3::zeros(),
                inverse: Matrix3::zeros(),
                solved: false,
            };
            if let Some(inverse) = rotation_inverse(data, frame)
                && let Some(factor) = (covariance + inverse * variance + white).cholesky()
                && let Some(whitening) = factor.l().try_inverse()
            {
                let gain = covariance * factor.inverse();
                covariance -= gain * covariance;
                covariance = 0.5 * (covariance + covariance.transpose());
                let used = data
                    .frames
                    .rows_of(frame)
                    .filter(|&r| !data.outlier[r])
                    .count();
                log_scale += whitening.determinant().ln() + 0.5 * inverse.determinant().ln()
                    - (2 * used - STATES) as f64 * noise.centroid.ln();
                step = Step {
                    gain,
                    whitening,
                    inverse,
                    solved: true,
                    ..step
                };
            }
            steps.push(step);
        }
        Self {
            steps,
            centroid: noise.centroid,
            log_scale,
        }
    }

    /// Whitens the rows of `frames` (x of every row, then y; outliers zero), with
    /// columns for the states behind them: `state` is what the filter predicts for
    /// each column, and for unit starts of each state. Writes the rest of every row
    /// and then three innovations a frame; returns the scalars that count.
    pub(crate) fn apply(
        &self,
        data: &StarData,
        frames: std::ops::Range<usize>,
        raw: &DMatrix<f64>,
        state: &mut DMatrix<f64>,
        out: &mut DMatrix<f64>,
    ) -> usize {
        let (n, width) = (raw.nrows() / 2, raw.ncols());
        let height = 2 * n + STATES * frames.len();
        if out.shape() != (height, width + STATES) {
            *out = DMatrix::zeros(height, width + STATES);
        }
        out.fill(0.0);
        let first = data.frames.first_row[frames.start];
        let mut scalars = 0;
        let mut jacobian = Vec::new();
        for (at, frame) in frames.enumerate() {
            let step = &self.steps[frame];
            let rows = data.frames.rows_of(frame);
            jacobian.clear();
            jacobian.extend(
                rows.clone()
                    .filter(|&r| !data.outlier[r])
                    .map(|r| (r - first, rotation_row(data, r))),
            );
            for column in 0..width + STATES {
                let mut mean = Vector3::from_fn(|k, _| step.decay[k] * state[(k, column)]);
                if step.solved {
                    let mut theta = Vector3::zeros();
                    if column < width {
                        let mut moment = Vector3::zeros();
                        for (i, [x, y]) in &jacobian {
                            moment += Vector3::from(*x) * raw[(*i, column)]
                                + Vector3::from(*y) * raw[(n + i, column)];
                        }
                        theta = step.inverse * moment;
                        for (i, [x, y]) in &jacobian {
                            for (row, a) in [(*i, x), (n + i, y)] {
                                out[(row, column)] = (raw[(row, column)]
                                    - Vector3::from(*a).dot(&theta))
                                    / self.centroid;
                            }
                        }
                    }
                    let innovation = theta - mean;
                    let white = step.whitening * innovation;
                    for k in 0..STATES {
                        out[(2 * n + STATES * at + k, column)] = white[k];
                    }
                    mean += step.gain * innovation;
                }
                for k in 0..STATES {
                    state[(k, column)] = mean[k];
                }
            }
            if step.solved {
                scalars += 2 * jacobian.len();
            }
        }
        scalars
    }
}
