//! What can keep an assessment from being made.

use focal_plane::AttitudeError;
use spectra::SpectraError;

/// Errors of this crate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AssessError {
    /// The bundle holds no attitude.
    #[error("the bundle has no table `attitude`: an assessment is made of quaternions")]
    NoAttitude,
    /// A method that needs a table which is not there.
    #[error("method {method} needs the table `{table}`, which the bundle does not have")]
    NoTable {
        /// The method.
        method: &'static str,
        /// The table.
        table: &'static str,
    },
    /// Something is given that the method has no use for.
    #[error("{given} is used by method {needs} alone, and the method here is {method}")]
    NotUsed {
        /// What is given: `inertia`, `alignment` or `gyro_walk`.
        given: &'static str,
        /// The method that uses it.
        needs: &'static str,
        /// The method that was asked for, or that the bundle's tables give.
        method: &'static str,
    },
    /// Too few frames.
    #[error("{got} frames that can be used, at least {need} are needed{why}")]
    TooFew {
        /// There are.
        got: usize,
        /// There must be.
        need: usize,
        /// For what, or nothing.
        why: &'static str,
    },
    /// The tracker turns so far between frames that its direction of turning is not known.
    #[error(
        "the attitude turns by {turn_deg:.0} deg between frames: beyond 120 deg the spin cannot be told from its alias"
    )]
    Aliased {
        /// Median turn, deg.
        turn_deg: f64,
    },
    /// Moments of inertia that no body has.
    #[error(
        "moments of inertia {0:?} must be positive, and none larger than the sum of the others"
    )]
    Inertia([f64; 3]),
    /// A matrix that is no rotation.
    #[error("the alignment is no rotation: its rows are off orthonormal by {off:.1e}")]
    Alignment {
        /// Largest deviation of `N N^T` from one.
        off: f64,
    },
    /// A number outside its range.
    #[error("{name} = {value} must be {expected}")]
    OutOfRange {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Its range.
        expected: &'static str,
    },
    /// A fit that does not settle, or whose parameters the data do not determine.
    #[error("the fit of {what} does not converge: {reason}")]
    Fit {
        /// What was fitted.
        what: &'static str,
        /// Why it stopped.
        reason: String,
    },
    /// A body whose motion is too long to be integrated.
    #[error(
        "a body that turns by {rate_rad_s:.3e} rad/s with an axial ratio of its moments of inertia of {axial_ratio:.3e} turns too often in the {span_s:.0} s of the attitudes to be integrated: attitudes that no rigid body has, or gaps that are too long"
    )]
    TooManyTurns {
        /// Rate of the body that was tried, rad/s.
        rate_rad_s: f64,
        /// Axial over transverse moment of inertia.
        axial_ratio: f64,
        /// Time that the attitudes span, s.
        span_s: f64,
    },
    /// An attitude.
    #[error(transparent)]
    Attitude(#[from] AttitudeError),
    /// A spectrum.
    #[error(transparent)]
    Spectra(#[from] SpectraError),
}

impl AssessError {
    pub(crate) fn positive(name: &'static str, value: f64) -> Result<(), Self> {
        if value.is_finite() && value > 0.0 {
            return Ok(());
        }
        let expected = "finite and positive";
        Err(Self::OutOfRange {
            name,
            value,
            expected,
        })
    }
}
