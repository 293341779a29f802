//! What can be wrong with a set of star vectors.

/// Why no attitude came out.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum QuestError {
    /// The three slices do not describe the same stars.
    #[error(
        "{measured} measured vectors, {reference} reference vectors and {weights} weights given; all must be equal in number"
    )]
    LengthMismatch {
        /// Number of measured vectors.
        measured: usize,
        /// Number of reference vectors.
        reference: usize,
        /// Number of weights.
        weights: usize,
    },
    /// One direction leaves a rotation about itself open.
    #[error("{got} stars given, at least 2 needed")]
    TooFewStars {
        /// Number of stars.
        got: usize,
    },
    /// A component is NaN or infinite.
    #[error("{set} vector {index} is not finite")]
    NotFinite {
        /// `"measured"`, `"reference"`, or `"profile"` for the matrix itself.
        set: &'static str,
        /// Index of the star; 0 for a profile.
        index: usize,
    },
    /// A vector is not a direction.
    #[error("{set} vector {index} has length {length}, which is more than 1e-6 from 1")]
    NotUnit {
        /// `"measured"` or `"reference"`.
        set: &'static str,
        /// Index of the star.
        index: usize,
        /// Its length.
        length: f64,
    },
    /// A weight (or standard deviation) must be finite and positive.
    #[error("{name} {index} is {value}, but must be finite and positive")]
    NotPositive {
        /// `"weight"`, `"sigma_rad"`, or `"total weight"`, which may overflow or vanish.
        name: &'static str,
        /// Index of the star; for the total, the number of stars.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// All vectors of one set lie on one line, in either sense.
    #[error(
        "the {set} vectors are parallel or antiparallel (spread {spread_rad:.1e} rad): rotation about them is not determined"
    )]
    Parallel {
        /// `"measured"` or `"reference"`.
        set: &'static str,
        /// Weighted rms distance from their common line, rad.
        spread_rad: f64,
    },
    /// Two attitudes fit equally well to working precision, though neither set is parallel: a
    /// mirrored set, or one that has nothing to do with the other.
    #[error("eigenvalue gap {gap:.1e} is below {limit:.1e}: the attitude is not determined")]
    Degenerate {
        /// The two largest eigenvalues' distance at unit total weight.
        gap: f64,
        /// The least gap accepted, [`MIN_GAP`](crate::MIN_GAP).
        limit: f64,
    },
}
