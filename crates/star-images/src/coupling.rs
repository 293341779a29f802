//! What a star's spot and the detector pixels under it have in common.
//!
//! ```text
//! N_p = sum w,   d_p = sum w (z - B),   c_p = sum w F taps        over the windows on pixel p
//! A = sum w F^2 taps taps^T,            b = sum w F taps (z - B)   over all its windows
//! spot:   (A + prior) g = b - sum_p c_p D_p
//! pixel:  D_p = (sum_i d_p - c_p g_i) / (sum_i N_p + prior)
//! ```
//!
//! With positions, fluxes and weights fixed these sums are all that spots and map
//! depend on: going to and fro between the two then costs next to nothing, and it
//! takes many times, because a spot that sweeps over a pixel can trade light for
//! the pixel's own signal. Units of the scaled windows.
//!
//! Source: normal equations of `z = F psi(p - s) + B + D` in blocks.

use super::sample::Sample;
use super::spline::{Grid, ORDER};

/// Sums of one star; rows `c_p` hold their non-zero entries only.
#[derive(Clone, Debug, Default)]
pub(crate) struct Coupling {
    /// Detector pixels that count, ascending.
    pub(crate) pixel: Vec<usize>,
    /// N and d of each.
    pub(crate) weight: Vec<f64>,
    pub(crate) excess: Vec<f64>,
    first: Vec<usize>,
    index: Vec<usize>,
    value: Vec<f64>,
}

/// Values of one star ordered by detector pixel: `[pixel, window, cell]`.
pub(crate) fn by_pixel(sample: &Sample, windows: &[usize]) -> Vec<[usize; 3]> {
    let mut values: Vec<[usize; 3]> = windows
        .iter()
        .flat_map(|&w| {
            sample
                .cells_of(w)
                .enumerate()
                .map(move |(k, i)| [sample.pixel[i], w, k])
        })
        .collect();
    values.sort_unstable();
    values
}

impl Coupling {
    /// Sums over the values `ordered` ([`by_pixel`]); `background` by window,
    /// `weight` by value.
    pub(crate) fn new(
        grid: &Grid,
        sample: &Sample,
        ordered: &[[usize; 3]],
        flux: &[f64],
        at: &[[f64; 2]],
        weight: &[f64],
        background: impl Fn(usize) -> f64,
    ) -> Self {
        let mut coupling = Self {
            first: vec![0],
            ..Self::default()
        };
        let mut row = vec![0.0; grid.len()];
        for run in ordered.chunk_by(|a, b| a[0] == b[0]) {
            row.fill(0.0);
            let (mut total, mut excess) = (0.0, 0.0);
            for &[_, w, k] in run {
                let i = sample.cells_of(w).start + k;
                let v = weight[i];
                if v == 0.0 {
                    continue;
                }
                total += v;
                excess += v * (sample.z[i] - background(w));
                let [c, r] = sample.cells[k];
                let x = grid.taps(sample.corner[w][0] - at[w][0] + c as f64);
                let y = grid.taps(sample.corner[w][1] - at[w][1] + r as f64);
                for a in 0..ORDER {
                    let start = (x.first + a) * grid.side + y.first;
                    let k = v * flux[w] * x.value[a];
                    for (t, q) in row[start..start + ORDER].iter_mut().zip(&y.value) {
                        *t += k * q;
                    }
                }
            }
            if total == 0.0 {
                continue;
            }
            coupling.pixel.push(run[0][0]);
            coupling.weight.push(total);
            coupling.excess.push(excess);
            for (j, &v) in row.iter().enumerate() {
                if v != 0.0 {
                    coupling.index.push(j);
                    coupling.value.push(v);
                }
            }
            coupling.first.push(coupling.index.len());
        }
        coupling
    }

    /// Indices and values of the non-zero entries of row `k`.
    pub(crate) fn row(&self, k: usize) -> (&[usize], &[f64]) {
        let range = self.first[k]..self.first[k + 1];
        (&self.index[range.clone()], &self.value[range])
    }

    /// Takes `sum_p c_p D_p` off the right hand side of the spot.
    pub(crate) fn take_off_dark(&self, dark: &[f64], moment: &mut [f64]) {
        for (k, &p) in self.pixel.iter().enumerate() {
            let (index, value) = self.row(k);
            for (&j, v) in index.iter().zip(value) {
                moment[j] -= v * dark[p];
            }
        }
    }

    /// Adds `d_p - c_p g` and `N_p` to what all stars say of each pixel.
    pub(crate) fn tell_pixels(&self, psi: &[f64], moment: &mut [f64], weight: &mut [f64]) {
        for (k, &p) in self.pixel.iter().enumerate() {
            let (index, value) = self.row(k);
            let light: f64 = index.iter().zip(value).map(|(&j, v)| v * psi[j]).sum();
            moment[p] += self.excess[k] - light;
            weight[p] += self.weight[k];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::spot::WindowTaps;
    use super::super::synthetic::few_windows;
    use super::*;

    /// Both directions against sums over the pixels one by one: rounding only.
    #[test]
    fn sums_are_those_over_the_pixels() {
        let sample = few_windows(25);
        let grid = Grid::new(sample.reach_px() + 0.5, 0.7);
        let windows: Vec<usize> = (0..sample.windows()).filter(|w| w % 5 != 2).collect();
        let weight: Vec<f64> = (0..sample.z.len()).map(|i| (i % 4) as f64 * 0.1).collect();
        let (flux, at) = (&sample.flux, &sample.start);
        let level = |w: usize| w as f64;
        let coupling = Coupling::new(
            &grid,
            &sample,
            &by_pixel(&sample, &windows),
            flux,
            at,
            &weight,
            level,
        );
        let dark: Vec<f64> = (0..sample.centre.len())
            .map(|p| (p as f64 * 0.7).sin())
            .collect();
        let psi: Vec<f64> = (0..grid.len()).map(|j| (j as f64 * 0.3).cos()).collect();
        let pixels = sample.centre.len();
        let (mut off, mut told, mut total) =
            (vec![0.0; grid.len()], vec![0.0; pixels], vec![0.0; pixels]);
        coupling.take_off_dark(&dark, &mut off);
        coupling.tell_pixels(&psi, &mut told, &mut total);
        let (mut both, mut excess, mut weights) = (0.0, vec![0.0; pixels], vec![0.0; pixels]);
        let mut taps = WindowTaps::default();
        for &w in &windows {
            taps.set(&grid, &sample, w, at[w]);
            for (i, &[c, r]) in sample.cells_of(w).zip(&sample.cells) {
                let light = flux[w] * grid.value(&psi, &taps.x[c], &taps.y[r]);
                let p = sample.pixel[i];
                both -= weight[i] * light * dark[p];
                excess[p] += weight[i] * (sample.z[i] - level(w) - light);
                weights[p] += weight[i];
            }
        }
        // psi^T sum c D, one number for all entries of the first
        let got: f64 = off.iter().zip(&psi).map(|(o, g)| o * g).sum();
        assert!((got / both - 1.0).abs() < 1e-9, "{got} {both}");
        for p in 0..pixels {
            assert!((told[p] - excess[p]).abs() < 1e-8 * FLUX_SCALE, "pixel {p}");
            assert!((total[p] - weights[p]).abs() < 1e-12);
        }
    }

    /// Rounding is relative to the light in a window.
    const FLUX_SCALE: f64 = 1e4;
}
