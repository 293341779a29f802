//! Sums over products of splines.
//!
//! ```text
//! A_jk,lm = sum v b_j(x) b_k(y) b_l(x) b_m(y)        c_jk = sum m b_j(x) b_k(y)
//! b_j b_l = sum_p P_jl,p u^p, p <= 6, on one knot interval,   u from its middle, in (-1/2, 1/2) knots
//! A_jk,lm = sum over intervals, p, q of P_jl,p P_km,q sum v u_x^p u_y^q
//! ```
//!
//! Of the 256 products that one point has, 49 powers tell all: these are summed point by point, and made into
//! products once for each interval.
//!
//! Source: de Boor, A Practical Guide to Splines (1978), ch. X: a spline is a polynomial between its knots.

use super::banded::Banded;
use super::spline::{Grid, ORDER, Place};

/// Powers of the product of two splines.
const POWERS: usize = 2 * ORDER - 1;
/// Room for them in rows of whole registers; the last is not used.
const ROW: usize = POWERS + 1;
/// Pairs of splines that act at a point.
const PAIRS: usize = ORDER * (ORDER + 1) / 2;

/// The splines that act on an interval, by powers of the offset from its middle.
const POLYNOMIALS: [[f64; ORDER]; ORDER] = [
    [1.0 / 48.0, -0.125, 0.25, -1.0 / 6.0],
    [23.0 / 48.0, -0.625, -0.25, 0.5],
    [23.0 / 48.0, 0.625, -0.25, -0.5],
    [1.0 / 48.0, 0.125, 0.25, 1.0 / 6.0],
];

/// Where a point lies along one axis, and the powers of its offset from the interval's middle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Powers {
    first: usize,
    of: [f64; ROW],
}

impl Powers {
    pub(crate) fn new(place: Place) -> Self {
        let u = place.part - 0.5;
        let mut of = [1.0; ROW];
        for p in 1..ROW {
            of[p] = of[p - 1] * u;
        }
        Self {
            first: place.first,
            of,
        }
    }
}

/// Sums of powers on one interval of either axis.
#[derive(Clone, Copy, Debug)]
struct Interval {
    squares: [[f64; ROW]; POWERS],
    values: [[f64; ORDER]; ORDER],
}

const NOTHING: Interval = Interval {
    squares: [[0.0; ROW]; POWERS],
    values: [[0.0; ORDER]; ORDER],
};

/// Sums over points: of the products of splines, and of splines times a value.
#[derive(Debug)]
pub(crate) struct SplineSums {
    side: usize,
    /// Intervals along each axis.
    across: usize,
    intervals: Vec<Interval>,
}

impl SplineSums {
    /// Sums over no point of `grid`.
    pub(crate) fn new(grid: &Grid) -> Self {
        let across = grid.side + 1 - ORDER;
        Self {
            side: grid.side,
            across,
            intervals: vec![NOTHING; across * across],
        }
    }

    /// Adds a point: `v` times the products of its splines, `m` times these.
    pub(crate) fn add(&mut self, x: &Powers, y: &Powers, v: f64, m: f64) {
        let interval = &mut self.intervals[x.first * self.across + y.first];
        for (row, p) in interval.squares.iter_mut().zip(&x.of) {
            let v = v * p;
            for (sum, q) in row.iter_mut().zip(&y.of) {
                *sum += v * q;
            }
        }
        for (row, p) in interval.values.iter_mut().zip(&x.of) {
            let m = m * p;
            for (sum, q) in row.iter_mut().zip(&y.of) {
                *sum += m * q;
            }
        }
    }

