//! A long motion of which a few stretches are held at a time.
//!
//! ```text
//! stretch k: the samples of the whole motion from the last one before k L to the first after (k + 1) L
//! ```
//!
//! A stretch is made from a mark: the attitude and the state of everything random at its beginning. The
//! samples are those of the whole motion to the last bit, and so is what lies between them, since every
//! sample has a rate. There are at most [`MARKS`] marks: when they are too many, every other one goes.
//! Who asks for times that ascend, roughly, has every stretch made once.
//!
//! Not physics: bookkeeping.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use focal_plane::{AttitudeSeries, AttitudeSource};
use nalgebra::{UnitQuaternion, Vector3};

use super::integrate::{Walker, integrate, series};
use super::turning::Turning;
use crate::ScenarioError;

/// Steps in a stretch.
const STRETCH: f64 = 512.0;
/// Stretches held.
const HELD: usize = 32;
/// Marks held.
const MARKS: usize = 256;

/// The attitude of a motion, in memory that does not depend on its length.
pub(super) struct Long<T> {
    span_s: [f64; 2],
    stretch_s: f64,
    /// What comes before t = 0.
    before: AttitudeSeries,
    state: Mutex<State<T>>,
}

struct State<T> {
    /// Ascending stretches; the first is 0.
    marks: Vec<(usize, Mark<T>)>,
    /// Marks are at multiples of this.
    every: usize,
    /// Latest use last.
    held: VecDeque<(usize, Arc<AttitudeSeries>)>,
}

#[derive(Clone)]
struct Mark<T> {
    walker: Walker,
    turning: T,
}

impl<T: Turning> Long<T> {
    /// Attitude that is `start` at t = 0 and turns as given.
    pub(super) fn new(
        mut turning: T,
        start: UnitQuaternion<f64>,
        span_s: [f64; 2],
    ) -> Result<Self, ScenarioError> {
        let stretch_s = STRETCH * turning.step_s();
        turning.extend(0.0);
        let before = integrate(&turning, start, [span_s[0], 0.0])?;
        let walker = Walker::new(start, span_s[1]);
        let state = State {
            marks: vec![(0, Mark { walker, turning })],
            every: 1,
            held: VecDeque::new(),
        };
        Ok(Self {
            span_s,
            stretch_s,
            before,
            state: Mutex::new(state),
        })
    }

    fn at<V>(&self, t_s: f64, value: impl Fn(&AttitudeSeries) -> Option<V>) -> Option<V> {
        if !(t_s >= self.span_s[0] && t_s <= self.span_s[1]) {
            return None;
        }
        if t_s < 0.0 {
            return value(&self.before);
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a time within the span, counted in stretches"
        )]
        let k = (t_s / self.stretch_s).floor() as usize;
        let stretch = {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            state.stretch(k, self.stretch_s)?
        };
        value(&stretch)
    }
}

impl<T: Turning> State<T> {
    fn stretch(&mut self, k: usize, stretch_s: f64) -> Option<Arc<AttitudeSeries>> {
        if let Some(at) = self.held.iter().position(|(held, _)| *held == k) {
            let found = self.held.remove(at)?;
            self.held.push_back(found);
            return self.held.back().map(|(_, series)| series.clone());
        }
        let nearest = self.marks.partition_point(|(at, _)| *at <= k) - 1;
        let (mut at, mut mark) = self.marks[nearest].clone();
        loop {
            let made = Arc::new(mark.advance((at + 1) as f64 * stretch_s)?);
            self.held.retain(|(held, _)| *held != at);
            self.held.push_back((at, made.clone()));
            if self.held.len() > HELD {
                self.held.pop_front();
            }
            if at == k {
                self.mark(at + 1, mark);
                return Some(made);
            }
            at += 1;
            self.mark(at, mark.clone());
        }
    }

    /// Remembers the beginning of a stretch, if it is later than all others.
    fn mark(&mut self, at: usize, mark: Mark<T>) {
        let last = self.marks.last().map_or(0, |(last, _)| *last);
        if at <= last || !at.is_multiple_of(self.every) {
            return;
        }
        self.marks.push((at, mark));
        if self.marks.len() > MARKS {
            self.every *= 2;
            let every = self.every;
            self.marks.retain(|(at, _)| at.is_multiple_of(every));
        }
    }
}

