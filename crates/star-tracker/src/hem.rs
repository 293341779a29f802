//! The hybrid empirical model (HEM): truth attitude in, measured attitude out, without centroids.
//!
//! ```text
//! q_lsf   = QUEST of the distorted stars                 as the PBM, Steps 1, 2 and 5; q itself without
//! b[k+1]  = exp(-T/tau) b[k] + K0 n                      distortion      K0 = sigma_HSF sqrt(1 - exp(-2 T/tau))
//! e[k]    = b[k] + sigma_TN n                            per axis, n ~ N(0, 1)
//! q_meas  = exp([e x]) q_lsf                             tracker axes
//! ```
//!
//! `T` is the time from one frame to the next. `K0` scales unit white noise so that the density of the
//! block is that of the term it stands for. [`k0`] does so for the consistent one-sided density, whose
//! sigma is the true standard deviation; [`k0_as_printed`] for \[M23\] Eq. 17 as printed, whose FOGM
//! term is two-sided (erratum E6), so that the same sigma gives `sqrt 2` less. The model's own
//! parameters are true standard deviations.
//!
//! Frames without distortion and without disturbances need no stars at all: this is the model's saving.
//! With them, what is saved is the centroid error and the noise of every star.
//!
//! Source: \[M23\] Section 3 and Fig. 5; the drawing of the figure names `K0` and `T` and no formula,
//! the text says what `K0` is for.

use std::sync::Arc;

use distortion::DistortionField;
use focal_plane::{Angle, AttitudeSource, Camera, rotation_from_vector};
use fogm_fit::{Fogm, FogmWhite};
use nalgebra::{UnitQuaternion, Vector3};
use quest::FrameStatus;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::{Disturbance, Measured, NoiseStreams, Pbm, Purpose, Rows, Scratch, stream};

/// What unit white noise is multiplied by before the filter, for a step of `dt_s`: the density of the
/// block is then the sampled one-sided density of `fogm`.
///
/// ```
/// let hold = fogm_fit::Fogm::new(3.58, 161.0)?;
/// assert!((star_tracker::k0(hold, 0.1) - 3.58 * (0.2_f64 / 161.0).sqrt()).abs() < 1e-4);
/// # Ok::<(), fogm_fit::FogmError>(())
/// ```
#[must_use]
pub fn k0(fogm: Fogm, dt_s: f64) -> f64 {
    fogm.drive(dt_s)
}

/// The same where sigma is that of \[M23\] Eq. 17 as printed (erratum E6): `k0 / sqrt 2`.
#[must_use]
pub fn k0_as_printed(fogm: Fogm, dt_s: f64) -> f64 {
    k0(fogm, dt_s) * core::f64::consts::FRAC_1_SQRT_2
}

/// The hybrid model of one tracker.
#[derive(Clone, Debug)]
pub struct Hem {
    /// Steps 1 and 2, and QUEST: a tracker without centroid error and noise.
    optics: Pbm,
    distorted: bool,
    /// About x, y, z, arcsec.
    axes: [FogmWhite; 3],
}

/// Where the processes stand: carried from one batch to the next, so that a series does not depend on
/// how it is cut.
///
/// The stream yields six normals a frame: for x, y, z first the process, then the white noise.
#[derive(Clone, Debug)]
pub struct HemState {
    rng: Xoshiro256PlusPlus,
    fogm_arcsec: [f64; 3],
    last_s: Option<f64>,
}

impl HemState {
    /// The start of a draw: each process in its stationary state at the first frame.
    #[must_use]
    pub fn new(seed: u64, draw: u64) -> Self {
        Self {
            rng: stream(seed, draw, Purpose::HybridNoise),
            fogm_arcsec: [0.0; 3],
            last_s: None,
        }
    }
}

impl Hem {
    /// A tracker with these errors about x, y, z, arcsec, and no distortion.
    #[must_use]
    pub fn new(camera: Camera, axes_arcsec: [FogmWhite; 3]) -> Self {
        Self {
            optics: Pbm::new(camera),
            distorted: false,
            axes: axes_arcsec,
        }
    }

    /// The same with this distortion residual (LSFE).
    #[must_use]
    pub fn with_distortion(mut self, field: DistortionField) -> Self {
        self.optics = self.optics.with_distortion(field);
        self.distorted = true;
        self
    }

    /// The same with one more disturbance, which acts on the light's way before QUEST. Those that
    /// change the noise of a star do nothing: there is none.
    #[must_use]
    pub fn with_disturbance(mut self, disturbance: impl Into<Arc<dyn Disturbance>>) -> Self {
        self.optics = self.optics.with_disturbance(disturbance);
        self
    }

