//! The tracker's side: where it opens windows, and the centroid that it forms.
//!
//! ```text
//! window kept while |expected place - its centre| <= 1/2 + hysteresis on both axes; else centred anew
//! v = dn - background, 0 below the threshold;   x = sum v x_pixel / sum v
//! weighted:  x <- x + 2 sum w v (x_pixel - x) / sum w v,  w = exp(-r^2 / 2 s^2),  five times
//! ```
//!
//! The expected place is that of a pinhole at the true attitude: the prediction of a tracker in its
//! stride is good to well below a pixel. Its background is the median of the window's border, or a
//! fixed level.
//!
//! Source: Thomas et al., "Comparison of centroid computation algorithms in a Shack-Hartmann sensor",
//! MNRAS 371 (2006) 323 (thresholded and weighted centre of gravity).

use focal_plane::{Camera, Pixel};
use serde::{Deserialize, Serialize};

use crate::ImagerError;
use crate::spot::MOST;

/// Rounds of the weighted centroid: each leaves a few per cent of the error before.
const ROUNDS: usize = 5;

/// `[readout]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Readout {
    /// Columns and rows of a window; default 7 by 7.
    pub window: [usize; 2],
    /// How much further than half a pixel a star may be from the middle before the window moves, px;
    /// default 0.2.
    pub hysteresis_px: f64,
    /// Background: default the median of the window's border.
    pub background: BackgroundLevel,
    /// The fixed level, DN; needed by `background = "fixed"`.
    pub background_dn: Option<f64>,
    /// Pixels below this count as 0, DN above the background; default none.
    pub threshold_dn: Option<f64>,
    /// How centroids are formed; default the first moment.
    pub centroid: CentroidForm,
    /// Width of the weight, 1 sigma, px; default 1. For `centroid = "weighted"`.
    pub weight_px: f64,
    /// Least flux of a valid star, DN; default 50.
    pub least_flux_dn: f64,
    /// Step of the reported positions, px; default 0: none.
    pub position_step_px: f64,
    /// Step of the components of the reported quaternion; default 0: none.
    pub quaternion_step: f64,
    /// Whether the windows are in the bundle; default no.
    pub images: bool,
}

/// How the background is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BackgroundLevel {
    /// `border`: median of the outermost pixels.
    #[default]
    Border,
    /// `fixed`: a level from the ground.
    Fixed,
}

/// How centroids are formed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CentroidForm {
    /// `moment`: first moment of the window.
    #[default]
    Moment,
    /// `weighted`: first moment under a Gaussian that follows the star.
    Weighted,
}

impl Default for Readout {
    fn default() -> Self {
        Self {
            window: [7, 7],
            hysteresis_px: 0.2,
            background: BackgroundLevel::Border,
            background_dn: None,
            threshold_dn: None,
            centroid: CentroidForm::Moment,
            weight_px: 1.0,
            least_flux_dn: 50.0,
            position_step_px: 0.0,
            quaternion_step: 0.0,
            images: false,
        }
    }
}

/// A centroid, px from the first edges of the window, and the flux, DN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Centroid {
    /// Along the columns.
    pub x: f64,
    /// Along the rows.
    pub y: f64,
    /// Sum of the pixels above the background.
    pub flux: f64,
}

impl Readout {
    pub(crate) fn check(&self) -> Result<(), ImagerError> {
        for n in self.window {
            let fits = (3..=MOST).contains(&n);
            ImagerError::check("readout.window", n as f64, fits, "from 3 to 64")?;
        }
        ImagerError::not_negative("readout.hysteresis_px", self.hysteresis_px)?;
        ImagerError::positive("readout.weight_px", self.weight_px)?;
        ImagerError::finite("readout.least_flux_dn", self.least_flux_dn)?;
        ImagerError::not_negative("readout.position_step_px", self.position_step_px)?;
        ImagerError::not_negative("readout.quaternion_step", self.quaternion_step)?;
        ImagerError::finite("readout.threshold_dn", self.threshold_dn.unwrap_or(0.0))?;
        let level = match self.background {
            BackgroundLevel::Fixed => self.background_dn.unwrap_or(f64::NAN),
            BackgroundLevel::Border => self.background_dn.unwrap_or(0.0),
        };
        ImagerError::check(
            "readout.background_dn",
            level,
            true,
            "given with background = \"fixed\"",
        )
    }

    /// First column and row of the window: the one before, or a new one.
    pub(crate) fn corner(&self, camera: &Camera, at: Pixel, before: Option<[i32; 2]>) -> [i32; 2] {
        let half = camera.half_size_px();
        let from_edge = [at.x + half[0], at.y + half[1]];
        let size = self.window.map(|n| n as f64);
        if let Some(before) = before {
            let off = |k: usize| (from_edge[k] - f64::from(before[k]) - 0.5 * size[k]).abs();
            if off(0).max(off(1)) <= 0.5 + self.hysteresis_px {
                return before;
            }
        }
        [0, 1].map(|k| {
            let most = f64::from(camera.pixels()[k]) - size[k];
            corner_of(
                (from_edge[k] - 0.5 * size[k])
                    .round()
                    .clamp(0.0, most.max(0.0)),
            )
        })
    }

