//! A rotating body as a tracker sees it: what is fitted to the quaternions.
//!
//! ```text
//! q_obs,body = B q_obs          B: tracker to body, alignment times misalignment       [A01] Eq. 2
//! e = log(q_obs,body q_mod^-1) - oscillations + w dt(t)         body axes              [A01] Eq. 4
//! r = B^-1 e / sigma            tracker axes; sigma = 1 is the loss of [A01] Eq. 5
//! ```
//!
//! `B` is turned about body x and y only: a turn about body z is the phase of the spin, which the
//! attitude at the epoch absorbs. An oscillation turns the tracker against the body that spins,
//! `c cos(2 pi f t) + s sin(2 pi f t)` about each body axis; a time-tag step `dt` from `at_s` on makes
//! a frame stamped t show the attitude of t + dt.
//!
//! Source: [A01] Eqs. 2 to 5.

mod free;

use focal_plane::{Angle, AttitudeSource, rotation_from_vector, rotation_vector};
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};

use crate::least_squares::{Minimum, Problem, minimise};
use crate::rotator::{Body, axisymmetric};
use crate::{AssessError, Observed};

pub use free::Free;

/// An oscillation of the tracker against the body, in body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillation {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Cosine amplitudes about body x, y, z, rad.
    pub cos_rad: Vector3<f64>,
    /// Sine amplitudes about body x, y, z, rad.
    pub sin_rad: Vector3<f64>,
}

/// A step of the time tags.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeTagStep {
    /// From here on, s of the bundle.
    pub at_s: f64,
    /// A frame stamped t shows the attitude of t plus this, s.
    pub offset_s: f64,
}

/// Everything that the model holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Rotating {
    /// The body; its t = 0 is the epoch.
    pub body: Body,
    /// Tracker to body.
    pub to_body: UnitQuaternion<f64>,
    /// Oscillations.
    pub oscillations: Vec<Oscillation>,
    /// Steps of the time tags.
    pub steps: Vec<TimeTagStep>,
}

/// Attitude (inertial to body) and rate (body axes) at many times.
struct Path {
    q: Vec<UnitQuaternion<f64>>,
    rate: Vec<Vector3<f64>>,
}

/// A fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model at its best.
    pub model: Rotating,
    /// What was free.
    pub free: Vec<Free>,
    /// 1 sigma of each, in the unit of [`Free::unit`].
    pub sigma: Vec<f64>,
    /// Covariance of all of them.
    pub(crate) covariance: DMatrix<f64>,
    /// Residual about the tracker's axes, arcsec.
    pub residual_arcsec: [Vec<f64>; 3],
    /// Whitened, three rows to a frame, and its derivatives.
    pub(crate) minimum: Minimum,
}

/// Fits models to one set of frames.
#[derive(Clone, Debug)]
pub struct Fitter<'a> {
    observed: &'a Observed,
    epoch_s: f64,
    sigma_arcsec: [f64; 3],
    /// Frames over which residuals may go together.
    lags: usize,
}

impl<'a> Fitter<'a> {
    /// With the loss of \[A01\] Eq. 5: every axis counts alike. The epoch is given, s of the bundle.
    #[must_use]
    pub fn new(observed: &'a Observed, epoch_s: f64) -> Self {
        Self {
            observed,
            epoch_s,
            sigma_arcsec: [1.0; 3],
            lags: 0,
        }
    }

    /// Weighs the tracker's axes by their noise, arcsec.
    #[must_use]
    pub fn weighted(self, sigma_arcsec: [f64; 3]) -> Self {
        Self {
            sigma_arcsec,
            ..self
        }
    }

    /// Lets uncertainties hold for residuals that go together over so many frames.
    #[must_use]
    pub fn with_lags(self, lags: usize) -> Self {
        Self { lags, ..self }
    }

    /// The epoch, s of the bundle.
    #[must_use]
    pub fn epoch_s(&self) -> f64 {
        self.epoch_s
    }

    /// The noise by which axes are weighed, arcsec.
    #[must_use]
    pub fn sigma_arcsec(&self) -> [f64; 3] {
        self.sigma_arcsec
    }

    pub(crate) fn observed(&self) -> &Observed {
        self.observed
    }

    fn span_s(&self) -> [f64; 2] {
        let t = &self.observed.t_s;
        let (first, last) = (t[0] - self.epoch_s, t[t.len() - 1] - self.epoch_s);
        [first.min(0.0), last.max(0.0)]
    }

    /// Half the span, s: the scale of times.
    pub(crate) fn half_s(&self) -> f64 {
        let [first, last] = self.span_s();
        0.5 * (last - first)
    }

