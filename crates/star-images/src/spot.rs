//! The effective point spread function of a star.
//!
//! ```text
//! z = F psi(p - s) + B + D + noise       p pixel centre, s position of the star, px
//! (A + R/rho + e 1) g = sum w F taps (z - B - D) + R/rho g0,     A = sum w F^2 taps taps^T
//! rho = (d^T R d + tr(Q^-1 R)) / (K - 4),   d = g - g0,   Q = A + R/rho + e 1
//! ```
//!
//! psi is integrated over the pixel already: it is what a pixel reads as a
//! function of its offset from the star, flux 1, a tensor cubic spline g of K
//! coefficients. R penalises second differences along both axes of what it is more than
//! g0, the Gaussian nearest to it: the wings of a spot are far smoother than its core, and what few
//! windows saw is taken for that of a Gaussian. The null space of R has 4 dimensions. rho is chosen by one step of
//! expectation-maximisation of the marginal likelihood.
//!
//! Source: Anderson & King 2000, PASP 112, 1360 (effective PSF); Eilers & Marx 1996
//! (penalised splines); Dempster, Laird & Rubin 1977 (expectation-maximisation) for rho.

use super::banded::{Banded, Factor};
use super::sample::Sample;
use super::spline::{Grid, Taps};
use super::spline_sums::{Powers, SplineSums};

/// Share of the mean weight of a coefficient that keeps unseen ones finite.
const RIDGE: f64 = 1e-9;
/// Dimensions on which second differences say nothing.
const UNPENALISED: f64 = 4.0;

/// Taps of every column and row of a window, for a star at one position.
#[derive(Clone, Debug, Default)]
pub(crate) struct WindowTaps {
    pub(crate) x: Vec<Taps>,
    pub(crate) y: Vec<Taps>,
}

impl WindowTaps {
    /// Fills in the taps of window `w` for a star at `at`.
    pub(crate) fn set(&mut self, grid: &Grid, sample: &Sample, w: usize, at: [f64; 2]) {
        let axis = |taps: &mut Vec<Taps>, a: usize| {
            taps.clear();
            taps.extend(sample.offsets(w, a, at).map(|d| grid.taps(d)));
        };
        axis(&mut self.x, 0);
        axis(&mut self.y, 1);
    }
}

/// Sums behind one star's spot.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    /// A, bandwidth 3 side + 3.
    band: Banded,
    /// `sum w F taps (z - B)`, and what the spot is drawn to.
    pub(crate) moment: Vec<f64>,
}

/// Accumulates the sums over windows of one star. `weight` is 0 for pixels left
/// out; `background` by window.
pub(crate) fn normal(
    grid: &Grid,
    sample: &Sample,
    windows: &[usize],
    flux: &[f64],
    at: &[[f64; 2]],
    weight: &[f64],
    background: impl Fn(usize) -> f64,
) -> Normal {
    let mut sums = SplineSums::new(grid);
    let mut along: [Vec<Powers>; 2] = Default::default();
    for &w in windows {
        for (axis, powers) in along.iter_mut().enumerate() {
            powers.clear();
            let offsets = sample.offsets(w, axis, at[w]);
            powers.extend(offsets.map(|d| Powers::new(grid.place(d))));
        }
        let f2 = flux[w] * flux[w];
        let level = background(w);
        for (i, &[c, r]) in sample.cells_of(w).zip(&sample.cells) {
            let v = weight[i] * f2;
            if v == 0.0 {
                continue;
            }
            let m = weight[i] * flux[w] * (sample.z[i] - level);
            sums.add(&along[0][c], &along[1][r], v, m);
        }
    }
    let (band, moment) = sums.products();
    Normal { band, moment }
}

impl Normal {
    /// A g.
    pub(crate) fn times(&self, g: &[f64]) -> Vec<f64> {
        self.band.times(g)
    }

    /// A + R/rho + ridge.
    pub(crate) fn penalised(&self, grid: &Grid, rho: f64) -> Banded {
        let mut band = self.band.clone();
        // a star without weight keeps a flat spot
        let ridge = RIDGE * band.trace().max(f64::MIN_POSITIVE) / grid.len() as f64;
        for row in 0..grid.len() {
            *band.at(row, 0) += ridge;
        }
        for_roughness(grid, |row, offset, value| {
            *band.at(row, offset) += value / rho;
        });
        band
    }

