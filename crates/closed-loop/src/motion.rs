//! Whether the samples of a motion resolve it.
//!
//! Rates and accelerations from differences of a series of attitudes are motion
//! only where its neighbours predict a sample. Where they do not (jitter faster
//! than the samples, or noise larger than the motion), the differences hold the
//! same noise as the residual against that series, and a time tag or a smear
//! "explains" it without being there. The test is the error of the cubic through
//! four neighbours,
//!
//! ```text
//! e_k = q_k - (-q_{k-2} + 4 q_{k-1} + 4 q_{k+1} - q_{k+2}) / 6
//! ```
//!
//! against the step `q_{k+1} - q_k`: for white noise of variance s^2 they have
//! variances (1 + 34/36) s^2 and 2 s^2, so nearly alike; for a resolved motion the
//! error is of fourth order in the step (where steps differ: the cubic through the four as they lie). Samples on both
//! sides of a hole predict nothing. What is a hole, the motion says: a step that is longer than those over which
//! the series, thinned, predicts itself as well.
//! Many samples resolve together what single ones do not: a motion whose steps are half the noise is one all the
//! same, and the path is a polynomial nearest to many of them ([`stencil`]). So means of 2, 4 and 8
//! samples are tried where single ones fail. Of white noise they are as unpredictable as the samples, of a wander
//! that is faster than they are, too.
//! A turn about the boresight counts by what it moves in the data, `arm` times itself:
//! stars of a narrow field tell their roll badly, and hardly move with it.
//!
//! Source: Lagrange interpolation; the errors-in-variables trap of regression.

mod around;
pub(crate) mod gyro;
pub(crate) mod neighbours;
mod piece;
mod rates;
mod stencil;

pub(crate) use around::Around;

use focal_plane::{
    ARCSEC_PER_RAD, AttitudeSeries, AttitudeSource, Camera, Series, rotation_from_vector,
    rotation_vector,
};
use nalgebra::{UnitQuaternion, Vector3};
use spectra::robust::median_step;

use crate::gaps::longest_step;
use stencil::Stencil;

/// Largest ratio of prediction error to step at which the motion is resolved.
const RESOLVED: f64 = 0.3;
/// Squares of the prediction error over those of second differences beyond which a path's own errors make most of these:
/// of a walk alone they are 5/18, of white noise 35/108. What else accelerates then makes less than 0.4 of what a walk does.
const ERRORS_ALONE: f64 = 0.2;
/// Samples whose means are tried where single ones resolve nothing.
const AVERAGED: [usize; 3] = [2, 4, 8];
/// Share of a step that is one: jitter is no shorter.
const NEARLY: f64 = 0.9;
/// Steps to which a series is thinned, the widest first: what they predict is no hole.
const THINNED: [f64; 4] = [16.0, 8.0, 4.0, 2.0];

/// Whether a series of attitudes tells how the tracker moved between them.
fn resolved(t_s: &[f64], q: &[UnitQuaternion<f64>], arm: f64) -> bool {
    is_small(prediction_error(t_s, q, arm, |_, [_, next]| *next))
}

/// Whether there is a prediction error, and it is one at which what is predicted is told.
fn is_small(error: Option<f64>) -> bool {
    error.is_some_and(|error| error <= RESOLVED * RESOLVED)
}

/// Whether it tells how that motion changed: the same against second differences, of which a walk of variance
/// s^2 a step has 2 s^2 and the error 20/36 s^2. What such a walk seems to accelerate by goes with itself, where
/// the path is one through attitudes ([`Around::by_rates`]).
pub(crate) fn accelerates(series: &AttitudeSeries, arm: f64) -> bool {
    is_small(error_of_change(series, arm))
}

/// Whether all that it seems to accelerate by is its own error: see [`ERRORS_ALONE`].
pub(crate) fn only_errs(series: &AttitudeSeries, arm: f64) -> bool {
    error_of_change(series, arm).is_some_and(|error| error > ERRORS_ALONE)
}

/// [`prediction_error`] over second differences.
fn error_of_change(series: &AttitudeSeries, arm: f64) -> Option<f64> {
    let change = |[before, after]: [f64; 2], [last, next]: [&Vector3<f64>; 2]| {
        2.0 * (last * after - next * before) / (after - before)
    };
    prediction_error(series.t_s(), series.quaternions(), arm, change)
}

