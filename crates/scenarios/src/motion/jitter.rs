//! Small motion about the commanded one: lines, and the noise of a control loop.
//!
//! ```text
//! sinusoid:     theta = amplitude sin(2 pi f t + phase)          about a given axis
//! closed loop:  theta'' + 2 zeta w0 theta' + w0^2 theta = n,     n white, per axis;  w0 = 2 pi f
//! ```
//!
//! Angles are in tracker axes and small, so that their derivatives add to the body rate. The loop's
//! angle has standard deviation sigma and, per axis, the one-sided density
//!
//! ```text
//! Phi(f') = 8 zeta w0^3 sigma^2 / ((w0^2 - w^2)^2 + (2 zeta w0 w)^2),        w = 2 pi f'
//! ```
//!
//! which peaks near the loop's frequency. Its state (theta, theta') is drawn stationary and advanced
//! without discretisation error: `x[k+1] = Phi x[k] + L n` with `Phi = exp(A h)` and
//! `L L^T = P - Phi P Phi^T`, `P = diag(sigma^2, (w0 sigma)^2)`. Between its samples theta is the cubic
//! through both states, so the rate is continuous.
//!
//! Source: the linear oscillator driven by white noise, as in any text on random vibration; [M23]
//! Section 4.1 and Fig. 6 show such a mode at the crossover of a control loop (0.036 Hz).

use focal_plane::Angle;
use nalgebra::{Matrix2, Vector2, Vector3};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Deserialize;

use super::turning::Samples;
use crate::ScenarioError;

/// One line of the jitter: `[[motion.sinusoid]]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sinusoid {
    /// Axis in the tracker; its length does not matter.
    pub axis: [f64; 3],
    /// Amplitude of the angle, arcsec.
    pub amplitude_arcsec: f64,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Phase of the sine at t = 0, deg; default 0.
    #[serde(default)]
    pub phase_deg: f64,
}

/// Noise of a control loop: `[motion.closed_loop]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClosedLoop {
    /// Standard deviation of the angle about each tracker axis, arcsec.
    pub sigma_arcsec: [f64; 3],
    /// Undamped frequency of the loop, Hz.
    pub frequency_hz: f64,
    /// Damping ratio, between 0 and 1; default 0.5.
    #[serde(default = "half")]
    pub damping: f64,
}

fn half() -> f64 {
    0.5
}

/// Rate of everything that jitters.
#[derive(Clone, Debug, Default)]
pub(crate) struct Jitter {
    lines: Vec<Line>,
    closed_loop: Option<Path>,
}

#[derive(Clone, Copy, Debug)]
struct Line {
    rate_rad_s: Vector3<f64>,
    w_rad_s: f64,
    phase_rad: f64,
}

/// Angle and rate of the loop at equal steps, drawn as they are asked for.
#[derive(Clone, Debug)]
struct Path {
    samples: Samples<[Vector3<f64>; 2]>,
    transition: Matrix2<f64>,
    factor: Matrix2<f64>,
    /// Angle and rate of each axis at the next sample, in sigmas of the angle.
    state: [Vector2<f64>; 3],
    sigma_rad: [f64; 3],
    rng: Xoshiro256PlusPlus,
}

/// Steps a period of the fastest jitter: the cubic between samples is then right to 1e-6 of the
/// amplitude, `(2 pi / 50)^4 / 384`.
const STEPS_PER_PERIOD: f64 = 50.0;

impl Jitter {
    /// The jitter from `from_s` on, and the step that resolves it (at most `step_s`).
    pub(crate) fn new(
        sinusoids: &[Sinusoid],
        closed_loop: Option<&ClosedLoop>,
        from_s: f64,
        step_s: f64,
        rng: &Xoshiro256PlusPlus,
    ) -> Result<(Self, f64), ScenarioError> {
        let mut step_s = step_s;
        let mut lines = Vec::with_capacity(sinusoids.len());
        for sinusoid in sinusoids {
            lines.push(Line::new(sinusoid)?);
            step_s = step_s.min(1.0 / (STEPS_PER_PERIOD * sinusoid.frequency_hz));
        }
        if let Some(closed_loop) = closed_loop {
            closed_loop.check()?;
            step_s = step_s.min(1.0 / (STEPS_PER_PERIOD * closed_loop.frequency_hz));
        }
        let path = closed_loop.map(|closed_loop| closed_loop.path(from_s, step_s, rng.clone()));
        Ok((
            Self {
                lines,
                closed_loop: path,
            },
            step_s,
        ))
    }

    /// Rate, rad/s, tracker axes.
    pub(crate) fn rate_rad_s(&self, t_s: f64) -> Vector3<f64> {
        let mut rate = Vector3::zeros();
        for line in &self.lines {
            rate += line.rate_rad_s * (line.w_rad_s * t_s + line.phase_rad).cos();
        }
        if let Some(path) = &self.closed_loop {
            rate += path.rate_rad_s(t_s);
        }
        rate
    }

