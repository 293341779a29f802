//! How many numbers a frame's stars tell once its attitude is free.
//!
//! A rotation takes three of the 2n numbers of n stars. What is left of two stars is a single number, seen four
//! times; sums over series that say the same run wider than those of independent ones:
//!
//! ```text
//! P = I - A (A^T A)^-1 A^T      what a rotation leaves; C_ij = P_ij / sqrt(P_ii P_jj)
//! sum of m squares ~ (m/v) chi2_v      v = (tr C)^2 / tr C^2
//! ```
//!
//! Source: Satterthwaite 1946.

use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::star::data::StarData;
use crate::star::frame_rotation::rotation_row;

/// Squares below which a number is not told at all.
const TOLD: f64 = 1e-6;

/// Freedom of sums over a frame's stars, as a share of that of as many independent numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Freedom {
    /// Of both axes of the star that tells least.
    pub(crate) one: f64,
    /// Of all stars.
    pub(crate) all: f64,
}

impl Freedom {
    /// Of independent numbers.
    pub(crate) const WHOLE: Self = Self { one: 1.0, all: 1.0 };

    /// Beside a free rotation of the frame with the most stars; rows have these weights.
    pub(crate) fn beside_rotation(data: &StarData, weight: &[f64]) -> Self {
        let counted = |k: usize| data.frames.rows_of(k).filter(|&r| !data.outlier[r]);
        let most = (0..data.frames.frames()).max_by_key(|&k| counted(k).count());
        most.and_then(|k| Self::of(data, &counted(k).collect::<Vec<_>>(), weight))
            .unwrap_or(Self::WHOLE)
    }

    fn of(data: &StarData, rows: &[usize], weight: &[f64]) -> Option<Self> {
        let turns: Vec<Vector3<f64>> = rows
            .iter()
            .flat_map(|&r| rotation_row(data, r).map(|turn| Vector3::from(turn) * weight[r]))
            .collect();
        let normal: Matrix3<f64> = turns.iter().map(|a| a * a.transpose()).sum();
        let inverse = normal.try_inverse()?;
        let m = turns.len();
        let left = DMatrix::from_fn(m, m, |i, j| {
            f64::from(u8::from(i == j)) - turns[i].dot(&(inverse * turns[j]))
        });
        let share = |which: std::ops::Range<usize>| -> f64 {
            let told: Vec<usize> = which.filter(|&i| left[(i, i)] > TOLD).collect();
            let like = |i: usize, j: usize| left[(i, j)].powi(2) / (left[(i, i)] * left[(j, j)]);
            let pairs = told.iter().flat_map(|&i| told.iter().map(move |&j| (i, j)));
            told.len() as f64 / pairs.map(|(i, j)| like(i, j)).sum::<f64>()
        };
        let ones = (0..m).step_by(2).map(|i| share(i..i + 2));
        Some(Self {
            one: ones.filter(|s| s.is_finite()).fold(1.0, f64::min),
            all: share(0..m),
        })
    }
}

#[cfg(test)]
mod tests {
    use focal_plane::{AttitudeSeries, Camera, StarFrames};
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::star::harness::{STARS, seen};

    fn of(stars: &[[f64; 2]]) -> Freedom {
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let mut frames = StarFrames::new();
        for t in [0.0, 1.0] {
            frames.begin(t);
            for (id, [x, y]) in (0..).zip(stars) {
                frames.push(id, i64::from(id), *x, *y);
            }
        }
        let q = vec![UnitQuaternion::identity(); 2];
        let reference = AttitudeSeries::new(vec![0.0, 1.0], q, None).unwrap();
        let data = seen(&camera, &frames, Some(&reference), stars);
        let rows = data.t_s.len();
        Freedom::beside_rotation(&data, &vec![1.0; rows])
    }

    /// Two stars tell their distance alone: one number of four, one of the two of a star. Of six stars 2n - 3 of 2n
    /// are left, spread over all: no more than that, and not much less.
    #[test]
    fn two_stars_tell_one_number() {
        let two = of(&STARS[..2]);
        assert!(
            (two.all - 0.25).abs() < 1e-9 && (two.one - 0.5).abs() < 1e-9,
            "{two:?}"
        );
        let six = of(&STARS);
        assert!(six.all < 0.75 && six.all > 0.6, "{six:?}");
        assert!(six.one > 0.9, "{six:?}");
    }
}
