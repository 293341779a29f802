//! Gaussian-weighted centroid: the place where the weighted first moment vanishes.
//!
//! ```text
//! g(c) = sum w (x - c) e = 0,    w = exp(-|x - c|^2 / 2 s^2),    c <- c + 2 g / sum w v
//! ```
//!
//! e is the pixel above the background, v. The weight keeps noise and cuts off at the window's edge
//! out. Spot times weight is a Gaussian of half the variance, centred halfway between the two, so
//! the plain weighted moment goes only half the way: the factor 2 makes up for it, and a spot as
//! wide as the weight is reached in about one step. A spot much narrower than the weight would
//! overshoot for ever; a step that turns back halves the factor.
//!
//! What bias is left comes from pixels that are missing (unread, off the window) and from sampling:
//! a pixel-phase wave of peak `8 pi v exp(-2 pi^2 v)` px with v half the spot's variance (1/12 of the
//! pixel included), 2e-3 px at 0.9 px. With the width of the spot known (`psf_sigma_px`) both go: e is then
//! `v - F m(c)`, where m is the spot integrated over pixels and F its flux from
//! `sum w (v - F m) = 0`. Model and data meet only where pixels were read.
//!
//! The formal error propagates pixel noise and background level through the equations solved,
//! `A^-1 B A^-T` with A their derivatives and B the variance of their sums.
//!
//! Source: adaptive weighted moments of Bernstein & Jarvis, Astron. J. 123 (2002) 583, section 3;
//! Huber's sandwich, Proc. 5th Berkeley Symp. 1 (1967) 221.

use crate::MAX_WINDOW_SIDE;
use crate::failure::{self, CentroidFailure};
use crate::normal;
use crate::window::{CentroidEstimate, Noise, Window};

/// Settings of the Gaussian-weighted centroid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussianWeighted {
    /// Standard deviation of the weight, px; best equal to that of the spot.
    pub sigma_px: f64,
    /// Standard deviation of the spot, px, where known: removes the bias of missing pixels and of
    /// sampling, and makes the flux that of the whole spot.
    pub psf_sigma_px: Option<f64>,
    /// Where to start, centred px; `None` for the brightest pixel.
    pub start_px: Option<[f64; 2]>,
    /// A step this small ends the iteration, px.
    pub tolerance_px: f64,
    /// Iterations before giving up.
    pub max_iterations: u32,
    /// Least weighted flux in units of its standard deviation.
    pub min_signal_to_noise: f64,
}

impl GaussianWeighted {
    /// A weight of `sigma_px` with the usual limits: steps to 1e-9 px, 100 iterations, signal to
    /// noise 3, no knowledge of the spot.
    pub fn new(sigma_px: f64) -> Self {
        Self {
            sigma_px,
            psf_sigma_px: None,
            start_px: None,
            tolerance_px: 1e-9,
            max_iterations: 100,
            min_signal_to_noise: 3.0,
        }
    }

    /// A weight matched to a spot of known width, whose missing pixels and sampling are made up
    /// for.
    pub fn matched(psf_sigma_px: f64) -> Self {
        Self {
            psf_sigma_px: Some(psf_sigma_px),
            ..Self::new(psf_sigma_px)
        }
    }

