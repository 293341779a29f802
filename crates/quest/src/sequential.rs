//! Sequential rotation: the way round the singularity at 180 degrees.
//!
//! The quaternion from the quartic comes with a factor `q_scalar`. Turning the reference vectors by
//! 180 degrees about an axis `e` first exchanges that factor for `q_e`:
//!
//! ```text
//! v' = R_e v,   B' = B R_e,   q = q' e        (R_x = diag(1, -1, -1), e = i, j or k)
//! ```
//!
//! and the largest of the four components is at least 1/2. Which one it is, the diagonal of
//! `adj(l I - K) = p'(l) q q^T` says before any of them is computed, so nothing is tried twice.
//!
//! Source: Shuster & Oh 1981, doi:10.2514/3.19717, section "the method of sequential rotations".

use crate::quartic::{Gibbs, Rows, normalised};

#[inline(always)]
fn minor(d: [f64; 3], xy: f64, xz: f64, yz: f64) -> f64 {
    d[0] * (d[1] * d[2] - yz * yz) - xy * (xy * d[2] - yz * xz) + xz * (xy * yz - d[1] * xz)
}

/// The quaternion of eigenvalue `l`, from the best of the four frames; branch-free.
#[inline(always)]
pub(crate) fn rotated_quaternion(b: &Rows, l: f64) -> [f64; 4] {
    let g = Gibbs::of(b, l);
    let [xx, yy, zz, xy, xz, yz] = g.a;
    let ([x, y, z], w) = (g.z, l - g.trace);
    // the border of l I - K is -z; its sign drops out of the minors' products in pairs
    let of_x = minor([yy, zz, w], yz, -y, -z);
    let of_y = minor([xx, zz, w], xz, -x, -z);
    let of_z = minor([xx, yy, w], xy, -x, -y);
    let of_w = minor([xx, yy, zz], xy, xz, yz);

    let about_x = (of_x > of_w) & (of_x >= of_y) & (of_x >= of_z);
    let about_y = !about_x & (of_y > of_w) & (of_y >= of_z);
    let about_z = !about_x & !about_y & (of_z > of_w);
    let (nx, ny, nz) = (
        if about_y | about_z { -1.0 } else { 1.0 },
        if about_x | about_z { -1.0 } else { 1.0 },
        if about_x | about_y { -1.0 } else { 1.0 },
    );
    let turned = [
        b[0] * nx,
        b[1] * ny,
        b[2] * nz,
        b[3] * nx,
        b[4] * ny,
        b[5] * nz,
        b[6] * nx,
        b[7] * ny,
        b[8] * nz,
    ];
    let [x, y, z, w] = Gibbs::of(&turned, l).column();
    // Hamilton products with i, j, k
    let q = [[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z], [x, y, z, w]];
    let mut out = [0.0; 4];
    for i in 0..4 {
        out[i] = if about_x {
            q[0][i]
        } else if about_y {
            q[1][i]
        } else if about_z {
            q[2][i]
        } else {
            q[3][i]
        };
    }
    normalised(out)
}
