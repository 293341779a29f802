//! Symmetric positive definite band matrices.
//!
//! ```text
//! A = L D L^T,   L unit lower, |i - j| <= width
//! Z = A^-1 inside the band, from the last row up:   Z = D^-1 L^-1 + (I - L^T) Z
//! ```
//!
//! Source: Golub & Van Loan, Matrix Computations, 4th ed., 4.3.5 (band Cholesky);
//! Takahashi, Fagan & Chen 1973 for the part of the inverse inside the band.

/// Upper half of a symmetric band matrix: row i holds the columns i..=i+width.
#[derive(Clone, Debug)]
pub(crate) struct Banded {
    pub(crate) order: usize,
    pub(crate) width: usize,
    /// `order` rows of `width + 1`.
    pub(crate) entries: Vec<f64>,
}

/// L and D of a band matrix.
#[derive(Clone, Debug)]
pub(crate) struct Factor {
    width: usize,
    /// Row i holds `D_i`, then `L_ji` of the rows j = i+1..=i+width.
    entries: Vec<f64>,
}

impl Banded {
    pub(crate) fn zeros(order: usize, width: usize) -> Self {
        Self {
            order,
            width,
            entries: vec![0.0; order * (width + 1)],
        }
    }

    /// Entry of row `row` and column `row + offset`.
    pub(crate) fn at(&mut self, row: usize, offset: usize) -> &mut f64 {
        &mut self.entries[row * (self.width + 1) + offset]
    }

    pub(crate) fn trace(&self) -> f64 {
        self.entries.iter().step_by(self.width + 1).sum()
    }

    /// The matrix times `v`.
    pub(crate) fn times(&self, v: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; v.len()];
        for (i, row) in self.entries.chunks_exact(self.width + 1).enumerate() {
            let reach = self.width.min(self.order - 1 - i);
            let (here, below) = (v[i], &v[i + 1..=i + reach]);
            out[i] += row[0] * here + dot(&row[1..=reach], below);
            for (o, a) in out[i + 1..=i + reach].iter_mut().zip(&row[1..]) {
                *o += a * here;
            }
        }
        out
    }

    /// L D L^T; `None` if the matrix is not positive definite.
    pub(crate) fn factor(mut self) -> Option<Factor> {
        let stride = self.width + 1;
        let mut lower = vec![0.0; self.width];
        for i in 0..self.order {
            let reach = self.width.min(self.order - 1 - i);
            let (row, rest) = self.entries[i * stride..].split_at_mut(stride);
            let pivot = row[0];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            for k in 1..=reach {
                lower[k - 1] = row[k] / pivot;
            }
            for k in 1..=reach {
                let l = lower[k - 1];
                if l == 0.0 {
                    continue;
                }
                let target = &mut rest[(k - 1) * stride..(k - 1) * stride + reach + 1 - k];
                for (t, r) in target.iter_mut().zip(&row[k..=reach]) {
                    *t -= l * r;
                }
            }
            row[1..=reach].copy_from_slice(&lower[..reach]);
        }
        Some(Factor {
            width: self.width,
            entries: self.entries,
        })
    }
}

/// Sum of products, in lanes.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    let (mut x, mut y) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    for (x, y) in (&mut x).zip(&mut y) {
        for (s, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *s += x * y;
        }
    }
    let rest = x.remainder().iter().zip(y.remainder());
    sums.iter().sum::<f64>() + rest.map(|(x, y)| x * y).sum::<f64>()
}

impl Factor {
    fn order(&self) -> usize {
        self.entries.len() / (self.width + 1)
    }

    fn row(&self, i: usize) -> &[f64] {
        let reach = self.width.min(self.order() - 1 - i);
        &self.entries[i * (self.width + 1)..i * (self.width + 1) + reach + 1]
    }

