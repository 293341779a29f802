//! Whether the noise of the stars, each at a level of its own, follows the rate.
//!
//! A rate that hardly changes adds the same to the noise of all stars: what photon and read noise are more than one
//! power of the flux looks like it. So each star has a level of its own, and what happens to one star tells:
//!
//! ```text
//! U = sum w (q / 2v - 1) (x - mean of x over the star),     x = R^2 / v,   v = level of the star * V
//! beta = U / sum w (x - mean)^2,    var beta = c sum w (1 + rho^2) (x - mean)^2 / (sum w (x - mean)^2)^2
//! ```
//!
//! q squared residual, V declared variance, R rate, w chance that the row is no spike, rho correlation of its
//! axes, c how much wider than chi-squared the squares scatter.
//!
//! In a steady spin each star has one rate, and only the stars beside each other tell: their levels are held against
//!
//! ```text
//! level = a + b m + d m^2 + beta mean(R^2 / V)        m magnitude; d where the stars are many
//! var beta = phi (X' W X)^-1,    phi = max(1, (2 + chi2) / (2 + freedom))
//! ```
//!
//! phi: stars that differ for no reason scatter by more than their rows say; that they do not counts as two stars.
//! Both estimates know nothing of each other and are joined by their precisions, with the freedom of both (Welch).
//!
//! Source: Rao 1948 (score test); Neyman & Scott 1948 (levels of single stars are nuisance parameters); Welch 1947;
//! Smyth 2004 (moderated variances).

use block_regression::beyond;
use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor, Normal};

use super::rows::Row;

/// Share of the squared rates' own sum that they have to differ by within the stars, or among them beside a slope in
/// magnitude: less is rounding.
const LEAST_SHARE: f64 = 1e-12;
/// Fewest rows of a star whose level is held against others.
const MIN_ROWS: f64 = 20.0;
/// Fewest stars beyond the terms of their levels, and beyond which a slope in magnitude may bend.
const FEWEST_MORE: usize = 3;
const MAY_BEND: usize = 8;
/// For how many stars it counts that levels scatter as their rows say.
const BELIEVED: f64 = 2.0;
/// Freedom beyond which a scatter is known.
const KNOWN: f64 = 1e6;

/// What is summed of a star.
#[derive(Clone, Copy, Debug, Default)]
struct Star {
    weight: f64,
    /// Half squares over the declared variance.
    level: f64,
    /// Squared rates over it.
    rate: f64,
    /// Variance of the half squares over their noise's.
    scatter: f64,
    mag: f64,
}

impl Star {
    fn mean_level(&self) -> f64 {
        self.level / self.weight
    }

    fn mean_rate(&self) -> f64 {
        self.rate / self.weight
    }
}

/// Squared noise of the rate by its size, (arcsec/(deg/s))^2, and how certain that is.
#[derive(Clone, Copy, Debug)]
struct Slope {
    value: f64,
    precision: f64,
    /// Of its scatter.
    freedom: f64,
}

impl Slope {
    /// Of two that know nothing of each other.
    fn with(self, other: Self) -> Self {
        let precision = self.precision + other.precision;
        let each = [self, other].map(|s| (s.precision / precision).powi(2) / s.freedom);
        Self {
            value: (self.value * self.precision + other.value * other.precision) / precision,
            precision,
            freedom: each.iter().sum::<f64>().recip().min(KNOWN),
        }
    }

    /// Chance that it is this large, or larger, by noise alone.
    fn chance(self) -> f64 {
        let z = self.value * self.precision.sqrt();
        if self.freedom >= KNOWN {
            return Normal::standard().sf(z);
        }
        // half of what lies beyond on both sides
        let law = FisherSnedecor::new(1.0, self.freedom);
        let half = law.map_or(0.5, |law| 0.5 * beyond(&law, z * z));
        if z > 0.0 { half } else { 1.0 - half }
    }
}

/// Chance that the squares of `rows` follow the rate this well, or better, where they do not: 1 if stars show no
/// different rates. `sound` is the chance that a row is no spike; the declared variance has the slope in magnitude
/// that there is.
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
        star.scatter += w * row.variance();
        star.mag = row.mag;
    }
    of_star.iter_mut().for_each(|star| {
        if star.level <= 0.0 {
            star.weight = 0.0;
        }
    });
    let within = within(rows, &weights, &of_star, widening);
    match (within, among(&of_star, widening)) {
        (Some(within), Some(among)) => within.with(among).chance(),
        (Some(only), None) | (None, Some(only)) => only.chance(),
        (None, None) => 1.0,
    }
}

/// What each star tells by itself.
fn within(rows: &[Row], weights: &[f64], of_star: &[Star], widening: f64) -> Option<Slope> {
    let (mut score, mut information, mut variance, mut whole) = (0.0, 0.0, 0.0, 0.0);
    for (row, w) in rows.iter().zip(weights) {
        let star = &of_star[row.star];
        if star.weight <= 0.0 {
            continue;
        }
        let level = star.mean_level();
        // both over the level of the star
        let x = row.rate / (row.declared * level);
        let more = x - star.mean_rate() / level;
        score += w * (0.5 * row.square / (row.declared * level) - 1.0) * more;
        information += w * more * more;
        variance += w * row.variance() * more * more;
        whole += w * x * x;
    }
    (variance > LEAST_SHARE * whole).then(|| Slope {
        value: score / information,
        precision: information * information / (widening * variance),
        freedom: KNOWN,
    })
}

