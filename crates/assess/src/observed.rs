//! What an analyst has: quaternions over time, cleaned and counted.
//!
//! ```text
//! w_k = -log(q_{k+1} q_k^-1) / dt                    rate, tracker axes
//! r_k = log(q_k (exp(-w (t_k - t_m)) q_m)^-1)        against the median rate w
//! outlier: |r_k - median over j = 1, 2, 3 of (r_{k-j} + r_{k+j}) / 2| beyond 8 robust sigma, any axis
//! ```
//!
//! Means of two frames at one distance follow any slope, and one outlier spoils one of three. Signs of
//! quaternions are made continuous; a step of more than one and a half times the median one is a gap.
//! Nothing is filled, and everything left out is counted.
//!
//! Source: the outlier rule of docs/formats/report.md; Hampel's identifier (running median).

use focal_plane::{rotation_from_vector, rotation_vector};
use nalgebra::{UnitQuaternion, Vector3};

use crate::AssessError;

/// Robust sigmas beyond which a frame is an outlier.
const OUTLIER_SIGMAS: f64 = 8.0;
/// Frames on either side that say where a frame should be.
const REACH: usize = 3;
/// Turn between frames beyond which its direction is not safe, rad.
const ALIAS_RAD: f64 = 2.0 * core::f64::consts::FRAC_PI_3;

/// What was found in the frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Counts {
    /// Frames of the bundle.
    pub frames: usize,
    /// Frames used.
    pub used: usize,
    /// Frames left out as outliers.
    pub outliers: usize,
    /// Frames outside the span of gyro or reference.
    pub outside: usize,
    /// Changes of a quaternion's sign, which mean nothing.
    pub sign_flips: usize,
    /// Holes in the frames.
    pub gaps: usize,
    /// The longest, s.
    pub longest_gap_s: f64,
}

/// Attitudes, inertial to tracker, outliers taken out.
#[derive(Clone, Debug, PartialEq)]
pub struct Observed {
    /// Times, s, strictly increasing.
    pub t_s: Vec<f64>,
    /// Attitudes; signs are continuous.
    pub q: Vec<UnitQuaternion<f64>>,
    /// Index of each frame in the table it came from.
    pub row: Vec<usize>,
    /// Median step, s.
    pub step_s: f64,
    /// Median rate, tracker axes, rad/s.
    pub rate_rad_s: Vector3<f64>,
    /// What was found.
    pub counts: Counts,
}

impl Observed {
    /// Cleans a table of attitudes.
    ///
    /// # Errors
    /// [`AssessError::TooFew`] frames, or a turn between frames that hides its direction.
    ///
    /// # Panics
    /// If times and attitudes differ in number.
    pub fn new(t_s: &[f64], q: &[UnitQuaternion<f64>]) -> Result<Self, AssessError> {
        assert_eq!(t_s.len(), q.len(), "one time for each attitude");
        const NEED: usize = 20;
        if t_s.len() < NEED {
            return Err(AssessError::TooFew {
                got: t_s.len(),
                need: NEED,
                why: "",
            });
        }
        let mut counts = Counts {
            frames: t_s.len(),
            ..Counts::default()
        };
        let q = continuous(q, &mut counts);
        let steps: Vec<f64> = t_s.windows(2).map(|t| t[1] - t[0]).collect();
        let step_s = median(&mut steps.clone());
        for step in steps.iter().filter(|s| **s > 1.5 * step_s) {
            counts.gaps += 1;
            counts.longest_gap_s = counts.longest_gap_s.max(*step);
        }
        let rate_rad_s = median_rate(t_s, &q, step_s)?;
        let keep = without_outliers(t_s, &q, &rate_rad_s, step_s);
        let row: Vec<usize> = (0..t_s.len()).filter(|k| keep[*k]).collect();
        counts.used = row.len();
        counts.outliers = t_s.len() - row.len();
        if row.len() < NEED {
            return Err(AssessError::TooFew {
                got: row.len(),
                need: NEED,
                why: " after outliers were taken out",
            });
        }
        Ok(Self {
            t_s: row.iter().map(|k| t_s[*k]).collect(),
            q: row.iter().map(|k| q[*k]).collect(),
            row,
            step_s,
            rate_rad_s,
            counts,
        })
    }

    /// Number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there is no frame: never, but for the look of it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// Middle of the span, s.
    #[must_use]
    pub fn middle_s(&self) -> f64 {
        0.5 * (self.t_s[0] + self.t_s[self.len() - 1])
    }

    /// One frame of every so many.
    pub(crate) fn every(&self, count: usize) -> Self {
        let count = count.max(1);
        Self {
            step_s: self.step_s * count as f64,
            ..self.only(|k| k % count == 0)
        }
    }

    /// Frames for which `keep` holds.
    pub(crate) fn only(&self, keep: impl Fn(usize) -> bool) -> Self {
        let index: Vec<usize> = (0..self.len()).filter(|k| keep(*k)).collect();
        Self {
            t_s: index.iter().map(|k| self.t_s[*k]).collect(),
            q: index.iter().map(|k| self.q[*k]).collect(),
            row: index.iter().map(|k| self.row[*k]).collect(),
            ..self.clone()
        }
    }
}

