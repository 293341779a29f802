//! Errata E3 and E4: what is printed in [M23], what is right, and a test that tells them apart.

use nalgebra::{Matrix3, Vector3};
use quest::{QuestError, covariance, covariance_as_printed, quest};

use crate::cases::{ARCSEC, Draw};

/// E3: Eq. 12 has `w = C v`, Eq. 13 `v = C w`. On exact data one of them leaves no residual.
#[test]
fn attitude_turns_catalogue_into_measured() -> Result<(), QuestError> {
    let mut draw = Draw::new(12);
    for _ in 0..100 {
        let truth = draw.attitude();
        let v: Vec<_> = (0..5).map(|_| draw.normals().normalize()).collect();
        let w: Vec<_> = v.iter().map(|v| truth * v).collect();
        let got = quest(&w, &v, &[1.0; 5])?;
        let bound = 40.0 * f64::EPSILON / (got.gap * got.gap);
        let (mut eq_12, mut eq_13) = (0.0_f64, 0.0_f64);
        for (w, v) in w.iter().zip(&v) {
            eq_12 = eq_12.max((w - got.q * v).norm());
            eq_13 = eq_13.max((v - got.q * w).norm());
        }
        assert!(eq_12 < bound, "{eq_12:e} > {bound:e}");
        // reversed, the residual is that of the attitude applied twice
        assert!(eq_13 > 0.1 * (2.0 * truth.angle()).sin().abs(), "{eq_13}");
    }
    Ok(())
}

/// E4 by Monte Carlo, 14 stars in 20 degrees, unequal sigmas: theta is turned by `P^-1/2`, so its
/// sample covariance over n runs is the identity with standard error `sqrt(2/n)` on the diagonal
/// and `1/sqrt(n)` beside it. P is first order in sigma; the next, of relative size
/// `sigma^2/gap < 1e-6`, is far below.
fn whitened(seed: u64, runs: u32) -> Result<(Matrix3<f64>, f64), QuestError> {
    let mut draw = Draw::new(seed);
    let truth = draw.attitude();
    let ideal: Vec<_> = (0..14).map(|_| draw.in_field(20.0)).collect();
    let v: Vec<_> = ideal.iter().map(|w| truth.inverse() * w).collect();
    let sigma: Vec<_> = (0..14)
        .map(|_| (5.0 + 10.0 * draw.uniform()) * ARCSEC)
        .collect();
    let weights: Vec<_> = sigma.iter().map(|s| 1.0 / (s * s)).collect();
    let p = covariance(&ideal, &sigma)?;
    let root = p.cholesky().expect("a covariance is positive definite").l();
    let (mut sum, mut loss) = (Matrix3::zeros(), 0.0);
    for _ in 0..runs {
        let w: Vec<_> = ideal
            .iter()
            .zip(&sigma)
            .map(|(w, s)| draw.disturbed(w, *s))
            .collect();
        let got = quest(&w, &v, &weights)?;
        // the solution's own P is taken at measured directions: the same to sigma/field
        assert!((got.covariance - p).norm() < 1e-2 * p.norm());
        loss += got.loss;
        let theta: Vector3<f64> = (got.q * truth.inverse()).scaled_axis();
        let white = root.solve_lower_triangular(&theta).expect("not singular");
        sum += white * white.transpose();
    }
    Ok((sum / f64::from(runs), loss / f64::from(runs)))
}

#[test]
fn covariance_is_that_of_a_monte_carlo() -> Result<(), QuestError> {
    let runs = 20_000;
    let (got, loss) = whitened(4, runs)?;
    let n = f64::from(runs);
    for i in 0..3 {
        for j in 0..=i {
            let (want, error) = if i == j {
                (1.0, (2.0 / n).sqrt())
            } else {
                (0.0, n.sqrt().recip())
            };
            assert!(
                (got[(i, j)] - want).abs() < 5.0 * error,
                "{i}{j}: {}",
                got[(i, j)]
            );
        }
    }
    // chi-squared of 2 M - 3 = 25 degrees: mean 25, standard deviation sqrt(50)
    assert!((loss - 25.0).abs() < 5.0 * (50.0 / n).sqrt(), "loss {loss}");
    Ok(())
}

/// E4 as printed: no covariance at all. With sigma far below 1 rad the identity is nothing beside
/// the sum, and the cross-axis variances come out negative.
#[test]
fn printed_covariance_is_negative() -> Result<(), QuestError> {
    let mut draw = Draw::new(5);
    let w: Vec<_> = (0..14).map(|_| draw.in_field(20.0)).collect();
    let printed = covariance_as_printed(&w, &[10.0 * ARCSEC; 14])?;
    assert!(printed.symmetric_eigenvalues().max() < 0.0, "{printed}");
    let right = covariance(&w, &[10.0 * ARCSEC; 14])?;
    assert!(right.symmetric_eigenvalues().min() > 0.0, "{right}");
    // erratum E5 by the way: cross-axis sigma is sigma_star/sqrt(M), 1.00 to 1.04 with real geometry
    let cross = (right[(0, 0)] * 14.0).sqrt() / (10.0 * ARCSEC);
    assert!((1.0..1.1).contains(&cross), "{cross}");
    Ok(())
}
