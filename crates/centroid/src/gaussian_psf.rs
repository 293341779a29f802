//! The S-curve: what a first moment makes of a Gaussian spot in a small window.
//!
//! A spot of standard deviation sigma, d from the middle of a window of n x n pixels, puts the
//! share `Phi(e_(i+1)) - Phi(e_i)` into column i, with the edges `e_i = (i - n/2 - d)/sigma`. The
//! rows are independent of it and cancel. Summed by parts,
//!
//! ```text
//! c(d) = S1/S0 - d,   S0 = Phi(e_n) - Phi(e_0)
//! S1 = (n - 1)/2 [Phi(e_n) + Phi(e_0)] - sum_(i=1)^(n-1) Phi(e_i)
//! ```
//!
//! The window is centred on the star's pixel for odd n, on the nearest pixel corner for even n, so
//! d is within half a pixel. Two errors are in it: sampling (a small spot is pulled to the middle
//! of its pixel; as sigma goes to 0, c = -d) and truncation (a wide spot is cut by the window
//! and drawn to the window's middle). The triangle idealises this curve.
//!
//! Source: [M23] section 2.4 (cause of the triangle); integration of a Gaussian over pixels.

use crate::failure::{self, CentroidFailure};
use crate::phase;

/// First-moment error of a Gaussian spot in an n x n window; in px until [`scaled`](Self::scaled).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussianPsf {
    sigma_px: f64,
    window: u32,
    scale: [f64; 2],
}

impl GaussianPsf {
    /// A spot of standard deviation `sigma_px` in windows of `window` x `window` pixels.
    ///
    /// # Errors
    ///
    /// If `sigma_px` is not finite and positive, or the window has no pixel.
    ///
    /// ```
    /// use centroid::GaussianPsf;
    ///
    /// // a small spot stays at the pixel's middle; 0.5 px in 5 x 5 pixels is almost free of error
    /// let small = GaussianPsf::new(0.05, 5)?.error_px(0.25);
    /// let usual = GaussianPsf::new(0.5, 5)?.error_px(0.25);
    /// assert!((small + 0.25).abs() < 1e-6);
    /// assert!(usual.abs() < 0.003);
    /// # Ok::<(), centroid::CentroidFailure>(())
    /// ```
    pub fn new(sigma_px: f64, window: u32) -> Result<Self, CentroidFailure> {
        failure::positive("sigma_px", sigma_px)?;
        failure::positive("window", f64::from(window))?;
        Ok(Self {
            sigma_px,
            window,
            scale: [1.0; 2],
        })
    }

    /// Standard deviation of the spot, px.
    pub fn sigma_px(&self) -> f64 {
        self.sigma_px
    }

    /// Side of the window, px.
    pub fn window(&self) -> u32 {
        self.window
    }

    /// Both axes in another unit: the factor is what one px is in it.
    #[must_use]
    pub fn scaled(&self, factor: [f64; 2]) -> Self {
        Self {
            scale: [self.scale[0] * factor[0], self.scale[1] * factor[1]],
            ..*self
        }
    }

    /// Error of a star `offset_px` from the middle of the window, px (measured minus true).
    ///
    /// The offset is meant to be within half a pixel; off the window the flux in it vanishes, and
    /// with it the meaning of the ratio (NaN in the end).
    pub fn error_px(&self, offset_px: f64) -> f64 {
        let half = 0.5 * f64::from(self.window);
        // erf instead of Phi: the constant halves cancel in S1 and S0 alike
        let edge = |position: f64| {
            libm::erf((position - offset_px) / self.sigma_px * std::f64::consts::FRAC_1_SQRT_2)
        };
        let (first, last) = (edge(-half), edge(half));
        let inner: f64 = (1..self.window).map(|i| edge(f64::from(i) - half)).sum();
        ((half - 0.5) * (last + first) - inner) / (last - first) - offset_px
    }

    /// Error of one axis (0: x, 1: y) at a phase in turns (0 at a pixel edge), scaled.
    pub(crate) fn value(&self, axis: usize, turns: f64) -> f64 {
        let middle = if self.window % 2 == 1 { 0.5 } else { 0.0 };
        self.scale[axis] * self.error_px(phase::from_nearest(turns - middle))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::normal;

    /// The sum by parts against the plain sum; both add up to n terms of size n/2.
    #[test]
    fn closed_form_equals_direct_sum() -> Result<(), CentroidFailure> {
        for window in 1..=9_u32 {
            for sigma in [0.05, 0.3, 0.5, 1.0, 3.0] {
                let psf = GaussianPsf::new(sigma, window)?;
                for i in -10..=10 {
                    let offset = f64::from(i) * 0.05;
                    let (mut s0, mut s1) = (0.0, 0.0);
                    for pixel in 0..window {
                        let left = f64::from(pixel) - 0.5 * f64::from(window);
                        let share =
                            normal::mass((left - offset) / sigma, (left + 1.0 - offset) / sigma);
                        s0 += share;
                        s1 += share * (left + 0.5);
                    }
                    let direct = s1 / s0 - offset;
                    let got = psf.error_px(offset);
                    assert!((got - direct).abs() < 1e-13, "{window} {sigma} {offset}");
                }
            }
        }
        Ok(())
    }

    /// Without truncation, Poisson's sum gives
    /// `sum_k (-1)^k/(pi k) exp(-2 (pi k sigma)^2) sin(2 pi k d)`.
    /// A window of 21 px leaves less than erfc(10/0.8/sqrt 2) = 1e-35 outside.
    #[test]
    fn wide_window_follows_poissons_sum() -> Result<(), CentroidFailure> {
        for sigma in [0.2, 0.5, 0.8] {
            let psf = GaussianPsf::new(sigma, 21)?;
            for i in -9..=9 {
                let d = f64::from(i) * 0.05;
                let series: f64 = (1..40)
                    .map(|k| {
                        let k = f64::from(k);
                        (PI * k).cos() / (PI * k)
                            * (-2.0 * (PI * k * sigma).powi(2)).exp()
                            * (2.0 * PI * k * d).sin()
                    })
                    .sum();
                assert!((psf.error_px(d) - series).abs() < 1e-13, "{sigma} {d}");
            }
        }
        Ok(())
    }

    #[test]
    fn bad_settings_are_refused() {
        assert!(GaussianPsf::new(0.0, 3).is_err());
        assert!(GaussianPsf::new(f64::NAN, 3).is_err());
        assert!(GaussianPsf::new(0.5, 0).is_err());
    }
}
