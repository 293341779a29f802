//! Directions of stars that no catalogue has, where a reference tells the attitudes.
//!
//! Each star starts from where its frames saw it, c being the camera's direction of a centroid. A misalignment
//! theta turns these directions along with it, or a mount that is off by some pixels would have to be made good
//! for by the directions, which are known to a pixel alone:
//!
//! ```text
//! u(theta) = mean of q^-1 exp(-theta) c       d(q u) = (theta - R A theta) x (q u)
//! ```
//!
//! R being the rotation of a frame, and A the mean of the rotations back over the frames of the star. A tracker
//! that does not turn tells nothing of its misalignment.
//!
//! Source: least squares for small errors; its derivative.

use nalgebra::{Matrix3, Vector3};

use crate::star::data::StarData;
use crate::star::directions::{seen_at, sums};
use crate::star::frame_rotation::rotation_row;

impl StarData {
    /// Whether directions are unknown beside attitudes that are not.
    fn sees_directions(&self) -> bool {
        self.free_directions && !self.free_attitude
    }

    /// Takes the directions from where the frames saw the stars.
    pub(super) fn take_directions(&mut self) {
        if !self.sees_directions() {
            return;
        }
        let frames = &self.frames;
        let seen = |row: usize| seen_at(&self.camera, frames, row);
        let attitude = |k: usize| Some(self.attitude[k]);
        let sum = sums(frames, &self.star, self.stars.len(), attitude, seen);
        for (star, sum) in self.stars.iter_mut().zip(sum) {
            star.direction = sum.try_normalize(0.0).unwrap_or_else(Vector3::z);
        }
        self.turn_back();
    }

    /// Finds the mean rotation back of each star.
    pub(crate) fn turn_back(&mut self) {
        if !self.sees_directions() {
            return;
        }
        let mut sum = vec![(Matrix3::zeros(), 0.0); self.stars.len()];
        for (k, q) in self.attitude.iter().enumerate() {
            let back = q.inverse().to_rotation_matrix();
            for row in self.frames.rows_of(k) {
                let (whole, rows) = &mut sum[self.star[row]];
                *whole += back.matrix();
                *rows += 1.0;
            }
        }
        self.turned_back = sum
            .into_iter()
            .map(|(whole, rows)| whole / f64::max(rows, 1.0))
            .collect();
    }

    /// Columns of the misalignment on a row of `frame`, arcsec per arcsec.
    pub(super) fn misalignment_row(&self, row: usize, frame: usize) -> [[f64; 3]; 2] {
        let of_camera = rotation_row(self, row);
        let Some(back) = self.turned_back.get(self.star[row]) else {
            return of_camera;
        };
        let turned = self.attitude[frame].to_rotation_matrix() * back;
        let left = Matrix3::identity() - turned;
        of_camera.map(|axis| left.tr_mul(&Vector3::from(axis)).into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::declared::OnCentroids;
    use crate::star::data::Inputs;
    use focal_plane::{AttitudeSeries, Camera, StarFrames, rotation_from_vector};

    /// Stars that join and leave over 11 degrees of turns: what a change of the misalignment by 7 arcsec does to
    /// their projections, directions seen anew, is what the columns say, to its square, 1e-4 arcsec.
    #[test]
    fn columns_are_how_stars_and_directions_turn() {
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let t_s: Vec<f64> = (0..40).map(|k| 0.5 * f64::from(k)).collect();
        let turn = |t: &f64| {
            rotation_from_vector(&Vector3::new(0.04 * (0.3 * t).sin(), 0.006 * t, -0.01 * t))
        };
        let q: Vec<_> = t_s.iter().map(turn).collect();
        let mount = rotation_from_vector(&Vector3::new(2e-3, -3e-3, 4e-3));
        let places = [[0.05, 0.08], [-0.07, 0.03], [0.02, -0.09]];
        let mut frames = StarFrames::new();
        for (k, t) in t_s.iter().enumerate() {
            frames.begin(*t);
            for (id, [x, y]) in (0..).zip(places) {
                let seen = mount * q[k] * Vector3::new(x, y, 1.0).normalize();
                let at = camera.project(&seen).unwrap();
                // one of them for a while alone
                if id != 1 || (10..25).contains(&k) {
                    frames.push(id, i64::from(id), at.x, at.y);
                }
            }
        }
        let reference = AttitudeSeries::new(t_s, q, None).unwrap();
        let mut data = StarData::prepare(&Inputs {
            camera: &camera,
            frames: &frames,
            reference: Some(&reference),
            catalogue: None,
            phase: &OnCentroids::default(),
            effects: &[],
        });
        let (theta, more) = (
            Vector3::new(300.0, -500.0, 700.0),
            Vector3::new(4.0, -3.0, 5.0),
        );
        assert!(data.project_through(theta, 0.0, &reference, &[]));
        let before = data.clone();
        assert!(data.project_through(theta + more, 0.0, &reference, &[]));
        let scale = camera.arcsec_per_px();
        let mut largest = 0.0_f64;
        for frame in 0..data.frames.frames() {
            for row in data.frames.rows_of(frame) {
                for (axis, column) in before.misalignment_row(row, frame).into_iter().enumerate() {
                    let moved =
                        scale[axis] * (data.projected[axis][row] - before.projected[axis][row]);
                    let told = Vector3::from(column).dot(&more);
                    assert!((moved - told).abs() < 5e-4, "row {row}: {moved} {told}");
                    largest = largest.max(told.abs());
                }
            }
        }
        assert!(largest > 0.2, "{largest}");
    }
}
