//! The pair of polynomials at many stars at once.
//!
//! ```text
//! F1(x, y) = y^T A x = sum_j y^j (sum_k A[j][k] x^k),     F2(x, y) = y^T B x
//! ```
//!
//! by Horner's rule, the powers of x inside and those of y outside, over several stars side by
//! side so that the compiler uses vector instructions. Each star goes through the same operations
//! in the same order wherever it stands in the slice: results do not depend on how a batch is cut.
//!
//! Source: [M23] Eq. 5 to 8; the row of A is the power of y, the column that of x (erratum E1).

use focal_plane::{Points, PointsMut};

/// Stars handled side by side: enough independent sums to hide the latency of an addition.
const LANES: usize = 8;

/// Both polynomials at `N` points.
#[inline(always)] // so that a caller compiled for wider vectors gets them here too
pub(crate) fn lanes<const N: usize>(
    width: usize,
    a: &[f64],
    b: &[f64],
    x: &[f64; N],
    y: &[f64; N],
) -> ([f64; N], [f64; N]) {
    let (mut f1, mut f2) = ([0.0; N], [0.0; N]);
    for (a_row, b_row) in a.chunks_exact(width).zip(b.chunks_exact(width)).rev() {
        let (mut g1, mut g2) = ([0.0; N], [0.0; N]);
        for (&a_k, &b_k) in a_row.iter().zip(b_row).rev() {
            for l in 0..N {
                g1[l] = g1[l] * x[l] + a_k;
                g2[l] = g2[l] * x[l] + b_k;
            }
        }
        for l in 0..N {
            f1[l] = f1[l] * y[l] + g1[l];
            f2[l] = f2[l] * y[l] + g2[l];
        }
    }
    (f1, f2)
}

/// Feeds all points through `kernel` in blocks of [`LANES`]; the last block is filled up with zeros.
///
/// # Panics
///
/// If the four slices differ in length.
#[inline(always)] // as above
pub(crate) fn in_blocks(
    at: Points<'_>,
    out: PointsMut<'_>,
    kernel: impl Fn(&[f64; LANES], &[f64; LANES]) -> ([f64; LANES], [f64; LANES]),
) {
    let n = at.x.len();
    assert_eq!(at.y.len(), n, "x and y of the positions");
    assert_eq!(out.x.len(), n, "positions and x of the output");
    assert_eq!(out.y.len(), n, "positions and y of the output");

    let (x, x_rest) = at.x.as_chunks::<LANES>();
    let (y, y_rest) = at.y.as_chunks::<LANES>();
    let (out_x, out_x_rest) = out.x.as_chunks_mut::<LANES>();
    let (out_y, out_y_rest) = out.y.as_chunks_mut::<LANES>();
    for (((x, y), out_x), out_y) in x.iter().zip(y).zip(out_x).zip(out_y) {
        (*out_x, *out_y) = kernel(x, y);
    }
    let rest = x_rest.len();
    if rest > 0 {
        let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
        x[..rest].copy_from_slice(x_rest);
        y[..rest].copy_from_slice(y_rest);
        let (f1, f2) = kernel(&x, &y);
        out_x_rest.copy_from_slice(&f1[..rest]);
        out_y_rest.copy_from_slice(&f2[..rest]);
    }
}
