//! Gauss-Legendre nodes and weights on [-1, 1].
//!
//! ```text
//! int_-1^1 g(u) du  ~  sum_k w_k g(u_k)        exact for polynomials up to degree 15
//! ```
//!
//! Source: Abramowitz & Stegun (1964), Table 25.4, n = 8.

/// Nodes and weights of the eight-point rule of Gauss and Legendre on [-1, 1]: exact to degree 15.
///
/// Source: Abramowitz & Stegun (1964), Table 25.4.
pub const GAUSS_LEGENDRE_8: [(f64, f64); 8] = [
    (-0.960_289_856_497_536_2, 0.101_228_536_290_376_26),
    (-0.796_666_477_413_626_7, 0.222_381_034_453_374_47),
    (-0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (-0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_47),
    (0.960_289_856_497_536_2, 0.101_228_536_290_376_26),
];

#[cfg(test)]
mod tests {
    use super::GAUSS_LEGENDRE_8;

    /// The rule is exact for every monomial up to degree 15; rounding of eight terms stays below 1e-15.
    #[test]
    fn monomials_up_to_degree_fifteen_are_exact() {
        for degree in 0..16_i32 {
            let got: f64 = GAUSS_LEGENDRE_8
                .iter()
                .map(|(u, w)| w * u.powi(degree))
                .sum();
            let exact = if degree % 2 == 0 {
                2.0 / f64::from(degree + 1)
            } else {
                0.0
            };
            assert!(
                (got - exact).abs() < 1e-15,
                "degree {degree}: {got} against {exact}"
            );
        }
    }
}
