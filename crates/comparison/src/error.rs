//! Why a bundle cannot be compared.

use focal_plane::AttitudeError;
use fogm_fit::FogmError;
use spectra::SpectraError;

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
    /// No spectrum of a draw.
    #[error("spectrum of a draw: {0}")]
    Draw(#[from] SpectraError),
    /// No fit of an axis.
    #[error("fit of the residual about {axis}: {source}")]
    Fit {
        /// The axis.
        axis: &'static str,
        /// Why.
        source: FogmError,
    },
}
