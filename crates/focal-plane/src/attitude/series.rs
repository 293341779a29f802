//! Attitude between samples: cubic Hermite on the rotation vector.
//!
//! ```text
//! q(t) = exp(phi(t)) q0,      phi(0) = 0,     phi(h) = log(q1 q0^-1)
//! phi'(0) = -omega0,          phi'(h) = J_l^-1(phi(h)) (-omega1)
//! ```
//!
//! phi is the cubic with these four values; its error falls as h^4 where rates are given. A missing
//! rate comes from the neighbours, two on each side where there are as many: of the polynomial through
//! (`t_j`, log(q[j] q[i]^-1)) and zero at t = 0
//!
//! ```text
//! -omega[i] = sum_j phi_j (1/t_j) prod over k /= j of t_k / (t_k - t_j)
//! ```
//!
//! is the slope there, with an error of h^4/30 phi''''', so that the path still falls as h^4. With one on each
//! side it would be h^2/6 phi''', and h^3/6 phi''' s (1 - s) (1 - 2 s) of the path: under a sway of frequency w a
//! time tag of -(w h)^2/6 h s (1 - s) (1 - 2 s), where stars are measured at one place s between two samples.
//! Near an end of a run as many in all are taken from the other side: the error is h^4/20 phi''''' beside the end and
//! h^4/5 phi''''' at it. (A parabola there errs by h^2/3 phi''', which bent the last segment of a reference of 30 s
//! by 2.3" under a sway of 1 degree in 700 s, and passed for a step.) Where samples are uneven or turn far, at the
//! first of a run
//!
//! ```text
//! -omega[i-1] = J_l(a) (slope of the parabola at -h0)      through (-h0, a), (0, 0), (h1, b) about i
//! ```
//!
//! Two samples on their own are joined by slerp, or by a parabola if one of them has a rate. Slerp elsewhere
//! would break the path at every sample, which halves the estimated exposure of a smear at 2 Hz.
//!
//! Source: physics conventions, row "attitude between samples"; Hermite interpolation as in any
//! text, the end slopes derived above.

use nalgebra::{UnitQuaternion, Vector3};

use super::fill_attitudes;
use crate::{
    AttitudeSource, QuaternionsMut, rotation_from_vector, rotation_vector, so3_left_jacobian,
    so3_left_jacobian_inverse,
};

/// Neighbours on each side that tell a missing rate.
const SIDE: usize = 2;
/// The longest step between these over the shortest: where steps are less even, the nearest alone tell it, for a
/// polynomial through points that lie close together shows their noise.
const EVEN: f64 = 2.0;
/// Largest turn to one of these, rad: further on two turns may be one.
const LARGEST_TURN: f64 = 1.0;
/// Largest deviation of a quaternion's norm from 1.
const NORM_TOLERANCE: f64 = 1e-6;

/// Why samples do not make a series.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AttitudeError {
    /// No sample.
    #[error("no attitude sample given")]
    Empty,
    /// Columns differ in number.
    #[error("{times} times, but {got} {what}")]
    Length {
        /// `quaternions` or `rates`.
        what: &'static str,
        /// Number of times.
        times: usize,
        /// Number of the others.
        got: usize,
    },
    /// A time is not finite, or not later than the one before.
    #[error("sample {index} at {t_s} s is not later than the one before, or not finite")]
    Time {
        /// The sample.
        index: usize,
        /// Its time, s.
        t_s: f64,
    },
    /// A quaternion is not finite or not of unit norm.
    #[error("quaternion {index} at {t_s} s has norm {norm}, not 1 within 1e-6")]
    NotUnit {
        /// The sample.
        index: usize,
        /// Its time, s.
        t_s: f64,
        /// Its norm.
        norm: f64,
    },
    /// A rate is infinite.
    #[error("rate {index} at {t_s} s is infinite")]
    InfiniteRate {
        /// The sample.
        index: usize,
        /// Its time, s.
        t_s: f64,
    },
}