/// The squares of what samples are off from where their neighbours predict them over those of `size`, of the times to
/// those before and after, and the turns; `None` without neighbours.
fn prediction_error(
    t_s: &[f64],
    q: &[UnitQuaternion<f64>],
    arm: f64,
    size: impl Fn([f64; 2], [&Vector3<f64>; 2]) -> Vector3<f64>,
) -> Option<f64> {
    const AROUND: [usize; 4] = [0, 1, 3, 4];
    let longest = longest_step(t_s);
    let (mut error, mut step, mut count) = (0.0, 0.0, 0_u32);
    for (t, w) in t_s.windows(5).zip(q.windows(5)) {
        if t.windows(2).any(|pair| pair[1] - pair[0] > longest) {
            continue;
        }
        let at = AROUND.map(|k| t[k] - t[2]);
        let turns = AROUND.map(|k| rotation_vector(&w[k], &w[2]));
        let weighed = cubic_at_zero(at).into_iter().zip(&turns);
        let predicted: Vector3<f64> = weighed.map(|(weight, turn)| turn * weight).sum();
        let moves = Vector3::new(1.0, 1.0, arm);
        error += predicted.component_mul(&moves).norm_squared();
        let size = size([at[1], at[2]], [&turns[1], &turns[2]]);
        step += size.component_mul(&moves).norm_squared();
        count += 1;
    }
    // what does not move at all is predicted
    let still = error <= 0.0;
    (count > 0).then(|| if still { 0.0 } else { error / step })
}

/// What values at four places weigh in the cubic through them, at 0: Lagrange's polynomials.
fn cubic_at_zero(at: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|i| {
        let others = (0..4).filter(|&j| j != i);
        others.map(|j| at[j] / (at[j] - at[i])).product()
    })
}

/// The longest step of a series over which its samples predict each other, s: a longer one is a hole.
fn reach_s(series: &AttitudeSeries, arm: f64) -> f64 {
    let t_s = series.t_s();
    let longest = longest_step(t_s);
    let Some(step) = median_step(t_s).filter(|_| t_s.windows(2).any(|t| t[1] - t[0] > longest))
    else {
        return longest;
    };
    let bridged = THINNED.into_iter().find(|steps| {
        let (t_s, q) = thinned(series, steps * step);
        resolved(&t_s, &q, arm)
    });
    longest + bridged.map_or(0.0, |steps| (steps - 1.0) * step)
}

/// Samples of a series that lie at least about as far apart as this, s.
fn thinned(series: &AttitudeSeries, apart_s: f64) -> (Vec<f64>, Vec<UnitQuaternion<f64>>) {
    let mut last = f64::NEG_INFINITY;
    let samples = series.t_s().iter().zip(series.quaternions());
    let far = samples.filter(|(t, _)| {
        let far = **t - last >= NEARLY * apart_s;
        if far {
            last = **t;
        }
        far
    });
    far.map(|(t, q)| (*t, *q)).unzip()
}

/// A series as a motion around each frame, as far as its samples resolve one.
pub(crate) fn around(series: &AttitudeSeries, t_s: &[f64], arm: f64) -> Around {
    let stencil = is_motion(series, arm).then(|| Stencil::of(series, reach_s(series, arm)));
    Around::new(series, t_s, stencil.as_ref())
}

/// The series turned by `arcsec` in tracker axes, which is known at `t_s`, and beyond these as at the first and
/// last. `None`: nothing is known.
pub(crate) fn turned_by(
    series: &AttitudeSeries,
    t_s: &[f64],
    arcsec: &[Vector3<f64>],
) -> Option<AttitudeSeries> {
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let values = arcsec.iter().map(|turn| turn[axis]).collect();
        Series::new(t_s.to_vec(), values).ok()
    });
    let axes = [x?, y?, z?];
    let (first, last) = (*t_s.first()?, *t_s.last()?);
    let turned = series.t_s().iter().zip(series.quaternions());
    let turned = turned.map(|(t, q)| {
        let turn = axes.each_ref().map(|axis| axis.at(t.clamp(first, last)));
        let turn = turn.map(|arcsec| arcsec.unwrap_or(0.0) / ARCSEC_PER_RAD);
        rotation_from_vector(&Vector3::from(turn)) * q
    });
    let rates = series.given_rates_rad_s().map(<[_]>::to_vec);
    let turned = AttitudeSeries::new(series.t_s().to_vec(), turned.collect(), rates).ok()?;
    Some(turned.with_max_gap_s(series.max_gap_s()))
}