    /// Solves A x = b in place.
    pub(crate) fn solve(&self, b: &mut [f64]) {
        for i in 0..self.order() {
            let row = self.row(i);
            let v = b[i];
            for (t, l) in b[i + 1..].iter_mut().zip(&row[1..]) {
                *t -= l * v;
            }
        }
        for i in (0..self.order()).rev() {
            let row = self.row(i);
            let tail = dot(&row[1..], &b[i + 1..i + row.len()]);
            b[i] = b[i] / row[0] - tail;
        }
    }

    /// `b^T A^-1 b`; overwrites `b`.
    pub(crate) fn quadratic(&self, b: &mut [f64]) -> f64 {
        let mut sum = 0.0;
        for i in 0..self.order() {
            let row = self.row(i);
            let v = b[i];
            sum += v * v / row[0];
            for (t, l) in b[i + 1..].iter_mut().zip(&row[1..]) {
                *t -= l * v;
            }
        }
        sum
    }

    /// The inverse inside the band.
    pub(crate) fn inverse_in_band(&self) -> Banded {
        let n = self.order();
        let stride = self.width + 1;
        let mut z = Banded::zeros(n, self.width);
        // row i of Z from the rows below it, all of them inside the band
        let mut sums = vec![0.0; stride];
        for i in (0..n).rev() {
            let row = self.row(i);
            let reach = row.len() - 1;
            sums.fill(0.0);
            for k in 1..=reach {
                let l = row[k];
                if l == 0.0 {
                    continue;
                }
                let known = &z.entries[(i + k) * stride..(i + k) * stride + reach + 1 - k];
                // Z_(i+k)(i+j) for j >= k, and by symmetry what row i+k owes to row i+j
                for (s, v) in sums[k..=reach].iter_mut().zip(known) {
                    *s += l * v;
                }
                sums[k] += dot(&row[k + 1..=reach], &known[1..]);
            }
            let mut diagonal = 1.0 / row[0];
            for k in 1..=reach {
                z.entries[i * stride + k] = -sums[k];
                diagonal += row[k] * sums[k];
            }
            z.entries[i * stride] = diagonal;
        }
        z
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    /// Condition about 10: both ways agree to a few hundred roundings.
    #[test]
    fn agrees_with_dense_algebra() {
        let (n, width) = (23, 5);
        let mut band = Banded::zeros(n, width);
        let mut dense = DMatrix::zeros(n, n);
        for i in 0..n {
            for k in 0..=width.min(n - 1 - i) {
                let v = if k == 0 {
                    6.0 + i as f64 * 0.1
                } else {
                    ((i * 7 + k * 3) as f64).sin()
                };
                *band.at(i, k) = v;
                dense[(i, i + k)] = v;
                dense[(i + k, i)] = v;
            }
        }
        assert!((band.trace() - dense.trace()).abs() < 1e-12);
        let inverse = dense.clone().try_inverse().unwrap();
        let whole = band.clone();
        let times = |v: &[f64]| whole.times(v);
        let factor = band.factor().unwrap();
        let mut x: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
        let b = nalgebra::DVector::from_vec(x.clone());
        let quadratic = factor.quadratic(&mut x.clone());
        let product = times(&x);
        let expected = &dense * &b;
        assert!((0..n).all(|i| (product[i] - expected[i]).abs() < 1e-13));
        factor.solve(&mut x);
        let expected = &inverse * &b;
        assert!((quadratic - b.dot(&expected)).abs() < 1e-13);
        for i in 0..n {
            assert!((x[i] - expected[i]).abs() < 1e-13);
        }
        let mut z = factor.inverse_in_band();
        for i in 0..n {
            for k in 0..=width.min(n - 1 - i) {
                assert!((*z.at(i, k) - inverse[(i, i + k)]).abs() < 1e-13, "{i} {k}");
            }
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_is_refused() {
        let mut band = Banded::zeros(2, 1);
        *band.at(0, 0) = 1.0;
        *band.at(0, 1) = 2.0;
        *band.at(1, 0) = 1.0;
        assert!(band.factor().is_none());
    }
}
