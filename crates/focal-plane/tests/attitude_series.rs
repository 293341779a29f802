//! Attitude between samples against closed-form motions.

#![expect(
    clippy::float_cmp,
    reason = "exact at samples; batches compute what single calls do"
)]

use focal_plane::{
    AttitudeError, AttitudeSeries, AttitudeSource, QuaternionsMut, UniformRotation,
    rotation_from_vector, rotation_vector,
};
use nalgebra::{UnitQuaternion, Vector3};

/// A motion that does not commute with itself, as `exp(a ex) exp(b ey) exp(c ez) q0`.
fn attitude(t: f64) -> UnitQuaternion<f64> {
    let [a, b, c] = angles(t);
    rotation_from_vector(&(Vector3::x() * a))
        * rotation_from_vector(&(Vector3::y() * b))
        * rotation_from_vector(&(Vector3::z() * c))
        * rotation_from_vector(&Vector3::new(0.4, 1.9, -0.7))
}

fn angles(t: f64) -> [f64; 3] {
    [
        0.3 * (0.9 * t).sin(),
        0.2 * (1.3 * t).cos(),
        0.25 * t + 0.1 * (0.7 * t).sin(),
    ]
}

/// `dq/dt = W q` with `W = a' ex + R(a) b' ey + R(a) R(b) c' ez`, and `omega = -W`.
fn rate(t: f64) -> Vector3<f64> {
    let [a, b, _] = angles(t);
    let [da, db, dc] = [
        0.27 * (0.9 * t).cos(),
        -0.26 * (1.3 * t).sin(),
        0.25 + 0.07 * (0.7 * t).cos(),
    ];
    let ra = rotation_from_vector(&(Vector3::x() * a));
    let rb = rotation_from_vector(&(Vector3::y() * b));
    -(Vector3::x() * da + ra * Vector3::y() * db + ra * (rb * Vector3::z()) * dc)
}

const SPAN_S: f64 = 12.0;

fn grid(steps: u32) -> Vec<f64> {
    (0..=steps)
        .map(|k| SPAN_S * f64::from(k) / f64::from(steps))
        .collect()
}

fn sampled(t_s: Vec<f64>, with_rates: bool) -> Result<AttitudeSeries, AttitudeError> {
    let q = t_s.iter().map(|&t| attitude(t)).collect();
    let rates = with_rates.then(|| t_s.iter().map(|&t| rate(t)).collect());
    AttitudeSeries::new(t_s, q, rates)
}

/// Largest error of attitude, rad, and of rate, rad/s, over times that avoid the samples.
fn largest_errors(series: &AttitudeSeries) -> [f64; 2] {
    let mut worst = [0.0_f64; 2];
    for k in 1..5000 {
        let t = SPAN_S * f64::from(k) / 5000.0;
        let q = series.attitude(t).unwrap_or_default();
        let w = series.rate_rad_s(t).unwrap_or_default();
        worst[0] = worst[0].max(rotation_vector(&q, &attitude(t)).norm());
        worst[1] = worst[1].max((w - rate(t)).norm());
    }
    worst
}

/// Halving the step divides the error by 2^order, up to the next order: at steps of 0.1 to 0.4 s
/// and frequencies near 1 rad/s its relative size is below (omega h) = 0.4, worth 0.3 in the order.
/// `ends`: what a slope at an end, of an order more but a larger factor, may add where it still outweighs the rest.
fn assert_orders(
    with_rates: bool,
    of_attitude: f64,
    of_rate: f64,
    ends: f64,
) -> Result<(), AttitudeError> {
    let errors = [30, 60, 120]
        .map(|steps| sampled(grid(steps), with_rates).map(|series| largest_errors(&series)));
    let [coarse, middle, fine] = errors;
    let (coarse, middle, fine) = (coarse?, middle?, fine?);
    for (big, small) in [(coarse, middle), (middle, fine)] {
        for (k, order) in [of_attitude, of_rate].into_iter().enumerate() {
            let got = (big[k] / small[k]).log2();
            assert!(
                got > order - 0.3 && got < order + ends + 0.3,
                "order {got}, theory {order}: {big:?} {small:?}"
            );
        }
    }
    Ok(())
}

#[test]
fn error_falls_as_h4_with_rates() -> Result<(), AttitudeError> {
    assert_orders(true, 4.0, 3.0, 0.0)
}

