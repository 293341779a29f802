//! Simulated bundles in which no effect of the tracker acts, to an analyst who is wrong about the noise.
//!
//! The tracker is the one of the papers: distortion, a triangle of pixel phase and temporal noise, all
//! declared. What differs is the declared sigma of the temporal noise, and the reference.
//!
//! Not physics: settings.

use imager::{Acting, Truth};
use scenarios::Scenario;

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

/// The simulated nulls: hold and slews of each case. Where the reference wanders, `reference_error` acts.
///
/// # Errors
///
/// None, unless the settings are wrong.
pub fn nulls() -> Result<Vec<Trial>, BlindError> {
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
