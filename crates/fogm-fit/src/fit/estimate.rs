//! What is known of one parameter: a number with its error, a bound, or nothing, never a bare number.
//!
//! Not physics: the vocabulary of a result.

use std::fmt;

/// Why a parameter has no two-sided estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reason {
    /// White noise alone describes the data as well: the FOGM is not seen.
    LostInWhite,
    /// FOGM alone describes the data as well: the white noise is not seen.
    LostInFogm,
    /// The correlation time exceeds what the span can tell from a random walk.
    BeyondSpan,
    /// The correlation time is below the sampling step: samples hardly show a correlation.
    BelowStep,
    /// The parameters cannot be told apart with this spectrum.
    Degenerate,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::LostInWhite => "white noise alone describes the data as well",
            Self::LostInFogm => "FOGM alone describes the data as well",
            Self::BeyondSpan => "the correlation time is too long for the span",
            Self::BelowStep => "the correlation time is below the sampling step",
            Self::Degenerate => "the parameters cannot be told apart",
        })
    }
}

/// What the data tell of one parameter. Bounds and intervals hold the truth with 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Estimate {
    /// A value, its standard error, and a 95 % interval which need not be symmetric.
    Estimated {
        /// Value, corrected for its bias to first order.
        value: f64,
        /// Standard error.
        sigma: f64,
        /// 95 % interval.
        interval: [f64; 2],
    },
    /// No more than `limit`; zero is possible. For `sigma_hsf` it holds for correlation times from one
    /// step to the span: a slower process is a constant, which no series shows, and a faster one is
    /// white.
    UpperBound {
        /// The bound.
        limit: f64,
        /// Why there is no lower one.
        reason: Reason,
    },
    /// No less than `limit`; any larger value is possible.
    LowerBound {
        /// The bound.
        limit: f64,
        /// Why there is no upper one.
        reason: Reason,
    },
    /// The data do not tell.
    Undetermined {
        /// Why.
        reason: Reason,
    },
}

impl Estimate {
    /// The value, where there is one.
    #[must_use]
    pub const fn value(&self) -> Option<f64> {
        match self {
            Self::Estimated { value, .. } => Some(*value),
            _ => None,
        }
    }

    /// The standard error, where there is one.
    #[must_use]
    pub const fn sigma(&self) -> Option<f64> {
        match self {
            Self::Estimated { sigma, .. } => Some(*sigma),
            _ => None,
        }
    }

    /// What remains possible with 95 %: the interval, or a half-open one; `None` where nothing is known.
    #[must_use]
    pub const fn interval(&self) -> Option<[f64; 2]> {
        match self {
            Self::Estimated { interval, .. } => Some(*interval),
            Self::UpperBound { limit, .. } => Some([0.0, *limit]),
            Self::LowerBound { limit, .. } => Some([*limit, f64::INFINITY]),
            Self::Undetermined { .. } => None,
        }
    }

    /// Why there is no value; `None` where there is one.
    #[must_use]
    pub const fn reason(&self) -> Option<Reason> {
        match self {
            Self::Estimated { .. } => None,
            Self::UpperBound { reason, .. }
            | Self::LowerBound { reason, .. }
            | Self::Undetermined { reason } => Some(*reason),
        }
    }
}
