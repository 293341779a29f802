//! Star directions and frame attitudes from the centroids alone.
//!
//! Without a reference every frame's attitude is a free unknown, and without a
//! catalogue every star's direction is an unknown constant. Both follow from the
//! centroids by alternation, started in the tracker axes of the fullest frame:
//!
//! ```text
//! q_k = QUEST( camera(x_ik, y_ik), u_i )          u_i = mean_k q_k^-1 camera(x_ik, y_ik)
//! ```
//!
//! The frame is fixed up to one common rotation, which no residual sees. The
//! alternation only has to bring the directions within the linear range: what is
//! left is solved exactly, with everything else, in the normal equations. Directions
//! are moved to what these say until that is next to nothing: a chain of stars that
//! pass by is off by pixels at its ends, and a prior of a pixel about where the
//! alternation left it asked for a lens that bends it back, of 27 sigma.
//!
//! Source: [M23] Eq. 12 for the attitude; the mean direction is the
//! least-squares one for small errors.

use std::sync::Arc;

use effects::Effect;
use focal_plane::{
    ARCSEC_PER_RAD, AttitudeSeries, AttitudeSource, Camera, Pixel, StarFrames, Vectors,
};
use nalgebra::{UnitQuaternion, Vector3};
use star_tracker::solve_frames;

use crate::star::data::StarData;
use crate::star::nuisance::tangent_axes;

/// Alternations; each shrinks the error of a star that joins late by about the
/// share of its frames among all.
const ALTERNATIONS: usize = 12;

/// Nats that the prior of a pixel about where directions are may cost. What noise moves them by where next to nothing
/// tells them, a rotation but for its second order, costs half of one.
const PRIOR_NATS: f64 = 2.0;

/// Attitude of each frame and direction of each star.
#[derive(Clone, Debug)]
pub(crate) struct Solved {
    /// Inertial to tracker, `None` where a frame has fewer than two usable stars.
    pub(crate) attitude: Vec<Option<UnitQuaternion<f64>>>,
    /// One unit vector a star.
    pub(crate) direction: Vec<Vector3<f64>>,
}

/// Attitudes of frames whose stars' directions are known.
pub(crate) fn attitudes(
    camera: &Camera,
    frames: &StarFrames,
    star: &[usize],
    direction: &[Option<Vector3<f64>>],
) -> Vec<Option<UnitQuaternion<f64>>> {
    // A star whose direction is not known yet is NaN: left out.
    let component = |axis: usize| -> Vec<f64> {
        star.iter()
            .map(|&s| direction[s].map_or(f64::NAN, |u| u[axis]))
            .collect()
    };
    let (x, y, z) = (component(0), component(1), component(2));
    solve_frames(
        camera,
        frames,
        Vectors {
            x: &x,
            y: &y,
            z: &z,
        },
    )
}

/// Where the camera sees the centroid of a row.
pub(crate) fn seen_at(camera: &Camera, frames: &StarFrames, row: usize) -> Vector3<f64> {
    camera.direction(Pixel {
        x: frames.x_px[row],
        y: frames.y_px[row],
    })
}

/// Sums of where frames of known attitude have seen each star, row by row.
pub(super) fn sums(
    frames: &StarFrames,
    star: &[usize],
    stars: usize,
    attitude: impl Fn(usize) -> Option<UnitQuaternion<f64>>,
    seen: impl Fn(usize) -> Vector3<f64>,
) -> Vec<Vector3<f64>> {
    let mut sum = vec![Vector3::zeros(); stars];
    for k in 0..frames.frames() {
        if let Some(q) = attitude(k) {
            for row in frames.rows_of(k) {
                sum[star[row]] += q.inverse() * seen(row);
            }
        }
    }
    sum
}

/// Directions and attitudes when neither is given. `star[row] < stars`.
pub(crate) fn solve(camera: &Camera, frames: &StarFrames, star: &[usize], stars: usize) -> Solved {
    let seen: Vec<Vector3<f64>> = (0..frames.rows())
        .map(|row| seen_at(camera, frames, row))
        .collect();
    let mut direction: Vec<Option<Vector3<f64>>> = vec![None; stars];
    let fullest =
        (0..frames.frames()).max_by_key(|&k| (frames.rows_of(k).len(), std::cmp::Reverse(k)));
    if let Some(k) = fullest {
        for row in frames.rows_of(k) {
            direction[star[row]] = Some(seen[row]);
        }
    }
    let mut attitude = attitudes(camera, frames, star, &direction);
    let solved = |attitude: &[Option<_>]| attitude.iter().flatten().count();
    let (mut left, mut before) = (ALTERNATIONS, 0);
    while left > 0 {
        // a sky that passes by is reached field by field
        let now = solved(&attitude);
        left -= usize::from(now <= before);
        before = now;
        let known = |k: usize| attitude[k];
        let sum = sums(frames, star, stars, known, |row| seen[row]);
        for (u, s) in direction.iter_mut().zip(&sum) {
            if s.norm_squared() > 0.0 {
                *u = Some(s.normalize());
            }
        }
        attitude = attitudes(camera, frames, star, &direction);
    }
    Solved {
        attitude,
        direction: direction
            .into_iter()
            .map(|u| u.unwrap_or_else(Vector3::z))
            .collect(),
    }
}

impl StarData {
    /// Moves each direction by two angles, arcsec, and projects the stars anew, `effects` being those that the model
    /// declares. Whether that matters.
    pub(super) fn move_directions(
        &mut self,
        by_arcsec: &[f64],
        reference: Option<&AttitudeSeries>,
        effects: &[Arc<dyn Effect>],
    ) -> bool {
        let squares: f64 = by_arcsec.iter().map(|a| a * a).sum();
        let px = self.camera.arcsec_per_px()[0];
        if 0.5 * squares < PRIOR_NATS * px * px {
            return false;
        }
        for (star, by) in self.stars.iter_mut().zip(by_arcsec.chunks_exact(2)) {
            let [e, n] = tangent_axes(&star.direction);
            let moved = star.direction + (e * by[0] + n * by[1]) / ARCSEC_PER_RAD;
            star.direction = moved.normalize();
        }
        match reference {
            Some(reference) => self.place_beside(reference, effects),
            None => {
                let own = self.own_motion();
                self.place(own.as_ref().map(|m| m as &dyn AttitudeSource), effects);
            }
        }
        true
    }
}
