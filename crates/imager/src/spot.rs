//! The image of a star at rest: a Gaussian integrated over pixels, with a flare if the optics have coma.
//!
//! ```text
//! share of pixel (c, r) = g_c g_r,   g_c = [erf((c + 1 - x)/(s sqrt 2)) - erf((c - x)/(s sqrt 2))] / 2
//! spot = (1 - w) G(x - w d, s) + w G(x + (1 - w) d, 1.5 s)
//! ```
//!
//! x, y in pixels from the first edge of the window; d is the displacement of the flare from the core, w
//! its share of the light. The shares of an infinite window sum to 1, and their first moment is x: where
//! the light is on average is what a calibration has measured.
//!
//! Source: integral of a normal density over a pixel; coma as a displaced wider component (Welford,
//! Aberrations of Optical Systems, 1986, ch. 8: a flare along the radius that grows with the field).

use core::f64::consts::FRAC_1_SQRT_2;

/// Width of the flare over that of the core.
const FLARE_WIDTH: f64 = 1.5;

/// Largest window, pixels on an axis.
pub(crate) const MOST: usize = 64;

/// The spot of one star.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Standard deviation, px.
    pub sigma_px: f64,
    /// Share of the light in the flare.
    pub flare: f64,
    /// Displacement of the flare from the core along x and y, px.
    pub flare_px: [f64; 2],
}

impl Spot {
    /// A plain Gaussian.
    #[must_use]
    pub fn gaussian(sigma_px: f64) -> Self {
        Self {
            sigma_px,
            flare: 0.0,
            flare_px: [0.0; 2],
        }
    }

    /// Adds `light` times the shares of one row of pixels: the row spans `y` from `row` to `row + 1`;
    /// `at` is the place of the spot from the first edge of the window, px.
    ///
    /// # Panics
    ///
    /// If the row is longer than 64 pixels.
    pub fn add_row(&self, at: [f64; 2], row: usize, light: f64, out: &mut [f64]) {
        self.for_components(at, light, |at, sigma, light| {
            let mut along_y = [0.0; 2];
            edges(at[1] - row as f64, sigma, &mut along_y);
            let mut along_x = [0.0; MOST + 1];
            let along_x = &mut along_x[..=out.len()];
            edges(at[0], sigma, along_x);
            let light = light * (along_y[1] - along_y[0]);
            for (c, out) in out.iter_mut().enumerate() {
                *out += light * (along_x[c + 1] - along_x[c]);
            }
        });
    }

    /// Adds `light` times the shares of a whole window of `columns`, row by row.
    ///
    /// # Panics
    ///
    /// If the window is longer than 64 pixels on an axis.
    pub fn add_window(&self, at: [f64; 2], columns: usize, light: f64, out: &mut [f64]) {
        self.for_components(at, light, |at, sigma, light| {
            let (mut along_x, mut along_y) = ([0.0; MOST + 1], [0.0; MOST + 1]);
            let along_x = &mut along_x[..=columns];
            let along_y = &mut along_y[..=out.len() / columns];
            edges(at[0], sigma, along_x);
            edges(at[1], sigma, along_y);
            for (row, out) in out.chunks_exact_mut(columns).enumerate() {
                let light = light * (along_y[row + 1] - along_y[row]);
                for (c, out) in out.iter_mut().enumerate() {
                    *out += light * (along_x[c + 1] - along_x[c]);
                }
            }
        });
    }

    fn for_components(&self, at: [f64; 2], light: f64, mut add: impl FnMut([f64; 2], f64, f64)) {
        let moved = |part: f64| {
            [
                at[0] + part * self.flare_px[0],
                at[1] + part * self.flare_px[1],
            ]
        };
        add(
            moved(-self.flare),
            self.sigma_px,
            light * (1.0 - self.flare),
        );
        if self.flare > 0.0 {
            let sigma_px = FLARE_WIDTH * self.sigma_px;
            add(moved(1.0 - self.flare), sigma_px, light * self.flare);
        }
    }
}

/// The normal distribution about `at` with `sigma`, at the edges 0, 1, ...
fn edges(at: f64, sigma: f64, out: &mut [f64]) {
    let scale = FRAC_1_SQRT_2 / sigma;
    for (k, out) in out.iter_mut().enumerate() {
        *out = 0.5 * libm::erf((k as f64 - at) * scale);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All light is there, its first moment is the place, its second that of the Gaussian plus 1/12 of
    /// the pixel (both exact up to aliasing, exp(-2 pi^2 s^2) = 3e-6 at s = 0.8, and the cut at 8 s).
    #[test]
    fn moments_of_the_spot() {
        let (n, at, sigma) = (21_usize, [10.3, 10.9], 0.8);
        let mut window = vec![0.0; n * n];
        Spot::gaussian(sigma).add_window(at, n, 2.0, &mut window);
        let sum: f64 = window.iter().sum();
        let moment = |power: i32, from: f64| -> f64 {
            let one = |(k, w): (usize, &f64)| w * ((k % n) as f64 + 0.5 - from).powi(power);
            window.iter().enumerate().map(one).sum::<f64>() / sum
        };
        assert!((sum - 2.0).abs() < 1e-12);
        assert!((moment(1, 0.0) - at[0]).abs() < 1e-6);
        assert!((moment(2, at[0]) - sigma * sigma - 1.0 / 12.0).abs() < 1e-4);
    }

    /// Rows one by one are the window; a flare leaves the first moment and skews the spot: third moment
    /// of two Gaussians `w (1 - w) d ((1 - 2 w) d^2 + 3 (s_f^2 - s^2))`, to aliasing (1e-6) and the cut
    /// of the window at 9 s.
    #[test]
    fn rows_make_the_window_and_a_flare_skews() {
        let (n, at) = (25_usize, [12.4, 12.1]);
        let spot = Spot {
            sigma_px: 0.9,
            flare: 0.2,
            flare_px: [0.5, -0.25],
        };
        let (mut whole, mut rows) = (vec![0.0; n * n], vec![0.0; n * n]);
        spot.add_window(at, n, 1.0, &mut whole);
        for (r, row) in rows.chunks_exact_mut(n).enumerate() {
            spot.add_row(at, r, 1.0, row);
        }
        assert!(whole.iter().zip(&rows).all(|(a, b)| (a - b).abs() < 1e-15));
        let moment = |power: i32| -> f64 {
            let one = |(k, w): (usize, &f64)| w * ((k % n) as f64 + 0.5 - at[0]).powi(power);
            whole.iter().enumerate().map(one).sum()
        };
        let (w, d, s) = (0.2, 0.5, 0.9_f64);
        let skew = w * (1.0 - w) * d * ((1.0 - 2.0 * w) * d * d + 3.0 * s * s * 1.25);
        assert!(moment(1).abs() < 1e-6, "{}", moment(1));
        assert!((moment(3) - skew).abs() < 1e-4, "{} {skew}", moment(3));
    }
}
