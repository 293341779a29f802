//! What can be wrong with an instrument, or with a run of it.

use focal_plane::{CameraError, CatalogueError};
use telemetry::TelemetryError;
use telemetry::config::Config;

/// Errors of this crate.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum ImagerError {
    /// A world file that cannot be read, or a bundle that cannot be written.
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
    /// A temperature that nothing has.
    #[error("{name} names the thermal node `{node}`, which [thermal] does not have")]
    NoNode {
        /// The key that names it.
        name: &'static str,
        /// The node.
        node: String,
    },
    /// A node that needs a temperature and names none.
    #[error("{name} needs a thermal node")]
    NeedsNode {
        /// The key that needs it.
        name: &'static str,
    },
    /// Two of one name.
    #[error("{what} `{name}` is given twice")]
    Repeated {
        /// What there are two of.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A star that the catalogue does not have.
    #[error("{name} = {id} is in no catalogue")]
    NoStar {
        /// The key.
        name: &'static str,
        /// The star.
        id: i64,
    },
    /// An effect by name.
    #[error(
        "effect `{id}` is a formula: what acts at pixel level is a setting of the instrument, in a world file"
    )]
    Formula {
        /// Its id.
        id: String,
    },
    /// A hybrid empirical model.
    #[error("a model of kind \"hem\" has no detector that could be rendered")]
    NoDetector,
    /// The frame itself cannot be described.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The stars seen make no catalogue.
    #[error(transparent)]
    Catalogue(#[from] CatalogueError),
    /// The motion holds no frame, or no star was in the field.
    #[error(
        "no star was seen in {frames} frames (limiting magnitude, field, or span of the motion)"
    )]
    NothingSeen {
        /// Frames asked for.
        frames: u64,
    },
}

impl ImagerError {
    /// The same with the file, and the line where one is to blame; `text` is the world or scenario,
    /// `file` its name. What has a place already keeps it.
    #[must_use]
    pub fn in_file(self, text: &str, file: &str) -> Self {
        let (name, value) = match &self {
            Self::File(_) => return self,
            Self::OutOfRange { name, value, .. } => (*name, Some(*value)),
            Self::NoNode { name, .. } | Self::NeedsNode { name } => (*name, None),
            Self::NoStar { name, id } => (*name, Some(*id as f64)),
            Self::Formula { .. } => ("effect.id", None),
            Self::NoDetector => ("kind", None),
            Self::Camera(_) => ("optics", None),
            _ => ("", None),
        };
        // "reference.cant_axis (length)"
        let path = name.split(' ').next().unwrap_or("");
        Config::blame(text, file, path, value, self.to_string()).into()
    }

    pub(crate) fn check(
        name: &'static str,
        value: f64,
        fine: bool,
        expected: &'static str,
    ) -> Result<(), Self> {
        if fine && value.is_finite() {
            Ok(())
        } else {
            Err(Self::OutOfRange {
                name,
                value,
                expected,
            })
        }
    }

    pub(crate) fn positive(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check(name, value, value > 0.0, "finite and positive")
    }

    pub(crate) fn not_negative(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check(name, value, value >= 0.0, "finite and not negative")
    }

    pub(crate) fn finite(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check(name, value, true, "finite")
    }
}
