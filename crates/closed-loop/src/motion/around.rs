//! The motion around each frame as the *other* samples tell it.
//!
//! A residual against a reference holds that reference's error `e_k` at the frame's
//! time. A path through the sample itself holds it too: its acceleration is
//! `-2 e_k/h^2` and more, and a smear "explains" the reference's white noise. So
//! around a frame the path is the polynomial through the neighbours alone, three
//! on each side that lie at least one step away, or two with their measured rates;
//! beside a hole, and at the ends, through those of one side. Of noisy samples it is
//! the polynomial of that degree nearest to more neighbours ([`super::stencil`]), or where measured rates tell
//! more than such samples, what the polynomial through the rates of three on each side integrates to:
//!
//! ```text
//! q(t_k + s) = exp( p_k(s) ) q_k      p_k(s_i) = log(q_i q_k^-1) = phi_i,  |s_i| >= 0.9 h
//!                                     p_k'(s_i) = -J_l^-1(phi_i) omega_i
//! J_l^-1(phi) v = v - phi x v / 2 + phi x (phi x v) / 12 - ...
//! ```
//!
//! For a swing of frequency f the acceleration is off by about (2 pi f h)^4 / 4 of
//! itself: 0.4 % at 18 samples a period. From three neighbours of one side the velocity
//! is off by (2 pi f h)^2: 12 % there, 1 % at 60 samples a period. Zero would be off by all
//! of it, and a frame where an effect seems not to act tells it from a constant.
//!
//! Samples much nearer to each other than the frames tell the path between these, where no frame's polynomial reaches;
//! what they are off by there is not what the frame's own is.
//!
//! Where the samples do not resolve a motion, or a frame has too few neighbours, the
//! attitude of the frame is all that is known: at its own time, and nowhere else.
//!
//! Source: Hermite interpolation in Newton's form; errors in variables.

use focal_plane::{AttitudeSeries, AttitudeSource, rotation_from_vector};
use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;
use spectra::robust::median_step;

use super::piece::Piece;
use super::stencil::Stencil;
use crate::gaps::GAP_STEPS;

/// Frames lie so many samples apart, or more, where what is between them is out of their reach.
const FAR: f64 = 2.0;
/// No frame.
const NOWHERE: usize = usize::MAX;

/// The motion around a list of times.
#[derive(Clone, Debug)]
pub(crate) struct Around {
    t_s: Vec<f64>,
    pieces: Vec<Option<Piece>>,
    /// Between samples, s.
    step_s: f64,
    /// Whether there are paths, not attitudes alone.
    resolved: bool,
    /// Whether these come from measured rates.
    by_rates: bool,
    /// Whether they come from samples, with the error of these.
    of_samples: bool,
    /// The samples themselves, where there are many from frame to frame.
    between: Option<AttitudeSeries>,
    /// How the camera that sees all this is turned against theirs.
    turn: UnitQuaternion<f64>,
}

impl Around {
    /// The motion of `series` around times in ascending order; attitudes alone where its samples do
    /// not resolve one (no `stencil`), or hardly a frame has neighbours enough.
    pub(crate) fn new(series: &AttitudeSeries, t_s: &[f64], stencil: Option<&Stencil>) -> Self {
        let step = median_step(series.t_s()).unwrap_or(f64::INFINITY);
        let resolved = stencil.is_some();
        let pieces = t_s
            .par_iter()
            .map(|&t| Piece::new(series, step, t, stencil))
            .collect();
        let mut around = Self {
            t_s: t_s.to_vec(),
            pieces,
            step_s: step,
            resolved,
            by_rates: stencil.is_some_and(|s| s.by_rates.is_some()),
            of_samples: stencil.is_some_and(|s| s.by_rates.is_none()),
            between: None,
            turn: UnitQuaternion::identity(),
        };
        let paths = around.pieces.iter().flatten().filter(|p| p.count > 0);
        if resolved && 2 * paths.count() < t_s.len() {
            around.resolved = false;
            around.pieces.iter_mut().flatten().for_each(Piece::forget);
        }
        let far = median_step(t_s).is_some_and(|frame| frame > FAR * step);
        if around.resolved && far {
            let longest = series.max_gap_s().min(GAP_STEPS * step);
            around.between = Some(series.clone().with_max_gap_s(longest));
        }
        around
    }

