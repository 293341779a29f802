//! A recorded attitude, taken from another bundle.
//!
//! Between samples it is the cubic of `focal_plane::AttitudeSeries`, with the recording's own rates
//! where it has them. What the recording's noise does to the motion is kept: a recording of noisy
//! attitudes shakes.
//!
//! Source: physics conventions, row "attitude between samples".

use std::path::{Path, PathBuf};

use focal_plane::AttitudeSeries;
use serde::Deserialize;
use telemetry::Bundle;

use crate::ScenarioError;

/// `[motion]` with `kind = "recorded"`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recorded {
    /// Folder of the bundle; a relative path starts at the folder of the scenario file.
    pub bundle: PathBuf,
    /// Table to take; default `reference`.
    #[serde(default)]
    pub table: RecordedTable,
    /// Holes longer than this are not bridged, s; default none.
    #[serde(default)]
    pub max_gap_s: Option<f64>,
}

/// Tables that hold an attitude.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordedTable {
    /// The better estimate.
    #[default]
    Reference,
    /// The tracker's own.
    Attitude,
}

impl Recorded {
    pub(super) fn truth(&self, folder: &Path) -> Result<AttitudeSeries, ScenarioError> {
        let path = folder.join(&self.bundle);
        let bundle = Bundle::read(&path)?;
        let series = match self.table {
            RecordedTable::Reference => bundle.reference.map(|table| table.series()),
            RecordedTable::Attitude => bundle.attitude.map(|table| table.series()),
        };
        let table = match self.table {
            RecordedTable::Reference => "reference",
            RecordedTable::Attitude => "attitude",
        };
        let none = || ScenarioError::NoRecording {
            bundle: path.display().to_string(),
            table,
        };
        let series = series.ok_or_else(none)??;
        match self.max_gap_s {
            None => Ok(series),
            Some(gap_s) => {
                ScenarioError::check_positive("motion.max_gap_s", gap_s)?;
                Ok(series.with_max_gap_s(gap_s))
            }
        }
    }
}
