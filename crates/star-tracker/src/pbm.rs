//! The physics-based model (PBM): truth attitude in, measured centroids and attitude out.
//!
//! ```text
//! Step 1   v = q(t) u,  P = (f_x v_x / v_z, f_y v_y / v_z)     stars of the frame, ideal position
//! Step 2   P += (F1(P), F2(P))                                 distortion residual, Eq. 4-8
//! Step 3   P += c(phase(P))                                    centroid error at the distorted position
//! Step 4   P += n,   n ~ N(0, sigma_TN^2) per axis             temporal noise
//! Step 5   q_meas = argmin sum |w_i - C v_i|^2                 QUEST on the measured positions
//! ```
//!
//! Centroid error and noise are held in arcsec at the centre's scale,
//! `focal_plane::Camera::arcsec_per_px`, and become pixels by it. Disturbances
//! ([`crate::Disturbance`]) act at their stages in between; without any, the batch runs through
//! elementwise kernels only.
//!
//! A row whose exposure is not wholly inside the span of the truth is left out (NaN), never
//! extrapolated.
//!
//! Source: \[M23\] Section 2.6 and Fig. 4. Eq. 12 is minimised (Eq. 13 has the frames reversed,
//! erratum E3).

mod ideal;

use std::sync::Arc;

use centroid::CentroidError;
use distortion::{DistortionField, PixelDistortion};
use focal_plane::{ARCSEC_PER_RAD, AttitudeSource, Camera, Pixel, Points, PointsMut, VectorsMut};
use quest::{ProfileBatch, QuaternionsMut, solve_batch_into};
use rand_core::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::star_field::uniform;
use crate::{Disturbance, Measured, NoiseStreams, Rows, Stages, StarView, TemporalNoise};

/// The physics-based model of one tracker.
#[derive(Clone, Debug)]
pub struct Pbm {
    camera: Camera,
    distortion: DistortionField,
    lens: PixelDistortion,
    centroid_error: CentroidError,
    /// The same in px.
    centroid_error_px: CentroidError,
    noise: TemporalNoise,
    disturbances: Vec<Arc<dyn Disturbance>>,
    stages: Stages,
    exposure_s: f64,
}

/// Memory of a batch: made once, grown to the largest batch seen.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    vx: Vec<f64>,
    vy: Vec<f64>,
    vz: Vec<f64>,
    ideal: [Vec<f64>; 2],
    weight: Vec<f64>,
    normal: Vec<f64>,
    profiles: ProfileBatch,
}

impl Scratch {
    fn resize(&mut self, rows: usize) {
        for column in [&mut self.vx, &mut self.vy, &mut self.vz, &mut self.weight] {
            column.resize(rows, 0.0);
        }
        self.normal.resize(2 * rows, 0.0);
    }
}

impl Pbm {
    /// A tracker without errors.
    pub fn new(camera: Camera) -> Self {
        let distortion = DistortionField::zero();
        Self {
            lens: distortion.for_camera(&camera),
            camera,
            distortion,
            centroid_error: CentroidError::None,
            centroid_error_px: CentroidError::None,
            noise: TemporalNoise::NONE,
            disturbances: Vec::new(),
            stages: Stages::NONE,
            exposure_s: 0.0,
        }
    }

    /// The same with this distortion residual (LSFE).
    #[must_use]
    pub fn with_distortion(mut self, field: DistortionField) -> Self {
        self.lens = field.for_camera(&self.camera);
        self.distortion = field;
        self
    }

    /// The same with this centroid error (HSFE), its amplitudes in arcsec.
    #[must_use]
    pub fn with_centroid_error(mut self, error_arcsec: CentroidError) -> Self {
        self.centroid_error_px = error_arcsec.scaled(self.camera.arcsec_per_px().map(|s| 1.0 / s));
        self.centroid_error = error_arcsec;
        self
    }

    /// The same with this temporal noise.
    #[must_use]
    pub fn with_noise(mut self, noise: TemporalNoise) -> Self {
        self.noise = noise;
        self
    }

    /// The same with one more disturbance; disturbances act in the order in which they were added.
    /// Of several exposures the longest holds.
    #[must_use]
    pub fn with_disturbance(mut self, disturbance: impl Into<Arc<dyn Disturbance>>) -> Self {
        let disturbance = disturbance.into();
        let stages = disturbance.stages();
        self.stages = self.stages.union(stages);
        if stages.exposure {
            self.exposure_s = self.exposure_s.max(disturbance.exposure_s());
        }
        self.disturbances.push(disturbance);
        self
    }

