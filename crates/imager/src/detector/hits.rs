//! Particle hits: tracks of charge.
//!
//! ```text
//! hits in a window ~ Poisson(rate pixels T);   track: straight, any direction, length exponential
//! charge per pixel of track ~ exponential (once a track)
//! ```
//!
//! Source: Groom, "Cosmic rays and other nonsense in astronomical CCD imagers", Experimental Astronomy
//! 14 (2002) 45.

use core::f64::consts::TAU;

use rand_core::Rng;
use rand_distr::{Distribution, Exp1, Poisson, Uniform};
use serde::{Deserialize, Serialize};

use super::Place;
use crate::ImagerError;

/// Distance of the steps in which a track leaves its charge, px.
const STEP_PX: f64 = 0.25;

/// `[detector.particles]`
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Particles {
    /// Hits per pixel and second.
    pub hits_px_s: f64,
    /// Mean charge per pixel of track, electrons.
    pub charge_e_px: f64,
    /// Mean length of a track, px.
    pub length_px: f64,
}

impl Particles {
    pub(super) fn check(&self) -> Result<(), ImagerError> {
        ImagerError::not_negative("detector.particles.hits_px_s", self.hits_px_s)?;
        ImagerError::not_negative("detector.particles.charge_e_px", self.charge_e_px)?;
        ImagerError::positive("detector.particles.length_px", self.length_px)
    }

    pub(super) fn hit<R: Rng>(&self, place: Place, window: &mut [f64], rng: &mut R) {
        let (columns, rows) = (place.columns as f64, (window.len() / place.columns) as f64);
        let expected = self.hits_px_s * columns * rows * place.exposure_s;
        let (Ok(count), Ok(unit)) = (Poisson::new(expected), Uniform::new(0.0, 1.0)) else {
            return;
        };
        let hits: f64 = count.sample(rng);
        let mut hit = 0.0;
        while hit < hits {
            hit += 1.0;
            let mut one = || -> f64 { unit.sample(rng) };
            let (mut x, mut y) = (columns * one(), rows * one());
            let (sin, cos) = (TAU * one()).sin_cos();
            let (length, charge): (f64, f64) = (Exp1.sample(rng), Exp1.sample(rng));
            let mut left_px = self.length_px * length;
            while left_px > 0.0 {
                let step = left_px.min(STEP_PX);
                if x >= 0.0 && x < columns && y >= 0.0 && y < rows {
                    let at = cell(y) * place.columns + cell(x);
                    window[at] += self.charge_e_px * charge * step;
                }
                x += step * cos;
                y += step * sin;
                left_px -= STEP_PX;
            }
        }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "inside a window: not negative, and below its size"
)]
fn cell(px: f64) -> usize {
    px as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Key, Use};

    /// Charge of short tracks: rate pixels T length charge on average. Of a hit's charge, which is a product of
    /// two exponentials, the variance is 3 of its squared mean; tracks of 0.05 px that leave 20 x 20 pixels
    /// lose under 1 %.
    #[test]
    fn hits_leave_the_charge_of_their_tracks() {
        let particles = Particles {
            hits_px_s: 0.01,
            charge_e_px: 2000.0,
            length_px: 0.05,
        };
        let place = Place {
            corner: [0, 0],
            columns: 20,
            t_s: 0.0,
            exposure_s: 0.5,
        };
        let (mut sum, windows) = (0.0, 4000_u32);
        for k in 0..windows {
            let mut window = vec![0.0; 400];
            let mut rng = Key::new(1, 0, Use::Exposure).with(u64::from(k)).stream();
            particles.hit(place, &mut window, &mut rng);
            sum += window.iter().sum::<f64>();
        }
        let hits = f64::from(windows) * 0.01 * 400.0 * 0.5;
        let mean = sum / hits;
        let error = 5.0 * (4.0 / hits).sqrt() + 0.01;
        assert!((mean / (2000.0 * 0.05) - 1.0).abs() < error, "{mean}");
    }
}
