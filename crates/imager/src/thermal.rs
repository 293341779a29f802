//! Temperatures: lumped masses with heaters, and the sensors on them.
//!
//! ```text
//! tau dT/dt = T_around - T + rise h(t)         h: heater on (1) or off (0)
//! T_around  = around + amplitude sin(2 pi t/period + phase) + per_s t,   or the temperature of another node
//! ```
//!
//! A heater switches on below `on_below_c` and off above `off_above_c`. The equation is advanced in steps of
//! a quarter of a second with the surroundings constant over a step (exact for them); between steps T is
//! linear, and a heater switches at the end of the step that crosses its limit. A node that follows
//! another lags behind it by its `tau_s`.
//!
//! Source: Gilmore (ed.), Spacecraft Thermal Control Handbook (2002), ch. 15: lumped-parameter nodes.

use core::f64::consts::TAU;

use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::ImagerError;
use crate::random::Key;

/// Step, s.
const STEP_S: f64 = 0.25;
/// Time constants that a node runs before the first frame, so that its start is forgotten.
const SETTLING: f64 = 12.0;
/// Longest time it runs before, s.
const LONGEST_S: f64 = 1e5;

/// `[thermal]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Thermal {
    /// Masses; a node may follow one that stands before it.
    pub node: Vec<Node>,
    /// Thermometers: channels of the housekeeping.
    pub sensor: Vec<Sensor>,
    /// Samples per second of the housekeeping; default 0.2.
    pub rate_hz: Option<f64>,
}

/// `[[thermal.node]]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Node {
    /// Name.
    pub name: String,
    /// Time constant, s.
    pub tau_s: f64,
    /// Node that it follows; default none: the surroundings below.
    #[serde(default)]
    pub follows: Option<String>,
    /// Mean temperature around it, deg C; default 20.
    #[serde(default = "twenty")]
    pub around_c: f64,
    /// Amplitude of the temperature around it, deg C; default 0.
    #[serde(default)]
    pub amplitude_c: f64,
    /// Its period, s; default 5400.
    #[serde(default = "period")]
    pub period_s: f64,
    /// Its phase at t = 0, deg; default 0.
    #[serde(default)]
    pub phase_deg: f64,
    /// Trend of the temperature around it, deg C per s; default 0.
    #[serde(default)]
    pub per_s: f64,
    /// What its heater would raise it by, deg C; default 0: no heater.
    #[serde(default)]
    pub heater_rise_c: f64,
    /// The heater switches on below, deg C.
    #[serde(default)]
    pub on_below_c: f64,
    /// The heater switches off above, deg C.
    #[serde(default)]
    pub off_above_c: f64,
}

/// `[[thermal.sensor]]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Name of the channel, ending in `_c`; in `_on` it is the heater's switch.
    pub channel: String,
    /// Node that it sits on.
    pub node: String,
    /// Noise, deg C rms; default 0.
    #[serde(default)]
    pub noise_c: f64,
    /// Step of its numbers, deg C; default 0: none.
    #[serde(default)]
    pub step_c: f64,
}

fn twenty() -> f64 {
    20.0
}

fn period() -> f64 {
    5400.0
}

impl Thermal {
    pub(crate) fn check(&self) -> Result<(), ImagerError> {
        for (k, node) in self.node.iter().enumerate() {
            node.check()?;
            if self.node[..k].iter().any(|other| other.name == node.name) {
                let name = node.name.clone();
                return Err(ImagerError::Repeated {
                    what: "thermal node",
                    name,
                });
            }
            if let Some(other) = &node.follows
                && !self.node[..k].iter().any(|before| before.name == *other)
            {
                let (name, node) = ("thermal.node.follows", other.clone());
                return Err(ImagerError::NoNode { name, node });
            }
        }
        for (k, sensor) in self.sensor.iter().enumerate() {
            self.index("thermal.sensor.node", &sensor.node)?;
            ImagerError::not_negative("thermal.sensor.noise_c", sensor.noise_c)?;
            ImagerError::not_negative("thermal.sensor.step_c", sensor.step_c)?;
            if self.sensor[..k]
                .iter()
                .any(|other| other.channel == sensor.channel)
            {
                let name = sensor.channel.clone();
                return Err(ImagerError::Repeated {
                    what: "channel",
                    name,
                });
            }
        }
        ImagerError::positive("thermal.rate_hz", self.rate_hz())
    }

    pub(crate) fn rate_hz(&self) -> f64 {
        self.rate_hz.unwrap_or(0.2)
    }