/// Sampled attitude with smooth values in between; exact at samples, `None` outside them.
///
/// ```
/// use focal_plane::{AttitudeSeries, AttitudeSource, rotation_from_vector};
/// use nalgebra::Vector3;
/// let t_s = vec![0.0, 0.5, 1.0, 1.5];
/// let turn = |t: f64| rotation_from_vector(&Vector3::new(0.0, 0.01 * t * t, 0.0));
/// let q = t_s.iter().map(|&t| turn(t)).collect();
/// let series = AttitudeSeries::new(t_s, q, None)?;
/// let between = series.attitude(0.7).expect("inside the span");
/// assert!(between.angle_to(&turn(0.7)) < 1e-15); // a parabola is met exactly
/// assert!(series.attitude(1.6).is_none());
/// # Ok::<(), focal_plane::AttitudeError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct AttitudeSeries {
    t_s: Vec<f64>,
    q: Vec<UnitQuaternion<f64>>,
    given_rates: Option<Vec<Vector3<f64>>>,
    max_gap_s: f64,
    /// At the samples, rad/s; `None` where neither rate nor neighbour is known.
    rate_rad_s: Vec<Option<Vector3<f64>>>,
    /// Between samples; `None` for a hole.
    segments: Vec<Option<Segment>>,
}

/// `phi = s (c1 + s (c2 + s c3))`, s from 0 to 1 over `h_s`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Segment {
    h_s: f64,
    c1: Vector3<f64>,
    c2: Vector3<f64>,
    c3: Vector3<f64>,
}

impl AttitudeSeries {
    /// From times, s, attitudes (inertial to tracker) and, where known, rates (tracker axes,
    /// rad/s). A rate with a NaN component is missing. Signs of quaternions are made continuous.
    ///
    /// # Errors
    ///
    /// No samples, different lengths, times that are not finite and strictly increasing, a
    /// quaternion whose norm is not 1 within 1e-6, or an infinite rate.
    pub fn new(
        t_s: Vec<f64>,
        q: Vec<UnitQuaternion<f64>>,
        rates: Option<Vec<Vector3<f64>>>,
    ) -> Result<Self, AttitudeError> {
        check(&t_s, &q, rates.as_deref())?;
        let mut series = Self {
            q: continuous(q),
            t_s,
            given_rates: rates,
            max_gap_s: f64::INFINITY,
            rate_rad_s: Vec::new(),
            segments: Vec::new(),
        };
        series.prepare();
        Ok(series)
    }

    /// The same series, with no attitude inside a hole longer than this (infinite by default);
    /// slopes are not taken from the other side of a hole either.
    ///
    /// # Panics
    ///
    /// Unless the length is positive.
    #[must_use]
    pub fn with_max_gap_s(mut self, max_gap_s: f64) -> Self {
        assert!(max_gap_s > 0.0, "max_gap_s = {max_gap_s} must be positive");
        self.max_gap_s = max_gap_s;
        self.prepare();
        self
    }

    /// Times of the samples, s.
    #[must_use]
    pub fn t_s(&self) -> &[f64] {
        &self.t_s
    }

    /// Attitudes of the samples, of continuous sign.
    #[must_use]
    pub fn quaternions(&self) -> &[UnitQuaternion<f64>] {
        &self.q
    }

    /// Rates as given, rad/s, tracker axes.
    #[must_use]
    pub fn given_rates_rad_s(&self) -> Option<&[Vector3<f64>]> {
        self.given_rates.as_deref()
    }

    /// Longest hole that is bridged, s.
    #[must_use]
    pub fn max_gap_s(&self) -> f64 {
        self.max_gap_s
    }

