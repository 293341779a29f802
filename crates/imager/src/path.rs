//! The way of a star over the detector while its window is exposed.
//!
//! ```text
//! row r is exposed over  t + row_time y_r - T/2 ... t + row_time y_r + T/2        y_r: its centre, centred px
//! image of the row = 1/T integral of spot(place(t')) dt'
//! ```
//!
//! The place is found with the full geometry at five Chebyshev-Lobatto instants of the window's own
//! span and is their polynomial in between; the integral is a Gauss-Legendre sum with as many nodes as the length of the
//! way needs. No expansion in rates: smear, turn-around and the shear of a rolling shutter follow.
//!
//! The polynomial leaves 2e-5 of the amplitude of a line whose period is four spans (0.1 s: 2.5 Hz) and 6e-4
//! of one of two spans. A Gauss-Legendre sum of n nodes over a way of L sigmas is good to 1e-5 of a pixel's share up
//! to the lengths in [`LEVELS`].
//!
//! Source: Abramowitz & Stegun 25.4.29 (Gauss-Legendre), 25.2.1 (Lagrange).

use core::f64::consts::PI;

/// Nodes at which the place is computed.
pub(crate) const NODES: usize = 5;

/// Gauss-Legendre nodes, up to this way in sigmas of the spot.
const LEVELS: [(usize, f64); 4] = [(3, 1.0), (8, 6.0), (24, 18.0), (64, f64::INFINITY)];

/// Instants of one window, relative to the middle of its exposure, and how to get from the places at
/// them to the places of every row.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    /// Half the time from the first row's opening to the last row's closing, s.
    half_s: f64,
    levels: Vec<Level>,
    /// Distinct rows: 1 for a global shutter.
    rows: usize,
}

#[derive(Clone, Debug)]
struct Level {
    nodes: usize,
    weight: Vec<f64>,
    /// For each row and node, what each instant's place counts.
    basis: Vec<[f64; NODES]>,
}

impl Plan {
    pub(crate) fn new(exposure_s: f64, row_time_s: f64, window_rows: usize) -> Self {
        let rows = if row_time_s == 0.0 { 1 } else { window_rows };
        let spread_s = row_time_s.abs() * (rows as f64 - 1.0);
        let half_s = 0.5 * (exposure_s + spread_s);
        let level = |nodes: usize| {
            let (at, weight) = gauss_legendre(nodes);
            let mut basis = Vec::with_capacity(rows * nodes);
            for row in 0..rows {
                let middle_s = row_time_s * (row as f64 - 0.5 * (rows as f64 - 1.0));
                for x in &at {
                    let s = (middle_s + 0.5 * exposure_s * x) / half_s;
                    basis.push(lagrange(if half_s > 0.0 { s } else { 0.0 }));
                }
            }
            Level {
                nodes,
                weight,
                basis,
            }
        };
        Self {
            half_s,
            levels: LEVELS.iter().map(|&(nodes, _)| level(nodes)).collect(),
            rows,
        }
    }

    /// Instants at which the place is needed, s from the middle of the window's exposure.
    pub(crate) fn instants_s(&self) -> [f64; NODES] {
        chebyshev().map(|x| x * self.half_s)
    }

    /// Whether every row sees the same.
    pub(crate) fn global(&self) -> bool {
        self.rows == 1
    }

    /// Calls `add(row, place, weight)` for all nodes of all rows (of one row for a global shutter); the
    /// weights of a row sum to 1.
    pub(crate) fn integrate(
        &self,
        place: &[[f64; 2]; NODES],
        sigma_px: f64,
        mut add: impl FnMut(usize, [f64; 2], f64),
    ) {
        let way = place
            .windows(2)
            .map(|p| (p[1][0] - p[0][0]).hypot(p[1][1] - p[0][1]));
        let sigmas = way.sum::<f64>() / sigma_px;
        let at = LEVELS.iter().position(|(_, most)| sigmas <= *most);
        let level = &self.levels[at.unwrap_or(LEVELS.len() - 1)];
        for row in 0..self.rows {
            for (k, weight) in level.weight.iter().enumerate() {
                let basis = &level.basis[row * level.nodes + k];
                let mut p = [0.0; 2];
                for (b, place) in basis.iter().zip(place) {
                    p[0] += b * place[0];
                    p[1] += b * place[1];
                }
                add(row, p, *weight);
            }
        }
    }
}

