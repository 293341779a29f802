//! Attitude errors that the declared model makes along a motion, imagined: what a line is held against.
//!
//! Stars that cross the detector bring the declared distortion and centroid error of their places along. A motion
//! that repeats makes a line of them, and so does a steady one that takes pixel after pixel. How large depends on
//! stars and coefficients that an attitude does not tell. So some skies and fields are drawn, and for a frequency
//!
//! ```text
//! theta = (sum N^T N)^-1 sum N^T e(P_s(t))         n stars, e: the drawn error at each star's place
//! a(f)  = rms over the draws of the amplitude of theta at f; the largest near f counts
//! ```
//!
//! Bright stars stand in heaps: for lines each sky is a part of the field, and stars that leave it on one side come
//! in on the other. An amplitude is Rayleigh over draws: one in 1e5 is beyond 3.4 times its rms, and of as many
//! frequencies the largest is found; the rms of 48 draws is known to 7 %.
//!
//! Source: [M23] Fig. 4 with equal weights; Sections 2.2 and 2.3 for the errors.

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::OnceLock;

use centroid::CentroidError;
use distortion::{DistortionField, LsfSigma};
use focal_plane::{Angle, Camera, Pixel};
use nalgebra::{Matrix3, Vector3};
use rand_core::Rng;
use rayon::prelude::*;
use star_tracker::{Purpose, stream};

/// Skies and fields.
const DRAWS: u64 = 48;
/// Most frames that are gone through. Of a longer run every few for slow lines; for fast ones all of some stretches,
/// of which that counts in which the line is largest, for the motion may come late and go early.
const MOST_FRAMES: usize = 6_000;
/// Those stretches.
const STRETCHES: usize = 6;
/// Cycles between frames above which a line is fast.
const FAST: f64 = 0.25;
/// Stars at the edge of the field are faster than those in the middle by some hundredths, and each has its line:
/// points to both sides, and what share of a frequency they are apart at least.
const NEAR: i32 = 4;
const SPREAD: f64 = 0.01;
/// The least part of the field, of its side, that stars stand in.
const LEAST_PART: f64 = 0.3;
/// Amplitudes beyond so many of the imagined are not the declared model's: 3.4 by the law above, and half as much
/// again for skies that are not like those that are drawn (at 4.5, two of 48 null runs named a line).
const BEYOND: f64 = 5.0;

/// What is drawn, and along which motion.
#[derive(Debug)]
pub(crate) struct Imagined {
    pub(crate) camera: Camera,
    pub(crate) stars: usize,
    /// Of the distortion, arcsec, and its order.
    pub(crate) lsf_arcsec: f64,
    pub(crate) order: usize,
    /// Arcsec.
    pub(crate) centroid: CentroidError,
    /// Times of the frames, and the turn to each from the one before, rad, tracker axes.
    pub(crate) t_s: Vec<f64>,
    pub(crate) turn: Vec<Vector3<f64>>,
    /// Drawn when it is asked for: frames evenly over all, all frames of some stretches, and means over all.
    pub(crate) even: OnceLock<Vec<Stretch>>,
    pub(crate) stretches: OnceLock<Vec<Stretch>>,
    pub(crate) sampled: OnceLock<Vec<Errors>>,
}

/// Errors of one sky and field, arcsec per axis, frame by frame.
pub(crate) type Errors = [Vec<f64>; 3];

/// Errors of all skies and fields at some times.
#[derive(Debug)]
pub(crate) struct Stretch {
    t_s: Vec<f64>,
    drawn: Vec<Errors>,
}

impl Imagined {
    /// Whether a line at `f`, Hz, of this amplitude about an axis, arcsec, is more than the declared model and noise
    /// make, of which amplitudes have a mean square of `noise`, arcsec^2.
    pub(crate) fn is_beyond(&self, f: f64, axis: usize, amplitude: f64, noise: f64) -> bool {
        let step = (0.5 / self.span_s()).max(SPREAD * f);
        let near = (-NEAR..=NEAR).map(|k| self.line_arcsec(f + step * f64::from(k), axis));
        amplitude > BEYOND * near.fold(0.0, f64::max).hypot(noise.sqrt())
    }

    pub(crate) fn span_s(&self) -> f64 {
        self.t_s.last().unwrap_or(&0.0) - self.t_s.first().unwrap_or(&0.0)
    }

