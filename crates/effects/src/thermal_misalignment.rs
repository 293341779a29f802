//! Thermal misalignment: the frame between tracker and reference bends with a temperature, or with a
//! heater cycle.
//!
//! ```text
//! channel    theta_a(t) = a_arcsec_per_unit (L(t) - mean),   lag dL/dt = channel - L,   L(first) = channel
//! period     theta_a(t) = a_arcsec h(t),   h: steady answer of the same lag to a heater that is on for
//!            the first half of each period and off for the second, scaled to a fundamental of 1:
//!              y(s) = 1 - (1 + m) e^(-s/lag),  0 <= s < P/2,   m = tanh(P / (4 lag)),   y(s + P/2) = -y(s)
//!              h = y / ( (4/pi) / sqrt(1 + (2 pi lag / P)^2) )
//! ```
//!
//! tracker axes, arcsec. `mean` is that of the channel. Where the channel is not known (outside it, in a
//! hole) it counts as its mean. Without `lag_s` the channel acts at once; the period form then takes
//! lag = period, a frame much slower than its heater, which gives nearly a triangle.
//!
//! Only channels ending in `_c`, `_k` (temperatures) and `_on` (switches) bend a frame: velocities
//! belong to `velocity_aberration`.
//!
//! Source: \[M23\] Section 4.3.2: heaters cycled every 3 min (0.0055 Hz) deform the frame between tracker
//! and camera. First-order lag of a square wave: elementary.

use std::collections::BTreeMap;

use core::f64::consts::{FRAC_PI_4, PI};

use focal_plane::Series;

use crate::bending::{Bending, BendingCandidate, Bent};
use crate::channels::{self, Ending};
use crate::parameters::Reader;
use crate::{
    ActsOn, Candidate, Coefficient, Effect, EffectError, EffectKind, Nonlinear, Parameter,
    Parameters, Scene, Surroundings,
};

const ID: &str = "thermal_misalignment";
const PER_UNIT: [&str; 3] = [
    "x_arcsec_per_unit",
    "y_arcsec_per_unit",
    "z_arcsec_per_unit",
];
const AMPLITUDE: [&str; 3] = ["x_arcsec", "y_arcsec", "z_arcsec"];

/// Bending over one standard deviation of a channel that would not surprise, arcsec.
const PLAUSIBLE_ARCSEC: f64 = 5.0;

/// Lags that the catalogue proposes beside none, s, as far as they fit into the span: a factor 3
/// apart, so that the nearest shifts a sinusoid by at most 15 deg against the best.
const LAGS_S: [f64; 8] = [10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 3e4];
/// Lags that differ by less are alike, s.
const LEAST_STEP_S: f64 = 5.0;

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "the frame to the reference bends with a temperature channel or a heater cycle"
    }
    fn needs(&self) -> &'static str {
        "a reference, and a housekeeping channel that varies and whose name ends in _c, _k or _on"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            attitude: true,
            ..ActsOn::default()
        }
    }
    fn build(
        &self,
        parameters: &Parameters,
        surroundings: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let mut known = vec!["channel", "period_s", "lag_s"];
        known.extend(PER_UNIT.into_iter().chain(AMPLITUDE));
        let reader = Reader::new(ID, parameters, &known)?;
        let lag_s = reader.number("lag_s")?;
        if let Some(value) = lag_s.filter(|lag| *lag < 0.0) {
            let (name, expected) = ("lag_s".to_owned(), "not negative");
            return Err(EffectError::OutOfRange {
                effect: ID,
                name,
                value,
                expected,
            });
        }
        if let Some(channel) = reader.text("channel")? {
            reader.exclude("channel", ["period_s"].into_iter().chain(AMPLITUDE))?;
            let series = channels::find(ID, channel, Ending::Thermal, surroundings)?;
            let bending = Channel::new(channel, series, lag_s.unwrap_or(0.0), [0.0; 2]);
            return Ok(Box::new(Bent {
                bending,
                values: reader.axes(PER_UNIT)?.to_vec(),
            }));
        }
        if !reader.has("period_s") {
            return Err(EffectError::MissingParameter {
                effect: ID,
                name: "channel or period_s",
            });
        }
        reader.exclude("period_s", PER_UNIT)?;
        let period_s = reader.within("period_s", [1e-6, 1e12], "positive")?;
        let bending = HeaterCycle {
            period_s,
            lag_s: lag_s.unwrap_or(period_s),
        };
        Ok(Box::new(Bent {
            bending,
            values: reader.axes(AMPLITUDE)?.to_vec(),
        }))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        if !scene.sees_misalignment() {
            return Vec::new();
        }
        let longest_s = scene.surroundings.length_s() / 3.0;
        let mut all = Vec::new();
        for (name, series) in channels::ending(Ending::Thermal, &scene.surroundings) {
            let lags = LAGS_S
                .into_iter()
                .filter(|lag| *lag <= longest_s && *lag > scene.step_s);
            for lag_s in core::iter::once(0.0).chain(lags) {
                let bending = Channel::new(name, series, lag_s, [0.0, longest_s]);
                if bending.deviation > 0.0 {
                    all.push(BendingCandidate::boxed(bending));
                }
            }
        }
        all
    }
}

