//! The centroid error of both axes, whichever its shape.
//!
//! ```text
//! x_measured = x + c_x(phi_x),    phi_x = 2 pi frac(P_x + 0.5 - pixel_centre)
//! ```
//!
//! evaluated at the distorted, noise-free position, and the same for y. Unit: that of the
//! amplitudes given. Where the position is known to a variance v (px^2) only, the error to expect is
//! the mean over it, in which harmonics fade:
//!
//! ```text
//! E sin(k phi) = exp(-2 pi^2 k^2 v) sin(k phi_known)
//! ```
//!
//! Source: [M23] Eq. 9 to 11, Step 3; the characteristic function of a Gaussian.

use focal_plane::{Pixel, Points, PointsMut};

use crate::gaussian_psf::GaussianPsf;
use crate::harmonics::Harmonics;
use crate::phase;
use crate::triangle::{self, Triangle};

/// Nodes (in standard deviations) and weights of a mean over a normal variable, exact to the ninth power.
pub const GAUSS_HERMITE_5: [(f64, f64); 5] = [
    (-2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (-1.355_626_179_974_266, 0.222_075_922_005_612_6),
    (0.0, 0.533_333_333_333_333_3),
    (1.355_626_179_974_266, 0.222_075_922_005_612_6),
    (2.856_970_013_872_806, 0.011_257_411_327_720_69),
];

/// How a centroid differs from the star's place, as a function of its pixel phase.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum CentroidError {
    /// No error.
    #[default]
    None,
    /// The paper's triangle, `[M23]` Eq. 10.
    Triangle(Triangle),
    /// A harmonic series on each axis.
    Harmonics(Harmonics),
    /// First moment of a Gaussian spot in a window.
    GaussianPsf(GaussianPsf),
}

impl CentroidError {
    /// Error of x and y at the phases of x and y (rad, 0 at a pixel edge), measured minus true.
    ///
    /// ```
    /// use centroid::{CentroidError, Triangle};
    ///
    /// let error = CentroidError::Triangle(Triangle::from_peak(2.0));
    /// let quarter = std::f64::consts::FRAC_PI_2;
    /// assert_eq!(error.error([quarter, 0.0]), [2.0, 0.0]);
    /// ```
    pub fn error(&self, phase_rad: [f64; 2]) -> [f64; 2] {
        self.at_turns(phase_rad.map(phase::turns))
    }

    /// Error at one position in centred pixels.
    pub fn error_at(&self, at: Pixel, pixel_centre: f64) -> [f64; 2] {
        let offset = 0.5 - pixel_centre;
        self.at_turns([at.x + offset, at.y + offset])
    }

    /// Errors at many positions in centred pixels; equal to [`error_at`](Self::error_at) to the
    /// last bit. A position that is NaN gives NaN, also without an error.
    ///
    /// # Panics
    ///
    /// If the four slices differ in length.
    #[inline]
    pub fn error_into(&self, at: Points<'_>, pixel_centre: f64, out: PointsMut<'_>) {
        self.each(at, pixel_centre, out, |_, error| error);
    }

    /// Errors to expect at positions that are known to these variances, px^2, about `at`; those of
    /// [`error_into`](Self::error_into) to the last bit where these are 0. The S-curve of a spot is
    /// averaged over five nodes.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    ///
    /// ```
    /// use centroid::{CentroidError, Harmonic, Harmonics};
    /// use focal_plane::{Points, PointsMut};
    ///
    /// let wave = [Harmonic { amplitude: 2.0, phase_rad: 0.0 }];
    /// let error = CentroidError::Harmonics(Harmonics::new(&wave, &wave));
    /// let (mut x, mut y) = ([0.0], [0.0]);
    /// let at = Points { x: &[0.25], y: &[0.25] };
    /// error.mean_error_into(at, [&[0.01], &[0.0]], 0.5, PointsMut { x: &mut x, y: &mut y });
    /// let faded = (-2.0 * std::f64::consts::PI.powi(2) * 0.01).exp();
    /// assert!((x[0] - 2.0 * faded).abs() < 1e-14 && (y[0] - 2.0).abs() < 1e-14);
    /// ```
    pub fn mean_error_into(
        &self,
        at: Points<'_>,
        variance_px2: [&[f64]; 2],
        pixel_centre: f64,
        out: PointsMut<'_>,
    ) {
        let n = at.x.len();
        assert_eq!(at.y.len(), n, "x and y of the positions");
        assert_eq!(out.x.len(), n, "positions and x of the output");
        assert_eq!(out.y.len(), n, "positions and y of the output");
        assert!(variance_px2.iter().all(|v| v.len() == n), "variances");
        let offset = 0.5 - pixel_centre;
        for (axis, (at, out)) in [(at.x, out.x), (at.y, out.y)].into_iter().enumerate() {
            for ((out, p), &v) in out.iter_mut().zip(at).zip(variance_px2[axis]) {
                let turns = p + offset;
                *out = match self {
                    Self::None => turns * 0.0,
                    Self::Triangle(t) => t.peak[axis] * triangle::mean_wave(turns, v),
                    Self::Harmonics(s) => s.mean_value(axis, turns, v),
                    Self::GaussianPsf(g) if v > 0.0 => {
                        let at = |node: f64| g.value(axis, turns + node * v.sqrt());
                        let nodes = GAUSS_HERMITE_5.into_iter();
                        nodes.map(|(node, weight)| weight * at(node)).sum()
                    }
                    Self::GaussianPsf(g) => g.value(axis, turns),
                };
            }
        }
    }

