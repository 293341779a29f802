//! Directions of stars, and their aberration.
//!
//! ```text
//! u  = (cos dec cos ra, cos dec sin ra, sin dec)
//! u' = (u + v/c) / |u + v/c|
//! ```
//!
//! v is the velocity of the observer in the frame of u. The second line is classical; the
//! relativistic formula differs by terms of (v/c)^2, at most 0.001 arcsec at 30 km/s.
//!
//! Source: effects catalogue, `velocity_aberration`; Green, Spherical Astronomy (1985), ch. 8.

use nalgebra::Vector3;

use crate::{Angle, SPEED_OF_LIGHT_M_S};

/// Unit vector towards right ascension and declination.
///
/// ```
/// use focal_plane::{Angle, ra_dec, unit_vector};
/// let u = unit_vector(Angle::from_deg(279.23), Angle::from_deg(38.78));
/// let (ra, dec) = ra_dec(&u);
/// assert!((ra.deg() - 279.23).abs() < 1e-12 && (dec.deg() - 38.78).abs() < 1e-12);
/// ```
#[must_use]
pub fn unit_vector(ra: Angle, dec: Angle) -> Vector3<f64> {
    let (sin_ra, cos_ra) = ra.rad().sin_cos();
    let (sin_dec, cos_dec) = dec.rad().sin_cos();
    Vector3::new(cos_dec * cos_ra, cos_dec * sin_ra, sin_dec)
}

/// Right ascension in [0, 2 pi) and declination of a vector of any length; accurate at the poles,
/// where `asin` of the third component would not be.
#[must_use]
pub fn ra_dec(v: &Vector3<f64>) -> (Angle, Angle) {
    let ra = v.y.atan2(v.x);
    // a tiny negative angle plus 2 pi rounds to 2 pi itself, hence the last step
    let ra = if ra < 0.0 {
        ra + std::f64::consts::TAU
    } else {
        ra
    };
    let ra = if ra < std::f64::consts::TAU { ra } else { 0.0 };
    (
        Angle::from_rad(ra),
        Angle::from_rad(v.z.atan2(v.x.hypot(v.y))),
    )
}

/// Apparent direction of a star for an observer that moves: `u + v/c`, normalised. `u` is a unit
/// vector, `velocity_m_s` in the same frame.
#[must_use]
pub fn aberrated(u: &Vector3<f64>, velocity_m_s: &Vector3<f64>) -> Vector3<f64> {
    (u + velocity_m_s / SPEED_OF_LIGHT_M_S).normalize()
}