    /// Gaussian-weighted centroid of one window.
    ///
    /// The flux is the sum of the pixels above the background, or, with `psf_sigma_px`, that of the
    /// whole spot.
    ///
    /// # Errors
    ///
    /// A setting out of range, a window beyond [`MAX_WINDOW_SIDE`], a read pixel that is not
    /// finite; fewer than two rows or columns; no weighted flux, or too little of it; a position
    /// that leaves the window, does not settle, or is no maximum.
    ///
    /// # Panics
    ///
    /// If the slices of window, mask and variances do not fit each other.
    ///
    /// ```
    /// use centroid::{GaussianWeighted, Noise, Window, pixel_gaussian_into};
    /// use focal_plane::Pixel;
    ///
    /// let mut values = [0.0; 25];
    /// let (first, at) = (Pixel { x: 0.5, y: 0.5 }, Pixel { x: 2.7, y: 2.4 });
    /// pixel_gaussian_into(first, 5, at, 0.6, 5000.0, &mut values)?;
    /// let mut unread = [false; 25];
    /// unread[6] = true; // beside the spot
    /// let window = Window {
    ///     values: &values,
    ///     columns: 5,
    ///     x0_px: first.x,
    ///     y0_px: first.y,
    ///     background: 0.0,
    ///     background_sigma: 0.0,
    ///     unread: Some(&unread),
    /// };
    /// let noise = Noise::Detector { gain_e: 1.0, read_noise_e: 10.0, pedestal: 0.0 };
    /// let star = GaussianWeighted::matched(0.6).estimate(&window, &noise)?;
    /// assert!((star.x_px - 2.7).abs() < 1e-8 && (star.y_px - 2.4).abs() < 1e-8);
    /// assert!((star.flux - 5000.0).abs() < 1e-4);
    /// # Ok::<(), centroid::CentroidFailure>(())
    /// ```
    pub fn estimate(
        &self,
        window: &Window<'_>,
        noise: &Noise<'_>,
    ) -> Result<CentroidEstimate, CentroidFailure> {
        self.check()?;
        window.check(noise)?;
        let side = window.columns.max(window.rows());
        if side > MAX_WINDOW_SIDE {
            return Err(CentroidFailure::WindowTooLarge {
                side,
                limit: MAX_WINDOW_SIDE,
            });
        }
        let (brightest, pixels) = survey(window)?;
        let [x_px, y_px] = self.start_px.unwrap_or([
            window.x0_px + (brightest % window.columns) as f64,
            window.y0_px + (brightest / window.columns) as f64,
        ]);
        let start = [x_px - window.x0_px, y_px - window.y0_px];
        let (at, iterations) = self.settle(window, start)?;
        self.with_errors(window, noise, at, pixels, iterations)
    }

    fn check(&self) -> Result<(), CentroidFailure> {
        failure::positive("sigma_px", self.sigma_px)?;
        if let Some(sigma) = self.psf_sigma_px {
            failure::positive("psf_sigma_px", sigma)?;
        }
        failure::positive("tolerance_px", self.tolerance_px)?;
        failure::not_negative("min_signal_to_noise", self.min_signal_to_noise)?;
        for value in self.start_px.into_iter().flatten() {
            if !value.is_finite() {
                let name = "start_px";
                return Err(CentroidFailure::Setting { name, value });
            }
        }
        Ok(())
    }

    /// Repeats the step until it is small; positions count from the first pixel.
    fn settle(
        &self,
        window: &Window<'_>,
        start: [f64; 2],
    ) -> Result<([f64; 2], u32), CentroidFailure> {
        let mut at = start;
        let mut factor = 2.0;
        let mut last = [0.0; 2];
        let mut step_px = f64::INFINITY;
        for iteration in 1..=self.max_iterations {
            let sums = self.sums(window, at);
            if sums.flux <= 0.0 {
                return Err(CentroidFailure::NoFlux { flux: sums.flux });
            }
            let step = [
                factor * sums.moment[0] / sums.flux,
                factor * sums.moment[1] / sums.flux,
            ];
            if step[0] * last[0] + step[1] * last[1] < 0.0 {
                factor = (0.5 * factor).max(0.125);
            }
            if !(step[0].is_finite() && step[1].is_finite()) {
                return Err(CentroidFailure::NotDetermined);
            }
            at = [at[0] + step[0], at[1] + step[1]];
            last = step;
            step_px = step[0].hypot(step[1]);
            let (x_px, y_px) = (window.x0_px + at[0], window.y0_px + at[1]);
            if !window.contains(x_px, y_px) {
                return Err(CentroidFailure::OutsideWindow { x_px, y_px });
            }
            if step_px <= self.tolerance_px {
                return Ok((at, iteration));
            }
        }
        Err(CentroidFailure::NotConverged {
            iterations: self.max_iterations,
            step_px,
        })
    }

    /// The equations at one place.
    fn sums(&self, window: &Window<'_>, at: [f64; 2]) -> Equations {
        let [columns, rows] = self.profiles(window, at);
        let mut flux = 0.0;
        let mut moment = [0.0; 2];
        let mut model_flux = 0.0;
        let mut model_moment = [0.0; 2];
        for (row, values) in window.values.chunks_exact(window.columns).enumerate() {
            for (column, value) in values.iter().enumerate() {
                if !window.read(row * window.columns + column) {
                    continue;
                }
                let weight = columns.weight[column] * rows.weight[row];
                let v = weight * (value - window.background);
                flux += v;
                moment[0] += v * columns.offset[column];
                moment[1] += v * rows.offset[row];
                let m = weight * columns.spot[column] * rows.spot[row];
                model_flux += m;
                model_moment[0] += m * columns.offset[column];
                model_moment[1] += m * rows.offset[row];
            }
        }
        if self.psf_sigma_px.is_none() {
            return Equations {
                flux,
                moment,
                spot_flux: 0.0,
            };
        }
        let spot_flux = flux / model_flux;
        Equations {
            flux,
            moment: [
                moment[0] - spot_flux * model_moment[0],
                moment[1] - spot_flux * model_moment[1],
            ],
            spot_flux,
        }
    }

