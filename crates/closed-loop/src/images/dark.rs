//! What each detector pixel adds by itself.
//!
//! ```text
//! D(p) = sum w (z - B - F psi) / (sum w + h_p) - plane,   v(p) = 1/(sum w + h_p)
//! h_p = sum_k r_kp / tau_k^2,   r_kp ~ n_k tau_k^-1 exp(-(D^2 + v)/(2 tau_k^2)),   k: quiet or warm
//! tau_k^2 = sum_p r_kp (D^2 + v) / sum_p r_kp,   n_k = mean of r_kp     over the pixels seen
//! ```
//!
//! over all windows that cover p, of whatever star. Most pixels of a good detector are
//! quiet and a few are warm: two spreads, estimated from the map, draw the noise of the
//! quiet ones to zero and leave the warm ones alone. Where all pixels are warm both
//! are wide, and nothing is drawn anywhere.
//!
//! The plane, fitted with the weights h to a group of pixels that share stars, has no size of its own: a
//! uniform level is a pedestal of the spots or a background as well, and a slope
//! `g p = g (p - s) + g s` is a slope of the spot, and a background that follows the star. Left
//! free they wander off, and every first moment that is freed from the map with them.
//! That no pixel is negative is for the finished map.
//!
//! v is the variance with the spots known. They are not: a pixel that a spot sweeps over shares its signal
//! with the spot's shape, and the marginal variance is
//!
//! ```text
//! var(D(p) - plane) = v(p) + sum_i u_ip^T M_i^-1 u_ip,   u_ip = v(p) c_ip - plane_p of v c_i
//! M_i = Q_i - sum_p v(p) c_ip c_ip^T,       c_ip = sum over the windows of star i on p of  w F taps
//! ```
//!
//! with `Q_i` the spot's own precision and planes over the pixels that star i covers. Units: those of the
//! scaled windows.
//!
//! Source: linear least squares with blocks eliminated (Schur complement); Dempster,
//! Laird & Rubin 1977 (expectation-maximisation) for tau and n.

