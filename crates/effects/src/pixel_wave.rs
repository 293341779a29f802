//! Waves in the pixel phase, of which every order is made of the first.
//!
//! ```text
//! sin (k + 1) phi = sin k phi cos phi + cos k phi sin phi      left_k = left_1^(k^2)
//! ```
//!
//! Of a wave at a position known to a variance v (px^2) `left_1 = exp(-2 pi^2 v)` is to be expected.
//!
//! Source: addition theorem; characteristic function of a Gaussian.

use core::f64::consts::PI;
use std::borrow::Cow;
use std::sync::OnceLock;

use focal_plane::Camera;

use crate::StarRows;

/// A wave of which less than this is left cannot be seen at all.
const FADED: f64 = 0.01;

/// The wave of one cycle a pixel, at one position along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelWave {
    sin: f64,
    cos: f64,
    left: f64,
}

impl PixelWave {
    /// At this phase, rad, of a position known to `variance_px2`; one of which no variance is known (NaN) is
    /// taken as it is.
    pub fn at(phase_rad: f64, variance_px2: f64) -> Self {
        let (sin, cos) = phase_rad.sin_cos();
        let left = if variance_px2 > 0.0 {
            (-2.0 * PI * PI * variance_px2).exp()
        } else {
            1.0
        };
        Self { sin, cos, left }
    }

    /// What is to be expected of the sine and the cosine of order 1, 2, ...; of what has all but gone,
    /// nothing.
    pub fn orders(self) -> impl Iterator<Item = [f64; 2]> {
        let (mut sin, mut cos) = (self.sin, self.cos);
        let mut shares = shares(self.left);
        core::iter::from_fn(move || {
            let left = shares.next()?;
            let order = [left * sin, left * cos];
            (sin, cos) = (
                sin * self.cos + cos * self.sin,
                cos * self.cos - sin * self.sin,
            );
            Some(order)
        })
    }
}

/// What is left of order 1, 2, ... where `first` is of the first.
fn shares(first: f64) -> impl Iterator<Item = f64> {
    let (mut left, mut factor) = (first, first);
    let square = first * first;
    core::iter::from_fn(move || {
        let share = if left < FADED { 0.0 } else { left };
        factor *= square;
        left *= factor;
        Some(share)
    })
}

/// The waves of some rows along x and y, evaluated when they are first asked for.
#[derive(Clone, Debug, Default)]
pub struct PixelWaves([OnceLock<Vec<PixelWave>>; 2]);

impl StarRows<'_> {
    /// The wave of each row along `axis` (0 is x), where the light falls.
    pub fn pixel_waves(&self, camera: &Camera, axis: usize) -> Cow<'_, [PixelWave]> {
        let all = || {
            let at = self.landed_px[axis].iter();
            at.zip(self.landed_variance_px2[axis])
                .map(|(&p, &variance)| PixelWave::at(camera.phase_rad(p), variance))
                .collect()
        };
        match self.waves {
            Some(PixelWaves(known)) => Cow::Borrowed(known[axis].get_or_init(all)),
            None => Cow::Owned(all()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each order against its own sine and exponential; rounding alone.
    #[test]
    fn every_order_comes_from_the_first() {
        for variance in [0.0, 0.003, 0.07] {
            for (k, got) in (1..=6).zip(PixelWave::at(1.1, variance).orders()) {
                let k = f64::from(k);
                let left = (-2.0 * PI * PI * k * k * variance).exp();
                let left = if left < 0.01 { 0.0 } else { left };
                let (sin, cos) = (1.1 * k).sin_cos();
                assert!((got[0] - left * sin).abs() < 1e-14, "{k}");
                assert!((got[1] - left * cos).abs() < 1e-14, "{k}");
            }
        }
    }
}
