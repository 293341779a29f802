//! Which motion would tell two effects apart: small manoeuvres flown on paper.
//!
//! An effect A of the size found predicts a shift of every centroid (or attitude) along a motion.
//! What another effect B and the declared unknowns cannot imitate of it is what tells them apart:
//!
//! ```text
//! n^2 = a' (S_AA - S_AB S_BB^-1 S_BA) a,    S = (G_cc - G_cn (G_nn + L)^-1 G_nc) / v
//! ```
//!
//! G: normal equations of the regressors c of both effects and of the unknowns n (with prior L) on
//! the manoeuvre; v: variance of the noise as it was found; a: the amplitudes of A as they were
//! found. A fit of B alone, where A is the truth, misses by n sigma.
//!
//! The library: a slew about one axis, there and back again, and a drift, each about X, Y, both, and
//! the boresight, with the rate rising and falling over a fifth of the time,
//!
//! ```text
//! rate = peak S(t / ramp),    S(s) = 10 s^3 - 15 s^4 + 6 s^5
//! ```
//!
//! The smallest that reaches 5 sigma is the one that turns the tracker least. The stars are those of
//! the bundle's middle; across the boresight their pattern repeats at every field of view, so that as
//! many come in as go out. Channels do what they did when the bundle began.
//!
//! Source: Fisher 1925 (information); the Schur complement of the nuisance.

pub(crate) mod attitudes;
pub(crate) mod stars;

use block_regression::{Folds, Layout};
use effects::Candidate;
use focal_plane::{ARCSEC_PER_RAD, AttitudeSeries, AttitudeSource, rotation_from_vector};
use nalgebra::{DMatrix, DVector, SymmetricEigen, UnitQuaternion, Vector3};
use rayon::prelude::*;
use telemetry::report::Manoeuvre;

use crate::evidence::Evidence;
use crate::questions::hypothesis::short;

/// Sigmas that are wanted.
pub const NEEDED_SIGMA: f64 = 5.0;
/// Peak rates of slews, deg/s, and constant rates of drifts, arcsec/s.
const RATES_DEG_S: [f64; 8] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0];
const DRIFTS_ARCSEC_S: [f64; 4] = [1.0, 3.0, 10.0, 30.0];
const DURATIONS_S: [f64; 2] = [60.0, 300.0];
/// Share of a one-way slew in which the rate rises, and falls.
const RAMP: f64 = 0.2;
/// Most frames of a manoeuvre that are worked out.
const MOST_FRAMES: usize = 60;
/// Manoeuvres worked out at once.
const BATCH: usize = 8;

/// Kinds of motion, by the name in the report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Slew,
    ToAndFro,
    Drift,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Slew => "slew",
            Self::ToAndFro => "to_and_fro",
            Self::Drift => "drift",
        }
    }
}

/// A manoeuvre of the library.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Flown {
    kind: Kind,
    axis: Vector3<f64>,
    peak_rad_s: f64,
    pub(crate) duration_s: f64,
    ramp_s: f64,
    /// When it begins, and from which attitude.
    start_s: f64,
    from: UnitQuaternion<f64>,
}

impl Flown {
    fn new(kind: Kind, axis: [f64; 3], peak_rad_s: f64, duration_s: f64) -> Self {
        let leg_s = match kind {
            Kind::Slew => duration_s,
            Kind::ToAndFro => 0.5 * duration_s,
            Kind::Drift => 0.0,
        };
        Self {
            kind,
            axis: Vector3::from(axis).normalize(),
            peak_rad_s,
            duration_s,
            ramp_s: RAMP * leg_s,
            start_s: 0.0,
            from: UnitQuaternion::identity(),
        }
    }

    fn starting(self, start_s: f64, from: UnitQuaternion<f64>) -> Self {
        Self {
            start_s,
            from,
            ..self
        }
    }

    /// Rate and angle at a time since the start.
    fn at(&self, t_s: f64) -> [f64; 2] {
        match self.kind {
            Kind::Drift => [self.peak_rad_s, self.peak_rad_s * t_s],
            Kind::Slew => self.leg(t_s, self.duration_s),
            Kind::ToAndFro => {
                let half = 0.5 * self.duration_s;
                let [rate, angle] = self.leg(t_s.min(half), half);
                if t_s <= half {
                    return [rate, angle];
                }
                let [back, turned] = self.leg(t_s - half, half);
                [-back, angle - turned]
            }
        }
    }