    /// Index of a node by its name; `name` is the key that asks.
    pub(crate) fn index(&self, name: &'static str, node: &str) -> Result<usize, ImagerError> {
        let found = self.node.iter().position(|known| known.name == node);
        let node = node.to_owned();
        found.ok_or(ImagerError::NoNode { name, node })
    }
}

impl Node {
    fn check(&self) -> Result<(), ImagerError> {
        ImagerError::positive("thermal.node.tau_s", self.tau_s)?;
        ImagerError::positive("thermal.node.period_s", self.period_s)?;
        ImagerError::finite("thermal.node.around_c", self.around_c + self.amplitude_c)?;
        ImagerError::finite("thermal.node.per_s", self.per_s + self.phase_deg)?;
        ImagerError::not_negative("thermal.node.heater_rise_c", self.heater_rise_c)?;
        let gap = self.off_above_c - self.on_below_c;
        if self.heater_rise_c > 0.0 {
            ImagerError::positive("thermal.node.off_above_c - on_below_c", gap)?;
        }
        Ok(())
    }

    fn around_c(&self, t_s: f64) -> f64 {
        let wave = (TAU * t_s / self.period_s + self.phase_deg.to_radians()).sin();
        self.around_c + self.amplitude_c * wave + self.per_s * t_s
    }
}

/// Temperatures as far as they are needed: they go forward with the frames, and what lies behind is
/// forgotten.
#[derive(Clone, Debug)]
pub(crate) struct Temperatures {
    nodes: Vec<Node>,
    /// Index of the node that each follows.
    follows: Vec<Option<usize>>,
    /// Number of the first step held.
    first: i64,
    /// Temperature and heater of every node, step after step.
    held: Vec<(f64, bool)>,
}

impl Temperatures {
    /// Settled before `from_s`.
    pub(crate) fn new(thermal: &Thermal, from_s: f64) -> Self {
        let nodes = thermal.node.clone();
        let place = |name: &String| nodes.iter().position(|node| node.name == *name);
        let follows = nodes
            .iter()
            .map(|node| node.follows.as_ref().and_then(place))
            .collect();
        let longest = nodes.iter().map(|node| node.tau_s).fold(0.0, f64::max);
        let settling_s = (SETTLING * longest).min(LONGEST_S);
        let first = step_of(from_s - settling_s) - 1;
        let start = |node: &Node| (node.around_c(time_of(first)), false);
        let held = nodes.iter().map(start).collect();
        let mut temperatures = Self {
            nodes,
            follows,
            first,
            held,
        };
        temperatures.advance([from_s, from_s]);
        temperatures
    }

    /// Makes [`at`](Self::at) right over `span_s`; what lies before may be forgotten.
    pub(crate) fn advance(&mut self, span_s: [f64; 2]) {
        let n = self.nodes.len();
        if n == 0 {
            return;
        }
        let last = step_of(span_s[1]) + 1;
        let forget = step_of(span_s[0]) - 1;
        while self.first + self.steps() <= last {
            let now = self.first + self.steps() - 1;
            let (t_s, base) = (time_of(now), self.held.len() - n);
            for k in 0..n {
                let node = &self.nodes[k];
                let (temperature, on) = self.held[base + k];
                let around = match self.follows[k] {
                    Some(other) => self.held[base + other].0,
                    None => node.around_c(t_s + 0.5 * STEP_S),
                };
                let goal = around + if on { node.heater_rise_c } else { 0.0 };
                let next = goal + (temperature - goal) * (-STEP_S / node.tau_s).exp();
                let heats = node.heater_rise_c > 0.0
                    && (next < node.on_below_c || (on && next < node.off_above_c));
                self.held.push((next, heats));
            }
            // while settling, only the last step matters
            if now < forget {
                self.held.drain(..n);
                self.first += 1;
            }
        }
        let stale = usize::try_from(forget - self.first).unwrap_or(0);
        if stale > 0 {
            self.held.drain(..stale * n);
            self.first = forget;
        }
    }

    fn steps(&self) -> i64 {
        // a chunk holds some thousand steps
        i64::try_from(self.held.len() / self.nodes.len()).unwrap_or(i64::MAX)
    }

    /// Temperature of a node, deg C, at an instant that [`advance`](Self::advance) covers.
    pub(crate) fn at(&self, node: usize, t_s: f64) -> f64 {
        let (n, k) = (self.nodes.len(), self.row(t_s));
        let part = (t_s - time_of(self.first)) / STEP_S - k as f64;
        let [a, b] = [k, k + 1].map(|k| self.held[k * n + node].0);
        a + part * (b - a)
    }

