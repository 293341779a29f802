//! Many windows of one size at once.
//!
//! ```text
//! pixel (row, column) of window i:  values[(i rows + row) columns + column]
//! ```
//!
//! Nothing is allocated. A window that has no centroid gets NaN in every output and its reason in
//! `failure`: it is never left out, so that rows keep their places.
//!
//! Source: bookkeeping only; the estimators cite theirs.

use crate::failure::CentroidFailure;
use crate::first_moment::FirstMoment;
use crate::gaussian_weighted::GaussianWeighted;
use crate::window::{CentroidEstimate, Noise, Window};

/// Windows of equal size, one after the other.
#[derive(Clone, Copy, Debug)]
pub struct WindowBatch<'a> {
    /// Pixels of all windows, each row by row.
    pub values: &'a [f64],
    /// Columns of a window.
    pub columns: usize,
    /// Rows of a window.
    pub rows: usize,
    /// Centre of each window's first pixel, x, centred px.
    pub x0_px: &'a [f64],
    /// Centre of each window's first pixel, y, centred px.
    pub y0_px: &'a [f64],
    /// Background of each window, units of `values`.
    pub background: &'a [f64],
    /// Standard deviation of the background level, all windows, units of `values`.
    pub background_sigma: f64,
    /// Pixels never read out, in one window: the same in all.
    pub unread: Option<&'a [bool]>,
}

/// Where a batch of centroids goes; all slices as long as there are windows.
#[derive(Debug)]
pub struct EstimatesMut<'a> {
    /// Positions, centred px.
    pub x_px: &'a mut [f64],
    /// Positions, centred px.
    pub y_px: &'a mut [f64],
    /// Formal standard deviations of `x_px`.
    pub sigma_x_px: &'a mut [f64],
    /// Formal standard deviations of `y_px`.
    pub sigma_y_px: &'a mut [f64],
    /// Fluxes above the background.
    pub flux: &'a mut [f64],
    /// Why a window has no centroid.
    pub failure: &'a mut [Option<CentroidFailure>],
}

impl FirstMoment {
    /// First moments of all windows; returns how many have none.
    ///
    /// [`Noise::Variance`] holds the variances of all windows in the order of `values`.
    ///
    /// # Panics
    ///
    /// If the slices do not fit each other.
    ///
    /// ```
    /// use centroid::{EstimatesMut, FirstMoment, Noise, WindowBatch};
    ///
    /// let windows = WindowBatch {
    ///     values: &[0., 9., 9., 0., 0., 0., 0., 0.], // the second one is dark
    ///     columns: 2,
    ///     rows: 2,
    ///     x0_px: &[10.5, 20.5],
    ///     y0_px: &[0.5, 0.5],
    ///     background: &[0.0, 0.0],
    ///     background_sigma: 0.0,
    ///     unread: None,
    /// };
    /// let noise = Noise::Detector { gain_e: 10.0, read_noise_e: 0.0, pedestal: 0.0 };
    /// let [mut x, mut y, mut sx, mut sy, mut flux] = [[0.0; 2]; 5];
    /// let mut failure = [None; 2];
    /// let out = EstimatesMut {
    ///     x_px: &mut x,
    ///     y_px: &mut y,
    ///     sigma_x_px: &mut sx,
    ///     sigma_y_px: &mut sy,
    ///     flux: &mut flux,
    ///     failure: &mut failure,
    /// };
    /// assert_eq!(FirstMoment::default().estimate_into(&windows, &noise, out), 1);
    /// assert_eq!((x[0], y[0], flux[0]), (11.0, 1.0, 18.0));
    /// assert!(x[1].is_nan() && failure[1].is_some());
    /// ```
    pub fn estimate_into(
        &self,
        windows: &WindowBatch<'_>,
        noise: &Noise<'_>,
        out: EstimatesMut<'_>,
    ) -> usize {
        windows.each(noise, out, |window, noise| self.estimate(window, noise))
    }
}

impl GaussianWeighted {
    /// Gaussian-weighted centroids of all windows; returns how many have none.
    ///
    /// [`Noise::Variance`] holds the variances of all windows in the order of `values`. A
    /// `start_px` holds for all windows; leave it `None` unless they share their place.
    ///
    /// # Panics
    ///
    /// If the slices do not fit each other.
    pub fn estimate_into(
        &self,
        windows: &WindowBatch<'_>,
        noise: &Noise<'_>,
        out: EstimatesMut<'_>,
    ) -> usize {
        windows.each(noise, out, |window, noise| self.estimate(window, noise))
    }
}

impl WindowBatch<'_> {
    /// Number of windows.
    pub fn len(&self) -> usize {
        self.x0_px.len()
    }

    /// Whether there is no window.
    pub fn is_empty(&self) -> bool {
        self.x0_px.is_empty()
    }

    fn each(
        &self,
        noise: &Noise<'_>,
        out: EstimatesMut<'_>,
        estimate: impl Fn(&Window<'_>, &Noise<'_>) -> Result<CentroidEstimate, CentroidFailure>,
    ) -> usize {
        let (n, pixels) = (self.len(), self.columns * self.rows);
        assert_eq!(self.values.len(), n * pixels, "pixels of {n} windows");
        assert_eq!(self.y0_px.len(), n, "x0 and y0");
        assert_eq!(self.background.len(), n, "windows and backgrounds");
        for (name, length) in [
            ("x", out.x_px.len()),
            ("y", out.y_px.len()),
            ("sigma x", out.sigma_x_px.len()),
            ("sigma y", out.sigma_y_px.len()),
            ("flux", out.flux.len()),
            ("failure", out.failure.len()),
        ] {
            assert_eq!(length, n, "windows and {name}");
        }
        if let Noise::Variance(variance) = noise {
            assert_eq!(variance.len(), self.values.len(), "pixels and variances");
        }

        let mut failures = 0;
        for i in 0..n {
            let range = i * pixels..(i + 1) * pixels;
            let window = Window {
                values: &self.values[range.clone()],
                columns: self.columns,
                x0_px: self.x0_px[i],
                y0_px: self.y0_px[i],
                background: self.background[i],
                background_sigma: self.background_sigma,
                unread: self.unread,
            };
            let noise = match *noise {
                Noise::Variance(variance) => Noise::Variance(&variance[range]),
                detector @ Noise::Detector { .. } => detector,
            };
            let row = match estimate(&window, &noise) {
                Ok(star) => {
                    out.failure[i] = None;
                    [
                        star.x_px,
                        star.y_px,
                        star.sigma_x_px,
                        star.sigma_y_px,
                        star.flux,
                    ]
                }
                Err(failure) => {
                    out.failure[i] = Some(failure);
                    failures += 1;
                    [f64::NAN; 5]
                }
            };
            [
                out.x_px[i],
                out.y_px[i],
                out.sigma_x_px[i],
                out.sigma_y_px[i],
                out.flux[i],
            ] = row;
        }
        failures
    }
}
