//! Simulated bundles of a tracker whose own errors are all declared.
//!
//! The tracker is the one of the papers: distortion, a triangle of pixel phase and temporal noise. Where nothing
//! else acts the analyst is wrong about the noise, or the reference errs; or one effect acts that a distortion
//! imitates, so that only what is declared of that one tells them apart.
//!
//! Not physics: settings.

use imager::{Acting, Truth};
use scenarios::Scenario;
use telemetry::{EffectEntry, EffectValue};

use crate::BlindError;
use crate::trial::{Made, Trial};

const TRACKER: &str = r#"
format = "boresight-model/1"
kind = "pbm"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
update_rate_hz = 2.0
max_stars = 12
exposure_s = 0.1
[noise]
temporal_arcsec = 7.43
centroid_arcsec = 5.06
distortion_arcsec = 3.1667
distortion_order = 7
[sky]
kind = "hipparcos"
limiting_mag = 6.5
[housekeeping]
rate_hz = 0.1
[[housekeeping.channel]]
kind = "thermostat"
name = "bracket_c"
low = 19.4
high = 20.6
settles_on = 24.0
settles_off = 17.0
tau_s = 200.0
noise = 0.02
switch = "heater_on"
"#;

const HOLD: &str = r#"
[motion]
kind = "hold"
start = { ra_deg = 75.0, dec_deg = 12.0, roll_deg = 20.0 }
drift_arcsec_s = [0.32, -0.26, 0.02]
closed_loop = { sigma_arcsec = [0.5, 0.5, 0.5], frequency_hz = 0.036 }
[run]
duration_s = 600.0
seed = 501
epoch = "2020-12-05T00:00:00"
"#;

const SLEWS: &str = r#"
[motion]
kind = "slews"
start = { ra_deg = 75.0, dec_deg = 12.0, roll_deg = 20.0 }
drift_arcsec_s = [1.5, -2.5, 0.5]
wait_s = 20.0
slew = [
  { axis = [1.0, 0.0, 0.0], angle_deg = 1.3, duration_s = 30.0, hold_s = 15.0 },
  { axis = [1.0, 0.0, 0.0], angle_deg = -1.3, duration_s = 30.0, hold_s = 15.0 },
  { axis = [0.0, 1.0, 0.0], angle_deg = 1.3, duration_s = 30.0, hold_s = 15.0 },
  { axis = [0.0, 1.0, 0.0], angle_deg = -1.3, duration_s = 30.0, hold_s = 15.0 },
]
[run]
duration_s = 300.0
seed = 502
epoch = "2020-12-05T00:00:00"
"#;

const SCAN: &str = r#"
[motion]
kind = "hold"
start = { ra_deg = 75.0, dec_deg = 12.0, roll_deg = 20.0 }
drift_arcsec_s = [130.0, 90.0, 20.0]
[run]
duration_s = 300.0
seed = 503
epoch = "2020-12-05T00:00:00"
"#;

const PERFECT: &str = "[reference]\n";
const WHITE: &str = "[reference]\nwhite_arcsec = [0.5, 0.5, 0.5]\n";
const WANDER: &str =
    "[reference]\nwander_arcsec = [0.5, 0.5, 0.5]\nwander_tau_s = [60.0, 60.0, 60.0]\n";

/// What the analyst is told, declared over true sigma of the temporal noise, reference, whether it wanders.
const CASES: [(&str, f64, &str, bool); 5] = [
    ("as_declared", 1.0, PERFECT, false),
    ("declared_noise_low", 0.8, PERFECT, false),
    ("declared_noise_high", 1.2, PERFECT, false),
    ("reference_white", 1.0, WHITE, false),
    ("reference_wanders", 1.0, WANDER, true),
];