    /// a(f) about an axis, arcsec.
    fn line_arcsec(&self, f: f64, axis: usize) -> f64 {
        let stride = self.turn.len().div_ceil(MOST_FRAMES).max(1);
        let step = self.span_s() / self.turn.len().max(1) as f64;
        let among = if stride == 1 || f * step * (stride as f64) < FAST {
            self.even.get_or_init(|| vec![self.every(stride)])
        } else {
            self.stretches.get_or_init(|| self.in_stretches())
        };
        among
            .iter()
            .map(|stretch| stretch.line_arcsec(f, axis))
            .fold(0.0, f64::max)
    }

    /// Every frame of so many.
    fn every(&self, stride: usize) -> Stretch {
        let turn: Vec<Vector3<f64>> = (self.turn.chunks(stride).map(|c| c.iter().sum())).collect();
        let last = |c: &[f64]| c.last().copied();
        Stretch {
            t_s: self.t_s.chunks(stride).filter_map(last).collect(),
            drawn: self.all(&turn, Place::Heap),
        }
    }

    /// All frames of some stretches, evenly from the first to the last.
    fn in_stretches(&self) -> Vec<Stretch> {
        let frames = (MOST_FRAMES / STRETCHES).min(self.turn.len());
        let starts = (0..STRETCHES).map(|k| k * (self.turn.len() - frames) / (STRETCHES - 1));
        starts
            .map(|start| Stretch {
                t_s: self.t_s[start..start + frames].to_vec(),
                drawn: self.all(&self.turn[start..start + frames], Place::Heap),
            })
            .collect()
    }

    /// Means of the errors of every draw over bins of frames. In a long run, over some frames of each.
    pub(crate) fn binned(&self, bins: &[Range<usize>]) -> Vec<Errors> {
        let stride = self.turn.len().div_ceil(MOST_FRAMES).max(1);
        let sampled = self.sampled.get_or_init(|| {
            let steps = self.turn.chunks(stride);
            let turn: Vec<Vector3<f64>> = steps.map(|step| step.iter().sum()).collect();
            self.all(&turn, Place::Whole)
        });
        let mean = |values: &[f64], bin: &Range<usize>| {
            let first = bin.start / stride;
            let values = &values[first..bin.end.div_ceil(stride).clamp(first + 1, values.len())];
            values.iter().sum::<f64>() / values.len() as f64
        };
        let means = |values: &Vec<f64>| bins.iter().map(|bin| mean(values, bin)).collect();
        sampled
            .iter()
            .map(|axes| axes.each_ref().map(means))
            .collect()
    }

    /// Errors of all skies and fields along these turns. Those that leave an attitude undetermined are left out.
    fn all(&self, turns: &[Vector3<f64>], place: Place) -> Vec<Errors> {
        let draws = (0..DRAWS).into_par_iter();
        draws.filter_map(|k| self.draw(turns, place, k)).collect()
    }

    /// Errors of sky and field `k` along these turns from frame to frame.
    fn draw(&self, turns: &[Vector3<f64>], place: Place, k: u64) -> Option<Errors> {
        let sigma = LsfSigma::Circular(Angle::from_arcsec(self.lsf_arcsec));
        let mut rng = stream(0, k, Purpose::Distortion);
        let field = DistortionField::draw(self.order, sigma, &mut rng).ok()?;
        let half = self.camera.half_size_px();
        let [fx, fy] = self.camera.focal_length_px();
        let mut rng = stream(0, k, Purpose::StarField);
        let mut within = |size: f64| size * (2.0 * (rng.next_u64() as f64 / u64::MAX as f64) - 1.0);
        let share = match place {
            Place::Whole => 1.0,
            Place::Heap => LEAST_PART + (1.0 - LEAST_PART) * within(0.5).abs() * 2.0,
        };
        let size = half.map(|half| share * half);
        let centre = half.map(|half| within((1.0 - share) * half));
        let mut at: Vec<[f64; 2]> = (0..self.stars)
            .map(|_| [0, 1].map(|axis| centre[axis] + within(size[axis])))
            .collect();
        let mut out = Errors::default();
        for turn in turns {
            let (mut normal, mut score) = (Matrix3::zeros(), Vector3::zeros());
            for star in &mut at {
                // dv = theta x v, v = (x, y, 1)
                let [x, y] = [star[0] / fx, star[1] / fy];
                let rows = [
                    Vector3::new(-x * y, 1.0 + x * x, -y),
                    Vector3::new(-1.0 - y * y, x * y, x),
                ];
                for (axis, row) in rows.iter().enumerate() {
                    let first = centre[axis] - size[axis];
                    let moved = star[axis] + row.dot(turn) * [fx, fy][axis];
                    star[axis] = first + (moved - first).rem_euclid(2.0 * size[axis]);
                }
                let pixel = Pixel {
                    x: star[0],
                    y: star[1],
                };
                let lsf = field.evaluate(self.camera.normalised(pixel));
                let hsf = self.centroid.error_at(pixel, self.camera.pixel_centre());
                for (axis, row) in rows.iter().enumerate() {
                    normal += row * row.transpose();
                    score += row * (lsf[axis] + hsf[axis]);
                }
            }
            let theta = normal.try_inverse()? * score;
            for (axis, out) in out.iter_mut().enumerate() {
                out.push(theta[axis]);
            }
        }
        Some(out)
    }
}