fn continuous(q: &[UnitQuaternion<f64>], counts: &mut Counts) -> Vec<UnitQuaternion<f64>> {
    let mut out: Vec<UnitQuaternion<f64>> = Vec::with_capacity(q.len());
    let mut sign = 1.0_f64;
    for given in q {
        let raw = given.into_inner();
        if let Some(last) = out.last() {
            let same = last.coords.dot(&(raw.coords * sign)) >= 0.0;
            if !same {
                sign = -sign;
                counts.sign_flips += 1;
            }
        }
        out.push(UnitQuaternion::new_unchecked(raw * sign));
    }
    out
}

fn median_rate(
    t_s: &[f64],
    q: &[UnitQuaternion<f64>],
    step_s: f64,
) -> Result<Vector3<f64>, AssessError> {
    let mut axes: [Vec<f64>; 3] = Default::default();
    let mut turns = Vec::new();
    for k in 1..t_s.len() {
        let dt = t_s[k] - t_s[k - 1];
        if dt > 1.5 * step_s {
            continue;
        }
        let turn = rotation_vector(&q[k], &q[k - 1]);
        turns.push(turn.norm());
        for (axis, out) in axes.iter_mut().enumerate() {
            out.push(-turn[axis] / dt);
        }
    }
    if turns.is_empty() {
        return Err(AssessError::TooFew {
            got: 0,
            need: 1,
            why: " next to each other",
        });
    }
    let turn = median(&mut turns);
    if turn > ALIAS_RAD {
        let turn_deg = turn.to_degrees();
        return Err(AssessError::Aliased { turn_deg });
    }
    let [x, y, z] = axes.each_mut().map(|axis| median(axis));
    Ok(Vector3::new(x, y, z))
}

/// Which frames stay.
fn without_outliers(
    t_s: &[f64],
    q: &[UnitQuaternion<f64>],
    rate: &Vector3<f64>,
    step_s: f64,
) -> Vec<bool> {
    let n = t_s.len();
    let middle = n / 2;
    let coarse = |k: usize| {
        let turn = rotation_from_vector(&(rate * -(t_s[k] - t_s[middle])));
        rotation_vector(&q[k], &(turn * q[middle]))
    };
    // may go round by 2 pi where the rate is a little off: the neighbour decides
    let mut path: Vec<Vector3<f64>> = (0..n).map(coarse).collect();
    for k in 1..n {
        let (last, now) = (path[k - 1], path[k]);
        let length = now.norm();
        if length > 0.0 {
            let other = now * (1.0 - core::f64::consts::TAU / length);
            if (other - last).norm() < (now - last).norm() {
                path[k] = other;
            }
        }
    }
    // frames since the last gap, and up to the next
    let joined = |k: &usize| t_s[*k] - t_s[*k - 1] <= 1.5 * step_s;
    let (mut since, mut until) = (vec![0; n], vec![0; n]);
    for k in (1..n).filter(joined) {
        since[k] = since[k - 1] + 1;
    }
    for k in (1..n).rev().filter(joined) {
        until[k - 1] = until[k] + 1;
    }
    let mut keep = vec![true; n];
    for axis in 0..3 {
        let deviation: Vec<f64> = (0..n)
            .map(|k| {
                let (back, on) = (since[k].min(REACH), until[k].min(REACH));
                let x = |j: usize| path[j][axis];
                let both = back.min(on);
                let mut said: Vec<f64> = (1..=both).map(|j| 0.5 * (x(k - j) + x(k + j))).collect();
                // at the ends the line through two on one side
                for (near, far) in [(1, 2), (1, 3), (2, 3)] {
                    let (p, q) = (near as f64, far as f64);
                    let line = |a: f64, b: f64| (q * a - p * b) / (q - p);
                    if both < REACH && far <= back {
                        said.push(line(x(k - near), x(k - far)));
                    }
                    if both < REACH && far <= on {
                        said.push(line(x(k + near), x(k + far)));
                    }
                }
                if said.is_empty() {
                    0.0
                } else {
                    x(k) - median(&mut said)
                }
            })
            .collect();
        let sigma = robust_sigma(&deviation);
        for (keep, d) in keep.iter_mut().zip(&deviation) {
            *keep &= sigma <= 0.0 || d.abs() <= OUTLIER_SIGMAS * sigma;
        }
    }
    keep
}

/// 1.4826 MAD about zero; where more than half are zero, as a running median leaves them on smooth
/// data, of the rest.
pub(crate) fn robust_sigma(x: &[f64]) -> f64 {
    let mut size: Vec<f64> = x.iter().map(|x| x.abs()).filter(|x| *x > 0.0).collect();
    if size.is_empty() {
        return 0.0;
    }
    1.4826 * median(&mut size)
}

/// The middle value; reorders.
pub(crate) fn median(x: &mut [f64]) -> f64 {
    let n = x.len();
    if n == 0 {
        return f64::NAN;
    }
    let (_, upper, _) = x.select_nth_unstable_by(n / 2, f64::total_cmp);
    let upper = *upper;
    if n % 2 == 1 {
        return upper;
    }
    let lower = x[..n / 2].iter().copied().fold(f64::MIN, f64::max);
    0.5 * (lower + upper)
}