/// What a distortion imitates: the name of a motion, its text, and the effect. Each is some six to ten standard
/// errors, most of which the declared distortion makes.
const IMITATED: [(&str, &str, &str); 6] = [
    ("hold", HOLD, DISTORTED),
    ("hold", HOLD, COLOURED),
    ("hold", HOLD, MISPLACED),
    ("slews", SLEWS, DISTORTED),
    ("slews", SLEWS, COLOURED),
    ("scan", SCAN, SHUTTER),
];
const DISTORTED: &str = "id = \"optical_distortion\"\nk1 = 9e-3";
const COLOURED: &str = "id = \"chromatic_shift\"\nppm_per_mag = 50.0";
const MISPLACED: &str =
    "id = \"catalogue_position\"\nstar_id = \"21421\"\neast_arcsec = 2.8\nnorth_arcsec = -2.2";
const SHUTTER: &str = "id = \"rolling_shutter\"\nline_time_s = 1.5e-4";

/// The simulated bundles: those in which no effect of the tracker acts, and one effect each beside the declared distortion.
///
/// # Errors
///
/// None, unless the settings are wrong.
pub fn simulated() -> Result<Vec<Trial>, BlindError> {
    let mut trials = nulls()?;
    for (motion, text, effect) in IMITATED {
        let text = format!("{TRACKER}[[effect]]\n{effect}\n{PERFECT}{text}");
        let scenario = Scenario::parse(&text, motion)?;
        let acting: Vec<Acting> = scenario.model.effects.iter().map(acting).collect();
        let name = format!("distorted_{motion}_{}", acting[0].id);
        trials.push(Trial {
            name,
            truth: Truth {
                effect: acting,
                ..Truth::default()
            },
            model: scenario.model_without_effects(),
            made: Made::Model(Box::new(scenario)),
        });
    }
    Ok(trials)
}

/// A declared effect as what acts: numbers are sizes, words say on what.
fn acting(entry: &EffectEntry) -> Acting {
    let mut acting = Acting {
        id: entry.id.clone(),
        ..Acting::default()
    };
    for (name, value) in &entry.parameters {
        match value {
            EffectValue::Number(number) => {
                acting.values.insert(name.clone(), *number);
            }
            EffectValue::Text(text) => {
                acting.selectors.insert(name.clone(), text.clone());
            }
            EffectValue::Numbers(_) => {}
        }
    }
    acting
}

/// The simulated nulls: hold and slews of each case. Where the reference wanders, `reference_error` acts.
///
/// # Errors
///
/// None, unless the settings are wrong.
pub(crate) fn nulls() -> Result<Vec<Trial>, BlindError> {
    let mut trials = Vec::new();
    for (motion, text) in [("hold", HOLD), ("slews", SLEWS)] {
        for (case, declared, reference, wanders) in CASES {
            let name = format!("model_{motion}_{case}");
            let scenario = Scenario::parse(&format!("{TRACKER}{reference}{text}"), &name)?;
            let mut model = scenario.model_without_effects();
            if let Some(sigma) = &mut model.noise.temporal_arcsec {
                *sigma *= declared;
            }
            let wander = Acting {
                id: "reference_error".to_owned(),
                ..Acting::default()
            };
            trials.push(Trial {
                name,
                truth: Truth {
                    effect: if wanders { vec![wander] } else { Vec::new() },
                    ..Truth::default()
                },
                model,
                made: Made::Model(Box::new(scenario)),
            });
        }
    }
    Ok(trials)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What acts beside a declared distortion is known to the bundle, and to nobody who closes the loop on it.
    #[test]
    fn what_acts_beside_a_distortion_is_not_declared() {
        let trials = simulated().unwrap();
        let distorted = trials.iter().filter(|t| t.name.starts_with("distorted_"));
        let mut seen = 0;
        for trial in distorted {
            let Made::Model(scenario) = &trial.made else {
                panic!("{} is rendered", trial.name)
            };
            assert_eq!(scenario.model.effects.len(), 1, "{}", trial.name);
            assert!(!trial.truth.effect[0].values.is_empty(), "{}", trial.name);
            assert!(trial.model.effects.is_empty(), "{}", trial.name);
            assert!(
                trial.model.noise.distortion_arcsec.is_some(),
                "{}",
                trial.name
            );
            seen += 1;
        }
        assert_eq!(seen, IMITATED.len());
    }
}