/// Bending with a channel.
#[derive(Clone, Debug)]
struct Channel {
    name: String,
    series: Series,
    lagged: Series,
    mean: f64,
    deviation: f64,
    lag_s: f64,
    range: [f64; 2],
}

impl Channel {
    fn new(name: &str, series: &Series, lag_s: f64, range: [f64; 2]) -> Self {
        Self {
            name: name.to_owned(),
            series: series.clone(),
            lagged: series.lagged(lag_s),
            mean: series.mean(),
            deviation: channels::deviation(series),
            lag_s,
            range,
        }
    }
}

impl Bending for Channel {
    fn id(&self) -> &'static str {
        ID
    }
    fn coefficients(&self) -> Vec<Coefficient> {
        let plausible = PLAUSIBLE_ARCSEC / self.deviation;
        PER_UNIT
            .map(|name| Coefficient::new(name, "arcsec/unit", plausible))
            .into()
    }
    fn functions(&self) -> usize {
        1
    }
    fn at(&self, t_s: f64, out: &mut [f64]) {
        out[0] = self.lagged.at(t_s).map_or(0.0, |value| value - self.mean);
    }
    fn fixed(&self) -> Vec<Parameter> {
        vec![Parameter::new("lag_s", self.lag_s, "s")]
    }
    fn selectors(&self) -> BTreeMap<String, String> {
        BTreeMap::from([("channel".to_owned(), self.name.clone())])
    }
    fn nonlinear(&self) -> Vec<Nonlinear> {
        vec![Nonlinear {
            name: "lag_s",
            unit: "s",
            value: self.lag_s,
            range: self.range,
            step: (0.5 * self.lag_s).max(LEAST_STEP_S),
            // no less: a lag as short as the time between samples takes the channel's noise along, and no longer one does
            difference: Some(LEAST_STEP_S),
        }]
    }
    fn with_nonlinear(&self, values: &[f64]) -> Option<Self> {
        let [low, high] = self.range;
        (low..=high)
            .contains(&values[0])
            .then(|| Self::new(&self.name, &self.series, values[0], self.range))
    }
}

/// Bending with a heater of unknown switching, from its period.
#[derive(Clone, Debug)]
struct HeaterCycle {
    period_s: f64,
    lag_s: f64,
}

