//! What each detector pixel adds by itself.
//!
//! ```text
//! D(p) = sum w (z - B - F psi) / (sum w + h_p) - level,   v(p) = 1/(sum w + h_p)
//! h_p = sum_k r_kp / tau_k^2,   r_kp ~ n_k tau_k^-1 exp(-(D^2 + v)/(2 tau_k^2)),   k: quiet or warm
//! tau_k^2 = sum_p r_kp (D^2 + v) / sum_p r_kp,   n_k = mean of r_kp     over the pixels seen
//! ```
//!
//! over all windows that cover p, of whatever star. Most pixels of a good detector are
//! quiet and a few are warm: two spreads, estimated from the map, draw the noise of the
//! quiet ones to zero and leave the warm ones alone. Where all pixels are warm both
//! are wide, and nothing is drawn anywhere.
//!
//! The level, the mean with the weights h of a group of pixels that share stars, has no size of its own: a
//! uniform level is a pedestal of the spots or a background as well, and left free it wanders off. A slope
//! `g p = g (p - s) + g s` is nearly one: a slope of the spot, and a background that follows the star. What
//! is known of pixels and of backgrounds decides on it.
//! That no pixel is negative is for the finished map.
//!
//! v is the variance with the spots known. They are not: a pixel that a spot sweeps over shares its signal
//! with the spot's shape, and the marginal variance is
//!
//! ```text
//! var(D(p) - mean D) = v(p) + sum_i u_ip^T M_i^-1 u_ip,   u_ip = v(p) c_ip - mean_p v c_i
//! M_i = Q_i - sum_p v(p) c_ip c_ip^T,       c_ip = sum over the windows of star i on p of  w F taps
//! ```
//!
//! with `Q_i` the spot's own precision and means over the pixels that star i covers. Units: those of the
//! scaled windows.
//!
//! Source: linear least squares with blocks eliminated (Schur complement); Dempster,
//! Laird & Rubin 1977 (expectation-maximisation) for tau and n.

use super::banded::Banded;
use super::coupling::Coupling;
use super::sample::take_off_level;

/// A dark map under construction.
#[derive(Clone, Debug)]
pub(crate) struct Dark {
    pub(crate) value: Vec<f64>,
    /// v, with the spots known.
    pub(crate) variance: Vec<f64>,
    pub(crate) seen: Vec<bool>,
    /// h, what is known of a pixel before it is looked at.
    precision: Vec<f64>,
    /// Share and tau^2 of quiet and of warm pixels.
    kinds: [[f64; 2]; 2],
}

/// Variance of quiet pixels to begin with, over that of all; and the least that it may become, over that of a
/// pixel's estimate.
const QUIET: f64 = 0.1;
const QUIETEST: f64 = 1e-3;

impl Dark {
    /// Nothing known: all zero, any size possible.
    pub(crate) fn none(pixels: usize) -> Self {
        Self {
            value: vec![0.0; pixels],
            variance: vec![0.0; pixels],
            seen: vec![false; pixels],
            precision: vec![0.0; pixels],
            kinds: [[0.5, f64::INFINITY]; 2],
        }
    }

    /// The next map from `sum w (z - B - F psi)` and `sum w` of every pixel, of groups `group`;
    /// returns the largest change in units of sqrt(v).
    pub(crate) fn update(&mut self, moment: &[f64], weight: &[f64], group: &[usize]) -> f64 {
        let mut next = vec![0.0; self.value.len()];
        for p in 0..next.len() {
            self.seen[p] = weight[p] > 0.0;
            if self.seen[p] {
                self.variance[p] = 1.0 / (weight[p] + self.precision[p]);
                next[p] = moment[p] * self.variance[p];
            }
        }
        let sure: Vec<f64> = self
            .seen
            .iter()
            .zip(&self.precision)
            .map(|(&seen, &h)| match seen {
                true if h > 0.0 => h,
                true => 1.0,
                false => 0.0,
            })
            .collect();
        take_off_level(&mut next, group, &sure);
        let mut change = 0.0_f64;
        for p in (0..next.len()).filter(|&p| self.seen[p]) {
            change = change.max((next[p] - self.value[p]).abs() / self.variance[p].sqrt());
        }
        let spread = self.learn_kinds(&next);
        for p in (0..next.len()).filter(|&p| !self.seen[p]) {
            next[p] = 0.0;
            self.variance[p] = spread;
        }
        self.value = next;
        change
    }

    /// How much of a pixel's value is the data's, 0 to 1; the rest draws it to zero.
    pub(crate) fn share_of_data(&self, p: usize) -> f64 {
        if self.seen[p] {
            1.0 - self.precision[p] * self.variance[p]
        } else {
            0.0
        }
    }