    fn leg(&self, t_s: f64, duration_s: f64) -> [f64; 2] {
        let (peak, ramp) = (self.peak_rad_s, self.ramp_s);
        let rise = |s: f64| {
            let s = s.clamp(0.0, 1.0);
            let rate = s * s * s * (10.0 + s * (6.0 * s - 15.0));
            let angle = s * s * s * s * (2.5 + s * (s - 3.0));
            [peak * rate, peak * ramp * angle]
        };
        let whole = peak * (duration_s - ramp);
        if t_s <= ramp {
            rise(t_s / ramp)
        } else if t_s <= duration_s - ramp {
            [peak, peak * (t_s - 0.5 * ramp)]
        } else {
            let [rate, left] = rise((duration_s - t_s) / ramp);
            [rate, whole - left]
        }
    }

    /// The whole angle that the tracker turns through, rad.
    pub(crate) fn path_rad(&self) -> f64 {
        match self.kind {
            Kind::Drift => self.peak_rad_s * self.duration_s,
            Kind::Slew => self.peak_rad_s * (self.duration_s - self.ramp_s),
            Kind::ToAndFro => 2.0 * self.peak_rad_s * (0.5 * self.duration_s - self.ramp_s),
        }
    }

    /// Axis of the turn, tracker axes.
    pub(crate) fn axis(&self) -> Vector3<f64> {
        self.axis
    }

    /// How many frames are worked out, and how many there are, one every `step_s`.
    pub(crate) fn frames(&self, step_s: f64) -> (usize, f64) {
        let whole = (self.duration_s / step_s).max(1.0);
        let count = (1..=MOST_FRAMES).take_while(|&n| n as f64 <= whole).count();
        (count, whole)
    }

    /// `frames` times over the manoeuvre.
    pub(crate) fn times(&self, frames: usize) -> Vec<f64> {
        let step = self.duration_s / frames as f64;
        (0..frames)
            .map(|k| self.start_s + (k as f64 + 0.5) * step)
            .collect()
    }

    /// The motion as a series at these times.
    pub(crate) fn series(&self, t_s: &[f64]) -> Option<AttitudeSeries> {
        let q = t_s.iter().filter_map(|&t| self.attitude(t)).collect();
        let rates = t_s.iter().filter_map(|&t| self.rate_rad_s(t)).collect();
        AttitudeSeries::new(t_s.to_vec(), q, Some(rates)).ok()
    }

    fn told(&self, sigma: f64, text: String) -> Manoeuvre {
        Manoeuvre {
            kind: self.kind.name().to_owned(),
            axis: self.axis.into(),
            rate_deg_s: self.peak_rad_s.to_degrees(),
            duration_s: self.duration_s,
            ramp_s: self.ramp_s,
            sigma,
            text,
        }
    }

    /// In words, such as "a slew about the boresight of at most 0.2 deg/s for 60 s".
    fn words(&self) -> String {
        let about = match self.axis.iamax() {
            2 => "the boresight",
            _ if self.axis.y.abs() < 0.1 => "X",
            _ if self.axis.x.abs() < 0.1 => "Y",
            _ => "X and Y alike",
        };
        let rate = match self.kind {
            Kind::Drift => format!("{} arcsec/s", short(self.peak_rad_s * ARCSEC_PER_RAD)),
            _ => format!("{} deg/s", short(self.peak_rad_s.to_degrees())),
        };
        let what = match (self.kind, self.axis.iamax()) {
            (Kind::Drift, _) => format!("a steady drift about {about} of {rate}"),
            (Kind::Slew, 2) => format!("a roll slew of {rate}"),
            (Kind::Slew, _) => format!("a slew about {about} of {rate}"),
            (Kind::ToAndFro, 2) => format!("a roll to and fro of {rate}"),
            (Kind::ToAndFro, _) => format!("a slew about {about} to and fro of {rate}"),
        };
        format!("{what} for {} s", short(self.duration_s))
    }
}