/// Whether it is not known how the tracker moved around each of the times, where it is around others.
pub(crate) fn lost(series: &AttitudeSeries, t_s: &[f64], arm: f64) -> Vec<bool> {
    let stencil = is_motion(series, arm).then(|| Stencil::plain(reach_s(series, arm)));
    let around = Around::new(series, t_s, stencil.as_ref());
    (0..t_s.len()).map(|k| around.lost(k)).collect()
}

/// Rates that were measured do not come from differences.
fn is_motion(series: &AttitudeSeries, arm: f64) -> bool {
    let known = series.given_rates_rad_s().is_some();
    known
        || resolved(series.t_s(), series.quaternions(), arm)
        || AVERAGED.iter().any(|&count| {
            let (t_s, q) = means(series, count);
            resolved(&t_s, &q, arm)
        })
}

/// Means of `count` samples in a row, with no hole among them.
fn means(series: &AttitudeSeries, count: usize) -> (Vec<f64>, Vec<UnitQuaternion<f64>>) {
    let longest = longest_step(series.t_s());
    let parts = series.t_s().chunks_exact(count);
    let parts = parts.zip(series.quaternions().chunks_exact(count));
    let whole = parts.filter(|(t, _)| t.windows(2).all(|pair| pair[1] - pair[0] <= longest));
    whole
        .map(|(t, q)| {
            let turns: Vector3<f64> = q.iter().map(|each| rotation_vector(each, &q[0])).sum();
            let mean = rotation_from_vector(&(turns / count as f64)) * q[0];
            (t.iter().sum::<f64>() / count as f64, mean)
        })
        .unzip()
}

/// What a star half-way up the field's edge moves by as it rolls.
pub(crate) fn roll_arm(camera: &Camera) -> f64 {
    camera.half_size_px()[0] / camera.focal_length_px()[0]
}

/// The motion as effects see it.
pub(crate) fn source(around: Option<&Around>) -> Option<&dyn AttitudeSource> {
    around.map(|a| a as &dyn AttitudeSource)
}

#[cfg(test)]
mod tests {
    use super::*;
    use focal_plane::rotation_from_vector;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    fn time() -> Vec<f64> {
        (0..500).map(|k| f64::from(k) * 0.5).collect()
    }

