//! Pinhole camera.
//!
//! ```text
//! x = f_x X/Z,   y = f_y Y/Z          centred pixels, Z out of the boresight
//! f_x = (n_x/2) / tan(fov_x/2)        focal length in pixels, the same for y
//! phase = 2 pi frac(P + 0.5 - pixel_centre)
//! ```
//!
//! A star at tangent-plane position (x, y) moves, under a small rotation theta of the whole
//! attitude in tracker axes (v' = v + theta x v), by f times
//!
//! ```text
//! dx =  theta_y (1 + x^2) - theta_x x y - theta_z y
//! dy = -theta_x (1 + y^2) + theta_y x y + theta_z x
//! ```
//!
//! which is d(X/Z), d(Y/Z) with (dX, dY, dZ) = theta x (x, y, 1).
//!
//! Source: \[M23\] Eq. 1 (pinhole), Eq. 9 (pixel phase).

use std::f64::consts::TAU;

use nalgebra::Vector3;

use crate::{
    ARCSEC_PER_RAD, Angle, Normalised, Pixel, Points, PointsMut, Tangent, Vectors, VectorsMut,
};

/// Largest relative difference of the two focal lengths that a field of view may imply.
const FOCAL_LENGTH_TOLERANCE: f64 = 0.005;

/// Why a camera cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// An axis has no pixels.
    #[error("detector of {columns} x {rows} px has an axis without pixels")]
    NoPixels {
        /// Pixels along x.
        columns: u32,
        /// Pixels along y.
        rows: u32,
    },
    /// A field of view that a pinhole cannot have.
    #[error("field of view {deg} deg on axis {axis} must lie between 0 and 180 deg")]
    FieldOfView {
        /// `x` or `y`.
        axis: char,
        /// The value given, deg.
        deg: f64,
    },
    /// A focal length that is not positive.
    #[error("focal length {px} px must be finite and positive")]
    FocalLength {
        /// The value given, px.
        px: f64,
    },
    /// The two axes imply different focal lengths.
    #[error(
        "fields of view imply focal lengths of {x_px} px on x and {y_px} px on y, which differ by more than 0.5 %"
    )]
    AxesDiffer {
        /// From the x axis, px.
        x_px: f64,
        /// From the y axis, px.
        y_px: f64,
    },
    /// A pixel centre other than the two conventions.
    #[error(
        "pixel_centre = {value} must be 0.5 (whole numbers are edges) or 0.0 (whole numbers are centres)"
    )]
    PixelCentre {
        /// The value given.
        value: f64,
    },
}

/// A pinhole camera: detector size, focal length, and where pixel centres lie.
///
/// ```
/// use focal_plane::{Camera, Pixel};
/// let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0])?;
/// assert!((camera.arcsec_per_px()[0] - 71.0).abs() < 0.05);
/// let corner = Pixel { x: 512.0, y: -512.0 };
/// assert!(camera.contains(corner));
/// let back = camera.project(&camera.direction(corner)).expect("in front");
/// assert!((back.x - 512.0).abs() < 1e-12);
/// # Ok::<(), focal_plane::CameraError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    pixels: [u32; 2],
    focal_length_px: [f64; 2],
    pixel_centre: f64,
}

impl Camera {
    /// From the size of the detector and its whole field of view on each axis, deg.
    ///
    /// # Errors
    ///
    /// No pixels, a field of view outside (0, 180) deg, or two axes whose focal lengths differ by
    /// more than 0.5 %.
    pub fn from_fov_deg(pixels: [u32; 2], fov_deg: [f64; 2]) -> Result<Self, CameraError> {
        for (axis, deg) in ['x', 'y'].into_iter().zip(fov_deg) {
            if !(deg > 0.0 && deg < 180.0) {
                return Err(CameraError::FieldOfView { axis, deg });
            }
        }
        let focal =
            |k: usize| 0.5 * f64::from(pixels[k]) / (0.5 * Angle::from_deg(fov_deg[k]).rad()).tan();
        let [x_px, y_px] = [focal(0), focal(1)];
        let camera = Self::build(pixels, [x_px, y_px])?;
        if (x_px - y_px).abs() > FOCAL_LENGTH_TOLERANCE * x_px.min(y_px) {
            return Err(CameraError::AxesDiffer { x_px, y_px });
        }
        Ok(camera)
    }

    /// From the size of the detector and one focal length for both axes, px.
    ///
    /// # Errors
    ///
    /// No pixels, or a focal length that is not finite and positive.
    pub fn from_focal_length_px(
        pixels: [u32; 2],
        focal_length_px: f64,
    ) -> Result<Self, CameraError> {
        Self::build(pixels, [focal_length_px; 2])
    }

    fn build(pixels: [u32; 2], focal_length_px: [f64; 2]) -> Result<Self, CameraError> {
        let [columns, rows] = pixels;
        if columns == 0 || rows == 0 {
            return Err(CameraError::NoPixels { columns, rows });
        }
        for px in focal_length_px {
            if !(px.is_finite() && px > 0.0) {
                return Err(CameraError::FocalLength { px });
            }
        }
        Ok(Self {
            pixels,
            focal_length_px,
            pixel_centre: 0.5,
        })
    }

