//! The better estimate, and the gyro: the truth with an error of its own.
//!
//! ```text
//! q_ref = exp(e) q_true,   e = white + wander,   tracker axes
//! wander[k+1] = a wander[k] + sqrt(1 - a^2) sigma n,   a = exp(-dt/tau)
//! ```
//!
//! The wander is a stationary first-order Gauss-Markov process per axis, exact at any step. Rates that
//! go with the reference are true: a filter's rate error is a thing of the gyro.
//!
//! Source: [M23] Eq. 15 (first-order Gauss-Markov process); the attitude errors of filters as white
//! plus coloured are an assumption of the scenario that uses them.

use focal_plane::{Angle, AttitudeSeries, AttitudeSource, rotation_from_vector};
use nalgebra::Vector3;
use rand_core::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Deserialize;
use telemetry::{RateTable, ReferenceTable};

use crate::ScenarioError;

/// `[reference]`: perfect unless errors are given.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Reference {
    /// Samples per second; default that of the frames.
    pub rate_hz: Option<f64>,
    /// Whether it comes with rates; default yes.
    pub rates: bool,
    /// White error of each sample, 1 sigma per axis, arcsec; default 0.
    pub white_arcsec: [f64; 3],
    /// Standard deviation of the wander, arcsec; default 0.
    pub wander_arcsec: [f64; 3],
    /// Correlation time of the wander, s; default 100.
    pub wander_tau_s: [f64; 3],
}

impl Default for Reference {
    fn default() -> Self {
        Self {
            rate_hz: None,
            rates: true,
            white_arcsec: [0.0; 3],
            wander_arcsec: [0.0; 3],
            wander_tau_s: [100.0; 3],
        }
    }
}

/// `[rates]`: a gyro in tracker axes.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gyro {
    /// Samples per second; default that of the frames.
    pub rate_hz: Option<f64>,
    /// White error of each sample, 1 sigma per axis, arcsec/s; default 0.
    pub white_arcsec_s: [f64; 3],
    /// Constant bias, arcsec/s; default 0.
    pub bias_arcsec_s: [f64; 3],
}

/// Coloured error about the three axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wander {
    pub(crate) sigma_arcsec: [f64; 3],
    pub(crate) tau_s: [f64; 3],
}

impl Reference {
    /// The reference at `t_s`; samples outside the truth are left out. `others` are wanders that
    /// effects add.
    pub(crate) fn table<R: Rng + ?Sized>(
        &self,
        truth: &AttitudeSeries,
        t_s: &[f64],
        others: &[Wander],
        rng: &mut R,
    ) -> Result<ReferenceTable, ScenarioError> {
        let own = Wander {
            sigma_arcsec: self.wander_arcsec,
            tau_s: self.wander_tau_s,
        };
        for axis in 0..3 {
            ScenarioError::check_not_negative("reference.white_arcsec", self.white_arcsec[axis])?;
            ScenarioError::check_not_negative("reference.wander_arcsec", own.sigma_arcsec[axis])?;
            ScenarioError::check_positive("reference.wander_tau_s", own.tau_s[axis])?;
        }
        let wanders: Vec<Wander> = core::iter::once(own)
            .chain(others.iter().copied())
            .collect();
        let mut error = vec![Vector3::<f64>::zeros(); t_s.len()];
        for wander in &wanders {
            wander.add(t_s, rng, &mut error);
        }
        for error in &mut error {
            *error += Vector3::from_fn(|axis, _| self.white_arcsec[axis] * normal(rng));
        }
        let mut table = ReferenceTable::default();
        let mut rates = Vec::new();
        for (&t, error) in t_s.iter().zip(&error) {
            let (Some(q), Some(rate)) = (truth.attitude(t), truth.rate_rad_s(t)) else {
                continue;
            };
            let e = error.map(|arcsec| Angle::from_arcsec(arcsec).rad());
            table.t_s.push(t);
            table.q.push(rotation_from_vector(&e) * q);
            rates.push(rate);
        }
        // only what it declares of itself: nobody tells a filter about the wander of an effect
        let sigma = [0, 1, 2].map(|axis| self.white_arcsec[axis].hypot(self.wander_arcsec[axis]));
        if sigma.iter().any(|sigma| *sigma > 0.0) {
            table.sigma_arcsec = Some(vec![sigma; table.t_s.len()]);
        }
        table.rates_rad_s = self.rates.then_some(rates);
        Ok(table)
    }
}

