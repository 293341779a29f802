//! What each detector pixel adds by itself.
//!
//! ```text
//! D(p) = sum w (z - B - F psi) / (sum w + 1/tau^2) - level,   v(p) = 1/(sum w + 1/tau^2)
//! tau^2 = mean(D^2 + v)     over the pixels seen
//! ```
//!
//! over all windows that cover p, of whatever star. The level makes the mean of a
//! group of pixels zero: a uniform level is a pedestal of the spots or a background
//! as well, and left free it wanders off, pushed by whichever pixel is at the edge
//! of what a detector can be. That no pixel is negative is for the finished map.
//!
//! v is the variance with the spots known. They are not: a pixel that a spot sweeps over shares its signal
//! with the spot's shape, and the marginal variance is
//!
//! ```text
//! var(D(p) - mean D) = v(p) + sum_i u_ip^T M_i^-1 u_ip,   u_ip = v(p) c_ip - mean_p v c_i
//! M_i = Q_i - sum_p v(p) c_ip c_ip^T,       c_ip = sum over the windows of star i on p of  w F taps
//! ```
//!
//! with `Q_i` the spot's own precision and means over the pixels that star i covers: a
//! uniform level there is a pedestal of the spot or a background as well, and has no
//! size of its own. Units: those of the scaled windows.
//!
//! Source: linear least squares with blocks eliminated (Schur complement); Dempster,
//! Laird & Rubin 1977 (expectation-maximisation) for tau.

use super::banded::Banded;
use super::coupling::Coupling;
use super::sample::{levelled, mean};

/// A dark map under construction.
#[derive(Clone, Debug)]
pub(crate) struct Dark {
    pub(crate) value: Vec<f64>,
    /// v, with the spots known.
    pub(crate) variance: Vec<f64>,
    pub(crate) seen: Vec<bool>,
    /// tau^2, the variance of pixels not seen.
    pub(crate) spread: f64,
}

impl Dark {
    /// Nothing known: all zero, any size possible.
    pub(crate) fn none(pixels: usize) -> Self {
        Self {
            value: vec![0.0; pixels],
            variance: vec![0.0; pixels],
            seen: vec![false; pixels],
            spread: f64::INFINITY,
        }
    }

    /// The next map from `sum w (z - B - F psi)` and `sum w` of every pixel of
    /// groups `group`; returns the largest change in units of sqrt(v).
    pub(crate) fn update(&mut self, moment: &[f64], weight: &[f64], group: &[usize]) -> f64 {
        let prior = 1.0 / self.spread;
        let mut next = vec![0.0; self.value.len()];
        for p in 0..next.len() {
            self.seen[p] = weight[p] > 0.0;
            if self.seen[p] {
                self.variance[p] = 1.0 / (weight[p] + prior);
                next[p] = moment[p] * self.variance[p];
            }
        }
        next = levelled(&next, group, &self.seen, mean);
        let (mut change, mut power, mut count) = (0.0_f64, 0.0, 0.0);
        for p in (0..next.len()).filter(|&p| self.seen[p]) {
            change = change.max((next[p] - self.value[p]).abs() / self.variance[p].sqrt());
            power += next[p] * next[p] + self.variance[p];
            count += 1.0;
        }
        if count > 0.0 {
            self.spread = power / count;
        }
        for p in (0..next.len()).filter(|&p| !self.seen[p]) {
            next[p] = 0.0;
            self.variance[p] = self.spread;
        }
        self.value = next;
        change
    }
}

