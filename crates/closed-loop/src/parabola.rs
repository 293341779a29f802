//! The parabola through three values.
//!
//! Not physics: interpolation.

/// Where its bottom lies beside the middle one of three values a step apart, of which that is the least, in steps: half a
/// step at most.
pub(crate) fn bottom([before, least, behind]: [f64; 3]) -> f64 {
    let bent = before - 2.0 * least + behind;
    // flat where all are the same
    if bent > 0.0 {
        0.5 * (before - behind) / bent
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bottom_of_a_parabola_is_met() {
        for bottom_at in [-0.5, -0.2, 0.0, 0.31, 0.5] {
            let values = [-1.0, 0.0, 1.0].map(|x: f64| 3.0 + 2.0 * (x - bottom_at).powi(2));
            assert!((bottom(values) - bottom_at).abs() < 1e-12);
        }
        assert!(bottom([1.0; 3]).abs() < 1e-12);
    }
}
