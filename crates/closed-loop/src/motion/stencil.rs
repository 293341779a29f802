//! How many neighbours tell the motion around a frame best.
//!
//! The polynomial through three neighbours on each side follows a swing, but of white noise s of the samples
//! its acceleration holds 1.2 s/h^2: of 0.3 arcsec at 5 Hz a tenth of what a slew has, all the time, and a smear
//! by such a motion is too small and leaves what it should explain. A polynomial of the same degree fitted to m
//! neighbours on each side holds 16.6 s/h^2 / m^2.5, and misses what bends within m steps. So around each frame m
//! grows for as long as the fit misses no more than noise would,
//!
//! ```text
//! sum over axes, neighbours ( (phi - p)^2 / s^2 ) < nu + 5 sqrt(2 nu)      nu = 3 (2 m - 6)
//! ```
//!
//! and no further than to where the samples of the whole series are predicted best by it, as the median of
//! the squared error tells,
//!
//! ```text
//! E(m) = s^2 (1 + (N^-1)_00) ~ s^2 (1 + 3.5 / (2 m)) of white noise       N: products of powers of the places
//! ```
//!
//! Noise that wanders is predicted worse from afar: a wide fit would follow it, and what it makes of its
//! acceleration goes with the error itself. Where motion is what a prediction misses, s is too large, but the
//! wider fit misses more yet.
//!
//! Source: Savitzky & Golay 1964; Stone 1974 (choice by prediction of what was left out); Katkovnik 1999
//! (windows that grow while noise explains the misfit).

use focal_plane::{AttitudeSeries, rotation_vector};
use nalgebra::{SMatrix, Vector3};
use spectra::robust;

use super::rates;
use crate::gaps::longest_step;

/// Neighbours on each side whose polynomial goes through all.
pub(crate) const SIDE: usize = 3;
/// Coefficients of the polynomial.
pub(crate) const COEFFICIENTS: usize = 2 * SIDE;
/// More neighbours on each side that are tried.
const WIDER: [usize; 5] = [6, 8, 12, 16, 24];
/// Standard deviations beyond which a misfit is not noise.
const BEYOND: f64 = 5.0;
/// Least variance, rad^2: of rounding.
const LEAST: f64 = 1e-20;
/// Most samples that are predicted, evenly among all.
const PREDICTIONS: usize = 2000;
/// Median of chi-squared of one degree.
pub(crate) const MEDIAN: f64 = 0.4549;

/// A neighbour: its time from the frame's, and its turn from it, or its slope.
pub(crate) type Place = (f64, Vector3<f64>);

/// What the samples of a series allow.
#[derive(Clone, Debug)]
pub(crate) struct Stencil {
    /// Of the samples' noise, rad^2.
    variance: Vector3<f64>,
    /// Neighbours on each side that may be taken.
    pub(crate) most: usize,
    /// Where the path comes from measured rates alone, their bias, rad/s.
    pub(crate) by_rates: Option<Vector3<f64>>,
}

impl Stencil {
    /// The nearest alone.
    pub(crate) const PLAIN: Self = Self {
        variance: Vector3::new(0.0, 0.0, 0.0),
        most: SIDE,
        by_rates: None,
    };

    pub(crate) fn of(series: &AttitudeSeries) -> Self {
        let mut most = SIDE;
        let first = of_samples(series, SIDE);
        let mut last = first;
        for m in WIDER {
            let errors = of_samples(series, m);
            let noisy = (0..3).filter(|&axis| last[axis] > LEAST);
            let falls: Vec<f64> = noisy.map(|a| (errors[a] / last[a]).ln()).collect();
            // nearer to what white noise does than to a tie
            let white = (predicted(m) / predicted(most)).ln();
            if falls.iter().sum::<f64>() >= 0.5 * white * falls.len() as f64 {
                break;
            }
            (most, last) = (m, errors);
        }
        Self {
            variance: first / predicted(SIDE),
            most,
            by_rates: rates::that_tell_more(series, &first),
        }
    }

    /// The polynomial of most neighbours that the noise explains, by its powers, and how many those are: of
    /// `before` and `after`, nearest first, as many of one as of the other. `None`: none of more than three.
    pub(crate) fn widest(
        &self,
        before: &[Place],
        after: &[Place],
    ) -> Option<(usize, [Vector3<f64>; COEFFICIENTS])> {
        let most = before.len().min(after.len()).min(self.most);
        let mut best = None;
        for m in WIDER.into_iter().take_while(|&m| m <= most) {
            let places = || before[..m].iter().chain(&after[..m]);
            let fitted = nearest(places())?;
            let misfit: f64 = places()
                .map(|(s, phi)| {
                    let sum = |sum: Vector3<f64>, c: &Vector3<f64>| sum * *s + c;
                    let off = phi - fitted.iter().rev().fold(Vector3::zeros(), sum);
                    off.component_mul(&off).component_div(&self.variance).sum()
                })
                .sum();
            let nu = (3 * (2 * m - COEFFICIENTS)) as f64;
            if misfit > nu + BEYOND * (2.0 * nu).sqrt() {
                break;
            }
            best = Some((m, fitted));
        }
        best
    }
}

