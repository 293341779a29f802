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
use super::sample::Sample;
use super::spline::{Grid, ORDER};
use super::spot::WindowTaps;
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

    /// The next map from `sum w (z - B - F psi)` and `sum w` of every pixel.
    pub(crate) fn update(&mut self, moment: &[f64], weight: &[f64]) {
        let prior = 1.0 / self.spread;
        let mut power = 0.0;
        let mut values = Vec::new();
        for p in 0..self.value.len() {
            self.seen[p] = weight[p] > 0.0;
            if self.seen[p] {
                let precision = weight[p] + prior;
                self.value[p] = (moment[p] / precision).max(0.0);
                self.variance[p] = 1.0 / precision;
                power += self.value[p].powi(2) + self.variance[p];
                values.push(self.value[p]);
            }
        }
        if values.is_empty() {
            return;
        }
        self.spread = power / values.len() as f64;
        let typical = robust_median(values).unwrap_or(0.0);
        for p in 0..self.value.len() {
            if !self.seen[p] {
                self.value[p] = typical;
                self.variance[p] = self.spread;
            }
        }
    }
}

/// What the uncertainty of one star's spot adds to the variance of each pixel
/// against the mean of those that the star covers. `precision` is Q of the spot, `variance` v by pixel.
pub(crate) fn variance_from_spot(
    grid: &Grid,
    sample: &Sample,
    windows: &[usize],
    flux: &[f64],
    at: &[[f64; 2]],
    weight: &[f64],
    mut precision: Banded,
    variance: &[f64],
) -> Vec<(usize, f64)> {
    // indices of the star's values, by detector pixel
    let mut values: Vec<[usize; 3]> = Vec::new();
    for &w in windows {
        for (k, i) in sample.cells_of(w).enumerate() {
            if weight[i] > 0.0 {
                values.push([sample.pixel[i], w, k]);
            }
        }
    }
    values.sort_unstable();
    let order = grid.len();
    let mut dense = vec![0.0; order * order];
    for row in 0..order {
        for offset in 0..=precision.width.min(order - 1 - row) {
            dense[row * order + row + offset] = *precision.at(row, offset);
        }
    }
    let mut taps = WindowTaps::default();
    let mut coupling = |run: &[[usize; 3]], c: &mut [f64]| {
        c.fill(0.0);
        for &[_, w, k] in run {
            taps.set(grid, sample, w, at[w]);
            let [column, row] = sample.cells[k];
            let v = weight[sample.cells_of(w).start + k] * flux[w];
            let (x, y) = (&taps.x[column], &taps.y[row]);
            for a in 0..ORDER {
                let start = (x.first + a) * grid.side + y.first;
                for (t, q) in c[start..start + ORDER].iter_mut().zip(&y.value) {
                    *t += v * x.value[a] * q;
                }
            }
        }
    };
    let runs = || values.chunk_by(|a, b| a[0] == b[0]);
    let mut c = vec![0.0; order];
    let mut mean = vec![0.0; order];
    let mut pixels = 0.0;
    for run in runs() {
        coupling(run, &mut c);
        let v = variance[run[0][0]];
        pixels += 1.0;
        for i in 0..order {
            let k = v * c[i];
            if k == 0.0 {
                continue;
            }
            mean[i] += k;
            for (t, q) in dense[i * order + i..(i + 1) * order].iter_mut().zip(&c[i..]) {
                *t -= k * q;
            }
        }
    }
    for m in &mut mean {
        *m /= f64::max(pixels, 1.0);
    }
    let mut matrix = Banded::zeros(order, order - 1);
    for i in 0..order {
        let row = &dense[i * order + i..(i + 1) * order];
        matrix.entries[i * order..i * order + row.len()].copy_from_slice(row);
    }
    let Some(factor) = matrix.factor() else { return Vec::new() };
    runs()
        .map(|run| {
            coupling(run, &mut c);
            let v = variance[run[0][0]];
            for (c, m) in c.iter_mut().zip(&mean) {
                *c = v * *c - m;
            }
            (run[0][0], factor.quadratic(&mut c))
        })
        .collect()
}