    /// Measured positions: `at` plus the errors, which must be in px.
    ///
    /// # Panics
    ///
    /// If the four slices differ in length.
    ///
    /// ```
    /// use centroid::{CentroidError, Triangle};
    /// use focal_plane::{Points, PointsMut};
    ///
    /// let error = CentroidError::Triangle(Triangle::from_peak(0.125));
    /// let (mut x, mut y) = ([0.0], [0.0]);
    /// let at = Points { x: &[1.25], y: &[2.75] };
    /// error.displace_into(at, 0.5, PointsMut { x: &mut x, y: &mut y });
    /// assert_eq!((x, y), ([1.375], [2.625]));
    /// ```
    #[inline]
    pub fn displace_into(&self, at: Points<'_>, pixel_centre: f64, out: PointsMut<'_>) {
        self.each(at, pixel_centre, out, |position, error| position + error);
    }

    /// The same error in another unit, or another size: x and y by their factor.
    ///
    /// ```
    /// use centroid::{CentroidError, GaussianPsf};
    ///
    /// // from px to arcsec
    /// let s_curve = CentroidError::GaussianPsf(GaussianPsf::new(0.4, 3)?).scaled([71.0, 71.0]);
    /// # Ok::<(), centroid::CentroidFailure>(())
    /// ```
    #[must_use]
    pub fn scaled(&self, factor: [f64; 2]) -> Self {
        match self {
            Self::None => Self::None,
            Self::Triangle(triangle) => Self::Triangle(Triangle {
                peak: [triangle.peak[0] * factor[0], triangle.peak[1] * factor[1]],
            }),
            Self::Harmonics(series) => Self::Harmonics(series.scaled(factor)),
            Self::GaussianPsf(psf) => Self::GaussianPsf(psf.scaled(factor)),
        }
    }

    fn at_turns(&self, turns: [f64; 2]) -> [f64; 2] {
        let [x, y] = turns;
        match self {
            Self::None => [x * 0.0, y * 0.0],
            Self::Triangle(t) => [t.peak[0] * triangle::wave(x), t.peak[1] * triangle::wave(y)],
            Self::Harmonics(series) => [series.value(0, x), series.value(1, y)],
            Self::GaussianPsf(psf) => [psf.value(0, x), psf.value(1, y)],
        }
    }

    /// One loop per shape and axis, so that each can be vectorised.
    #[inline(always)] // so that a caller compiled for wider vectors gets them here too
    fn each(
        &self,
        at: Points<'_>,
        pixel_centre: f64,
        out: PointsMut<'_>,
        combine: impl Fn(f64, f64) -> f64,
    ) {
        let n = at.x.len();
        assert_eq!(at.y.len(), n, "x and y of the positions");
        assert_eq!(out.x.len(), n, "positions and x of the output");
        assert_eq!(out.y.len(), n, "positions and y of the output");
        let offset = 0.5 - pixel_centre;
        for (axis, (at, out)) in [(at.x, out.x), (at.y, out.y)].into_iter().enumerate() {
            match self {
                Self::None => map(at, out, |p| combine(p, (p + offset) * 0.0)),
                Self::Triangle(t) => {
                    let peak = t.peak[axis];
                    map(at, out, |p| combine(p, peak * triangle::wave(p + offset)));
                }
                Self::Harmonics(s) => map(at, out, |p| combine(p, s.value(axis, p + offset))),
                Self::GaussianPsf(g) => map(at, out, |p| combine(p, g.value(axis, p + offset))),
            }
        }
    }
}

#[inline(always)] // as above
fn map(at: &[f64], out: &mut [f64], f: impl Fn(f64) -> f64) {
    for (out, &p) in out.iter_mut().zip(at) {
        *out = f(p);
    }
}
