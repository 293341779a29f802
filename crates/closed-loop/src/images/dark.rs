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
//! with Q_i the spot's own precision and means over the pixels that star i covers: a
//! uniform level there is a pedestal of the spot or a background as well, and has no
//! size of its own. Units: those of the scaled windows.
//!
//! Source: linear least squares with blocks eliminated (Schur complement); MacKay
//! 1992 for tau.

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
