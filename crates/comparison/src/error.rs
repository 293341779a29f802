//! Why a bundle cannot be compared.

use effects::EffectError;
use focal_plane::{AttitudeError, CameraError};
use fogm_fit::FogmError;
use scenarios::ScenarioError;
use spectra::SpectraError;
use star_tracker::TrackerError;
use telemetry::{Model, TelemetryError};

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
    /// Draws that have no attitude in next to all frames.
    #[error(
        "a model has no attitude in {lost} of the {frames} frames with a residual (no stars in its field, or an exposure beyond the reference): too few are left to compare"
    )]
    NothingFlown {
        /// Frames with a residual.
        frames: usize,
        /// Those without an attitude of a draw.
        lost: usize,
    },
    /// A star without a direction.
    #[error("star {id} of table `stars` is not in table `catalog`")]
    UnknownStar {
        /// Its id.
        id: i64,
    },
    /// The reference is no series of attitudes.
    #[error("table `reference`: {0}")]
    Reference(AttitudeError),
    /// No spectrum of an axis.
    #[error("spectrum of the residual about {axis}: {reason}")]
    Spectrum {
        /// The axis.
        axis: &'static str,
        /// Why.
        reason: SpectraError,
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
    Camera(CameraError),
    /// Made-up stars that the model's field has no room for.
    #[error("model: {0}")]
    Tracker(TrackerError),
    /// A model that cannot be flown.
    #[error("model: {0}")]
    Scenario(ScenarioError),
    /// An effect that cannot be built.
    #[error("model: {0}")]
    Effect(EffectError),
    /// Numbers of a hybrid model outside their range.
    #[error("model: {0}")]
    Hybrid(FogmError),
    /// A model that cannot be flown, in its own line.
    #[error(transparent)]
    InModel(TelemetryError),
    /// A model that cannot be flown, as a whole.
    #[error("{model}: {reason}")]
    OfModel {
        /// Its file, or its title.
        model: String,
        /// Why.
        reason: String,
    },
    /// No frequency is left to be fitted.
    #[error(
        "the spectrum of the residual has no frequency in {low_hz} to {high_hz} Hz: it reaches from {from_hz:.3e} to {nyquist_hz:.3} Hz, half the sample rate"
    )]
    EmptyBand {
        /// Lower end of the band asked for, Hz.
        low_hz: f64,
        /// Its upper end.
        high_hz: f64,
        /// Lowest frequency there is.
        from_hz: f64,
        /// Highest.
        nyquist_hz: f64,
    },
    /// No spectrum of a draw.
    #[error("spectrum of a draw: {0}")]
    Draw(SpectraError),
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
    #[error("fit of the residual about {axis}: {reason}")]
    Fit {
        /// The axis.
        axis: &'static str,
        /// Why.
        reason: FogmError,
    },
}

/// A scatter below which a residual holds rounding only: products of unit quaternions are good to some
/// 1e-10 arcsec.
const ROUNDING_ARCSEC: f64 = 1e-7;

/// The text of each of these holds that of its reason, which is therefore no `source`: it would be told
/// twice.
macro_rules! from {
    ($($variant:ident: $reason:ty),* $(,)?) => {
        $(impl From<$reason> for ComparisonError {
            fn from(reason: $reason) -> Self {
                Self::$variant(reason)
            }
        })*
    };
}

from! {
    Reference: AttitudeError,
    Camera: CameraError,
    Tracker: TrackerError,
    Scenario: ScenarioError,
    Effect: EffectError,
    Hybrid: FogmError,
    Draw: SpectraError,
}

impl ComparisonError {
    /// The same with the name of the model, where it is one's fault.
    pub(crate) fn of_model(self, model: &Model) -> Self {
        let reason = match self {
            Self::Scenario(ScenarioError::File(located)) => return Self::InModel(located),
            Self::Camera(error) => error.to_string(),
            Self::Tracker(error) => error.to_string(),
            Self::Scenario(error) => error.to_string(),
            Self::Effect(error) => error.to_string(),
            Self::Hybrid(error) => error.to_string(),
            other => return other,
        };
        let names = [Some(&model.file), model.title.as_ref()];
        let name = names.into_iter().flatten().find(|name| !name.is_empty());
        Self::OfModel {
            model: name.map_or_else(|| "model".to_owned(), String::clone),
            reason,
        }
    }

    /// Whether it is a model's fault, and not the bundle's.
    #[must_use]
    pub fn is_of_model(&self) -> bool {
        matches!(
            self,
            Self::InModel(_) | Self::OfModel { .. } | Self::NoNoise { .. }
        )
    }

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
