//! The attitude profile matrix and the steps that solve it.
//!
//! ```text
//! B = sum a_i w_i v_i^T,   sum a_i = 1;    attitude = argmax tr(B C^T)
//! ```
//!
//! Frames take one of three ways, the same alone and in a batch: two Newton steps (nearly all), the
//! same with sequential rotation and one polish, or Newton to the end and polishing until it rests.
//!
//! Source: Shuster & Oh 1981, doi:10.2514/3.19717; \[M23\] section 2.5.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion};

use crate::error::QuestError;
use crate::gap_limits::MIN_GAP;
use crate::polish::{gap, polished};
use crate::quartic::{FirstPass, Quartic, Rows, first_pass};
use crate::sequential::rotated_quaternion;

/// Row-major 3x3 profile of one frame at unit total weight; rows measured, columns reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile(pub [f64; 9]);

/// Attitude of a profile with its eigenvalues.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attitude {
    /// Inertial to tracker, scalar part not negative.
    pub q: UnitQuaternion<f64>,
    /// Largest eigenvalue of Davenport's matrix at unit total weight: 1 for exact data, less by
    /// half the weighted mean square residual.
    pub lambda: f64,
    /// Its distance from the second largest.
    pub gap: f64,
    /// Newton steps and polishing steps taken.
    pub iterations: u32,
}

impl Profile {
    /// As a matrix.
    #[must_use]
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_row_slice(&self.0)
    }

    /// The best attitude of this profile.
    ///
    /// # Errors
    ///
    /// [`QuestError::NotFinite`] for a NaN or infinity, [`QuestError::Degenerate`] if the gap is
    /// below [`MIN_GAP`].
    pub fn solve(&self) -> Result<Attitude, QuestError> {
        let raw = solve_rows(&self.0)?;
        let [x, y, z, w] = raw.q;
        let gap = gap(&self.0, raw.q);
        Ok(Attitude {
            q: UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)),
            lambda: raw.lambda,
            gap,
            iterations: raw.iterations,
        })
    }
}

/// Quaternion (x, y, z, w), eigenvalue and steps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Raw {
    pub(crate) q: [f64; 4],
    pub(crate) lambda: f64,
    pub(crate) iterations: u32,
}

fn solve_rows(b: &Rows) -> Result<Raw, QuestError> {
    let first = first_pass(b);
    if first.is_final() {
        return Ok(Raw {
            q: first.q,
            lambda: first.lambda,
            iterations: 2,
        });
    }
    if first.has_root() {
        let (q, lambda) = second_pass(b, &first);
        return Ok(Raw {
            q,
            lambda,
            iterations: 3,
        });
    }
    solve_guarded(b)
}

/// Best frame and one polish; branch-free.
#[inline(always)]
pub(crate) fn second_pass(b: &Rows, first: &FirstPass) -> ([f64; 4], f64) {
    polished(b, rotated_quaternion(b, first.lambda))
}

/// Steps after which Newton from above has halved its distance from a double root below eps.
const NEWTON_STEPS: u32 = 60;
const POLISH_STEPS: u32 = 10;

/// The way of the few: large residuals, or a small gap.
#[cold]
pub(crate) fn solve_guarded(b: &Rows) -> Result<Raw, QuestError> {
    if !b.iter().all(|x| x.is_finite()) {
        return Err(QuestError::NotFinite {
            set: "profile",
            index: 0,
        });
    }
    let quartic = Quartic::of(b);
    let (mut lambda, mut iterations) = (quartic.bound(), 0);
    // from above the largest root Newton only goes down, until rounding stops it
    while iterations < NEWTON_STEPS {
        let next = lambda - quartic.step(lambda);
        iterations += 1;
        if next >= lambda || next.is_nan() {
            break;
        }
        lambda = next;
    }
    let mut q = rotated_quaternion(b, lambda);
    let mut last = f64::INFINITY;
    for _ in 0..POLISH_STEPS {
        let (next, rayleigh) = polished(b, q);
        iterations += 1;
        let change = change(q, next);
        (q, lambda) = (next, rayleigh);
        if change > 0.5 * last || change < 2.0 * f64::EPSILON || change.is_nan() {
            break;
        }
        last = change;
    }
    let gap = gap(b, q);
    if gap >= MIN_GAP {
        return Ok(Raw {
            q,
            lambda,
            iterations,
        });
    }
    Err(QuestError::Degenerate {
        gap: gap.max(0.0),
        limit: MIN_GAP,
    })
}

/// Largest difference of components; at 180 degrees the sign is open.
fn change(a: [f64; 4], b: [f64; 4]) -> f64 {
    let far = |sign: f64| (0..4).fold(0.0_f64, |most, i| most.max((a[i] - sign * b[i]).abs()));
    far(1.0).min(far(-1.0))
}
