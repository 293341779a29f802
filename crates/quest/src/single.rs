//! One frame: checked input, attitude, covariance.
//!
//! ```text
//! L(C) = sum s_i^-2 |w_i - C v_i|^2  ->  min
//! ```
//!
//! with `C` inertial to tracker, w measured and v from the catalogue.
//!
//! Source: \[M23\] Eq. 12-14. Eq. 13 as printed has the two sets the other way round (erratum E3);
//! the square in Eq. 12 belongs on the norm (erratum E16).

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::covariance::{information, of_information};
use crate::error::QuestError;
use crate::gap_limits::MIN_GAP;
use crate::polish::least_eigenvalue;
use crate::profile::Profile;
use crate::unit_vectors::{check, inverse_length};

/// What [`quest`] returns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Attitude, inertial to tracker: `v_tracker = q * v_inertial`; scalar part not negative.
    pub q: UnitQuaternion<f64>,
    /// Covariance of the attitude error in tracker axes, \[M23\] Eq. 14 with erratum E4; rad^2 if the
    /// weights are `1/sigma_i^2` with sigma in rad per axis.
    pub covariance: Matrix3<f64>,
    /// \[M23\] Eq. 12, from the residuals. With weights `1/sigma_i^2` of M stars it is distributed as
    /// chi-squared of `2 M - 3` degrees of freedom.
    pub loss: f64,
    /// Largest eigenvalue of Davenport's matrix at unit total weight, `1 - loss/(2 sum weights)`.
    pub lambda: f64,
    /// Its distance from the second largest; see the crate's page for what it decides.
    pub gap: f64,
    /// Newton steps and polishing steps taken.
    pub iterations: u32,
}

/// The attitude that turns `reference` (inertial) into `measured` (tracker), least squares with
/// `weights` (`1/sigma_i^2`; only their ratios matter for the attitude).
///
/// # Errors
///
/// [`QuestError`] for slices of different lengths, fewer than two stars, a component that is not
/// finite, a length more than [`UNIT_TOLERANCE`](crate::UNIT_TOLERANCE) from 1, a weight that is not
/// finite and positive, a set of parallel or antiparallel vectors, or a gap below [`MIN_GAP`].
///
/// ```
/// use nalgebra::Vector3;
/// // the tracker sees the sky turned by 90 degrees about the boresight
/// let sky = [Vector3::z(), Vector3::new(0.6, 0.0, 0.8)];
/// let seen = [Vector3::z(), Vector3::new(0.0, 0.6, 0.8)];
/// let solution = quest::quest(&seen, &sky, &[1.0, 1.0])?;
/// assert!((solution.q.angle().to_degrees() - 90.0).abs() < 1e-12);
/// # Ok::<(), quest::QuestError>(())
/// ```
pub fn quest(
    measured: &[Vector3<f64>],
    reference: &[Vector3<f64>],
    weights: &[f64],
) -> Result<Solution, QuestError> {
    let total = checked(measured, reference, weights)?;
    let profile = profile(measured, reference, weights, total);
    let attitude = profile
        .solve()
        .map_err(|error| named(error, measured, reference, weights, total))?;
    let covariance = of_information(&information(measured, weights, total), total).ok_or(
        QuestError::Degenerate {
            gap: attitude.gap,
            limit: MIN_GAP,
        },
    )?;
    let matrix = attitude.q.to_rotation_matrix();
    let residual = |w: &Vector3<f64>, v: &Vector3<f64>| {
        (w * inverse_length(w) - matrix * v * inverse_length(v)).norm_squared()
    };
    let pairs = measured.iter().zip(reference).zip(weights);
    let loss = pairs.map(|((w, v), a)| a * residual(w, v)).sum();
    Ok(Solution {
        q: attitude.q,
        covariance,
        loss,
        lambda: attitude.lambda,
        gap: attitude.gap,
        iterations: attitude.iterations,
    })
}

fn checked(
    measured: &[Vector3<f64>],
    reference: &[Vector3<f64>],
    weights: &[f64],
) -> Result<f64, QuestError> {
    if measured.len() != reference.len() || measured.len() != weights.len() {
        return Err(QuestError::LengthMismatch {
            measured: measured.len(),
            reference: reference.len(),
            weights: weights.len(),
        });
    }
    if measured.len() < 2 {
        return Err(QuestError::TooFewStars {
            got: measured.len(),
        });
    }
    check("measured", measured)?;
    check("reference", reference)?;
    let bad = |x: f64| !(x.is_finite() && x > 0.0);
    if let Some(index) = weights.iter().position(|&a| bad(a)) {
        return Err(QuestError::NotPositive {
            name: "weight",
            index,
            value: weights[index],
        });
    }
    let total: f64 = weights.iter().sum();
    // its reciprocal must exist too
    if bad(total) || !total.recip().is_normal() {
        return Err(QuestError::NotPositive {
            name: "total weight",
            index: weights.len(),
            value: total,
        });
    }
    Ok(total)
}

fn profile(
    measured: &[Vector3<f64>],
    reference: &[Vector3<f64>],
    weights: &[f64],
    total: f64,
) -> Profile {
    let scale = 1.0 / total;
    let mut b = [0.0; 9];
    for ((w, v), weight) in measured.iter().zip(reference).zip(weights) {
        let a = weight * scale * inverse_length(w) * inverse_length(v);
        for i in 0..3 {
            for j in 0..3 {
                b[3 * i + j] += a * w[i] * v[j];
            }
        }
    }
    Profile(b)
}

/// A small gap has a name if one set is at fault.
fn named(
    error: QuestError,
    measured: &[Vector3<f64>],
    reference: &[Vector3<f64>],
    weights: &[f64],
    total: f64,
) -> QuestError {
    for (set, vectors) in [("measured", measured), ("reference", reference)] {
        let spread = least_eigenvalue(information(vectors, weights, total));
        if 2.0 * spread < MIN_GAP {
            return QuestError::Parallel {
                set,
                spread_rad: spread.max(0.0).sqrt(),
            };
        }
    }
    error
}