impl<T: Turning> Mark<T> {
    /// Goes to the last sample at or before `to_s`, and returns the samples from here to the one after.
    fn advance(&mut self, to_s: f64) -> Option<AttitudeSeries> {
        let margin_s = 2.0 * self.turning.step_s();
        self.turning.extend(to_s + margin_s);
        let mut samples = vec![(self.walker.t_s, self.walker.q)];
        let mut next = self.walker.clone();
        while let Some(sample) = next.next(&self.turning) {
            samples.push(sample);
            if next.t_s > to_s {
                break;
            }
            self.walker = next.clone();
        }
        let made = series(&self.turning, samples).ok();
        self.turning.forget(self.walker.t_s);
        made
    }
}

impl<T: Turning + Sync> AttitudeSource for Long<T> {
    fn attitude(&self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        self.at(t_s, |series| series.attitude(t_s))
    }

    fn rate_rad_s(&self, t_s: f64) -> Option<Vector3<f64>> {
        self.at(t_s, |series| series.rate_rad_s(t_s))
    }

    fn span_s(&self) -> [f64; 2] {
        self.span_s
    }
}

#[cfg(test)]
mod tests {
    use star_tracker::{Purpose, stream};

    use super::super::integrate::whole;
    use super::super::phase_plane::y_axis;
    use super::super::{ClosedLoop, Hold, PhasePlane, Pointing, Slew, Slews};
    use super::*;

    /// Both at the same times, forwards and then far back, to the last bit; and what is held stays small.
    fn same<T: Turning + Sync>(turning: T, start: Pointing, end_s: f64) {
        let (start, span_s) = (start.attitude().unwrap(), [-5.0, end_s]);
        let long = Long::new(turning.clone(), start, span_s).unwrap();
        let whole = whole(turning, start, span_s).unwrap();
        let ascending = (0..4000).map(|k| -5.0 + (end_s + 5.0) * f64::from(k) / 3999.0);
        let back = [0.37, 0.0, 0.9, 0.52, 1.0, 0.11].map(|share| share * end_s);
        for t in ascending
            .chain(back)
            .chain(whole.t_s()[..2000].iter().copied())
        {
            let both = [long.attitude(t), whole.attitude(t)];
            let bits = both.map(|q| q.unwrap().coords.map(f64::to_bits));
            assert_eq!(bits[0], bits[1], "at {t} s");
            assert_eq!(long.rate_rad_s(t), whole.rate_rad_s(t), "at {t} s");
        }
        assert_eq!(
            long.span_s().map(f64::to_bits),
            whole.span_s().map(f64::to_bits)
        );
        assert!(long.attitude(end_s + 1e-3).is_none() && long.attitude(-5.1).is_none());
        let state = long.state.lock().unwrap();
        assert!(state.held.len() <= HELD && state.marks.len() <= MARKS && state.every > 1);
    }

    fn noise() -> Option<ClosedLoop> {
        Some(ClosedLoop {
            sigma_arcsec: [1.0, 2.0, 3.0],
            frequency_hz: 0.6,
            damping: 0.3,
        })
    }

    #[test]
    fn stretches_are_those_of_the_whole() {
        let rng = stream(4, 0, Purpose::Motion);
        let hold = Hold {
            drift_arcsec_s: [1.0, 2.0, 3.0],
            closed_loop: noise(),
            ..Hold::default()
        };
        same(hold.turning(-5.0, &rng).unwrap(), hold.start, 6000.0);
        let slew = Slew {
            axis: [1.0, 2.0, 3.0],
            angle_deg: 2.0,
            duration_s: 31.3,
            ramp_s: Some(7.1),
            hold_s: 12.0,
        };
        let slews = Slews {
            start: Pointing::default(),
            drift_arcsec_s: [0.0; 3],
            wait_s: 3.3,
            repeat: 200,
            slew: vec![slew],
            sinusoid: Vec::new(),
            closed_loop: noise(),
        };
        same(slews.turning(-5.0, &rng).unwrap(), slews.start, 6000.0);
        let cycle = PhasePlane {
            start: Pointing::default(),
            drift_arcsec_s: [0.0; 3],
            cant_axis: y_axis(),
            cant_deg: 15.0,
            deadband_deg: [0.11, 0.11, 0.27],
            rate_arcsec_s: [15.0; 3],
            rate_spread: 0.5,
            coupling: 0.2,
            torque_arcsec_s2: [0.0; 3],
            cycle_s: 0.7,
        };
        same(cycle.turning(-5.0, &rng).unwrap(), cycle.start, 9000.0);
    }
}