    /// The same camera with pixel centres at half-integers (0.5, the default) or at whole numbers
    /// (0.0).
    ///
    /// # Errors
    ///
    /// Any other value.
    pub fn with_pixel_centre(mut self, pixel_centre: f64) -> Result<Self, CameraError> {
        #[expect(clippy::float_cmp, reason = "two named conventions, not a measurement")]
        let known = pixel_centre == 0.5 || pixel_centre == 0.0;
        if !known {
            return Err(CameraError::PixelCentre {
                value: pixel_centre,
            });
        }
        self.pixel_centre = pixel_centre;
        Ok(self)
    }

    /// Pixels along x and y.
    #[must_use]
    pub fn pixels(&self) -> [u32; 2] {
        self.pixels
    }

    /// Focal length along x and y, px.
    #[must_use]
    pub fn focal_length_px(&self) -> [f64; 2] {
        self.focal_length_px
    }

    /// Whole field of view along x and y, `2 atan(n/2 / f)`.
    #[must_use]
    pub fn fov(&self) -> [Angle; 2] {
        let half = self.half_size_px();
        [0, 1].map(|k| Angle::from_rad(2.0 * half[k].atan2(self.focal_length_px[k])))
    }

    /// Where pixel centres lie: 0.5 at half-integers, 0.0 at whole numbers.
    #[must_use]
    pub fn pixel_centre(&self) -> f64 {
        self.pixel_centre
    }

    /// Half of the detector along x and y, px: where its edges are.
    #[must_use]
    pub fn half_size_px(&self) -> [f64; 2] {
        self.pixels.map(|n| 0.5 * f64::from(n))
    }

    /// Scale at the centre along x and y, arcsec per pixel: the scale of all residuals.
    #[must_use]
    pub fn arcsec_per_px(&self) -> [f64; 2] {
        self.focal_length_px.map(|f| ARCSEC_PER_RAD / f)
    }

    /// Whether a point lies on the detector, edges included; never for NaN.
    #[must_use]
    pub fn contains(&self, p: Pixel) -> bool {
        let [half_x, half_y] = self.half_size_px();
        p.x.abs() <= half_x && p.y.abs() <= half_y
    }

    /// From the tangent plane to pixels.
    #[must_use]
    pub fn pixel(&self, t: Tangent) -> Pixel {
        let [fx, fy] = self.focal_length_px;
        Pixel {
            x: fx * t.x,
            y: fy * t.y,
        }
    }

    /// From pixels to the tangent plane.
    #[must_use]
    pub fn tangent(&self, p: Pixel) -> Tangent {
        let [fx, fy] = self.focal_length_px;
        Tangent {
            x: p.x / fx,
            y: p.y / fy,
        }
    }

    /// From pixels to -1..1 over the detector.
    #[must_use]
    pub fn normalised(&self, p: Pixel) -> Normalised {
        let [half_x, half_y] = self.half_size_px();
        Normalised {
            x: p.x / half_x,
            y: p.y / half_y,
        }
    }

    /// From -1..1 over the detector to pixels.
    #[must_use]
    pub fn from_normalised(&self, n: Normalised) -> Pixel {
        let [half_x, half_y] = self.half_size_px();
        Pixel {
            x: n.x * half_x,
            y: n.y * half_y,
        }
    }

    /// Where a direction in tracker axes falls (\[M23\] Eq. 1); `None` unless Z > 0. The vector need
    /// not be of unit length, and the point need not lie on the detector.
    #[must_use]
    pub fn project(&self, v: &Vector3<f64>) -> Option<Pixel> {
        let [x, y] = pinhole(self.focal_length_px, v.x, v.y, v.z);
        (v.z > 0.0).then_some(Pixel { x, y })
    }

    /// Unit vector in tracker axes towards a point.
    #[must_use]
    pub fn direction(&self, p: Pixel) -> Vector3<f64> {
        let [x, y, z] = ray(self.focal_length_px, p.x, p.y);
        Vector3::new(x, y, z)
    }

    /// Phase of a coordinate within its pixel, `2 pi frac(P + 0.5 - pixel_centre)`, rad in
    /// [0, 2 pi): zero at a pixel's edge if centres are at half-integers, pi at its centre.
    #[must_use]
    pub fn phase_rad(&self, p_px: f64) -> f64 {
        phase(p_px, 0.5 - self.pixel_centre)
    }

