//! Equivalent degrees of freedom of an Allan variance.
//!
//! The second differences `z_i` of power-law noise have a known covariance, and
//!
//! ```text
//! edf = M / (1 + 2 sum_{j < M} (1 - j/M) rho_j^2),   rho_j = s_z(j S) / s_z(0)
//! s_z(t) = 6 s_x(t) - 4 s_x(t - m) - 4 s_x(t + m) + s_x(t - 2m) + s_x(t + 2m)
//! s_x(t) = [t = 0], 2 l(t) - l(t - 1) - l(t + 1), -|t|, l(t), |t|^3     for S_rate ~ f^2, f, 1, 1/f, 1/f^2
//! l(t)   = t^2 ln|t|
//! ```
//!
//! with `M` differences `S` samples apart. White angle noise is new at every sample, flicker of the angle
//! is averaged over the sampling interval; the other three are continuous in time, and the angle is read
//! at instants. The source averages these too; that differs at `m` of a few only. The covariance
//! ends within three averaging times; that of flicker falls off as `t^-2` and is followed for ten.
//!
//! Source: Greenhall & Riley, Proc. 35th PTTI Meeting (2003) 267, Eqs. 8-12; NIST SP 1065 Section 5.4.1.

use super::AllanKind;

/// Noise whose density follows a power of frequency: `S_rate ~ f^alpha`, `S_angle ~ f^(alpha - 2)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PowerLaw {
    /// `alpha = 2`: white noise of the angle.
    WhiteAngle,
    /// `alpha = 1`: flicker noise of the angle.
    FlickerAngle,
    /// `alpha = 0`: white noise of the rate, a random walk of the angle.
    WhiteRate,
    /// `alpha = -1`: flicker noise of the rate, bias instability.
    FlickerRate,
    /// `alpha = -2`: random walk of the rate.
    RandomWalkRate,
}

impl PowerLaw {
    /// The exponent `alpha` of the density of the rate.
    #[must_use]
    pub fn alpha(self) -> i32 {
        match self {
            Self::WhiteAngle => 2,
            Self::FlickerAngle => 1,
            Self::WhiteRate => 0,
            Self::FlickerRate => -1,
            Self::RandomWalkRate => -2,
        }
    }

    /// `s_x` at `lag` samples.
    fn angle(self, lag: f64) -> f64 {
        let flicker = |t: f64| {
            let t2 = t * t;
            if t2 > 0.0 { 0.5 * t2 * t2.ln() } else { 0.0 }
        };
        let t = lag.abs();
        match self {
            Self::WhiteAngle => f64::from(u8::from(t < 0.5)),
            Self::FlickerAngle => 2.0 * flicker(t) - flicker(t - 1.0) - flicker(t + 1.0),
            Self::WhiteRate => -t,
            Self::FlickerRate => flicker(t),
            Self::RandomWalkRate => t.powi(3),
        }
    }

    /// `s_z` at `lag` samples.
    fn difference(self, lag: f64, m: f64) -> f64 {
        let x = |t: f64| self.angle(t);
        6.0 * x(lag) - 4.0 * (x(lag - m) + x(lag + m)) + x(lag - 2.0 * m) + x(lag + 2.0 * m)
    }
}

/// Equivalent degrees of freedom of an Allan variance at averaging factor `factor` from `angles` samples
/// of the angle (one more than there are rates): `variance ~ truth chi2_edf / edf`.
///
/// ```
/// use spectra::{AllanKind, PowerLaw, allan_edf};
/// // white rates at m = 1: rho_1 = -1/2, edf -> M / (1 + 1/2)
/// let edf = allan_edf(PowerLaw::WhiteRate, AllanKind::Overlapping, 1, 1002);
/// assert!((edf - 1000.0 / (1.0 + 0.5 * 0.999)).abs() < 1e-6);
/// ```
///
/// # Panics
///
/// If the series holds no difference: `2 factor >= angles`, or `factor` is 0.
#[must_use]
pub fn allan_edf(noise: PowerLaw, kind: AllanKind, factor: usize, angles: usize) -> f64 {
    assert!(
        factor > 0 && 2 * factor < angles,
        "factor {factor} needs more than {angles} angles"
    );
    let stride = match kind {
        AllanKind::Classic => factor,
        AllanKind::Overlapping => 1,
    };
    let m = factor as f64;
    let differences = (angles - 2 * factor).div_ceil(stride);
    let times = match noise {
        PowerLaw::FlickerAngle | PowerLaw::FlickerRate => 10,
        _ => 3,
    };
    let reach = (times * factor / stride).min(differences - 1);
    let count = differences as f64;
    let variance = noise.difference(0.0, m);
    let sum: f64 = (1..=reach)
        .map(|j| {
            let rho = noise.difference((j * stride) as f64, m) / variance;
            (1.0 - j as f64 / count) * rho * rho
        })
        .sum();
    count / (1.0 + 2.0 * sum)
}
