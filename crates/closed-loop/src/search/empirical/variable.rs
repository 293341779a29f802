//! Variables that a leftover may follow, and what they are scaled by.
//!
//! ```text
//! z = (v - middle) / half      -1..1 over the run's rows
//! ```
//!
//! Not physics: names, values and ranges.

use effects::{CHANNEL, StarRows};
use focal_plane::Series;

use super::ORDERS;

/// A variable that a leftover may follow.
#[derive(Clone, Debug)]
pub(crate) enum Variable {
    /// Detector position along one axis (0 = x).
    Position(usize),
    /// The half of the detector along one axis, and the quarter: each may have an output of its own.
    Half(usize),
    Quarter,
    /// Beyond a line across the detector, or on a patch of it.
    Beyond {
        axis: usize,
        at_px: f64,
    },
    Patch {
        from_px: [f64; 2],
        to_px: [f64; 2],
    },
    /// Pixel phase along one axis.
    Phase(usize),
    /// Both, one wave times the other.
    PhaseProduct,
    Time,
    /// The time, of frames that turn to and fro with it: what a slow error of the reference does, too.
    Turning,
    /// Within a stretch of time.
    During {
        from_s: f64,
        to_s: f64,
    },
    /// Before and after an instant.
    Since {
        at_s: f64,
    },
    /// Velocity of the image.
    Rate,
    /// Acceleration of the image.
    Acceleration,
    Magnitude,
    Colour,
    /// Measured flux, logarithm.
    Flux,
    /// Measured flux over the usual one of its star, logarithm.
    Brightening,
    /// The flux of the catalogue's magnitude: charge acts in proportion.
    Brightness,
    /// One constant shift a star.
    Star(Vec<i64>),
    /// One constant shift a slot.
    Slot(Vec<i32>),
    /// Place within the star's window.
    Window,
    /// A housekeeping channel.
    Housekeeping(String, Series),
}

impl Variable {
    /// The name in `unattributed.depends_on`.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Position(0) | Self::Half(0) | Self::Beyond { axis: 0, .. } => "x_px".into(),
            Self::Position(_) | Self::Half(_) | Self::Beyond { .. } => "y_px".into(),
            Self::Quarter | Self::Patch { .. } => "x_px*y_px".into(),
            Self::Phase(0) => "pixel_phase_x".into(),
            Self::Phase(_) => "pixel_phase_y".into(),
            Self::PhaseProduct => "pixel_phase_x*pixel_phase_y".into(),
            Self::Time | Self::Turning | Self::During { .. } | Self::Since { .. } => "time".into(),
            Self::Rate => "rate".into(),
            Self::Acceleration => "acceleration".into(),
            Self::Magnitude => "mag".into(),
            Self::Colour => "colour".into(),
            Self::Flux | Self::Brightening | Self::Brightness => "flux".into(),
            Self::Star(_) => "star".into(),
            Self::Slot(_) => "slot".into(),
            Self::Window => "window".into(),
            Self::Housekeeping(channel, _) => format!("{CHANNEL}{channel}"),
        }
    }
}

/// Middle and half range of a variable: scale it to -1..1. Of a motion the mean of its size where that is steady,
/// and its largest component.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    pub(super) middle: f64,
    pub(super) half: f64,
}

impl Scale {
    pub(crate) fn new(range: [f64; 2]) -> Self {
        Self {
            middle: 0.5 * (range[0] + range[1]),
            half: 0.5 * (range[1] - range[0]),
        }
    }

    /// Whether there is anything to scale.
    pub(super) fn varies(self) -> bool {
        self.half > 0.0
    }

    /// 0 where the value is not known.
    pub(crate) fn of(self, value: f64) -> f64 {
        let z = (value - self.middle) / self.half;
        if z.is_finite() { z } else { 0.0 }
    }
}

impl Variable {
    /// Whether its polynomials are not all one.
    pub(crate) fn is_bent(&self) -> bool {
        orders(self) > 1
    }

    /// The same channel by another series; anything else as it is.
    pub(crate) fn with_series(&self, series: Series) -> Self {
        match self {
            Self::Housekeeping(name, _) => Self::Housekeeping(name.clone(), series),
            other => other.clone(),
        }
    }