    /// The same as a camera sees it that is turned against it.
    pub(crate) fn turned(mut self, turn: &UnitQuaternion<f64>) -> Self {
        self.turn = turn * self.turn;
        for piece in self.pieces.iter_mut().flatten() {
            piece.q = turn * piece.q;
            piece.back = turn * piece.back * turn.inverse();
            piece.newton.iter_mut().for_each(|phi| *phi = turn * *phi);
        }
        self
    }

    /// The same of samples whose error is out: its paths follow none.
    pub(crate) fn without_error(self) -> Self {
        Self {
            of_samples: false,
            ..self
        }
    }

    /// Between samples, s.
    pub(crate) fn step_s(&self) -> f64 {
        self.step_s
    }

    /// Whether the samples tell how the tracker moved between them.
    pub(crate) fn resolved(&self) -> bool {
        self.resolved
    }

    /// Whether the paths come from measured rates, which hold nothing of the samples' errors.
    pub(crate) fn by_rates(&self) -> bool {
        self.by_rates
    }

    /// Whether what acts around a frame's time follows the samples around it, with their error.
    pub(crate) fn has_own_paths(&self) -> bool {
        self.resolved && self.of_samples
    }

    /// Whether it is not known how the tracker moved around a frame, where it is around others.
    pub(crate) fn lost(&self, frame: usize) -> bool {
        self.resolved && self.pieces[frame].as_ref().is_none_or(|p| p.count == 0)
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
        let mut reach = piece.reach_s(self.step_s);
        // samples beside the frame's own hold the error that its attitude has from them
        if self.between.is_some() {
            reach = reach.max(piece.own_s);
        }
        (s.abs() <= reach).then_some((piece, s))
    }
}

impl AttitudeSource for Around {
    fn attitude(&self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        let mut nowhere = NOWHERE;
        self.attitude_near(t_s, &mut nowhere)
    }

    fn attitude_near(&self, t_s: f64, hint: &mut usize) -> Option<UnitQuaternion<f64>> {
        let Some((piece, s)) = self.piece(t_s, hint) else {
            return Some(self.turn * self.between.as_ref()?.attitude(t_s)?);
        };
        Some(rotation_from_vector(&piece.value(s)) * piece.q)
    }

    /// As the frame at `t_s` knows it, as far as its neighbours reach: another frame's path holds the error of this
    /// one. Between its neighbours a polynomial is off by no more than where the frame itself is.
    fn turn(&self, t_s: f64, d_s: f64, hint: &mut usize) -> Option<UnitQuaternion<f64>> {
        let (piece, s) = self.piece(t_s, hint)?;
        let back = if s == 0.0 {
            piece.back
        } else {
            rotation_from_vector(&piece.value(s)).inverse()
        };
        let later = if (s + d_s).abs() <= piece.own_s {
            rotation_from_vector(&piece.value(s + d_s))
        } else {
            self.attitude_near(t_s + d_s, hint)? * piece.q.inverse()
        };
        Some(later * back)
    }