    /// Draws the loop's noise up to this time.
    pub(crate) fn extend(&mut self, to_s: f64) {
        if let Some(path) = &mut self.closed_loop {
            path.extend(to_s);
        }
    }

    /// Lets go of what is needed before this time alone.
    pub(crate) fn forget(&mut self, before_s: f64) {
        if let Some(path) = &mut self.closed_loop {
            path.samples.forget(before_s);
        }
    }
}

impl Line {
    fn new(sinusoid: &Sinusoid) -> Result<Self, ScenarioError> {
        let axis = unit_axis("motion.sinusoid.axis", sinusoid.axis)?;
        let amplitude = sinusoid.amplitude_arcsec;
        ScenarioError::check_finite("motion.sinusoid.amplitude_arcsec", amplitude)?;
        ScenarioError::check_positive("motion.sinusoid.frequency_hz", sinusoid.frequency_hz)?;
        let phase = sinusoid.phase_deg;
        ScenarioError::check_finite("motion.sinusoid.phase_deg", phase)?;
        let w_rad_s = core::f64::consts::TAU * sinusoid.frequency_hz;
        Ok(Self {
            rate_rad_s: axis * (Angle::from_arcsec(amplitude).rad() * w_rad_s),
            w_rad_s,
            phase_rad: Angle::from_deg(phase).rad(),
        })
    }
}

/// Unit vector along an axis of a scenario file.
pub(crate) fn unit_axis(name: &'static str, axis: [f64; 3]) -> Result<Vector3<f64>, ScenarioError> {
    let axis = Vector3::from(axis);
    let norm = axis.norm();
    ScenarioError::check(
        name,
        norm,
        norm.is_finite() && norm > 0.0,
        "a vector that is not zero",
    )?;
    Ok(axis / norm)
}

impl ClosedLoop {
    fn check(&self) -> Result<(), ScenarioError> {
        for sigma in self.sigma_arcsec {
            ScenarioError::check_not_negative("motion.closed_loop.sigma_arcsec", sigma)?;
        }
        ScenarioError::check_positive("motion.closed_loop.frequency_hz", self.frequency_hz)?;
        let damped = self.damping > 0.0 && self.damping < 1.0;
        ScenarioError::check(
            "motion.closed_loop.damping",
            self.damping,
            damped,
            "between 0 and 1",
        )
    }

    fn path(&self, from_s: f64, step_s: f64, mut rng: Xoshiro256PlusPlus) -> Path {
        let w0 = core::f64::consts::TAU * self.frequency_hz;
        let transition = transition(w0, self.damping, step_s);
        let stationary = Matrix2::new(1.0, 0.0, 0.0, w0 * w0);
        let factor = cholesky(&(stationary - transition * stationary * transition.transpose()));
        let state = [(); 3].map(|()| Vector2::new(normal(&mut rng), w0 * normal(&mut rng)));
        Path {
            samples: Samples::new(from_s, step_s),
            transition,
            factor,
            state,
            sigma_rad: self
                .sigma_arcsec
                .map(|sigma| Angle::from_arcsec(sigma).rad()),
            rng,
        }
    }
}

fn normal(rng: &mut Xoshiro256PlusPlus) -> f64 {
    StandardNormal.sample(rng)
}

/// `exp(A h)` of the undriven oscillator, states angle and rate.
fn transition(w0: f64, zeta: f64, h_s: f64) -> Matrix2<f64> {
    let (decay, wd) = (zeta * w0, w0 * (1.0 - zeta * zeta).sqrt());
    let (s, c) = (wd * h_s).sin_cos();
    let e = (-decay * h_s).exp();
    Matrix2::new(
        e * (c + decay / wd * s),
        e * s / wd,
        -e * w0 * w0 / wd * s,
        e * (c - decay / wd * s),
    )
}

/// Lower factor of a positive semidefinite 2 x 2 matrix; rounding below zero counts as zero.
fn cholesky(q: &Matrix2<f64>) -> Matrix2<f64> {
    let l11 = q[(0, 0)].max(0.0).sqrt();
    let l21 = if l11 > 0.0 { q[(1, 0)] / l11 } else { 0.0 };
    Matrix2::new(l11, 0.0, l21, (q[(1, 1)] - l21 * l21).max(0.0).sqrt())
}

impl Path {
    /// One sample beyond the end, for the last cubic.
    fn extend(&mut self, to_s: f64) {
        while self.samples.end_s() < to_s + 2.0 * self.samples.step_s() {
            let (state, sigma) = (&self.state, self.sigma_rad);
            let [angle, rate] =
                [0, 1].map(|k| Vector3::from_fn(|axis, _| sigma[axis] * state[axis][k]));
            self.samples.push([angle, rate]);
            let (transition, factor) = (self.transition, self.factor);
            for state in &mut self.state {
                let noise = Vector2::new(normal(&mut self.rng), normal(&mut self.rng));
                *state = transition * *state + factor * noise;
            }
        }
    }

