//! Whether measured rates tell the motion better than the attitudes beside them, and what they are off by.
//!
//! From each sample to the next the attitudes turn by `phi`, and the polynomial through the four rates around
//! by its integral; of rates with a bias b, from attitudes with white noise s,
//!
//! ```text
//! d = phi + int omega = h b + noise      b = sum d / sum h      median of (d - h b)^2 ~ 0.455 * 2 s^2
//! ```
//!
//! The sum holds the noise of the first and the last sample alone. Rates tell more where, by how well three
//! neighbours on each side predict a sample, their noise w over a step is well below that of the attitudes, and no
//! axis is worse,
//!
//! ```text
//! mean over axes of ln( w^2 h^2 / s^2 ) < ln 0.1      w h < s
//! ```
//!
//! where they are known nearly everywhere, and where they are rates of these attitudes: d scatters by no more than
//! the attitudes' noise makes it (2 s^2; 2.6 s^2 of a random walk). A gyro that is dead, turned about or too coarse
//! fails there; so do exact attitudes, whose own polynomial is better than that of four rates.
//!
//! Source: moments of differences of white noise; Simpson's and Newton's quadrature by the polynomial itself.

use focal_plane::{AttitudeSeries, rotation_vector};
use nalgebra::Vector3;
use spectra::robust::{self, median_step};

use super::neighbours::{COEFFICIENTS, MEDIAN, Place, SIDE, errors, predicted};
use crate::gaps::longest_step;

/// Share of the attitudes' variance below which that of a step of the rates is well below.
const BETTER: f64 = 0.1;
/// Share of the rows that have rates.
const KNOWN: f64 = 0.9;
/// Variance of d over that of the attitudes' noise.
const AGREES: f64 = 6.0;

/// The bias of the measured rates of a series, rad/s, where they tell more than its attitudes, which are predicted
/// with these squared errors ([`super::neighbours::of_samples`]).
pub(crate) fn that_tell_more(series: &AttitudeSeries, own: &Vector3<f64>) -> Option<Vector3<f64>> {
    let rates = series.given_rates_rad_s()?;
    let step = median_step(series.t_s())?;
    let known = rates.iter().filter(|w| is_finite(w)).count();
    if (known as f64) < KNOWN * rates.len() as f64 {
        return None;
    }
    let measured = errors(series, SIDE, |i, k| (rates[i] - rates[k]) * step);
    let share = measured.component_div(own);
    if !(share.max() < 1.0 && share.map(f64::ln).mean() < BETTER.ln()) {
        return None;
    }
    let (bias, scatter) = disagreement(series, rates)?;
    let most = own * (AGREES / predicted(SIDE));
    (0..3)
        .all(|axis| scatter[axis] <= most[axis])
        .then_some(bias)
}

/// The bias, rad/s, and the variance of d beside it, rad^2.
fn disagreement(
    series: &AttitudeSeries,
    rates: &[Vector3<f64>],
) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let (t_s, q) = (series.t_s(), series.quaternions());
    let longest = longest_step(t_s);
    let inner = 1..t_s.len().saturating_sub(2);
    let mut off: Vec<(f64, Vector3<f64>)> = Vec::new();
    for k in inner {
        let around = k - 1..k + 3;
        let hole = t_s[around.clone()]
            .windows(2)
            .any(|t| t[1] - t[0] > longest);
        if hole || !rates[around.clone()].iter().all(is_finite) {
            continue;
        }
        let slopes = [k - 1, k, k + 1, k + 2].map(|i| {
            let phi = rotation_vector(&q[i], &q[k]);
            (t_s[i] - t_s[k], slope(&phi, &rates[i]))
        });
        let step = t_s[k + 1] - t_s[k];
        let turned = integrated(&slopes)
            .iter()
            .rev()
            .fold(Vector3::zeros(), |sum, c| (sum + c) * step);
        off.push((step, rotation_vector(&q[k + 1], &q[k]) - turned));
    }
    let sum: Vector3<f64> = off.iter().map(|(_, d)| d).sum();
    let bias = sum / off.iter().map(|(step, _)| step).sum::<f64>();
    let square = |axis: usize| {
        let squares = off
            .iter()
            .map(|(step, d)| (d[axis] - step * bias[axis]).powi(2));
        robust::median(&mut squares.collect::<Vec<f64>>())
    };
    let squares = Vector3::new(square(0)?, square(1)?, square(2)?);
    Some((bias, squares / MEDIAN))
}

/// Whether all of a rate is known.
pub(crate) fn is_finite(rate: &Vector3<f64>) -> bool {
    rate.iter().all(|w| w.is_finite())
}

/// What a path that has turned by `phi` changes by at a rate: `-J_l^-1(phi) omega`, for the rotations of a few steps.
pub(crate) fn slope(phi: &Vector3<f64>, rate: &Vector3<f64>) -> Vector3<f64> {
    let turned = phi.cross(rate);
    turned * 0.5 - rate - phi.cross(&turned) / 12.0
}

