//! Why a bundle cannot be compared.

use effects::EffectError;
use focal_plane::{AttitudeError, CameraError};
use fogm_fit::FogmError;
use scenarios::ScenarioError;
use spectra::SpectraError;
use star_tracker::TrackerError;

/// Why no comparison came out.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ComparisonError {
    /// The bundle lacks what a residual needs.
    #[error("{0}")]
    NothingToCompare(&'static str),
    /// Too few frames of a residual are left.
    #[error(
        "{frames} frames with a residual, at least {need} needed ({outside_reference} lie outside the reference, {unsolved} have too few stars)"
    )]
    TooFewFrames {
        /// Frames left.
        frames: usize,
        /// Frames needed.
        need: usize,
        /// Frames that the reference does not cover.
        outside_reference: usize,
        /// Frames whose stars do not fix an attitude.
        unsolved: usize,
    },
    /// A star without a direction.
    #[error("star {id} of table `stars` is not in table `catalog`")]
    UnknownStar {
        /// Its id.
        id: i64,
    },
    /// The reference is no series of attitudes.
    #[error("table `reference`: {0}")]
    Reference(#[from] AttitudeError),
    /// No spectrum of an axis.
    #[error("spectrum of the residual about {axis}: {source}")]
    Spectrum {
        /// The axis.
        axis: &'static str,
        /// Why.
        source: SpectraError,
    },
    /// Too few draws for a standard deviation.
    #[error("{got} draws asked for, at least 8 needed")]
    TooFewDraws {
        /// Draws asked for.
        got: u64,
    },
    /// A model without any error.
    #[error(
        "{model} declares no noise, distortion or effect that shows in an attitude: its draws are all alike"
    )]
    NoNoise {
        /// Its name.
        model: String,
    },
    /// Numbers of the model that make no camera.
    #[error("model: {0}")]
    Camera(#[from] CameraError),
    /// Made-up stars that the model's field has no room for.
    #[error("model: {0}")]
    Tracker(#[from] TrackerError),
    /// A model that cannot be flown.
    #[error("model: {0}")]
    Scenario(#[from] ScenarioError),
    /// An effect that cannot be built.
    #[error("model: {0}")]
    Effect(#[from] EffectError),
    /// Numbers of a hybrid model outside their range.
    #[error("model: {0}")]
    Hybrid(#[from] FogmError),
    /// No spectrum of a draw.
    #[error("spectrum of a draw: {0}")]
    Draw(#[from] SpectraError),
    /// A residual that does not vary.
    #[error(
        "the residual about {axis} does not vary (standard deviation {std_arcsec:.0e} arcsec, which is rounding): there is no noise to speak of; is the reference a copy of the attitude?"
    )]
    NoScatter {
        /// The axis.
        axis: &'static str,
        /// Its standard deviation, arcsec.
        std_arcsec: f64,
    },
    /// No fit of an axis.
    #[error("fit of the residual about {axis}: {source}")]
    Fit {
        /// The axis.
        axis: &'static str,
        /// Why.
        source: FogmError,
    },
}

/// A scatter below which a residual holds rounding only: products of unit quaternions are good to some
/// 1e-10 arcsec.
const ROUNDING_ARCSEC: f64 = 1e-7;

impl ComparisonError {
    /// Refuses a residual of rounding.
    pub(crate) fn check_scatter(axis: &'static str, std_arcsec: f64) -> Result<(), Self> {
        // NaN has no scatter either
        if std_arcsec >= ROUNDING_ARCSEC {
            Ok(())
        } else {
            Err(Self::NoScatter { axis, std_arcsec })
        }
    }
}