use super::banded::Banded;
use super::coupling::Coupling;
use super::sample::Planes;

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

    /// The next map from `sum w (z - B - F psi)` and `sum w` of every pixel, in groups that `planes` knows;
    /// returns the largest change in units of sqrt(v).
    pub(crate) fn update(&mut self, moment: &[f64], weight: &[f64], planes: &Planes) -> f64 {
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
        planes.take_off(&mut next, &sure);
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
/// against the plane through those that the star covers. `precision` is Q of the spot,
/// `variance` v and `centre` the place by pixel.
pub(crate) fn variance_from_spot(
    coupling: &Coupling,
    mut precision: Banded,
    variance: &[f64],
    centre: &[[f64; 2]],
) -> Vec<(usize, f64)> {
    let order = precision.order;
    let mut matrix = Banded::zeros(order, order - 1);
    for row in 0..order {
        for offset in 0..=precision.width.min(order - 1 - row) {
            *matrix.at(row, offset) = *precision.at(row, offset);
        }
    }
    let basis = plane_basis(&coupling.pixel, centre);
    // v c along each of the basis
    let mut planes = vec![[0.0; 3]; order];
    for (k, &p) in coupling.pixel.iter().enumerate() {
        let (index, value) = coupling.row(k);
        for (n, (&i, vi)) in index.iter().zip(value).enumerate() {
            let c = variance[p] * vi;
            for (plane, b) in planes[i].iter_mut().zip(&basis[k]) {
                *plane += b * c;
            }
            for (&j, vj) in index[n..].iter().zip(&value[n..]) {
                *matrix.at(i, j - i) -= c * vj;
            }
        }
    }
    let Some(factor) = matrix.factor() else {
        return Vec::new();
    };
    let mut u = vec![0.0; order];
    (0..coupling.pixel.len())
        .map(|k| {
            let p = coupling.pixel[k];
            for (u, plane) in u.iter_mut().zip(&planes) {
                *u = -plane.iter().zip(&basis[k]).map(|(a, b)| a * b).sum::<f64>();
            }
            let (index, value) = coupling.row(k);
            for (&j, v) in index.iter().zip(value) {
                u[j] += variance[p] * v;
            }
            (p, factor.quadratic(&mut u))
        })
        .collect()
}

/// Orthonormal functions that span the planes over some pixels, `[function]` by pixel; those that the pixels
/// do not tell from the others are zero.
fn plane_basis(pixels: &[usize], centre: &[[f64; 2]]) -> Vec<[f64; 3]> {
    let mut basis: Vec<[f64; 3]> = pixels
        .iter()
        .map(|&p| [1.0, centre[p][0], centre[p][1]])
        .collect();
    let dot =
        |basis: &[[f64; 3]], a: usize, b: usize| basis.iter().map(|f| f[a] * f[b]).sum::<f64>();
    for a in 0..3 {
        let before = dot(&basis, a, a);
        // twice: positions far from zero lose digits the first time
        for _ in 0..2 {
            for b in 0..a {
                let share = dot(&basis, a, b);
                for f in &mut basis {
                    f[a] -= share * f[b];
                }
            }
        }
        let left = dot(&basis, a, a);
        let unit = if left > 1e-12 * before {
            1.0 / left.sqrt()
        } else {
            0.0
        };
        for f in &mut basis {
            f[a] *= unit;
        }
    }
    basis
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
        // what is left of each pixel beside the plane through all, by the normal equations
        let planes = DMatrix::from_fn(pixels, 3, |k, j| {
            let [x, y] = sample.centre[shared.pixel[k]];
            [1.0, x, y][j]
        });
        let inverse = (planes.transpose() * &planes).try_inverse().unwrap();
        let beside = DMatrix::identity(pixels, pixels) - &planes * inverse * planes.transpose();
        let contrast = &beside * covariance * &beside;
        let known = DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(
            pixels,
            shared.pixel.iter().map(|&p| variance[p]),
        ));
        let own = &beside * known * &beside;
        for (k, (p, added)) in variance_from_spot(&shared, precision, &variance, &sample.centre)
            .into_iter()
            .enumerate()
        {
            assert_eq!(p, shared.pixel[k]);
            let expected = contrast[(k, k)] - own[(k, k)];
            assert!(
                (added - expected).abs() < 1e-6 * contrast[(k, k)],
                "{added} {expected}"
            );
        }
    }

    /// Of 400 pixels 20 are warm by 30 and all are known to 1: the noise of the quiet ones is drawn to
    /// zero (to less than half; it would be 1), the warm ones keep their size to their own noise and a
    /// shrinkage of 1/30^2; and a slope of what is given goes.
    #[test]
    fn quiet_pixels_are_drawn_to_zero_and_warm_ones_are_not() {
        let mut rng = star_tracker::stream(3, 0, star_tracker::Purpose::Noise);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let side = 20;
        let centre: Vec<[f64; 2]> = (0..side * side)
            .map(|p| [(p % side) as f64, (p / side) as f64])
            .collect();
        let planes = Planes::new(&vec![0; centre.len()], &centre);
        let truth = |p: usize| if p % 20 == 7 { 30.0 } else { 0.0 };
        let noise: Vec<f64> = centre.iter().map(|_| normal()).collect();
        let weight = vec![1.0; centre.len()];
        let moment: Vec<f64> = (0..centre.len())
            .map(|p| truth(p) + noise[p] + 5.0 + 0.7 * centre[p][0] - 0.4 * centre[p][1])
            .collect();
        let mut dark = Dark::none(centre.len());
        for _ in 0..200 {
            // pedestal and slope go into the spot, as in the alternation
            let mut moment = moment.clone();
            planes.take_off(
                &mut moment,
                &dark
                    .precision
                    .iter()
                    .map(|h| h.max(1e-9))
                    .collect::<Vec<_>>(),
            );
            dark.update(&moment, &weight, &planes);
        }
        let mut quiet = 0.0;
        for p in 0..centre.len() {
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
        let planes = Planes::new(&[0, 0, 0], &[[5.0, 5.0]; 3]);
        let change = dark.update(&[12.0, 4.0, 0.0], &[4.0, 4.0, 0.0], &planes);
        assert!((dark.value[0] - 1.0).abs() < 1e-12 && (dark.value[1] + 1.0).abs() < 1e-12);
        assert!(dark.value[2].abs() < 1e-15 && !dark.seen[2]);
        assert!((change - 2.0).abs() < 1e-12);
        // both are as likely quiet as warm: after one step they share the power of 1 + 1/4
        assert!(
            (dark.variance[2] - 1.25).abs() < 1e-12,
            "{}",
            dark.variance[2]
        );
    }
}
