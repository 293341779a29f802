//! Step 1: where the optics would put each star, with all that disturbs when and where it is seen.
//!
//! ```text
//! v = q(t) u,   P = (f_x v_x / v_z, f_y v_y / v_z)
//! ```
//!
//! No distortion, centroid error or noise is in it: draws that differ in these alone share it.
//!
//! Source: \[M23\] Section 2.6, Step 1.

use focal_plane::{
    AttitudeSource, Pixel, Points, PointsMut, VectorsMut, rotate_into, rotation_from_vector,
};
use nalgebra::{UnitQuaternion, Vector3};

use super::{Pbm, Scratch};
use crate::quadrature::GAUSS_LEGENDRE_8;
use crate::{Rows, StarView};

/// Substitutions after which the instant of a row is taken as found. Each shrinks the error by
/// `line_time x speed`, 4e-4 for 12 px/s and 30 us, so three are the rule.
const INSTANT_STEPS: u32 = 30;
/// An instant is found when it moves by less, s.
const INSTANT_TOLERANCE_S: f64 = 1e-13;

impl Pbm {
    /// Ideal position of every row, px: Step 1 with all that disturbs instants, directions and images;
    /// NaN where a row is left out. No distortion, centroid error or noise is in it: draws that differ
    /// in these alone share it, see [`measure_at_into`](Self::measure_at_into).
    ///
    /// # Panics
    ///
    /// If the columns of `rows` do not fit together, or `out` differs in length.
    pub fn ideal_into(
        &self,
        truth: &dyn AttitudeSource,
        rows: Rows<'_>,
        scratch: &mut Scratch,
        mut out: PointsMut<'_>,
    ) {
        rows.check();
        assert_eq!(out.len(), rows.len(), "one position for each row");
        scratch.resize(rows.len());
        if self.stages.instant || self.stages.exposure {
            self.ideal_row_by_row(truth, rows, out.reborrow());
        } else {
            self.ideal_frame_by_frame(truth, rows, scratch, out.reborrow());
        }
        if self.stages.image {
            self.shift_rows(
                rows,
                |s| s.image,
                None,
                |disturbance, star| disturbance.image_shift_px(star),
                out,
            );
        }
    }

    /// Calls `then` with the ideal positions, which are in the scratch's own columns meanwhile.
    pub(super) fn with_ideal<T>(
        &self,
        truth: &dyn AttitudeSource,
        rows: Rows<'_>,
        scratch: &mut Scratch,
        then: impl FnOnce(Points<'_>, &mut Scratch) -> T,
    ) -> T {
        let [mut x, mut y] = std::mem::take(&mut scratch.ideal);
        for column in [&mut x, &mut y] {
            column.resize(rows.len(), 0.0);
        }
        let out = PointsMut {
            x: &mut x,
            y: &mut y,
        };
        self.ideal_into(truth, rows, scratch, out);
        let done = then(Points { x: &x, y: &y }, scratch);
        scratch.ideal = [x, y];
        done
    }

    /// Step 1 where no row needs its own instant: one attitude a frame.
    fn ideal_frame_by_frame(
        &self,
        truth: &dyn AttitudeSource,
        rows: Rows<'_>,
        scratch: &mut Scratch,
        out: PointsMut<'_>,
    ) {
        let Scratch { vx, vy, vz, .. } = scratch;
        let mut v = VectorsMut {
            x: vx,
            y: vy,
            z: vz,
        };
        for (k, &t_s) in rows.t_s.iter().enumerate() {
            let of = rows.of(k);
            let Some(q) = truth.attitude(t_s) else {
                for column in [&mut *v.x, &mut *v.y, &mut *v.z] {
                    column[of.clone()].fill(f64::NAN);
                }
                continue;
            };
            let q = self.misaligned(t_s, q);
            rotate_into(&q, rows.direction.range(of.clone()), v.range(of.clone()));
            if self.stages.direction || self.stages.tracker_direction {
                for row in of {
                    let star = rows.view(k, row, Pixel::default());
                    let seen =
                        self.in_tracker(&star, q * self.apparent(&star, rows.direction(row)));
                    v.x[row] = seen.x;
                    v.y[row] = seen.y;
                    v.z[row] = seen.z;
                }
            }
        }
        self.camera.project_into(v.as_shared(), out);
    }

    /// Step 1 where rows are exposed at their own instants or over a time.
    fn ideal_row_by_row(&self, truth: &dyn AttitudeSource, rows: Rows<'_>, out: PointsMut<'_>) {
        let mut hint = 0;
        for k in 0..rows.frames() {
            for row in rows.of(k) {
                let star = rows.view(k, row, Pixel::default());
                let at = self.exposed(truth, star, rows.direction(row), &mut hint);
                let Pixel { x, y } = at.unwrap_or(Pixel {
                    x: f64::NAN,
                    y: f64::NAN,
                });
                out.x[row] = x;
                out.y[row] = y;
            }
        }
    }

    /// Mean of the star's path over the exposure of its row.
    fn exposed(
        &self,
        truth: &dyn AttitudeSource,
        mut star: StarView,
        u: Vector3<f64>,
        hint: &mut usize,
    ) -> Option<Pixel> {
        let u = self.apparent(&star, u);
        let mut t_s = self.instant_s(&star);
        let mut last_s = f64::INFINITY;
        for _ in 0..INSTANT_STEPS {
            star.at = self.seen_at(truth, t_s, &star, &u, hint)?;
            let step_s = self.instant_s(&star) - t_s;
            // steps shrink by one factor: their sum (Aitken 1926)
            let shrinks = step_s / last_s;
            t_s += if shrinks.abs() < 0.5 {
                step_s / (1.0 - shrinks)
            } else {
                step_s
            };
            last_s = step_s;
            if step_s.abs() <= INSTANT_TOLERANCE_S {
                break;
            }
        }
        if self.exposure_s <= 0.0 {
            return Some(star.at);
        }
        let half_s = 0.5 * self.exposure_s;
        let [first_s, last_s] = truth.span_s();
        if t_s - half_s < first_s || t_s + half_s > last_s {
            return None;
        }
        let mut mean = Pixel::default();
        for (node, weight) in GAUSS_LEGENDRE_8 {
            let at = self.seen_at(truth, t_s + half_s * node, &star, &u, hint)?;
            mean.x += 0.5 * weight * at.x;
            mean.y += 0.5 * weight * at.y;
        }
        Some(mean)
    }

    fn seen_at(
        &self,
        truth: &dyn AttitudeSource,
        t_s: f64,
        star: &StarView,
        u: &Vector3<f64>,
        hint: &mut usize,
    ) -> Option<Pixel> {
        let q = self.misaligned(t_s, truth.attitude_near(t_s, hint)?);
        self.camera.project(&self.in_tracker(star, q * u))
    }

    fn instant_s(&self, star: &StarView) -> f64 {
        star.t_s
            + self
                .at_stage(|s| s.instant)
                .map(|d| d.time_shift_s(star))
                .sum::<f64>()
    }

    fn misaligned(&self, t_s: f64, q: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        self.at_stage(|s| s.attitude)
            .fold(q, |q, d| rotation_from_vector(&d.misalignment_rad(t_s)) * q)
    }

    fn apparent(&self, star: &StarView, u: Vector3<f64>) -> Vector3<f64> {
        self.at_stage(|s| s.direction)
            .fold(u, |u, d| d.direction(star, u))
    }

    fn in_tracker(&self, star: &StarView, v: Vector3<f64>) -> Vector3<f64> {
        self.at_stage(|s| s.tracker_direction)
            .fold(v, |v, d| d.tracker_direction(star, v))
    }
}