    /// One step for the kinds of pixels and what is known of each; returns the variance of a pixel of which
    /// nothing is.
    fn learn_kinds(&mut self, value: &[f64]) -> f64 {
        let seen: Vec<usize> = (0..value.len()).filter(|&p| self.seen[p]).collect();
        let count = seen.len() as f64;
        if seen.is_empty() {
            return f64::INFINITY;
        }
        let power = |p: usize| value[p] * value[p] + self.variance[p];
        if !self.kinds[1][1].is_finite() {
            let all = seen.iter().map(|&p| power(p)).sum::<f64>() / count;
            self.kinds = [[0.5, QUIET * all], [0.5, all]];
        }
        let least = seen.iter().map(|&p| self.variance[p]).sum::<f64>() / count * QUIETEST;
        let mut sums = [[0.0; 2]; 2];
        for &p in &seen {
            let square = power(p);
            // Logarithms: one of the two may be out of reach.
            let [quiet, warm] = self
                .kinds
                .map(|[n, tau2]| n.ln() - 0.5 * tau2.ln() - 0.5 * square / tau2);
            let share = 1.0 / (1.0 + (quiet - warm).exp());
            let shares = [1.0 - share, share];
            self.precision[p] = shares[0] / self.kinds[0][1] + share / self.kinds[1][1];
            for (sum, share) in sums.iter_mut().zip(shares) {
                sum[0] += share;
                sum[1] += share * square;
            }
        }
        for (kind, [n, power]) in self.kinds.iter_mut().zip(sums) {
            if n > 0.0 {
                *kind = [(n / count).max(1.0 / (count + 1.0)), (power / n).max(least)];
            }
        }
        self.kinds.iter().map(|[n, tau2]| n * tau2).sum()
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
    use rand_distr::{Distribution, StandardNormal};

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

    /// Of 400 pixels 20 are warm by 30 and all are known to 1: the noise of the quiet ones is drawn to
    /// zero (to less than half; it would be 1), the warm ones keep their size to their own noise and a
    /// shrinkage of 1/30^2; and a level goes.
    #[test]
    fn quiet_pixels_are_drawn_to_zero_and_warm_ones_are_not() {
        let mut rng = star_tracker::stream(3, 0, star_tracker::Purpose::TemporalNoise);
        let truth = |p: usize| if p % 20 == 7 { 30.0 } else { 0.0 };
        let noise: Vec<f64> = (0..400).map(|_| StandardNormal.sample(&mut rng)).collect();
        let (weight, group) = (vec![1.0; 400], vec![0; 400]);
        let mut dark = Dark::none(400);
        for _ in 0..200 {
            // a pedestal goes into the spot, as in the alternation
            let mut moment: Vec<f64> = (0..400).map(|p| truth(p) + noise[p] + 5.0).collect();
            let sure: Vec<f64> = dark.precision.iter().map(|h| h.max(1e-9)).collect();
            take_off_level(&mut moment, &group, &sure);
            dark.update(&moment, &weight, &group);
        }
        let mut quiet = 0.0;
        for p in 0..400 {
            if truth(p) > 0.0 {
                let off = dark.value[p] - truth(p);
                assert!((off - noise[p]).abs() < 0.5, "{off} {}", noise[p]);
            } else {
                quiet += dark.value[p].powi(2) / 380.0;
            }
        }
        assert!(quiet < 0.25, "{quiet}");
    }

    /// One pixel seen with weight 4 and excess 3, another with none: level taken off, the unseen one at
    /// the level.
    #[test]
    fn unseen_pixels_get_the_level_and_the_spread() {
        let mut dark = Dark::none(3);
        let change = dark.update(&[12.0, 4.0, 0.0], &[4.0, 4.0, 0.0], &[0, 0, 0]);
        assert!((dark.value[0] - 1.0).abs() < 1e-12 && (dark.value[1] + 1.0).abs() < 1e-12);
        assert!(dark.value[2].abs() < 1e-15 && !dark.seen[2]);
        assert!((change - 2.0).abs() < 1e-12);
        // all power 1 + 1/4 and quiet ones a tenth of it to begin with: 1/(1 + sqrt(10) exp(-4.5)) are warm, and
        // no kind is ever rarer than one pixel
        let warm = 1.0 / (1.0 + 10_f64.sqrt() * (-4.5_f64).exp());
        assert!((dark.variance[2] - 1.25 * (warm + 1.0 / 3.0)).abs() < 1e-12);
    }
}
