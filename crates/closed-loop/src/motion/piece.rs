//! The path around one frame: the polynomial through its neighbours ([`super::around`] has the formulas).
//!
//! Source: Hermite interpolation in Newton's form; errors in variables.

use focal_plane::{AttitudeSeries, AttitudeSource, rotation_from_vector, rotation_vector};
use nalgebra::{UnitQuaternion, Vector3};

use super::neighbours::{COEFFICIENTS, Place, SIDE};
use super::rates::{divide, integrated, is_finite, slope};
use super::stencil::Stencil;
use crate::gaps::GAP_STEPS;

/// Neighbours on each side with rates.
const SIDE_WITH_RATES: usize = 2;
/// Most conditions of a polynomial.
const MOST: usize = 4 * SIDE_WITH_RATES;
/// Fewest conditions: with two there is no acceleration.
const FEWEST: usize = 3;
/// Samples nearer than this many steps hold the frame's own error.
const NEAR: f64 = 0.9;

#[derive(Clone, Debug)]
pub(super) struct Piece {
    pub(super) q: UnitQuaternion<f64>,
    /// Back to there from where the path is at the frame's own time.
    pub(super) back: UnitQuaternion<f64>,
    /// Times of the neighbours from the frame's, and Newton's coefficients; none where the path is not
    /// known.
    nodes: [f64; MOST],
    pub(super) newton: [Vector3<f64>; MOST],
    pub(super) count: usize,
    /// How far the neighbours that it comes from reach on both sides, s.
    pub(super) own_s: f64,
}

impl Piece {
    pub(super) fn new(
        series: &AttitudeSeries,
        step: f64,
        t_s: f64,
        stencil: Option<&Stencil>,
    ) -> Option<Self> {
        let held = Self {
            q: series.attitude(t_s)?,
            back: UnitQuaternion::identity(),
            nodes: [0.0; MOST],
            newton: [Vector3::zeros(); MOST],
            count: 0,
            own_s: 0.0,
        };
        Some(match stencil {
            Some(stencil) => held.beside(series, step, t_s, stencil).ready(),
            None => held,
        })
    }

    /// The path of the neighbours.
    fn beside(mut self, series: &AttitudeSeries, step: f64, t_s: f64, stencil: &Stencil) -> Self {
        let times = series.t_s();
        let samples = series.quaternions();
        let reach = series.max_gap_s().min(stencil.reach_s);
        // between samples a path is known as well as they are near
        let next = times.partition_point(|&t| t < t_s);
        let between = next > 0 && times.get(next).is_some_and(|&t| t > t_s);
        if between && times[next] - times[next - 1] > GAP_STEPS * step {
            return self;
        }
        let before = times.partition_point(|&t| t <= t_s - NEAR * step);
        let after = times.partition_point(|&t| t < t_s + NEAR * step);
        let rates = series.given_rates_rad_s();
        let (side, most) = match rates {
            Some(_) if stencil.by_rates.is_none() => (SIDE_WITH_RATES, SIDE_WITH_RATES),
            _ => (SIDE, stencil.most),
        };
        // outward on each side, as far as no hole is crossed
        let within = |last: &mut f64, i: usize| {
            let near = (times[i] - *last).abs() <= reach;
            *last = times[i];
            near.then_some(i)
        };
        let left = (0..before).rev().take(most);
        let left: Vec<usize> = left.scan(t_s, |last, i| within(last, i)).collect();
        let right = (after..times.len()).take(most);
        let right: Vec<usize> = right.scan(t_s, |last, i| within(last, i)).collect();
        let place = |i: &usize| (times[*i] - t_s, rotation_vector(&samples[*i], &self.q));
        let [near_left, near_right] = [&left, &right].map(|s| &s[..s.len().min(side)]);
        let used = [near_left, near_right].concat();
        let rates = rates.filter(|r| used.iter().all(|&i| is_finite(&r[i])));
        let both_sides = match (near_left.last(), near_right.last()) {
            (Some(&first), Some(&last)) => (times[last] - t_s).min(t_s - times[first]),
            _ => 0.0,
        };
        if let (Some(rates), Some(bias)) = (rates, stencil.by_rates) {
            let slopes: Vec<Place> = used
                .iter()
                .map(|i| (place(i).0, slope(&place(i).1, &(rates[*i] - bias))))
                .collect();
            if slopes.len() + 1 >= FEWEST {
                self.newton[1..=COEFFICIENTS].copy_from_slice(&integrated(&slopes));
                self.count = slopes.len() + 1;
                self.own_s = both_sides;
            }
            return self;
        }
        if most > SIDE {
            let [left, right] = [&left, &right].map(|s| s.iter().map(place).collect::<Vec<_>>());
            if let Some((m, powers)) = stencil.widest(&left, &right) {
                self.newton[..powers.len()].copy_from_slice(&powers);
                self.count = powers.len();
                self.own_s = right[m - 1].0.min(-left[m - 1].0);
                return self;
            }
        }
        let repeats = if rates.is_some() { 2 } else { 1 };
        let count = repeats * used.len();
        if count < FEWEST {
            return self;
        }
        let (nodes, newton) = (&mut self.nodes, &mut self.newton);
        let mut slopes = [Vector3::zeros(); MOST];
        for (j, &i) in used.iter().enumerate() {
            let (s, phi) = place(&i);
            for at in repeats * j..repeats * (j + 1) {
                nodes[at] = s;
                newton[at] = phi;
                slopes[at] = rates.map_or_else(Vector3::zeros, |rates| slope(&phi, &rates[i]));
            }
        }
        divide(&nodes[..count], newton, &slopes);
        self.count = count;
        self.own_s = both_sides;
        self
    }

    fn ready(mut self) -> Self {
        self.back = rotation_from_vector(&self.value(0.0)).inverse();
        self
    }

    /// Leaves the attitude alone.
    pub(super) fn forget(&mut self) {
        (self.count, self.own_s) = (0, 0.0);
        self.back = UnitQuaternion::identity();
    }

    /// How far its path may be asked.
    pub(super) fn reach_s(&self, step: f64) -> f64 {
        if self.count > 0 { step } else { 0.0 }
    }

    pub(super) fn value(&self, s: f64) -> Vector3<f64> {
        let mut value = Vector3::zeros();
        for j in (0..self.count).rev() {
            value = value * (s - self.nodes[j]) + self.newton[j];
        }
        value
    }

    pub(super) fn slope(&self, s: f64) -> Vector3<f64> {
        let (mut value, mut slope) = (Vector3::zeros(), Vector3::zeros());
        for j in (0..self.count).rev() {
            let d = s - self.nodes[j];
            slope = slope * d + value;
            value = value * d + self.newton[j];
        }
        slope
    }
}
