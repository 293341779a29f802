//! Housekeeping channels and their lag.

#![expect(clippy::float_cmp, reason = "samples are returned as given")]

use focal_plane::{Series, SeriesError};

#[test]
fn values_are_linear_between_valid_samples() -> Result<(), SeriesError> {
    let nan = f64::NAN;
    let series = Series::new(
        vec![0.0, 1.0, 2.0, 3.0, 10.0, 11.0],
        vec![nan, 1.0, nan, 5.0, 12.0, nan],
    )?;
    assert_eq!(
        (series.t_s(), series.value()),
        (&[1.0, 3.0, 10.0][..], &[1.0, 5.0, 12.0][..])
    );
    assert_eq!(series.mean(), 6.0);
    for (t, want) in [
        (0.5, None),
        (1.0, Some(1.0)),
        (2.0, Some(3.0)),
        (3.0, Some(5.0)),
        (6.5, Some(8.5)),
        (10.0, Some(12.0)),
        (10.5, None),
        (nan, None),
    ] {
        assert_eq!(series.at(t), want, "at {t}");
    }
    let holed = series.with_max_gap_s(2.0);
    assert_eq!(
        [holed.at(2.5), holed.at(6.5), holed.at(10.0)],
        [Some(4.0), None, Some(12.0)]
    );
    let mut out = [0.0; 4];
    holed.at_into(&[10.0, 6.5, 2.0, 1.5], &mut out);
    assert_eq!([out[0], out[2], out[3]], [12.0, 3.0, 2.0]);
    assert!(out[1].is_nan());
    Ok(())
}

#[test]
fn a_channel_without_values_has_none() -> Result<(), SeriesError> {
    let series = Series::new(vec![0.0, 1.0], vec![f64::NAN; 2])?;
    assert!(series.is_empty() && series.mean().is_nan() && series.at(0.0).is_none());
    assert!(series.lagged(3.0).is_empty());
    Ok(())
}

#[test]
fn bad_channels_are_named() {
    let new = |t: &[f64], v: &[f64]| Series::new(t.to_vec(), v.to_vec()).err();
    assert_eq!(
        new(&[0.0], &[]),
        Some(SeriesError::Length {
            times: 1,
            values: 0
        })
    );
    assert_eq!(
        new(&[0.0, 0.0], &[1.0, f64::NAN]),
        Some(SeriesError::Time { index: 1, t_s: 0.0 })
    );
    assert_eq!(
        new(&[0.0, 2.0], &[1.0, f64::INFINITY]),
        Some(SeriesError::Infinite { index: 1, t_s: 2.0 })
    );
}

/// A ramp `u = a t` gives `x = a (t - lag + lag e^(-t/lag))`. Steps of the recursion each round by
/// a few eps of the value; 1000 of them: 1e-13. The cases put z = h/lag on both sides of 0.01.
#[test]
fn a_ramp_has_its_closed_form() -> Result<(), SeriesError> {
    for (lag, h) in [
        (50.0, 1.0),
        (300.0, 1.0),
        (1e6, 1.0),
        (0.2, 1.0),
        (100.0, 1.0001),
    ] {
        let t_s: Vec<f64> = (0..1000).map(|k| h * f64::from(k)).collect();
        let ramp = t_s.iter().map(|t| 0.3 * t).collect();
        let lagged = Series::new(t_s.clone(), ramp)?.lagged(lag);
        for &t in t_s.iter().step_by(7).take(140) {
            for t in [t, t + 0.37 * h] {
                // t - lag (1 - e^-z) with exp_m1; for z < 1e-3 its series to z^5
                let z = t / lag;
                let shape = if z < 1e-3 {
                    z * z * (0.5 - z * (1.0 / 6.0 - z * (1.0 / 24.0 - z / 120.0)))
                } else {
                    z + (-z).exp_m1()
                };
                let want = 0.3 * lag * shape;
                let got = lagged.at(t).unwrap_or(f64::NAN);
                // the closed form itself loses eps/z
                let tol = 1e-13 * want.abs() + 2e-16 * 0.3 * t;
                assert!(
                    (got - want).abs() <= tol,
                    "lag {lag}, t {t}: {got} against {want}"
                );
            }
        }
    }
    Ok(())
}

/// Against a Runge-Kutta solution of `x' = (u - x)/lag` with steps of lag/100 or less, each side of
/// every kink apart: its error, (h/lag)^4/120 relative, is below 1e-10.
#[test]
fn lag_solves_its_equation_for_uneven_samples() -> Result<(), SeriesError> {
    let t_s = vec![0.0, 1.0, 1.5, 7.0, 7.1, 30.0];
    let u = [3.0, -2.0, 5.0, 4.0, -8.0, 1.0];
    for lag in [0.5, 4.0, 60.0] {
        let lagged = Series::new(t_s.clone(), u.to_vec())?.lagged(lag);
        let mut x = u[0];
        assert_eq!(lagged.at(0.0), Some(x));
        for i in 1..u.len() {
            let span = t_s[i] - t_s[i - 1];
            let steps = if lag < 1.0 { 10_000 } else { 2000 };
            let h = span / f64::from(steps);
            let f = |s: f64, x: f64| (u[i - 1] + (u[i] - u[i - 1]) * s / span - x) / lag;
            for k in 0..steps {
                let s = h * f64::from(k);
                let k1 = f(s, x);
                let k2 = f(s + h / 2.0, x + h / 2.0 * k1);
                let k3 = f(s + h / 2.0, x + h / 2.0 * k2);
                let k4 = f(s + h, x + h * k3);
                x += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
            }
            let got = lagged.at(t_s[i]).unwrap_or(f64::NAN);
            assert!(
                (got - x).abs() < 1e-9,
                "lag {lag}, t {}: {got} against {x}",
                t_s[i]
            );
        }
    }
    Ok(())
}

#[test]
fn no_lag_changes_nothing_and_a_constant_stays() -> Result<(), SeriesError> {
    let series = Series::new(vec![0.0, 1.0, 5.0], vec![2.0, 3.0, -1.0])?;
    assert_eq!(series.lagged(0.0), series);
    let constant = Series::new(vec![0.0, 1.0, 5.0], vec![2.5; 3])?.lagged(7.0);
    assert_eq!([constant.at(0.3), constant.at(4.9)], [Some(2.5), Some(2.5)]);
    Ok(())
}

#[test]
#[should_panic(expected = "lag_s = -1 must be finite and not negative")]
fn a_negative_lag_is_a_bug() {
    let _ = Series::new(vec![0.0], vec![1.0]).map(|series| series.lagged(-1.0));
}
