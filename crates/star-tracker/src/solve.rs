//! Attitudes of measured frames: Step 5 alone.
//!
//! ```text
//! q = argmin sum |w_i - C v_i|^2          w: directions of the centroids, v: of the stars
//! ```
//!
//! Stars weigh alike. A row without position or direction (NaN) is left out.
//!
//! Source: \[M23\] Eq. 12 and section 2.5.

use focal_plane::{Camera, StarFrames, Vectors, VectorsMut};
use nalgebra::{Quaternion, UnitQuaternion};
use quest::{FrameStatus, ProfileBatch, QuaternionsMut, solve_batch_into};

/// Attitude of each frame from its centroids and the inertial directions of their stars; `None` where
/// they cannot fix one.
///
/// ```
/// use focal_plane::{Camera, StarFrames, Vectors};
/// let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0])?;
/// let mut frames = StarFrames::new();
/// frames.begin(0.0);
/// frames.push(0, 1, 0.0, 0.0);
/// frames.push(1, 2, 300.0, 0.0);
/// let x = 300.0 / camera.focal_length_px()[0];
/// let z = 1.0 / x.hypot(1.0);
/// let directions = Vectors { x: &[0.0, x * z], y: &[0.0; 2], z: &[1.0, z] };
/// let q = star_tracker::solve_frames(&camera, &frames, directions);
/// assert!(q[0].expect("two stars").angle() < 1e-12);
/// # Ok::<(), focal_plane::CameraError>(())
/// ```
///
/// # Panics
///
/// If there is not one direction for each row.
pub fn solve_frames(
    camera: &Camera,
    frames: &StarFrames,
    direction: Vectors<'_>,
) -> Vec<Option<UnitQuaternion<f64>>> {
    let (rows, count) = (frames.rows(), frames.frames());
    assert_eq!(direction.len(), rows, "one direction for each row");
    let [mut x, mut y, mut z] = [(); 3].map(|()| vec![0.0; rows]);
    camera.direction_into(
        frames.positions(),
        VectorsMut {
            x: &mut x,
            y: &mut y,
            z: &mut z,
        },
    );
    let known = |row: usize| x[row].is_finite() && direction.x[row].is_finite();
    let weights: Vec<f64> = (0..rows)
        .map(|row| f64::from(u8::from(known(row))))
        .collect();
    let mut profiles = ProfileBatch::default();
    profiles.accumulate(
        quest::Vectors {
            x: &x,
            y: &y,
            z: &z,
        },
        quest::Vectors {
            x: direction.x,
            y: direction.y,
            z: direction.z,
        },
        &weights,
        &frames.first_row,
    );
    let [mut qx, mut qy, mut qz, mut qw] = [(); 4].map(|()| vec![0.0; count]);
    let mut status = vec![FrameStatus::default(); count];
    let out = QuaternionsMut {
        x: &mut qx,
        y: &mut qy,
        z: &mut qz,
        w: &mut qw,
    };
    solve_batch_into(&profiles, out, &mut status);
    (0..count)
        .map(|k| {
            let q = Quaternion::new(qw[k], qx[k], qy[k], qz[k]);
            (status[k] == FrameStatus::Solved).then(|| UnitQuaternion::new_unchecked(q))
        })
        .collect()
}
