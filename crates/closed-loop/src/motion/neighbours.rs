//! The polynomial nearest to the neighbours of a sample, and how well it predicts the sample.
//!
//! Of degree 5: through three neighbours on each side it goes, of more it is the one of least squares. The
//! sample itself is left out, so that what it is off by is the error of a prediction,
//!
//! ```text
//! E(m) = s^2 (1 + (N^-1)_00) ~ s^2 (1 + 3.5 / (2 m)) of white noise      N: products of powers of the places
//! ```
//!
//! of which the median of the squares over a series tells.
//!
//! Source: Savitzky & Golay 1964; Stone 1974 (prediction of what was left out).

use focal_plane::{AttitudeSeries, rotation_vector};
use nalgebra::{SMatrix, Vector3};
use spectra::robust;

use crate::gaps::longest_step;

/// Neighbours on each side whose polynomial goes through all.
pub(crate) const SIDE: usize = 3;
/// Coefficients of the polynomial.
pub(crate) const COEFFICIENTS: usize = 2 * SIDE;
/// Least variance, rad^2: of rounding.
pub(crate) const LEAST: f64 = 1e-20;
/// Most samples that are predicted, evenly among all.
const PREDICTIONS: usize = 2000;
/// Median of chi-squared of one degree.
pub(crate) const MEDIAN: f64 = 0.4549;

/// A neighbour: its time from the frame's, and its turn from it, or its slope.
pub(crate) type Place = (f64, Vector3<f64>);

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
pub(crate) fn nearest<'a>(
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

    /// The polynomial through three on each side predicts by (15, -6, 1) / 20; the integral of many gives
    /// (1 + 5/4 + 9 * 9/64) / (2 m), which sums miss by about 1/m of it.
    #[test]
    fn what_is_left_of_white_noise_is_known() {
        const MOST: usize = 24;
        let through = 1.0 + 2.0 * (15.0_f64.powi(2) + 6.0_f64.powi(2) + 1.0) / 400.0;
        assert!((predicted(SIDE) - through).abs() < 1e-9);
        let many = (1.0 + 1.25 + 9.0 * 9.0 / 64.0) / (2.0 * MOST as f64);
        assert!(((predicted(MOST) - 1.0) / many - 1.0).abs() < 2.0 / MOST as f64);
    }
}
