//! Noise levels of single stars, held against each other.
//!
//! ```text
//! y_s = ln L_s = line in magnitude + slope f_s + e_s      var e_s = r / n_s + tau^2
//! ```
//!
//! `r / n_s` is what the rows of a star leave open, which is certain: half a square of two axes has
//! variance 1 (more where they are nearly one number, [`super::rows`]), and `r` is how much more the sums over
//! blocks of time scatter than that. By how much stars differ for no reason, `tau`, is small, and known as from
//! [`PRIOR`] of them beside those that are seen (Smyth 2004), so that the sum of both has a freedom of its own
//! (Satterthwaite 1946),
//!
//! ```text
//! nu = (PRIOR + n - k) (var e / tau^2)^2
//! ```
//!
//! With it five stars are enough for one to be odd by 8 sigma. Where nothing tells why, whether all levels
//! scatter by more is asked, too: `sum (y - line)^2 / var e` is F of n - k and nu.
//!
//! Source: Smyth 2004 (moderated variances); Satterthwaite 1946; Rosner 1983 (more than one odd value).

use block_regression::beyond;
use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor, StudentsT};

use super::squares::{Columns, Judged, MIN_ROWS, Table};

/// Fewest stars that are compared.
const MIN_STARS: usize = 8;
/// Fewest where it is known how they usually scatter.
const MIN_USUAL_STARS: usize = 5;
/// Fewest that may scatter by more than stars usually do.
const FEWEST_STARS: usize = 3;
/// A star with fewer rows than this part of the most is not compared.
const SELDOM: usize = 20;
/// Most odd stars.
const MOST_ODD: usize = 3;
/// By how much stars differ for no reason (logarithm of the variance), and how many that is known from.
const SCATTER: f64 = 0.02;
const PRIOR: f64 = 8.0;
/// Beyond this many degrees a law is normal.
const NORMAL: f64 = 1e6;

/// A star that is compared.
#[derive(Clone, Copy)]
struct Level {
    /// Logarithm of its level.
    ln: f64,
    mag: f64,
    /// Variance of `ln` that its rows leave.
    of_rows: f64,
    star: usize,
}

/// A variance of levels, and its degrees of freedom.
struct Spread {
    variance: f64,
    freedom: f64,
}

impl Spread {
    /// `of_rows` is certain; of what stars differ by beside it, `excess` is the sum of squares of `seen` degrees.
    fn of(of_rows: f64, excess: f64, seen: f64) -> Self {
        let of_stars = (PRIOR * SCATTER * SCATTER + excess.max(0.0)) / (PRIOR + seen);
        let variance = of_rows + of_stars;
        let freedom = (PRIOR + seen) * (variance / of_stars).powi(2);
        Self {
            variance,
            freedom: freedom.min(NORMAL),
        }
    }
}

impl Table {
    fn compared(&self) -> Vec<Level> {
        let most = self.stars.iter().map(|s| s.rows).max().unwrap_or(0);
        let enough = MIN_ROWS.max(most / SELDOM);
        let repeated = self.repeated();
        let each = self.stars.iter().enumerate();
        each.filter(|(_, s)| s.rows >= enough && s.level > 0.0)
            .map(|(star, s)| Level {
                ln: s.level.ln(),
                mag: s.mag,
                of_rows: repeated * s.scatter / (s.rows as f64).powi(2),
                star,
            })
            .collect()
    }

    /// How much more the mean square of a star scatters than that of rows of white noise, by the sums over blocks.
    fn repeated(&self) -> f64 {
        let mut sums = vec![0.0; self.stars.len() * self.blocks];
        for (row, z) in self.rows.iter().zip(&self.relative) {
            sums[row.star * self.blocks + row.block] += z;
        }
        let square: f64 = sums.iter().map(|u| u * u).sum();
        let white: f64 = self.stars.iter().map(|s| s.scatter).sum();
        (square / white.max(1.0)).max(1.0)
    }

    /// A column of a variable of stars beside a line in magnitude, held against the scatter of their levels.
    pub(super) fn between(&self, columns: &Columns, k: usize) -> Option<Judged> {
        let stars = self.compared();
        let f: Vec<f64> = stars.iter().map(|s| columns.mean[s.star][k]).collect();
        let (p, left) = beside_line(&stars, &f, None)?;
        Some([p, left])
    }

    /// The star whose level lies farthest off the others', those set aside that are farther off still: one
    /// odd star hides another (Rosner 1983).
    pub(super) fn odd_star(&self) -> Option<Judged> {
        let mut stars = self.compared();
        let mut best: Option<Judged> = None;
        for stage in 1..=MOST_ODD {
            let Some((at, [p, share])) = oddest(&stars) else {
                break;
            };
            let p = (p * (stars.len() * stage) as f64).min(1.0);
            if best.is_none_or(|b| p < b[0]) {
                best = Some([p, share]);
            }
            stars.remove(at);
        }
        best
    }

