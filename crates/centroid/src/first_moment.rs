//! The plain first moment of a window.
//!
//! ```text
//! x = sum v x / sum v,            v = pixel - background
//! sigma_x^2 = [sum (x_i - x)^2 var_i + sigma_b^2 (sum (x_i - x))^2] / (sum v)^2
//! ```
//!
//! It is biased: by sampling and truncation as [`GaussianPsf`](crate::GaussianPsf) tells, by
//! pixels that were not read (the light in them is missing on one side), and by a threshold. The
//! formal error knows of none of these.
//!
//! Source: [M23] section 2.4 (windowing of the star image); linear propagation of pixel noise.

use crate::failure::{self, CentroidFailure};
use crate::window::{CentroidEstimate, Noise, Window};

/// Settings of the first moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstMoment {
    /// Pixels at or below this value above the background are left out; default: none.
    pub threshold: f64,
    /// Least flux in units of its standard deviation; default 3.
    pub min_signal_to_noise: f64,
}

impl Default for FirstMoment {
    fn default() -> Self {
        Self {
            threshold: f64::NEG_INFINITY,
            min_signal_to_noise: 3.0,
        }
    }
}

impl FirstMoment {
    /// First moment of one window.
    ///
    /// # Errors
    ///
    /// A setting out of range or a read pixel that is not finite; fewer than two rows or columns
    /// left; no flux, or too little of it; a centroid off the window.
    ///
    /// # Panics
    ///
    /// If the slices of window, mask and variances do not fit each other.
    ///
    /// ```
    /// use centroid::{FirstMoment, Noise, Window};
    ///
    /// let window = Window {
    ///     values: &[10., 20., 10., 30., 70., 10., 10., 20., 10.],
    ///     columns: 3,
    ///     x0_px: 99.5,
    ///     y0_px: -20.5,
    ///     background: 10.0,
    ///     background_sigma: 0.0,
    ///     unread: None,
    /// };
    /// let noise = Noise::Detector { gain_e: 20.0, read_noise_e: 5.0, pedestal: 0.0 };
    /// let star = FirstMoment::default().estimate(&window, &noise)?;
    /// assert!((star.x_px - (100.5 - 20.0 / 100.0)).abs() < 1e-12);
    /// assert!((star.y_px + 19.5).abs() < 1e-12);
    /// # Ok::<(), centroid::CentroidFailure>(())
    /// ```
    pub fn estimate(
        &self,
        window: &Window<'_>,
        noise: &Noise<'_>,
    ) -> Result<CentroidEstimate, CentroidFailure> {
        window.check(noise)?;
        if self.threshold.is_nan() {
            let (name, value) = ("threshold", self.threshold);
            return Err(CentroidFailure::Setting { name, value });
        }
        failure::not_negative("min_signal_to_noise", self.min_signal_to_noise)?;
        let used = |index: usize| {
            window.read(index) && window.values[index] - window.background > self.threshold
        };

        let mut sums = Sums::default();
        for (row, values) in window.values.chunks_exact(window.columns).enumerate() {
            for (column, &value) in values.iter().enumerate() {
                let index = row * window.columns + column;
                if used(index) {
                    sums.add(row, column, value - window.background);
                }
            }
        }
        if !sums.spans() {
            return Err(CentroidFailure::TooFewPixels {
                pixels: sums.pixels,
            });
        }
        if sums.flux <= 0.0 {
            return Err(CentroidFailure::NoFlux { flux: sums.flux });
        }
        let (x, y) = (sums.x / sums.flux, sums.y / sums.flux);

        let mut noise_sums = NoiseSums::default();
        for (row, values) in window.values.chunks_exact(window.columns).enumerate() {
            for (column, &value) in values.iter().enumerate() {
                let index = row * window.columns + column;
                if used(index) {
                    let variance = noise.variance(index, value);
                    noise_sums.add(column as f64 - x, row as f64 - y, variance);
                }
            }
        }
        noise_sums.add_common(window.background_sigma, f64::from(sums.pixels));
        let estimate = noise_sums.estimate(window, &sums, x, y);
        let signal_to_noise = sums.flux / estimate.sigma_flux;
        if signal_to_noise < self.min_signal_to_noise {
            return Err(CentroidFailure::TooFaint {
                signal_to_noise,
                need: self.min_signal_to_noise,
            });
        }
        if !window.contains(estimate.x_px, estimate.y_px) {
            return Err(CentroidFailure::OutsideWindow {
                x_px: estimate.x_px,
                y_px: estimate.y_px,
            });
        }
        Ok(estimate)
    }
}

/// Sums over the used pixels, positions counted from the first pixel.
#[derive(Default)]
struct Sums {
    flux: f64,
    x: f64,
    y: f64,
    pixels: u32,
    first: Option<(usize, usize)>,
    two_rows: bool,
    two_columns: bool,
}

impl Sums {
    fn add(&mut self, row: usize, column: usize, value: f64) {
        self.flux += value;
        self.x += value * column as f64;
        self.y += value * row as f64;
        self.pixels += 1;
        let (first_row, first_column) = *self.first.get_or_insert((row, column));
        self.two_rows |= row != first_row;
        self.two_columns |= column != first_column;
    }

    fn spans(&self) -> bool {
        self.two_rows && self.two_columns
    }
}

/// Sums of the noise about the centroid.
#[derive(Default)]
struct NoiseSums {
    flux: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    dx: f64,
    dy: f64,
}

impl NoiseSums {
    fn add(&mut self, dx: f64, dy: f64, variance: f64) {
        self.flux += variance;
        self.xx += dx * dx * variance;
        self.xy += dx * dy * variance;
        self.yy += dy * dy * variance;
        self.dx += dx;
        self.dy += dy;
    }

    /// The error of the background level moves all pixels together.
    fn add_common(&mut self, sigma: f64, pixels: f64) {
        let variance = sigma * sigma;
        self.flux += variance * pixels * pixels;
        self.xx += variance * self.dx * self.dx;
        self.xy += variance * self.dx * self.dy;
        self.yy += variance * self.dy * self.dy;
    }

    fn estimate(&self, window: &Window<'_>, sums: &Sums, x: f64, y: f64) -> CentroidEstimate {
        let (sigma_x, sigma_y) = (self.xx.sqrt(), self.yy.sqrt());
        let product = sigma_x * sigma_y;
        CentroidEstimate {
            x_px: window.x0_px + x,
            y_px: window.y0_px + y,
            sigma_x_px: sigma_x / sums.flux,
            sigma_y_px: sigma_y / sums.flux,
            correlation: if product > 0.0 {
                self.xy / product
            } else {
                0.0
            },
            flux: sums.flux,
            sigma_flux: self.flux.sqrt(),
            pixels: sums.pixels,
            iterations: 0,
        }
    }
}
