//! From monomials to Legendre polynomials and back.
//!
//! ```text
//! x P_l = ((l + 1) P_(l+1) + l P_(l-1)) / (2l + 1),     <P_l P_m> = delta_lm / (2l + 1)
//! ```
//!
//! In this basis the mean of a field is its first coefficient and its mean square a sum of
//! squares, which cannot come out negative; a fit in it is well conditioned where one in monomials
//! would lose ten digits at the highest order.
//!
//! Source: NIST Digital Library of Mathematical Functions, 18.9.1 and Table 18.3.1.

use crate::MAX_ORDER;

const WIDTH: usize = MAX_ORDER + 1;

/// Square matrix of basis changes, row by row.
pub(crate) type Table = [[f64; WIDTH]; WIDTH];

/// `table[n][l]`: the share of `P_l` in `x^n`. All entries are positive or zero, each row sums to 1.
pub(crate) fn from_monomials() -> Table {
    let mut table = [[0.0; WIDTH]; WIDTH];
    table[0][0] = 1.0;
    for n in 1..WIDTH {
        for l in 0..n {
            let share = table[n - 1][l] / (2 * l + 1) as f64;
            table[n][l + 1] += share * (l + 1) as f64;
            if l > 0 {
                table[n][l - 1] += share * l as f64;
            }
        }
    }
    table
}

/// `table[l][n]`: the coefficient of `x^n` in `P_l`.
pub(crate) fn to_monomials() -> Table {
    let mut table = [[0.0; WIDTH]; WIDTH];
    table[0][0] = 1.0;
    table[1][1] = 1.0;
    for l in 1..WIDTH - 1 {
        for n in 0..WIDTH {
            let raised = if n > 0 { table[l][n - 1] } else { 0.0 };
            table[l + 1][n] =
                ((2 * l + 1) as f64 * raised - l as f64 * table[l - 1][n]) / (l + 1) as f64;
        }
    }
    table
}

/// `sqrt(2l + 1) P_l(x)` for all `l < out.len()`: orthonormal under the mean over [-1, 1].
pub(crate) fn orthonormal_into(x: f64, out: &mut [f64]) {
    let (mut before, mut now) = (0.0, 1.0);
    for (l, value) in out.iter_mut().enumerate() {
        *value = now * ((2 * l + 1) as f64).sqrt();
        let next = ((2 * l + 1) as f64 * x * now - l as f64 * before) / (l + 1) as f64;
        (before, now) = (now, next);
    }
}

/// Changes the basis of a two-dimensional coefficient matrix: `T^T A T`, both row by row.
pub(crate) fn change_basis(coefficients: &[f64], order: usize, table: &Table) -> Vec<f64> {
    let width = order + 1;
    let mut half = vec![0.0; width * width];
    for row in 0..width {
        for to in 0..width {
            half[row * width + to] = (0..width)
                .map(|column| coefficients[row * width + column] * table[column][to])
                .sum();
        }
    }
    let mut changed = vec![0.0; width * width];
    for to in 0..width {
        for column in 0..width {
            changed[to * width + column] = (0..width)
                .map(|row| table[row][to] * half[row * width + column])
                .sum();
        }
    }
    changed
}

#[cfg(test)]
mod tests {
    use super::*;

    /// There and back is the identity. The way back has coefficients up to 1e5 (order 15), so the
    /// rounding grows to about 1e5 * 1e-16.
    #[test]
    fn tables_are_inverse() {
        let (there, back) = (from_monomials(), to_monomials());
        for n in 0..WIDTH {
            for m in 0..WIDTH {
                let product: f64 = (0..WIDTH).map(|l| there[n][l] * back[l][m]).sum();
                let identity = if n == m { 1.0 } else { 0.0 };
                assert!((product - identity).abs() < 1e-10, "{n} {m}: {product}");
            }
        }
    }

    /// `P_l(1) = 1`, so each row of shares sums to 1; `P_3` is known by heart.
    #[test]
    fn known_values() {
        for row in from_monomials() {
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        }
        assert_eq!(to_monomials()[3][..4], [0.0, -1.5, 0.0, 2.5]);
        let mut p = [0.0; 4];
        orthonormal_into(0.5, &mut p);
        assert!((p[3] / 7_f64.sqrt() - (2.5 * 0.125 - 1.5 * 0.5)).abs() < 1e-15);
    }
}
