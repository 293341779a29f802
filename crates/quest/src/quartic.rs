//! The characteristic quartic, its largest root, and the quaternion that belongs to it.
//!
//! Davenport's matrix of the profile `B = sum a_i w_i v_i^T` (unit total weight) is
//!
//! ```text
//! K = | S - s I   z |    S = B + B^T,  s = tr B,  z = sum a_i v_i x w_i
//!     |   z^T     s |
//! ```
//!
//! and `(q_vector, q_scalar)` is the eigenvector of its largest eigenvalue, a root of
//!
//! ```text
//! p(l) = (l^2 - |B|^2)^2 - 8 l det B - 4 |adj B|^2
//! ```
//!
//! Every function here is branch-free, so that a loop over lanes of frames vectorises.
//!
//! Source: Shuster & Oh 1981, doi:10.2514/3.19717, Eqs. 63-71; p(l) from Markley 1993,
//! J. Astronautical Sciences 41, 261. The sign of `z` is for Hamilton quaternions with
//! `w = q v`, the opposite of the source's.

use crate::gap_limits::POLISH_GAP;

/// Row-major profile.
pub(crate) type Rows = [f64; 9];

/// Coefficients of the quartic that depend on the profile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quartic {
    norm2: f64,
    det8: f64,
    adj4: f64,
}

impl Quartic {
    #[inline(always)]
    pub(crate) fn of(b: &Rows) -> Self {
        let norm2 = b[0] * b[0]
            + b[1] * b[1]
            + b[2] * b[2]
            + (b[3] * b[3] + b[4] * b[4] + b[5] * b[5])
            + (b[6] * b[6] + b[7] * b[7] + b[8] * b[8]);
        let c = [
            b[4] * b[8] - b[5] * b[7],
            b[5] * b[6] - b[3] * b[8],
            b[3] * b[7] - b[4] * b[6],
            b[2] * b[7] - b[1] * b[8],
            b[0] * b[8] - b[2] * b[6],
            b[1] * b[6] - b[0] * b[7],
            b[1] * b[5] - b[2] * b[4],
            b[2] * b[3] - b[0] * b[5],
            b[0] * b[4] - b[1] * b[3],
        ];
        let adj2 = c[0] * c[0]
            + c[1] * c[1]
            + c[2] * c[2]
            + (c[3] * c[3] + c[4] * c[4] + c[5] * c[5])
            + (c[6] * c[6] + c[7] * c[7] + c[8] * c[8]);
        Self {
            norm2,
            det8: 8.0 * (b[0] * c[0] + b[1] * c[1] + b[2] * c[2]),
            adj4: 4.0 * adj2,
        }
    }

    /// An upper bound of the largest root, whatever the total weight: `l = s1 + s2 +- s3` of the
    /// singular values, at most `sqrt(3) |B|`.
    pub(crate) fn bound(&self) -> f64 {
        (3.0 * self.norm2).sqrt()
    }

    #[inline(always)]
    fn value(&self, l: f64) -> f64 {
        let h = l * l - self.norm2;
        h * h - self.det8 * l - self.adj4
    }

    /// `p'(l)`; at the largest root the product of its distances from the other three.
    #[inline(always)]
    fn slope(&self, l: f64) -> f64 {
        4.0 * l * (l * l - self.norm2) - self.det8
    }

    /// The Newton step to subtract from `l`.
    #[inline(always)]
    pub(crate) fn step(&self, l: f64) -> f64 {
        self.value(l) / self.slope(l)
    }
}

/// A lower bound of the gap, from the slope at the largest root: the distances to the other roots
/// sum to `4 l` (K has no trace), so the two larger ones multiply to at most `4 l^2`.
#[inline(always)]
fn gap_bound(slope: f64, l: f64) -> f64 {
    slope / (4.0 * l * l)
}

/// Symmetric 3x3 system `A = (l + s) I - S` and right side `z` of the profile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gibbs {
    /// xx, yy, zz, xy, xz, yz.
    pub(crate) a: [f64; 6],
    pub(crate) z: [f64; 3],
    pub(crate) trace: f64,
}

