//! White noise of the reference, as weights.
//!
//! A reference with noise of its own turns all stars of a frame alike. Taken for noise of the stars it makes
//! what turns the camera seem far more certain than it is, and weighs the rotation about the boresight, which
//! the stars tell badly, as little against the other two as they do. With s^2 the variance of a row of weight 1,
//! A the rotation columns of a frame and S the reference's variances,
//!
//! ```text
//! V = s^2 + A S A'      s^2 c' V^-1 c = c'c - (A'c)' (A'A + P)^-1 (A'c)      P = s^2 / S
//! ```
//!
//! so that a frame's rotation is a free unknown with a prior, P = 0 without a reference. P is found from what
//! changes from one frame to the next, which no slow effect adds to: changes of rows have 2 s^2, changes of
//! rotations 2 S beside the stars' own ([`crate::star::frame_rotation`]).
//!
//! Source: Aitken 1935 (generalised least squares); Woodbury 1950; Henderson 1975.

use crate::star::data::StarData;
use crate::star::frame_rotation::Turns;

/// Share of the stars' own variance of a rotation below which the reference's changes nothing.
const LEAST: f64 = 0.1;
/// The same in sigmas of what chance makes of it.
const BEYOND_CHANCE: f64 = 4.0;
/// An axis on which the reference has no noise, in units of the stars' information.
const NONE: f64 = 1e6;

/// What changes from frame to frame tells of the reference.
#[derive(Clone, Copy, Debug)]
pub(crate) struct White {
    /// P of the module's header per axis; `None` where the reference is as good as exact.
    pub(crate) precision: Option<[f64; 3]>,
    /// Variance of the white part of its error about each axis, and how well that is known, arcsec^2.
    pub(crate) variance: [[f64; 2]; 3],
}

/// Of rows that change by `changes` ([`crate::star::changes`]) and count by their `weight`; `None` where there is no
/// reference, or nothing is known of it.
pub(crate) fn white(data: &StarData, changes: &[Vec<f64>; 2], weight: &[f64]) -> Option<White> {
    if data.free_attitude || data.frames_are_unrelated() {
        return None;
    }
    let turns = Turns::of(data, changes.each_ref().map(Vec::as_slice), weight);
    let known: Vec<_> = turns.frames.iter().flatten().collect();
    let n = known.len() as f64;
    if known.is_empty() || turns.noise.is_nan() || turns.noise <= 0.0 {
        return None;
    }
    // a mean of n squares of neighbouring differences, of which each has a half of the next
    let error = (3.0 / n).sqrt();
    let mut precision = [0.0; 3];
    let mut variance = [[0.0; 2]; 3];
    let mut matters = false;
    for axis in 0..3 {
        let information = known.iter().map(|t| t.variance[axis].recip()).sum::<f64>() / n;
        let own = turns.reference[axis];
        let share = own / turns.noise * information;
        matters |= share > LEAST.max(BEYOND_CHANCE * error);
        precision[axis] = information * f64::min(share.recip(), NONE);
        // changes have twice the variance
        variance[axis] = [0.5 * own, 0.5 * (own + turns.noise / information) * error];
    }
    Some(White {
        precision: matters.then_some(precision),
        variance,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::star::changes;
    use crate::star::harness::{STARS, seen};
    use focal_plane::{ARCSEC_PER_RAD, AttitudeSeries, Camera, StarFrames, rotation_from_vector};
    use nalgebra::{UnitQuaternion, Vector3};
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const FRAMES: usize = 2000;
    /// Of a centroid, arcsec.
    const NOISE: f64 = 4.0;

    /// Information of six stars on a rotation per axis, and the precision that is found where the reference
    /// has white noise `white` per axis, arcsec, and a slow error of 30 arcsec.
    fn found(white: [f64; 3]) -> ([f64; 3], White) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let mut frames = StarFrames::new();
        let (mut t_s, mut q) = (Vec::new(), Vec::new());
        let scale = camera.arcsec_per_px();
        for k in 0..FRAMES {
            let t = 0.5 * k as f64;
            frames.begin(t);
            for (s, at) in (0..).zip(&STARS) {
                let [x, y] = [0, 1].map(|a| at[a] + NOISE / scale[a] * normal());
                frames.push(s, i64::from(s), x, y);
            }
            let slow = 30.0 * (0.01 * t).sin();
            let error = white.map(|w| (w * normal() + slow) / ARCSEC_PER_RAD);
            t_s.push(t);
            q.push(rotation_from_vector(&Vector3::from(error)) * UnitQuaternion::identity());
        }
        let reference = AttitudeSeries::new(t_s, q, None).unwrap();
        let data = seen(&camera, &frames, Some(&reference), &STARS);
        let residual = data.measured_residual();
        let residual = residual.each_ref().map(Vec::as_slice);
        let weight = vec![1.0; data.t_s.len()];
        let turns = Turns::of(&data, residual, &weight);
        let first = turns.frames[0].as_ref().unwrap();
        let information = std::array::from_fn(|a| first.variance[a].recip());
        (
            information,
            super::white(&data, &changes::of(&data), &weight).unwrap(),
        )
    }

    /// Six stars know X and Y to 4/sqrt(6) = 1.6 arcsec, Z ten times worse; the reference has 3 and 0.8 arcsec
    /// about X and Y, and 40 about Z. The mean of n squares of differences, of which neighbours share a half, is
    /// known to sqrt(3/n) = 3.9 %, and so are both parts of S: of X, where S is most of what is seen, P to 6 %; of
    /// Y, where the stars' part is five times S, to 24 %.
    #[test]
    fn what_changes_from_frame_to_frame_is_the_white_part() {
        let white = [3.0, 0.8, 40.0];
        let (_, found) = found(white);
        let precision = found.precision.unwrap();
        for (axis, sigma) in [(0, 0.06), (1, 0.24), (2, 0.06)] {
            let truth = (NOISE / white[axis]).powi(2);
            let off = (precision[axis] / truth).ln();
            assert!(
                off.abs() < 5.0 * sigma,
                "{axis}: {} {truth}",
                precision[axis]
            );
            let [variance, error] = found.variance[axis];
            assert!(
                (variance - white[axis].powi(2)).abs() < 4.0 * error,
                "{axis}: {variance} {error} {white:?}"
            );
            assert!(
                (error / variance / sigma).ln().abs() < 0.5,
                "{axis}: {error}"
            );
        }
    }

    /// A slow error of 30 arcsec is not white, and a reference of a tenth of the stars' noise is as good as exact.
    #[test]
    fn a_slow_error_is_none_and_a_good_reference_is_exact() {
        assert_eq!(found([0.0; 3]).1.precision, None);
        assert_eq!(found([0.1; 3]).1.precision, None);
        // about an axis without noise the rotation is held
        let (information, found) = found([3.0, 0.0, 0.0]);
        let found = found.precision.unwrap();
        assert!(found[1] > 5.0 * information[1] && found[2] > 5.0 * information[2]);
    }
}