    /// Number of samples, at least one.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "a series is never empty")]
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// A reader for times that ascend: finds the next sample without a search.
    #[must_use]
    pub fn cursor(&self) -> AttitudeCursor<'_> {
        AttitudeCursor {
            series: self,
            hint: 0,
        }
    }

    fn prepare(&mut self) {
        let slopes = self.slopes();
        self.segments = (1..self.len())
            .map(|i| {
                let h_s = self.t_s[i] - self.t_s[i - 1];
                (h_s <= self.max_gap_s).then(|| {
                    let end = rotation_vector(&self.q[i], &self.q[i - 1]);
                    Segment::new(h_s, &end, slopes[i - 1], slopes[i])
                })
            })
            .collect();
        self.rate_rad_s = (0..self.len())
            .map(|i| self.rate_at_sample(i, slopes[i]))
            .collect();
    }

    /// A slope where it is known, else what the only segment there implies.
    fn rate_at_sample(&self, i: usize, slope: Option<Vector3<f64>>) -> Option<Vector3<f64>> {
        if let Some(slope) = slope {
            return Some(-slope);
        }
        let after = self.segments.get(i).copied().flatten();
        let before = i.checked_sub(1).and_then(|i| self.segments[i]);
        after
            .map(|segment| segment.rate_rad_s(0.0))
            .or_else(|| before.map(|segment| segment.rate_rad_s(1.0)))
    }

    /// `-omega` at each sample, from the given rate, else from a run of at least three samples.
    fn slopes(&self) -> Vec<Option<Vector3<f64>>> {
        (0..self.len())
            .map(|i| self.given_slope(i).or_else(|| self.neighbour_slope(i)))
            .collect()
    }

    fn given_slope(&self, i: usize) -> Option<Vector3<f64>> {
        let rate = self.given_rates.as_ref()?[i];
        (!rate.iter().any(|c| c.is_nan())).then_some(-rate)
    }

    fn neighbour_slope(&self, i: usize) -> Option<Vector3<f64>> {
        let joined =
            |i: usize| i + 1 < self.len() && self.t_s[i + 1] - self.t_s[i] <= self.max_gap_s;
        // as many in all at the ends as elsewhere: a slope of lower order there would bend the last segment
        let ahead = (0..2 * SIDE).take_while(|k| joined(i + k)).count();
        let back = (1..=(2 * SIDE).min(i))
            .take_while(|k| joined(i - k))
            .count();
        let share = |own: usize, other: usize| own.min(2 * SIDE - other.min(SIDE));
        let (back, ahead) = (share(back, ahead), share(ahead, back));
        (back + ahead >= 2).then(|| self.slope_through(i, back, ahead))
    }

    /// `-omega` at i of the polynomial through so many neighbours before and after, two at least; through the nearest
    /// two alone where they are uneven or far.
    fn slope_through(&self, i: usize, before: usize, after: usize) -> Vector3<f64> {
        let near = (i - before..=i + after).filter(|&j| j != i);
        let mut others = [(0.0, Vector3::zeros()); 2 * SIDE];
        for (other, j) in others.iter_mut().zip(near) {
            let turn = rotation_vector(&self.q[j], &self.q[i]);
            *other = (self.t_s[j] - self.t_s[i], turn);
        }
        let others = &others[..before + after];
        let steps = (i - before..i + after).map(|j| self.t_s[j + 1] - self.t_s[j]);
        let (short, long) = steps.fold((f64::INFINITY, 0.0_f64), |(short, long), h| {
            (short.min(h), long.max(h))
        });
        let far = others.iter().any(|(_, turn)| turn.norm() > LARGEST_TURN);
        if others.len() > 2 && (far || long > EVEN * short) {
            return match (before, after) {
                (0, _) => self.parabola(i + 1).0,
                (_, 0) => self.parabola(i - 1).1,
                _ => self.slope_through(i, 1, 1),
            };
        }
        let of = |j: usize| {
            let (t, turn) = others[j];
            let rest = (0..others.len()).filter(|&k| k != j).map(|k| others[k].0);
            turn * (rest.map(|other| other / (other - t)).product::<f64>() / t)
        };
        (0..others.len()).map(of).sum()
    }

    /// `-omega` at i-1 and i+1 of the parabola through these and i, in the chart of i: no
    /// logarithm reaches further than one step.
    fn parabola(&self, i: usize) -> (Vector3<f64>, Vector3<f64>) {
        let (h0, h1) = (self.t_s[i] - self.t_s[i - 1], self.t_s[i + 1] - self.t_s[i]);
        let a = rotation_vector(&self.q[i - 1], &self.q[i]);
        let b = rotation_vector(&self.q[i + 1], &self.q[i]);
        let slope = (b * (h0 / h1) - a * (h1 / h0)) / (h0 + h1);
        let bend = (a / h0 + b / h1) / (h0 + h1);
        (
            so3_left_jacobian(&a, &(slope - bend * (2.0 * h0))),
            so3_left_jacobian(&b, &(slope + bend * (2.0 * h1))),
        )
    }

    /// Sample at or before a time inside the span.
    fn find(&self, t_s: f64, hint: usize) -> Option<usize> {
        let [first_s, last_s] = self.span_s();
        (t_s >= first_s && t_s <= last_s).then(|| locate(&self.t_s, t_s, hint))
    }

    fn attitude_after(&self, i: usize, t_s: f64) -> Option<UnitQuaternion<f64>> {
        let since_s = t_s - self.t_s[i];
        if since_s <= 0.0 {
            return Some(self.q[i]);
        }
        let segment = self.segments[i].as_ref()?;
        Some(rotation_from_vector(&segment.phi(since_s / segment.h_s)) * self.q[i])
    }

    fn rate_after(&self, i: usize, t_s: f64) -> Option<Vector3<f64>> {
        let since_s = t_s - self.t_s[i];
        if since_s <= 0.0 {
            return self.rate_rad_s[i];
        }
        let segment = self.segments[i].as_ref()?;
        Some(segment.rate_rad_s(since_s / segment.h_s))
    }
}