impl AttitudeSource for Flown {
    /// A little beyond both ends the motion goes on as it was there.
    fn attitude(&self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        let since = t_s - self.start_s;
        let inside = since.clamp(0.0, self.duration_s);
        let [rate, angle] = self.at(inside);
        let angle = angle + rate * (since - inside);
        // the tracker turns by +angle, what it sees by -angle
        Some(rotation_from_vector(&(self.axis * -angle)) * self.from)
    }

    fn rate_rad_s(&self, t_s: f64) -> Option<Vector3<f64>> {
        let since = (t_s - self.start_s).clamp(0.0, self.duration_s);
        Some(self.axis * self.at(since)[0])
    }

    fn span_s(&self) -> [f64; 2] {
        [self.start_s, self.start_s + self.duration_s]
    }
}

/// All manoeuvres, those that turn least first.
fn library() -> Vec<Flown> {
    let axes = [
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 1.0, 0.0],
    ];
    let mut all = Vec::new();
    for axis in axes {
        for duration in DURATIONS_S {
            for rate in RATES_DEG_S.map(f64::to_radians) {
                all.push(Flown::new(Kind::Slew, axis, rate, duration));
                all.push(Flown::new(Kind::ToAndFro, axis, rate, duration));
            }
            for drift in DRIFTS_ARCSEC_S {
                all.push(Flown::new(
                    Kind::Drift,
                    axis,
                    drift / ARCSEC_PER_RAD,
                    duration,
                ));
            }
        }
    }
    all.sort_by(|a, b| {
        let key = |m: &Flown| (m.path_rad(), m.duration_s);
        let (a, b) = (key(a), key(b));
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    all
}

/// Two effects that are to be told apart: columns among those of the candidates.
#[derive(Clone, Debug)]
pub(crate) struct Pair {
    /// Columns of the effect that was found, and its amplitudes.
    pub(crate) columns: Vec<usize>,
    pub(crate) amplitudes: Vec<f64>,
    /// Columns of the other.
    pub(crate) other: Vec<usize>,
    /// What both are called.
    pub(crate) names: [String; 2],
}

impl Pair {
    /// Sigmas by which data with this information tells the two apart.
    pub(crate) fn sigma(&self, information: &DMatrix<f64>) -> f64 {
        let part = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| {
                information[(rows[i], columns[j])]
            })
        };
        let own = part(&self.columns, &self.columns);
        let cross = part(&self.other, &self.columns);
        let a = DVector::from_row_slice(&self.amplitudes);
        let imitated = &cross * &a;
        // columns of different units: all of length 1 before small directions are dropped
        let other = part(&self.other, &self.other);
        let scale: Vec<f64> = (0..self.other.len())
            .map(|i| {
                let d = other[(i, i)];
                if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }
            })
            .collect();
        let unit = DMatrix::from_fn(self.other.len(), self.other.len(), |i, j| {
            other[(i, j)] * scale[i] * scale[j]
        });
        let eigen = SymmetricEigen::new(unit);
        let scaled = DVector::from_fn(scale.len(), |i, _| imitated[i] * scale[i]);
        let turned = eigen.eigenvectors.transpose() * scaled;
        let taken: f64 = turned
            .iter()
            .zip(eigen.eigenvalues.iter())
            .filter(|(_, e)| **e > 1e-9)
            .map(|(t, e)| t * t / e)
            .sum();
        (a.dot(&(own * &a)) - taken).max(0.0).sqrt()
    }
}

/// Information on the candidates' columns in `evidence`, with noise of `variance` a scalar and the
/// nuisance eliminated.
pub(crate) fn information(
    evidence: &dyn Evidence,
    candidates: &[&dyn Candidate],
    folds: &Folds,
    variance: f64,
) -> Option<DMatrix<f64>> {
    let layout = Layout {
        nuisance_precision: evidence.precision(),
        relative: evidence.relative(),
        candidates: candidates.iter().map(|c| c.coefficients().len()).sum(),
        residuals: evidence.residual_columns(),
    };
    let total = evidence.grams(folds, candidates).total();
    Some(layout.without_nuisance(&total, variance)? / variance)
}

