//! The better estimate, and the gyro: the truth with an error of its own.
//!
//! ```text
//! q_ref = exp(C e) q_true,   e = white + wander,   axes of the reference
//! wander[k+1] = a wander[k] + sqrt(1 - a^2) sigma n,   a = exp(-dt/tau)
//! ```
//!
//! C turns the axes of the reference, which are the tracker's turned about `cant_axis` by `cant_deg`,
//! into the tracker's: a second sensor has an uncertainty of its own shape. What the bundle holds is
//! the tracker's attitude by that reference, in tracker axes.
//!
//! The wander is a stationary first-order Gauss-Markov process per axis, exact at any step. Rates that
//! go with the reference are true: a filter's rate error is a thing of the gyro.
//!
//! Source: [M23] Eq. 15 (first-order Gauss-Markov process); Section 4.3.1 for the second sensor; the
//! attitude errors of filters as white plus coloured are an assumption of the scenario that uses them.

use focal_plane::{Angle, AttitudeSeries, AttitudeSource, rotation_from_vector};
use nalgebra::{Matrix3, Vector3};
use rand_core::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Deserialize;
use telemetry::{RateTable, ReferenceTable};

use crate::ScenarioError;
use crate::motion::phase_plane::{cant, y_axis};

/// `[reference]`: perfect unless errors are given.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Reference {
    /// Samples per second; default that of the frames.
    pub rate_hz: Option<f64>,
    /// Whether it comes with rates; default yes.
    pub rates: bool,
    /// Axis about which the reference is turned against the tracker; its length does not matter;
    /// default y.
    pub cant_axis: [f64; 3],
    /// Angle of that turn, deg; default 0.
    pub cant_deg: f64,
    /// White error of each sample, 1 sigma about each axis of the reference, arcsec; default 0.
    pub white_arcsec: [f64; 3],
    /// Standard deviation of the wander about each axis of the reference, arcsec; default 0.
    pub wander_arcsec: [f64; 3],
    /// Correlation time of the wander, s; default 100.
    pub wander_tau_s: [f64; 3],
}

impl Default for Reference {
    fn default() -> Self {
        Self {
            rate_hz: None,
            rates: true,
            cant_axis: y_axis(),
            cant_deg: 0.0,
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
        let names = ["reference.cant_axis", "reference.cant_deg"];
        let to_tracker = cant(names, self.cant_axis, self.cant_deg)?;
        let mut error = vec![Vector3::<f64>::zeros(); t_s.len()];
        own.add(t_s, rng, &mut error);
        // effects act in tracker axes
        let mut foreign = vec![Vector3::<f64>::zeros(); t_s.len()];
        for wander in others {
            wander.add(t_s, rng, &mut foreign);
        }
        for (error, foreign) in error.iter_mut().zip(&foreign) {
            *error += Vector3::from_fn(|axis, _| self.white_arcsec[axis] * normal(rng));
            *error = to_tracker * *error + foreign;
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
        let own = Vector3::from_fn(|axis, _| {
            self.white_arcsec[axis].powi(2) + self.wander_arcsec[axis].powi(2)
        });
        let covariance = to_tracker * Matrix3::from_diagonal(&own) * to_tracker.inverse();
        let sigma = [0, 1, 2].map(|axis| covariance[(axis, axis)].sqrt());
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
        let declared = Vector3::from(table.sigma_arcsec.unwrap()[7]);
        // a square and its root: rounding
        assert!((declared - Vector3::new(2.0, 0.5, 3.0)).norm() < 1e-12);
    }

    /// [M23] Section 4.3.1: (1.5, 1.5, 124) arcsec, 3 sigma, about the axes of a camera canted by 15 deg
    /// are (32, 1.5, 120) about those of the tracker, to the digits printed; and the errors themselves
    /// have these deviations: 5 sqrt(1 / 2n) of n white samples.
    #[test]
    fn a_canted_reference_has_its_uncertainty_in_its_own_axes() {
        let n = 20_000_u32;
        let t_s: Vec<f64> = (0..n).map(f64::from).collect();
        let still = vec![UnitQuaternion::identity(); 2];
        let truth = AttitudeSeries::new(vec![0.0, f64::from(n)], still, None).unwrap();
        let draco = Reference {
            cant_deg: 15.0,
            white_arcsec: [0.5, 0.5, 124.0 / 3.0],
            ..Reference::default()
        };
        let mut rng = stream(4, 0, Purpose::Reference);
        let table = draco.table(&truth, &t_s, &[], &mut rng).unwrap();
        // the camera's boresight is (sin 15, 0, cos 15) in tracker axes, and its large error is about it:
        // about x and z the errors go together, by sin 15 cos 15 of (41.3^2 - 0.5^2) arcsec^2. A product of
        // two errors that are nearly the same one scatters by sqrt 2 of its mean
        let product = |q: &UnitQuaternion<f64>| {
            let e = rotation_vector(q, &UnitQuaternion::identity());
            Angle::from_rad(e.x).arcsec() * Angle::from_rad(e.z).arcsec()
        };
        let together = table.q.iter().map(product).sum::<f64>() / f64::from(n);
        let (sin, cos) = 15_f64.to_radians().sin_cos();
        let expected = sin * cos * ((124.0_f64 / 3.0).powi(2) - 0.25);
        let tolerance = 5.0 * (2.0 / f64::from(n)).sqrt();
        assert!((together / expected - 1.0).abs() < tolerance, "{together}");
        let declared = table.sigma_arcsec.unwrap()[0];
        for (axis, printed) in [32.0, 1.5, 120.0].into_iter().enumerate() {
            let half_digit = if axis == 1 { 0.05 } else { 0.5 };
            let three_sigma = 3.0 * declared[axis];
            assert!((three_sigma - printed).abs() < half_digit, "{three_sigma}");
            let square = |q: &UnitQuaternion<f64>| {
                Angle::from_rad(rotation_vector(q, &UnitQuaternion::identity())[axis])
                    .arcsec()
                    .powi(2)
            };
            let sigma = (table.q.iter().map(square).sum::<f64>() / f64::from(n)).sqrt();
            let tolerance = 5.0 * (0.5 / f64::from(n)).sqrt();
            assert!(
                (sigma / declared[axis] - 1.0).abs() < tolerance,
                "axis {axis}: {sigma}"
            );
        }
    }
}
