//! Exact moments of monomials over the field.
//!
//! ```text
//! <x^k y^j> = 1/4 int_-1^1 int_-1^1 x^k y^j dx dy = m_j m_k,   m_n = 1/(n + 1) for even n, 0 for odd n
//! ```
//!
//! They replace the paper's "rectangular integration over a fine mesh": the polynomials integrate
//! in closed form, so mean and deviation carry no mesh error.
//!
//! Source: [M23] section 2.3, scaling of A and B; elementary integration.

/// Mean of `x^power_x y^power_y` over the normalised field, `[-1, 1]^2`.
///
/// ```
/// assert_eq!(distortion::monomial_moment(2, 4), 1.0 / 15.0);
/// assert_eq!(distortion::monomial_moment(3, 4), 0.0);
/// ```
pub fn monomial_moment(power_x: usize, power_y: usize) -> f64 {
    if power_x % 2 == 1 || power_y % 2 == 1 {
        return 0.0;
    }
    1.0 / ((power_x + 1) as f64 * (power_y + 1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Midpoint sums over a mesh of n x n cells, the paper's way: the error of the midpoint rule is
    /// at most h^2/24 times the length times the largest second derivative, here below
    /// 2 * (2/n)^2 / 24 * 30 * 29 for powers to 30 on each axis (means: half of it, two axes).
    #[test]
    fn moments_agree_with_a_fine_mesh() {
        let n = 2000_u32;
        let h = 2.0 / f64::from(n);
        let tolerance = 2.0 * h * h / 24.0 * 30.0 * 29.0;
        let axis_mean = |power: i32| {
            (0..n)
                .map(|i| (-1.0 + (f64::from(i) + 0.5) * h).powi(power))
                .sum::<f64>()
                / f64::from(n)
        };
        for k in 0..=30_u8 {
            for j in [0_u8, 1, 2, 15, 30] {
                let mesh = axis_mean(i32::from(k)) * axis_mean(i32::from(j));
                let exact = monomial_moment(usize::from(k), usize::from(j));
                assert!(
                    (mesh - exact).abs() < tolerance,
                    "x^{k} y^{j}: mesh {mesh}, exact {exact}"
                );
            }
        }
    }
}
