//! Measured attitudes against a better estimate.
//!
//! ```text
//! theta = log(q_meas q_ref^-1)        rad, tracker axes
//! ```
//!
//! A time that the better estimate does not cover has no residual: it is counted, never extrapolated.
//!
//! Source: \[M23\] section 4, residuals by differencing quaternions.

use nalgebra::UnitQuaternion;

use super::{AttitudeSource, rotation_vector};

/// Residual rotation of many attitudes, structure of arrays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AttitudeResidual {
    /// Times that the reference covers, s.
    pub t_s: Vec<f64>,
    /// Residual about x, y, z at these times, rad.
    pub theta_rad: [Vec<f64>; 3],
    /// Attitudes that the reference does not cover.
    pub outside_reference: usize,
}

impl AttitudeResidual {
    /// Differences `q`, at `t_s`, against the reference.
    ///
    /// ```
    /// use focal_plane::{AttitudeResidual, UniformRotation, rotation_from_vector};
    /// use nalgebra::Vector3;
    /// let q = [rotation_from_vector(&Vector3::new(1e-6, 0.0, -2e-6))];
    /// let residual = AttitudeResidual::against(&[3.0], &q, &UniformRotation::default());
    /// assert!((residual.theta_rad[2][0] + 2e-6).abs() < 1e-15);
    /// ```
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    #[must_use]
    pub fn against(t_s: &[f64], q: &[UnitQuaternion<f64>], reference: &dyn AttitudeSource) -> Self {
        assert_eq!(t_s.len(), q.len(), "one attitude for each time");
        let mut out = Self::default();
        for (&t, q) in t_s.iter().zip(q) {
            let Some(better) = reference.attitude(t) else {
                out.outside_reference += 1;
                continue;
            };
            out.t_s.push(t);
            let theta = rotation_vector(q, &better);
            for (axis, column) in out.theta_rad.iter_mut().enumerate() {
                column.push(theta[axis]);
            }
        }
        out
    }
}
