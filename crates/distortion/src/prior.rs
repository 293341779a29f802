//! What is known of the coefficients before the field is seen.
//!
//! A draw `g ~ N(0, I)` is brought to its size, `c = g sigma / sqrt(g' M g)`, with M the covariance of the
//! monomials over the field: the coefficients are no Gaussians of one spread. In the eigenmodes of M, of
//! eigenvalue l and share f = l / tr M of the expected square,
//!
//! ```text
//! <c^2>  = sigma^2 int_0^inf prod_m (1 + 2 s l_m)^(-1/2) / (1 + 2 s l) ds
//! P(c^2 > t^2 sigma^2 / tr M) = P(F(1, v) > t^2 (1 - f) / (1 - t^2 f)),   v/(v - 2) = <tr M / g' M g>
//! ```
//!
//! A mode that holds much of the field is bounded, c^2 < sigma^2 / l: where one coefficient is large, the
//! scale is small. A mode that holds little follows the scale, which differs from draw to draw by 0.58 to
//! 2.2 times (order 7, 1 to 99 %). The second line takes the square of the other modes for a chi-squared, with
//! the v that gives the mean inverse of all. The Gaussian that stands for a mode is the widest of those with its mean square and with
//! its 99.99 % point, so that tails are covered where effects are judged, which pay for all that were tried: 0.9 to
//! 1.1 of the spread over all draws in the modes that matter, 2 in those that hold nothing.
//!
//! Source: [M23] section 2.3; mean of a ratio of quadratic forms: Sawa 1972.

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::moments::monomial_moment;

/// Chance that a coefficient is beyond the point at which the Gaussian is as wide.
const TAIL: f64 = 1e-4;
/// The square of a standard normal is beyond this with that chance.
const TAIL_OF_GAUSSIAN: f64 = 15.136_705_226_623_396;
/// Step, first and last point of the integral over ln(s tr M); by the trapezium, which converges
/// exponentially. With three modes, the fewest, the last point leaves 1e-7.
const STEP: f64 = 0.1;
const POINTS: (i32, i32) = (-230, 320);

/// Prior precision of the coefficients of a [drawn](crate::DistortionField::draw) field with a deviation of 1
/// an axis: one axis, in the order of [`basis_into`](crate::DistortionField::basis_into) without the constant.
///
/// For a deviation of `sigma` arcsec it is this over `sigma^2`, 1/arcsec^2; the axes are independent. Order 0 has
/// no coefficients.
///
/// ```
/// let precision = distortion::coefficient_precision(7);
/// assert_eq!(precision.shape(), (63, 63));
/// ```
pub fn coefficient_precision(order: usize) -> DMatrix<f64> {
    let powers: Vec<(usize, usize)> = (0..=order)
        .flat_map(|k| (0..=order).map(move |j| (j, k)))
        .skip(1)
        .collect();
    let covariance = DMatrix::from_fn(powers.len(), powers.len(), |a, b| {
        let ((j, k), (l, m)) = (powers[a], powers[b]);
        monomial_moment(j + l, k + m) - monomial_moment(j, k) * monomial_moment(l, m)
    });
    if powers.is_empty() {
        return covariance;
    }
    let modes = covariance.symmetric_eigen();
    let share = modes.eigenvalues.map(|l| l.max(0.0));
    let total = share.sum();
    let variance = variances((share / total).as_slice());
    let mut scaled = modes.eigenvectors.clone();
    for (mut mode, v) in scaled.column_iter_mut().zip(&variance) {
        mode.scale_mut(total / v);
    }
    scaled * modes.eigenvectors.transpose()
}

/// Variance of the coefficient of each mode, which holds this share of the field, over that of all draws.
fn variances(share: &[f64]) -> Vec<f64> {
    let (squares, inverse) = mean_squares(share);
    let freedom = 2.0 * inverse / (inverse - 1.0);
    let tail = FisherSnedecor::new(1.0, freedom)
        .map_or(TAIL_OF_GAUSSIAN, |law| law.inverse_cdf(1.0 - TAIL));
    let widest = |(square, f): (f64, &f64)| {
        let point = tail / (1.0 - f + tail * f);
        square.max(point / TAIL_OF_GAUSSIAN)
    };
    squares.into_iter().zip(share).map(widest).collect()
}