    /// To first order in the rotation from the frame's attitude.
    fn rate_rad_s(&self, t_s: f64) -> Option<Vector3<f64>> {
        let mut nowhere = NOWHERE;
        let (piece, s) = self.piece(t_s, &mut nowhere)?;
        if piece.count == 0 {
            return None;
        }
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
    use crate::gaps::longest_step;
    use focal_plane::rotation_vector;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const STEP: f64 = 0.5;

    fn of(motion: &AttitudeSeries, t_s: &[f64]) -> Around {
        Around::new(
            motion,
            t_s,
            Some(&Stencil::of(motion, longest_step(motion.t_s()))),
        )
    }

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
        let around = of(&motion, &t_s);
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

    /// Frames forty samples apart: between them the samples tell the path, for a camera that is turned against theirs,
    /// too; not across a hole of theirs. 2 pi f h = 0.03: what cubics miss is far below 1e-9.
    #[test]
    fn samples_tell_the_path_between_frames() {
        let path = |t: f64| Vector3::x() * 1e-3 * (std::f64::consts::TAU * 0.01 * t).sin();
        let whole = series(path, 800);
        let kept = |t: &f64| !(100.0..130.0).contains(t);
        let t_s: Vec<f64> = whole.t_s().iter().copied().filter(kept).collect();
        let q = t_s.iter().map(|&t| rotation_from_vector(&path(t)));
        let motion = AttitudeSeries::new(t_s.clone(), q.collect(), None).unwrap();
        let frames: Vec<f64> = (1..20).map(|k| 20.0 * f64::from(k)).collect();
        let turn = rotation_from_vector(&Vector3::new(0.1, -0.2, 0.3));
        let around = of(&motion, &frames).turned(&turn);
        for d in [0.3, 1.7, -8.0] {
            let got = around.turn(300.0, d, &mut 0).unwrap();
            let [later, now] = [300.0 + d, 300.0].map(|t| turn * rotation_from_vector(&path(t)));
            assert!(got.angle_to(&(later * now.inverse())) < 1e-9, "{d}");
        }
        assert!(around.turn(80.0, 19.0, &mut 0).is_some());
        assert!(around.turn(80.0, 25.0, &mut 0).is_none());
    }

    /// Frames thirty samples of 1e-6 apart, at none of them. By what the samples err the path bends around a frame by
    /// 16.6 (1.4)^2 / m^2.5 of it, a tenth where noise allows 10 on each side, and no more of it goes with the error of the
    /// frame's own attitude than chance has, 0.15 / sqrt(600). Taken from the samples next to it, which that error comes
    /// from, it bends by more than all of it, and an eighth of that error goes along.
    #[test]
    fn a_path_between_frames_knows_nothing_of_their_own_error() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(8);
        let path = |t: f64| Vector3::x() * 1e-3 * (std::f64::consts::TAU * 0.003 * t).sin();
        let t_s: Vec<f64> = (0..18_100).map(|k| STEP * f64::from(k)).collect();
        let q = t_s.iter().map(|&t| {
            let noise: f64 = StandardNormal.sample(&mut rng);
            rotation_from_vector(&(path(t) + Vector3::x() * noise * 1e-6))
        });
        let motion = AttitudeSeries::new(t_s.clone(), q.collect(), None).unwrap();
        let frames: Vec<f64> = (1..=600).map(|k| 15.0 * f64::from(k) + 0.21).collect();
        let around = of(&motion, &frames);
        let (mut both, mut own, mut bent) = (0.0, 0.0, 0.0);
        for &t in &frames {
            let h = 1.4 * STEP;
            let [a, b, c] = [-h, 0.0, h].map(|d| around.attitude(t + d).unwrap());
            let off = rotation_vector(
                &motion.attitude(t).unwrap(),
                &rotation_from_vector(&path(t)),
            )
            .x;
            let bends = (rotation_vector(&a, &b) + rotation_vector(&c, &b)).x;
            both += off * bends;
            own += off * off;
            bent += bends * bends;
        }
        assert!(bent < 0.1 * own, "{bent} of {own}");
        assert!(
            (both / own).abs() < 4.0 * 0.15 / 600.0_f64.sqrt(),
            "{both} of {own}"
        );
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
        let around = of(&motion, &t_s);
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
        let around = of(&motion, &t_s);
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

    /// Slews of 20 s (half of them speeding up, half slowing down) every minute at 5 Hz, and samples of which the
    /// interpolating path's acceleration (1.2 s/h^2) has as much noise as the slews accelerate on average. A
    /// smear by a path is too small by the share of its noise, here a half: of more neighbours, by less
    /// than a twentieth. The exposure is longer than a step: the path stays that of its frame.
    #[test]
    fn the_acceleration_of_noisy_samples_is_told() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(10);
        let (h, a) = (0.2, 1e-4);
        let pull = |t: f64| match t.rem_euclid(60.0) {
            s if s < 10.0 => a,
            s if s < 20.0 => -a,
            _ => 0.0,
        };
        let n = 3000;
        let t_s: Vec<f64> = (0..n).map(|k| h * f64::from(k)).collect();
        let (mut angle, mut rate) = (0.0, 0.0);
        let sigma = a / 3.0_f64.sqrt() * h * h / 1.23;
        let q: Vec<_> = t_s
            .iter()
            .map(|&t| {
                let e: f64 = StandardNormal.sample(&mut rng);
                let q = rotation_from_vector(&(Vector3::x() * (angle + sigma * e)));
                angle += h * rate + 0.5 * h * h * pull(t);
                rate += h * pull(t);
                q
            })
            .collect();
        let motion = AttitudeSeries::new(t_s.clone(), q, None).unwrap();
        let around = of(&motion, &t_s);
        let (mut both, mut own, mut hint) = (0.0, 0.0, 0);
        for &t in &t_s[30..t_s.len() - 30] {
            let half = 0.3;
            let turns = [-half, half].map(|d| around.turn(t, d, &mut hint).unwrap());
            let told: f64 = turns.iter().map(|q| q.scaled_axis().x).sum::<f64>() / (half * half);
            both += told * pull(t);
            own += told * told;
        }
        assert!((both / own - 1.0).abs() < 0.05, "{}", both / own);
    }

