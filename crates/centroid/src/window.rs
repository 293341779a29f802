//! A window of pixels around a star, its noise, and what is measured in it.
//!
//! ```text
//! variance of a pixel = max(v - pedestal, 0)/gain + (read noise/gain)^2
//! ```
//!
//! in squared units of the window (DN), the gain in electrons per unit: photon noise taken from
//! the pixel itself, and read noise.
//!
//! Source: photon transfer, Janesick, Scientific Charge-Coupled Devices (2001), section 2.2.

use crate::failure::{self, CentroidFailure};

/// One window of raw pixels.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a> {
    /// Pixel values, row by row: along x within a row, the rows along y.
    pub values: &'a [f64],
    /// Pixels in a row.
    pub columns: usize,
    /// Centre of the first pixel, x, centred px.
    pub x0_px: f64,
    /// Centre of the first pixel, y, centred px.
    pub y0_px: f64,
    /// Background to be taken off each pixel, units of `values`.
    pub background: f64,
    /// Standard deviation of the background level, common to all pixels, units of `values`; zero
    /// where it is known.
    pub background_sigma: f64,
    /// `true` for pixels never read out; they are left out whatever they hold.
    pub unread: Option<&'a [bool]>,
}

/// Noise of single pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise<'a> {
    /// Photon and read noise of a detector.
    Detector {
        /// Electrons per unit of the window.
        gain_e: f64,
        /// Read noise of a pixel, electrons RMS.
        read_noise_e: f64,
        /// Value of a pixel that received nothing, units of the window.
        pedestal: f64,
    },
    /// Variance of each pixel, squared units of the window, in the order of its values.
    Variance(&'a [f64]),
}

/// A centroid with its formal error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CentroidEstimate {
    /// Position, centred px.
    pub x_px: f64,
    /// Position, centred px.
    pub y_px: f64,
    /// Formal standard deviation of `x_px`: pixel noise and background level only.
    pub sigma_x_px: f64,
    /// Formal standard deviation of `y_px`.
    pub sigma_y_px: f64,
    /// Correlation of the errors of x and y.
    pub correlation: f64,
    /// Flux above the background, units of the window.
    pub flux: f64,
    /// Formal standard deviation of the flux.
    pub sigma_flux: f64,
    /// Pixels used.
    pub pixels: u32,
    /// Iterations spent; 0 for a closed form.
    pub iterations: u32,
}

impl Window<'_> {
    /// Rows of the window.
    pub fn rows(&self) -> usize {
        self.values.len() / self.columns
    }

    /// Whether pixel `index` was read.
    pub(crate) fn read(&self, index: usize) -> bool {
        self.unread.is_none_or(|unread| !unread[index])
    }

    /// Checks what would otherwise turn into a silent number.
    pub(crate) fn check(&self, noise: &Noise<'_>) -> Result<(), CentroidFailure> {
        assert!(
            self.columns > 0 && self.values.len().is_multiple_of(self.columns),
            "{} pixels are no whole number of rows of {}",
            self.values.len(),
            self.columns
        );
        if let Some(unread) = self.unread {
            assert_eq!(unread.len(), self.values.len(), "pixels and mask");
        }
        for (name, value) in [
            ("x0_px", self.x0_px),
            ("y0_px", self.y0_px),
            ("background", self.background),
        ] {
            if !value.is_finite() {
                return Err(CentroidFailure::Setting { name, value });
            }
        }
        failure::not_negative("background_sigma", self.background_sigma)?;
        match *noise {
            Noise::Detector {
                gain_e,
                read_noise_e,
                pedestal,
            } => {
                failure::positive("gain_e", gain_e)?;
                failure::not_negative("read_noise_e", read_noise_e)?;
                if !pedestal.is_finite() {
                    let (name, value) = ("pedestal", pedestal);
                    return Err(CentroidFailure::Setting { name, value });
                }
            }
            Noise::Variance(variance) => {
                assert_eq!(variance.len(), self.values.len(), "pixels and variances");
                for (index, &value) in variance.iter().enumerate() {
                    if self.read(index) {
                        failure::not_negative("variance", value)?;
                    }
                }
            }
        }
        match (0..self.values.len()).find(|&i| self.read(i) && !self.values[i].is_finite()) {
            None => Ok(()),
            Some(index) => Err(CentroidFailure::Pixel {
                row: index / self.columns,
                column: index % self.columns,
                value: self.values[index],
            }),
        }
    }

    /// Whether a position lies on the window's pixels.
    pub(crate) fn contains(&self, x_px: f64, y_px: f64) -> bool {
        let (x, y) = (x_px - self.x0_px, y_px - self.y0_px);
        x >= -0.5 && y >= -0.5 && x <= self.columns as f64 - 0.5 && y <= self.rows() as f64 - 0.5
    }
}

impl Noise<'_> {
    /// Variance of pixel `index` holding `value`.
    pub(crate) fn variance(&self, index: usize, value: f64) -> f64 {
        match *self {
            Self::Detector {
                gain_e,
                read_noise_e,
                pedestal,
            } => (value - pedestal).max(0.0) / gain_e + (read_noise_e / gain_e).powi(2),
            Self::Variance(variance) => variance[index],
        }
    }
}
