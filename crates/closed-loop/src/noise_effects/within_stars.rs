//! Whether the noise of each star by itself follows the rate.
//!
//! A rate that hardly changes adds the same to the noise of all stars: what photon and read noise are more than one
//! power of the flux looks like it. Only what happens to one star tells, so that each has a level of its own:
//!
//! ```text
//! U = sum w (q / 2v - 1) (x - mean of x over the star),     x = R^2 / v,   v = level of the star * V
//! U / sqrt(c sum w (1 + rho^2) (x - mean)^2) ~ N(0, 1) where no noise follows the rate
//! ```
//!
//! q squared residual, V declared variance, R rate, w chance that the row is no spike, rho correlation of its
//! axes, c how much wider than chi-squared the squares scatter.
//!
//! Source: Rao 1948 (score test); Neyman & Scott 1948 (levels of single stars are nuisance parameters).

use statrs::distribution::{ContinuousCDF, Normal};

use super::rows::Row;

/// Share of the squared rates' own sum that they have to differ by within the stars: less is rounding.
const LEAST_SHARE: f64 = 1e-12;

/// What is summed of a star.
#[derive(Clone, Copy, Debug, Default)]
struct Star {
    weight: f64,
    /// Half squares over the declared variance.
    level: f64,
    /// Squared rates over it.
    rate: f64,
}

/// Chance that the squares of `rows` follow the rate this well, or better, where they do not: 1 if no star shows
/// different rates. `sound` is the chance that a row is no spike.
pub(super) fn chance(
    rows: &[Row],
    stars: usize,
    sound: impl Fn(&Row) -> f64,
    widening: f64,
) -> f64 {
    let mut of_star = vec![Star::default(); stars];
    let weights: Vec<f64> = rows.iter().map(sound).collect();
    for (row, w) in rows.iter().zip(&weights) {
        let star = &mut of_star[row.star];
        star.weight += w;
        star.level += w * 0.5 * row.square / row.declared;
        star.rate += w * row.rate / row.declared;
    }
    let (mut score, mut variance, mut whole) = (0.0, 0.0, 0.0);
    for (row, w) in rows.iter().zip(&weights) {
        let star = &of_star[row.star];
        if star.level <= 0.0 {
            continue;
        }
        let level = star.level / star.weight;
        // both over the level of the star
        let x = row.rate / (row.declared * level);
        let more = x - star.rate / (star.weight * level);
        score += w * (0.5 * row.square / (row.declared * level) - 1.0) * more;
        variance += w * row.variance() * more * more;
        whole += w * x * x;
    }
    if variance <= LEAST_SHARE * whole {
        return 1.0;
    }
    let z = score / (widening * variance).sqrt();
    Normal::standard().sf(z)
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng as _;
    use rand_distr::{Distribution as _, Exp1};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    /// Six stars of 300 rows whose variances are `floor + declared`, which no power of the flux is, and grow by
    /// `noise` times the squared rate: 1 on average, 1.3 and 0.7 in turn.
    fn rows(floor: f64, noise: f64, seed: u64) -> Vec<Row> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut out = Vec::new();
        for k in 0..1800 {
            let star = k % 6;
            let declared = [0.1, 0.2, 0.4, 1.0, 2.5, 6.0][star];
            let rate = if (k / 60) % 2 == 0 { 1.3 } else { 0.7 };
            let half: f64 = Exp1.sample(&mut rng);
            out.push(Row {
                square: 2.0 * half * (floor + declared + noise * rate),
                shows: 1.0,
                alike: 0.0,
                declared,
                mag: 0.0,
                rate,
                at: k,
                star,
                block: k / 60,
                marked: false,
            });
        }
        out
    }

    fn of(floor: f64, noise: f64, seed: u64) -> f64 {
        chance(&rows(floor, noise, seed), 6, |_| 1.0, 1.0)
    }

    /// A floor under the noise of all stars does not follow the rate: z has mean 0 and variance 1, so that of 400
    /// chances 40 +- 6 are below a tenth (5 sigma: 30), and none is below 1e-6.
    #[test]
    fn a_floor_is_no_noise_of_a_rate() {
        let chances: Vec<f64> = (0..400).map(|seed| of(0.5, 0.0, seed)).collect();
        let below = chances.iter().filter(|p| **p < 0.1).count();
        assert!((10..=70).contains(&below), "{below}");
        assert!(chances.iter().all(|p| *p > 1e-6));
    }

    /// The bright star has a variance of 0.1 + 0.5 rate, which differs by 0.3 of 0.6 between its rows: half of that
    /// is a quarter of 1, over 300 rows 4.3 sigma, and the six together 6.
    #[test]
    fn noise_of_a_rate_shows_on_every_star() {
        for seed in 0..100 {
            assert!(of(0.0, 0.5, seed) < 0.01, "{}", of(0.0, 0.5, seed));
        }
    }

    /// Stars at one rate each do not tell.
    #[test]
    fn one_rate_a_star_is_none() {
        let mut rows = rows(0.5, 0.0, 1);
        rows.iter_mut().for_each(|r| r.rate = 1.0 + r.star as f64);
        assert!(chance(&rows, 6, |_| 1.0, 1.0) >= 1.0);
    }
}