    /// Adds R/rho g0 to the moment: what draws a spot to the Gaussian `about`.
    pub(crate) fn draw_to(&mut self, grid: &Grid, rho: f64, about: &[f64]) {
        for_roughness(grid, |row, offset, value| {
            let value = value / rho;
            self.moment[row] += value * about[row + offset];
            if offset > 0 {
                self.moment[row + offset] += value * about[row];
            }
        });
    }

    /// Factor of Q.
    pub(crate) fn factor(&self, grid: &Grid, rho: f64) -> Option<Factor> {
        self.penalised(grid, rho).factor()
    }
}

/// One step of expectation-maximisation for the variance of second differences of `own`, what the spot is more than
/// the Gaussian it is drawn to.
pub(crate) fn next_rho(grid: &Grid, factor: &Factor, own: &[f64]) -> f64 {
    let mut inverse = factor.inverse_in_band();
    let mut sum = 0.0;
    for_roughness(grid, |row, offset, value| {
        // each pair off the diagonal stands for two entries
        let twice = if offset == 0 { 1.0 } else { 2.0 };
        sum += twice * value * (own[row] * own[row + offset] + *inverse.at(row, offset));
    });
    sum / (grid.len() as f64 - UNPENALISED).max(1.0)
}

/// Upper half of R, entry by entry: row, offset of the column, value.
fn for_roughness(grid: &Grid, mut f: impl FnMut(usize, usize, f64)) {
    let n = grid.side;
    // second differences of n points: D^T D
    let entry = |i: usize, k: usize| -> f64 {
        let d = [1.0, -2.0, 1.0];
        (0..n.saturating_sub(2))
            .filter(|s| (*s..s + 3).contains(&i) && (*s..s + 3).contains(&(i + k)))
            .map(|s| d[i - s] * d[i + k - s])
            .sum()
    };
    for i in 0..n {
        for k in 0..3.min(n - i) {
            let value = entry(i, k);
            for j in 0..n {
                f(i * n + j, k * n, value);
                f(j * n + i, k, value);
            }
        }
    }
}

