//! What can be wrong with a model or a star field.

/// Errors of this crate.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum TrackerError {
    /// A number that must be finite is not.
    #[error("{name} = {value} must be finite")]
    NotFinite {
        /// What it is.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number that must not be negative is, or is not finite.
    #[error("{name} = {value} must be finite and not negative")]
    Negative {
        /// What it is.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A star field without stars.
    #[error("{got} stars asked for, at least {need} needed")]
    TooFewStars {
        /// Asked for.
        got: usize,
        /// Needed.
        need: usize,
    },
}

impl TrackerError {
    pub(crate) fn check_finite(name: &'static str, value: f64) -> Result<(), Self> {
        if value.is_finite() {
            Ok(())
        } else {
            Err(Self::NotFinite { name, value })
        }
    }

    pub(crate) fn check_not_negative(name: &'static str, value: f64) -> Result<(), Self> {
        if value.is_finite() && value >= 0.0 {
            Ok(())
        } else {
            Err(Self::Negative { name, value })
        }
    }
}
