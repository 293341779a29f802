//! How much a star's centroids count: by their own noise.
//!
//! Bright stars are measured better. Least squares that takes all rows for alike loses
//! what the mean of 1/sigma^2 is more than 1 over the mean of sigma^2: 40 % of the
//! information for 14 stars between magnitudes 3.3 and 4.4. No declared noise is
//! believed; the noise of a star is what its residual changes by from one frame to the
//! next, which no slow effect adds to:
//!
//! ```text
//! sigma_s = median |r_k+1 - r_k| / (0.6745 sqrt 2)      both axes of star s
//! w_s     = g / sigma_s                                 g: geometric mean over the rows
//! ```
//!
//! so that a weighted residual has the same noise everywhere, and weights of all rows
//! multiply to 1: likelihoods are those of the residual itself. The error of a sigma from n
//! changes is 1.2/sqrt(n) of it; stars seen for few frames are drawn to the noise that stars of their magnitude have,
//!
//! ```text
//! ln sigma_s = a + b m_s      a, b: weighted least squares over the stars with 20 changes and more
//! ```
//!
//! or where no magnitude tells, to that of all rows. Drawn to the latter alone a faint star that was seen
//! once was misplaced by three sigmas of a bright one.
//!
//! Frames with attitudes of their own take a part of each star's noise along, most of those that tell most of them:
//!
//! ```text
//! var r = (1 - h) sigma^2      h = a (A'A)^-1 a'      a: what a rotation does to the row, A: all rows of its frame
//! ```
//!
//! is what changes are held against there. Of three stars in a row the outer two have h near 1, and looked quiet.
//!
//! Source: Hoaglin & Welsch 1978 (leverage); Aitken 1935 (weighted least squares); Rousseeuw & Croux 1993 (the median's scale).

use nalgebra::Vector3;
use rayon::prelude::*;
use spectra::robust;

use crate::star::data::StarData;
use crate::star::frame_rotation::{rotation_inverse, rotation_row};

/// Changes that the common noise counts for beside a star's own.
const COMMON: f64 = 20.0;
/// Fewest changes of a star that says how noise grows with the magnitude, fewest such stars, and their spread.
const ENOUGH: usize = 20;
const LEAST_STARS: usize = 4;
const LEAST_SPREAD_MAG: f64 = 0.1;
/// By how much stars of one magnitude differ, of their sigma.
const SCATTER: f64 = 0.1;
/// Steepest growth of ln sigma over a magnitude that is believed: that of read noise alone is ln 2.512 = 0.92.
const STEEPEST: f64 = 1.2;
/// A row of which its frame's attitude takes all but this share says nothing of its star's noise.
const LEAST_LEFT: f64 = 0.1;
/// A star is never taken for quieter than this share of the common noise.
const QUIETEST: f64 = 0.1;
/// Rows that are sorted by star at once.
const PIECE: usize = 1 << 17;
/// Median of |x| for unit variance.
const MEDIAN_OF_NORMAL: f64 = 0.6745;

/// Weight of every row by its `changes` ([`crate::star::changes`]); all alike where the noise cannot be told
/// from frame to frame.
pub(crate) fn of(data: &StarData, changes: &[Vec<f64>; 2]) -> Vec<f64> {
    let rows = data.t_s.len();
    // pictures of other places have other errors in common
    if data.frames_are_unrelated() {
        return vec![1.0; rows];
    }
    let sizes = sizes(data, changes);
    let scale = |values: &mut Vec<f64>| {
        let median = robust::median(values)?;
        Some(median / (MEDIAN_OF_NORMAL * std::f64::consts::SQRT_2))
    };
    let mut together = sizes.concat();
    let (all, own) = rayon::join(
        || scale(&mut together),
        || {
            sizes
                .into_par_iter()
                .map(|mut own| (own.len(), scale(&mut own)))
                .collect::<Vec<_>>()
        },
    );
    let Some(common) = all.filter(|s| *s > 0.0) else {
        return vec![1.0; rows];
    };
    let usual = usual(data, &own);
    let sigma: Vec<f64> = own
        .into_iter()
        .enumerate()
        .map(|(star, (n, own))| {
            let usual = usual(star).unwrap_or(common);
            let n = n as f64;
            let square = own.map_or(0.0, |s| s * s);
            let drawn = (n * square + COMMON * usual * usual) / (n + COMMON);
            drawn.sqrt().max(QUIETEST * common)
        })
        .collect();
    let counted = || (0..rows).filter(|&r| !data.outlier[r]);
    let log_sigma: Vec<f64> = sigma.iter().map(|s| s.ln()).collect();
    let log: f64 = counted().map(|r| log_sigma[data.star[r]]).sum();
    let geometric = (log / counted().count().max(1) as f64).exp();
    let weight: Vec<f64> = sigma.iter().map(|s| geometric / s).collect();
    data.star.iter().map(|&star| weight[star]).collect()
}