#[test]
fn error_falls_as_h4_with_slopes_from_neighbours() -> Result<(), AttitudeError> {
    assert_orders(false, 4.0, 3.0, 1.0)
}

/// About one axis the rotation vector is a scalar, and the error of a cubic Hermite is at most
/// `h^4/384 max |f''''|`, reached where the fourth derivative is largest. A 0.036 Hz mode of
/// 100 arcsec at 2 Hz: 4e-5 arcsec; slerp would give `h^2/8 max |f''|` = 0.16 arcsec.
#[test]
fn one_axis_meets_the_bound_of_hermite_interpolation() -> Result<(), AttitudeError> {
    let (amplitude, w, h) = (100.0 / focal_plane::ARCSEC_PER_RAD, 2.0, 0.5);
    let axis = Vector3::new(2.0, -1.0, 2.0) / 3.0;
    let truth = |t: f64| rotation_from_vector(&(axis * (amplitude * (w * t).sin())));
    let t_s: Vec<f64> = (0..40).map(|k| h * f64::from(k)).collect();
    let series = AttitudeSeries::new(
        t_s.clone(),
        t_s.iter().map(|&t| truth(t)).collect(),
        Some(
            t_s.iter()
                .map(|&t| axis * (-amplitude * w * (w * t).cos()))
                .collect(),
        ),
    )?;
    let bound = h.powi(4) / 384.0 * amplitude * w.powi(4);
    let worst = (0..1950)
        .map(|k| 0.01 * f64::from(k))
        .map(|t| rotation_vector(&series.attitude(t).unwrap_or_default(), &truth(t)).norm())
        .fold(0.0, f64::max);
    assert!(
        worst < bound + 1e-15 && worst > 0.9 * bound,
        "{worst:.3e} against {bound:.3e}"
    );
    Ok(())
}

/// The slope at zero of the polynomial through zero and n points at `t_k` errs by
/// `f^(n+1)/(n+1)! prod(-t_k)`: of four neighbours by `h^4/30 f^(5)` with two on each side, by `-h^4/20 f^(5)` with
/// one before and three behind, and at the ends themselves, where all lie on one side, by `h^4/5 f^(5)`. Next order:
/// below `w h` of it, and next to and at an end, where the neighbours reach three and four steps, below `4 w h`.
#[test]
fn rates_from_neighbours_have_the_error_of_their_polynomial() -> Result<(), AttitudeError> {
    let (w, h) = (0.48_f64, 0.5_f64);
    let truth = |t: f64| rotation_from_vector(&(Vector3::y() * (1e-3 * (w * t).sin())));
    let t_s: Vec<f64> = (0..9).map(|k| h * f64::from(k)).collect();
    let series = AttitudeSeries::new(t_s.clone(), t_s.iter().map(|&t| truth(t)).collect(), None)?;
    for (k, &t) in t_s.iter().enumerate() {
        let got = series.rate_rad_s(t).unwrap_or_default();
        let cos = (w * t).cos();
        let (share, next) = match k.min(8 - k) {
            0 => (1.0 / 5.0, 4.0),
            1 => (-1.0 / 20.0, 4.0),
            _ => (1.0 / 30.0, 1.0),
        };
        let size = 1e-3 * h.powi(4) * w.powi(5);
        // the fifth derivative of a sine is w^5 cos, and the rate is minus the slope
        let expected = -1e-3 * w * cos + share * size * cos;
        assert!(
            (got.y - expected).abs() < next * w * h * share.abs() * size,
            "at {t}: {} against {expected}",
            got.y
        );
        assert!(got.x.abs() + got.z.abs() < 1e-18);
    }
    Ok(())
}

