//! What can be wrong with a scenario.

use distortion::DistortionError;
use effects::EffectError;
use focal_plane::{AttitudeError, CameraError, CatalogueError, SeriesError};
use fogm_fit::FogmError;
use star_tracker::TrackerError;
use telemetry::TelemetryError;

/// Errors of this crate.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum ScenarioError {
    /// A scenario file that cannot be read, or a bundle that it names.
    #[error(transparent)]
    File(#[from] TelemetryError),
    /// A number outside its range.
    #[error("{name} = {value} must be {expected}")]
    OutOfRange {
        /// The key.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range in words.
        expected: &'static str,
    },
    /// A key that a simulation needs and a model may leave out.
    #[error("a scenario needs {name}")]
    Missing {
        /// The key.
        name: &'static str,
    },
    /// Star positions are asked of a model that does not describe centroids.
    #[error("a model of kind \"hem\" makes no star positions: leave \"stars\" out of run.tables")]
    NoCentroids,
    /// A preset that does not exist.
    #[error("no preset `{name}`; the nearest that exists is `{nearest}` (all: {all})")]
    NoPreset {
        /// Asked for.
        name: String,
        /// Nearest name.
        nearest: &'static str,
        /// All names.
        all: String,
    },
    /// The hybrid model.
    #[error(transparent)]
    Fogm(#[from] FogmError),
    /// Two channels of one name.
    #[error("housekeeping channel `{name}` is given twice")]
    RepeatedChannel {
        /// The channel.
        name: String,
    },
    /// The recording holds no attitude of that kind.
    #[error("{bundle} has no table `{table}`")]
    NoRecording {
        /// The bundle.
        bundle: String,
        /// The table.
        table: &'static str,
    },
    /// Nothing came out: no frame has a star.
    #[error(
        "no star was seen in {frames} frames (limiting magnitude, field, or span of the recording)"
    )]
    NothingSeen {
        /// Number of frames.
        frames: usize,
    },
    /// An effect of the scenario.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// The tracker.
    #[error(transparent)]
    Tracker(#[from] TrackerError),
    /// The camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The distortion.
    #[error(transparent)]
    Distortion(#[from] DistortionError),
    /// An attitude.
    #[error(transparent)]
    Attitude(#[from] AttitudeError),
    /// A channel.
    #[error(transparent)]
    Series(#[from] SeriesError),
    /// The sky.
    #[error(transparent)]
    Catalogue(#[from] CatalogueError),
}

impl ScenarioError {
    pub(crate) fn check(
        name: &'static str,
        value: f64,
        fits: bool,
        expected: &'static str,
    ) -> Result<(), Self> {
        if fits {
            Ok(())
        } else {
            Err(Self::OutOfRange {
                name,
                value,
                expected,
            })
        }
    }

    pub(crate) fn check_finite(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check(name, value, value.is_finite(), "finite")
    }

    pub(crate) fn check_positive(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check(
            name,
            value,
            value.is_finite() && value > 0.0,
            "finite and positive",
        )
    }

    pub(crate) fn check_not_negative(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check(
            name,
            value,
            value.is_finite() && value >= 0.0,
            "finite and not negative",
        )
    }
}
