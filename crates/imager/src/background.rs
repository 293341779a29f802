//! Light that is not of stars: the sky, and stray light that rises.
//!
//! ```text
//! rate(x, y, t) = sky (1 + g . (x, y)/half) + stray max(0, t - t0) (1 + h . (x, y)/half)     electrons/s a pixel
//! ```
//!
//! x, y: centred px; half: half the detector, so that g and h are the relative change from the centre to
//! an edge.
//!
//! Not physics: a linear form.

use focal_plane::{Camera, Pixel};
use serde::{Deserialize, Serialize};

use crate::ImagerError;

/// `[background]`
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Background {
    /// Sky at the centre, electrons per second and pixel; default 0.
    pub sky_e_s: f64,
    /// Its relative change from the centre to the edges along x and y; default 0.
    pub sky_gradient: [f64; 2],
    /// Rise of the stray light at the centre, electrons per second and pixel, per second; default 0.
    pub stray_e_s2: f64,
    /// Its relative change from the centre to the edges along x and y; default 0.
    pub stray_gradient: [f64; 2],
    /// When it begins to rise, s; default 0.
    pub stray_from_s: f64,
}

impl Background {
    pub(crate) fn check(&self) -> Result<(), ImagerError> {
        ImagerError::not_negative("background.sky_e_s", self.sky_e_s)?;
        ImagerError::not_negative("background.stray_e_s2", self.stray_e_s2)?;
        ImagerError::finite("background.stray_from_s", self.stray_from_s)?;
        for value in self.sky_gradient {
            ImagerError::check(
                "background.sky_gradient",
                value,
                value.abs() <= 1.0,
                "from -1 to 1",
            )?;
        }
        for value in self.stray_gradient {
            ImagerError::check(
                "background.stray_gradient",
                value,
                value.abs() <= 1.0,
                "from -1 to 1",
            )?;
        }
        Ok(())
    }

    /// Electrons per second of a pixel.
    pub(crate) fn e_s(&self, camera: &Camera, at: Pixel, t_s: f64) -> f64 {
        let [half_x, half_y] = camera.half_size_px();
        let (x, y) = (at.x / half_x, at.y / half_y);
        let linear = |g: [f64; 2]| (1.0 + g[0] * x + g[1] * y).max(0.0);
        let risen = self.stray_e_s2 * (t_s - self.stray_from_s).max(0.0);
        self.sky_e_s * linear(self.sky_gradient) + risen * linear(self.stray_gradient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand at half way to an edge on x, and at the lower edge.
    #[test]
    fn sky_and_stray_light_are_linear() {
        let camera = crate::Optics::default().camera().unwrap();
        let background = Background {
            sky_e_s: 100.0,
            sky_gradient: [0.2, -0.1],
            stray_e_s2: 3.0,
            stray_gradient: [0.0, 0.5],
            stray_from_s: 10.0,
        };
        let at = |x: f64, y: f64, t: f64| background.e_s(&camera, Pixel { x, y }, t);
        assert!((at(256.0, 0.0, 5.0) - 110.0).abs() < 1e-9);
        assert!((at(0.0, -512.0, 20.0) - (110.0 + 30.0 * 0.5)).abs() < 1e-9);
    }
}
