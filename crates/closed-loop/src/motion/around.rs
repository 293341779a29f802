//! The motion around each frame as the *other* samples tell it.
//!
//! A residual against a reference holds that reference's error `e_k` at the frame's
//! time. A path through the sample itself holds it too: its acceleration is
//! `-2 e_k/h^2` and more, and a smear "explains" the reference's white noise. So
//! around a frame the path is the polynomial through the neighbours alone, three
//! on each side that lie at least one step away, or two with their measured rates:
//!
//! ```text
//! q(t_k + s) = exp( p_k(s) ) q_k      p_k(s_i) = log(q_i q_k^-1) = phi_i,  |s_i| >= 0.9 h
//!                                     p_k'(s_i) = -J_l^-1(phi_i) omega_i
//! J_l^-1(phi) v = v - phi x v / 2 + phi x (phi x v) / 12 - ...
//! ```
//!
//! For a swing of frequency f the acceleration is off by about (2 pi f h)^4 / 4 of
//! itself: 0.4 % at 18 samples a period.
//!
//! Source: Hermite interpolation in Newton's form; errors in variables.

use focal_plane::{AttitudeSeries, AttitudeSource, rotation_from_vector, rotation_vector};
use nalgebra::{UnitQuaternion, Vector3};
use spectra::robust::median_step;

/// Neighbours on each side, without and with rates.
const SIDE: usize = 3;
const SIDE_WITH_RATES: usize = 2;
/// Most conditions of a polynomial.
const MOST: usize = 4 * SIDE_WITH_RATES;
/// Fewest on each side.
const FEWEST: usize = 2;
/// Samples nearer than this many steps hold the frame's own error.
const NEAR: f64 = 0.9;
/// No frame.
const NOWHERE: usize = usize::MAX;

/// The motion around a list of times.
#[derive(Clone, Debug)]
pub(crate) struct Around {
    t_s: Vec<f64>,
    pieces: Vec<Option<Piece>>,
    /// How far from its time a piece may be asked, s.
    reach_s: f64,
}

#[derive(Clone, Debug)]
struct Piece {
    q: UnitQuaternion<f64>,
    /// Times of the neighbours from the frame's, and Newton's coefficients.
    nodes: [f64; MOST],
    newton: [Vector3<f64>; MOST],
    count: usize,
}

impl Around {
    /// The motion of `series` around times in ascending order.
    pub(crate) fn new(series: &AttitudeSeries, t_s: &[f64]) -> Self {
        let step = median_step(series.t_s()).unwrap_or(f64::INFINITY);
        let pieces = t_s.iter().map(|&t| Piece::new(series, step, t)).collect();
        Self {
            t_s: t_s.to_vec(),
            pieces,
            reach_s: step,
        }
    }

    /// The frame nearest to a time, looked for around `hint` first.
    fn nearest(&self, t_s: f64, hint: usize) -> Option<usize> {
        let distance = |k: usize| self.t_s.get(k).map_or(f64::INFINITY, |t| (t - t_s).abs());
        let before = |k: usize| k.checked_sub(1).map_or(f64::INFINITY, distance);
        let here = distance(hint);
        if here < before(hint) && here <= distance(hint.saturating_add(1)) {
            return Some(hint);
        }
        let after = self.t_s.partition_point(|&t| t < t_s);
        (after.saturating_sub(1)..=after)
            .filter(|&k| k < self.t_s.len())
            .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
    }

    fn piece(&self, t_s: f64, hint: &mut usize) -> Option<(&Piece, f64)> {
        *hint = self.nearest(t_s, *hint)?;
        let s = t_s - self.t_s[*hint];
        let piece = self.pieces[*hint].as_ref()?;
        (s.abs() <= self.reach_s).then_some((piece, s))
    }
}