    /// Offset, weight and spot along each axis.
    fn profiles(&self, window: &Window<'_>, at: [f64; 2]) -> [Profile; 2] {
        [
            Profile::new(window.columns, at[0], self.sigma_px, self.psf_sigma_px),
            Profile::new(window.rows(), at[1], self.sigma_px, self.psf_sigma_px),
        ]
    }

    /// Formal errors at the solution.
    fn with_errors(
        &self,
        window: &Window<'_>,
        noise: &Noise<'_>,
        at: [f64; 2],
        pixels: u32,
        iterations: u32,
    ) -> Result<CentroidEstimate, CentroidFailure> {
        let [columns, rows] = self.profiles(window, at);
        let spot_flux = self.sums(window, at).spot_flux;
        let modelled = self.psf_sigma_px.is_some();
        let per_variance = 1.0 / (self.sigma_px * self.sigma_px);
        let mut slope = [[0.0; 3]; 3];
        let mut spread = [[0.0; 3]; 3];
        let mut common = [0.0; 3];
        let (mut sum, mut sum_variance, mut weighted, mut weighted_variance) = (0.0, 0.0, 0.0, 0.0);
        for (index, &value) in window.values.iter().enumerate() {
            if !window.read(index) {
                continue;
            }
            let (row, column) = (index / window.columns, index % window.columns);
            let weight = columns.weight[column] * rows.weight[row];
            let v = value - window.background;
            let variance = noise.variance(index, value);
            let d = [columns.offset[column], rows.offset[row], 1.0];
            let spot = spot_flux * columns.spot[column] * rows.spot[row];
            let spot_slope = [
                spot_flux * columns.spot_slope[column] * rows.spot[row],
                spot_flux * columns.spot[column] * rows.spot_slope[row],
                spot,
            ];
            let e = v - spot;
            for p in 0..3 {
                common[p] += weight * d[p];
                for q in 0..3 {
                    spread[p][q] += weight * weight * d[p] * d[q] * variance;
                    // minus the derivative with respect to x, y and the logarithm of the flux
                    let mut s = spot_slope[q] * d[p];
                    if q < 2 {
                        s -= e * d[p] * d[q] * per_variance;
                        if p == q {
                            s += e;
                        }
                    }
                    slope[p][q] += weight * s;
                }
            }
            sum += v;
            sum_variance += variance;
            weighted += weight * v;
            weighted_variance += weight * weight * variance;
        }
        let background = window.background_sigma * window.background_sigma;
        for p in 0..3 {
            for q in 0..3 {
                spread[p][q] += background * common[p] * common[q];
            }
        }
        weighted_variance += background * common[2] * common[2];
        let signal_to_noise = weighted / weighted_variance.sqrt();
        if signal_to_noise < self.min_signal_to_noise {
            return Err(CentroidFailure::TooFaint {
                signal_to_noise,
                need: self.min_signal_to_noise,
            });
        }
        if !modelled {
            // no third unknown: leave it alone
            slope[2] = [0.0, 0.0, weighted];
            slope[0][2] = 0.0;
            slope[1][2] = 0.0;
        }
        let covariance = sandwich(&slope, &spread).ok_or(CentroidFailure::NotDetermined)?;
        let (sigma_x, sigma_y) = (covariance[0][0].sqrt(), covariance[1][1].sqrt());
        let product = sigma_x * sigma_y;
        let n = f64::from(pixels);
        let (flux, sigma_flux) = if modelled {
            (spot_flux, spot_flux * covariance[2][2].sqrt())
        } else {
            (sum, (sum_variance + background * n * n).sqrt())
        };
        Ok(CentroidEstimate {
            x_px: window.x0_px + at[0],
            y_px: window.y0_px + at[1],
            sigma_x_px: sigma_x,
            sigma_y_px: sigma_y,
            correlation: if product > 0.0 {
                covariance[0][1] / product
            } else {
                0.0
            },
            flux,
            sigma_flux,
            pixels,
            iterations,
        })
    }
}

