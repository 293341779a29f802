//! The tables of a bundle in memory: one vector a column, rows in time order.
//!
//! ```text
//! attitude, reference   q: inertial to tracker, v_tracker = q v_inertial
//! rates                 w: rate of the tracker against inertial space, tracker axes, rad/s
//! ```
//!
//! Source: telemetry bundle format (docs/formats/bundle.md); frames and signs as in `focal-plane`.

use std::collections::BTreeMap;

use focal_plane::{AttitudeError, AttitudeSeries, Series};
use nalgebra::{UnitQuaternion, Vector3};

/// A step longer than this many median steps is a gap.
const GAP_STEPS: f64 = 1.9;

/// Median of the steps of a time grid, s.
pub(crate) fn median_step(t_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = t_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if steps.is_empty() {
        return None;
    }
    let middle = steps.len() / 2;
    let (_, &mut median, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    Some(median)
}

/// Table `attitude`: what the tracker itself reports.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AttitudeTable {
    /// Times, s from the bundle's epoch, strictly increasing.
    pub t_s: Vec<f64>,
    /// Attitudes, inertial to tracker.
    pub q: Vec<UnitQuaternion<f64>>,
}

impl AttitudeTable {
    /// Smooth attitude between the samples; rates are taken from neighbours.
    ///
    /// # Errors
    ///
    /// Times or quaternions that were changed after reading and no longer fit.
    pub fn series(&self) -> Result<AttitudeSeries, AttitudeError> {
        AttitudeSeries::new(self.t_s.clone(), self.q.clone(), None)
    }
}

/// Table `reference`: the better estimate, on its own times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferenceTable {
    /// Times, s from the bundle's epoch, strictly increasing.
    pub t_s: Vec<f64>,
    /// Attitudes, inertial to tracker.
    pub q: Vec<UnitQuaternion<f64>>,
    /// Rates, tracker axes, rad/s.
    pub rates_rad_s: Option<Vec<Vector3<f64>>>,
    /// 1-sigma errors about the tracker's axes, arcsec.
    pub sigma_arcsec: Option<Vec<[f64; 3]>>,
}

impl ReferenceTable {
    /// Smooth attitude between the samples, with the table's own rates where it has them.
    ///
    /// # Errors
    ///
    /// Times or quaternions that were changed after reading and no longer fit.
    pub fn series(&self) -> Result<AttitudeSeries, AttitudeError> {
        AttitudeSeries::new(self.t_s.clone(), self.q.clone(), self.rates_rad_s.clone())
    }

    /// The same with its gaps left open: where a step is longer than 1.9 median ones, at least one
    /// sample is missing, and nothing is interpolated across.
    ///
    /// # Errors
    ///
    /// As [`series`](Self::series).
    pub fn series_with_gaps(&self) -> Result<AttitudeSeries, AttitudeError> {
        let series = self.series()?;
        Ok(match median_step(&self.t_s) {
            Some(step_s) => series.with_max_gap_s(GAP_STEPS * step_s),
            None => series,
        })
    }
}

/// Table `rates`: gyro, tracker axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RateTable {
    /// Times, s from the bundle's epoch, strictly increasing.
    pub t_s: Vec<f64>,
    /// Rates, rad/s.
    pub w: Vec<Vector3<f64>>,
}

/// Table `images`: the raw window around each star.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WindowTable {
    /// Times, s from the bundle's epoch; the rows of one frame share one.
    pub t_s: Vec<f64>,
    /// Slot of the tracker, unique in a frame.
    pub slot: Vec<i32>,
    /// Centre of the window's first pixel along x, px.
    pub x0_px: Vec<f64>,
    /// Centre of the window's first pixel along y, px.
    pub y0_px: Vec<f64>,
    /// Background level that the source subtracts, in the unit of the pixels.
    pub background: Vec<f64>,
    /// Pixels, `size[0] * size[1]` for each row of the table, row by row of the window
    /// (index `row * size[0] + column`).
    pub pixels: Vec<f64>,
    /// Columns (along x) and rows (along y) of a window.
    pub size: [usize; 2],
    /// Pixels that are never read out, one for each pixel of a window.
    pub unread: Vec<bool>,
}

impl WindowTable {
    /// Number of windows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there is no window.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// Pixels of one window.
    #[must_use]
    pub fn pixels_per_window(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// The pixels of window `index`, row by row.
    ///
    /// # Panics
    ///
    /// If there is no such window.
    #[must_use]
    pub fn window(&self, index: usize) -> &[f64] {
        let n = self.pixels_per_window();
        &self.pixels[index * n..(index + 1) * n]
    }
}

/// Table `housekeeping`: numeric channels over time.
///
/// Units by the end of the name: temperatures `_c`, `_k`; switches `_on` (0 to 1); velocities
/// `_m_s`, `_km_s`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Housekeeping {
    /// Times, s from the bundle's epoch, strictly increasing.
    pub t_s: Vec<f64>,
    /// Channels by name; NaN is a missing value.
    pub channels: BTreeMap<String, Vec<f64>>,
}

impl Housekeeping {
    /// One channel, linear between its valid samples; `None` if there is no such channel, or if
    /// its columns no longer make a series.
    #[must_use]
    pub fn series(&self, name: &str) -> Option<Series> {
        Series::new(self.t_s.clone(), self.channels.get(name)?.clone()).ok()
    }

    /// All channels that hold at least one value.
    #[must_use]
    pub fn all_series(&self) -> BTreeMap<String, Series> {
        self.channels
            .keys()
            .filter_map(|name| Some((name.clone(), self.series(name)?)))
            .filter(|(_, series)| !series.is_empty())
            .collect()
    }
}