/// Stars measured at one place s between the samples of a sway: what interpolation leaves goes with the rate as a
/// time tag of `(w h)^4/30 h s (1 - s) (1 - 2 s)`, 7.5e-6 of a step here. With slopes from the nearest alone it
/// is `-(w h)^2/6`: 6.9e-4 of a step, which closed loops told as a time tag at 40 nats.
#[test]
fn a_sway_between_samples_is_no_time_tag() -> Result<(), AttitudeError> {
    let (wh, s) = (core::f64::consts::TAU / 24.0, 0.63);
    let angle = |t: f64| 1e-4 * (wh * t).sin();
    let turn = |t: f64| rotation_from_vector(&(Vector3::x() * angle(t)));
    let t_s: Vec<f64> = (0..245).map(f64::from).collect();
    let series = AttitudeSeries::new(t_s.clone(), t_s.iter().map(|&t| turn(t)).collect(), None)?;
    let (mut off, mut all) = (0.0, 0.0);
    for k in 2..242 {
        let t = f64::from(k) + s;
        let rate = 1e-4 * wh * (wh * t).cos();
        let error = rotation_vector(&series.attitude(t).unwrap_or_default(), &turn(t));
        off += error.x * rate;
        all += rate * rate;
    }
    let tag = off / all;
    let expected = -wh.powi(4) / 30.0 * s * (1.0 - s) * (1.0 - 2.0 * s);
    assert!(
        (tag - expected).abs() < wh * expected.abs(),
        "{tag:.3e} against {expected:.3e}"
    );
    Ok(())
}

/// A constant acceleration about one axis is a parabola: slopes from neighbours meet it at every
/// sample, however uneven, and so does the cubic in between.
#[test]
fn uneven_samples_meet_a_parabola_exactly() -> Result<(), AttitudeError> {
    let truth = |t: f64| rotation_from_vector(&(Vector3::z() * (0.2 * t - 0.05 * t * t)));
    let t_s = vec![0.0, 0.1, 1.3, 1.5, 4.0, 4.2];
    let series = AttitudeSeries::new(t_s.clone(), t_s.iter().map(|&t| truth(t)).collect(), None)?;
    for k in 0..=420 {
        let t = 0.01 * f64::from(k);
        let q = series.attitude(t).unwrap_or_default();
        let w = series.rate_rad_s(t).unwrap_or_default();
        assert!(rotation_vector(&q, &truth(t)).norm() < 2e-15, "at {t}");
        // rounding of a logarithm, 3e-16, over steps of 0.1 s
        assert!((w.z + 0.2 - 0.1 * t).abs() < 2e-14, "at {t}");
    }
    Ok(())
}

/// The rate is the derivative of the attitude: a central difference over 2 d errs by `d^2/6 W''`
/// (below 1e-8 for d = 1e-4) and by rounding, `2e-16/d`.
#[test]
fn rate_is_the_derivative_of_the_attitude() -> Result<(), AttitudeError> {
    let series = sampled(grid(24), true)?;
    let d = 1e-4;
    for k in 0..200 {
        let t = 0.1 + 0.0583 * f64::from(k);
        let after = series.attitude(t + d).unwrap_or_default();
        let before = series.attitude(t - d).unwrap_or_default();
        let difference = -rotation_vector(&after, &before) / (2.0 * d);
        let rate = series.rate_rad_s(t).unwrap_or_default();
        // where a sample lies between, the second derivative jumps by up to h^2 W'''/12: d times it
        assert!((rate - difference).norm() < 1e-5 * rate.norm(), "at {t}");
    }
    Ok(())
}

#[test]
fn samples_and_given_rates_are_returned_exactly() -> Result<(), AttitudeError> {
    let series = sampled(grid(17), true)?;
    for (i, &t) in series.t_s().iter().enumerate() {
        assert_eq!(series.attitude(t), Some(series.quaternions()[i]));
        assert_eq!(series.rate_rad_s(t), Some(rate(t)));
        let same = series.quaternions()[i].into_inner();
        let given = attitude(t).into_inner();
        assert!(same == given || same == -given);
    }
    Ok(())
}

/// A quaternion and its negative are one rotation: flipping any of them changes nothing.
#[test]
fn signs_of_the_input_do_not_matter() -> Result<(), AttitudeError> {
    let t_s = grid(20);
    for with_rates in [false, true] {
        let plain = sampled(t_s.clone(), with_rates)?;
        let flipped = t_s
            .iter()
            .enumerate()
            .map(|(i, &t)| {
                let sign = if (i * i) % 3 == 1 { -1.0 } else { 1.0 };
                UnitQuaternion::new_unchecked(attitude(t).into_inner() * sign)
            })
            .collect();
        let rates = with_rates.then(|| t_s.iter().map(|&t| rate(t)).collect());
        let flipped = AttitudeSeries::new(t_s.clone(), flipped, rates)?;
        let mut last = plain.quaternions()[0];
        for k in 0..=1000 {
            let t = SPAN_S * f64::from(k) / 1000.0;
            let q = flipped.attitude(t).unwrap_or_default();
            assert_eq!(Some(q), plain.attitude(t));
            assert_eq!(plain.rate_rad_s(t), flipped.rate_rad_s(t));
            assert!(
                last.into_inner().dot(&q.into_inner()) > 0.9,
                "the sign jumps at {t}"
            );
            last = q;
        }
    }
    Ok(())
}

