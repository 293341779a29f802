//! White noise of the reference about all axes together.
//!
//! The rotation of a frame whose stars lie off the boresight is known far better in one mixture of axes than
//! in any of them, so that what an axis by itself shows of the reference's white noise drowns in its stars'.
//! Beside known slow parts the variances v of the white parts are those of greatest likelihood of the
//! innovations e and their covariances F ([`Filter`]),
//!
//! ```text
//! slope_a  = 1/2 sum ( (F^-1 e)_a^2 - (F^-1)_aa )        v <- v + information^-1 slope,   v >= 0
//! info_ab  = 1/2 sum ( (F^-1)_ab )^2
//! ```
//!
//! each sum over the bins, whose means hold v / frames.
//!
//! Source: Fisher scoring for components of variance (Patterson & Thompson 1971).

use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::common_noise::CommonNoise;
use crate::filter::Filter;

/// Steps, and how often one is halved.
const ROUNDS: usize = 8;
const HALVINGS: usize = 4;
/// Nats that a further step has to gain.
const GAIN: f64 = 0.01;

/// Rotations of bins of frames.
pub(crate) struct Joint<'a> {
    pub(crate) t_s: &'a [f64],
    /// Three rows a bin.
    pub(crate) theta: &'a DMatrix<f64>,
    pub(crate) frames: &'a [usize],
    pub(crate) inverse: &'a [Option<Matrix3<f64>>],
}

/// The log-likelihood at a noise, and how it grows with the variances of the white parts.
struct Slope {
    loglik: f64,
    slope: Vector3<f64>,
    information: Matrix3<f64>,
}

impl Joint<'_> {
    /// `noise` with white parts of the reference that suit it best, and the log-likelihood, nats.
    pub(crate) fn with_white(&self, noise: &CommonNoise) -> (CommonNoise, f64) {
        let mut at = *noise;
        let mut now = self.slope(&at);
        for _ in 0..ROUNDS {
            let variance = Vector3::from(at.reference.map(|r| r.white * r.white));
            let mut step = now.step(&variance);
            let better = (0..=HALVINGS).find_map(|_| {
                let mut there = at;
                for (axis, part) in there.reference.iter_mut().enumerate() {
                    part.white = (variance[axis] + step[axis]).max(0.0).sqrt();
                }
                step *= 0.5;
                let slope = self.slope(&there);
                (slope.loglik > now.loglik).then_some((there, slope))
            });
            let Some((there, slope)) = better else { break };
            let gain = slope.loglik - now.loglik;
            (at, now) = (there, slope);
            if gain < GAIN {
                break;
            }
        }
        (at, now.loglik)
    }

    fn slope(&self, noise: &CommonNoise) -> Slope {
        let filter = Filter::new(noise, self.t_s, self.frames, self.inverse);
        let whitened =
            filter.innovations(0..self.t_s.len(), self.theta, &[0], &mut [Vector3::zeros()]);
        let mut out = Slope {
            loglik: filter.log_scale - 0.5 * whitened.norm_squared(),
            slope: Vector3::zeros(),
            information: Matrix3::zeros(),
        };
        for (bin, step) in filter.steps.iter().enumerate() {
            let Some(whitening) = &step.whitening else {
                continue;
            };
            let share = 1.0 / self.frames[bin] as f64;
            let weight = whitening.tr_mul(whitening) * share;
            let pull = whitening.tr_mul(&whitened.fixed_rows::<3>(3 * bin));
            out.slope += 0.5 * (pull.component_mul(&pull) * share - weight.diagonal());
            out.information += 0.5 * weight.component_mul(&weight);
        }
        out
    }
}

