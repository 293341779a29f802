//! A temperature held between two limits by a heater.
//!
//! ```text
//! T' = (T_on - T) / tau  until T = high,      T' = (T_off - T) / tau  until T = low
//! t_heat = tau ln((T_on - low) / (T_on - high)),   t_cool = tau ln((high - T_off) / (low - T_off))
//! ```
//!
//! The cycle is in closed form; it starts with the heater switching on at t = 0, plus `delay_s`.
//!
//! Source: Newton's law of cooling with a two-point controller. [M23] Section 4.3 has heaters cycled
//! every 3 minutes (0.0055 Hz); the temperatures are an assumption of the scenario that uses it.

use serde::Deserialize;

use super::Column;
use crate::ScenarioError;

/// `kind = "thermostat"`. Temperatures in the unit of the channel, `_c` or `_k`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thermostat {
    /// Name of the channel; ends in `_c` or `_k`.
    pub name: String,
    /// Temperature at which the heater switches on.
    pub low: f64,
    /// Temperature at which it switches off.
    pub high: f64,
    /// Temperature that it would settle at with the heater on; above `high`.
    pub settles_on: f64,
    /// Temperature that it would settle at with the heater off; below `low`.
    pub settles_off: f64,
    /// Time constant, s.
    pub tau_s: f64,
    /// Time at which the heater switches on, s; default 0.
    #[serde(default)]
    pub delay_s: f64,
    /// Name of a channel for the heater itself (1 on, 0 off); ends in `_on`; default none.
    #[serde(default)]
    pub switch: Option<String>,
    /// 1 sigma of the measured temperature; default 0.
    #[serde(default)]
    pub noise: f64,
}

impl Thermostat {
    /// Time with the heater on and time with it off in one cycle, s.
    pub fn cycle_s(&self) -> [f64; 2] {
        let heat = (self.settles_on - self.low) / (self.settles_on - self.high);
        let cool = (self.high - self.settles_off) / (self.low - self.settles_off);
        [self.tau_s * heat.ln(), self.tau_s * cool.ln()]
    }

    fn check(&self) -> Result<(), ScenarioError> {
        ScenarioError::check_finite("housekeeping.channel.low", self.low)?;
        let (low, high) = (self.low, self.high);
        ScenarioError::check(
            "housekeeping.channel.high",
            high,
            high > low && high.is_finite(),
            "above low",
        )?;
        let (on, off) = (self.settles_on, self.settles_off);
        let hot = on > high && on.is_finite();
        ScenarioError::check("housekeeping.channel.settles_on", on, hot, "above high")?;
        let cold = off < low && off.is_finite();
        ScenarioError::check("housekeeping.channel.settles_off", off, cold, "below low")?;
        ScenarioError::check_positive("housekeeping.channel.tau_s", self.tau_s)?;
        ScenarioError::check_finite("housekeeping.channel.delay_s", self.delay_s)?;
        ScenarioError::check_not_negative("housekeeping.channel.noise", self.noise)
    }

    /// Temperature, and whether the heater is on.
    fn at(&self, t_s: f64) -> (f64, bool) {
        let [heat_s, cool_s] = self.cycle_s();
        let since = (t_s - self.delay_s).rem_euclid(heat_s + cool_s);
        let (from, to, passed, on) = if since < heat_s {
            (self.low, self.settles_on, since, true)
        } else {
            (self.high, self.settles_off, since - heat_s, false)
        };
        (to + (from - to) * (-passed / self.tau_s).exp(), on)
    }

    pub(super) fn columns(&self, t_s: &[f64]) -> Result<Vec<Column>, ScenarioError> {
        self.check()?;
        let value = t_s.iter().map(|&t| self.at(t).0).collect();
        let mut columns = vec![Column {
            name: self.name.clone(),
            value,
            noise: self.noise,
        }];
        if let Some(switch) = &self.switch {
            let value = t_s
                .iter()
                .map(|&t| if self.at(t).1 { 1.0 } else { 0.0 })
                .collect();
            columns.push(Column {
                name: switch.clone(),
                value,
                noise: 0.0,
            });
        }
        Ok(columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The temperature is continuous, stays between its limits, reaches both, and repeats with the
    /// cycle; its slope is Newton's law on both branches.
    #[test]
    fn the_cycle_runs_between_its_limits() {
        let heater = Thermostat {
            name: "bracket_c".to_owned(),
            low: 19.0,
            high: 21.0,
            settles_on: 26.0,
            settles_off: 10.0,
            tau_s: 400.0,
            delay_s: 13.0,
            switch: Some("heater_on".to_owned()),
            noise: 0.0,
        };
        let [heat_s, cool_s] = heater.cycle_s();
        assert!((heat_s - 400.0 * (7.0_f64 / 5.0).ln()).abs() < 1e-9);
        assert!((cool_s - 400.0 * (11.0_f64 / 9.0).ln()).abs() < 1e-9);
        let top = heater.at(13.0 + heat_s - 1e-9).0;
        assert!(
            (top - 21.0).abs() < 1e-9 && (heater.at(13.0 + heat_s + 1e-9).0 - 21.0).abs() < 1e-9
        );
        for k in -50..500 {
            let t = 3.7 * f64::from(k);
            let (now, on) = heater.at(t);
            assert!((19.0 - 1e-9..=21.0 + 1e-9).contains(&now));
            assert!((heater.at(t + heat_s + cool_s).0 - now).abs() < 1e-9);
            let (later, still) = heater.at(t + 1e-4);
            if on == still {
                let law = (if on { 26.0 } else { 10.0 } - now) / 400.0;
                // forward difference: T'' h / 2 = 16 / 400^2 * 5e-5
                assert!(((later - now) / 1e-4 - law).abs() < 1e-8);
            }
        }
        let columns = heater.columns(&[13.0, 13.0 + heat_s + 1.0]).unwrap();
        assert_eq!(
            (columns[1].name.as_str(), columns[1].value.as_slice()),
            ("heater_on", [1.0, 0.0].as_slice())
        );
    }

    #[test]
    fn a_heater_that_never_reaches_its_limit_is_an_error() {
        let heater = Thermostat {
            name: "bracket_c".to_owned(),
            low: 19.0,
            high: 21.0,
            settles_on: 20.5,
            settles_off: 10.0,
            tau_s: 400.0,
            delay_s: 0.0,
            switch: None,
            noise: 0.0,
        };
        let name = "housekeeping.channel.settles_on";
        assert!(
            matches!(heater.columns(&[0.0]), Err(ScenarioError::OutOfRange { name: n, .. }) if n == name)
        );
    }
}
