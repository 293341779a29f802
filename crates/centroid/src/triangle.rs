//! The triangle: centroid error that grows linearly away from the middle of the pixel.
//!
//! ```text
//! c(phi) = peak (2/pi) asin(sin(phi)) = peak (1 - 4 |t - round(t)|),   t = phi/(2 pi) - 1/4
//! ```
//!
//! zero at whole and half pixels, `+peak` at phase pi/2, `-peak` at 3 pi/2. The second form is
//! what is computed: it has no transcendental function, and it does not lose half the digits near
//! the peaks, where asin has a vertical tangent.
//!
//! The paper calls its factor "the circular RMS error", but it is the *peak* of each axis; the RMS
//! of one axis is peak / sqrt(3) and of both together peak sqrt(2/3) = 0.8165 peak (erratum E2).
//! The constructors name which of the three is meant.
//!
//! Source: [M23] Eq. 10.

use std::f64::consts::PI;

use crate::phase;

/// A triangle wave on each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Triangle {
    /// Peak of x and of y, in any unit.
    pub peak: [f64; 2],
}

impl Triangle {
    /// Eq. 10 as printed: `sigma_HSF` is the peak, on both axes.
    pub fn from_peak(peak: f64) -> Self {
        Self { peak: [peak; 2] }
    }

    /// The triangle whose RMS on each axis is `rms`.
    ///
    /// ```
    /// let triangle = centroid::Triangle::from_per_axis_rms(1.0);
    /// assert!((triangle.peak[0] - 3_f64.sqrt()).abs() < 1e-15);
    /// ```
    pub fn from_per_axis_rms(rms: f64) -> Self {
        Self::from_peak(rms * 3_f64.sqrt())
    }

    /// The triangle whose RMS of both axes together is `rms`: Eq. 10 as its text has it.
    ///
    /// ```
    /// let triangle = centroid::Triangle::from_circular_rms(0.816_496_580_927_726);
    /// assert!((triangle.peak[0] - 1.0).abs() < 1e-14);
    /// ```
    pub fn from_circular_rms(rms: f64) -> Self {
        Self::from_peak(rms * 1.5_f64.sqrt())
    }

    /// RMS of each axis over a uniformly distributed phase.
    pub fn per_axis_rms(&self) -> [f64; 2] {
        self.peak.map(|peak| peak.abs() / 3_f64.sqrt())
    }

    /// RMS of both axes together over uniformly distributed phases.
    pub fn circular_rms(&self) -> f64 {
        let [x, y] = self.per_axis_rms();
        x.hypot(y)
    }
}

/// The wave of peak 1 at a phase in turns.
#[inline(always)] // part of every kernel
pub(crate) fn wave(turns: f64) -> f64 {
    1.0 - 4.0 * phase::from_nearest(turns - 0.25).abs()
}

/// A position known better than this, squared px, is as good as known: a kink is rounded by 0.4 of it.
const KNOWN_PX2: f64 = 0.005 * 0.005;

/// Mean of the wave over a position that is known to a variance, px^2: the odd harmonics, faded, as far
/// as 1e-8 of the first is left of them.
pub(crate) fn mean_wave(turns: f64, variance_px2: f64) -> f64 {
    if variance_px2 < KNOWN_PX2 || variance_px2.is_nan() {
        return wave(turns);
    }
    let (sin, _) = phase::sin_cos_turns(turns);
    // sin((m + 2) phi) = 2 cos(2 phi) sin(m phi) - sin((m - 2) phi); the fading falls by a ratio that falls
    let twice = 2.0 * (1.0 - 2.0 * sin * sin);
    let each = (-2.0 * PI * PI * variance_px2).exp();
    let by = each.powi(8);
    let (mut now, mut before) = (sin, -sin);
    let (mut faded, mut ratio) = (each, by);
    let (mut sum, mut m, mut sign) = (0.0, 1.0, 1.0);
    while faded > 1e-8 * m * m * each {
        sum += sign * faded / (m * m) * now;
        (now, before) = (twice * now - before, now);
        faded *= ratio;
        ratio *= by;
        m += 2.0;
        sign = -sign;
    }
    8.0 / (PI * PI) * sum
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_2_PI, TAU};

    use super::*;

    /// Near its peaks asin(sin) is wrong by sqrt(2 * 1.1e-16) * 2/pi = 9.5e-9 at most.
    #[test]
    fn equals_the_printed_form() {
        for i in -3000..3000 {
            let turns = f64::from(i) * 0.001_37;
            let printed = FRAC_2_PI * (TAU * turns).sin().asin();
            assert!((wave(turns) - printed).abs() < 1e-8, "{turns}");
        }
    }

    /// Against the mean over a Gaussian by the midpoint rule, 4000 steps over +-8 sigma: exact to rounding
    /// but for the kinks, each a change of slope of 8, off by h^2 times their density, two a turn of them:
    /// 2 h^2 = 2.9e-6 where h = 0.004 * 0.3. The series is cut at 1e-8 of the first harmonic a term. Below the least variance a kink is rounded by 4 sigma (2/pi)^(1/2).
    #[test]
    fn mean_over_the_position() {
        for sigma in [0.02, 0.1, 0.3_f64] {
            for i in 0..37 {
                let turns = f64::from(i) / 37.0;
                let (mut sum, mut all) = (0.0, 0.0);
                for k in 0..4000 {
                    let z = (f64::from(k) + 0.5) * 0.004 - 8.0;
                    let weight = (-0.5 * z * z).exp();
                    sum += weight * wave(turns + sigma * z);
                    all += weight;
                }
                let got = mean_wave(turns, sigma * sigma);
                assert!((got - sum / all).abs() < 3e-6, "{sigma} {turns}: {got}");
            }
        }
        assert_eq!(mean_wave(0.27, 0.0).to_bits(), wave(0.27).to_bits());
        for i in 0..100 {
            let turns = f64::from(i) / 100.0;
            let rounded = 4.0 * 0.005 * (2.0 / PI).sqrt();
            assert!((mean_wave(turns, KNOWN_PX2) - wave(turns)).abs() < 1.01 * rounded);
        }
    }

    /// Erratum E2 by direct quadrature: the factor of Eq. 10 is the peak. The midpoint sum of a
    /// square of straight pieces over n cells is off by at most h^2/24 * 2 * 16, h = 1/n.
    #[test]
    fn printed_factor_is_the_peak_and_not_the_rms() {
        let n = 4000_u32;
        let h = 1.0 / f64::from(n);
        let triangle = Triangle::from_peak(5.06);
        let mean_square = (0..n)
            .map(|i| (triangle.peak[0] * wave((f64::from(i) + 0.5) * h)).powi(2))
            .sum::<f64>()
            * h;
        let tolerance = 5.06 * 5.06 * h * h / 24.0 * 32.0;
        let [rms, _] = triangle.per_axis_rms();
        assert!((mean_square - rms * rms).abs() < tolerance);
        let circular = triangle.circular_rms();
        assert!((2.0 * mean_square - circular * circular).abs() < 2.0 * tolerance);
        assert!((circular / 5.06 - 0.8165).abs() < 1e-5);
        // as the text of Eq. 10 has it, the circular RMS would be 5.06
        assert!(circular < 4.2);
    }

    #[test]
    fn conversions_invert() {
        let triangle = Triangle::from_circular_rms(2.0);
        assert!((triangle.circular_rms() - 2.0).abs() < 1e-15);
        let triangle = Triangle::from_per_axis_rms(2.0);
        assert!((triangle.per_axis_rms()[1] - 2.0).abs() < 1e-15);
    }
}