    /// Place among the names, for pairs.
    pub(super) fn rank(&self) -> usize {
        match self {
            Self::Position(axis) | Self::Half(axis) | Self::Beyond { axis, .. } => *axis,
            Self::Quarter | Self::Patch { .. } => 0,
            Self::Phase(axis) => 2 + axis,
            Self::PhaseProduct => 2,
            Self::Time | Self::Turning | Self::During { .. } | Self::Since { .. } => 4,
            Self::Rate => 5,
            Self::Acceleration => 6,
            Self::Magnitude => 7,
            Self::Colour => 8,
            Self::Flux | Self::Brightening | Self::Brightness => 9,
            Self::Star(_) => 10,
            Self::Slot(_) => 11,
            Self::Window => 12,
            Self::Housekeeping(..) => 13,
        }
    }

    /// Its value in a row, where that is one number; NaN where it is unknown.
    pub(crate) fn value(&self, rows: &StarRows<'_>, i: usize) -> f64 {
        match self {
            Self::Position(0) => rows.x_px[i],
            Self::Position(_) => rows.y_px[i],
            Self::Time | Self::Turning => rows.t_s[i],
            Self::During { from_s, to_s } => {
                f64::from(u8::from(*from_s < rows.t_s[i] && rows.t_s[i] <= *to_s))
            }
            Self::Since { at_s } => f64::from(u8::from(rows.t_s[i] > *at_s)),
            Self::Magnitude => rows.mag[i],
            Self::Colour => rows.bv[i],
            Self::Flux => rows.log_flux[i],
            Self::Brightening => rows.log_flux_change[i],
            Self::Brightness => flux_of(rows.mag[i]),
            Self::Rate => rows.vx_px_s[i].hypot(rows.vy_px_s[i]),
            Self::Acceleration => rows.ax_px_s2[i].hypot(rows.ay_px_s2[i]),
            Self::Housekeeping(_, series) => series.at(rows.t_s[i]).unwrap_or(f64::NAN),
            Self::Half(axis) => [rows.x_px, rows.y_px][*axis][i].signum(),
            Self::Quarter => (rows.x_px[i] * rows.y_px[i]).signum(),
            Self::Beyond { axis, at_px } => {
                f64::from(u8::from([rows.x_px, rows.y_px][*axis][i] > *at_px))
            }
            Self::Patch { from_px, to_px } => {
                let at = [rows.x_px[i], rows.y_px[i]];
                let within = |axis: usize| from_px[axis] < at[axis] && at[axis] <= to_px[axis];
                f64::from(u8::from(within(0) && within(1)))
            }
            Self::PhaseProduct | Self::Phase(_) | Self::Star(_) | Self::Slot(_) | Self::Window => {
                f64::NAN
            }
        }
    }

    /// Its values in all rows; none where they are not one number.
    pub(crate) fn values(&self, rows: &StarRows<'_>) -> Vec<f64> {
        match self {
            Self::PhaseProduct | Self::Phase(_) | Self::Star(_) | Self::Slot(_) | Self::Window => {
                Vec::new()
            }
            Self::Housekeeping(_, series) => series.at_all(rows.t_s),
            _ => (0..rows.len()).map(|i| self.value(rows, i)).collect(),
        }
    }
}

/// Flux over that of magnitude 5.
pub(crate) fn flux_of(mag: f64) -> f64 {
    10_f64.powf(-0.4 * (mag - 5.0))
}

/// Least and largest of the values that are known.
pub(crate) fn range(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let known = values.into_iter().filter(|v| v.is_finite());
    known.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
        [low.min(v), high.max(v)]
    })
}

/// The range about their mean that holds all values that are known: what a variable adds up to over a run has been
/// calibrated away, and a scale that follows it about another value is a constant one as well, which is not fitted.
pub(crate) fn about_mean(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let known = values.filter(|v| v.is_finite());
    let (count, sum) = known
        .clone()
        .fold((0.0, 0.0), |(n, sum), v| (n + 1.0, sum + v));
    let mean = sum / f64::max(count, 1.0);
    let [low, high] = range(known);
    let half = (high - mean).max(mean - low);
    [mean - half, mean + half]
}

/// Orders that a variable can tell apart: a switch has two values, and all its polynomials are one.
pub(super) fn orders(variable: &Variable) -> usize {
    let Variable::Housekeeping(_, series) = variable else {
        return ORDERS;
    };
    let mut known: Vec<f64> = Vec::new();
    for value in series.value().iter().filter(|v| v.is_finite()) {
        if known.iter().all(|k| k.to_bits() != value.to_bits()) {
            known.push(*value);
        }
        if known.len() > ORDERS {
            break;
        }
    }
    known.len().saturating_sub(1).clamp(1, ORDERS)
}