#[test]
fn nothing_is_extrapolated() -> Result<(), AttitudeError> {
    let series = sampled(grid(4), true)?;
    assert_eq!(series.span_s(), [0.0, SPAN_S]);
    for t in [-1e-9, SPAN_S + 1e-9, f64::NAN, f64::INFINITY] {
        assert_eq!((series.attitude(t), series.rate_rad_s(t)), (None, None));
    }
    Ok(())
}

/// Two samples without rates: slerp, which turns at a constant rate.
#[test]
fn two_isolated_samples_are_joined_by_slerp() -> Result<(), AttitudeError> {
    let motion = UniformRotation {
        start_s: 3.0,
        at_start: attitude(0.0),
        rate_rad_s: Vector3::new(0.2, -0.3, 0.5),
    };
    let at = |t: f64| motion.attitude(t).unwrap_or_default();
    let series = AttitudeSeries::new(vec![3.0, 4.5], vec![at(3.0), at(4.5)], None)?;
    for t in [3.0, 3.1, 4.0, 4.499, 4.5] {
        let q = series.attitude(t).unwrap_or_default();
        assert!(rotation_vector(&q, &at(t)).norm() < 2e-15);
        let w = series.rate_rad_s(t).unwrap_or_default();
        assert!((w - motion.rate_rad_s).norm() < 2e-15);
    }
    Ok(())
}

/// Two samples and one rate: the parabola, exact for a constant acceleration about one axis.
#[test]
fn one_rate_of_two_makes_a_parabola() -> Result<(), AttitudeError> {
    let truth = |t: f64| rotation_from_vector(&(Vector3::x() * (0.1 * t + 0.03 * t * t)));
    let rate = |t: f64| Vector3::x() * -(0.1 + 0.06 * t);
    let missing = Vector3::new(0.0, f64::NAN, 0.0);
    for rates in [vec![rate(0.0), missing], vec![missing, rate(2.0)]] {
        let series =
            AttitudeSeries::new(vec![0.0, 2.0], vec![truth(0.0), truth(2.0)], Some(rates))?;
        for t in [0.0, 0.3, 1.0, 1.9, 2.0] {
            let q = series.attitude(t).unwrap_or_default();
            assert!(rotation_vector(&q, &truth(t)).norm() < 1e-15);
            let w = series.rate_rad_s(t).unwrap_or_default();
            assert!((w - rate(t)).norm() < 1e-15, "{w} at {t}");
        }
    }
    Ok(())
}

/// A missing rate in a longer run comes from its neighbours; the given ones stay.
#[test]
fn missing_rates_come_from_neighbours() -> Result<(), AttitudeError> {
    let t_s = grid(24);
    let mut rates: Vec<_> = t_s.iter().map(|&t| rate(t)).collect();
    rates[7] = Vector3::repeat(f64::NAN);
    let series = AttitudeSeries::new(
        t_s.clone(),
        t_s.iter().map(|&t| attitude(t)).collect(),
        Some(rates),
    )?;
    let without = sampled(t_s.clone(), false)?;
    assert_eq!(series.rate_rad_s(t_s[7]), without.rate_rad_s(t_s[7]));
    assert_eq!(series.rate_rad_s(t_s[8]), Some(rate(t_s[8])));
    Ok(())
}

