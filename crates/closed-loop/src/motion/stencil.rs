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
//! and no further than to where the samples of the whole series are predicted best by it
//! ([`super::neighbours`]). Noise that wanders is predicted worse from afar: a wide fit would follow it, and what it
//! makes of its acceleration goes with the error itself. Where motion is what a prediction misses, s is too large, but the
//! wider fit misses more yet.
//!
//! Source: Stone 1974 (choice by prediction of what was left out); Katkovnik 1999 (windows that grow while
//! noise explains the misfit).

use focal_plane::AttitudeSeries;
use nalgebra::Vector3;

use super::neighbours::{COEFFICIENTS, LEAST, Place, SIDE, nearest, of_samples, predicted};
use super::rates;

/// More neighbours on each side that are tried.
const WIDER: [usize; 5] = [6, 8, 12, 16, 24];
/// Standard deviations beyond which a misfit is not noise.
const BEYOND: f64 = 5.0;

/// What the samples of a series allow.
#[derive(Clone, Debug)]
pub(crate) struct Stencil {
    /// Of the samples' noise, rad^2.
    variance: Vector3<f64>,
    /// Neighbours on each side that may be taken.
    pub(crate) most: usize,
    /// Where the path comes from measured rates alone, their bias, rad/s.
    pub(crate) by_rates: Option<Vector3<f64>>,
    /// The longest step that is crossed, s.
    pub(crate) reach_s: f64,
}

impl Stencil {
    /// The nearest alone.
    pub(crate) fn plain(reach_s: f64) -> Self {
        Self {
            variance: Vector3::zeros(),
            most: SIDE,
            by_rates: None,
            reach_s,
        }
    }

    /// Of a series whose steps are crossed up to `reach_s`.
    pub(crate) fn of(series: &AttitudeSeries, reach_s: f64) -> Self {
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
            reach_s,
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

#[cfg(test)]
mod tests {
    use super::*;
    use focal_plane::rotation_from_vector;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use spectra::robust;

    const MOST: usize = WIDER[WIDER.len() - 1];

    fn normal(rng: &mut Xoshiro256PlusPlus) -> Vector3<f64> {
        Vector3::from_fn(|_, _| StandardNormal.sample(rng))
    }

    fn noise(variance: f64) -> Stencil {
        Stencil {
            variance: Vector3::repeat(variance),
            most: MOST,
            by_rates: None,
            reach_s: f64::INFINITY,
        }
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
            Stencil::of(&AttitudeSeries::new(t_s.clone(), q, None).unwrap(), 0.2).most
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
        let ratio = Stencil::of(&series, 0.95)
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
