//! What can be wrong with an effect's description.

/// Errors of this crate.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum EffectError {
    /// No effect of that id.
    #[error("no effect `{id}` in the catalogue; the nearest is `{nearest}`")]
    UnknownEffect {
        /// The id given.
        id: String,
        /// The nearest id that exists.
        nearest: String,
    },
    /// No parameter of that name.
    #[error("effect `{effect}` has no parameter `{name}`; the nearest is `{nearest}`")]
    UnknownParameter {
        /// The effect.
        effect: &'static str,
        /// The name given.
        name: String,
        /// The nearest name that exists.
        nearest: String,
    },
    /// A parameter without which the effect means nothing.
    #[error("effect `{effect}` needs `{name}`")]
    MissingParameter {
        /// The effect.
        effect: &'static str,
        /// The missing parameter.
        name: &'static str,
    },
    /// Two forms of one effect at once.
    #[error("effect `{effect}`: `{name}` and `{other}` exclude each other")]
    Conflicting {
        /// The effect.
        effect: &'static str,
        /// A parameter.
        name: String,
        /// The one that it excludes.
        other: String,
    },
    /// Text for a number, or the reverse.
    #[error("effect `{effect}`: `{name}` must be {expected}")]
    WrongType {
        /// The effect.
        effect: &'static str,
        /// The parameter.
        name: String,
        /// What was expected.
        expected: &'static str,
    },
    /// A value outside its physical range.
    #[error("effect `{effect}`: `{name}` = {value} must be {expected}")]
    OutOfRange {
        /// The effect.
        effect: &'static str,
        /// The parameter.
        name: String,
        /// The value.
        value: f64,
        /// The range in words.
        expected: &'static str,
    },
    /// The housekeeping channel it needs is not there.
    #[error(
        "effect `{effect}` needs housekeeping channel `{channel}`, which this data does not have"
    )]
    NoChannel {
        /// The effect.
        effect: &'static str,
        /// The channel.
        channel: String,
    },
    /// The channel is there, but this effect never uses channels of its kind.
    #[error("effect `{effect}` does not take channel `{channel}`: its name must end in {expected}")]
    WrongChannel {
        /// The effect.
        effect: &'static str,
        /// The channel.
        channel: String,
        /// The endings accepted.
        expected: &'static str,
    },
    /// The bundle does not say how housekeeping vectors relate to the tracker.
    #[error("effect `{effect}` needs {needed} in [frames]")]
    NoFrames {
        /// The effect.
        effect: &'static str,
        /// What is missing.
        needed: &'static str,
    },
    /// The effect moves raw pixels, not centroids.
    #[error("effect `{effect}` acts on raw images, which a model of centroids does not have")]
    ActsOnImages {
        /// The effect.
        effect: &'static str,
    },
}

impl EffectError {
    /// The key whose value is to blame, `id` for the effect itself; empty where it is the whole entry.
    #[must_use]
    pub fn key(&self) -> &str {
        match self {
            Self::UnknownEffect { .. } | Self::ActsOnImages { .. } => "id",
            Self::UnknownParameter { name, .. }
            | Self::Conflicting { name, .. }
            | Self::WrongType { name, .. }
            | Self::OutOfRange { name, .. } => name,
            Self::NoChannel { .. } | Self::WrongChannel { .. } => "channel",
            _ => "",
        }
    }
}
