//! The strongest line that is left about the body's axes.
//!
//! ```text
//! power(f) = sum_axis |sum_k e_k exp(-2 pi i f t_k)|^2 / sigma_axis^2
//! ```
//!
//! on a grid four times finer than the span resolves, up to the Nyquist frequency of the median step or
//! twenty times the spin, whichever is lower: booms are slow.
//!
//! Source: the periodogram of unevenly sampled data, Lomb, Astrophysics and Space Science 39 (1976) 447,
//! without its phase: the fit that follows finds amplitude and phase.

use nalgebra::Vector3;

use crate::model::{Fit, Fitter};

/// Multiples of the spin rate up to which oscillations are looked for.
const FASTEST: f64 = 20.0;

/// Frequency, Hz, and how many independent ones were tried; `None` if the span is too short.
pub(super) fn strongest_line(fitter: &Fitter<'_>, last: &Fit) -> Option<(f64, f64)> {
    let observed = fitter.observed();
    let span_s = 2.0 * fitter.half_s();
    let resolution_hz = 1.0 / span_s;
    let spin_hz = last.model.body.rate_rad_s.norm() / core::f64::consts::TAU;
    let top_hz = (0.5 / observed.step_s).min(FASTEST * spin_hz);
    let step_hz = 0.25 * resolution_hz;
    if top_hz < 2.0 * resolution_hz {
        return None;
    }
    let to_body = last.model.to_body;
    let sigma = fitter.sigma_arcsec();
    // noise about body axes is that of the tracker's, turned
    let rows = to_body.to_rotation_matrix();
    let variance = Vector3::from_fn(|i, _| {
        (0..3)
            .map(|j| (rows[(i, j)] * sigma[j]).powi(2))
            .sum::<f64>()
    });
    let n = observed.len();
    let mut e: Vec<Vector3<f64>> = (0..n)
        .map(|k| to_body * Vector3::from_fn(|axis, _| last.residual_arcsec[axis][k]))
        .collect();
    let mean = e.iter().sum::<Vector3<f64>>() / n as f64;
    for e in &mut e {
        for axis in 0..3 {
            e[axis] = (e[axis] - mean[axis]) / variance[axis].sqrt();
        }
    }
    let tau: Vec<f64> = observed.t_s.iter().map(|t| t - fitter.epoch_s()).collect();
    // one turn of each frame's phasor per step of the grid
    let turn: Vec<[f64; 2]> = tau
        .iter()
        .map(|t| (core::f64::consts::TAU * step_hz * t).sin_cos().into())
        .collect();
    let first = 4.0;
    let mut phasor: Vec<[f64; 2]> = tau
        .iter()
        .map(|t| {
            (core::f64::consts::TAU * first * step_hz * t)
                .sin_cos()
                .into()
        })
        .collect();
    let (mut best, mut at_hz, mut k) = (0.0, 0.0, first);
    while k * step_hz <= top_hz {
        let (mut re, mut im) = (Vector3::zeros(), Vector3::zeros());
        for (p, e) in phasor.iter().zip(&e) {
            re += e * p[1];
            im += e * p[0];
        }
        let power = re.norm_squared() + im.norm_squared();
        if power > best {
            (best, at_hz) = (power, k * step_hz);
        }
        for (p, d) in phasor.iter_mut().zip(&turn) {
            let [s, c] = *p;
            *p = [s * d[1] + c * d[0], c * d[1] - s * d[0]];
        }
        k += 1.0;
    }
    (at_hz > 0.0).then(|| (at_hz, top_hz / resolution_hz))
}
