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
