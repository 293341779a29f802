//! Slow errors of the attitude that the declared model makes by itself: stars cross the
//! detector, and change.
//!
//! Each star brings the declared error of its own place along. While n stars drift over
//! pixels, and when one of them is replaced, the attitude errs and jumps by
//!
//! ```text
//!         error                  jump                     s^2 = sigma_LSF^2/2 + A^2/3
//! x, y:   s / sqrt(n)            sqrt(2) s / n            one axis of one star
//! z:      s / (sqrt(2 n/3) h)    sqrt(2) s / (n (2/3) h)  h: half the field; stars of rms distance
//!                                                         sqrt(2/3) h, the one that changes at the edge
//! N = n sum (d / (2 h) + a / 4)  changes while the boresight moves by d and rolls by a
//! ```
//!
//! (A: peak of the declared triangle). The attitude alone does not tell such a jump from a
//! shift of the bracket: a step counts as one only if none of N changes makes it. Slow noise within the error is
//! what was declared, once the stars cross pixels, and so are lines as the motion makes them
//! ([`crate::attitude::imagined`]). All are taken twice as wide: bright stars stand in heaps, two may go at once,
//! and a sum of a few places scatters.
//!
//! Source: [M23] Fig. 4 with equal weights; erratum E14 for attitudes of few stars.

use std::sync::{Arc, OnceLock};

use centroid::{CentroidError, Triangle};
use coloured_noise::Coloured;
use focal_plane::{AttitudeSeries, AttitudeSource, rotation_vector};
use nalgebra::Vector3;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use telemetry::ModelKind;

use crate::attitude::imagined::Imagined;
use crate::situation::Situation;

/// Stars of a model that does not say how many.
const USUAL_STARS: u32 = 10;
/// See the header.
const WIDER: f64 = 2.0;
/// Stretches of the motion; a jitter faster than that changes no stars for long. In no number of whole periods of
/// one motion are all of these: it would be none.
const STRETCHES: [usize; 3] = [24, 29, 37];

/// What changes of stars do to an attitude.
#[derive(Clone, Debug)]
pub(crate) struct SpatialErrors {
    /// 1 sigma of a jump per axis, arcsec.
    pub(crate) sigma_arcsec: [f64; 3],
    /// Largest rms of the error per axis, arcsec; zero where no star crosses a pixel.
    pub(crate) slow_arcsec: [f64; 3],
    /// How many there are.
    pub(crate) expected: f64,
    /// What tells the lines.
    pub(crate) imagined: Option<Arc<Imagined>>,
}

impl SpatialErrors {
    /// Of the declared model along the reference at times `t_s`; `None` if it declares no
    /// error that stays with a place.
    pub(crate) fn declared(situation: &Situation<'_>, t_s: &[f64]) -> Option<Self> {
        let model = situation.model;
        let reference = situation.reference.as_ref()?;
        if model.kind != ModelKind::Pbm || t_s.len() < 2 {
            return None;
        }
        let noise = &model.noise;
        let star = (noise.distortion_arcsec.unwrap_or(0.0).powi(2) / 2.0
            + noise.centroid_arcsec.unwrap_or(0.0).powi(2) / 3.0)
            .sqrt();
        let n = stars(situation);
        let [x, y] = situation.camera.half_size_px();
        let half = half_field_rad(situation);
        let jump = WIDER * std::f64::consts::SQRT_2 * star / n;
        let error = WIDER * star / n.sqrt();
        let expected = changes_of_stars(situation, t_s);
        let crossed = expected / n * 2.0 * x.max(y) > 1.0;
        let slow_arcsec = [error, error, error / (half * (2.0_f64 / 3.0).sqrt())];
        (star > 0.0).then_some(Self {
            sigma_arcsec: [jump, jump, jump / (2.0 / 3.0 * half)],
            slow_arcsec: if crossed { slow_arcsec } else { [0.0; 3] },
            expected,
            imagined: Self::imagine(situation, reference, t_s),
        })
    }

    fn imagine(
        situation: &Situation<'_>,
        reference: &AttitudeSeries,
        t_s: &[f64],
    ) -> Option<Arc<Imagined>> {
        let noise = &situation.model.noise;
        let q: Vec<_> = t_s
            .iter()
            .map(|&t| reference.attitude(t))
            .collect::<Option<_>>()?;
        let turn = q.windows(2).map(|w| rotation_vector(&w[1], &w[0]));
        let peak = noise.centroid_arcsec.unwrap_or(0.0);
        let stars = situation.model.tracker.max_stars;
        Some(Arc::new(Imagined {
            camera: situation.camera.clone(),
            stars: stars.unwrap_or(USUAL_STARS) as usize,
            lsf_arcsec: noise.distortion_arcsec.unwrap_or(0.0),
            order: noise.distortion_order.unwrap_or(7) as usize,
            centroid: CentroidError::Triangle(Triangle::from_peak(peak)),
            t_s: t_s.to_vec(),
            turn: std::iter::once(Vector3::zeros()).chain(turn).collect(),
            even: OnceLock::new(),
            stretches: OnceLock::new(),
            sampled: OnceLock::new(),
        }))
    }