/// What the uncertainty of one star's spot adds to the variance of each pixel
/// against the mean of those that the star covers. `precision` is Q of the spot,
/// `variance` v by pixel.
pub(crate) fn variance_from_spot(
    coupling: &Coupling,
    mut precision: Banded,
    variance: &[f64],
) -> Vec<(usize, f64)> {
    let order = precision.order;
    let mut matrix = Banded::zeros(order, order - 1);
    for row in 0..order {
        for offset in 0..=precision.width.min(order - 1 - row) {
            *matrix.at(row, offset) = *precision.at(row, offset);
        }
    }
    let mut mean = vec![0.0; order];
    let pixels = coupling.pixel.len();
    for (k, &p) in coupling.pixel.iter().enumerate() {
        let (index, value) = coupling.row(k);
        for (n, (&i, vi)) in index.iter().zip(value).enumerate() {
            let c = variance[p] * vi;
            mean[i] += c / pixels as f64;
            for (&j, vj) in index[n..].iter().zip(&value[n..]) {
                *matrix.at(i, j - i) -= c * vj;
            }
        }
    }
    let Some(factor) = matrix.factor() else {
        return Vec::new();
    };
    let mut u = vec![0.0; order];
    (0..pixels)
        .map(|k| {
            let p = coupling.pixel[k];
            for (u, m) in u.iter_mut().zip(&mean) {
                *u = -m;
            }
            let (index, value) = coupling.row(k);
            for (&j, v) in index.iter().zip(value) {
                u[j] += variance[p] * v;
            }
            (p, factor.quadratic(&mut u))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::super::coupling;
    use super::super::sample::Sample;
    use super::super::spline::Grid;
    use super::super::spot;
    use super::super::synthetic::few_windows;
    use super::*;

    /// The inverse of all normal equations of spot and pixels together, contrasts
    /// taken: condition about 10^9 by the ridge, hence 10^-6.
    #[test]
    fn variance_is_that_of_the_whole_system() {
        let sample: Sample = few_windows(30);
        let grid = Grid::new(sample.reach_px() + 0.5, 1.1);
        let windows: Vec<usize> = (0..sample.windows()).collect();
        let weight: Vec<f64> = (0..sample.z.len())
            .map(|i| {
                if i % 11 == 3 {
                    0.0
                } else {
                    0.01 + (i % 7) as f64 * 0.003
                }
            })
            .collect();
        let level = |_: usize| 20.0;
        let (flux, at, rho) = (&sample.flux, &sample.start, 1e-3);
        let normal = spot::normal(&grid, &sample, &windows, flux, at, &weight, level);
        let ordered = coupling::by_pixel(&sample, &windows);
        let shared = Coupling::new(&grid, &sample, &ordered, flux, at, &weight, level);
        let (order, prior) = (grid.len(), 1.0 / 400.0);
        let pixels = shared.pixel.len();
        let mut whole = DMatrix::zeros(order + pixels, order + pixels);
        let mut precision = normal.penalised(&grid, rho);
        for i in 0..order {
            for k in 0..=precision.width.min(order - 1 - i) {
                whole[(i, i + k)] = *precision.at(i, k);
                whole[(i + k, i)] = *precision.at(i, k);
            }
        }
        let mut variance = vec![0.0; sample.centre.len()];
        for k in 0..pixels {
            whole[(order + k, order + k)] = shared.weight[k] + prior;
            variance[shared.pixel[k]] = 1.0 / (shared.weight[k] + prior);
            let (index, value) = shared.row(k);
            for (&j, &v) in index.iter().zip(value) {
                whole[(j, order + k)] = v;
                whole[(order + k, j)] = v;
            }
        }
        let covariance = whole.cholesky().unwrap().inverse();
        let covariance = covariance
            .view((order, order), (pixels, pixels))
            .into_owned();
        let all = pixels as f64;
        for (k, (p, added)) in variance_from_spot(&shared, precision, &variance)
            .into_iter()
            .enumerate()
        {
            assert_eq!(p, shared.pixel[k]);
            let contrast = covariance[(k, k)] - 2.0 * covariance.column(k).sum() / all
                + covariance.sum() / (all * all);
            // v of a pixel against the mean of the others, which the module leaves out
            let own = variance[p] * (1.0 - 2.0 / all)
                + shared.pixel.iter().map(|&q| variance[q]).sum::<f64>() / (all * all);
            let expected = contrast - own;
            assert!(
                (added - expected).abs() < 1e-6 * contrast,
                "{added} {expected}"
            );
        }
    }

    /// One pixel seen with weight 4 and excess 3, another with none: shrunk, level
    /// taken off, the unseen one at the level.
    #[test]
    fn unseen_pixels_get_the_level_and_the_spread() {
        let mut dark = Dark::none(3);
        let change = dark.update(&[12.0, 4.0, 0.0], &[4.0, 4.0, 0.0], &[0, 0, 0]);
        assert!((dark.value[0] - 1.0).abs() < 1e-15 && (dark.value[1] + 1.0).abs() < 1e-15);
        assert!(dark.value[2].abs() < 1e-15 && !dark.seen[2]);
        assert!((dark.spread - 1.25).abs() < 1e-15 && (dark.variance[2] - 1.25).abs() < 1e-15);
        assert!((change - 2.0).abs() < 1e-15);
    }
}