/// What the polynomial through slopes, no more than [`COEFFICIENTS`], integrates to from 0 on: coefficients of its
/// powers, from the first; as many as there are slopes, and zeros.
pub(crate) fn integrated(slopes: &[Place]) -> [Vector3<f64>; COEFFICIENTS] {
    let mut nodes = [0.0; COEFFICIENTS];
    let mut newton = [Vector3::zeros(); COEFFICIENTS];
    for (j, (s, slope)) in slopes.iter().enumerate() {
        (nodes[j], newton[j]) = (*s, *slope);
    }
    divide(&nodes[..slopes.len()], &mut newton, &[]);
    // Horner's scheme on the powers
    let mut powers = [Vector3::zeros(); COEFFICIENTS];
    for j in (0..slopes.len()).rev() {
        for k in (0..slopes.len() - 1).rev() {
            let lower = powers[k];
            powers[k + 1] = lower - powers[k + 1] * nodes[j];
        }
        powers[0] = newton[j] - powers[0] * nodes[j];
    }
    for (k, c) in powers.iter_mut().enumerate() {
        *c /= (k + 1) as f64;
    }
    powers
}

/// Newton's coefficients from the values at `nodes`, in place. Of a node that is there twice the difference
/// quotient is its slope.
pub(crate) fn divide(nodes: &[f64], values: &mut [Vector3<f64>], slopes: &[Vector3<f64>]) {
    for order in 1..nodes.len() {
        for j in (order..nodes.len()).rev() {
            let apart = nodes[j] - nodes[j - order];
            values[j] = if apart == 0.0 {
                slopes[j]
            } else {
                (values[j] - values[j - 1]) / apart
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::neighbours::of_samples;
    use focal_plane::rotation_from_vector;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const STEP: f64 = 0.5;
    const ROWS: usize = 800;

    /// 2 s - 3 s^3 + s^6, by its slopes at six places that are not evenly spaced.
    #[test]
    fn slopes_integrate_to_their_polynomial() {
        let slope = |s: f64| Vector3::x() * (2.0 - 9.0 * s.powi(2) + 6.0 * s.powi(5));
        let places = [-1.1, -0.6, -0.25, 0.3, 0.5, 1.2].map(|s| (s, slope(s)));
        let powers: Vec<f64> = integrated(&places).iter().map(|c| c.x).collect();
        for (got, want) in powers.iter().zip([2.0, 0.0, -3.0, 0.0, 0.0, 1.0]) {
            assert!((got - want).abs() < 1e-12, "{powers:?}");
        }
    }

    /// Swings about three axes, 36 samples a period, with noise of `white` or a walk of `walk` a step; the rate is given
    /// with noise of 1e-8, changed by `change`.
    fn told(
        white: f64,
        walk: f64,
        change: impl Fn(usize, Vector3<f64>) -> Vector3<f64>,
    ) -> Option<Vector3<f64>> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
        let mut normal =
            || -> Vector3<f64> { Vector3::from_fn(|_, _| StandardNormal.sample(&mut rng)) };
        let omega = std::f64::consts::TAU / 36.0 / STEP;
        let about = Vector3::new(1.0, -0.7, 0.4) * 1e-3;
        let mut off = Vector3::zeros();
        let (mut t_s, mut q, mut rates) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..ROWS {
            let t = STEP * k as f64;
            off += normal() * walk;
            let phi = about * (omega * t).sin() + off + normal() * white;
            let rate = -about * omega * (omega * t).cos() + normal() * 1e-8;
            t_s.push(t);
            q.push(rotation_from_vector(&phi));
            rates.push(change(k, rate));
        }
        let series = AttitudeSeries::new(t_s, q, Some(rates)).unwrap();
        that_tell_more(&series, &of_samples(&series, SIDE))
    }

    /// What they are off by is known within the noise of two samples over 400 s, 3.5e-9 and that of 800 rates, 3.5e-10,
    /// or within a walk of 797 steps, 7e-8: four of it.
    #[test]
    fn rates_of_these_attitudes_tell_more_but_for_their_bias() {
        let bias = Vector3::new(5e-5, -2e-4, 0.0);
        for (white, walk, sigma) in [(1e-6, 0.0, 3.6e-9), (0.0, 1e-6, 7e-8)] {
            let got = told(white, walk, |_, w| w + bias).expect("they tell more");
            assert!((got - bias).abs().max() < 4.0 * sigma, "{got}");
        }
    }

    #[test]
    fn other_rates_tell_nothing() {
        let nothing = |change: &dyn Fn(usize, Vector3<f64>) -> Vector3<f64>| {
            assert_eq!(told(1e-6, 0.0, change), None);
        };
        nothing(&|_, _| Vector3::zeros());
        nothing(&|_, w| -w);
        // one axis is stuck
        nothing(&|_, w| Vector3::new(w.x, w.y, 0.0));
        // steps of 1e-4 rad/s; motion of 3.5e-4 and less
        nothing(&|_, w| (w * 1e4).map(f64::round) * 1e-4);
        // noisier than the samples about one axis
        nothing(&|k, w| w + Vector3::x() * 4e-6 * if k % 2 == 0 { 1.0 } else { -1.0 });
        // a fifth is not known
        nothing(&|k, w| {
            if k < ROWS / 5 {
                Vector3::repeat(f64::NAN)
            } else {
                w
            }
        });
        // exact samples, whose own path is better
        assert_eq!(told(0.0, 0.0, |_, w| w), None);
    }
}