/// Median squared error of the attitudes, rad^2, predicted from `m` neighbours on each side, of each axis.
pub(crate) fn of_samples(series: &AttitudeSeries, m: usize) -> Vector3<f64> {
    let samples = series.quaternions();
    errors(series, m, |i, k| rotation_vector(&samples[i], &samples[k]))
}

/// Median squared error of samples predicted from `m` neighbours on each side, of each axis. A sample is given as
/// it is from another.
pub(crate) fn errors(
    series: &AttitudeSeries,
    m: usize,
    from: impl Fn(usize, usize) -> Vector3<f64>,
) -> Vector3<f64> {
    let times = series.t_s();
    let longest = longest_step(times);
    let inner = m..times.len().saturating_sub(m);
    let stride = inner.len().div_ceil(PREDICTIONS).max(1);
    let mut squares: [Vec<f64>; 3] = Default::default();
    for k in inner.step_by(stride) {
        let hole = |pair: &[f64]| pair[1] - pair[0] > longest;
        if times[k - m..=k + m].windows(2).any(hole) {
            continue;
        }
        let places = (k - m..k)
            .chain(k + 1..=k + m)
            .map(|i| (times[i] - times[k], from(i, k)));
        let places: Vec<Place> = places.collect();
        if let Some([error, ..]) = nearest(places.iter()) {
            // a row may lack its rates
            if error.iter().all(|e| e.is_finite()) {
                for (squares, e) in squares.iter_mut().zip(error.iter()) {
                    squares.push(e * e);
                }
            }
        }
    }
    let [x, y, z] = squares.map(|mut s| {
        let median = robust::median(&mut s).unwrap_or(f64::INFINITY);
        (median / MEDIAN).max(LEAST)
    });
    Vector3::new(x, y, z)
}

/// Variance of a sample less its prediction from `m` neighbours on each side, over that of white noise.
pub(crate) fn predicted(m: usize) -> f64 {
    let places = (1..=m).flat_map(|k| [k as f64, -(k as f64)].map(|s| (s, Vector3::zeros())));
    let places: Vec<Place> = places.collect();
    let (normal, _) = products(places.iter(), m as f64);
    1.0 + normal
        .try_inverse()
        .map_or(f64::INFINITY, |inverse| inverse[(0, 0)])
}

/// The polynomial of degree 5 nearest to `places`: coefficients of its powers, or `None` where they do not
/// determine it.
fn nearest<'a>(
    places: impl Iterator<Item = &'a Place> + Clone,
) -> Option<[Vector3<f64>; COEFFICIENTS]> {
    let scale = places.clone().map(|(s, _)| s.abs()).fold(0.0, f64::max);
    let (normal, right) = products(places, scale);
    let solved = normal.cholesky()?.solve(&right);
    let mut power = 1.0;
    Some(std::array::from_fn(|j| {
        let c = solved.row(j).transpose() / power;
        power *= scale;
        c
    }))
}