    /// Beside a hole the path comes from one side: a parabola is met to the square of its turn (1e-5),
    /// not the rate that a line across the hole would have (half of it). Three samples on their own have
    /// two neighbours each: an attitude, no path.
    #[test]
    fn holes_are_not_crossed() {
        let run = |from: f64, n: usize| (0..n).map(move |k| from + 0.5 * k as f64);
        let t_s: Vec<f64> = run(0.0, 5).chain(run(9.0, 5)).chain(run(19.0, 3)).collect();
        let q = t_s
            .iter()
            .map(|&t| rotation_from_vector(&(Vector3::z() * 1e-3 * t * t)))
            .collect();
        let motion = AttitudeSeries::new(t_s.clone(), q, None).unwrap();
        let around = of(&motion, &t_s);
        assert!(around.resolved());
        for &t in &t_s[..10] {
            let rate = around.rate_rad_s(t).unwrap();
            assert!((rate.z + 2e-3 * t).abs() < 1e-9, "{t}: {rate}");
        }
        for k in 0..10 {
            assert!(!around.lost(k));
        }
        for k in 10..13 {
            assert!(around.lost(k));
            assert_eq!(around.attitude(t_s[k]), motion.attitude(t_s[k]));
            assert!(around.attitude(t_s[k] + 0.01).is_none());
            assert!(around.rate_rad_s(t_s[k]).is_none());
        }
    }

