//! How near the two largest eigenvalues of Davenport's matrix may come to each other.
//!
//! Not physics: limits of rounding, from one tolerance.

/// Gap below which the quartic's own error, `100 eps/gap^2` with its margin, exceeds 1e-9 rad and
/// the quaternion is polished: `sqrt(100 eps/1e-9)`.
pub const POLISH_GAP: f64 = 4.712_160_915_387_242e-3;

/// Least gap accepted, `10 sqrt(eps)`: where `100 eps/gap^2`, the error that the quartic alone may
/// make, reaches 1 rad. A polished attitude still holds to 6e-8 rad there (`40 eps/gap`). Two stars
/// of equal weight come to it 1.9 arcmin apart, two 1 degree apart by weights of 1:4000.
pub const MIN_GAP: f64 = 1.490_116_119_384_765_6e-7;

#[cfg(test)]
mod tests {
    use super::*;

    /// Both limits come from one tolerance, `100 eps/gap^2`: at 1e-9 rad and at 1 rad.
    #[test]
    fn limits_are_what_they_say() {
        for (gap, tolerance) in [(POLISH_GAP, 1e-9), (MIN_GAP, 1.0)] {
            let at = 100.0 * f64::EPSILON / (gap * gap);
            assert!((at / tolerance - 1.0).abs() < 1e-12, "{gap}: {at}");
        }
    }
}