impl Piece {
    fn new(series: &AttitudeSeries, step: f64, t_s: f64) -> Option<Self> {
        let q = series.attitude(t_s)?;
        let times = series.t_s();
        let samples = series.quaternions();
        let reach = series.max_gap_s().min(1.9 * step);
        let before = times.partition_point(|&t| t <= t_s - NEAR * step);
        let after = times.partition_point(|&t| t < t_s + NEAR * step);
        let rates = series.given_rates_rad_s();
        let side = if rates.is_some() {
            SIDE_WITH_RATES
        } else {
            SIDE
        };
        let mut used: Vec<usize> = Vec::with_capacity(2 * side);
        // outward on each side, as far as no hole is crossed
        let mut last = t_s;
        for i in (0..before).rev().take(side) {
            if last - times[i] > reach {
                break;
            }
            last = times[i];
            used.push(i);
        }
        let left = used.len();
        last = t_s;
        for (i, &t) in times.iter().enumerate().skip(after).take(side) {
            if t - last > reach {
                break;
            }
            last = t;
            used.push(i);
        }
        if left < FEWEST || used.len() - left < FEWEST {
            return None;
        }
        let rates = rates.filter(|r| used.iter().all(|&i| r[i].iter().all(|w| w.is_finite())));
        let repeats = if rates.is_some() { 2 } else { 1 };
        let count = repeats * used.len();
        let mut nodes = [0.0; MOST];
        let mut newton = [Vector3::zeros(); MOST];
        let mut slope = [Vector3::zeros(); MOST];
        for (j, &i) in used.iter().enumerate() {
            let phi = rotation_vector(&samples[i], &q);
            for at in repeats * j..repeats * (j + 1) {
                nodes[at] = times[i] - t_s;
                newton[at] = phi;
                slope[at] = rates.map_or_else(Vector3::zeros, |rates| -unrolled(&phi, &rates[i]));
            }
        }
        for order in 1..count {
            for j in (order..count).rev() {
                let apart = nodes[j] - nodes[j - order];
                // a node that is there twice: the difference quotient is the slope
                newton[j] = if order == 1 && j % repeats == 1 {
                    slope[j]
                } else {
                    (newton[j] - newton[j - 1]) / apart
                };
            }
        }
        Some(Self {
            q,
            nodes,
            newton,
            count,
        })
    }

    fn value(&self, s: f64) -> Vector3<f64> {
        let mut value = Vector3::zeros();
        for j in (0..self.count).rev() {
            value = value * (s - self.nodes[j]) + self.newton[j];
        }
        value
    }

    fn slope(&self, s: f64) -> Vector3<f64> {
        let (mut value, mut slope) = (Vector3::zeros(), Vector3::zeros());
        for j in (0..self.count).rev() {
            let d = s - self.nodes[j];
            slope = slope * d + value;
            value = value * d + self.newton[j];
        }
        slope
    }
}

/// `J_l^-1(phi) v` for the rotations of a few steps.
fn unrolled(phi: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    let turned = phi.cross(v);
    v - turned * 0.5 + phi.cross(&turned) / 12.0
}

impl AttitudeSource for Around {
    fn attitude(&self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        let mut nowhere = NOWHERE;
        self.attitude_near(t_s, &mut nowhere)
    }

    fn attitude_near(&self, t_s: f64, hint: &mut usize) -> Option<UnitQuaternion<f64>> {
        let (piece, s) = self.piece(t_s, hint)?;
        Some(rotation_from_vector(&piece.value(s)) * piece.q)
    }

    /// To first order in the rotation from the frame's attitude.
    fn rate_rad_s(&self, t_s: f64) -> Option<Vector3<f64>> {
        let mut nowhere = NOWHERE;
        let (piece, s) = self.piece(t_s, &mut nowhere)?;
        // v' = -omega x v for vectors seen from the tracker
        Some(-piece.slope(s))
    }