    /// Whether the levels scatter about a line in magnitude, or a parabola through enough of them, or their mean where
    /// there are too few for that, by more than rows and stars usually do.
    pub(super) fn scatter(&self) -> Option<Judged> {
        let stars = self.compared();
        let n = stars.len();
        if n < FEWEST_STARS {
            return None;
        }
        // three or four stars lie on any line
        let columns = match (told_by_magnitude(&stars), n) {
            (true, MIN_STARS..) => 3,
            (true, MIN_USUAL_STARS..) => 2,
            _ => 1,
        };
        let spread = |s: &Level| Spread::of(s.of_rows, 0.0, 0.0);
        let root: Vec<f64> = stars.iter().map(|s| spread(s).variance.sqrt()).collect();
        let design = DMatrix::from_fn(n, columns, |i, j| {
            [1.0, stars[i].mag, stars[i].mag.powi(2)][j] / root[i]
        });
        let y = DVector::from_fn(n, |i, _| stars[i].ln / root[i]);
        let factor = Cholesky::new(design.transpose() * &design)?;
        let left = &y - &design * factor.solve(&(design.transpose() * &y));
        let seen = (n - columns) as f64;
        // the least freedom of any is that of the best known star
        let freedom = stars.iter().map(|s| spread(s).freedom);
        let law = FisherSnedecor::new(seen, freedom.fold(NORMAL, f64::min)).ok()?;
        let square = left.norm_squared() / seen;
        let more: f64 = (0..n)
            .map(|i| (left[i].powi(2) - 1.0) * root[i].powi(2))
            .sum();
        Some([beyond(&law, square), (more / seen).max(0.0).sqrt()])
    }
}

/// Magnitudes that are 0 throughout are not known.
fn told_by_magnitude(stars: &[Level]) -> bool {
    stars.iter().any(|s| (s.mag - stars[0].mag).abs() > 1e-6)
}

/// The one of `stars` whose level lies farthest off the others'.
fn oddest(stars: &[Level]) -> Option<(usize, Judged)> {
    let n = stars.len() as f64;
    let of_rows = stars.iter().map(|s| s.of_rows).sum::<f64>() / n;
    let each = (0..stars.len()).filter_map(|k| {
        let alone: Vec<f64> = (0..stars.len())
            .map(|j| f64::from(u8::from(j == k)))
            .collect();
        let (p, share) = beside_line(stars, &alone, Some(of_rows))?;
        // a star that was seen for a moment scatters by itself
        let off = share / (n.recip() * (1.0 - n.recip())).sqrt();
        let own = ChiSquared::new(1.0).ok()?.sf(off * off / stars[k].of_rows);
        Some((k, [p.max(own), share]))
    });
    each.min_by(|a, b| a.1[0].total_cmp(&b.1[0]))
}