/// Mean square of the coefficient of each mode over that of all draws, and the mean of `tr M / g' M g`.
fn mean_squares(share: &[f64]) -> (Vec<f64>, f64) {
    let mut squares = vec![0.0; share.len()];
    let mut inverse = 0.0;
    for point in POINTS.0..=POINTS.1 {
        let s = (STEP * f64::from(point)).exp();
        let log: f64 = share.iter().map(|f| (2.0 * s * f).ln_1p()).sum();
        let term = STEP * s * (-0.5 * log).exp();
        inverse += term;
        for (square, f) in squares.iter_mut().zip(share) {
            *square += term / (1.0 + 2.0 * s * f);
        }
    }
    (squares, inverse)
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use nalgebra::DVector;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    use super::*;
    use crate::{DistortionField, LsfSigma};
    use focal_plane::Angle;

    /// Whatever the scale of a draw, its modes make up a field of one size: `sum f c^2 = 1`. Where all shares are
    /// equal each has a mean square of 1, and the mean inverse of a chi-squared of n over n is n/(n - 2).
    #[test]
    fn mean_squares_add_up_to_the_field() {
        for share in [
            vec![0.4, 0.4, 0.2],
            vec![0.7, 0.1, 0.1, 0.1],
            vec![0.25; 4],
            vec![0.025; 40],
        ] {
            let n = share.len() as f64;
            let (squares, inverse) = mean_squares(&share);
            let sum: f64 = squares.iter().zip(&share).map(|(c, f)| c * f).sum();
            assert_relative_eq!(sum, 1.0, epsilon = 1e-6);
            if (share[0] - share[share.len() - 1]).abs() < 1e-9 {
                assert_relative_eq!(squares[0], 1.0, epsilon = 1e-6);
                assert_relative_eq!(inverse, n / (n - 2.0), epsilon = 1e-6);
            }
        }
    }

    /// In every order the coefficients have a covariance, positive and finite, and no mode a variance below half of
    /// that over all draws: a prior is never the tighter for what is known of a draw's size.
    #[test]
    fn every_order_has_a_prior() {
        for order in 1..=crate::MAX_ORDER {
            let precision = coefficient_precision(order);
            let values = precision.symmetric_eigenvalues();
            let total: f64 = (0..precision.nrows())
                .map(|k| {
                    let (j, l) = ((k + 1) % (order + 1), (k + 1) / (order + 1));
                    monomial_moment(2 * j, 2 * l) - monomial_moment(j, l).powi(2)
                })
                .sum();
            assert!(
                values
                    .iter()
                    .all(|v| v.is_finite() && *v > 0.0 && *v < 2.0 * total),
                "{order}: {values}"
            );
        }
    }

    /// Draws in units of their prior: a number that a Gaussian of that prior would have with a deviation of 1, for the
    /// coefficients that a scale error, a line that is exposed later, a radial distortion, a decentring and the
    /// finest term of all resemble. 20 000 draws of two axes.
    #[test]
    fn draws_keep_within_their_prior() {
        let order = 7;
        let precision = coefficient_precision(order);
        let at = |j: usize, k: usize| j + k * (order + 1) - 1;
        let along: Vec<DVector<f64>> = [
            vec![(1, 0, 1.0)],
            vec![(0, 1, 1.0)],
            vec![(3, 0, 1.0), (1, 2, 1.0)],
            vec![(2, 0, 3.0), (0, 2, 1.0)],
            vec![(7, 7, 1.0)],
        ]
        .into_iter()
        .map(|terms| {
            let mut d = DVector::zeros(precision.nrows());
            for (j, k, value) in terms {
                d[at(j, k)] = value;
            }
            let column = &precision * &d;
            let length = d.dot(&column).sqrt();
            column / length
        })
        .collect();
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(20);
        let draws = 20_000;
        let mut square = vec![0.0; along.len()];
        let mut beyond = vec![0; along.len()];
        for _ in 0..draws {
            let sigma = LsfSigma::PerAxis(Angle::from_arcsec(1.0));
            let field = DistortionField::draw(order, sigma, &mut rng).unwrap();
            for coefficients in [field.a(), field.b()] {
                let c = DVector::from_column_slice(&coefficients[1..]);
                for (k, column) in along.iter().enumerate() {
                    let z = column.dot(&c);
                    square[k] += z * z;
                    beyond[k] += usize::from(z * z > TAIL_OF_GAUSSIAN);
                }
            }
        }
        for k in 0..along.len() {
            let n = 2.0 * f64::from(draws);
            // at most 1 and 5 sigma of a mean square of 40 000, 5 sqrt(2/n) / 2 = 0.018; a prior 2.2 times as wide
            // as the spread over all draws has 0.48 to 0.53
            let rms = (square[k] / n).sqrt();
            let least = [0.9, 0.9, 0.7, 0.7, 0.55][k];
            assert!((least..1.02).contains(&rms), "{k}: {rms}");
            // 4 are expected at 0.01 %, at most 4 + 4 sqrt(4) = 12 seen
            assert!(beyond[k] <= 12, "{k}: {} beyond", beyond[k]);
        }
    }
}