impl Stretch {
    /// a(f) about an axis, arcsec.
    fn line_arcsec(&self, f: f64, axis: usize) -> f64 {
        let wave = |t: &f64| {
            let (sin, cos) = (TAU * f * (t - self.t_s[0])).sin_cos();
            [1.0, cos, sin]
        };
        let waves: Vec<[f64; 3]> = self.t_s.iter().map(wave).collect();
        let normal: Matrix3<f64> = waves
            .iter()
            .map(|w| Vector3::from(*w) * Vector3::from(*w).transpose())
            .sum();
        let Some(inverse) = normal.try_inverse() else {
            return 0.0;
        };
        let square = |theta: &Errors| -> f64 {
            let all = waves.iter().zip(&theta[axis]);
            let score: Vector3<f64> = all.map(|(w, v)| Vector3::from(*w) * *v).sum();
            let size = inverse * score;
            size.y * size.y + size.z * size.z
        };
        let n = self.drawn.len().max(1) as f64;
        (self.drawn.iter().map(square).sum::<f64>() / n).sqrt()
    }
}

/// Where in the field stars stand.
#[derive(Clone, Copy, Debug)]
enum Place {
    /// Anywhere: they go and come at its edges, where a distortion is largest.
    Whole,
    /// All of them in a part of it.
    Heap,
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Ten minutes at 2 Hz about X, by what `path` tells in rad.
    pub(in crate::attitude) fn imagined(
        lsf_arcsec: f64,
        peak_arcsec: f64,
        path: impl Fn(f64) -> f64,
    ) -> Imagined {
        let t_s: Vec<f64> = (0..1200).map(|k| 0.5 * f64::from(k)).collect();
        let turn = t_s
            .windows(2)
            .map(|t| Vector3::x() * (path(t[1]) - path(t[0])));
        Imagined {
            camera: Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).expect("a camera"),
            stars: 12,
            lsf_arcsec,
            order: 7,
            centroid: CentroidError::Triangle(centroid::Triangle::from_peak(peak_arcsec)),
            turn: std::iter::once(Vector3::zeros()).chain(turn).collect(),
            t_s,
            even: OnceLock::new(),
            stretches: OnceLock::new(),
            sampled: OnceLock::new(),
        }
    }

    /// A swing by 1 degree (50 px) takes all stars over the same distortion again and again: a line at its
    /// frequency, ten times what there is elsewhere, of the size of 3 arcsec over sqrt(12) or less.
    #[test]
    fn a_motion_that_repeats_makes_a_line() {
        let swing = imagined(3.0, 0.0, |t| 0.0175 * (TAU * 0.04 * t).sin());
        let [line, beside] =
            [0.04, 0.0533].map(|f| [0, 1, 2].map(|axis| swing.line_arcsec(f, axis)));
        for axis in 0..3 {
            assert!(line[axis] > 10.0 * beside[axis], "{line:?} {beside:?}");
        }
        assert!(line[0] < 3.0 / 12.0_f64.sqrt(), "{line:?}");
        assert!(
            swing.is_beyond(0.04, 0, 5.1 * line[0], 0.0) && !swing.is_beyond(0.04, 0, line[0], 0.0)
        );
    }

    /// A drift of 0.1 px/s takes pixel after pixel: the triangle's line is at 0.1 Hz, about X. Without errors there
    /// is none.
    #[test]
    fn a_drift_over_pixels_makes_a_line() {
        let px =
            imagined(0.0, 0.0, |_| 0.0).camera.arcsec_per_px()[0] / focal_plane::ARCSEC_PER_RAD;
        let drift = |peak: f64| imagined(0.0, peak, move |t| 0.1 * px * t);
        let [line, beside] = [0.1, 0.0727].map(|f| drift(5.0).line_arcsec(f, 0));
        assert!(line > 5.0 * beside, "{line} {beside}");
        let none = [0, 1, 2].map(|axis| drift(0.0).line_arcsec(0.1, axis));
        assert!(none.iter().all(|a| a.abs() < 1e-12), "{none:?}");
    }
}