/// Sums of the products of powers of `s / scale`, and with the turns.
fn products<'a>(
    places: impl Iterator<Item = &'a Place>,
    scale: f64,
) -> (
    SMatrix<f64, COEFFICIENTS, COEFFICIENTS>,
    SMatrix<f64, COEFFICIENTS, 3>,
) {
    let mut normal = SMatrix::<f64, COEFFICIENTS, COEFFICIENTS>::zeros();
    let mut right = SMatrix::<f64, COEFFICIENTS, 3>::zeros();
    for (s, phi) in places {
        let mut powers = [1.0; 2 * COEFFICIENTS - 1];
        for j in 1..powers.len() {
            powers[j] = powers[j - 1] * (s / scale);
        }
        for i in 0..COEFFICIENTS {
            for j in 0..COEFFICIENTS {
                normal[(i, j)] += powers[i + j];
            }
            for axis in 0..3 {
                right[(i, axis)] += powers[i] * phi[axis];
            }
        }
    }
    (normal, right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use focal_plane::rotation_from_vector;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const MOST: usize = WIDER[WIDER.len() - 1];

    fn normal(rng: &mut Xoshiro256PlusPlus) -> Vector3<f64> {
        Vector3::from_fn(|_, _| StandardNormal.sample(rng))
    }

    fn noise(variance: f64) -> Stencil {
        Stencil {
            variance: Vector3::repeat(variance),
            most: MOST,
            by_rates: None,
        }
    }

    /// The polynomial through three on each side predicts by (15, -6, 1) / 20; the integral of many gives
    /// (1 + 5/4 + 9 * 9/64) / (2 m), which sums miss by about 1/m of it.
    #[test]
    fn what_is_left_of_white_noise_is_known() {
        let through = 1.0 + 2.0 * (15.0_f64.powi(2) + 6.0_f64.powi(2) + 1.0) / 400.0;
        assert!((predicted(SIDE) - through).abs() < 1e-9);
        let many = (1.0 + 1.25 + 9.0 * 9.0 / 64.0) / (2.0 * MOST as f64);
        assert!(((predicted(MOST) - 1.0) / many - 1.0).abs() < 2.0 / MOST as f64);
    }

    /// Of white noise all neighbours may be taken, of noise that wanders the nearest alone: a random walk is
    /// predicted best from the two beside it.
    #[test]
    fn a_wander_is_not_followed_from_afar() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
        let t_s: Vec<f64> = (0..4000).map(|k| 0.1 * f64::from(k)).collect();
        let mut walk = Vector3::zeros();
        let walked: Vec<Vector3<f64>> = t_s
            .iter()
            .map(|_| {
                walk += normal(&mut rng) * 1e-7;
                walk
            })
            .collect();
        let mut most = |white: f64| {
            let q = walked
                .iter()
                .map(|w| rotation_from_vector(&(w + normal(&mut rng) * white)))
                .collect();
            Stencil::of(&AttitudeSeries::new(t_s.clone(), q, None).unwrap()).most
        };
        assert_eq!(most(0.0), SIDE);
        assert!(most(1e-5) >= 12);
    }

    /// A swing of 36 samples a period and noise of 1e-3 of it. The medians' variances scatter by
    /// 2.33 / sqrt(2000) = 5 %; what the swing itself
    /// misses is (2 pi / 36)^6 / 20 of it, 1.4e-6.
    #[test]
    fn noise_is_told_beside_a_swing() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
        let sigma = Vector3::new(1e-6, 2e-6, 4e-6);
        let t_s: Vec<f64> = (0..4000).map(|k| 0.5 * f64::from(k)).collect();
        let path =
            |t: f64| Vector3::new(1.0, 1.0, 1.0) * 1e-3 * (std::f64::consts::TAU * t / 18.0).sin();
        let q = t_s
            .iter()
            .map(|&t| rotation_from_vector(&(path(t) + normal(&mut rng).component_mul(&sigma))))
            .collect();
        let series = AttitudeSeries::new(t_s, q, None).unwrap();
        let ratio = Stencil::of(&series)
            .variance
            .component_div(&sigma.component_mul(&sigma));
        assert!(ratio.iter().all(|r| (r - 1.0).abs() < 0.2), "{ratio}");
    }

    /// Twice the second coefficient of white noise: Legendre's sum (5 * 3^2 + 9 * 7.5^2) / (2 m) over m^4, root
    /// 16.6 / m^2.5. The median over 3000 scatters by 1.6 %, and discrete samples differ by 1/m from an
    /// integral.
    #[test]
    fn all_neighbours_are_taken_where_there_is_noise_alone() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        let m = MOST as f64;
        let mut all: Vec<f64> = (0..1000)
            .filter_map(|_| {
                let mut side = |sign: f64| -> Vec<Place> {
                    (1..=MOST)
                        .map(|k| (sign * k as f64, normal(&mut rng)))
                        .collect()
                };
                // one in a thousand is none
                noise(1.0).widest(&side(-1.0), &side(1.0))
            })
            .flat_map(|(_, fitted)| (2.0 * fitted[2]).abs().iter().copied().collect::<Vec<_>>())
            .collect();
        let sigma = robust::median(&mut all).unwrap() / 0.6745;
        assert!(
            (sigma * m.powf(2.5) / 16.6 - 1.0).abs() < 0.05 + 1.0 / m,
            "{sigma}"
        );
    }

    /// Of a corner nothing is taken that noise does not explain.
    #[test]
    fn a_corner_is_not_smoothed() {
        let bend = |s: f64| Vector3::x() * if s > 2.5 { (s - 2.5) * 1e-3 } else { 0.0 };
        let side = |sign: f64| -> Vec<Place> {
            (1..=MOST)
                .map(|k| (sign * k as f64, bend(sign * k as f64)))
                .collect()
        };
        assert!(noise(1e-12).widest(&side(-1.0), &side(1.0)).is_none());
    }
}
