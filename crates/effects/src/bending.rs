//! Effects that turn the tracker as a whole by functions of time.
//!
//! ```text
//! theta_a(t) = sum_k c_ak g_k(t),    a = x, y, z       arcsec, tracker axes
//! dP = J(P) theta                                      J: focal_plane::Camera::rotation_jacobian
//! ```
//!
//! The coefficients are ordered axis by axis, and within an axis by k. As a residual of the attitude,
//! theta is the error `log(q_meas q_ref^-1)` itself: `v_meas = v + theta x v`.
//!
//! Source: \[M23\] Section 4.3 for why the frame bends; the Jacobian is that of `focal_plane::Camera`.

use core::fmt::Debug;
use std::collections::BTreeMap;

use focal_plane::{ARCSEC_PER_RAD, Camera, PointsMut, VectorsMut};
use nalgebra::Vector3;
use star_tracker::{Disturbance, Stages};

use crate::candidate::check_columns;
use crate::shift::sizes;
use crate::{
    AttitudeRows, Candidate, Coefficient, Effect, EffectError, Nonlinear, Parameter, StarRows,
    Surroundings, Twin,
};

/// Most functions of time of one effect.
pub(crate) const MAX_FUNCTIONS: usize = 2;

/// The functions of time of one effect.
pub(crate) trait Bending: Clone + Debug + Send + Sync + 'static {
    /// Identity in the catalogue.
    fn id(&self) -> &'static str;
    /// Coefficients: axis by axis, within an axis by function.
    fn coefficients(&self) -> Vec<Coefficient>;
    /// How many functions.
    fn functions(&self) -> usize;
    /// `g_k` at a time.
    fn at(&self, t_s: f64, out: &mut [f64]);
    /// Parameters that are not coefficients.
    fn fixed(&self) -> Vec<Parameter> {
        Vec::new()
    }
    /// What tells it from others of its kind.
    fn selectors(&self) -> BTreeMap<String, String> {
        BTreeMap::new()
    }
    /// Non-linear parameters.
    fn nonlinear(&self) -> Vec<Nonlinear> {
        Vec::new()
    }
    /// See [`Candidate::stands_for`].
    fn stands_for(&self) -> f64 {
        1.0
    }
    /// See [`Candidate::twin`].
    fn twin(&self) -> Option<Twin> {
        None
    }
    /// With other non-linear parameters.
    fn with_nonlinear(&self, values: &[f64]) -> Option<Self> {
        let _ = values;
        None
    }
}

/// A bending with its values, arcsec.
#[derive(Clone, Debug)]
pub(crate) struct Bent<B> {
    pub(crate) bending: B,
    pub(crate) values: Vec<f64>,
}

impl<B: Bending> Disturbance for Bent<B> {
    fn stages(&self) -> Stages {
        Stages {
            attitude: true,
            ..Stages::NONE
        }
    }
    fn misalignment_rad(&self, t_s: f64) -> Vector3<f64> {
        let mut g = [0.0; MAX_FUNCTIONS];
        let n = self.bending.functions();
        self.bending.at(t_s, &mut g[..n]);
        let axis = |a: usize| (0..n).map(|k| self.values[a * n + k] * g[k]).sum::<f64>();
        Vector3::new(axis(0), axis(1), axis(2)) / ARCSEC_PER_RAD
    }
}

impl<B: Bending> Effect for Bent<B> {
    fn id(&self) -> &'static str {
        self.bending.id()
    }
    fn parameters(&self) -> Vec<Parameter> {
        let mut all = sizes(self.bending.coefficients(), &self.values);
        all.extend(self.bending.fixed());
        all
    }
    fn selectors(&self) -> BTreeMap<String, String> {
        self.bending.selectors()
    }
}

/// A bending of unknown size.
#[derive(Clone, Debug)]
pub(crate) struct BendingCandidate<B> {
    bending: B,
    coefficients: Vec<Coefficient>,
}

impl<B: Bending> BendingCandidate<B> {
    pub(crate) fn boxed(bending: B) -> Box<dyn Candidate> {
        let coefficients = bending.coefficients();
        Box::new(Self {
            bending,
            coefficients,
        })
    }
}

impl<B: Bending> Candidate for BendingCandidate<B> {
    fn id(&self) -> &'static str {
        self.bending.id()
    }
    fn selectors(&self) -> BTreeMap<String, String> {
        self.bending.selectors()
    }
    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }
    fn nonlinear(&self) -> Vec<Nonlinear> {
        self.bending.nonlinear()
    }
    fn stands_for(&self) -> f64 {
        self.bending.stands_for()
    }
    fn twin(&self) -> Option<Twin> {
        self.bending.twin()
    }
    fn with_nonlinear(&self, values: &[f64]) -> Option<Box<dyn Candidate>> {
        assert_eq!(
            values.len(),
            self.nonlinear().len(),
            "one value per non-linear parameter"
        );
        self.bending.with_nonlinear(values).map(Self::boxed)
    }
    fn acts_on_stars(&self) -> bool {
        true
    }
    fn acts_on_attitude(&self) -> bool {
        true
    }
    fn turns_camera(&self) -> bool {
        true
    }
    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        let (n, functions) = (rows.len(), self.bending.functions());
        check_columns(self.coefficients.len(), n, out.x.len());
        let mut g = [0.0; MAX_FUNCTIONS];
        for i in 0..n {
            // rows of one frame share their time
            if i == 0 || rows.t_s[i].to_bits() != rows.t_s[i - 1].to_bits() {
                self.bending.at(rows.t_s[i], &mut g[..functions]);
            }
            let [jx, jy] = camera.rotation_jacobian(rows.at(i));
            for axis in 0..3 {
                for (k, g) in g[..functions].iter().enumerate() {
                    let j = axis * functions + k;
                    out.x[j * n + i] = jx[axis] * g / ARCSEC_PER_RAD;
                    out.y[j * n + i] = jy[axis] * g / ARCSEC_PER_RAD;
                }
            }
        }
        true
    }
    fn attitude_columns(&self, rows: &AttitudeRows<'_>, out: VectorsMut<'_>) -> bool {
        let (n, functions) = (rows.len(), self.bending.functions());
        check_columns(self.coefficients.len(), n, out.x.len());
        out.x.fill(0.0);
        out.y.fill(0.0);
        out.z.fill(0.0);
        let mut g = [0.0; MAX_FUNCTIONS];
        for (i, &t_s) in rows.t_s.iter().enumerate() {
            self.bending.at(t_s, &mut g[..functions]);
            for (k, g) in g[..functions].iter().enumerate() {
                out.x[k * n + i] = g / ARCSEC_PER_RAD;
                out.y[(functions + k) * n + i] = g / ARCSEC_PER_RAD;
                out.z[(2 * functions + k) * n + i] = g / ARCSEC_PER_RAD;
            }
        }
        true
    }
    fn realise(
        &self,
        values: &[f64],
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        assert_eq!(
            values.len(),
            self.coefficients.len(),
            "one value per coefficient"
        );
        Ok(Box::new(Bent {
            bending: self.bending.clone(),
            values: values.to_vec(),
        }))
    }
}