    /// [`phase_rad`](Self::phase_rad) of a column.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn phase_into(&self, p_px: &[f64], out_rad: &mut [f64]) {
        assert_eq!(p_px.len(), out_rad.len(), "one phase for each coordinate");
        let shift = 0.5 - self.pixel_centre;
        for (out, &p) in out_rad.iter_mut().zip(p_px) {
            *out = phase(p, shift);
        }
    }

    /// [`project`](Self::project) of many directions; both coordinates are NaN unless Z > 0.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn project_into(&self, v: Vectors<'_>, out: PointsMut<'_>) {
        let n = v.len();
        assert_eq!(n, out.len(), "one point for each direction");
        let (vx, vy, vz) = (&v.x[..n], &v.y[..n], &v.z[..n]);
        let (out_x, out_y) = (&mut out.x[..n], &mut out.y[..n]);
        for i in 0..n {
            let [x, y] = pinhole(self.focal_length_px, vx[i], vy[i], vz[i]);
            out_x[i] = x;
            out_y[i] = y;
        }
    }

    /// [`direction`](Self::direction) of many points.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn direction_into(&self, p: Points<'_>, out: VectorsMut<'_>) {
        let n = p.len();
        assert_eq!(n, out.len(), "one direction for each point");
        let (px, py) = (&p.x[..n], &p.y[..n]);
        let (out_x, out_y, out_z) = (&mut out.x[..n], &mut out.y[..n], &mut out.z[..n]);
        for i in 0..n {
            let [x, y, z] = ray(self.focal_length_px, px[i], py[i]);
            out_x[i] = x;
            out_y[i] = y;
            out_z[i] = z;
        }
    }

    /// Shift of a star at `p` with a small rotation of the attitude, tracker axes:
    /// `[[dx/dtheta_x, dx/dtheta_y, dx/dtheta_z], [dy/...]]`, px per rad.
    ///
    /// ```
    /// use focal_plane::{Camera, Pixel};
    /// let camera = Camera::from_focal_length_px([1024, 1024], 2900.0)?;
    /// let j = camera.rotation_jacobian(Pixel::default());
    /// assert_eq!(j, [[0.0, 2900.0, 0.0], [-2900.0, 0.0, 0.0]]);
    /// # Ok::<(), focal_plane::CameraError>(())
    /// ```
    #[must_use]
    pub fn rotation_jacobian(&self, p: Pixel) -> [[f64; 3]; 2] {
        rotation_jacobian(self.focal_length_px, p.x, p.y)
    }

    /// [`rotation_jacobian`](Self::rotation_jacobian) of many points, one column for each
    /// derivative, px per rad.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn rotation_jacobian_into(&self, p: Points<'_>, out: [VectorsMut<'_>; 2]) {
        let n = p.len();
        let [along_x, along_y] = out;
        assert_eq!(n, along_x.len(), "one x derivative for each point");
        assert_eq!(n, along_y.len(), "one y derivative for each point");
        let (px, py) = (&p.x[..n], &p.y[..n]);
        let (xx, xy, xz) = (
            &mut along_x.x[..n],
            &mut along_x.y[..n],
            &mut along_x.z[..n],
        );
        let (yx, yy, yz) = (
            &mut along_y.x[..n],
            &mut along_y.y[..n],
            &mut along_y.z[..n],
        );
        for i in 0..n {
            let [dx, dy] = rotation_jacobian(self.focal_length_px, px[i], py[i]);
            [xx[i], xy[i], xz[i]] = dx;
            [yx[i], yy[i], yz[i]] = dy;
        }
    }
}

/// One division for both axes; NaN behind the camera, as a select and not a branch.
#[inline]
fn pinhole([fx, fy]: [f64; 2], x: f64, y: f64, z: f64) -> [f64; 2] {
    let inverse = if z > 0.0 { 1.0 / z } else { f64::NAN };
    [fx * (x * inverse), fy * (y * inverse)]
}

#[inline]
fn ray([fx, fy]: [f64; 2], x_px: f64, y_px: f64) -> [f64; 3] {
    // reciprocals leave a loop over stars, divisions would not
    let (x, y) = (x_px * (1.0 / fx), y_px * (1.0 / fy));
    let scale = 1.0 / (1.0 + x * x + y * y).sqrt();
    [x * scale, y * scale, scale]
}

/// Adding and taking away 1.5 * 2^52 rounds to the nearest whole number, for coordinates up to
/// 2^51; unlike `floor` it is two plain additions on every processor.
const WHOLE: f64 = 6_755_399_441_055_744.0;

#[inline]
fn phase(p_px: f64, shift: f64) -> f64 {
    let p = p_px + shift;
    let past = p - ((p + WHOLE) - WHOLE);
    let fraction = if past < 0.0 { past + 1.0 } else { past };
    // -1e-20 + 1 rounds to 1, which is the same phase as 0
    let fraction = if fraction >= 1.0 { 0.0 } else { fraction };
    TAU * fraction
}

#[inline]
fn rotation_jacobian([fx, fy]: [f64; 2], x_px: f64, y_px: f64) -> [[f64; 3]; 2] {
    let (x, y) = (x_px / fx, y_px / fy);
    [
        [-fx * x * y, fx * (1.0 + x * x), -fx * y],
        [-fy * (1.0 + y * y), fy * x * y, fy * x],
    ]
}