    /// The part that follows the stars: a tracker without centroid error and noise.
    #[must_use]
    pub fn optics(&self) -> &Pbm {
        &self.optics
    }

    /// Errors about x, y, z, arcsec.
    #[must_use]
    pub fn axes(&self) -> [FogmWhite; 3] {
        self.axes
    }

    /// Whether a frame's attitude needs its stars.
    #[must_use]
    pub fn needs_stars(&self) -> bool {
        self.distorted || !self.optics.disturbances().is_empty()
    }

    /// Measured attitude of a batch of frames; `out` has no positions.
    ///
    /// Without need of stars every frame within the truth's span is solved, whatever its rows.
    /// `streams` are those of disturbances that draw numbers.
    ///
    /// # Panics
    ///
    /// If the columns of `rows` do not fit together, or time goes backwards.
    pub fn measure_into(
        &self,
        truth: &dyn AttitudeSource,
        rows: Rows<'_>,
        state: &mut HemState,
        streams: &mut NoiseStreams,
        scratch: &mut Scratch,
        out: &mut Measured,
    ) {
        if self.needs_stars() {
            self.optics
                .solve_without_noise(truth, rows, streams, scratch, out);
            for column in [
                &mut out.x_px,
                &mut out.y_px,
                &mut out.noise_free_x_px,
                &mut out.noise_free_y_px,
            ] {
                column.clear();
            }
        } else {
            take_truth(truth, rows.t_s, out);
        }
        let mut step = Step::default();
        for (k, &t_s) in rows.t_s.iter().enumerate() {
            let error = self.error_rad(t_s, state, &mut step);
            let Some(q) = out.attitude(k) else { continue };
            write(out, k, rotation_from_vector(&error) * q);
        }
    }

    /// Errors of the next frame, rad, tracker axes.
    fn error_rad(&self, t_s: f64, state: &mut HemState, step: &mut Step) -> Vector3<f64> {
        let dt_s = state.last_s.map(|last_s| t_s - last_s);
        if let Some(dt_s) = dt_s {
            assert!(dt_s >= 0.0, "frames in the order of time");
            step.set(dt_s, &self.axes);
        }
        state.last_s = Some(t_s);
        let HemState {
            rng, fogm_arcsec, ..
        } = state;
        let mut normal = || -> f64 { StandardNormal.sample(&mut *rng) };
        Vector3::from_fn(|axis, _| {
            let process = self.axes[axis];
            let b = &mut fogm_arcsec[axis];
            *b = match dt_s {
                Some(_) => step.decay[axis] * *b + step.k0[axis] * normal(),
                None => process.fogm().sigma() * normal(),
            };
            Angle::from_arcsec(*b + process.sigma_white() * normal()).rad()
        })
    }
}

/// Decay and K0 of one step: frames come at equal steps but for rounding and gaps.
#[derive(Clone, Copy, Debug, Default)]
struct Step {
    dt_s: f64,
    decay: [f64; 3],
    k0: [f64; 3],
}

impl Step {
    /// Exponentials only where the step differs from the one before.
    #[expect(clippy::float_cmp, reason = "any other number is another step")]
    fn set(&mut self, dt_s: f64, axes: &[FogmWhite; 3]) {
        if dt_s == self.dt_s && dt_s > 0.0 {
            return;
        }
        self.dt_s = dt_s;
        self.decay = axes.map(|axis| axis.fogm().decay(dt_s));
        self.k0 = axes.map(|axis| k0(axis.fogm(), dt_s));
    }
}

/// The truth itself, where it is known.
fn take_truth(truth: &dyn AttitudeSource, t_s: &[f64], out: &mut Measured) {
    out.resize(t_s.len(), 0);
    out.rows_left_out = 0;
    for (k, &t) in t_s.iter().enumerate() {
        match truth.attitude(t) {
            Some(q) => {
                out.status[k] = FrameStatus::Solved;
                write(out, k, q);
            }
            None => {
                out.status[k] = FrameStatus::NotFinite;
                for column in [&mut out.qx, &mut out.qy, &mut out.qz, &mut out.qw] {
                    column[k] = f64::NAN;
                }
            }
        }
    }
}

fn write(out: &mut Measured, k: usize, q: UnitQuaternion<f64>) {
    // products of rotations stay unit to rounding, and are not accumulated here
    out.qx[k] = q.i;
    out.qy[k] = q.j;
    out.qz[k] = q.k;
    out.qw[k] = q.w;
}
