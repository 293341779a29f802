//! How long, how often, and with which random numbers: `[run]`.
//!
//! Not physics: settings.

use serde::Deserialize;
use telemetry::{Epoch, ModelKind, TimeScale};

use crate::ScenarioError;

/// `[run]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Title of the bundle; default none.
    #[serde(default)]
    pub title: Option<String>,
    /// Length, s; frames are at 0, 1/rate, ... before it. May be left out where a recording gives it.
    #[serde(default)]
    pub duration_s: Option<f64>,
    /// Frames per second; default `update_rate_hz` of `[tracker]`.
    #[serde(default)]
    pub rate_hz: Option<f64>,
    /// Seed of all random numbers; default 1.
    #[serde(default = "one")]
    pub seed: u64,
    /// Which of the draws of that seed; default 0.
    #[serde(default)]
    pub draw: u64,
    /// Date at t = 0 (`"2020-08-17T00:00:00"`): stars are where their proper motion has taken them.
    /// Default none: stars are where they were at J2000.0.
    #[serde(default, deserialize_with = "epoch")]
    pub epoch: Option<Epoch>,
    /// Time scale of the epoch: `"UTC"`, `"TAI"`, `"TT"`, `"TDB"`, `"GPS"`.
    #[serde(default, deserialize_with = "time_scale")]
    pub time_scale: Option<TimeScale>,
    /// The motion is known this long before the first and after the last frame, s, for exposures and
    /// time tags that reach beyond; default 5.
    #[serde(default = "five")]
    pub margin_s: f64,
    /// Step of the reported positions, px: they are rounded to its multiples. Default 0, no rounding.
    #[serde(default)]
    pub position_step_px: f64,
    /// Tables of what the tracker reports; default `["stars", "attitude", "catalog"]`, and
    /// `["attitude"]` of a model of kind `"hem"`, which has no centroids.
    #[serde(default)]
    pub tables: Option<Vec<Reported>>,
}

/// Tables of what the tracker reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reported {
    /// Centroids.
    Stars,
    /// The solved attitude.
    Attitude,
    /// Directions, magnitudes and colours of the stars seen.
    Catalog,
}

fn one() -> u64 {
    1
}

fn five() -> f64 {
    5.0
}

fn epoch<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Option<Epoch>, D::Error> {
    let text = String::deserialize(from)?;
    let wrong = || {
        serde::de::Error::custom(format!(
            "expected a date as 2020-08-17T00:00:00, found {text}"
        ))
    };
    Epoch::parse(&text).map(Some).ok_or_else(wrong)
}

fn time_scale<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Option<TimeScale>, D::Error> {
    let text = String::deserialize(from)?;
    let known = TimeScale::NAMES.iter().find(|(name, _)| *name == text);
    let wrong =
        || serde::de::Error::custom(format!("expected UTC, TAI, TT, TDB or GPS, found {text}"));
    known.map(|(_, scale)| Some(*scale)).ok_or_else(wrong)
}

impl Run {
    /// Whether a table is asked for, of a model of this kind.
    pub fn reports(&self, table: Reported, kind: ModelKind) -> bool {
        match (&self.tables, kind) {
            (Some(tables), _) => tables.contains(&table),
            (None, ModelKind::Pbm) => true,
            (None, ModelKind::Hem) => table == Reported::Attitude,
        }
    }

    pub(crate) fn check(&self, kind: ModelKind) -> Result<(), ScenarioError> {
        if let Some(duration_s) = self.duration_s {
            ScenarioError::check_positive("run.duration_s", duration_s)?;
        }
        if let Some(rate_hz) = self.rate_hz {
            ScenarioError::check_positive("run.rate_hz", rate_hz)?;
        }
        ScenarioError::check_not_negative("run.margin_s", self.margin_s)?;
        ScenarioError::check_not_negative("run.position_step_px", self.position_step_px)?;
        let stars = self.reports(Reported::Stars, kind);
        if stars && kind == ModelKind::Hem {
            return Err(ScenarioError::NoCentroids);
        }
        if !stars && !self.reports(Reported::Attitude, kind) {
            return Err(ScenarioError::Missing {
                name: "\"stars\" or \"attitude\" in run.tables",
            });
        }
        Ok(())
    }
}