    /// A and c.
    pub(crate) fn products(&self) -> (Banded, Vec<f64>) {
        let n = self.side;
        let last = ORDER - 1;
        let mut band = Banded::zeros(n * n, n * last + last);
        let mut moment = vec![0.0; n * n];
        let pairs = pairs();
        for (k, interval) in self.intervals.iter().enumerate() {
            // nothing was added
            if interval.squares[0][0] == 0.0 && interval.values[0][0] == 0.0 {
                continue;
            }
            let (x, y) = (k / self.across, k % self.across);
            for (a, of_x) in POLYNOMIALS.iter().enumerate() {
                for (b, of_y) in POLYNOMIALS.iter().enumerate() {
                    moment[(x + a) * n + y + b] += of_x
                        .iter()
                        .zip(&interval.values)
                        .map(|(p, row)| p * along(of_y, row))
                        .sum::<f64>();
                }
            }
            for &(a, c, ref of_x) in &pairs {
                let mut row = [0.0; ROW];
                for (p, squares) in of_x.iter().zip(&interval.squares) {
                    for (sum, q) in row.iter_mut().zip(squares) {
                        *sum += p * q;
                    }
                }
                for &(b, d, ref of_y) in &pairs {
                    let value = along(of_y, &row);
                    *band.at((x + a) * n + y + b, (c - a) * n + d - b) += value;
                    // the same of (a, d), (c, b): another entry above the diagonal, unless a = c
                    if a != c && b != d {
                        *band.at((x + a) * n + y + d, (c - a) * n + b - d) += value;
                    }
                }
            }
        }
        (band, moment)
    }
}

/// A polynomial whose powers have the sums `powers`.
fn along(of: &[f64], powers: &[f64]) -> f64 {
    of.iter().zip(powers).map(|(of, power)| of * power).sum()
}

/// Every two splines that act on an interval, the lower first, and the powers of their product.
fn pairs() -> [(usize, usize, [f64; POWERS]); PAIRS] {
    let mut pairs = [(0, 0, [0.0; POWERS]); PAIRS];
    let both = (0..ORDER).flat_map(|a| (a..ORDER).map(move |c| (a, c)));
    for (pair, (a, c)) in pairs.iter_mut().zip(both) {
        (pair.0, pair.1) = (a, c);
        for (i, p) in POLYNOMIALS[a].iter().enumerate() {
            for (k, q) in POLYNOMIALS[c].iter().enumerate() {
                pair.2[i + k] += p * q;
            }
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the products of the splines themselves, point by point; also beyond the edge, where the edge's hold.
    /// Sums of 600 terms below 1 agree to some hundred roundings.
    #[test]
    fn sums_are_those_of_the_splines() {
        let grid = Grid::new(1.7, 0.6);
        let n = grid.side;
        let mut sums = SplineSums::new(&grid);
        let mut dense = vec![0.0; grid.len() * grid.len()];
        let mut values = vec![0.0; grid.len()];
        for i in 0..600 {
            let [dx, dy] = [0.7301, 1.117].map(|f| 1.9 * (f * f64::from(i)).sin());
            let (v, m) = (0.5 + 0.4 * f64::from(i).cos(), (0.3 * f64::from(i)).sin());
            let [x, y] = [dx, dy].map(|d| Powers::new(grid.place(d)));
            sums.add(&x, &y, v, m);
            let (x, y) = (grid.taps(dx), grid.taps(dy));
            let mut acts = vec![0.0; grid.len()];
            for a in 0..ORDER {
                for b in 0..ORDER {
                    acts[(x.first + a) * n + y.first + b] = x.value[a] * y.value[b];
                }
            }
            for (j, a) in acts.iter().enumerate() {
                values[j] += m * a;
                for (l, b) in acts.iter().enumerate() {
                    dense[j * grid.len() + l] += v * a * b;
                }
            }
        }
        let (mut band, moment) = sums.products();
        for j in 0..grid.len() {
            assert!((moment[j] - values[j]).abs() < 1e-13, "{j}");
            for l in j..grid.len() {
                let expected = dense[j * grid.len() + l];
                if l - j > band.width {
                    assert!(expected == 0.0, "{j} {l}");
                    continue;
                }
                let got = *band.at(j, l - j);
                assert!((got - expected).abs() < 1e-13, "{j} {l}: {got} {expected}");
            }
        }
    }
}
