//! Scenario files: a model, and what happens to the tracker that it describes.
//!
//! A scenario is a model file with the tables `[motion]`, `[sky]` and `[run]`, and optionally
//! `[reference]`, `[rates]` and `[housekeeping]`. Its `[[effect]]` entries are the truth: they act on
//! the simulated measurements. `docs/formats/scenario.md` lists every key with unit and default.
//!
//! Not physics: reading a file.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use telemetry::{Model, TelemetryError};

use crate::{Gyro, Housekeeping, Motion, Reference, Run, ScenarioError, Sky};

/// Tables that a scenario has beside those of a model.
const TABLES: [&str; 6] = ["motion", "sky", "run", "reference", "rates", "housekeeping"];

/// A scenario: everything that a simulated bundle follows from.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// The tracker, its noise, and the effects that act.
    pub model: Model,
    /// `[motion]`
    pub motion: Motion,
    /// `[sky]`
    pub sky: Sky,
    /// `[run]`
    pub run: Run,
    /// `[reference]`; none in the bundle without it.
    pub reference: Option<Reference>,
    /// `[rates]`; none in the bundle without it.
    pub rates: Option<Gyro>,
    /// `[housekeeping]`; none in the bundle without it.
    pub housekeeping: Option<Housekeeping>,
    /// Folder at which relative paths start.
    pub folder: PathBuf,
}

/// The tables of a scenario; those of the model are checked by the model's reader.
#[derive(Deserialize)]
struct Tables {
    motion: Motion,
    #[serde(default)]
    sky: Sky,
    run: Run,
    reference: Option<Reference>,
    rates: Option<Gyro>,
    housekeeping: Option<Housekeeping>,
}

impl Scenario {
    /// Reads a scenario file.
    ///
    /// # Errors
    /// A file that cannot be read, a key that does not exist (with the nearest that does), a missing
    /// key, or a value of the wrong type, with the line.
    pub fn read(path: &Path) -> Result<Self, ScenarioError> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| TelemetryError::Io {
            file: file.clone(),
            what: "read",
            kind: error.kind(),
            reason: error.to_string(),
        })?;
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Self {
            folder,
            ..Self::parse(&text, &file)?
        })
    }

    /// Reads a scenario from text; `file` is its name in messages.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    ///
    /// ```
    /// use scenarios::{Scenario, simulate};
    ///
    /// let text = r#"
    ///     format = "boresight-model/1"
    ///     kind = "pbm"
    ///     [tracker]
    ///     pixels = [1024, 1024]
    ///     fov_deg = [20.0, 20.0]
    ///     max_stars = 14
    ///     [noise]
    ///     temporal_arcsec = 7.43
    ///     centroid_arcsec = 5.06
    ///     distortion_arcsec = 3.1667
    ///     [motion]
    ///     kind = "hold"
    ///     start = { ra_deg = 83.0, dec_deg = -1.0 }
    ///     drift_arcsec_s = [0.0, 0.05, 0.0]
    ///     [run]
    ///     duration_s = 60.0
    ///     rate_hz = 2.0
    /// "#;
    /// let bundle = simulate(&Scenario::parse(text, "hold.toml")?)?;
    /// assert_eq!(bundle.attitude.map(|attitude| attitude.t_s.len()), Some(120));
    /// # Ok::<(), scenarios::ScenarioError>(())
    /// ```
    pub fn parse(text: &str, file: &str) -> Result<Self, ScenarioError> {
        let model = Model::parse(text, file, &TABLES)?;
        let tables: Tables = telemetry::config::deserialise(text, file)?;
        Ok(Self {
            model,
            motion: tables.motion,
            sky: tables.sky,
            run: tables.run,
            reference: tables.reference,
            rates: tables.rates,
            housekeeping: tables.housekeeping,
            folder: PathBuf::new(),
        })
    }

    /// The model without its effects: what somebody who does not know them would declare.
    pub fn model_without_effects(&self) -> Model {
        Model {
            effects: Vec::new(),
            ..self.model.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOLD: &str = r#"format = "boresight-model/1"
kind = "pbm"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
[noise]
temporal_arcsec = 7.43
[motion]
kind = "hold"
drift_arcsec_s = [0.0, 0.05, 0.0]
[sky]
kind = "generated"
[run]
duration_s = 60.0
rate_hz = 2.0
"#;

    fn message(from: &str, to: &str) -> String {
        assert!(HOLD.contains(from), "{from} is in the file");
        Scenario::parse(&HOLD.replacen(from, to, 1), "s.toml")
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn every_table_is_read() {
        let scenario = Scenario::parse(HOLD, "s.toml").unwrap();
        assert!(matches!(scenario.motion, Motion::Hold(_)));
        assert_eq!(scenario.sky, Sky::Generated(crate::GeneratedSky::default()));
        assert!(scenario.reference.is_none() && scenario.housekeeping.is_none());
    }

    #[test]
    fn a_misspelt_key_is_answered_with_line_and_nearest_key() {
        let got = message("drift_arcsec_s", "drift_arcsecs");
        assert!(
            got.contains("line 10") && got.contains("`drift_arcsec_s`"),
            "{got}"
        );
        let got = message("duration_s", "duratoin_s");
        assert!(
            got.contains("line 14") && got.contains("`duration_s`"),
            "{got}"
        );
        let got = message("\"hold\"", "\"hodl\"");
        assert!(got.contains("line 9") && got.contains("`hold`"), "{got}");
        let got = message("[sky]", "[skyy]");
        assert!(got.contains("line 11") && got.contains("sky"), "{got}");
    }

    #[test]
    fn a_missing_table_and_a_wrong_type_are_named() {
        let got = message(
            "[motion]\nkind = \"hold\"\ndrift_arcsec_s = [0.0, 0.05, 0.0]\n",
            "",
        );
        assert!(got.contains("motion"), "{got}");
        let got = message("rate_hz = 2.0", "rate_hz = \"fast\"");
        assert!(got.contains("line 15"), "{got}");
    }
}
