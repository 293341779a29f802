//! Which sigma is meant: per star circular, per star per axis, or of the attitude.
//!
//! ```text
//! circular:    sigma_circ^2 = sigma_x^2 + sigma_y^2          per axis = circular / sqrt 2
//! cross axis:  sigma_att = sigma_star / sqrt M               M stars, sigma_star per axis (small field)
//! roll:        sigma_roll = sigma_star / (sqrt M rho)        rho = rms sine of the angle off the boresight
//! ```
//!
//! \[M23\] Step 4 scales an angular sigma by `f / sqrt M` to get a per-star one; the inverse is right:
//! a per-star sigma is `sqrt M` *larger* than the attitude's (erratum E5). The printed scaling is kept
//! as [`star_from_cross_axis_as_printed`], because the paper's numbers may have been made with it.
//!
//! \[M23\] Section 4.1 feeds the sigmas fitted on the *boresight attitude* into the model as *per-star
//! circular* sigmas (erratum E14); [`star_per_axis_from_roll`] is what would have closed that loop for
//! white noise.
//!
//! The triangle's peak, per-axis and circular rms (erratum E2) are converted in the `centroid` crate.
//! Lengths of all angles cancel, so any angular unit may be used as long as it is kept.
//!
//! Source: \[M23\] Step 4 and Eq. 14 with errata E2, E5, E14.

use focal_plane::Camera;

/// Per-axis sigma of a per-star circular one: `sigma / sqrt 2`.
pub fn per_axis_from_circular(circular: f64) -> f64 {
    circular * core::f64::consts::FRAC_1_SQRT_2
}

/// Circular sigma of a per-star per-axis one: `sqrt 2 sigma`.
pub fn circular_from_per_axis(per_axis: f64) -> f64 {
    per_axis * core::f64::consts::SQRT_2
}

/// Cross-axis attitude sigma from the per-axis sigma of each of `stars` stars.
///
/// Small-field limit: with stars up to an angle `a` off the boresight the information on x is
/// `sum (1 - w_x^2)`, so the true value is larger by up to `sin^2 a / 2` (erratum E5 found 1.04 with the
/// geometry of real frames, most of it from the coupling of the axes in a lopsided star field).
pub fn cross_axis_from_star(per_axis: f64, stars: usize) -> f64 {
    per_axis / (stars as f64).sqrt()
}

/// Per-star per-axis sigma that gives this cross-axis attitude sigma: `sigma sqrt M`.
pub fn star_from_cross_axis(cross_axis: f64, stars: usize) -> f64 {
    cross_axis * (stars as f64).sqrt()
}

/// The scaling as \[M23\] Step 4 prints it, `sigma / sqrt M`: wrong by a factor M (erratum E5).
pub fn star_from_cross_axis_as_printed(cross_axis: f64, stars: usize) -> f64 {
    cross_axis / (stars as f64).sqrt()
}

/// Roll sigma from the per-axis sigma of each of `stars` stars whose sines of the angle off the
/// boresight have root mean square `rho`.
pub fn roll_from_star(per_axis: f64, stars: usize, rho: f64) -> f64 {
    per_axis / ((stars as f64).sqrt() * rho)
}

/// Per-star per-axis sigma that gives this roll sigma.
pub fn star_per_axis_from_roll(roll: f64, stars: usize, rho: f64) -> f64 {
    roll * (stars as f64).sqrt() * rho
}

/// Root mean square sine of the angle off the boresight for stars spread evenly over the detector.
///
/// ```text
/// rho^2 = < (x^2 + y^2) / (1 + x^2 + y^2) >,   x, y uniform in the tangent plane
/// ```
///
/// by an 8 x 8 Gauss-Legendre rule (error below 1e-12 for any field narrower than 90 deg).
pub fn uniform_field_rho(camera: &Camera) -> f64 {
    let half = camera.half_size_px();
    let focal = camera.focal_length_px();
    let edge = [half[0] / focal[0], half[1] / focal[1]];
    let mut sum = 0.0;
    for (u, wu) in crate::quadrature::GAUSS_LEGENDRE_8 {
        for (v, wv) in crate::quadrature::GAUSS_LEGENDRE_8 {
            let r2 = (edge[0] * u).powi(2) + (edge[1] * v).powi(2);
            sum += 0.25 * wu * wv * r2 / (1.0 + r2);
        }
    }
    sum.sqrt()
}