    /// The level that is subtracted, DN.
    pub(crate) fn background_dn(&self, window: &[f64]) -> f64 {
        if let (BackgroundLevel::Fixed, Some(level)) = (self.background, self.background_dn) {
            return level;
        }
        let [columns, rows] = self.window;
        let mut border = [0.0; 4 * MOST];
        let mut count = 0;
        for (k, value) in window.iter().enumerate() {
            let (c, r) = (k % columns, k / columns);
            if c == 0 || r == 0 || c == columns - 1 || r == rows - 1 {
                border[count] = *value;
                count += 1;
            }
        }
        let border = &mut border[..count];
        border.sort_by(f64::total_cmp);
        0.5 * (border[(count - 1) / 2] + border[count / 2])
    }

    /// The centroid; none without enough flux, or if it leaves the window.
    pub(crate) fn centroid(&self, window: &[f64], background_dn: f64) -> Option<Centroid> {
        let columns = self.window[0];
        let value = |v: f64| {
            let above = v - background_dn;
            match self.threshold_dn {
                Some(threshold) if above < threshold => 0.0,
                _ => above,
            }
        };
        let (mut flux, mut x, mut y) = (0.0, 0.0, 0.0);
        for (r, row) in window.chunks_exact(columns).enumerate() {
            for (c, v) in row.iter().enumerate() {
                let v = value(*v);
                flux += v;
                x += v * (c as f64 + 0.5);
                y += v * (r as f64 + 0.5);
            }
        }
        if flux < self.least_flux_dn || flux <= 0.0 {
            return None;
        }
        let (mut x, mut y) = (x / flux, y / flux);
        if self.centroid == CentroidForm::Weighted {
            for _ in 0..ROUNDS {
                let [dx, dy] = self.weighted_step(window, x, y, &value)?;
                x += 2.0 * dx;
                y += 2.0 * dy;
            }
        }
        let inside = |p: f64, n: usize| p > 0.0 && p < n as f64;
        (inside(x, columns) && inside(y, self.window[1])).then_some(Centroid { x, y, flux })
    }

    fn weighted_step(
        &self,
        window: &[f64],
        x: f64,
        y: f64,
        value: &impl Fn(f64) -> f64,
    ) -> Option<[f64; 2]> {
        let scale = 0.5 / (self.weight_px * self.weight_px);
        let (mut sum, mut dx, mut dy) = (0.0, 0.0, 0.0);
        for (r, row) in window.chunks_exact(self.window[0]).enumerate() {
            let ry = r as f64 + 0.5 - y;
            for (c, v) in row.iter().enumerate() {
                let rx = c as f64 + 0.5 - x;
                let v = value(*v) * (-scale * (rx * rx + ry * ry)).exp();
                sum += v;
                dx += v * rx;
                dy += v * ry;
            }
        }
        (sum > 0.0).then_some([dx / sum, dy / sum])
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a whole number within the detector"
)]
fn corner_of(px: f64) -> i32 {
    px as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A window of seven about the pixel of the star, kept until the star is 0.7 px from its middle, and then
    /// moved by one pixel: a jump.
    #[test]
    fn windows_move_late_and_by_whole_pixels() {
        let camera = crate::Optics::default().camera().unwrap();
        let readout = Readout::default();
        let at = |x: f64| Pixel { x, y: 0.3 };
        // 512 from the edge: x = 0.5 is the middle of column 512
        let first = readout.corner(&camera, at(0.5), None);
        assert_eq!(first, [509, 509]);
        assert_eq!(readout.corner(&camera, at(1.19), Some(first)), first);
        assert_eq!(readout.corner(&camera, at(1.21), Some(first)), [510, 509]);
        assert_eq!(readout.corner(&camera, at(600.0), None)[0], 1017);
        let even = Readout {
            window: [6, 6],
            ..Readout::default()
        };
        assert_eq!(even.corner(&camera, at(0.1), None), [509, 509]);
    }

    /// The border's median ignores one hot pixel; the threshold cuts below it.
    #[test]
    fn background_and_threshold() {
        let readout = Readout {
            window: [3, 3],
            threshold_dn: Some(5.0),
            ..Readout::default()
        };
        let window = [
            100.0, 900.0, 100.0, 100.0, 400.0, 103.0, 100.0, 100.0, 100.0,
        ];
        let level = readout.background_dn(&window);
        assert!((level - 100.0).abs() < 1e-12);
        let c = readout.centroid(&window, level).unwrap();
        assert!((c.flux - 1100.0).abs() < 1e-9 && (c.x - 1.5).abs() < 1e-12);
        assert!((c.y - (800.0 * 0.5 + 300.0 * 1.5) / 1100.0).abs() < 1e-12);
    }
}