    fn series(noise: f64) -> Vec<UnitQuaternion<f64>> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        (0..500)
            .map(|k| {
                let t = f64::from(k) * 0.5;
                let path = Vector3::new((0.02 * t).sin(), 0.3 * (0.05 * t).cos(), 0.1 * t) * 1e-3;
                rotation_from_vector(&(path + Vector3::new(normal(), normal(), normal()) * noise))
            })
            .collect()
    }

    #[test]
    fn a_smooth_path_is_resolved_and_noise_is_not() {
        assert!(resolved(&time(), &series(1e-6), 1.0));
        assert!(!resolved(&time(), &series(1e-3), 1.0));
    }

    /// A swing of 60 samples a turn whose largest step is 1.6 times the noise: single samples are off from their
    /// neighbours' prediction by what they step, means of four step by four times as much and have half the noise.
    /// White noise has means like itself.
    #[test]
    fn a_path_of_many_samples_is_resolved_by_their_means() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
        let mut noisy = |swing: f64| {
            let t_s: Vec<f64> = (0..2400).map(|k| 0.1 * f64::from(k)).collect();
            let q = t_s.iter().map(|t| {
                let path = Vector3::x() * swing * (std::f64::consts::TAU * t / 6.0).sin();
                let noise: [f64; 3] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                rotation_from_vector(&(path + Vector3::from(noise) * 1e-6))
            });
            let q = q.collect();
            AttitudeSeries::new(t_s, q, None).unwrap()
        };
        let path = noisy(1.5e-5);
        assert!(!resolved(path.t_s(), path.quaternions(), 1.0));
        assert!(is_motion(&path, 1.0));
        assert!(!is_motion(&noisy(0.0), 1.0));
    }

    /// 2 - 3 s + 0.4 s^3 at 0, from four places that are not evenly spaced; and the even ones' -1/6, 4/6.
    #[test]
    fn a_cubic_is_told_by_four_places() {
        let cubic = |s: f64| 2.0 - 3.0 * s + 0.4 * s.powi(3);
        let at = [-3.1, -0.9, 1.0, 4.5];
        let told: f64 = cubic_at_zero(at)
            .iter()
            .zip(at)
            .map(|(w, s)| w * cubic(s))
            .sum();
        assert!((told - 2.0).abs() < 1e-12);
        let even = cubic_at_zero([-2.0, -1.0, 1.0, 2.0]);
        for (weight, want) in even.iter().zip([-1.0, 4.0, 4.0, -1.0]) {
            assert!((6.0 * weight - want).abs() < 1e-12);
        }
    }

    /// A swing of a hundred steps, of which three in ten samples are missing: what is missing is told by the others,
    /// and no frame is lost. Of a swing of five steps the samples beside a missing one tell nothing.
    #[test]
    fn what_the_motion_bridges_is_no_hole() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
        let mut share_lost = |period: f64| {
            let kept = |_: &f64| {
                rand_distr::Uniform::new(0.0, 1.0).is_ok_and(|u| u.sample(&mut rng) > 0.3)
            };
            let t_s: Vec<f64> = (0..900).map(f64::from).filter(kept).collect();
            let swing = |t: &f64| Vector3::x() * 1e-3 * (std::f64::consts::TAU * t / period).sin();
            let q = t_s
                .iter()
                .map(|t| rotation_from_vector(&swing(t)))
                .collect();
            let series = AttitudeSeries::new(t_s.clone(), q, None).unwrap();
            let lost = lost(&series, &t_s, 1.0);
            lost.iter().filter(|lost| **lost).count() as f64 / t_s.len() as f64
        };
        assert!(share_lost(100.0) < 1e-12);
        let fast = share_lost(6.5);
        assert!((0.2..0.6).contains(&fast), "{fast}");
    }

    /// Roll with the noise of twenty steps, in a field of a few degrees: a twentieth of a step is what it
    /// moves stars by.
    #[test]
    fn roll_counts_by_what_it_moves() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
        let rolled: Vec<_> = series(1e-7)
            .into_iter()
            .map(|q| {
                let noise: f64 = StandardNormal.sample(&mut rng);
                rotation_from_vector(&Vector3::new(0.0, 0.0, 2e-4 * noise)) * q
            })
            .collect();
        assert!(!resolved(&time(), &rolled, 1.0));
        assert!(resolved(&time(), &rolled, 0.005));
    }

    /// A walk of 3e-7 rad a step on a steady drift of 1e-4: steps are the drift's, their changes the walk's, of which
    /// the error is sqrt(20/72) = 0.53. On a swing that changes by 1e-5 a step they are the swing's.
    #[test]
    fn a_walk_on_a_drift_does_not_accelerate() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(6);
        let mut series = |path: &dyn Fn(f64) -> f64| {
            let mut walk = Vector3::zeros();
            let q = time().into_iter().map(|t| {
                let step: [f64; 3] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                walk += Vector3::from(step) * 3e-7;
                rotation_from_vector(&(walk + Vector3::new(path(t), 0.0, 0.0)))
            });
            AttitudeSeries::new(time(), q.collect(), None).unwrap()
        };
        let drift = series(&|t| 2e-4 * t);
        assert!(resolved(drift.t_s(), drift.quaternions(), 1.0) && !accelerates(&drift, 1.0));
        assert!(only_errs(&drift, 1.0));
        let swing = series(&|t| 1e-3 * (0.2 * t).sin());
        assert!(accelerates(&swing, 1.0) && !only_errs(&swing, 1.0));
    }

    /// A path of 3e-5 rad a step, and holes across which it turns by up to 1e-2.
    #[test]
    fn holes_say_nothing_of_the_motion_between_samples() {
        let kept = |k: usize| !(100..220).contains(&k) && !(300..420).contains(&k);
        let of = |noise: f64| {
            let q = series(noise);
            let rows = (0..q.len()).filter(|&k| kept(k));
            rows.map(|k| (time()[k], q[k])).unzip()
        };
        let (t_s, q): (Vec<f64>, Vec<_>) = of(1e-6);
        assert!(resolved(&t_s, &q, 1.0));
        let (t_s, q): (Vec<f64>, Vec<_>) = of(1e-3);
        assert!(!resolved(&t_s, &q, 1.0));
    }
}
