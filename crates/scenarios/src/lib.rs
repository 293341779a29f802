//! Motions and skies: bundles simulated from a scenario.
//!
//! A [`Scenario`] is a model file with `[motion]`, `[sky]` and `[run]`; [`simulate`] makes the bundle
//! that a tracker of that model, with the effects of the scenario acting in it, would have sent.
#![forbid(unsafe_code)]

mod course;
mod declared;
mod error;
mod housekeeping;
mod located;
mod motion;
mod preset;
mod reference;
mod run;
mod scenario;
mod simulate;
mod sky;

pub use course::Course;
pub use declared::{Declared, effect_parameters, hybrid_processes};
pub use error::ScenarioError;
pub use housekeeping::{Channel, Housekeeping, OrbitVelocity, SinusoidChannel, Thermostat};
pub use located::effect_error;
pub use motion::{
    ClosedLoop, Hold, Motion, PhasePlane, Pointing, Recorded, RecordedTable, Rotator, Sinusoid,
    Slew, Slews,
};
pub use preset::{PRESETS, Preset, preset};
pub use reference::{Gyro, Reference};
pub use run::{Reported, Run};
pub use scenario::Scenario;
pub use simulate::{Simulated, simulate, simulate_with_truth};
pub use sky::{GeneratedSky, HipparcosSky, Sky, hipparcos};
