//! A body rate as a function of time, some of it drawn at random as time goes on.
//!
//! Not physics: what the motions have in common.

use std::collections::VecDeque;

use nalgebra::Vector3;

/// A body rate, rad/s, tracker axes.
pub(crate) trait Turning: Clone + Send + 'static {
    /// The rate at a time that [`extend`](Self::extend) has reached and [`forget`](Self::forget) has
    /// left.
    fn rate_rad_s(&self, t_s: f64) -> Vector3<f64>;

    /// Longest step that follows it, s.
    fn step_s(&self) -> f64;

    /// The next time where the rate is not smooth, strictly after `from_s` or, `backwards`, before it.
    fn next_break_s(&self, from_s: f64, backwards: bool) -> Option<f64>;

    /// Draws what is random up to this time.
    fn extend(&mut self, to_s: f64);

    /// Lets go of what is needed before this time alone.
    fn forget(&mut self, before_s: f64);
}

/// The nearest of ascending times on one side.
pub(crate) fn neighbour(ascending_s: &[f64], from_s: f64, backwards: bool) -> Option<f64> {
    if backwards {
        let below = ascending_s.partition_point(|&t| t < from_s);
        below.checked_sub(1).map(|k| ascending_s[k])
    } else {
        let above = ascending_s.partition_point(|&t| t <= from_s);
        ascending_s.get(above).copied()
    }
}

/// Samples at equal steps, of which the first may have been let go.
#[derive(Clone, Debug)]
pub(crate) struct Samples<T> {
    start_s: f64,
    step_s: f64,
    /// Samples that were let go.
    gone: usize,
    kept: VecDeque<T>,
}

impl<T: Copy> Samples<T> {
    pub(crate) fn new(start_s: f64, step_s: f64) -> Self {
        Self {
            start_s,
            step_s,
            gone: 0,
            kept: VecDeque::new(),
        }
    }

    pub(crate) fn push(&mut self, sample: T) {
        self.kept.push_back(sample);
    }

    /// Time of the sample that would be pushed next.
    pub(crate) fn end_s(&self) -> f64 {
        self.start_s + (self.gone + self.kept.len()) as f64 * self.step_s
    }

    pub(crate) fn step_s(&self) -> f64 {
        self.step_s
    }

    /// Samples that are kept.
    #[cfg(test)]
    pub(crate) fn iter(&self) -> impl Iterator<Item = T> {
        self.kept.iter().copied()
    }

    /// Samples on either side of a time, and the share of the step that lies behind it.
    pub(crate) fn around(&self, t_s: f64) -> (T, T, f64) {
        let steps = (t_s - self.start_s) / self.step_s;
        let last = self.gone + self.kept.len() - 2;
        let k = index(steps).clamp(self.gone, last);
        let [a, b] = [k, k + 1].map(|k| self.kept[k - self.gone]);
        (a, b, steps - k as f64)
    }

    /// Keeps the samples around this time and later ones.
    pub(crate) fn forget(&mut self, before_s: f64) {
        let first = index((before_s - self.start_s) / self.step_s).saturating_sub(1);
        while self.gone < first && self.kept.len() > 2 {
            self.kept.pop_front();
            self.gone += 1;
        }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers below zero become zero"
)]
fn index(steps: f64) -> usize {
    steps.floor().max(0.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_stay_where_they_are_when_older_ones_go() {
        let mut samples = Samples::new(-1.0, 0.5);
        for k in 0..8 {
            samples.push(k);
        }
        assert!((samples.end_s() - 3.0).abs() < 1e-15);
        assert_eq!(samples.around(0.25), (2, 3, 0.5));
        samples.forget(0.25);
        assert_eq!((samples.gone, samples.around(0.25)), (1, (2, 3, 0.5)));
        assert!((samples.end_s() - 3.0).abs() < 1e-15);
        // beyond the last sample the last pair goes on
        assert_eq!(samples.around(3.0), (6, 7, 2.0));
    }

    #[test]
    fn neighbours_are_strictly_on_their_side() {
        let times = [0.0, 1.0, 2.0];
        assert_eq!(neighbour(&times, 1.0, false), Some(2.0));
        assert_eq!(neighbour(&times, 1.0, true), Some(0.0));
        assert_eq!(neighbour(&times, 2.0, false), None);
        assert_eq!(neighbour(&times, 0.0, true), None);
    }
}
