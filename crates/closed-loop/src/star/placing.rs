//! Where stars are expected, and how they move there.
//!
//! Source: [M23] Section 2.6, Step 1; the declared effects by [`star_tracker::Pbm`].

use std::sync::Arc;

use effects::Effect;
use focal_plane::{AttitudeSeries, AttitudeSource, PointsMut, Vectors};
use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;
use spectra::robust;
use star_tracker::{Disturbance, Pbm, Rows, Scratch};

use crate::star::data::StarData;

impl StarData {
    /// Projected positions with what the declared effects do to them along `motion`; modelled ones are
    /// the same.
    pub(crate) fn place(
        &mut self,
        motion: Option<&dyn AttitudeSource>,
        effects: &[Arc<dyn Effect>],
    ) {
        self.project_with(motion, effects);
        self.modelled = self.projected.clone();
    }

    /// Projected positions alone.
    pub(super) fn project_with(
        &mut self,
        motion: Option<&dyn AttitudeSource>,
        effects: &[Arc<dyn Effect>],
    ) {
        self.project();
        self.set_aside_behind();
        self.disturb(motion, effects);
    }

    /// A star behind the camera was taken for another.
    fn set_aside_behind(&mut self) {
        let [x, y] = &self.projected;
        let places = x.iter().zip(y).zip(&mut self.outlier);
        for ((x, y), outlier) in places {
            *outlier |= !(x.is_finite() && y.is_finite());
        }
    }

    /// Projection of every row by its frame's attitude, before any effect, px.
    pub(crate) fn bare_projections(&self) -> Vec<[f64; 2]> {
        let of_frame = |k: usize| {
            let rows = self.frames.rows_of(k);
            rows.map(move |row| self.bare_projection(k, row))
        };
        let frames = (0..self.frames.frames()).into_par_iter();
        frames.flat_map_iter(of_frame).collect()
    }

    /// That of a row of this frame.
    pub(crate) fn bare_projection(&self, frame: usize, row: usize) -> [f64; 2] {
        let star = &self.stars[self.star[row]];
        self.position(&self.attitude[frame], &star.direction)
    }

    /// Projected positions.
    fn project(&mut self) {
        let at = self.bare_projections();
        for (row, at) in at.into_iter().enumerate() {
            for axis in 0..2 {
                self.projected[axis][row] = at[axis];
            }
        }
    }

    /// Velocity and acceleration across the detector, from `motion` at three
    /// instants around each frame; zero where there is none.
    pub(crate) fn follow(&mut self, motion: Option<&dyn AttitudeSource>) {
        // Short against any motion that the samples resolve, long against the
        // rounding of a difference of positions.
        let h = 0.05 * robust::median_step(&self.frames.t_s).unwrap_or(1.0);
        let known = &*self;
        let of_frame = |k: usize| {
            let t = known.frames.t_s[k];
            let around =
                motion.and_then(|m| Some([m.attitude(t - h)?, m.attitude(t)?, m.attitude(t + h)?]));
            known.frames.rows_of(k).map(move |row| {
                let u = known.stars[known.star[row]].direction;
                let path = around
                    .as_ref()
                    .map(|a| a.each_ref().map(|q| known.position(q, &u)));
                path.map_or([[0.0; 2]; 2], |[p, c, q]| {
                    [0, 1].map(|axis| {
                        [
                            (q[axis] - p[axis]) / (2.0 * h),
                            (q[axis] - 2.0 * c[axis] + p[axis]) / (h * h),
                        ]
                    })
                })
            })
        };
        let frames = (0..self.frames.frames()).into_par_iter();
        let moves: Vec<[[f64; 2]; 2]> = frames.flat_map_iter(of_frame).collect();
        for (row, moves) in moves.into_iter().enumerate() {
            for (axis, [velocity, acceleration]) in moves.into_iter().enumerate() {
                self.velocity[axis][row] = velocity;
                self.acceleration[axis][row] = acceleration;
            }
        }
    }

    /// The motion that the frames' own attitudes describe.
    pub(crate) fn own_motion(&self) -> Option<AttitudeSeries> {
        AttitudeSeries::new(self.frames.t_s.clone(), self.attitude.clone(), None).ok()
    }

    /// Adds what the declared effects do to the projected positions, before the centroid. Rows whose
    /// exposure leaves the known motion are set aside.
    fn disturb(&mut self, motion: Option<&dyn AttitudeSource>, effects: &[Arc<dyn Effect>]) {
        let Some(motion) = motion.filter(|_| !effects.is_empty()) else {
            return;
        };
        let mut tracker = Pbm::new(self.camera.clone());
        for effect in effects {
            let disturbance: Arc<dyn Disturbance> = effect.clone();
            tracker = tracker.with_disturbance(disturbance);
        }
        let component = |axis: usize| -> Vec<f64> {
            self.star
                .iter()
                .map(|&s| self.stars[s].direction[axis])
                .collect()
        };
        let (x, y, z) = (component(0), component(1), component(2));
        let [px, py] = &mut self.projected;
        tracker.ideal_into(
            motion,
            Rows {
                t_s: &self.frames.t_s,
                first_row: &self.frames.first_row,
                slot: &self.frames.slot,
                star_id: &self.frames.star_id,
                mag: &self.mag,
                bv: &self.bv,
                direction: Vectors {
                    x: &x,
                    y: &y,
                    z: &z,
                },
            },
            &mut Scratch::default(),
            PointsMut { x: px, y: py },
        );
        for row in 0..self.t_s.len() {
            if !self.projected[0][row].is_finite() && !self.outlier[row] {
                self.outlier[row] = true;
                self.outside_reference += 1;
                self.unplaced += 1;
            }
        }
    }

    pub(crate) fn position(&self, q: &UnitQuaternion<f64>, u: &Vector3<f64>) -> [f64; 2] {
        self.camera
            .project(&(q * u))
            .map_or([f64::NAN; 2], |p| [p.x, p.y])
    }
}