    /// The same of noisy samples, of a tracker at rest that swings at last: many are used, of the swing fewer. A
    /// frame without a path tells of no turn, and one with a path no more than its own neighbours know: however
    /// far off, what is told is within some of the noise, where a path continued beyond them would be hundreds
    /// off.
    #[test]
    fn a_path_is_not_continued() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let (sigma, omega) = (1e-6, std::f64::consts::TAU / 18.0);
        let path = |t: f64| Vector3::x() * 1e-3 * (1.0 - (omega * (t - 1170.0).max(0.0)).cos());
        let run = |from: f64, n: usize| (0..n).map(move |k| from + STEP * k as f64);
        let t_s: Vec<f64> = run(0.0, 2400).chain(run(1220.0, 3)).collect();
        let q = t_s.iter().map(|&t| {
            let noise: Vector3<f64> = Vector3::from_fn(|_, _| StandardNormal.sample(&mut rng));
            rotation_from_vector(&(path(t) + noise * sigma))
        });
        let motion = AttitudeSeries::new(t_s.clone(), q.collect(), None).unwrap();
        let around = of(&motion, &t_s);
        assert!(around.has_own_paths());
        let mut hint = 0;
        for (k, &t) in t_s.iter().enumerate() {
            if around.lost(k) {
                assert!(k >= 2400 && around.turn(t, 0.3, &mut hint).is_none(), "{t}");
            } else if (30..2370).contains(&k) {
                for d in [6.0, 12.0, 18.0, 24.0].map(|steps| steps * STEP) {
                    let turn = around.turn(t, d, &mut hint).unwrap();
                    let off = turn.scaled_axis() - (path(t + d) - path(t));
                    assert!(off.norm() < 20.0 * sigma, "{t}: {d} s, {off}");
                }
            }
        }
        assert!((2400..2403).all(|k| around.lost(k)));
    }

    /// A swing of 36 samples a period, whose samples hold noise of 1e-3 of it or a wander, with its rates: the polynomial
    /// through six is off by (2 pi/36)^6 / 20 = 1.4e-6 of the largest, and what the samples err by is not in the
    /// path, but for turning the rates of neighbours by it, by 5e-6 of half of them, and for what these seem to be off
    /// by: the noise of two samples over 200 s, or 400 steps of a walk. Rates whose noise over a step is that of the
    /// samples tell no more than they do.
    #[test]
    fn a_path_by_rates_holds_no_noise_of_the_samples() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
        let mut normal =
            || -> Vector3<f64> { Vector3::from_fn(|_, _| StandardNormal.sample(&mut rng)) };
        let omega = std::f64::consts::TAU / 36.0 / STEP;
        let path = |t: f64| Vector3::x() * 1e-3 * (omega * t).sin();
        let t_s: Vec<f64> = (0..400).map(|k| STEP * f64::from(k)).collect();
        let mut swing = |white: f64, walk: f64, of_rates: f64| {
            let mut off = Vector3::zeros();
            let mut q = Vec::new();
            let mut rates = Vec::new();
            for &t in &t_s {
                off += normal() * walk;
                q.push(rotation_from_vector(&(path(t) + off + normal() * white)));
                rates.push(-Vector3::x() * 1e-3 * omega * (omega * t).cos() + normal() * of_rates);
            }
            AttitudeSeries::new(t_s.clone(), q, Some(rates)).unwrap()
        };
        let cases = [(swing(1e-6, 0.0, 0.0), 7e-9), (swing(0.0, 1e-6, 0.0), 1e-7)];
        for (motion, bias) in cases {
            let around = of(&motion, &t_s);
            assert!(around.by_rates() && !around.has_own_paths());
            for &t in &t_s[3..397] {
                let turn = around.turn(t, 0.3, &mut 0).unwrap();
                let off = turn.scaled_axis() - (path(t + 0.3) - path(t));
                assert!(
                    off.norm() < ((1.4e-6 + 2.5e-6) * 1e-3 * omega + 5.0 * bias) * 0.3,
                    "{t}: {off}"
                );
            }
        }
        let noisy = swing(1e-6, 0.0, 1e-6 / STEP);
        assert!(!of(&noisy, &t_s).by_rates());
    }

    /// Where most frames are lost, or the motion is not resolved, none has a path; all have attitudes.
    #[test]
    fn without_a_motion_there_are_attitudes() {
        let t_s: Vec<f64> = (0..30)
            .map(|k| 0.5 * f64::from(k) + 20.0 * f64::from(k / 3))
            .collect();
        let turn = |&t: &f64| rotation_from_vector(&(Vector3::z() * 1e-3 * t));
        let q = t_s.iter().map(turn).collect();
        let motion = AttitudeSeries::new(t_s.clone(), q, None).unwrap();
        let smooth = series(|t| Vector3::z() * 1e-3 * t, 30);
        for around in [of(&motion, &t_s), Around::new(&smooth, smooth.t_s(), None)] {
            assert!(!around.resolved() && !around.lost(4));
            let t = around.t_s[4];
            assert!(around.attitude(t).is_some() && around.attitude(t + 0.01).is_none());
            assert!(around.rate_rad_s(t).is_none());
        }
    }
}