    fn path(&self, body: &Body) -> Result<Path, AssessError> {
        let times = self.observed.t_s.iter().map(|t| t - self.epoch_s);
        let plain = body.inertia.triaxial.iter().all(|a| a.abs() <= 0.0)
            && body.torque_rad_s2.norm() <= 0.0;
        if plain {
            let inertia = body.inertia;
            let inertial = body.epoch.inverse() * body.momentum_rad_s();
            let (mut q, mut rate) = (vec![], vec![]);
            for t in times {
                let now = axisymmetric(body, t);
                let l = now * inertial;
                rate.push(Vector3::new(l.x, l.y, l.z / inertia.axial_ratio));
                q.push(now);
            }
            return Ok(Path { q, rate });
        }
        let motion = body.motion(self.span_s())?;
        let mut cursor = motion.cursor();
        let (mut q, mut rate) = (vec![], vec![]);
        for t in times {
            let at = cursor.attitude(t).or_else(|| motion.attitude(t));
            let w = motion.rate_rad_s(t);
            let (Some(at), Some(w)) = (at, w) else {
                return Err(AssessError::Fit {
                    what: "a rotating body",
                    reason: "its motion is not finite".into(),
                });
            };
            q.push(at);
            rate.push(w);
        }
        Ok(Path { q, rate })
    }

    /// Residual about body axes, rad.
    fn residual_body(&self, model: &Rotating, path: &Path) -> Vec<Vector3<f64>> {
        let mut out = Vec::with_capacity(self.observed.len());
        for (k, q) in self.observed.q.iter().enumerate() {
            let mut e = rotation_vector(&(model.to_body * q), &path.q[k]);
            let t_s = self.observed.t_s[k];
            for line in &model.oscillations {
                let angle = core::f64::consts::TAU * line.frequency_hz * (t_s - self.epoch_s);
                let (sin, cos) = angle.sin_cos();
                e -= line.cos_rad * cos + line.sin_rad * sin;
            }
            for step in model.steps.iter().filter(|step| t_s >= step.at_s) {
                e += path.rate[k] * step.offset_s;
            }
            out.push(e);
        }
        out
    }

    /// About the tracker's axes, over sigma, three rows to a frame.
    fn whiten(&self, model: &Rotating, e: &[Vector3<f64>]) -> DVector<f64> {
        let back = model.to_body.inverse();
        let mut out = DVector::zeros(3 * e.len());
        for (k, e) in e.iter().enumerate() {
            let r = back * e;
            for axis in 0..3 {
                out[3 * k + axis] = Angle::from_rad(r[axis]).arcsec() / self.sigma_arcsec[axis];
            }
        }
        out
    }

    /// Fits; `what` is its name in errors.
    ///
    /// # Errors
    /// [`AssessError::Fit`] where the data do not determine what is free.
    pub fn fit(
        &self,
        start: &Rotating,
        free: &[Free],
        what: &'static str,
    ) -> Result<Fit, AssessError> {
        let problem = Around {
            fitter: self,
            start,
            free,
        };
        let zero = DVector::zeros(free.len());
        let settled = 1e-7 * (3.0 * self.observed.len() as f64).sqrt();
        let minimum = minimise(&problem, zero, settled, what)?;
        let model = problem.at(&minimum.p);
        let covariance = minimum.covariance(3, self.lags, what)?;
        let units: Vec<f64> = free.iter().map(|f| f.scale(self, &model)).collect();
        let n = free.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] * units[i] * units[j]);
        let sigma = (0..n).map(|i| covariance[(i, i)].max(0.0).sqrt()).collect();
        let residual_arcsec = std::array::from_fn(|axis| {
            let rows = minimum.residuals.iter().skip(axis).step_by(3);
            rows.map(|r| r * self.sigma_arcsec[axis]).collect()
        });
        Ok(Fit {
            model,
            free: free.to_vec(),
            sigma,
            covariance,
            residual_arcsec,
            minimum,
        })
    }

    /// Derivatives of the whitened residuals at a model, one column for each number.
    pub(crate) fn columns(
        &self,
        model: &Rotating,
        free: &[Free],
    ) -> Result<DMatrix<f64>, AssessError> {
        let around = Around {
            fitter: self,
            start: model,
            free,
        };
        around.jacobian(&DVector::zeros(free.len()))
    }

    /// Residuals of a model as it is, tracker axes, arcsec.
    ///
    /// # Errors
    /// A motion that is not finite.
    pub fn residual_arcsec(&self, model: &Rotating) -> Result<[Vec<f64>; 3], AssessError> {
        let path = self.path(&model.body)?;
        let e = self.residual_body(model, &path);
        let back = model.to_body.inverse();
        let mut out: [Vec<f64>; 3] = Default::default();
        for e in &e {
            let r = back * e;
            for (axis, out) in out.iter_mut().enumerate() {
                out.push(Angle::from_rad(r[axis]).arcsec());
            }
        }
        Ok(out)
    }
}

impl Fit {
    /// Residual about body axes, arcsec: those of \[A01\] Fig. 1.
    #[must_use]
    pub fn residual_body_arcsec(&self) -> [Vec<f64>; 3] {
        let [x, y, z] = &self.residual_arcsec;
        let mut out: [Vec<f64>; 3] = Default::default();
        for k in 0..x.len() {
            let e = self.model.to_body * Vector3::new(x[k], y[k], z[k]);
            for (axis, out) in out.iter_mut().enumerate() {
                out.push(e[axis]);
            }
        }
        out
    }