/// What the stars tell beside each other.
fn among(of_star: &[Star], widening: f64) -> Option<Slope> {
    let known: Vec<&Star> = of_star.iter().filter(|s| s.weight >= MIN_ROWS).collect();
    let terms = if known.len() < MAY_BEND { 3 } else { 4 };
    if known.len() < terms + FEWEST_MORE {
        return None;
    }
    // each row over the sigma of the star's level
    let sigma = |s: &Star| s.mean_level() * (widening * s.scatter).sqrt() / s.weight;
    let column = |s: &Star, k: usize| match k {
        0 => s.mean_rate(),
        k => s.mag.powi(i32::try_from(k).unwrap_or(1) - 1),
    };
    let design = DMatrix::from_fn(known.len(), terms, |i, k| {
        column(known[i], k) / sigma(known[i])
    });
    let seen = DVector::from_fn(known.len(), |i, _| known[i].mean_level() / sigma(known[i]));
    let normal = design.tr_mul(&design);
    let inverse = Cholesky::new(normal.clone())?.inverse();
    let value = &inverse * design.tr_mul(&seen);
    let information = inverse[(0, 0)].recip();
    if information.is_nan() || information <= LEAST_SHARE * normal[(0, 0)] {
        return None;
    }
    let chi2 = (seen - design * &value).norm_squared();
    let freedom = (known.len() - terms) as f64 + BELIEVED;
    let wider = ((chi2 + BELIEVED) / freedom).max(1.0);
    Some(Slope {
        value: value[0],
        precision: information / wider,
        freedom,
    })
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng as _;
    use rand_distr::{Distribution as _, Exp1, StandardNormal};
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

    /// Stars at one rate each, without magnitudes, do not tell.
    #[test]
    fn one_rate_a_star_is_none() {
        let mut rows = rows(0.5, 0.0, 1);
        rows.iter_mut().for_each(|r| r.rate = 1.0 + r.star as f64);
        assert!(chance(&rows, 6, |_| 1.0, 1.0) >= 1.0);
    }

    /// Of 1 known to 1/2 and 3 known to 1/sqrt 12 the mean is (4 + 36) / 16, and three quarters of its variance are of
    /// six degrees of freedom: 6 / (3/4)^2.
    #[test]
    fn two_estimates_are_joined_by_how_well_they_are_known() {
        let slope = |value, precision, freedom| Slope {
            value,
            precision,
            freedom,
        };
        let both = slope(1.0, 4.0, KNOWN).with(slope(3.0, 12.0, 6.0));
        assert!((both.value - 2.5).abs() < 1e-12 && (both.precision - 16.0).abs() < 1e-12);
        assert!((both.freedom - 10.667).abs() < 1e-2, "{}", both.freedom);
        // Student's t of 10.667 at 1 sigma, and the normal law
        assert!((slope(0.25, 16.0, 10.667).chance() - 0.1697).abs() < 1e-3);
        assert!((slope(0.25, 16.0, KNOWN).chance() - 0.1587).abs() < 1e-4);
        assert!((slope(-0.25, 16.0, 10.667).chance() - 0.8303).abs() < 1e-3);
    }

    /// Eight stars of 300 rows in a steady spin, at rates that no magnitude tells; variances of 1, `noise` times the
    /// squared rate, and what each star is `off` by for no reason.
    fn spinning(noise: f64, off: f64, seed: u64) -> f64 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let level: Vec<f64> = (0..8)
            .map(|_| {
                let z: f64 = StandardNormal.sample(&mut rng);
                (off * z).exp()
            })
            .collect();
        let rows: Vec<Row> = (0..2400)
            .map(|k| {
                let star = k % 8;
                // hardly different within a star
                let rate = [0.2, 1.4, 0.6, 1.0, 0.3, 1.8, 0.1, 0.7][star] * [1.01, 0.99][k / 8 % 2];
                let half: f64 = Exp1.sample(&mut rng);
                Row {
                    square: 2.0 * half * level[star] * (1.0 + noise * rate),
                    shows: 1.0,
                    alike: 0.0,
                    declared: 1.0,
                    mag: star as f64 - 3.5,
                    rate,
                    at: k,
                    star,
                    block: k / 60,
                    marked: false,
                }
            })
            .collect();
        chance(&rows, 8, |_| 1.0, 1.0)
    }

    /// The rates have a variance of 0.32 beside a bent slope in magnitude (of 0.333 in all), so that 0.35 of them is
    /// seen at 0.35 sqrt(0.32 * 2400) / 1.25 = 7.8 sigma with eight stars: beyond 0.01 for certain. Where nothing
    /// follows the rate, a tenth of 400 chances is below a tenth (30 is five sigma), and no more if the stars differ by
    /// 15 %, three times what their rows say.
    #[test]
    fn in_a_steady_spin_stars_tell_beside_each_other() {
        for seed in 0..100 {
            assert!(
                spinning(0.35, 0.0, seed) < 0.01,
                "{}",
                spinning(0.35, 0.0, seed)
            );
        }
        for off in [0.0, 0.15] {
            let chances: Vec<f64> = (0..400).map(|seed| spinning(0.0, off, seed)).collect();
            let below = |p: f64| chances.iter().filter(|c| **c < p).count();
            assert!((10..=70).contains(&below(0.1)), "{off}: {}", below(0.1));
            assert!(below(0.003) <= 6, "{off}: {}", below(0.003));
        }
    }
}