/// Weighted flux, remaining moment and flux of the spot at one place.
struct Equations {
    flux: f64,
    moment: [f64; 2],
    spot_flux: f64,
}

/// What one axis contributes to each pixel.
struct Profile {
    offset: [f64; MAX_WINDOW_SIDE],
    weight: [f64; MAX_WINDOW_SIDE],
    spot: [f64; MAX_WINDOW_SIDE],
    spot_slope: [f64; MAX_WINDOW_SIDE],
}

impl Profile {
    fn new(pixels: usize, at: f64, sigma: f64, psf_sigma: Option<f64>) -> Self {
        let mut profile = Self {
            offset: [0.0; MAX_WINDOW_SIDE],
            weight: [0.0; MAX_WINDOW_SIDE],
            spot: [0.0; MAX_WINDOW_SIDE],
            spot_slope: [0.0; MAX_WINDOW_SIDE],
        };
        for i in 0..pixels {
            let offset = i as f64 - at;
            profile.offset[i] = offset;
            profile.weight[i] = (-0.5 * (offset / sigma).powi(2)).exp();
            if let Some(psf) = psf_sigma {
                let (left, right) = ((offset - 0.5) / psf, (offset + 0.5) / psf);
                profile.spot[i] = normal::mass(left, right);
                profile.spot_slope[i] = (normal::density(left) - normal::density(right)) / psf;
            }
        }
        profile
    }
}

/// Brightest read pixel and the number of read pixels.
fn survey(window: &Window<'_>) -> Result<(usize, u32), CentroidFailure> {
    let mut brightest: Option<usize> = None;
    let mut pixels = 0;
    let (mut two_rows, mut two_columns) = (false, false);
    for index in 0..window.values.len() {
        if !window.read(index) {
            continue;
        }
        pixels += 1;
        let best = *brightest.get_or_insert(index);
        two_rows |= best / window.columns != index / window.columns;
        two_columns |= best % window.columns != index % window.columns;
        if window.values[index] > window.values[best] {
            brightest = Some(index);
        }
    }
    match brightest {
        Some(index) if two_rows && two_columns => Ok((index, pixels)),
        _ => Err(CentroidFailure::TooFewPixels { pixels }),
    }
}

/// `A^-1 B A^-T`, or `None` if A does not belong to a maximum that is determined.
fn sandwich(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let largest = a.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
    let upper = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    let cofactor = |p: usize, q: usize| {
        let (r, s) = ((p + 1) % 3, (p + 2) % 3);
        let (t, u) = ((q + 1) % 3, (q + 2) % 3);
        a[r][t] * a[s][u] - a[r][u] * a[s][t]
    };
    let determinant: f64 = (0..3).map(|q| a[0][q] * cofactor(0, q)).sum();
    let fixed = a[0][0] > 0.0
        && a[1][1] > 0.0
        && upper > 0.0
        && determinant > 1e-12 * largest * largest * largest;
    if !fixed {
        return None;
    }
    let mut inverse = [[0.0; 3]; 3];
    for p in 0..3 {
        for q in 0..3 {
            inverse[p][q] = cofactor(q, p) / determinant;
        }
    }
    let mut covariance = [[0.0; 3]; 3];
    for p in 0..3 {
        for q in 0..3 {
            for r in 0..3 {
                for s in 0..3 {
                    covariance[p][q] += inverse[p][r] * b[r][s] * inverse[q][s];
                }
            }
        }
    }
    Some(covariance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sandwich_of_a_known_matrix() {
        let a = [[2.0, 0.0, 1.0], [0.0, 4.0, 0.0], [0.0, 0.0, 1.0]];
        let b = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        // inverse of a: [[1/2, 0, -1/2], [0, 1/4, 0], [0, 0, 1]]
        let got = sandwich(&a, &b);
        let expected = [[0.5, 0.0, -0.5], [0.0, 0.0625, 0.0], [-0.5, 0.0, 1.0]];
        assert_eq!(got, Some(expected));
        let saddle = [[2.0, 0.0, 0.0], [0.0, -4.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(sandwich(&saddle, &b), None);
    }
}