/// Sizes of the changes of each star, as if attitudes left all of its noise.
fn sizes(data: &StarData, changes: &[Vec<f64>; 2]) -> Vec<Vec<f64>> {
    let left = left_by_attitudes(data);
    let stars = data.stars.len();
    let of_rows = |(piece, of_row): (usize, &[usize])| {
        let mut sizes = vec![Vec::new(); stars];
        for (i, &star) in of_row.iter().enumerate() {
            let row = PIECE * piece + i;
            let left = left.get(row).unwrap_or(&[1.0; 2]);
            let each = changes
                .iter()
                .zip(left)
                .map(|(c, l)| c[row].abs() / l.sqrt());
            sizes[star].extend(each.filter(|c| c.is_finite()));
        }
        sizes
    };
    let pieces: Vec<Vec<Vec<f64>>> = data
        .star
        .par_chunks(PIECE)
        .enumerate()
        .map(of_rows)
        .collect();
    let of_star = |star: usize| pieces.iter().flat_map(|p| &p[star]).copied().collect();
    (0..stars).into_par_iter().map(of_star).collect()
}

/// Share of each row's variance, per axis, that the attitude of its frame leaves; NaN where that is next to nothing.
/// Empty where attitudes are given.
fn left_by_attitudes(data: &StarData) -> Vec<[f64; 2]> {
    if !data.free_attitude {
        return Vec::new();
    }
    let of_frame = |frame: usize| {
        let inverse = rotation_inverse(data, frame);
        data.frames.rows_of(frame).map(move |row| {
            rotation_row(data, row).map(|axis| {
                let a = Vector3::from(axis);
                let left = inverse.map_or(1.0, |inverse| 1.0 - a.dot(&(inverse * a)));
                if left > LEAST_LEFT { left } else { f64::NAN }
            })
        })
    };
    let frames = (0..data.frames.frames()).into_par_iter();
    frames.flat_map_iter(of_frame).collect()
}

