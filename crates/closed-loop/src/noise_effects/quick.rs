//! What of the residuals changes from frame to frame: what is slow is no noise.
//!
//! ```text
//! d_k = sqrt(2/3) (r_k - (r_k-1 + r_k+1)/2)        var d_k = (2/3) v_k + (v_k-1 + v_k+1)/6
//! ```
//!
//! The variance is that of one row where it is the same in all three. In a raster that moves and
//! stands by turns it is not: with the row's own rate a noise of the rate was told a third too small, and refused
//! for that.
//!
//! Source: second differences (von Neumann 1941).

use rayon::prelude::*;

use crate::star::data::StarData;

/// What a row counts with in the square of its difference, and each neighbour.
pub(super) const OWN: f64 = 2.0 / 3.0;
pub(super) const NEIGHBOUR: f64 = 1.0 / 6.0;

/// Each row of a star less the mean of its neighbours, at the same white noise.
pub(super) struct Quick {
    /// Unknown where a neighbour is missing.
    pub(super) residual: Vec<Vec<f64>>,
    /// What goes with the variance of a row, as it goes with that of the difference.
    pub(super) squares: [Vec<f64>; 2],
}

impl Quick {
    pub(super) fn of(data: &StarData, residual: &[Vec<f64>], squares: [&[f64]; 2]) -> Self {
        let mut of_star = vec![Vec::new(); data.stars.len()];
        for r in (0..data.t_s.len()).filter(|&r| !data.outlier[r]) {
            of_star[data.star[r]].push(r);
        }
        let each =
            |values: &[f64], own: f64, neighbour: f64| mixed(&of_star, values, own, neighbour);
        let (own, neighbour) = (OWN.sqrt(), -NEIGHBOUR.sqrt());
        let residuals = residual.par_iter();
        let residuals = residuals.map(|values| each(values, own, neighbour));
        Self {
            residual: residuals.collect(),
            squares: squares.map(|values| each(values, OWN, NEIGHBOUR)),
        }
    }
}

/// `own` of the value in the middle and `neighbour` of the ones before and after it.
pub(super) fn of_three(
    values: &[f64],
    [before, at, after]: [usize; 3],
    own: f64,
    neighbour: f64,
) -> f64 {
    own * values[at] + neighbour * (values[before] + values[after])
}

/// `own` of every value and `neighbour` of the ones before and after it among the rows of its star; NaN where one is
/// missing.
fn mixed(of_star: &[Vec<usize>], values: &[f64], own: f64, neighbour: f64) -> Vec<f64> {
    let mut out = vec![f64::NAN; values.len()];
    for w in of_star.iter().flat_map(|rows| rows.windows(3)) {
        out[w[1]] = of_three(values, [w[0], w[1], w[2]], own, neighbour);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Two stars by turns, whose noise is 1 and 3 from row to row. The mean square of n differences over the variance
    /// that is said of each scatters by sqrt(2 (1 + 2 (2/3)^2 + 2/36) / n) = 0.020 of n = 10 000 (neighbours share two
    /// of three rows, the next but one a single one). With a row's own variance it would be
    /// (2/3 + 1/3 9 + 2/3 + 1/3 / 9) / 2 = 2.2.
    #[test]
    fn squares_say_what_the_differences_scatter_by() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
        let of_star: Vec<Vec<usize>> = (0..2).map(|s| (s..10_000).step_by(2).collect()).collect();
        let variance: Vec<f64> = (0..10_000).map(|r| [1.0, 9.0][r / 2 % 2]).collect();
        let noise: Vec<f64> = variance
            .iter()
            .map(|v| {
                let z: f64 = StandardNormal.sample(&mut rng);
                z * v.sqrt()
            })
            .collect();
        let difference = mixed(&of_star, &noise, OWN.sqrt(), -NEIGHBOUR.sqrt());
        let said = mixed(&of_star, &variance, OWN, NEIGHBOUR);
        // an end of a star has no difference
        assert!(difference[0].is_nan() && said[1].is_nan() && difference[9_999].is_nan());
        let ratio = |said: &[f64]| {
            let each = difference.iter().zip(said).filter(|(d, _)| d.is_finite());
            let (sum, count) = each.fold((0.0, 0.0), |(s, n), (d, v)| (s + d * d / v, n + 1.0));
            sum / count
        };
        assert!((ratio(&said) - 1.0).abs() < 5.0 * 0.020, "{}", ratio(&said));
        assert!(ratio(&variance) > 1.9, "{}", ratio(&variance));
    }
}
