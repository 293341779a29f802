//! A channel that goes up and down smoothly.
//!
//! ```text
//! value = mean + amplitude sin(2 pi t / period + phase) + per_s t
//! ```
//!
//! Source: an assumption of the scenario that uses it.

use focal_plane::Angle;
use serde::Deserialize;

use super::Column;
use crate::ScenarioError;

/// `kind = "sinusoid"`. Numbers are in the channel's own unit.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SinusoidChannel {
    /// Name of the channel; its suffix is the unit.
    pub name: String,
    /// Mean; default 0.
    #[serde(default)]
    pub mean: f64,
    /// Amplitude.
    pub amplitude: f64,
    /// Period, s.
    pub period_s: f64,
    /// Phase of the sine at t = 0, deg; default 0.
    #[serde(default)]
    pub phase_deg: f64,
    /// Trend per second; default 0.
    #[serde(default)]
    pub per_s: f64,
    /// 1 sigma of the measurement; default 0.
    #[serde(default)]
    pub noise: f64,
}

impl SinusoidChannel {
    pub(super) fn columns(&self, t_s: &[f64]) -> Result<Vec<Column>, ScenarioError> {
        ScenarioError::check_finite("housekeeping.channel.mean", self.mean)?;
        ScenarioError::check_finite("housekeeping.channel.amplitude", self.amplitude)?;
        ScenarioError::check_positive("housekeeping.channel.period_s", self.period_s)?;
        ScenarioError::check_finite("housekeeping.channel.phase_deg", self.phase_deg)?;
        ScenarioError::check_finite("housekeeping.channel.per_s", self.per_s)?;
        ScenarioError::check_not_negative("housekeeping.channel.noise", self.noise)?;
        let w = core::f64::consts::TAU / self.period_s;
        let phase = Angle::from_deg(self.phase_deg).rad();
        let at = |t: &f64| self.mean + self.amplitude * (w * t + phase).sin() + self.per_s * t;
        let value = t_s.iter().map(at).collect();
        Ok(vec![Column {
            name: self.name.clone(),
            value,
            noise: self.noise,
        }])
    }
}