fn chebyshev() -> [f64; NODES] {
    core::array::from_fn(|k| -(PI * k as f64 / (NODES as f64 - 1.0)).cos())
}

/// What each instant's value counts at x in -1..1.
fn lagrange(x: f64) -> [f64; NODES] {
    let at = chebyshev();
    core::array::from_fn(|i| {
        let factor = |j: usize| {
            if j == i {
                1.0
            } else {
                (x - at[j]) / (at[i] - at[j])
            }
        };
        (0..NODES).map(factor).product()
    })
}

/// Nodes on -1..1 and weights that sum to 1: Newton on the Legendre polynomial.
fn gauss_legendre(n: usize) -> (Vec<f64>, Vec<f64>) {
    let count = n as f64;
    let polynomial = |x: f64| {
        let (mut before, mut now) = (1.0, x);
        for k in 2..=n {
            let k = k as f64;
            let next = ((2.0 * k - 1.0) * x * now - (k - 1.0) * before) / k;
            before = now;
            now = next;
        }
        (now, count * (x * now - before) / (x * x - 1.0))
    };
    (0..n)
        .map(|i| {
            let mut x = -(PI * (i as f64 + 0.75) / (count + 0.5)).cos();
            for _ in 0..20 {
                let (value, slope) = polynomial(x);
                x -= value / slope;
            }
            let slope = polynomial(x).1;
            // half of the usual weight: the interval has length 2
            (x, 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// n nodes integrate x^k exactly up to k = 2n - 1; rounding of 64 terms.
    #[test]
    fn quadrature_is_exact_for_polynomials() {
        for (n, _) in LEVELS {
            let (x, w) = gauss_legendre(n);
            for power in [0, 1, 2, 4] {
                let sum: f64 = x.iter().zip(&w).map(|(x, w)| w * x.powi(power)).sum();
                let exact = if power % 2 == 1 {
                    0.0
                } else {
                    1.0 / f64::from(power + 1)
                };
                assert!((sum - exact).abs() < 1e-13, "{n} {power}: {sum}");
            }
        }
    }

    /// A place of fourth order in time comes back exactly, at its own time for every row.
    #[test]
    fn rows_see_their_own_interval() {
        let (exposure, row_time, rows) = (0.1, 2e-3, 7);
        let plan = Plan::new(exposure, row_time, rows);
        let path = |t: f64| [3.0 * t - 40.0 * t * t, 5.0 * t.powi(3) - 1e3 * t.powi(4)];
        let place = plan.instants_s().map(path);
        let mut mean = vec![[0.0; 2]; rows];
        plan.integrate(&place, 1.0, |row, p, w| {
            mean[row][0] += w * p[0];
            mean[row][1] += w * p[1];
        });
        for (row, mean) in mean.iter().enumerate() {
            let a = row_time * (row as f64 - 3.0) - 0.5 * exposure;
            let b = a + exposure;
            let x = (1.5 * (b * b - a * a) - 40.0 / 3.0 * (b.powi(3) - a.powi(3))) / exposure;
            let y = (1.25 * (b.powi(4) - a.powi(4)) - 200.0 * (b.powi(5) - a.powi(5))) / exposure;
            assert!(
                (mean[0] - x).abs() < 1e-12 && (mean[1] - y).abs() < 1e-12,
                "row {row}"
            );
        }
    }

    /// The claim of the header: the share of a pixel of a Gaussian smeared over L sigmas, against a
    /// midpoint sum of 20000.
    #[test]
    fn levels_are_long_enough() {
        let share = |x: f64| libm::erf((1.0 - x) / 0.7_f64) - libm::erf((0.0 - x) / 0.7_f64);
        let sigma = 0.7 / 2_f64.sqrt();
        for ((_, longest), length) in LEVELS.iter().zip([1.0, 6.0, 18.0, 48.0]) {
            assert!(length <= *longest);
            let way = length * sigma;
            let plan = Plan::new(1.0, 0.0, 1);
            let place = plan.instants_s().map(|t| [way * t + 0.2, 0.0]);
            let mut got = 0.0;
            plan.integrate(&place, sigma, |_, p, w| got += w * share(p[0]));
            let n = 20_000_i32;
            let t = |k: i32| (f64::from(k) + 0.5) / f64::from(n) - 0.5;
            let want: f64 = (0..n).map(|k| share(way * t(k) + 0.2)).sum::<f64>() / f64::from(n);
            assert!((got - want).abs() < 1e-5, "{length}: {got} {want}");
        }
    }
}
