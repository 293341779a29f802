//! Inverse iteration in the frame of the attitude already found, and the eigenvalue gap there.
//!
//! With the reference vectors turned by the attitude `C`, what is left to find is a small rotation,
//! and the Rayleigh quotient `s' = tr B'` is the eigenvalue without any quartic:
//!
//! ```text
//! B' = B C^T,   e = [2 s' I - S']^-1 z',   q <- (e, 1) q / |..|
//! ```
//!
//! One step is one step of Rayleigh quotient iteration on K: the error goes to its cube, down to
//! `eps/gap` rather than the quartic's `eps/gap^2`. At the solution B' is symmetric and
//! `H = s' I - B'` has half the distances of the largest eigenvalue of K from the others as its own
//! eigenvalues; so `gap = 2 min eig H`.
//!
//! Source: Golub & Van Loan, Matrix Computations, 4th ed., section 8.2.3; H from Markley &
//! Crassidis, Fundamentals of Spacecraft Attitude Determination and Control (2014), section 5.5.

use nalgebra::Matrix3;

use crate::quartic::{Gibbs, Rows, normalised};

/// `B' = B C(q)^T`.
#[inline(always)]
fn turned(b: &Rows, q: [f64; 4]) -> Rows {
    let [x, y, z, w] = q;
    let c = [
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    ];
    let mut out = [0.0; 9];
    for i in 0..3 {
        for j in 0..3 {
            out[3 * i + j] =
                b[3 * i] * c[3 * j] + b[3 * i + 1] * c[3 * j + 1] + b[3 * i + 2] * c[3 * j + 2];
        }
    }
    out
}

/// One step: the better quaternion and the Rayleigh quotient of the old one; branch-free.
#[inline(always)]
pub(crate) fn polished(b: &Rows, q: [f64; 4]) -> ([f64; 4], f64) {
    let b = turned(b, q);
    let s = b[0] + b[4] + b[8];
    let [ex, ey, ez, ew] = Gibbs::of(&b, s).column();
    let [x, y, z, w] = q;
    let q = [
        ew * x + ex * w + ey * z - ez * y,
        ew * y - ex * z + ey * w + ez * x,
        ew * z + ex * y - ey * x + ez * w,
        ew * w - ex * x - ey * y - ez * z,
    ];
    (normalised(q), s)
}

/// Gap at the attitude `q`, good to a few eps. Not above zero if `q` is no maximum.
pub(crate) fn gap(b: &Rows, q: [f64; 4]) -> f64 {
    let b = turned(b, q);
    let s = b[0] + b[4] + b[8];
    // 2 H, whose least eigenvalue is the gap
    least_eigenvalue(Gibbs::of(&b, s).a)
}

/// Least eigenvalue of a symmetric 3x3 matrix (xx, yy, zz, xy, xz, yz), good to a few tens of eps of
/// the largest: Newton on the cubic from below, unless roots are so close that it would lose digits.
pub(crate) fn least_eigenvalue(m: [f64; 6]) -> f64 {
    let [xx, yy, zz, xy, xz, yz] = m;
    let (cx, cy, cz) = (yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy);
    let c2 = xx + yy + zz;
    let c1 = cx + cy + cz;
    let c0 = xx * cx - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    // no negative root if every coefficient is positive; concave below the least root, so that from
    // 0 the steps go up to it, at least doubling the digits
    let mut x = 0.0;
    let steps = if c0 >= 0.0 && c1 > 0.0 && c2 > 0.0 {
        8
    } else {
        0
    };
    for _ in 0..steps {
        let step = (((x - c2) * x + c1) * x - c0) / ((3.0 * x - 2.0 * c2) * x + c1);
        x -= step;
        // product of the distances to the other two roots, which divides the error
        let slope = (3.0 * x - 2.0 * c2) * x + c1;
        if step.abs() <= f64::EPSILON * c2 && slope > 0.05 * c2 * c2 && x >= 0.0 {
            return x;
        }
    }
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        .symmetric_eigenvalues()
        .min()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A backward stable method errs by a few eps of the largest eigenvalue, here at most 5.
    #[test]
    fn least_eigenvalue_of_known_matrices() {
        for (m, want) in [
            ([3.0, 1.0, 2.0, 0.0, 0.0, 0.0], 1.0),
            ([2.0, 2.0, 2.0, 0.0, 0.0, 0.0], 2.0),
            ([2.0, 2.0, 5.0, 1.0, 0.0, 0.0], 1.0),
            ([1.0, 1.0, 1.0, 1.0, 1.0, 1.0], 0.0),
            ([0.0, 0.0, 1.0, 1.0, 0.0, 0.0], -1.0),
            ([1e-7, 1.0, 1.0, 0.0, 0.0, 0.0], 1e-7),
        ] {
            let got = least_eigenvalue(m);
            assert!(
                (got - want).abs() < 16.0 * f64::EPSILON * 5.0,
                "{m:?}: {got} not {want}"
            );
        }
    }
}
