//! Torque-free rotation of a rigid body, and small torques on it.
//!
//! ```text
//! h(t) = h0 + n t                  angular momentum, inertial; n = 0 without torque
//! w    = J^-1 (q h)                rate of the body, body axes
//! q(t + s) = exp(phi(s)) q(t),     phi' = -J_l^-1(phi) w          v_body = q v_inertial
//! J    = IT [1 + a, b, 0; b, 1 - a, 0; 0, 0, r]
//! ```
//!
//! Only ratios of the moments of inertia act: `r = I3/IT`, `IT` the mean of the transverse moments, and
//! `a`, `b` the triaxiality, `a = (Ix - Iy) / (Ix + Iy)` for principal axes. Angular momentum is in
//! units of IT, rad/s. The axisymmetric body without torque has a closed form, [`axisymmetric`]; any
//! other is integrated, [`Body::motion`].
//!
//! Source: [A01] Eq. 3; Wertz, Spacecraft Attitude Determination and Control (1978), Section 16.2.

mod axisymmetric;
mod integrated;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::AssessError;

pub use axisymmetric::{NutationRates, axisymmetric, nutation_rates};

/// Ratios of the moments of inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// `I3 / IT`: below 1 a pencil, up to 2 a disc.
    pub axial_ratio: f64,
    /// `a` and `b` of the triaxiality, relative to IT.
    pub triaxial: [f64; 2],
}

impl Inertia {
    /// From principal moments about body x, y, z in any unit.
    ///
    /// # Errors
    /// [`AssessError::Inertia`]: not positive, or against the triangle inequality.
    ///
    /// ```
    /// // IMAGE, [A01]: x and y differ by 0.15 percent, not by 7
    /// let image = assess::Inertia::principal([14710.5, 14688.8, 29041.9])?;
    /// assert!((2.0 * image.triaxial[0] - 0.00148).abs() < 1e-5);
    /// # Ok::<(), assess::AssessError>(())
    /// ```
    pub fn principal(moments: [f64; 3]) -> Result<Self, AssessError> {
        let [x, y, z] = moments;
        let fits = moments.iter().all(|m| m.is_finite() && *m > 0.0)
            && x <= y + z
            && y <= x + z
            && z <= x + y;
        if !fits {
            return Err(AssessError::Inertia(moments));
        }
        Ok(Self {
            axial_ratio: 2.0 * z / (x + y),
            triaxial: [(x - y) / (x + y), 0.0],
        })
    }

    /// Without the triaxiality.
    #[must_use]
    pub fn axisymmetric(self) -> Self {
        Self {
            triaxial: [0.0; 2],
            ..self
        }
    }

    /// The tensor over IT.
    #[must_use]
    pub fn tensor(&self) -> Matrix3<f64> {
        let [a, b] = self.triaxial;
        Matrix3::new(1.0 + a, b, 0.0, b, 1.0 - a, 0.0, 0.0, 0.0, self.axial_ratio)
    }

    fn inverse(&self) -> Matrix3<f64> {
        let [a, b] = self.triaxial;
        let det = 1.0 - a * a - b * b;
        let (diagonal, off) = ([(1.0 - a) / det, (1.0 + a) / det], -b / det);
        Matrix3::new(
            diagonal[0],
            off,
            0.0,
            off,
            diagonal[1],
            0.0,
            0.0,
            0.0,
            1.0 / self.axial_ratio,
        )
    }
}

/// A rigid body in motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Its moments of inertia.
    pub inertia: Inertia,
    /// Attitude at t = 0, inertial to body.
    pub epoch: UnitQuaternion<f64>,
    /// Rate at t = 0, body axes, rad/s.
    pub rate_rad_s: Vector3<f64>,
    /// Torque over IT, inertial axes, constant, rad/s^2.
    pub torque_rad_s2: Vector3<f64>,
}

impl Body {
    /// Angular momentum at t = 0 over IT, body axes, rad/s.
    #[must_use]
    pub fn momentum_rad_s(&self) -> Vector3<f64> {
        self.inertia.tensor() * self.rate_rad_s
    }

    /// Twice the kinetic energy over IT at a rate, rad^2/s^2.
    #[must_use]
    pub fn twice_energy(&self, rate_rad_s: &Vector3<f64>) -> f64 {
        rate_rad_s.dot(&(self.inertia.tensor() * rate_rad_s))
    }

    /// Angle between angular momentum and body z at t = 0, rad: the nutation of an axisymmetric body.
    #[must_use]
    pub fn nutation_rad(&self) -> f64 {
        let l = self.momentum_rad_s();
        l.xy().norm().atan2(l.z.abs())
    }
}
