//! A round Gaussian as a spot: what a tracker would fit that knows no better, and what a spot is thought to be where
//! its windows do not say.
//!
//! ```text
//! psi_G(q) = a G(q; s) + u . grad G + p,     G the Gaussian of width s integrated over the pixel
//! minimise (psi - psi_G)^T A (psi - psi_G)   over a, p, the shift u to first order, and s
//! ```
//!
//! psi is the effective spot, A its normal matrix: the Gaussian that the windows themselves ask for, without
//! going through them again. Where G is compared with the spot it is written in splines with knots of half the
//! distance: its own shape, not that of the splines, is compared; and without its shift: a spot has its own zero.
//!
//! Source: linear least squares with one non-linear parameter profiled.

use nalgebra::{DMatrix, DVector, Matrix4, Vector4};

use super::banded::dot;
use super::spline::Grid;
use super::spot::Normal;

/// Widths that are looked at, px.
const WIDTHS_PX: [f64; 2] = [0.15, 4.0];
/// Parts of the interval, by the golden section: to 1e-5 of the width.
const STEPS: usize = 28;
/// How far from the last one a width is looked for while a spot is still learned, and how often the interval is
/// parted: to 2e-3.
const NEAR: f64 = 0.1;
const NEAR_STEPS: usize = 10;

/// A round Gaussian.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gaussian {
    pub(crate) width_px: f64,
    amplitude: f64,
    /// What lies under it.
    pub(crate) pedestal: f64,
    /// Amplitude times its shift along x and y, px.
    shift: [f64; 2],
}

/// Where the width is looked for.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Widths {
    All,
    /// Within a tenth of this one, px, and roughly.
    Near(f64),
}