/// Full width of a spot at half its maximum, px: diameter of the circle whose area
/// is that above half the maximum. For a Gaussian spot of standard deviation s it is
/// near `2.355 sqrt(s^2 + 1/12)`: the pixel is in it.
pub(crate) fn fwhm_px(grid: &Grid, psi: &[f64]) -> f64 {
    let step = 0.05;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few pixels in twentieths"
    )]
    let half = (grid.half_width_px / step) as usize;
    let taps: Vec<Taps> = (0..=2 * half)
        .map(|i| grid.taps((i as f64 - half as f64) * step))
        .collect();
    let values: Vec<f64> = taps
        .iter()
        .flat_map(|x| taps.iter().map(move |y| (x, y)))
        .map(|(x, y)| grid.value(psi, x, y))
        .collect();
    let peak = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let above = values.iter().filter(|v| **v > 0.5 * peak).count();
    2.0 * (above as f64 * step * step / std::f64::consts::PI).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// R applied to a function of second differences d along one axis gives n d^2
    /// summed; a plane gives nothing.
    #[test]
    fn the_penalty_sees_curvature_only() {
        let grid = Grid::new(1.5, 0.5);
        let n = grid.side;
        let quadratic = |psi: &[f64]| {
            let mut sum = 0.0;
            for_roughness(&grid, |row, offset, value| {
                sum += if offset == 0 { 1.0 } else { 2.0 } * value * psi[row] * psi[row + offset];
            });
            sum
        };
        let build = |f: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
            (0..grid.len())
                .map(|k| f((k / n) as f64, (k % n) as f64))
                .collect()
        };
        let plane = build(&|x, y| 2.0 + 3.0 * x - y);
        assert!(quadratic(&plane).abs() < 1e-9);
        let parabola = build(&|x, y| x * x + 0.5 * y);
        let expected = (n * (n - 2)) as f64 * 4.0;
        assert!((quadratic(&parabola) - expected).abs() < 1e-9 * expected);
    }

    /// Area above half the maximum of a separable Gaussian is that of a circle of
    /// diameter 2.3548 sigma; it is counted in cells of 0.05 px, about 1 % here,
    /// and the spline follows the Gaussian to (h/sigma)^4/384.
    #[test]
    fn width_of_a_gaussian() {
        let grid = Grid::new(4.0, 0.4);
        let sigma = 0.9;
        let knot = |j: usize| (j as f64 - 1.0) * grid.spacing_px - grid.half_width_px;
        // smoothing by the spline adds h^2/3 to the variance when its
        // coefficients are samples of the function
        let v = sigma * sigma - grid.spacing_px.powi(2) / 3.0;
        let psi: Vec<f64> = (0..grid.len())
            .map(|k| {
                let (x, y) = (knot(k / grid.side), knot(k % grid.side));
                (-0.5 * (x * x + y * y) / v).exp()
            })
            .collect();
        let width = fwhm_px(&grid, &psi);
        assert!((width - 2.3548 * sigma).abs() < 0.02 * width, "{width}");
    }

    /// Windows that show the spot g0 itself are explained by it, however strongly a spot is drawn to g0: the moment is
    /// A g0, and Q g0 = A g0 + R/rho g0, but for the ridge of 1e-9. Drawn to nothing, the same spot is smoothed.
    #[test]
    fn a_spot_that_is_what_it_is_drawn_to_stays() {
        let sample = super::super::synthetic::few_windows(300);
        let grid = Grid::new(sample.reach_px() + 0.5, 0.4);
        let windows: Vec<usize> = (0..sample.windows()).collect();
        let weight = vec![0.05; sample.z.len()];
        let (flux, at) = (&sample.flux, &sample.start);
        let sums = normal(&grid, &sample, &windows, flux, at, &weight, |_| 0.0);
        let about: Vec<f64> = (0..grid.len())
            .map(|k| {
                let [x, y] = [k / grid.side, k % grid.side].map(|k| k as f64 - 8.0);
                (-0.05 * (x * x + 0.7 * y * y)).exp()
            })
            .collect();
        let rho = 1e-8;
        let factor = sums.factor(&grid, rho).unwrap();
        let off = |drawn: bool| {
            let mut sums = sums.clone();
            sums.moment = sums.times(&about);
            if drawn {
                sums.draw_to(&grid, rho, &about);
            }
            let mut psi = sums.moment;
            factor.solve(&mut psi);
            let off = psi.iter().zip(&about).map(|(p, a)| (p - a).abs());
            off.fold(0.0, f64::max)
        };
        assert!(off(true) < 1e-4, "{}", off(true));
        assert!(off(false) > 0.1, "{}", off(false));
    }

    /// psi^T R psi + tr(Q^-1 R) with dense matrices; R built from its definition.
    #[test]
    fn roughness_step_against_dense_algebra() {
        let sample = super::super::synthetic::few_windows(40);
        let grid = Grid::new(sample.reach_px() + 0.5, 1.3);
        let (n, order) = (grid.side, grid.len());
        let windows: Vec<usize> = (0..sample.windows()).collect();
        let weight = vec![1e-9; sample.z.len()];
        let sums = normal(
            &grid,
            &sample,
            &windows,
            &sample.flux,
            &sample.start,
            &weight,
            |_| 0.0,
        );
        let mut q = sums.penalised(&grid, 0.4);
        let mut dense = nalgebra::DMatrix::zeros(order, order);
        for i in 0..order {
            for k in 0..=q.width.min(order - 1 - i) {
                dense[(i, i + k)] = *q.at(i, k);
                dense[(i + k, i)] = *q.at(i, k);
            }
        }
        let mut rough = nalgebra::DMatrix::zeros(order, order);
        for line in 0..n {
            for s in 0..n - 2 {
                for (stride, start) in [(n, s * n + line), (1, line * n + s)] {
                    for (a, u) in [1.0, -2.0, 1.0].into_iter().enumerate() {
                        for (b, v) in [1.0, -2.0, 1.0].into_iter().enumerate() {
                            rough[(start + a * stride, start + b * stride)] += u * v;
                        }
                    }
                }
            }
        }
        let psi: Vec<f64> = (0..order).map(|i| (i as f64).sin()).collect();
        let x = nalgebra::DVector::from_vec(psi.clone());
        let trace = (dense.try_inverse().unwrap() * &rough).trace();
        let expected = (x.dot(&(&rough * &x)) + trace) / (order as f64 - 4.0);
        let factor = sums.factor(&grid, 0.4).unwrap();
        let got = next_rho(&grid, &factor, &psi);
        assert!((got / expected - 1.0).abs() < 1e-9, "{got} {expected}");
        // both parts count
        assert!(trace > 0.1 * expected * order as f64);
    }
}