impl AttitudeSource for AttitudeSeries {
    fn attitude(&self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        self.attitude_after(self.find(t_s, 0)?, t_s)
    }

    fn rate_rad_s(&self, t_s: f64) -> Option<Vector3<f64>> {
        self.rate_after(self.find(t_s, 0)?, t_s)
    }

    fn span_s(&self) -> [f64; 2] {
        [self.t_s[0], self.t_s[self.len() - 1]]
    }

    fn attitude_near(&self, t_s: f64, hint: &mut usize) -> Option<UnitQuaternion<f64>> {
        *hint = self.find(t_s, *hint)?;
        self.attitude_after(*hint, t_s)
    }

    fn attitude_into(&self, t_s: &[f64], out: QuaternionsMut<'_>) {
        let mut cursor = self.cursor();
        fill_attitudes(t_s, out, |t| cursor.attitude(t));
    }
}

/// Reads a series at ascending times; any other order works too, only slower.
#[derive(Clone, Debug)]
pub struct AttitudeCursor<'a> {
    series: &'a AttitudeSeries,
    hint: usize,
}

impl AttitudeCursor<'_> {
    /// As [`AttitudeSource::attitude`] of the series.
    pub fn attitude(&mut self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        self.hint = self.series.find(t_s, self.hint)?;
        self.series.attitude_after(self.hint, t_s)
    }

    /// As [`AttitudeSource::rate_rad_s`] of the series.
    pub fn rate_rad_s(&mut self, t_s: f64) -> Option<Vector3<f64>> {
        self.hint = self.series.find(t_s, self.hint)?;
        self.series.rate_after(self.hint, t_s)
    }
}