    /// Whether the heater of a node is on.
    pub(crate) fn is_on(&self, node: usize, t_s: f64) -> bool {
        self.held[self.row(t_s) * self.nodes.len() + node].1
    }

    fn row(&self, t_s: f64) -> usize {
        let last = usize::try_from(self.steps() - 2).unwrap_or(0);
        usize::try_from(step_of(t_s) - self.first)
            .unwrap_or(0)
            .min(last)
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "seconds of a mission fit by far"
)]
fn step_of(t_s: f64) -> i64 {
    (t_s / STEP_S).floor() as i64
}

fn time_of(step: i64) -> f64 {
    // exact: a quarter of a whole number
    step as f64 * STEP_S
}

impl Sensor {
    /// What the sensor says at an instant; the number of the sample makes its noise.
    pub(crate) fn reads(
        &self,
        temperatures: &Temperatures,
        node: usize,
        t_s: f64,
        key: Key,
    ) -> f64 {
        if self.channel.ends_with("_on") {
            return if temperatures.is_on(node, t_s) {
                1.0
            } else {
                0.0
            };
        }
        let noise: f64 = StandardNormal.sample(&mut key.stream());
        let value = temperatures.at(node, t_s) + self.noise_c * noise;
        if self.step_c > 0.0 {
            (value / self.step_c).round() * self.step_c
        } else {
            value
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heated() -> Thermal {
        Thermal {
            node: vec![
                Node {
                    name: "plate".into(),
                    tau_s: 400.0,
                    follows: None,
                    around_c: 10.0,
                    amplitude_c: 0.0,
                    period_s: 5400.0,
                    phase_deg: 0.0,
                    per_s: 0.0,
                    heater_rise_c: 16.0,
                    on_below_c: 19.0,
                    off_above_c: 21.0,
                },
                Node {
                    name: "bracket".into(),
                    tau_s: 30.0,
                    follows: Some("plate".into()),
                    around_c: 20.0,
                    amplitude_c: 0.0,
                    period_s: 5400.0,
                    phase_deg: 0.0,
                    per_s: 0.0,
                    heater_rise_c: 0.0,
                    on_below_c: 0.0,
                    off_above_c: 0.0,
                },
            ],
            ..Thermal::default()
        }
    }

    /// The heater is on for tau ln((26 - 19)/(26 - 21)) and off for tau ln((21 - 10)/(19 - 10)), each to a step
    /// of switching late; over a ramp the bracket is its time constant behind.
    #[test]
    fn a_heater_cycles_and_a_bracket_lags() {
        let thermal = heated();
        thermal.check().unwrap();
        let mut temperatures = Temperatures::new(&thermal, 0.0);
        temperatures.advance([0.0, 2000.0]);
        let mut switched = Vec::new();
        for k in 1..8000_i32 {
            let t = 0.25 * f64::from(k);
            if temperatures.is_on(0, t) != temperatures.is_on(0, t - 0.25) {
                switched.push((t, temperatures.is_on(0, t)));
            }
        }
        let (on, off) = (400.0 * (7.0_f64 / 5.0).ln(), 400.0 * (11.0_f64 / 9.0).ln());
        for pair in switched.windows(2) {
            let lasted = pair[1].0 - pair[0].0;
            // late by up to a step at either end, and the overshoot has to be made good: 2 more
            assert!(
                (lasted - if pair[0].1 { on } else { off }).abs() < 1.0,
                "{lasted}"
            );
        }
        assert!(switched.len() > 10);
        // 100 s after switching on the plate rises by 26 - T over 400 s; its curvature adds tau/400 of the lag
        let t = switched.iter().find(|s| s.1).unwrap().0 + 100.0;
        let lag = temperatures.at(0, t) - temperatures.at(1, t);
        let slope = (26.0 - temperatures.at(0, t)) / 400.0;
        assert!((lag / (30.0 * slope) - 1.0).abs() < 0.15, "{lag}");
    }

    /// Going forward in pieces gives what going at once gives.
    #[test]
    fn pieces_are_the_whole() {
        let thermal = heated();
        let mut whole = Temperatures::new(&thermal, -5.0);
        whole.advance([-5.0, 900.0]);
        let mut pieces = Temperatures::new(&thermal, -5.0);
        for k in 0..9 {
            let from = 100.0 * f64::from(k);
            pieces.advance([from - 5.0, from + 100.0]);
            for t in [from + 0.1, from + 57.3, from + 99.9] {
                assert!((pieces.at(1, t) - whole.at(1, t)).abs() < 1e-12);
            }
            assert!(pieces.held.len() < 2 * 500);
        }
    }
}
