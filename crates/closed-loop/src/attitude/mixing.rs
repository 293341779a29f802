//! Noise that the axes of an attitude share.
//!
//! A rotation solved from a few stars, or from stars on one side of the field, errs about its axes together: with
//! correlations of 0.6 and more. Taken for three axes, one peak of that noise counts up to three times. So each axis
//! is taken less what the noisier ones tell of its noise,
//!
//! ```text
//! theta'_a = theta_a - sum over noisier b of m_ab theta_b       C = cov(theta_k+1 - theta_k) = M^-1 D M^-T
//! ```
//!
//! and so is every column that is held against it. M is triangular with ones, so that likelihoods stay those of the
//! attitude. Slow errors of the reference, which are each axis' own, are mixed by it, too: little, as the noisier axis
//! enters by a small factor.
//!
//! Source: the modified Cholesky decomposition (Pourahmadi 1999).

use nalgebra::DMatrix;

use crate::evidence::Residuals;

/// A correlation below that makes a chance wider by less than every chance is held to be anyway, and one that changes
/// hardly tell is not believed: so many standard errors of one of white noise.
const LEAST: f64 = 0.25;
const BEYOND_CHANCE: f64 = 5.0;

/// What of the other axes is taken off each, in turn; the axes from the noisiest on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Mixing(Option<[[f64; 3]; 3]>);

impl Mixing {
    /// By what the residuals change by from one row to the next, where both count on all axes.
    pub(crate) fn of(residual: &Residuals, outlier: &[Vec<bool>; 3]) -> Self {
        let rows = residual.axes.first().map_or(0, Vec::len);
        let counts = |k: usize| (0..3).all(|a| !outlier[a][k] && residual.axes[a][k].is_finite());
        let (mut c, mut n) = ([[0.0; 3]; 3], 0.0);
        for k in (1..rows).filter(|&k| counts(k - 1) && counts(k)) {
            let change = [0, 1, 2].map(|a| residual.axes[a][k] - residual.axes[a][k - 1]);
            for a in 0..3 {
                for b in 0..3 {
                    c[a][b] += change[a] * change[b];
                }
            }
            n += 1.0;
        }
        let share = |a: usize, b: usize| c[a][b] / (c[a][a] * c[b][b]).sqrt();
        let most = [(0, 1), (0, 2), (1, 2)]
            .map(|(a, b)| share(a, b).abs())
            .into_iter()
            .fold(0.0, f64::max);
        // products of changes that follow one another scatter by 1.5 / n
        let by_chance = BEYOND_CHANCE * (1.5_f64 / n).sqrt();
        if most > LEAST.max(by_chance) {
            Self(Some(triangle(c)))
        } else {
            Self(None)
        }
    }

    /// Of series, one an axis.
    pub(crate) fn mix(self, series: [Vec<f64>; 3]) -> [Vec<f64>; 3] {
        let Some(m) = self.0 else { return series };
        std::array::from_fn(|a| {
            let mut own = series[a].clone();
            for b in (0..3).filter(|&b| m[a][b] != 0.0) {
                for (own, other) in own.iter_mut().zip(&series[b]) {
                    *own -= m[a][b] * other;
                }
            }
            own
        })
    }

    /// Of residuals row by row, and which of them are outliers: what stands out about one axis is in the others then.
    pub(crate) fn mix_rows(
        self,
        axes: &[Vec<f64>],
        outlier: &[Vec<bool>; 3],
    ) -> ([Vec<f64>; 3], [Vec<bool>; 3]) {
        let mixed = self.mix(std::array::from_fn(|a| axes[a].clone()));
        if self.0.is_none() {
            return (mixed, outlier.clone());
        }
        let any = (0..outlier[0].len()).map(|k| outlier.iter().any(|o| o[k]));
        let any: Vec<bool> = any.collect();
        (mixed, std::array::from_fn(|_| any.clone()))
    }

    /// Of columns of x, y and z, one behind the other.
    pub(crate) fn mix_columns(self, columns: &mut DMatrix<f64>) {
        let Some(m) = self.0 else { return };
        let rows = columns.nrows() / 3;
        for mut column in columns.column_iter_mut() {
            for row in 0..rows {
                let axes = [0, 1, 2].map(|a| column[a * rows + row]);
                for a in 0..3 {
                    let others: f64 = (0..3).map(|b| m[a][b] * axes[b]).sum();
                    column[a * rows + row] = axes[a] - others;
                }
            }
        }
    }
}

/// Regression of each axis on all that are noisier by the covariance `c`.
fn triangle(c: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| c[b][b].total_cmp(&c[a][a]));
    let [first, second, third] = order;
    let mut m = [[0.0; 3]; 3];
    m[second][first] = c[second][first] / c[first][first];
    let own = c[second][second] - m[second][first] * c[second][first];
    // two that say the same leave nothing to tell them apart by
    let beside = c[third][second] - m[second][first] * c[third][first];
    let by_second = if own > 1e-12 * c[second][second] {
        beside / own
    } else {
        0.0
    };
    m[third][second] = by_second;
    m[third][first] = (c[third][first] - by_second * c[second][first]) / c[first][first];
    m
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    /// White noise of correlated axes, 4000 rows: x and y hold 0.1 and -0.05 of z, and y half of the rest of x.
    fn correlated(shared: f64) -> Residuals {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
        let mut one = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut axes = vec![Vec::new(); 3];
        for _ in 0..4000 {
            let (z, x, y) = (10.0 * one(), one(), one());
            axes[0].push(x + shared * 0.1 * z);
            axes[1].push(y + shared * (0.5 * x - 0.05 * z));
            axes[2].push(z);
        }
        Residuals {
            axes,
            modelled: vec![],
        }
    }

    fn correlation(a: &[f64], b: &[f64]) -> f64 {
        let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
    }

    /// Mixed axes are independent, to five standard errors of a correlation by changes (sqrt(1.5 / n)); columns are
    /// mixed as series are. Axes that share nothing stay what they are, to the last digit.
    #[test]
    fn mixed_axes_share_no_noise() {
        let none = || std::array::from_fn(|_| vec![false; 4000]);
        let residual = correlated(1.0);
        let mixing = Mixing::of(&residual, &none());
        let axes: [Vec<f64>; 3] = residual.axes.clone().try_into().unwrap();
        assert!(correlation(&axes[0], &axes[2]) > 0.6);
        let mixed = mixing.mix(axes.clone());
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            let left = correlation(&mixed[a], &mixed[b]);
            assert!(
                left.abs() < 5.0 * (1.5_f64 / 4000.0).sqrt(),
                "{a} {b} {left}"
            );
        }
        assert_eq!(mixed[2], axes[2]);
        let mut columns = DMatrix::from_column_slice(12_000, 1, &axes.concat());
        mixing.mix_columns(&mut columns);
        let both = columns.iter().zip(mixed.concat());
        assert!(both.fold(0.0, |most, (a, b)| f64::max(most, (a - b).abs())) < 1e-12);
        assert_eq!(Mixing::of(&correlated(0.0), &none()), Mixing::default());
    }
}