/// The smallest manoeuvre of the library for each pair, or the best of them. `fly` gives the
/// information of all candidates' columns along a manoeuvre.
pub(crate) fn recommend(
    pairs: &[Pair],
    start_s: f64,
    from: UnitQuaternion<f64>,
    fly: &(dyn Fn(&Flown) -> Option<DMatrix<f64>> + Sync),
) -> Vec<Option<Manoeuvre>> {
    let library: Vec<Flown> = library()
        .into_iter()
        .map(|m| m.starting(start_s, from))
        .collect();
    let mut best: Vec<Option<(Flown, f64)>> = vec![None; pairs.len()];
    for batch in library.chunks(BATCH) {
        let open =
            |best: &[Option<(Flown, f64)>], k: usize| best[k].is_none_or(|b| b.1 < NEEDED_SIGMA);
        if (0..pairs.len()).all(|k| !open(&best, k)) {
            break;
        }
        let flown: Vec<Option<DMatrix<f64>>> = batch.par_iter().map(fly).collect();
        for (manoeuvre, information) in batch.iter().zip(&flown) {
            let Some(information) = information else {
                continue;
            };
            for (k, pair) in pairs.iter().enumerate() {
                let sigma = pair.sigma(information);
                if open(&best, k) && best[k].is_none_or(|b| sigma > b.1) {
                    best[k] = Some((*manoeuvre, sigma));
                }
            }
        }
    }
    let tried = library.len();
    best.into_iter()
        .zip(pairs)
        .map(|(best, pair)| {
            let (manoeuvre, sigma) = best?;
            let [a, b] = &pair.names;
            let words = manoeuvre.words();
            let text = if sigma >= NEEDED_SIGMA {
                format!("{words} separates {a} from {b} at {} sigma", short(sigma))
            } else {
                let most = short((10.0 * sigma).round() / 10.0);
                if sigma < 1.0 {
                    format!("none of {tried} motions of at most {} s tells {a} from {b}: at most {most} sigma", DURATIONS_S[1])
                } else {
                    format!("none of {tried} motions tells {a} from {b} at 5 sigma; the best is {words}, at {most} sigma")
                }
            };
            Some(manoeuvre.told(sigma, text))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rate is the derivative of the angle, and the whole angle is that of the path.
    #[test]
    fn motions_are_what_they_say() {
        for manoeuvre in library() {
            let h = 1e-4;
            for k in 1..40 {
                let t = manoeuvre.duration_s * f64::from(k) / 40.0;
                if (t - 0.5 * manoeuvre.duration_s).abs() < 0.1 {
                    continue;
                }
                let [rate, _] = manoeuvre.at(t);
                let slope = (manoeuvre.at(t + h)[1] - manoeuvre.at(t - h)[1]) / (2.0 * h);
                // third derivative of the quintic: 60 peak/ramp^2, ramp >= 6 s
                assert!(
                    (rate - slope).abs() < 1e-7 * manoeuvre.peak_rad_s,
                    "{manoeuvre:?} at {t}"
                );
            }
            let steps = 10_000;
            let dt = manoeuvre.duration_s / f64::from(steps);
            let path: f64 = (0..steps)
                .map(|k| manoeuvre.at((f64::from(k) + 0.5) * dt)[0].abs() * dt)
                .sum();
            assert!((path / manoeuvre.path_rad() - 1.0).abs() < 1e-6);
            let turned =
                manoeuvre.attitude(7.0).unwrap() * manoeuvre.attitude(7.1).unwrap().inverse();
            // v' = -omega x v: what is seen turns against the tracker, so that going back turns with it
            let along = focal_plane::rotation_vector(&turned, &UnitQuaternion::identity())
                .dot(&manoeuvre.axis);
            assert!(along > 0.0);
        }
    }

    /// One column each, at an angle: what the other cannot imitate is the sine.
    #[test]
    fn what_the_other_imitates_does_not_count() {
        let pair = Pair {
            columns: vec![0],
            amplitudes: vec![2.0],
            other: vec![1],
            names: [String::new(), String::new()],
        };
        let likeness = 0.6;
        let information = DMatrix::from_row_slice(
            2,
            2,
            &[9.0, likeness * 3.0 * 5e4, likeness * 3.0 * 5e4, 25e8],
        );
        // 2 * 3 * sqrt(1 - 0.36)
        assert!((pair.sigma(&information) - 4.8).abs() < 1e-12);
        let same = DMatrix::from_row_slice(2, 2, &[9.0, 15e4, 15e4, 25e8]);
        assert!(pair.sigma(&same) < 1e-6);
    }
}