impl Segment {
    /// From the rotation over the segment and `-omega` at its ends where known.
    fn new(
        h_s: f64,
        end: &Vector3<f64>,
        slope_start: Option<Vector3<f64>>,
        slope_end: Option<Vector3<f64>>,
    ) -> Self {
        let start = slope_start.map(|slope| slope * h_s);
        let stop = slope_end.map(|slope| so3_left_jacobian_inverse(end, &slope) * h_s);
        // one slope alone makes a parabola, none a straight line (slerp)
        let (start, stop) = match (start, stop) {
            (Some(start), Some(stop)) => (start, stop),
            (Some(start), None) => (start, end * 2.0 - start),
            (None, Some(stop)) => (end * 2.0 - stop, stop),
            (None, None) => (*end, *end),
        };
        Self {
            h_s,
            c1: start,
            c2: end * 3.0 - start * 2.0 - stop,
            c3: start + stop - end * 2.0,
        }
    }

    fn phi(&self, s: f64) -> Vector3<f64> {
        (self.c1 + (self.c2 + self.c3 * s) * s) * s
    }

    fn rate_rad_s(&self, s: f64) -> Vector3<f64> {
        let derivative = (self.c1 + (self.c2 * 2.0 + self.c3 * (3.0 * s)) * s) / self.h_s;
        -so3_left_jacobian(&self.phi(s), &derivative)
    }
}

/// Last entry of ascending `t_s` at or before `t`, given `t_s[0] <= t`: a few steps on from `hint` or
/// back, and a search if it is not there.
pub(crate) fn locate(t_s: &[f64], t: f64, hint: usize) -> usize {
    const STEPS: usize = 8;
    match t_s.get(hint) {
        Some(&at) if at <= t => {
            let ahead = &t_s[hint + 1..t_s.len().min(hint + 1 + STEPS)];
            if let Some(steps) = ahead.iter().position(|&next| t < next) {
                return hint + steps;
            }
        }
        Some(_) => {
            let behind = hint.saturating_sub(STEPS);
            if let Some(steps) = t_s[behind..hint].iter().rposition(|&at| at <= t) {
                return behind + steps;
            }
        }
        None => {}
    }
    t_s.partition_point(|&sample| sample <= t) - 1
}

fn check(
    t_s: &[f64],
    q: &[UnitQuaternion<f64>],
    rates: Option<&[Vector3<f64>]>,
) -> Result<(), AttitudeError> {
    let times = t_s.len();
    if times == 0 && q.is_empty() {
        return Err(AttitudeError::Empty);
    }
    for (what, got) in [
        ("quaternions", q.len()),
        ("rates", rates.map_or(times, <[_]>::len)),
    ] {
        if got != times {
            return Err(AttitudeError::Length { what, times, got });
        }
    }
    let mut last_s = f64::NEG_INFINITY;
    for (index, &t_s) in t_s.iter().enumerate() {
        if !t_s.is_finite() || t_s <= last_s {
            return Err(AttitudeError::Time { index, t_s });
        }
        last_s = t_s;
        let norm = q[index].quaternion().norm();
        if norm.is_nan() || (norm - 1.0).abs() > NORM_TOLERANCE {
            return Err(AttitudeError::NotUnit { index, t_s, norm });
        }
        if rates.is_some_and(|rates| rates[index].iter().any(|c| c.is_infinite())) {
            return Err(AttitudeError::InfiniteRate { index, t_s });
        }
    }
    Ok(())
}

/// Unit to rounding, and each of the sign nearer to the one before.
fn continuous(mut q: Vec<UnitQuaternion<f64>>) -> Vec<UnitQuaternion<f64>> {
    for i in 0..q.len() {
        if (q[i].quaternion().norm() - 1.0).abs() > 4.0 * f64::EPSILON {
            q[i] = UnitQuaternion::new_normalize(q[i].into_inner());
        }
        if i > 0 && q[i - 1].quaternion().dot(q[i].quaternion()) < 0.0 {
            q[i] = UnitQuaternion::new_unchecked(-q[i].into_inner());
        }
    }
    q
}
