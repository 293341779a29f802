//! A gyro's rates at the samples of attitudes that have none of their own.
//!
//! Between two of the gyro's samples the rate changes evenly; where one of them is missing, and outside the
//! record, there is none. It is sampled, not averaged: what vibrates faster than the attitudes' steps is not
//! taken out. A gyro that is read out less often than the attitudes would make them smoother than they are, and one
//! that knows less of the motion than they do, or of another motion, is of no use ([`super::rates`]). Its bias is
//! the attitudes' to tell.
//!
//! Not physics: linear interpolation.

use focal_plane::{AttitudeSeries, Series};
use nalgebra::Vector3;
use spectra::robust::median_step;
use telemetry::RateTable;

use super::neighbours::{SIDE, of_samples};
use super::rates::{is_finite, that_tell_more};
use crate::gaps::longest_step;

/// Steps of the attitudes that one of the gyro may take: rounded times are no slower gyro.
const DENSE: f64 = 1.05;

/// The same attitudes with the rates of `gyro`, where these tell more of the motion.
pub(crate) fn with_rates(series: AttitudeSeries, gyro: Option<&RateTable>) -> AttitudeSeries {
    let own = series
        .given_rates_rad_s()
        .is_some_and(|rates| rates.iter().any(is_finite));
    let Some(gyro) = gyro.filter(|_| !own) else {
        return series;
    };
    let dense = match (median_step(&gyro.t_s), median_step(series.t_s())) {
        (Some(own), Some(step)) => own <= DENSE * step,
        _ => false,
    };
    if !dense {
        return series;
    }
    let Some(measured) = at(gyro, series.t_s()) else {
        return series;
    };
    let with = |bias: Vector3<f64>| {
        let (t_s, q) = (series.t_s().to_vec(), series.quaternions().to_vec());
        let rates = measured.iter().map(|w| w - bias).collect();
        let with = AttitudeSeries::new(t_s, q, Some(rates)).ok()?;
        Some(with.with_max_gap_s(series.max_gap_s()))
    };
    with(Vector3::zeros())
        .and_then(|raw| that_tell_more(&raw, &of_samples(&raw, SIDE)))
        .and_then(with)
        .unwrap_or(series)
}

/// Its rates at times in ascending order; NaN where there are none.
fn at(gyro: &RateTable, t_s: &[f64]) -> Option<Vec<Vector3<f64>>> {
    let axis = |axis: usize| {
        let values = gyro.w.iter().map(|w| w[axis]).collect();
        let series = Series::new(gyro.t_s.clone(), values).ok()?;
        let series = series.with_max_gap_s(longest_step(&gyro.t_s));
        Some(series.at_all(t_s))
    };
    let [x, y, z] = [axis(0)?, axis(1)?, axis(2)?];
    Some(
        (0..t_s.len())
            .map(|k| Vector3::new(x[k], y[k], z[k]))
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use focal_plane::rotation_from_vector;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    fn gyro(t_s: Vec<f64>) -> RateTable {
        let w = t_s.iter().map(|t| Vector3::x() * (1.0 + 2.0 * t)).collect();
        RateTable { t_s, w }
    }

    /// A rate that grows evenly, with a sample missing at 4 s.
    #[test]
    fn rates_change_evenly_and_holes_have_none() {
        let table = gyro(vec![0.0, 1.0, 2.0, 3.0, 5.0, 6.0]);
        let got = at(
            &table,
            &[-0.5, 0.0, 0.25, 2.0, 3.0, 3.5, 5.0, 5.5, 6.0, 6.5],
        )
        .unwrap();
        let want = [
            None,
            Some(1.0),
            Some(1.5),
            Some(5.0),
            Some(7.0),
            None,
            Some(11.0),
            Some(12.0),
            Some(13.0),
            None,
        ];
        for (got, want) in got.iter().zip(want) {
            match want {
                Some(rate) => assert!((got - Vector3::x() * rate).norm() < 1e-12, "{got}"),
                None => assert!(got.iter().all(|c| c.is_nan()), "{got}"),
            }
        }
    }

    /// Samples with noise of 1e-6 every 0.5 s, of a turn at (1 + 2 t) 1e-6: a gyro as often or oftener tells the
    /// motion better, whatever its bias, one that is slower or noisier is left out, and rates of the samples' own are
    /// kept if there are any.
    #[test]
    fn a_gyro_serves_where_it_knows_more() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
        let mut normal =
            || -> Vector3<f64> { Vector3::from_fn(|_, _| StandardNormal.sample(&mut rng)) };
        let times = |step: f64| -> Vec<f64> {
            (0..)
                .map(|k| step * f64::from(k))
                .take_while(|t| *t <= 100.0)
                .collect()
        };
        let path = |t: f64| -Vector3::x() * 1e-6 * (t + t * t);
        let rate = |t: f64| Vector3::x() * 1e-6 * (1.0 + 2.0 * t);
        let t_s = times(0.5);
        let q: Vec<_> = t_s
            .iter()
            .map(|&t| rotation_from_vector(&(path(t) + normal() * 1e-6)))
            .collect();
        let mut gyro = |step: f64, noise: f64| {
            let t_s = times(step);
            let off = |t| rate(t) + Vector3::y() * 1e-4 + normal() * noise;
            let w = t_s.iter().copied().map(off).collect();
            RateTable { t_s, w }
        };
        let tables = [
            (gyro(0.5, 1e-8), true),
            (gyro(0.2, 1e-8), true),
            (gyro(1.0, 1e-8), false),
            (gyro(0.5, 1e-5), false),
        ];
        let series = AttitudeSeries::new(t_s.clone(), q.clone(), None).unwrap();
        for (table, serves) in &tables {
            let with = with_rates(series.clone(), Some(table));
            assert_eq!(with.given_rates_rad_s().is_some(), *serves);
            if let Some(rates) = with.given_rates_rad_s() {
                // of two samples over 100 s, and of the gyro's own: four or five of both
                let off = rates[3] - rate(t_s[3]);
                assert!(off.norm() < 5.0 * 1.4e-8 + 5.0 * 1e-8, "{off}");
            }
        }
        let none = vec![Vector3::repeat(f64::NAN); t_s.len()];
        let lacking = AttitudeSeries::new(t_s.clone(), q.clone(), Some(none)).unwrap();
        let with = with_rates(lacking, Some(&tables[0].0));
        assert!(with.given_rates_rad_s().unwrap()[3].x > 0.0);
        let own = vec![Vector3::y(); t_s.len()];
        let series = AttitudeSeries::new(t_s, q, Some(own)).unwrap();
        let with = with_rates(series, Some(&tables[0].0));
        assert_eq!(with.given_rates_rad_s().unwrap()[3], Vector3::y());
    }
}