/// The chance of the slope of the levels along `f` beside a constant and a line in magnitude, and the rms of
/// what it takes. The variance is what is left, or where `of_rows` of it is known, as [`Spread`] tells.
fn beside_line(stars: &[Level], f: &[f64], of_rows: Option<f64>) -> Option<(f64, f64)> {
    let n = stars.len();
    let columns = 2 + usize::from(told_by_magnitude(stars));
    let fewest = of_rows.map_or(MIN_STARS, |_| MIN_USUAL_STARS);
    if n < fewest {
        return None;
    }
    let design = DMatrix::from_fn(n, columns, |i, j| [f[i], 1.0, stars[i].mag][j]);
    let factor = Cholesky::new(design.transpose() * &design)?;
    let y = DVector::from_fn(n, |i, _| stars[i].ln);
    let beta = factor.solve(&(design.transpose() * &y));
    let squares = (&y - &design * &beta).norm_squared();
    let seen = (n - columns) as f64;
    let spread = match of_rows {
        Some(of_rows) => Spread::of(of_rows, squares - seen * of_rows, seen),
        None => Spread {
            variance: squares / seen,
            freedom: seen,
        },
    };
    let variance = factor.inverse()[(0, 0)] * spread.variance;
    let law = StudentsT::new(0.0, 1.0, spread.freedom).ok()?;
    let t = beta[0] / variance.sqrt();
    let p = 2.0 * beyond(&law, t.abs());
    let mean = f.iter().sum::<f64>() / n as f64;
    let spread = f.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
    t.is_finite().then(|| (p, beta[0].abs() * spread.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise_effects::squares::StarLevel;

    /// Stars of a level, so many rows and a magnitude.
    fn table(stars: impl Iterator<Item = (f64, usize, f64)>) -> Table {
        Table {
            rows: Vec::new(),
            relative: Vec::new(),
            stars: stars
                .map(|(level, rows, mag)| StarLevel {
                    level,
                    rows,
                    scatter: rows as f64,
                    mag,
                })
                .collect(),
            blocks: 0,
        }
    }

    /// Eleven stars of 10 000 rows, whose levels are known to 1 %, and one of `rows` at `level`.
    fn odd(level: f64, rows: usize) -> f64 {
        let usual = (0..11).map(|k| (1.0 + 0.01 * f64::from(k - 5), 10_000, 0.1 * f64::from(k)));
        table(usual.chain([(level, rows, 0.5)])).odd_star().unwrap()[0]
    }

    /// Of twenty stars two are noisier, by half as much again: the one stands far off the others only once the
    /// other is set aside (with it their levels scatter by 0.2, of which 0.8 is 4 sigma).
    #[test]
    fn an_odd_star_does_not_hide_another() {
        let usual = (0..18).map(|k| (1.0 + 0.01 * f64::from(k % 5), 1000, 0.1 * f64::from(k)));
        let two = table(usual.chain([(2.2, 1000, 0.7), (2.3, 1000, 1.1)]));
        assert!(two.odd_star().unwrap()[0] < 1e-6);
        // the same number of stars that all differ like that for no reason
        let level = |k: i32| if k % 3 == 0 { 2.2 } else { 1.0 };
        let all = table((0..20).map(|k| (level(k), 1000, 0.1 * f64::from(k))));
        assert!(all.odd_star().unwrap()[0] > 0.05);
        assert!(all.scatter().unwrap()[0] < 1e-6);
    }

    /// Of five stars one is noisier, by 1.45 times: 0.74 in the logarithm of the variance, which 350 rows of a star
    /// tell to 0.053 and a line through four others to some 0.05. As much off as its rows leave is nothing.
    #[test]
    fn five_stars_are_enough_for_one_to_be_odd() {
        let chance = |level: f64| {
            let usual = (0..4).map(|k| (1.0 + 0.03 * f64::from(k % 3), 350, 0.3 * f64::from(k)));
            let table = table(usual.chain([(level, 350, 0.7)]));
            table.odd_star().unwrap()[0]
        };
        assert!(chance(2.1) < 1e-6, "{}", chance(2.1));
        assert!(chance(1.1) > 0.05, "{}", chance(1.1));
    }

    /// Twelve stars of 400 rows: levels are known to 5 %, and those that scatter by that are as they should be; by
    /// three times that, chi-squared is 9 a degree.
    #[test]
    fn levels_that_scatter_by_more_than_their_rows_are_told() {
        let chance = |by: f64| {
            let off = |k: usize| [1.0, -1.2, 0.4, -0.2, 1.3, -1.3][k * 7 % 6] * by;
            let stars = (0..12).map(|k| (off(k).exp(), 400, (k * 5 % 12) as f64));
            table(stars).scatter().unwrap()[0]
        };
        assert!(chance(0.05) > 0.1, "{}", chance(0.05));
        assert!(chance(0.15) < 1e-6, "{}", chance(0.15));
    }

    /// Three stars of 1000 rows, on whatever line: one that is half as noisy again is told, ones within 3 % are not.
    #[test]
    fn three_stars_are_held_against_their_mean() {
        let chance = |level: f64| {
            let stars = [(1.0, 1000, 3.0), (1.03, 1000, 4.0), (level, 1000, 5.0)];
            table(stars.into_iter()).scatter().unwrap()[0]
        };
        assert!(chance(1.5) < 1e-4, "{}", chance(1.5));
        assert!(chance(1.02) > 0.1, "{}", chance(1.02));
    }

    /// Twelve stars of 1000 rows across the field, noisier at both edges: no slope, and a parabola.
    #[test]
    fn stars_at_the_edges_may_be_noisier() {
        let x = |k: usize| k as f64 / 5.5 - 1.0;
        let level = |k: usize| (0.4 * x(k) * x(k) + 0.01 * (k % 3) as f64).exp();
        let table = table((0..12).map(|k| (level(k), 1000, (k * 5 % 12) as f64)));
        let mean = (0..12).map(|k| [x(k), 1.5 * x(k) * x(k) - 0.5]).collect();
        let columns = Columns {
            rows: Vec::new(),
            mean,
        };
        let [slope, bent] = [0, 1].map(|k| table.between(&columns, k).unwrap()[0]);
        assert!(bent < 1e-6 && slope > 0.1, "{bent} {slope}");
    }

    /// Of 600 rows a level is known to 4 %: 10 % more are 2.3 sigma, and the worst of twelve stars lies
    /// there by chance in one of five. Of 60 it is not compared: what is left are the levels of the others,
    /// evenly spread.
    #[test]
    fn a_star_that_was_seen_for_a_moment_is_not_odd() {
        assert!(odd(1.1, 10_000) < 1e-3);
        assert!(odd(1.1, 600) > 0.05);
        assert!(odd(1.3, 60) > 0.05);
    }
}