    /// Value and 1 sigma of something that was free, in the unit of [`Free::unit`].
    #[must_use]
    pub fn estimate(&self, which: Free) -> Option<[f64; 2]> {
        let at = self.free.iter().position(|free| *free == which)?;
        Some([which.value(&self.model)?, self.sigma[at]])
    }
}

impl Fit {
    /// The spin axis, inertial: the direction of the angular momentum at the epoch. Right ascension and
    /// declination, each with its 1 sigma, deg.
    #[must_use]
    pub fn spin_axis_deg(&self) -> [[f64; 2]; 2] {
        let direction = |model: &Rotating| {
            let l = model.body.epoch.inverse() * model.body.momentum_rad_s();
            let ra = l.y.atan2(l.x).to_degrees().rem_euclid(360.0);
            [ra, l.z.atan2(l.x.hypot(l.y)).to_degrees()]
        };
        let at = direction(&self.model);
        let rate = self.model.body.rate_rad_s.norm();
        let slopes: Vec<[f64; 2]> = self
            .free
            .iter()
            .map(|free| {
                let mut moved = self.model.clone();
                let h = 1e-6
                    * if matches!(free, Free::Rate(_)) {
                        rate
                    } else {
                        1.0
                    };
                if let Free::Attitude(axis) = free {
                    let turn = Vector3::from_fn(|i, _| if i == *axis { h } else { 0.0 });
                    moved.body.epoch = rotation_from_vector(&turn) * moved.body.epoch;
                } else {
                    free.change(&mut moved, h);
                }
                let to = direction(&moved);
                [
                    ((to[0] - at[0] + 180.0).rem_euclid(360.0) - 180.0) / h,
                    (to[1] - at[1]) / h,
                ]
            })
            .collect();
        [0, 1].map(|k| {
            let g = DVector::from_fn(slopes.len(), |i, _| slopes[i][k]);
            let variance = g.dot(&(&self.covariance * &g));
            [at[k], variance.max(0.0).sqrt()]
        })
    }
}

/// A model as a function of small changes to it.
struct Around<'a, 'b> {
    fitter: &'a Fitter<'b>,
    start: &'a Rotating,
    free: &'a [Free],
}

impl Around<'_, '_> {
    fn at(&self, p: &DVector<f64>) -> Rotating {
        let mut model = self.start.clone();
        for (free, p) in self.free.iter().zip(p.iter()) {
            free.change(&mut model, p * free.scale(self.fitter, self.start));
        }
        // turns do not commute: all three at once
        let turn = |of: fn(usize) -> Free| {
            Vector3::from_fn(|axis, _| {
                let at = self.free.iter().position(|free| *free == of(axis));
                at.map_or(0.0, |at| p[at] * of(axis).scale(self.fitter, self.start))
            })
        };
        let attitude = rotation_from_vector(&turn(Free::Attitude));
        let alignment = rotation_from_vector(&turn(Free::Misalignment));
        let whole = |q: UnitQuaternion<f64>| UnitQuaternion::new_normalize(q.into_inner());
        model.body.epoch = whole(attitude * self.start.body.epoch);
        model.to_body = whole(alignment * self.start.to_body);
        model
    }
}

impl Problem for Around<'_, '_> {
    fn residuals(&self, p: &DVector<f64>) -> Result<DVector<f64>, AssessError> {
        let model = self.at(p);
        let path = self.fitter.path(&model.body)?;
        let e = self.fitter.residual_body(&model, &path);
        Ok(self.fitter.whiten(&model, &e))
    }

    fn jacobian(&self, p: &DVector<f64>) -> Result<DMatrix<f64>, AssessError> {
        let model = self.at(p);
        let path = self.fitter.path(&model.body)?;
        let observed = self.fitter.observed;
        let mut out = DMatrix::zeros(3 * observed.len(), self.free.len());
        for (column, free) in self.free.iter().enumerate() {
            let scale = free.scale(self.fitter, self.start);
            let mut moved = model.clone();
            free.change(&mut moved, scale);
            let e: Vec<Vector3<f64>> = if free.moves_body() {
                let other = self.fitter.path(&moved.body)?;
                let pairs = other.q.iter().zip(&path.q);
                pairs.map(|(new, old)| -rotation_vector(new, old)).collect()
            } else {
                let times = observed.t_s.iter().enumerate();
                let unit = |(k, t): (usize, &f64)| {
                    let tau = t - self.fitter.epoch_s;
                    free.derivative(&model, tau, *t, &path.q[k], &path.rate[k]) * scale
                };
                times.map(unit).collect()
            };
            out.set_column(column, &self.fitter.whiten(&model, &e));
        }
        Ok(out)
    }
}