/// The noise that a star of the magnitude of each has by the others: `own` are changes of each star and their sigma.
fn usual<'a>(
    data: &'a StarData,
    own: &[(usize, Option<f64>)],
) -> impl Fn(usize) -> Option<f64> + use<'a> {
    let known = || {
        let each = data.stars.iter().zip(own);
        each.filter_map(|(star, (n, sigma))| {
            let sigma = sigma.filter(|s| *s > 0.0 && *n >= ENOUGH && star.mag.is_finite())?;
            let weight = 1.0 / (1.44 / *n as f64 + SCATTER * SCATTER);
            Some((weight, star.mag, sigma.ln()))
        })
    };
    let whole: f64 = known().map(|k| k.0).sum();
    let [mag, ln] = known().fold([0.0; 2], |[m, l], (w, mag, ln)| {
        [m + w * mag / whole, l + w * ln / whole]
    });
    let (mut square, mut product) = (0.0, 0.0);
    for (w, m, l) in known() {
        square += w * (m - mag).powi(2);
        product += w * (m - mag) * (l - ln);
    }
    let told = known().count() >= LEAST_STARS && square > whole * LEAST_SPREAD_MAG.powi(2);
    let slope = (product / square).clamp(-STEEPEST, STEEPEST);
    move |star| {
        let line = (ln + slope * (data.stars[star].mag - mag)).exp();
        (told && line.is_finite()).then_some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::declared::OnCentroids;
    use crate::star::changes;
    use crate::star::data::Inputs;
    use crate::star::harness::seen;
    use focal_plane::{Camera, StarFrames};
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Stars of these noises, px, on an image that grows slowly by far more; the last is seen in `seen` frames.
    fn image_that_grows(sigma: &[f64], seen: u32) -> StarData {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let place = [
            [200.0, 10.0],
            [-150.0, 180.0],
            [-60.0, -220.0],
            [90.0, 90.0],
            [-20.0, 130.0],
            [-210.0, -120.0],
        ];
        let last = i32::try_from(sigma.len()).unwrap() - 1;
        let mut frames = StarFrames::new();
        for k in 0..1250_u32 {
            let t = 0.5 * f64::from(k);
            frames.begin(t);
            for (s, (at, sigma)) in (0..).zip(place.iter().zip(sigma)) {
                if s == last && k >= seen {
                    continue;
                }
                let mut noisy = |v: f64| {
                    let e: f64 = StandardNormal.sample(&mut rng);
                    v * (1.0 + 2e-3 * (0.01 * t).sin()) + sigma * e
                };
                let (x, y) = (noisy(at[0]), noisy(at[1]));
                frames.push(s, i64::from(s) + 1, x, y);
            }
        }
        let mut data = StarData::prepare(&Inputs {
            camera: &camera,
            frames: &frames,
            reference: None,
            catalogue: None,
            phase: &OnCentroids::default(),
            effects: &[],
        });
        // positions against where the first frame has them: the attitude solved frame by frame would
        // mix the stars' noise
        for row in 0..data.t_s.len() {
            for axis in 0..2 {
                data.projected[axis][row] = place[data.star[row]][axis];
                data.phase_error[axis][row] = 0.0;
            }
        }
        data
    }

    /// Stars of noise 0.02, 0.04 and 0.08 px on an image that grows slowly by far more than that; the
    /// last is seen in four frames. The median of n changes is known to 1.2/sqrt(n): 2.4 % here.
    #[test]
    fn weights_are_those_of_the_noise_alone() {
        let sigma = [0.02, 0.04, 0.08, 0.08];
        let data = image_that_grows(&sigma, 4);
        let weight = of(&data, &changes::of(&data));
        let of_star = |s: usize| weight[data.star.iter().position(|&k| k == s).unwrap()];
        for (a, b) in [(0, 1), (1, 2)] {
            let ratio = of_star(a) / of_star(b);
            assert!(
                (ratio / 2.0 - 1.0).abs() < 5.0 * 0.034,
                "{a} over {b}: {ratio}"
            );
        }
        // six changes tell 0.08 to a half; twenty of the common noise, 0.04, stand beside them
        let ratio = of_star(3) / of_star(1);
        assert!((0.35..1.1).contains(&ratio), "{ratio}");
        let log: f64 = weight.iter().map(|w| w.ln()).sum();
        assert!(log.abs() < 1e-9 * weight.len() as f64, "{log}");
    }

    /// Three stars nearly in a row, of the same noise, in frames with attitudes of their own: the attitude takes most of
    /// what the outer two say across the row. Of 1250 changes each is known to 1.2/sqrt(2500) = 2.4 %.
    #[test]
    fn stars_that_make_the_attitude_are_no_quieter() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(8);
        let camera = Camera::from_fov_deg([1024, 1024], [5.0, 5.0]).unwrap();
        let place = [[-400.0, 30.0], [20.0, 80.0], [380.0, 20.0]];
        let mut frames = StarFrames::new();
        for k in 0..1250_u32 {
            frames.begin(0.5 * f64::from(k));
            for (s, at) in (0..).zip(&place) {
                let mut noisy = |v: f64| {
                    let e: f64 = StandardNormal.sample(&mut rng);
                    v + 0.05 * e
                };
                frames.push(s, i64::from(s), noisy(at[0]), noisy(at[1]));
            }
        }
        let data = seen(&camera, &frames, None, &place);
        let weight = of(&data, &changes::of(&data));
        for pair in weight[..3].windows(2) {
            assert!(
                (pair[1] / pair[0]).ln().abs() < 5.0 * 0.034,
                "{weight:?}",
                weight = &weight[..3]
            );
        }
    }

    /// Noise of 0.02 px doubles with every magnitude; a star of 4 mag that is seen once has 0.32 px, as the line
    /// through the others has it. Five sigmas of 2.4 % are 0.12 of its logarithm, and a magnitude beyond the last 0.17.
    #[test]
    fn a_star_seen_once_has_the_noise_of_its_magnitude() {
        let mag = [0.0, 1.0, 2.0, 3.0, 1.0, 4.0];
        let sigma = mag.map(|m| 0.02 * 2_f64.powf(m));
        let mut data = image_that_grows(&sigma, 1);
        let of_star = |data: &StarData, s: usize| {
            let row = data.star.iter().position(|&k| k == s).unwrap();
            of(data, &changes::of(data))[row]
        };
        let unknown = of_star(&data, 5) / of_star(&data, 0);
        data.stars.iter_mut().zip(mag).for_each(|(s, m)| s.mag = m);
        let ratio = of_star(&data, 5) / of_star(&data, 0);
        assert!((ratio * 16.0).ln().abs() < 0.17, "{ratio}");
        // without magnitudes it is taken for what is usual
        assert!(unknown > 3.0 / 16.0, "{unknown}");
    }
}