    /// Derivative of the cubic through the states on either side.
    fn rate_rad_s(&self, t_s: f64) -> Vector3<f64> {
        let ([angle0, v0], [angle1, v1], s) = self.samples.around(t_s);
        let rise = (angle1 - angle0) / self.samples.step_s();
        v0 + (rise * 6.0 - v0 * 4.0 - v1 * 2.0) * s + (v0 + v1 - rise * 2.0) * (3.0 * s * s)
    }
}

#[cfg(test)]
mod tests {
    use star_tracker::{Purpose, stream};

    use super::*;

    /// `d Phi / dh = A Phi`, by central differences of 1e-4 s (error `h^2/6 |A|^3`, below 1e-7 here).
    #[test]
    fn the_transition_solves_the_oscillator() {
        let (w0, zeta, h) = (2.0, 0.3, 0.7);
        let a = Matrix2::new(0.0, 1.0, -w0 * w0, -2.0 * zeta * w0);
        let slope = (transition(w0, zeta, h + 1e-4) - transition(w0, zeta, h - 1e-4)) / 2e-4;
        assert!((slope - a * transition(w0, zeta, h)).norm() < 1e-7);
    }

    /// The process is stationary: over n periods-long records the mean square of angle and rate are
    /// sigma^2 and (w0 sigma)^2. The variance estimate of a process with two-sided density S has
    /// relative error sqrt(2 B / T), B = int rho^2 over all lags = (1 + 4 zeta^2) / (4 zeta w0) x 2
    /// (angle; 1 / (2 zeta w0) for the rate), bounded here by 3 / (2 zeta w0).
    #[test]
    fn the_loop_has_its_standard_deviation_from_the_first_sample_on() {
        let given = ClosedLoop {
            sigma_arcsec: [1.0, 2.0, 5.0],
            frequency_hz: 0.036,
            damping: 0.3,
        };
        let length = 100_000.0;
        let mut path = given.path(0.0, 0.5, stream(5, 0, Purpose::Motion));
        path.extend(length);
        let samples: Vec<_> = path.samples.iter().collect();
        let w0 = core::f64::consts::TAU * 0.036;
        let tolerance = 5.0 * (2.0 * 3.0 / (2.0 * 0.3 * w0) / length).sqrt();
        let n = samples.len() as f64;
        for axis in 0..3 {
            let sigma = Angle::from_arcsec(given.sigma_arcsec[axis]).rad();
            let square = |k: usize| samples.iter().map(|v| v[k][axis].powi(2)).sum::<f64>() / n;
            let (angle, rate) = (square(0), square(1));
            assert!(
                (angle / (sigma * sigma) - 1.0).abs() < tolerance,
                "axis {axis}"
            );
            assert!(
                (rate / (w0 * sigma).powi(2) - 1.0).abs() < tolerance,
                "axis {axis}"
            );
        }
    }

    /// It starts as it goes on: over 1000 draws of three axes the first state has the same standard
    /// deviations; relative error of a variance sqrt(2/3000).
    #[test]
    fn the_loop_starts_in_its_stationary_state() {
        let given = ClosedLoop {
            sigma_arcsec: [2.0; 3],
            frequency_hz: 0.036,
            damping: 0.3,
        };
        let sigma = Angle::from_arcsec(2.0).rad();
        let w0 = core::f64::consts::TAU * 0.036;
        let (mut angle, mut rate) = (0.0, 0.0);
        for draw in 0..1000 {
            let mut path = given.path(0.0, 0.5, stream(5, draw, Purpose::Motion));
            path.extend(1.0);
            let ([first, slope], ..) = path.samples.around(0.0);
            angle += first.norm_squared() / (3000.0 * sigma * sigma);
            rate += slope.norm_squared() / (3000.0 * (w0 * sigma).powi(2));
        }
        let tolerance = 5.0 * (2.0_f64 / 3000.0).sqrt();
        assert!((angle - 1.0).abs() < tolerance, "angle {angle}");
        assert!((rate - 1.0).abs() < tolerance, "rate {rate}");
    }

    /// The rate between samples integrates to the angles at the samples: Simpson is exact for it.
    #[test]
    fn the_rate_integrates_to_the_angle() {
        let given = ClosedLoop {
            sigma_arcsec: [3.0; 3],
            frequency_hz: 0.1,
            damping: 0.5,
        };
        let mut path = given.path(-1.0, 0.2, stream(2, 0, Purpose::Motion));
        path.extend(20.0);
        let angles: Vec<_> = path.samples.iter().map(|v| v[0]).collect();
        for k in 0..100 {
            let t = -1.0 + 0.2 * k as f64;
            let simpson = (path.rate_rad_s(t + 1e-12)
                + path.rate_rad_s(t + 0.1) * 4.0
                + path.rate_rad_s(t + 0.2 - 1e-12))
                * (0.2 / 6.0);
            let rise = angles[k + 1] - angles[k];
            assert!((simpson - rise).norm() < 1e-15);
        }
    }
}
