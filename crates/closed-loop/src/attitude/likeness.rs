//! How much of an effect the declared errors make by themselves.
//!
//! What an effect gains is the square of a projection, and what stars that cross the detector bring along
//! ([`Imagined`]) has such a square, too. Noise that was fitted knows of it on the whole, and not of what it does
//! along this motion:
//!
//! ```text
//! S = |Q^T W theta|^2      excess = mean over draws of S / p + share of white noise,   at least 1
//! ```
//!
//! (W: whitens by the fitted noise; Q: p orthonormal columns of the effect beside all else, whitened).
//!
//! Source: the expected value of a quadratic form.

use nalgebra::{DMatrix, DVector};
use rand_core::Rng;
use star_tracker::{Purpose, stream};

use crate::attitude::data::AttitudeEvidence;
use crate::attitude::imagined::Imagined;

/// Series of white noise that its share is the mean of: known to 1/sqrt(12 p) or better.
const WHITE: usize = 24;
/// Share of a column below which it has nothing of its own.
const LEAST: f64 = 1e-6;

/// What an effect explains under the fitted noise, as a square of so many columns, and how many times too large the
/// declared errors make it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Likeness {
    pub(crate) square: f64,
    pub(crate) columns: usize,
    pub(crate) excess: f64,
}

/// Of the last `own` of the columns `binned` ([`AttitudeEvidence::binned`]); `None` where they show nothing.
pub(crate) fn likeness(
    imagined: &Imagined,
    evidence: &AttitudeEvidence<'_>,
    binned: &DMatrix<f64>,
    own: usize,
) -> Option<Likeness> {
    let data = evidence.data;
    let drawn = imagined.binned(&data.bins.rows);
    let mut columns = binned.clone();
    evidence.whiten(&mut columns);
    let q = orthonormal(&columns, own);
    if q.ncols() == 0 || drawn.is_empty() {
        return None;
    }
    let m = data.bins.rows.len();
    let mean_square = |mut series: DMatrix<f64>| {
        evidence.whiten(&mut series);
        (q.transpose() * &series).norm_squared() / series.ncols() as f64
    };
    let theta = data.unshared_theta();
    let measured = DMatrix::from_fn(3 * m, 1, |row, _| theta[row / m][row % m]);
    let mut errors = DMatrix::from_fn(3 * m, drawn.len(), |row, k| drawn[k][row / m][row % m]);
    data.mixing.mix_columns(&mut errors);
    let mut rng = stream(0, 0, Purpose::Estimation);
    let white = DMatrix::from_fn(3 * m, WHITE, |row, _| {
        let (axis, bin) = (row / m, row % m);
        let count = data.count[axis][bin];
        let sign = if rng.next_u64() & 1 == 0 { 1.0 } else { -1.0 };
        if count > 0.0 {
            sign * evidence.noise[axis].white / count.sqrt()
        } else {
            0.0
        }
    });
    let p = q.ncols() as f64;
    Some(Likeness {
        square: mean_square(measured),
        columns: q.ncols(),
        excess: (mean_square(errors) / p + (mean_square(white) / p).min(1.0)).max(1.0),
    })
}

/// What the last `own` of `columns` have of their own, orthonormal.
fn orthonormal(columns: &DMatrix<f64>, own: usize) -> DMatrix<f64> {
    let mut kept: Vec<DVector<f64>> = Vec::new();
    let mut first = 0;
    for (k, column) in columns.column_iter().enumerate() {
        let mut left = column.into_owned();
        let whole = left.norm();
        // twice is enough (Giraud et al. 2005)
        for _ in 0..2 {
            for q in &kept {
                left -= q * q.dot(&left);
            }
        }
        if left.norm() > LEAST * whole && whole > 0.0 {
            left /= left.norm();
            kept.push(left);
        }
        if k + own < columns.ncols() {
            first = kept.len();
        }
    }
    DMatrix::from_columns(&kept[first..])
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use block_regression::Folds;
    use coloured_noise::Coloured;

    use super::*;
    use crate::attitude::data::AttitudeData;
    use crate::attitude::imagined::tests::imagined;
    use crate::bins::{Bins, MOST};

    const FRAMES: usize = 1200;
    const SWING_HZ: f64 = 0.01;

    /// Attitudes of as many frames, of which nothing counts but where they are.
    fn data(t_s: &[f64]) -> AttitudeData {
        let zeros = || std::array::from_fn(|_| vec![0.0; FRAMES]);
        let folds = Folds::cut(FRAMES);
        let mut data = AttitudeData {
            t_s: t_s.to_vec(),
            theta: zeros(),
            rate: zeros(),
            outlier: std::array::from_fn(|_| vec![false; FRAMES]),
            bins: Bins::cut(t_s, &folds, MOST),
            count: Default::default(),
            mixing: Default::default(),
            outside_reference: 0,
        };
        data.rebin(&folds, MOST);
        data
    }

    /// Ten minutes on a swing by 1 degree about X. A line about X at the swing's own frequency and white noise of 0.5 arcsec: an amplitude a is a gain of
    /// a^2 N / 2 over the variance, by two columns. At thirteen times it there is a hundredth of that, and without a
    /// distortion nothing.
    #[test]
    fn a_swing_makes_its_own_line() {
        let of = |lsf: f64, times: f64| {
            let swing = |t: f64| 0.0175 * (TAU * SWING_HZ * t).sin();
            let (imagined, white) = (imagined(lsf, 0.0, swing), 0.5);
            let data = data(&imagined.t_s);
            let evidence = AttitudeEvidence {
                data: &data,
                constant_sigma: [f64::INFINITY; 3],
                noise: [Coloured {
                    white,
                    slow: 0.0,
                    tau_s: 1.0,
                }; 3],
                motion: None,
            };
            let phase = |row: usize| TAU * times * SWING_HZ * imagined.t_s[row % FRAMES];
            let columns = DMatrix::from_fn(3 * FRAMES, 5, |row, column| match column {
                3 if row < FRAMES => phase(row).cos(),
                4 if row < FRAMES => phase(row).sin(),
                0..3 if row / FRAMES == column => 1.0,
                _ => 0.0,
            });
            let squares = imagined.binned(&data.bins.rows).into_iter().map(|[x, ..]| {
                // whole periods
                let part = |wave: fn(f64) -> f64| -> f64 {
                    let all = x.iter().enumerate().map(|(k, v)| v * wave(phase(k)));
                    2.0 * all.sum::<f64>() / FRAMES as f64
                };
                part(f64::cos).powi(2) + part(f64::sin).powi(2)
            });
            let amplitude = squares.sum::<f64>() / 48.0;
            let expected = 1.0 + amplitude * FRAMES as f64 / 4.0 / (white * white);
            let told = likeness(&imagined, &evidence, &columns, 2).expect("two columns");
            (told.excess, expected)
        };
        // white noise of 24 series and two columns is known to 1/sqrt(24): five of these below 1
        let (own, expected) = of(3.0, 1.0);
        assert!(
            own > 20.0 && (own - expected).abs() < 1.0,
            "{own} {expected}"
        );
        let (beside, expected) = of(3.0, 13.0);
        assert!(
            (beside - expected).abs() < 1.0 && own > 20.0 * beside,
            "{own} {beside}"
        );
        assert!((of(0.0, 1.0).0 - 1.0).abs() < 1e-12);
    }
}