impl Wander {
    fn add<R: Rng + ?Sized>(&self, t_s: &[f64], rng: &mut R, error_arcsec: &mut [Vector3<f64>]) {
        if self.sigma_arcsec.iter().all(|sigma| *sigma <= 0.0) {
            return;
        }
        let mut state = Vector3::from_fn(|_, _| normal(rng));
        for (k, error) in error_arcsec.iter_mut().enumerate() {
            if k > 0 {
                let dt_s = t_s[k] - t_s[k - 1];
                state = Vector3::from_fn(|axis, _| {
                    let x = dt_s / self.tau_s[axis];
                    // sqrt(1 - e^-2x) by exp_m1: exact for steps short against tau
                    (-x).exp() * state[axis] + (-(-2.0 * x).exp_m1()).sqrt() * normal(rng)
                });
            }
            *error += Vector3::from(self.sigma_arcsec).component_mul(&state);
        }
    }
}

impl Gyro {
    /// The gyro at `t_s`; samples outside the truth are left out.
    pub(crate) fn table<R: Rng + ?Sized>(
        &self,
        truth: &AttitudeSeries,
        t_s: &[f64],
        rng: &mut R,
    ) -> Result<RateTable, ScenarioError> {
        for axis in 0..3 {
            ScenarioError::check_not_negative("rates.white_arcsec_s", self.white_arcsec_s[axis])?;
            ScenarioError::check_finite("rates.bias_arcsec_s", self.bias_arcsec_s[axis])?;
        }
        let mut table = RateTable::default();
        for &t in t_s {
            let error = Vector3::from_fn(|axis, _| {
                self.bias_arcsec_s[axis] + self.white_arcsec_s[axis] * normal(rng)
            });
            let Some(rate) = truth.rate_rad_s(t) else {
                continue;
            };
            table.t_s.push(t);
            table
                .w
                .push(rate + error.map(|arcsec_s| Angle::from_arcsec(arcsec_s).rad()));
        }
        Ok(table)
    }
}

fn normal<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    StandardNormal.sample(rng)
}

#[cfg(test)]
mod tests {
    use focal_plane::rotation_vector;
    use nalgebra::UnitQuaternion;
    use star_tracker::{Purpose, stream};

    use super::*;

    /// Standard deviation and lag-one correlation of the error: relative error of the variance of an
    /// AR(1) of n samples is `sqrt(2 (1 + a^2) / (1 - a^2) / n)`.
    #[test]
    fn the_wander_has_its_sigma_and_its_correlation_time() {
        let n = 200_000_u32;
        let t_s: Vec<f64> = (0..n).map(f64::from).collect();
        let still = vec![UnitQuaternion::identity(); 2];
        let truth = AttitudeSeries::new(vec![0.0, f64::from(n)], still, None).unwrap();
        let reference = Reference {
            wander_arcsec: [2.0, 0.5, 0.0],
            wander_tau_s: [10.0, 3.0, 1.0],
            white_arcsec: [0.0, 0.0, 3.0],
            ..Reference::default()
        };
        let mut rng = stream(4, 0, Purpose::Reference);
        let table = reference.table(&truth, &t_s, &[], &mut rng).unwrap();
        let error: Vec<Vector3<f64>> = table
            .q
            .iter()
            .map(|q| rotation_vector(q, &UnitQuaternion::identity()))
            .collect();
        for (axis, (sigma, tau)) in [(2.0, 10.0), (0.5, 3.0), (3.0, 0.0)]
            .into_iter()
            .enumerate()
        {
            let e: Vec<f64> = error
                .iter()
                .map(|e| Angle::from_rad(e[axis]).arcsec())
                .collect();
            let mean_square = e.iter().map(|e| e * e).sum::<f64>() / f64::from(n);
            let a = if tau > 0.0 { f64::exp(-1.0 / tau) } else { 0.0 };
            let tolerance = 5.0 * (2.0 * (1.0 + a * a) / (1.0 - a * a) / f64::from(n)).sqrt();
            assert!(
                (mean_square / (sigma * sigma) - 1.0).abs() < tolerance,
                "axis {axis}"
            );
            let lag = e.windows(2).map(|p| p[0] * p[1]).sum::<f64>() / f64::from(n) / mean_square;
            // standard error of the lag-one correlation of an AR(1): sqrt((1 - a^2) / n)
            let tolerance = 5.0 * ((1.0 - a * a) / f64::from(n)).sqrt();
            assert!(
                (lag - a).abs() < tolerance,
                "axis {axis}: {lag} against {a}"
            );
        }
        assert_eq!(
            Vector3::from(table.sigma_arcsec.unwrap()[7]),
            Vector3::new(2.0, 0.5, 3.0)
        );
    }
}