impl Slope {
    /// The step to the summit, of the axes that have room: a variance of nothing cannot fall.
    fn step(&self, variance: &Vector3<f64>) -> Vector3<f64> {
        let open = |a: usize| variance[a] > 0.0 || self.slope[a] > 0.0;
        let information = Matrix3::from_fn(|a, b| match (open(a) && open(b), a == b) {
            (true, _) => self.information[(a, b)],
            (false, same) => f64::from(u8::from(same)),
        });
        let slope = Vector3::from_fn(|a, _| if open(a) { self.slope[a] } else { 0.0 });
        information
            .cholesky()
            .map_or_else(Vector3::zeros, |factor| factor.solve(&slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coloured::Coloured;
    use crate::rotations::Rotations;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const FRAMES: usize = 255;
    const CENTROID: f64 = 0.35;

    /// Rotations of frames whose six stars lie 0.05 rad off the boresight, within 0.03 rad of each other, and
    /// a reference with white noise of these variances.
    struct OffAxis {
        t_s: Vec<f64>,
        theta: DMatrix<f64>,
        frames: Vec<usize>,
        inverse: Vec<Option<Matrix3<f64>>>,
    }

    impl OffAxis {
        fn new(variance: [f64; 3], seed: u64) -> Self {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let mut theta = Vec::new();
            let mut inverse = Vec::new();
            for _ in 0..FRAMES {
                let reference = Vector3::from(variance.map(|v: f64| v.sqrt() * normal()));
                let (mut information, mut moment) = (Matrix3::zeros(), Vector3::zeros());
                for _ in 0..6 {
                    let (x, y) = (0.05 + 0.03 * normal(), 0.02 * normal());
                    for row in [Vector3::new(0.0, -1.0, y), Vector3::new(1.0, 0.0, -x)] {
                        information += row * row.transpose();
                        moment += row * (row.dot(&reference) + CENTROID * normal());
                    }
                }
                let own = information.try_inverse().expect("six stars");
                theta.extend_from_slice((own * moment).as_slice());
                inverse.push(Some(own));
            }
            Self {
                t_s: (0..FRAMES).map(|k| 0.5 * k as f64).collect(),
                theta: DMatrix::from_vec(3 * FRAMES, 1, theta),
                frames: vec![1; FRAMES],
                inverse,
            }
        }

        fn joint(&self) -> Joint<'_> {
            Joint {
                t_s: &self.t_s,
                theta: &self.theta,
                frames: &self.frames,
                inverse: &self.inverse,
            }
        }
    }

    fn noise(variance: [f64; 3]) -> CommonNoise {
        CommonNoise {
            centroid: CENTROID,
            reference: variance.map(|v| Coloured {
                white: v.sqrt(),
                slow: 0.0,
                tau_s: 1.0,
            }),
        }
    }

    /// The slope is the derivative: central differences of 1e-4 of the variance are off by 1e-8 of it, and
    /// lose 1e-16 of a thousand nats over 1e-4 of a slope of ten.
    #[test]
    fn the_slope_is_that_of_the_likelihood() {
        let data = OffAxis::new([0.01, 0.02, 2.0], 1);
        let joint = data.joint();
        let at = [0.02, 0.01, 4.0];
        let slope = joint.slope(&noise(at)).slope;
        for axis in 0..3 {
            let step = 1e-4 * at[axis];
            let beside = |sign: f64| {
                let mut there = at;
                there[axis] += sign * step;
                joint.slope(&noise(there)).loglik
            };
            let difference = (beside(1.0) - beside(-1.0)) / (2.0 * step);
            let scale = slope[axis].abs() + 1.0 / at[axis];
            assert!(
                (difference - slope[axis]).abs() < 1e-6 * scale,
                "axis {axis}: {difference} {slope}"
            );
        }
    }

    /// What is estimated is what is there: the mean of 200 worlds is within 5 of its own standard errors, beside
    /// a bias of second order (an estimate that is off by 1 sigma, itself a tenth, puts the information off by
    /// as much: 1 %).
    #[test]
    fn white_parts_come_out_as_they_are() {
        let truth = [0.04, 0.09, 40.0];
        let seeds = 200;
        let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
        for seed in 0..seeds {
            let (found, _) = OffAxis::new(truth, seed)
                .joint()
                .with_white(&noise([0.0; 3]));
            for axis in 0..3 {
                let relative = found.reference[axis].white.powi(2) / truth[axis] - 1.0;
                sum[axis] += relative;
                squares[axis] += relative * relative;
            }
        }
        let n = seeds as f64;
        for axis in 0..3 {
            let mean = sum[axis] / n;
            let error = (squares[axis] / n - mean * mean).sqrt() / n.sqrt();
            assert!(
                mean.abs() < 5.0 * error + 0.01,
                "axis {axis}: {mean} +- {error}"
            );
        }
    }

    /// Where the reference has no noise, none is put in that the data speak against: axis by axis, the excess
    /// of a sum of squares that is off by 1 or 2 sigma would cost up to twenty nats. Three variances
    /// gain more than 12 nats by chance once in 30 000.
    #[test]
    fn what_an_axis_shows_by_chance_is_no_noise_of_the_reference() {
        for seed in 0..60 {
            let data = OffAxis::new([0.0; 3], seed);
            let rotations = Rotations::new(
                data.t_s.clone(),
                data.theta.as_slice().to_vec(),
                data.frames.clone(),
                data.inverse.clone(),
                CENTROID,
            );
            let mut found = rotations.noise(None);
            for part in &mut found.reference {
                part.slow = 0.0;
            }
            let joint = data.joint();
            let gain = joint.slope(&found).loglik - joint.slope(&noise([0.0; 3])).loglik;
            assert!(
                (-0.01..12.0).contains(&gain),
                "seed {seed}: {gain} {found:?}"
            );
        }
    }
}