/// The Gaussian nearest to the spot `psi`.
pub(crate) fn nearest(
    grid: &Grid,
    normal: &Normal,
    psi: &[f64],
    widths: Widths,
) -> Option<Gaussian> {
    let spline = Spline::new(grid)?;
    let seen = normal.times(psi);
    let level = vec![1.0; psi.len()];
    let level_seen = normal.times(&level);
    let fit = |width: f64| -> Option<(f64, Vector4<f64>)> {
        let columns = spline.columns(width);
        let [value_seen, x_seen, y_seen] = columns.each_ref().map(|c| normal.times(c));
        let [value, x, y] = &columns;
        let columns = [value, &level, x, y];
        let by = [&value_seen, &level_seen, &x_seen, &y_seen];
        let matrix = Matrix4::from_fn(|i, j| dot(columns[i], by[j]));
        let moment = Vector4::from_fn(|i, _| dot(columns[i], &seen));
        // amplitudes and slopes differ by orders of magnitude
        let size = matrix.diagonal().map(|v| v.max(f64::MIN_POSITIVE).sqrt());
        let scaled = Matrix4::from_fn(|i, j| matrix[(i, j)] / (size[i] * size[j]));
        let solution = scaled.cholesky()?.solve(&moment.component_div(&size));
        let solution = solution.component_div(&size);
        Some((moment.dot(&solution), solution))
    };
    let ([mut low, mut high], steps) = match widths {
        Widths::All => (WIDTHS_PX.map(f64::ln), STEPS),
        Widths::Near(width) => ([-NEAR, NEAR].map(|d| width.ln() + d), NEAR_STEPS),
    };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let power = |at: f64| fit(at.exp()).map_or(f64::NEG_INFINITY, |f| f.0);
    let mut inner = [high - golden * (high - low), low + golden * (high - low)];
    let mut found = inner.map(power);
    for _ in 0..steps {
        if found[0] > found[1] {
            high = inner[1];
            inner = [high - golden * (high - low), inner[0]];
            found = [power(inner[0]), found[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + golden * (high - low)];
            found = [found[1], power(inner[1])];
        }
    }
    let width_px = (0.5 * (low + high)).exp();
    let (_, solution) = fit(width_px)?;
    let [amplitude, pedestal, x, y]: [f64; 4] = solution.into();
    (amplitude > 0.0).then_some(Gaussian {
        width_px,
        amplitude,
        pedestal,
        shift: [x, y],
    })
}

impl Gaussian {
    /// In splines, at the spot's zero.
    pub(crate) fn coefficients(&self, grid: &Grid) -> Option<Vec<f64>> {
        Self {
            shift: [0.0; 2],
            ..*self
        }
        .shifted(grid)
    }

    /// In splines, where the spot has it.
    pub(crate) fn shifted(&self, grid: &Grid) -> Option<Vec<f64>> {
        let [value, x, y] = Spline::new(grid)?.columns(self.width_px);
        let [u, v] = self.shift;
        let at = |k: usize| self.amplitude * value[k] + u * x[k] + v * y[k] + self.pedestal;
        Some((0..value.len()).map(at).collect())
    }
}

/// Knots of half the distance.
pub(crate) fn finer(grid: &Grid) -> Grid {
    Grid::new(grid.half_width_px, 0.5 * grid.spacing_px)
}

/// Share of the light in a pixel at distance d along one axis, and minus its derivative.
fn gaussian(d: f64, width: f64) -> [f64; 2] {
    let edge = |at: f64| {
        let z = at / width;
        let density = (-0.5 * z * z).exp() / (width * std::f64::consts::TAU.sqrt());
        let below = 0.5 * statrs::function::erf::erfc(-z / std::f64::consts::SQRT_2);
        [below, -density]
    };
    let ([a, da], [b, db]) = (edge(d + 0.5), edge(d - 0.5));
    [a - b, da - db]
}

fn outer(x: &[f64], y: &[f64]) -> Vec<f64> {
    x.iter()
        .flat_map(|a| y.iter().map(move |b| a * b))
        .collect()
}

/// Interpolation along one axis: the values at the knots, straight at both ends.
struct Spline {
    inverse: DMatrix<f64>,
    knots: Vec<f64>,
}

impl Spline {
    fn new(grid: &Grid) -> Option<Self> {
        let n = grid.side;
        let knots: Vec<f64> = (0..n - 2)
            .map(|k| k as f64 * grid.spacing_px - grid.half_width_px)
            .collect();
        let mut matrix = DMatrix::zeros(n, n);
        for k in 0..n - 2 {
            for (j, v) in [1.0, 4.0, 1.0].into_iter().enumerate() {
                matrix[(k, k + j)] = v / 6.0;
            }
        }
        for (row, first) in [(n - 2, 0), (n - 1, n - 3)] {
            for (j, v) in [1.0, -2.0, 1.0].into_iter().enumerate() {
                matrix[(row, first + j)] = v;
            }
        }
        let inverse = matrix.try_inverse()?;
        Some(Self { inverse, knots })
    }

    /// A Gaussian of amplitude 1, and what a shift along x and y adds to it.
    fn columns(&self, width: f64) -> [Vec<f64>; 3] {
        let [value, slope] = [0, 1].map(|k| self.coefficients(|d| gaussian(d, width)[k]));
        [
            outer(&value, &value),
            outer(&slope, &value),
            outer(&value, &slope),
        ]
    }

    fn coefficients(&self, f: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut values: Vec<f64> = self.knots.iter().map(|&d| f(d)).collect();
        values.extend([0.0; 2]);
        (&self.inverse * DVector::from_vec(values))
            .as_slice()
            .to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::super::spot;
    use super::super::synthetic::few_windows;
    use super::*;

    /// Interpolation of a Gaussian of s^2 = 0.7^2 + 1/12 with knots h apart is off by up to h^4/384 f'''',
    /// 3/s^4 of its height at the middle: 6e-4 for 0.4 px, half of that allowed at 0.2 px; and it is the
    /// crate `centroid`'s.
    #[test]
    fn splines_follow_a_gaussian() {
        let grid = Grid::new(4.0, 0.2);
        let shape = Gaussian {
            width_px: 0.7,
            amplitude: 2.0,
            pedestal: 0.1,
            shift: [0.0; 2],
        };
        let psi = shape.coefficients(&grid).unwrap();
        for (x, y) in [(0.0, 0.0), (0.3, -0.7), (1.13, 0.41), (-2.2, 1.9)] {
            let got = grid.value(&psi, &grid.taps(x), &grid.taps(y));
            let mut expected = [0.0];
            let at = focal_plane::Pixel { x: -x, y: -y };
            let first = focal_plane::Pixel { x: 0.0, y: 0.0 };
            centroid::pixel_gaussian_into(first, 1, at, 0.7, 2.0, &mut expected).unwrap();
            assert!(
                (got - 0.1 - expected[0]).abs() < 4e-5 * 2.0,
                "{got} {expected:?}"
            );
        }
    }

    /// The windows of `few_windows` hold a Gaussian of known width: it is found from its splines.
    #[test]
    fn the_width_is_found() {
        let sample = few_windows(300);
        let grid = Grid::new(sample.reach_px() + 0.5, 0.4);
        let windows: Vec<usize> = (0..sample.windows()).collect();
        let weight = vec![0.05; sample.z.len()];
        let level = sample.background[0];
        let (flux, at) = (&sample.flux, &sample.start);
        let normal = spot::normal(&grid, &sample, &windows, flux, at, &weight, |_| level);
        let mut psi = normal.moment.clone();
        normal.factor(&grid, 1e-2).unwrap().solve(&mut psi);
        let Gaussian {
            width_px: width,
            amplitude,
            pedestal,
            ..
        } = nearest(&grid, &normal, &psi, Widths::All).unwrap();
        assert!((width / 0.9 - 1.0).abs() < 2e-3, "{width}");
        // the fluxes of the sample are sums over a window that the spot does not fit into
        assert!(amplitude > 0.98 && amplitude < 1.2, "{amplitude}");
        assert!(pedestal.abs() < 1e-3, "{pedestal}");
    }
}
