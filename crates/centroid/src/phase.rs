//! Where in its pixel a star is.
//!
//! ```text
//! phi = 2 pi frac(P + 0.5 - pixel_centre)
//! ```
//!
//! with P in centred pixels and `pixel_centre` 0.5 where pixel centres are half-integers (an even
//! detector), 0 where they are whole numbers. The phase is 0 at a pixel edge and pi in the middle.
//!
//! The kernels work in turns (phi / 2 pi) reduced to [-1/2, 1/2] by adding and taking away
//! `1.5 * 2^52`, which rounds to the nearest whole number in two additions; `floor` would be a
//! library call on processors without SSE4.1. Exact for |P| < 2^51.
//!
//! Source: [M23] Eq. 11, whose `rem(P, 1)` differs from `frac` for P < 0 by whole turns only.

use std::f64::consts::{PI, TAU};

/// `1.5 * 2^52`: next to it the spacing of doubles is one.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// Phase of a centred pixel coordinate, rad, in [0, 2 pi).
///
/// ```
/// assert_eq!(centroid::phase_rad(-3.5, 0.5), std::f64::consts::PI);
/// assert_eq!(centroid::phase_rad(4.0, 0.5), 0.0);
/// ```
pub fn phase_rad(p_px: f64, pixel_centre: f64) -> f64 {
    let turns = p_px + 0.5 - pixel_centre;
    TAU * (turns - turns.floor())
}

/// Distance to the nearest whole number, signed, in [-1/2, 1/2].
#[inline(always)] // part of every kernel
pub(crate) fn from_nearest(turns: f64) -> f64 {
    turns - ((turns + ROUND) - ROUND)
}

/// Turns of a phase.
pub(crate) fn turns(phase_rad: f64) -> f64 {
    phase_rad / TAU
}

/// Sine and cosine of `2 pi turns`, vectorisable; absolute error below 4e-16.
///
/// The argument is folded into a quarter turn either side of zero, where the Taylor series to the
/// 21st power leaves (pi/2)^23 / 23! = 1.3e-18.
#[inline(always)] // part of every kernel
pub(crate) fn sin_cos_turns(turns: f64) -> (f64, f64) {
    let t = from_nearest(turns);
    let folded = if t > 0.25 {
        0.5 - t
    } else if t < -0.25 {
        -0.5 - t
    } else {
        t
    };
    (sin_quarter(folded), sin_quarter(0.25 - t.abs()))
}

/// `sin(2 pi t)` for |t| <= 1/4.
#[inline(always)] // part of every kernel
fn sin_quarter(t: f64) -> f64 {
    /// `(-1)^i / (2i + 1)!`, i = 10 down to 0.
    const SERIES: [f64; 11] = [
        1.957_294_106_339_126_1e-20,
        -8.220_635_246_624_329_5e-18,
        2.811_457_254_345_520_6e-15,
        -7.647_163_731_819_816_4e-13,
        1.605_904_383_682_161_3e-10,
        -2.505_210_838_544_172e-8,
        2.755_731_922_398_589_3e-6,
        -1.984_126_984_126_984_1e-4,
        8.333_333_333_333_333_3e-3,
        -1.666_666_666_666_666_6e-1,
        1.0,
    ];
    let z = 2.0 * PI * t;
    let square = z * z;
    let mut sum = 0.0;
    for c in SERIES {
        sum = sum * square + c;
    }
    sum * z
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "compared where the result is exact")]
mod tests {
    use super::*;

    #[test]
    fn phase_follows_the_pixel_grid() {
        assert_eq!(phase_rad(0.0, 0.5), 0.0);
        assert_eq!(phase_rad(0.0, 0.0), PI);
        assert_eq!(phase_rad(-0.25, 0.5), 1.5 * PI);
    }

    /// Eq. 11's remainder keeps the sign of P: the phases differ by a whole turn.
    #[test]
    fn remainder_as_printed_differs_by_whole_turns() {
        for p in [-7.3, -0.25, 0.0, 0.4, 12.9] {
            let printed = TAU * (p % 1.0);
            let turns = (phase_rad(p, 0.5) - printed) / TAU;
            assert!((turns - turns.round()).abs() < 1e-15, "{p}: {turns}");
        }
    }

    #[test]
    fn rounding_by_addition_is_rounding() {
        for i in -4000..4000 {
            let t = f64::from(i) * 0.137;
            assert_eq!(from_nearest(t), t - t.round_ties_even(), "{t}");
        }
        assert!(from_nearest(f64::NAN).is_nan());
    }

    /// `2 pi t` is itself rounded: half a unit in the last place of 2 pi |t| < 3.15, 2.2e-16, on
    /// each side of the comparison, and one rounding of the result.
    #[test]
    fn sine_and_cosine() {
        for i in -2000..=2000 {
            let t = f64::from(i) / 2000.0 * 0.5;
            let (sin, cos) = sin_cos_turns(t);
            assert!((sin - (TAU * t).sin()).abs() < 6e-16, "{t}");
            assert!((cos - (TAU * t).cos()).abs() < 6e-16, "{t}");
            let (sin_far, cos_far) = sin_cos_turns(t + 1024.0);
            assert!((sin_far - sin).abs() < 1e-12 && (cos_far - cos).abs() < 1e-12);
        }
    }
}