impl Gibbs {
    #[inline(always)]
    pub(crate) fn of(b: &Rows, l: f64) -> Self {
        let s = b[0] + b[4] + b[8];
        let d = l + s;
        Self {
            a: [
                d - 2.0 * b[0],
                d - 2.0 * b[4],
                d - 2.0 * b[8],
                -(b[1] + b[3]),
                -(b[2] + b[6]),
                -(b[5] + b[7]),
            ],
            z: [b[7] - b[5], b[2] - b[6], b[3] - b[1]],
            trace: s,
        }
    }

    /// `(adj(A) z, det A)`: the fourth column of `adj(l I - K)`, hence proportional to the
    /// quaternion, with a factor `p'(l) q_scalar` that vanishes for a rotation by 180 degrees.
    #[inline(always)]
    pub(crate) fn column(&self) -> [f64; 4] {
        let [xx, yy, zz, xy, xz, yz] = self.a;
        let [x, y, z] = self.z;
        let (cxx, cyy, czz) = (yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy);
        let (cxy, cxz, cyz) = (xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz);
        [
            cxx * x + cxy * y + cxz * z,
            cxy * x + cyy * y + cyz * z,
            cxz * x + cyz * y + czz * z,
            xx * cxx + xy * cxy + xz * cxz,
        ]
    }
}

/// Unit length and non-negative scalar part.
#[inline(always)]
pub(crate) fn normalised(q: [f64; 4]) -> [f64; 4] {
    let n = 1.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    let n = if q[3] < 0.0 { -n } else { n };
    [q[0] * n, q[1] * n, q[2] * n, q[3] * n]
}

/// What two Newton steps from the total weight give, and how far it may be trusted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FirstPass {
    pub(crate) q: [f64; 4],
    pub(crate) lambda: f64,
    pub(crate) gap_bound: f64,
    pub(crate) last_step: f64,
    /// Square of the scalar part, from `det A = p'(l) q_scalar^2`: unlike the quaternion's own it
    /// is good where the column is all rounding.
    pub(crate) scalar2: f64,
}

/// Newton leaves about `last_step^2 / gap` of error in the root, hence the square of this share of
/// the gap in the attitude: at most 1e-16 rad where the quaternion stands as it is, and 1e-6 rad
/// where a polish follows, which takes that to its cube.
const CONVERGED: f64 = 1e-8;
const CONVERGED_FOR_POLISH: f64 = 1e-3;

/// Below this gap rounding (`eps/gap^2` from the quartic) leaves too much for one polish.
const LANE_GAP: f64 = 1e-5;

/// Square of the least scalar part for which the frame need not be rotated: the error of the
/// largest root is magnified by up to the inverse of that part.
const MIN_SCALAR2: f64 = 0.01;

#[inline(always)]
pub(crate) fn first_pass(b: &Rows) -> FirstPass {
    let quartic = Quartic::of(b);
    let l = 1.0 - quartic.step(1.0);
    let last_step = quartic.step(l);
    let lambda = l - last_step;
    let column = Gibbs::of(b, lambda).column();
    let slope = quartic.slope(lambda);
    FirstPass {
        q: normalised(column),
        lambda,
        gap_bound: gap_bound(slope, lambda),
        last_step,
        scalar2: column[3] / slope,
    }
}

impl FirstPass {
    /// The quaternion stands as it is. Written so that a NaN says no.
    #[inline(always)]
    pub(crate) fn is_final(&self) -> bool {
        (self.gap_bound >= POLISH_GAP)
            & (self.last_step.abs() <= CONVERGED * self.gap_bound)
            & (self.scalar2 >= MIN_SCALAR2)
    }

    /// The root is good enough for the second pass.
    #[inline(always)]
    pub(crate) fn has_root(&self) -> bool {
        (self.gap_bound >= LANE_GAP)
            & (self.last_step.abs() <= CONVERGED_FOR_POLISH * self.gap_bound)
    }
}