impl Bending for HeaterCycle {
    fn id(&self) -> &'static str {
        ID
    }
    fn coefficients(&self) -> Vec<Coefficient> {
        AMPLITUDE
            .map(|name| Coefficient::new(name, "arcsec", PLAUSIBLE_ARCSEC).as_misalignment())
            .into()
    }
    fn functions(&self) -> usize {
        1
    }
    fn at(&self, t_s: f64, out: &mut [f64]) {
        let share = (t_s / self.period_s).rem_euclid(1.0);
        let (sign, share) = if share < 0.5 {
            (1.0, share)
        } else {
            (-1.0, share - 0.5)
        };
        if self.lag_s <= 0.0 {
            out[0] = sign * FRAC_PI_4;
            return;
        }
        let lags = self.period_s / self.lag_s;
        let m = (0.25 * lags).tanh();
        let fundamental = (1.0 / FRAC_PI_4) / 1.0_f64.hypot(2.0 * PI / lags);
        out[0] = sign * (1.0 - (1.0 + m) * (-share * lags).exp()) / fundamental;
    }
    fn fixed(&self) -> Vec<Parameter> {
        vec![
            Parameter::new("period_s", self.period_s, "s"),
            Parameter::new("lag_s", self.lag_s, "s"),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a temperature that rises and falls by 0.0075 a second, once a second with errors of 0.02 up and down, no lag and one
    /// of 5 s differ by 0.0075 times 5 and the errors, which the lag has taken out: by sqrt(1 + (0.02 / 0.0375)^2) = 1.13 times
    /// what they do without errors, in the middle of a rise. Over 0.1 s by 5.4 times, of changes of 0.04 a second: each error
    /// would count as knowledge.
    #[test]
    fn a_slope_at_no_lag_is_hardly_that_of_errors() {
        let slope = |error: f64| {
            let t_s: Vec<f64> = (0..1200).map(f64::from).collect();
            let value = |t: &f64| {
                let phase = t.rem_euclid(320.0);
                let up_and_down = if t.rem_euclid(2.0) < 1.0 {
                    error
                } else {
                    -error
                };
                20.0 + 0.0075 * phase.min(320.0 - phase) + up_and_down
            };
            let values = t_s.iter().map(value).collect();
            let series = Series::new(t_s.clone(), values).unwrap();
            let at_once = Channel::new("bracket_c", &series, 0.0, [0.0, 400.0]);
            let width = at_once.nonlinear()[0].difference.unwrap();
            let later = at_once.with_nonlinear(&[width]).unwrap();
            let change = |t: &f64| {
                let mut at = [[0.0]; 2];
                at_once.at(*t, &mut at[0]);
                later.at(*t, &mut at[1]);
                ((at[1][0] - at[0][0]) / width).powi(2)
            };
            (t_s.iter().map(change).sum::<f64>() / t_s.len() as f64).sqrt()
        };
        let wider = slope(0.02) / slope(0.0);
        assert!((1.0..1.25).contains(&wider), "{wider}");
    }

    /// The fundamental of the period form is 1 whatever the lag: its Fourier sum over n points per
    /// period has, beside rounding, only the aliasing of harmonics n +- 1. These fall off as 1/n for
    /// the square wave (lag 0) and as P/(lag n^2) otherwise.
    #[test]
    fn the_heater_cycle_has_unit_fundamental() {
        let n = 20_000_u32;
        for (lag_s, tolerance) in [
            (0.0, 2.0 / f64::from(n)),
            (20.0, 1e-6),
            (180.0, 1e-6),
            (1e4, 1e-6),
        ] {
            let cycle = HeaterCycle {
                period_s: 180.0,
                lag_s,
            };
            let (mut cos, mut sin) = (0.0, 0.0);
            for i in 0..n {
                let turn = (f64::from(i) + 0.5) / f64::from(n);
                let mut h = [0.0];
                cycle.at(turn * 180.0, &mut h);
                let (s, c) = (2.0 * PI * turn).sin_cos();
                cos += 2.0 * c * h[0] / f64::from(n);
                sin += 2.0 * s * h[0] / f64::from(n);
            }
            let amplitude = f64::hypot(cos, sin);
            assert!(
                (amplitude - 1.0).abs() < tolerance,
                "lag {lag_s}: {amplitude}"
            );
            // the fundamental lags the heater by atan(2 pi lag / P)
            let late = f64::atan2(-cos, sin);
            let theory = (2.0 * PI * lag_s / 180.0).atan();
            assert!(
                (late - theory).abs() < 10.0 * tolerance,
                "lag {lag_s}: {late} {theory}"
            );
        }
    }
}
