//! What each detector pixel adds by itself.
//!
//! ```text
//! D(p) = max(0, sum w (z - B - F psi) / (sum w + 1/tau^2)),   v(p) = 1/(sum w + 1/tau^2)
//! tau^2 = mean(D^2 + v)     over the pixels seen
//! ```
//!
//! over all windows that cover p, of whatever star. v is the variance with the
//! spots known. They are not: a pixel that a spot sweeps over shares its signal
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
use super::robust_median;

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

    /// The next map from `sum w (z - B - F psi)` and `sum w` of every pixel;
    /// returns the largest change in units of sqrt(v).
    pub(crate) fn update(&mut self, moment: &[f64], weight: &[f64]) -> f64 {
        let mut change = 0.0_f64;
        let prior = 1.0 / self.spread;
        let mut power = 0.0;
        let mut values = Vec::new();
        for p in 0..self.value.len() {
            self.seen[p] = weight[p] > 0.0;
            if self.seen[p] {
                let precision = weight[p] + prior;
                let value = (moment[p] / precision).max(0.0);
                change = change.max((value - self.value[p]).abs() * precision.sqrt());
                self.value[p] = value;
                self.variance[p] = 1.0 / precision;
                power += self.value[p].powi(2) + self.variance[p];
                values.push(self.value[p]);
            }
        }
        if values.is_empty() {
            return 0.0;
        }
        self.spread = power / values.len() as f64;
        let typical = robust_median(values).unwrap_or(0.0);
        for p in 0..self.value.len() {
            if !self.seen[p] {
                self.value[p] = typical;
                self.variance[p] = self.spread;
            }
        }
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
