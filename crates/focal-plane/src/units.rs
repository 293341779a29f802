//! Units at the borders: one angle type, and the constants that turn units.
//!
//! ```text
//! 1 rad = 180 * 3600 / pi arcsec = 206 264.806... arcsec
//! ```
//!
//! Inside, angles are plain `f64` radians with the unit in the name.
//!
//! Source: definition of the arcsecond; c is exact by the definition of the metre (SI brochure,
//! 9th edition).

/// Arcseconds in one radian, `648000 / pi`.
pub const ARCSEC_PER_RAD: f64 = 648_000.0 / std::f64::consts::PI;

/// Speed of light in vacuum, m/s; exact.
pub const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;

/// A plane angle, held in radians.
///
/// ```
/// use focal_plane::Angle;
/// let pixel = Angle::from_arcsec(71.0);
/// assert!((pixel.deg() - 71.0 / 3600.0).abs() < 1e-17);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Angle(f64);

impl Angle {
    /// From radians.
    #[must_use]
    pub const fn from_rad(rad: f64) -> Self {
        Self(rad)
    }

    /// From arcseconds.
    #[must_use]
    pub const fn from_arcsec(arcsec: f64) -> Self {
        Self(arcsec / ARCSEC_PER_RAD)
    }

    /// From degrees.
    #[must_use]
    pub const fn from_deg(deg: f64) -> Self {
        Self(deg * (std::f64::consts::PI / 180.0))
    }

    /// In radians.
    #[must_use]
    pub const fn rad(self) -> f64 {
        self.0
    }

    /// In arcseconds.
    #[must_use]
    pub const fn arcsec(self) -> f64 {
        self.0 * ARCSEC_PER_RAD
    }

    /// In degrees.
    #[must_use]
    pub const fn deg(self) -> f64 {
        self.0 * (180.0 / std::f64::consts::PI)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two roundings each way: 2 eps relative, and one more for the constant.
    #[test]
    fn units_round_trip() {
        for value in [1e-9, 0.3, 71.0, 1.3e6] {
            let tol = 4.0 * f64::EPSILON * value;
            assert!((Angle::from_arcsec(value).arcsec() - value).abs() <= tol);
            assert!((Angle::from_deg(value).deg() - value).abs() <= tol);
            assert!((Angle::from_deg(value).arcsec() - 3600.0 * value).abs() <= 3600.0 * tol);
        }
        assert!((Angle::from_deg(180.0).rad() - std::f64::consts::PI).abs() < 1e-15);
    }
}