    /// Whether a line of this amplitude about an axis, arcsec, is more than the declared model makes beside `noise`
    /// of so many rows in a second.
    pub(crate) fn is_line(
        &self,
        frequency_hz: f64,
        axis: usize,
        amplitude: f64,
        noise: &Coloured,
        rows_s: f64,
    ) -> bool {
        let Some(imagined) = &self.imagined else {
            return true;
        };
        // amplitudes have a mean square of four densities over the span
        let turns = std::f64::consts::TAU * frequency_hz * noise.tau_s;
        let slow = 2.0 * noise.slow.powi(2) * noise.tau_s / (1.0 + turns * turns);
        let density = noise.white.powi(2) / rows_s + slow;
        let noise = 4.0 * density / imagined.span_s();
        imagined.is_beyond(frequency_hz, axis, amplitude, noise)
    }

    /// Chance that one of the changes makes a jump as large as `step`, arcsec.
    pub(crate) fn chance(&self, step: [f64; 3]) -> f64 {
        let square: f64 = (0..3)
            .map(|a| (step[a] / self.sigma_arcsec[a]).powi(2))
            .sum();
        self.paid(square, 3.0)
    }

    /// The same of axis `axis` alone.
    pub(crate) fn chance_on(&self, axis: usize, step: f64) -> f64 {
        self.paid((step / self.sigma_arcsec[axis]).powi(2), 1.0)
    }

    fn paid(&self, square: f64, freedom: f64) -> f64 {
        let one = ChiSquared::new(freedom).map_or(1.0, |law| law.sf(square));
        (one * self.expected).min(1.0)
    }
}

/// How many stars the declared tracker changes for others along the reference; 0 without one.
pub(crate) fn changes_of_stars(situation: &Situation<'_>, t_s: &[f64]) -> f64 {
    let Some(reference) = situation.reference.as_ref().filter(|_| t_s.len() > 1) else {
        return 0.0;
    };
    let half = half_field_rad(situation);
    let moved = STRETCHES.map(|stretches| moved(reference, t_s, stretches, half));
    stars(situation) * moved.into_iter().fold(0.0, f64::max)
}

fn stars(situation: &Situation<'_>) -> f64 {
    f64::from(situation.model.tracker.max_stars.unwrap_or(USUAL_STARS))
}

fn half_field_rad(situation: &Situation<'_>) -> f64 {
    let [x, y] = situation.camera.half_size_px();
    x.max(y) / situation.camera.focal_length_px()[0]
}

/// By how many fields, of this half size in rad, stars move from stretch to stretch.
fn moved(reference: &AttitudeSeries, t_s: &[f64], stretches: usize, half: f64) -> f64 {
    let mut moved = 0.0;
    let mut last = None;
    for k in 0..=stretches {
        let Some(q) = reference.attitude(t_s[k * (t_s.len() - 1) / stretches]) else {
            continue;
        };
        if let Some(last) = last {
            let turn: Vector3<f64> = rotation_vector(&q, &last);
            moved += turn.xy().norm() / (2.0 * half) + turn.z.abs() / 4.0;
        }
        last = Some(q);
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three sigma of the largest axis come by chance in 2 to 3 of 100 changes; where
    /// nothing changes, no step is one of them.
    #[test]
    fn a_step_is_held_against_the_changes_that_there_are() {
        let changes = SpatialErrors {
            sigma_arcsec: [0.5, 0.5, 5.0],
            slow_arcsec: [0.0; 3],
            expected: 20.0,
            imagined: None,
        };
        assert!(changes.chance([1.5, 0.0, 0.0]) > 0.5);
        // exp(-x/2) (1 + ...) at 36: 7.5e-8 times 20
        assert!((changes.chance([0.0, 3.0, 0.0]) - 1.5e-6).abs() < 2e-7);
        assert!((changes.chance_on(2, 15.0) - 20.0 * 0.0027).abs() < 1e-4);
        let still = SpatialErrors {
            expected: 0.0,
            ..changes
        };
        assert!(still.chance([0.1, 0.0, 0.0]).abs() < f64::EPSILON);
    }
}
