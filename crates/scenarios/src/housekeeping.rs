//! Housekeeping channels: what temperatures, switches and velocities do during a run.
//!
//! Channels are made without noise on the grid of the table, which reaches one sample beyond the truth
//! on either side; effects follow them there (linear between samples, as everyone who reads the bundle
//! sees them). Measurement noise is added to the table only.
//!
//! Not physics: the channels are in the files beside this one.

mod orbit;
mod sinusoid;
mod thermostat;

use std::collections::BTreeMap;

use focal_plane::Series;
use rand_core::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Deserialize;
use telemetry::Housekeeping as Table;

use crate::ScenarioError;

pub use orbit::OrbitVelocity;
pub use sinusoid::SinusoidChannel;
pub use thermostat::Thermostat;

/// `[housekeeping]`: channels at a rate of their own.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Housekeeping {
    /// Samples per second; default 0.1.
    #[serde(default = "tenth")]
    pub rate_hz: f64,
    /// The channels: `[[housekeeping.channel]]`.
    pub channel: Vec<Channel>,
}

fn tenth() -> f64 {
    0.1
}

/// One entry of `[[housekeeping.channel]]`, told apart by `kind`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Channel {
    /// `sinusoid`
    Sinusoid(SinusoidChannel),
    /// `thermostat`
    Thermostat(Thermostat),
    /// `orbit_velocity`
    OrbitVelocity(OrbitVelocity),
}

/// Channels of one run.
#[derive(Clone, Debug, Default)]
pub(crate) struct Channels {
    /// Without noise: what effects follow.
    pub(crate) series: BTreeMap<String, Series>,
    /// With noise: what the bundle holds.
    pub(crate) table: Option<Table>,
    /// Whether there are vectors among them, which are inertial.
    pub(crate) vectors: bool,
}

/// One column of a channel.
#[derive(Debug)]
struct Column {
    name: String,
    value: Vec<f64>,
    noise: f64,
}

impl Housekeeping {
    /// The channels over `span_s`.
    pub(crate) fn channels<R: Rng + ?Sized>(
        &self,
        span_s: [f64; 2],
        rng: &mut R,
    ) -> Result<Channels, ScenarioError> {
        ScenarioError::check_positive("housekeeping.rate_hz", self.rate_hz)?;
        let t_s = grid(span_s, self.rate_hz);
        let mut out = Channels::default();
        let mut table = BTreeMap::new();
        for channel in &self.channel {
            out.vectors |= matches!(channel, Channel::OrbitVelocity(_));
            for column in channel.columns(&t_s)? {
                let series = Series::new(t_s.clone(), column.value.clone())?;
                if out.series.insert(column.name.clone(), series).is_some() {
                    return Err(ScenarioError::RepeatedChannel { name: column.name });
                }
                let mut noisy = || -> f64 { StandardNormal.sample(&mut *rng) };
                let value = column
                    .value
                    .iter()
                    .map(|v| v + column.noise * noisy())
                    .collect();
                table.insert(column.name, value);
            }
        }
        out.table = Some(Table {
            t_s,
            channels: table,
        });
        Ok(out)
    }
}

/// Multiples of the step that cover the span with one sample beyond each end.
fn grid([from_s, to_s]: [f64; 2], rate_hz: f64) -> Vec<f64> {
    let mut k = (from_s * rate_hz).floor() - 1.0;
    let last = (to_s * rate_hz).ceil() + 1.0;
    let mut t_s = Vec::new();
    while k <= last {
        t_s.push(k / rate_hz);
        k += 1.0;
    }
    t_s
}

impl Channel {
    fn columns(&self, t_s: &[f64]) -> Result<Vec<Column>, ScenarioError> {
        match self {
            Self::Sinusoid(sinusoid) => sinusoid.columns(t_s),
            Self::Thermostat(thermostat) => thermostat.columns(t_s),
            Self::OrbitVelocity(orbit) => orbit.columns(t_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use star_tracker::{Purpose, stream};

    use super::*;

    /// The table is the channel that effects follow, plus white noise: mean within 5 sigma / sqrt n,
    /// variance within 5 sqrt(2/n); and both reach beyond the span on either side.
    #[test]
    fn the_table_is_the_channel_plus_noise() {
        let sinusoid = SinusoidChannel {
            name: "optics_c".to_owned(),
            mean: 12.0,
            amplitude: 3.0,
            period_s: 777.0,
            phase_deg: 10.0,
            per_s: 0.001,
            noise: 0.5,
        };
        let housekeeping = Housekeeping {
            rate_hz: 0.7,
            channel: vec![Channel::Sinusoid(sinusoid)],
        };
        let span_s = [-5.0, 20_000.0];
        let mut rng = stream(1, 0, Purpose::Housekeeping);
        let channels = housekeeping.channels(span_s, &mut rng).unwrap();
        let (table, series) = (channels.table.unwrap(), &channels.series["optics_c"]);
        assert!(table.t_s[0] < span_s[0] && table.t_s[table.t_s.len() - 1] > span_s[1]);
        assert!(series.at(span_s[0]).is_some() && series.at(span_s[1]).is_some());
        let n = table.t_s.len() as f64;
        let noise: Vec<f64> = table.channels["optics_c"]
            .iter()
            .zip(series.value())
            .map(|(a, b)| a - b)
            .collect();
        let mean = noise.iter().sum::<f64>() / n;
        let variance = noise.iter().map(|v| v * v).sum::<f64>() / n;
        assert!(mean.abs() < 5.0 * 0.5 / n.sqrt(), "mean {mean}");
        assert!(
            (variance / 0.25 - 1.0).abs() < 5.0 * (2.0 / n).sqrt(),
            "variance {variance}"
        );
        let t = series.t_s()[100];
        let expected = 12.0
            + 3.0 * (core::f64::consts::TAU * t / 777.0 + 10_f64.to_radians()).sin()
            + 0.001 * t;
        assert!((series.value()[100] - expected).abs() < 1e-12);
    }

    #[test]
    fn two_channels_of_one_name_are_an_error() {
        let orbit = OrbitVelocity {
            prefix: String::new(),
            radius_km: 7000.0,
            period_s: 5800.0,
            inclination_deg: 0.0,
            node_deg: 0.0,
            phase_deg: 0.0,
            noise_km_s: 0.0,
        };
        let channel = vec![
            Channel::OrbitVelocity(orbit.clone()),
            Channel::OrbitVelocity(orbit),
        ];
        let housekeeping = Housekeeping {
            rate_hz: 0.1,
            channel,
        };
        let got = housekeeping.channels([0.0, 60.0], &mut stream(1, 0, Purpose::Housekeeping));
        assert!(matches!(got, Err(ScenarioError::RepeatedChannel { name }) if name == "vx_km_s"));
    }
}