/// Inside a long hole there is no attitude, its edges are samples like any other, and slopes do
/// not look across it: each side is what it would be alone.
#[test]
fn holes_are_not_crossed() -> Result<(), AttitudeError> {
    let all: Vec<f64> = (0..24)
        .filter(|k| !(8..14).contains(k))
        .map(|k| 0.5 * f64::from(k))
        .collect();
    let whole = sampled(all.clone(), false)?;
    assert!(whole.attitude(5.0).is_some());
    let holed = whole.clone().with_max_gap_s(0.75);
    assert_eq!(holed.attitude(5.0), None);
    assert_eq!(holed.rate_rad_s(5.0), None);
    let (left, right) = (
        sampled(all[..8].to_vec(), false)?,
        sampled(all[8..].to_vec(), false)?,
    );
    for k in 0..=1150 {
        let t = 0.01 * f64::from(k);
        let alone = left.attitude(t).or_else(|| right.attitude(t));
        match (holed.attitude(t), alone) {
            (Some(got), Some(want)) => assert!(rotation_vector(&got, &want).norm() < 1e-15),
            (got, want) => assert!(got.is_none() && want.is_none(), "at {t}"),
        }
    }
    // a sample between two holes: itself, with no rate
    let lonely = sampled(vec![0.0, 1.0, 5.0, 9.0, 10.0], false)?.with_max_gap_s(2.0);
    assert_eq!(lonely.attitude(5.0), Some(lonely.quaternions()[2]));
    assert_eq!((lonely.rate_rad_s(5.0), lonely.attitude(5.1)), (None, None));
    Ok(())
}

#[test]
fn batches_and_cursors_give_the_same_in_any_order() -> Result<(), AttitudeError> {
    let series = sampled(grid(50), true)?;
    // 0.618...: visits the span in a scattered order; some times lie outside
    let t_s: Vec<f64> = (0..500)
        .map(|k| (f64::from(k) * 0.618_033_988_75).fract() * 1.1 * SPAN_S - 0.3)
        .collect();
    let n = t_s.len();
    let (mut x, mut y, mut z, mut w) = (vec![0.0; n], vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    series.attitude_into(
        &t_s,
        QuaternionsMut {
            x: &mut x,
            y: &mut y,
            z: &mut z,
            w: &mut w,
        },
    );
    let mut cursor = series.cursor();
    for (i, &t) in t_s.iter().enumerate() {
        assert_eq!(cursor.rate_rad_s(t), series.rate_rad_s(t));
        match series.attitude(t) {
            Some(q) => assert_eq!([q.i, q.j, q.k, q.w], [x[i], y[i], z[i], w[i]]),
            None => assert!(x[i].is_nan() && y[i].is_nan() && z[i].is_nan() && w[i].is_nan()),
        }
    }
    Ok(())
}

#[test]
fn bad_samples_are_named() {
    let q = UnitQuaternion::identity();
    let new = |t_s: &[f64], q: Vec<_>, rates| AttitudeSeries::new(t_s.to_vec(), q, rates).err();
    assert_eq!(new(&[], vec![], None), Some(AttitudeError::Empty));
    assert_eq!(
        new(&[0.0, 1.0], vec![q], None),
        Some(AttitudeError::Length {
            what: "quaternions",
            times: 2,
            got: 1
        })
    );
    assert_eq!(
        new(&[0.0], vec![q], Some(vec![])),
        Some(AttitudeError::Length {
            what: "rates",
            times: 1,
            got: 0
        })
    );
    assert_eq!(
        new(&[0.0, 0.0], vec![q; 2], None),
        Some(AttitudeError::Time { index: 1, t_s: 0.0 })
    );
    assert!(matches!(
        new(&[f64::NAN], vec![q], None),
        Some(AttitudeError::Time { index: 0, .. })
    ));
    let long = UnitQuaternion::new_unchecked(q.into_inner() * 1.001);
    assert_eq!(
        new(&[0.0, 2.0], vec![q, long], None),
        Some(AttitudeError::NotUnit {
            index: 1,
            t_s: 2.0,
            norm: 1.001
        })
    );
    let nan = UnitQuaternion::new_unchecked(q.into_inner() * f64::NAN);
    assert!(matches!(
        new(&[0.0], vec![nan], None),
        Some(AttitudeError::NotUnit { index: 0, .. })
    ));
    assert_eq!(
        new(&[0.0], vec![q], Some(vec![Vector3::repeat(f64::INFINITY)])),
        Some(AttitudeError::InfiniteRate { index: 0, t_s: 0.0 })
    );
}

/// Seven digits in a file leave a norm off by 1e-7: accepted, and made unit.
#[test]
fn rounded_quaternions_are_made_unit() -> Result<(), AttitudeError> {
    let rounded = UnitQuaternion::new_unchecked(attitude(1.0).into_inner() * (1.0 + 3e-7));
    let series = AttitudeSeries::new(vec![0.0], vec![rounded], None)?;
    assert!((series.quaternions()[0].into_inner().norm() - 1.0).abs() < 4.0 * f64::EPSILON);
    Ok(())
}