    fn span_s(&self) -> [f64; 2] {
        match (self.t_s.first(), self.t_s.last()) {
            (Some(a), Some(b)) => [*a, *b],
            _ => [f64::NAN; 2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const STEP: f64 = 0.5;

    fn series(path: impl Fn(f64) -> Vector3<f64>, n: usize) -> AttitudeSeries {
        let t_s: Vec<f64> = (0..n).map(|k| STEP * k as f64).collect();
        let q = t_s
            .iter()
            .map(|&t| rotation_from_vector(&path(t)))
            .collect();
        AttitudeSeries::new(t_s, q, None).unwrap()
    }

    /// Acceleration of the path from its mean over an exposure: 24 (mean)/T^2.
    fn acceleration(motion: &dyn AttitudeSource, t: f64) -> Vector3<f64> {
        let h = 0.1;
        let [a, b, c] = [-h, 0.0, h].map(|d| motion.attitude(t + d).unwrap());
        (rotation_vector(&a, &b) + rotation_vector(&c, &b)) / (h * h)
    }

    /// 2 pi f h = 0.35: sixth order leaves (0.35)^4 49/180 = 0.4 % of the acceleration.
    #[test]
    fn a_swing_is_followed() {
        let omega = std::f64::consts::TAU * 0.11;
        let motion = series(|t| Vector3::x() * 1e-3 * (omega * t).sin(), 200);
        let t_s: Vec<f64> = (10..190).map(|k| STEP * f64::from(k)).collect();
        let around = Around::new(&motion, &t_s);
        for &t in &t_s {
            let got = acceleration(&around, t).x;
            let true_one = -1e-3 * omega * omega * (omega * t).sin();
            assert!((got - true_one).abs() < 0.006 * 1e-3 * omega * omega, "{t}");
            let rate = around.rate_rad_s(t).unwrap();
            let given = motion.rate_rad_s(t).unwrap();
            assert!(
                (rate - given).norm() < 0.03 * 1e-3 * omega,
                "{rate} {given}"
            );
        }
    }

    /// With rates, which rotate on the way (0.1 rad/s): as good, from fewer neighbours.
    #[test]
    fn a_swing_is_followed_with_rates() {
        let omega = std::f64::consts::TAU * 0.11;
        let turn = rotation_from_vector(&(Vector3::z() * 0.1 * STEP));
        let t_s: Vec<f64> = (0..200).map(|k| STEP * f64::from(k)).collect();
        let mut base = UnitQuaternion::identity();
        let (mut q, mut rates) = (Vec::new(), Vec::new());
        for &t in &t_s {
            let swing = rotation_from_vector(&(Vector3::x() * 1e-3 * (omega * t).sin()));
            q.push(swing * base);
            let slope =
                Vector3::x() * 1e-3 * omega * (omega * t).cos() + swing * (Vector3::z() * 0.1);
            rates.push(-slope);
            base = turn * base;
        }
        let motion = AttitudeSeries::new(t_s.clone(), q, Some(rates)).unwrap();
        let around = Around::new(&motion, &t_s);
        for &t in &t_s[10..190] {
            let got = acceleration(&around, t).x;
            let true_one = -1e-3 * omega * omega * (omega * t).sin();
            assert!(
                (got - true_one).abs() < 0.006 * 1e-3 * omega * omega,
                "{t}: {got} {true_one}"
            );
        }
    }

    fn nearest(t: f64) -> usize {
        (0..4000)
            .min_by(|&a, &b| {
                let off = |k: u32| (t - STEP * f64::from(k)).abs();
                off(a).total_cmp(&off(b))
            })
            .unwrap_or_default() as usize
    }

    /// White noise of the samples: acceleration and own error are uncorrelated
    /// here (5/sqrt(n)), and strongly correlated for a path through the sample.
    #[test]
    fn the_own_error_stays_out() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
        let noise: Vec<f64> = (0..4000).map(|_| StandardNormal.sample(&mut rng)).collect();
        let motion = series(|t| Vector3::y() * 1e-6 * noise[nearest(t)], 4000);
        let t_s: Vec<f64> = (10..3990).map(|k| STEP * f64::from(k)).collect();
        let around = Around::new(&motion, &t_s);
        let correlation = |motion: &dyn AttitudeSource| {
            let (mut ae, mut aa, mut ee) = (0.0, 0.0, 0.0);
            for &t in &t_s {
                let a = acceleration(motion, t).y;
                let e = noise[nearest(t)];
                ae += a * e;
                aa += a * a;
                ee += e * e;
            }
            ae / (aa * ee).sqrt()
        };
        assert!(correlation(&around).abs() < 5.0 / (t_s.len() as f64).sqrt());
        assert!(correlation(&motion) < -0.3);
    }

    /// A hole leaves too few neighbours on one side.
    #[test]
    fn holes_are_not_crossed() {
        let t_s = vec![0.0, 0.5, 1.0, 1.5, 2.0, 9.0, 9.5, 10.0, 10.5, 11.0];
        let q = t_s
            .iter()
            .map(|&t| rotation_from_vector(&(Vector3::z() * 1e-3 * t)))
            .collect();
        let motion = AttitudeSeries::new(t_s.clone(), q, None).unwrap();
        let around = Around::new(&motion, &t_s);
        assert!(around.attitude(1.0).is_some());
        assert!(around.attitude(2.0).is_none());
        assert!(around.attitude(9.0).is_none());
    }
}
