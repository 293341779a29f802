//! The scenarios of the paper as files that a user can print and edit.
//!
//! Each file says which of its numbers the paper prints, and marks every other as an assumption with
//! its reason.
//!
//! Not physics: the files are in `presets` beside the sources.

use crate::{Scenario, ScenarioError};

/// A scenario inside the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// What it is, in one line.
    pub what: &'static str,
    /// The file.
    pub text: &'static str,
}

macro_rules! presets {
    ($($name:literal: $what:literal),* $(,)?) => {
        &[$(Preset {
            name: $name,
            what: $what,
            text: include_str!(concat!("../presets/", $name, ".toml")),
        }),*]
    };
}

/// All presets.
pub const PRESETS: &[Preset] = presets![
    "iht": "PSP Inertial Hold Test, tracker 1, with the printed periods (erratum E10)",
    "iht-distance": "the same with the printed distances (erratum E10)",
    "ict1": "PSP IMU Calibration Test of 17 August 2020, tracker 1",
    "ict2": "PSP IMU Calibration Test of 5 December 2020, tracker 1",
    "pitt": "DART Pre-Impact Terminal Test",
    "image": "IMAGE, spinning, of 21 July 2000 ([A01]): 30 min of quaternions",
    "eo1": "EO-1, nadir pointing, of 23 November 2000 ([A01]): quaternions and gyro",
    "st2-iht": "PSP Inertial Hold Test, tracker 2",
    "st2-iht-distance": "the same with the printed distances (erratum E10)",
    "st2-ict1": "PSP IMU Calibration Test of 17 August 2020, tracker 2",
    "st2-ict2": "PSP IMU Calibration Test of 5 December 2020, tracker 2",
];

/// The preset of that name; `st2` alone is the second tracker in the inertial hold.
///
/// # Errors
/// [`ScenarioError::NoPreset`], with the nearest name.
///
/// ```
/// let iht = scenarios::preset("iht")?;
/// assert!(iht.text.contains("drift_arcsec_s"));
/// assert!(scenarios::preset("ith").unwrap_err().to_string().contains("`iht`"));
/// assert_eq!(scenarios::preset("st2")?.name, "st2-iht");
/// # Ok::<(), scenarios::ScenarioError>(())
/// ```
pub fn preset(name: &str) -> Result<&'static Preset, ScenarioError> {
    let name = if name == "st2" { "st2-iht" } else { name };
    let found = PRESETS.iter().find(|preset| preset.name == name);
    found.ok_or_else(|| {
        let names = PRESETS.iter().map(|preset| preset.name);
        let nearest = names.clone().min_by_key(|n| strsim::levenshtein(name, n));
        ScenarioError::NoPreset {
            name: name.to_owned(),
            nearest: nearest.unwrap_or_default(),
            all: names.collect::<Vec<_>>().join(", "),
        }
    })
}

impl Preset {
    /// The scenario that the file describes.
    ///
    /// # Errors
    /// None with the files that are compiled in: a test reads them all.
    pub fn scenario(&self) -> Result<Scenario, ScenarioError> {
        Scenario::parse(self.text, &format!("preset {}", self.name))
    }
}
