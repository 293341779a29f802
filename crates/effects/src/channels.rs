//! Which housekeeping channels an effect may follow: told by the ending of their names.
//!
//! ```text
//! temperatures  _c, _k        switches  _on        velocity  vx_m_s.. or vx_km_s..
//! ```
//!
//! Source: the format of telemetry bundles of this project.

use focal_plane::Series;

use crate::{EffectError, Surroundings};

/// Kinds of channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// Temperatures.
    Temperature,
    /// Temperatures and switches.
    Thermal,
}

impl Ending {
    fn takes(self, name: &str) -> bool {
        let temperature = name.ends_with("_c") || name.ends_with("_k");
        match self {
            Self::Temperature => temperature,
            Self::Thermal => temperature || name.ends_with("_on"),
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Temperature => "_c or _k",
            Self::Thermal => "_c, _k or _on",
        }
    }
}

/// The channel of that name, if the effect may follow it.
pub(crate) fn find<'s>(
    effect: &'static str,
    channel: &str,
    ending: Ending,
    surroundings: &Surroundings<'s>,
) -> Result<&'s Series, EffectError> {
    let channel = channel.to_owned();
    if !ending.takes(&channel) {
        return Err(EffectError::WrongChannel {
            effect,
            channel,
            expected: ending.words(),
        });
    }
    match surroundings
        .channels
        .get(&channel)
        .filter(|series| !series.is_empty())
    {
        Some(series) => Ok(series),
        None => Err(EffectError::NoChannel { effect, channel }),
    }
}

/// All channels that an effect may follow.
pub(crate) fn ending<'s>(
    ending: Ending,
    surroundings: &Surroundings<'s>,
) -> impl Iterator<Item = (&'s String, &'s Series)> {
    surroundings
        .channels
        .iter()
        .filter(move |(name, series)| ending.takes(name) && !series.is_empty())
}

/// Standard deviation of the valid samples of a channel.
pub(crate) fn deviation(series: &Series) -> f64 {
    let mean = series.mean();
    let sum: f64 = series.value().iter().map(|v| (v - mean) * (v - mean)).sum();
    (sum / series.len() as f64).sqrt()
}
