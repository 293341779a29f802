//! The field prepared for one camera: pixel positions in, pixel positions out.
//!
//! ```text
//! x' = x + F1(2 x / M_p, 2 y / N_p) / s_x,    y' = y + F2(2 x / M_p, 2 y / N_p) / s_y
//! ```
//!
//! with s the arcsec per pixel at the centre of the field. The way back solves the same equations
//! for (x, y) by repeated substitution, which contracts as long as the field's slope is below one
//! pixel per pixel; residual distortions have slopes near 1e-3.
//!
//! Source: [M23] Eq. 2, 3 and 9, Step 2.

use focal_plane::{Camera, Pixel, Points, PointsMut};

use crate::error::DistortionError;
use crate::field::DistortionField;
use crate::polynomial;

/// Substitutions before the way back gives up.
const MAX_ITERATIONS: u32 = 60;
/// The way back stops when a step is this small, px: far below any centroid.
const STEP_PX: f64 = 1e-12;

/// A [`DistortionField`] with the units of one camera folded in.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelDistortion {
    width: usize,
    a_px: Vec<f64>,
    b_px: Vec<f64>,
    per_px: [f64; 2],
}

impl DistortionField {
    /// Prepares the field for pixel positions of `camera`.
    pub fn for_camera(&self, camera: &Camera) -> PixelDistortion {
        let [scale_x, scale_y] = camera.arcsec_per_px();
        PixelDistortion {
            width: self.order() + 1,
            a_px: self.a().iter().map(|c| c / scale_x).collect(),
            b_px: self.b().iter().map(|c| c / scale_y).collect(),
            per_px: camera.half_size_px().map(|half| 1.0 / half),
        }
    }
}

impl PixelDistortion {
    /// Displacement at one ideal position, px.
    pub fn shift_px(&self, at: Pixel) -> [f64; 2] {
        let [x, y] = [at.x * self.per_px[0], at.y * self.per_px[1]];
        let ([dx], [dy]) = polynomial::lanes(self.width, &self.a_px, &self.b_px, &[x], &[y]);
        [dx, dy]
    }

    /// Moves ideal positions to distorted ones, both in centred pixels; NaN stays NaN.
    ///
    /// # Panics
    ///
    /// If the four slices differ in length.
    #[inline]
    pub fn distort_into(&self, ideal: Points<'_>, distorted: PointsMut<'_>) {
        let [per_x, per_y] = self.per_px;
        polynomial::in_blocks(ideal, distorted, |x, y| {
            let (xn, yn) = (x.map(|v| v * per_x), y.map(|v| v * per_y));
            let (mut dx, mut dy) = polynomial::lanes(self.width, &self.a_px, &self.b_px, &xn, &yn);
            for l in 0..x.len() {
                dx[l] += x[l];
                dy[l] += y[l];
            }
            (dx, dy)
        });
    }

    /// Moves distorted positions back to ideal ones, both in centred pixels; NaN stays NaN.
    /// Returns the largest number of substitutions that a row took.
    ///
    /// # Errors
    ///
    /// [`DistortionError::NotConverged`] with the first row that did not settle, as with a field
    /// whose slope is above one pixel per pixel. The output is then incomplete.
    ///
    /// # Panics
    ///
    /// If the four slices differ in length.
    ///
    /// ```
    /// use distortion::DistortionField;
    /// use focal_plane::{Camera, Pixel, Points, PointsMut};
    ///
    /// let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0])?;
    /// let field = DistortionField::from_coefficients(1, &[0., 0., 30., 0.], &[5., -20., 0., 0.])?;
    /// let lens = field.for_camera(&camera);
    /// let [dx, dy] = lens.shift_px(Pixel { x: 100.0, y: -300.0 });
    /// let (mut x, mut y) = ([0.0], [0.0]);
    /// lens.undistort_into(
    ///     Points { x: &[100.0 + dx], y: &[-300.0 + dy] },
    ///     PointsMut { x: &mut x, y: &mut y },
    /// )?;
    /// assert!((x[0] - 100.0).abs() < 1e-10 && (y[0] + 300.0).abs() < 1e-10);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn undistort_into(
        &self,
        distorted: Points<'_>,
        ideal: PointsMut<'_>,
    ) -> Result<u32, DistortionError> {
        let n = distorted.x.len();
        assert_eq!(distorted.y.len(), n, "x and y of the positions");
        assert_eq!(ideal.x.len(), n, "positions and x of the output");
        assert_eq!(ideal.y.len(), n, "positions and y of the output");
        let mut most = 0;
        for row in 0..n {
            let target = Pixel {
                x: distorted.x[row],
                y: distorted.y[row],
            };
            let (at, iterations) = self.undistort(target, row)?;
            (ideal.x[row], ideal.y[row]) = (at.x, at.y);
            most = most.max(iterations);
        }
        Ok(most)
    }

    /// One row of [`undistort_into`](Self::undistort_into).
    fn undistort(&self, target: Pixel, row: usize) -> Result<(Pixel, u32), DistortionError> {
        if target.x.is_nan() || target.y.is_nan() {
            let (x, y) = (f64::NAN, f64::NAN);
            return Ok((Pixel { x, y }, 0));
        }
        // a step cannot become smaller than the rounding of the position itself
        let enough = STEP_PX.max(4.0 * f64::EPSILON * target.x.abs().max(target.y.abs()));
        let mut at = target;
        let mut step_px = f64::INFINITY;
        for iteration in 1..=MAX_ITERATIONS {
            let [dx, dy] = self.shift_px(at);
            let next = Pixel {
                x: target.x - dx,
                y: target.y - dy,
            };
            step_px = (next.x - at.x).hypot(next.y - at.y);
            at = next;
            if step_px <= enough {
                return Ok((at, iteration));
            }
        }
        Err(DistortionError::NotConverged {
            row,
            step_px,
            iterations: MAX_ITERATIONS,
        })
    }
}