    /// The same without disturbances: the declared model.
    #[must_use]
    pub fn undisturbed(&self) -> Self {
        Self {
            disturbances: Vec::new(),
            stages: Stages::NONE,
            exposure_s: 0.0,
            ..self.clone()
        }
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The distortion residual.
    pub fn distortion(&self) -> &DistortionField {
        &self.distortion
    }

    /// The centroid error, amplitudes in arcsec.
    pub fn centroid_error(&self) -> &CentroidError {
        &self.centroid_error
    }

    /// The temporal noise.
    pub fn noise(&self) -> &TemporalNoise {
        &self.noise
    }

    /// The disturbances, in the order in which they act.
    pub fn disturbances(&self) -> &[Arc<dyn Disturbance>] {
        &self.disturbances
    }

    /// Noise-free measured positions of every row, px (Steps 1 to 3, with disturbances); returns how
    /// many rows were left out (NaN).
    ///
    /// # Panics
    ///
    /// If the columns of `rows` do not fit together, or `out` differs in length.
    pub fn positions_into(
        &self,
        truth: &dyn AttitudeSource,
        rows: Rows<'_>,
        scratch: &mut Scratch,
        out: PointsMut<'_>,
    ) -> usize {
        self.with_ideal(truth, rows, scratch, |ideal, scratch| {
            self.distorted_into(rows, ideal, scratch, out)
        })
    }

    /// Steps 2 and 3; returns how many rows are NaN.
    fn distorted_into(
        &self,
        rows: Rows<'_>,
        ideal: Points<'_>,
        scratch: &mut Scratch,
        mut out: PointsMut<'_>,
    ) -> usize {
        assert_eq!(out.len(), rows.len(), "one position for each row");
        scratch.resize(rows.len());
        // nothing else needs the columns of the directions meanwhile
        self.lens.distort_into(
            ideal,
            PointsMut {
                x: &mut scratch.vx,
                y: &mut scratch.vy,
            },
        );
        let distorted = Points {
            x: &scratch.vx,
            y: &scratch.vy,
        };
        let centre = self.camera.pixel_centre();
        self.centroid_error_px
            .displace_into(distorted, centre, out.reborrow());
        if self.stages.centroid {
            self.shift_rows(
                rows,
                |s| s.centroid,
                Some(distorted),
                |disturbance, star| disturbance.centroid_shift_px(star),
                out.reborrow(),
            );
        }
        out.x.iter().filter(|x| x.is_nan()).count()
    }

    /// Steps 1 to 5 for a batch of frames.
    ///
    /// The stream of noise yields two normals per row in the order of the rows, used or not. Rows are
    /// weighted by the inverse of the declared noise variance, equally where that is one number.
    ///
    /// # Panics
    ///
    /// If the columns of `rows` do not fit together.
    pub fn measure_into(
        &self,
        truth: &dyn AttitudeSource,
        rows: Rows<'_>,
        streams: &mut NoiseStreams,
        scratch: &mut Scratch,
        out: &mut Measured,
    ) {
        self.with_ideal(truth, rows, scratch, |ideal, scratch| {
            self.measure_at_into(truth, rows, ideal, streams, scratch, out);
        });
    }

    /// The same for rows whose ideal positions, px, are known: those of
    /// [`ideal_into`](Self::ideal_into) with the same motion, stars, camera and disturbances.
    ///
    /// # Panics
    ///
    /// If the columns of `rows` do not fit together, or `ideal` differs in length.
    pub fn measure_at_into(
        &self,
        truth: &dyn AttitudeSource,
        rows: Rows<'_>,
        ideal: Points<'_>,
        streams: &mut NoiseStreams,
        scratch: &mut Scratch,
        out: &mut Measured,
    ) {
        rows.check();
        out.resize(rows.frames(), rows.len());
        out.rows_left_out = self.distorted_into(rows, ideal, scratch, out.noise_free());
        self.add_noise(truth, rows, streams, scratch, out);
        self.solve(rows, scratch, out);
    }

    /// Steps 1 to 3 and 5: attitudes of stars without noise, equally weighted. Spikes are added, as
    /// they belong to a disturbance; the stream of noise is left as it is.
    pub(crate) fn solve_without_noise(
        &self,
        truth: &dyn AttitudeSource,
        rows: Rows<'_>,
        streams: &mut NoiseStreams,
        scratch: &mut Scratch,
        out: &mut Measured,
    ) {
        out.resize(rows.frames(), rows.len());
        out.rows_left_out = self.positions_into(truth, rows, scratch, out.noise_free());
        out.x_px.copy_from_slice(&out.noise_free_x_px);
        out.y_px.copy_from_slice(&out.noise_free_y_px);
        for (weight, x) in scratch.weight.iter_mut().zip(&out.x_px) {
            *weight = if x.is_nan() { 0.0 } else { 1.0 };
        }
        if self.stages.spike {
            self.add_spikes(rows, &mut streams.spikes, out);
        }
        self.solve(rows, scratch, out);
    }

    /// Disturbances that act at a stage; none are asked when no disturbance acts there.
    fn at_stage(&self, stage: fn(Stages) -> bool) -> impl Iterator<Item = &dyn Disturbance> {
        let any = stage(self.stages);
        let all = if any {
            self.disturbances.as_slice()
        } else {
            &[]
        };
        all.iter()
            .map(AsRef::as_ref)
            .filter(move |d| stage(d.stages()))
    }

    /// Adds to `out` what the disturbances of a stage `shift` each row by, px. They see it at `at`; where that is
    /// `None`, at what `out` holds.
    fn shift_rows(
        &self,
        rows: Rows<'_>,
        stage: fn(Stages) -> bool,
        at: Option<Points<'_>>,
        mut shift: impl FnMut(&dyn Disturbance, &StarView) -> [f64; 2],
        out: PointsMut<'_>,
    ) {
        for k in 0..rows.frames() {
            for row in rows.of(k) {
                let [x, y] = at.map_or([out.x[row], out.y[row]], |at| [at.x[row], at.y[row]]);
                let star = rows.view(k, row, Pixel { x, y });
                for disturbance in self.at_stage(stage) {
                    let [dx, dy] = shift(disturbance, &star);
                    out.x[row] += dx;
                    out.y[row] += dy;
                }
            }
        }
    }

    /// Step 4.
    fn add_noise(
        &self,
        truth: &dyn AttitudeSource,
        rows: Rows<'_>,
        streams: &mut NoiseStreams,
        scratch: &mut Scratch,
        out: &mut Measured,
    ) {
        let scale = self.camera.arcsec_per_px();
        let Scratch { normal, weight, .. } = scratch;
        for value in normal.iter_mut() {
            *value = StandardNormal.sample(&mut streams.noise);
        }
        if self.noise.is_constant() && !self.stages.noise {
            let [sx, sy] = scale.map(|s| self.noise.base_arcsec() / s);
            for row in 0..rows.len() {
                out.x_px[row] = out.noise_free_x_px[row] + sx * normal[2 * row];
                out.y_px[row] = out.noise_free_y_px[row] + sy * normal[2 * row + 1];
            }
            for (weight, x) in weight.iter_mut().zip(&out.x_px) {
                *weight = if x.is_nan() { 0.0 } else { 1.0 };
            }
        } else {
            self.add_varying_noise(truth, rows, normal, weight, out);
        }
        if self.stages.spike {
            self.add_spikes(rows, &mut streams.spikes, out);
        }
    }

    /// Step 4 where sigma differs between rows.
    fn add_varying_noise(
        &self,
        truth: &dyn AttitudeSource,
        rows: Rows<'_>,
        normal: &[f64],
        weight: &mut [f64],
        out: &mut Measured,
    ) {
        let [scale_x, scale_y] = self.camera.arcsec_per_px();
        for k in 0..rows.frames() {
            let rate = truth.rate_rad_s(rows.t_s[k]).unwrap_or_default();
            for row in rows.of(k) {
                let at = Pixel {
                    x: out.noise_free_x_px[row],
                    y: out.noise_free_y_px[row],
                };
                let star = rows.view(k, row, at);
                let speed = rate.cross(&self.camera.direction(at)).norm() * ARCSEC_PER_RAD;
                let declared = self.noise.sigma_arcsec(star.mag, speed);
                let sigma = self.at_stage(|s| s.noise).fold(declared, |sigma, d| {
                    d.noise_sigma_arcsec(&star, speed, sigma)
                });
                out.x_px[row] = at.x + sigma / scale_x * normal[2 * row];
                out.y_px[row] = at.y + sigma / scale_y * normal[2 * row + 1];
                weight[row] = match (at.x.is_nan(), declared > 0.0) {
                    (true, _) => 0.0,
                    (false, true) => 1.0 / (declared * declared),
                    (false, false) => 1.0,
                };
            }
        }
    }

    fn add_spikes<R: Rng>(&self, rows: Rows<'_>, rng: &mut R, out: &mut Measured) {
        let noise_free = Points {
            x: &out.noise_free_x_px,
            y: &out.noise_free_y_px,
        };
        self.shift_rows(
            rows,
            |s| s.spike,
            Some(noise_free),
            |disturbance, star| disturbance.spike_px(star, &mut || uniform(rng)),
            PointsMut {
                x: &mut out.x_px,
                y: &mut out.y_px,
            },
        );
    }

    /// Step 5.
    fn solve(&self, rows: Rows<'_>, scratch: &mut Scratch, out: &mut Measured) {
        let Scratch {
            vx,
            vy,
            vz,
            weight,
            profiles,
            ..
        } = scratch;
        let measured = Points {
            x: &out.x_px,
            y: &out.y_px,
        };
        self.camera.direction_into(
            measured,
            VectorsMut {
                x: vx,
                y: vy,
                z: vz,
            },
        );
        profiles.accumulate(
            quest::Vectors {
                x: vx,
                y: vy,
                z: vz,
            },
            quest::Vectors {
                x: rows.direction.x,
                y: rows.direction.y,
                z: rows.direction.z,
            },
            weight,
            rows.first_row,
        );
        let q = QuaternionsMut {
            x: &mut out.qx,
            y: &mut out.qy,
            z: &mut out.qz,
            w: &mut out.qw,
        };
        solve_batch_into(profiles, q, &mut out.status);
    }
}
