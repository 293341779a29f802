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

/// Mean of the valid samples of a channel within the run; of all, where none lies within it. A table that starts
/// before the run, or goes on after it, would otherwise make a scale of its own out of a drift.
pub(crate) fn mean_within(series: &Series, [first_s, last_s]: [f64; 2]) -> f64 {
    let within = series.t_s().iter().zip(series.value());
    let within = within.filter(|(t, _)| (first_s..=last_s).contains(*t));
    let offset = series.value().first().copied().unwrap_or(0.0);
    let (sum, count) = within.fold((0.0, 0.0), |(s, n), (_, v)| (s + (v - offset), n + 1.0));
    if count > 0.0 {
        offset + sum / count
    } else {
        series.mean()
    }
}

/// Standard deviation of the valid samples of a channel.
pub(crate) fn deviation(series: &Series) -> f64 {
    let mean = series.mean();
    let sum: f64 = series.value().iter().map(|v| (v - mean) * (v - mean)).sum();
    (sum / series.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp of 0.01 a second over 600 s, of which the run is the last half: its mean there, not that of the table.
    /// Where the run has no sample the table's is all that there is.
    #[test]
    fn the_mean_is_that_of_the_run() {
        let t_s: Vec<f64> = (0..=60).map(|k| 10.0 * f64::from(k) - 300.0).collect();
        let value = t_s.iter().map(|t| 20.0 + 0.01 * t).collect();
        let series = Series::new(t_s, value).expect("a series");
        assert!((mean_within(&series, [0.0, 300.0]) - 21.5).abs() < 1e-12);
        assert!((mean_within(&series, [1000.0, 1300.0]) - 20.0).abs() < 1e-12);
    }
}
