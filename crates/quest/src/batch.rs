//! Many frames at once: profiles as nine columns, quaternions as four, no allocation.
//!
//! ```text
//! B[k][frame] = sum over the frame's rows of a w_i v_j / sum a,   k = 3 i + j
//! ```
//!
//! Frames go through in groups of eight. The first pass is branch-free over a group; if some frame
//! of it fails the check of accuracy, gap or rotation, the second pass runs over the group and is
//! kept where it was needed; what fails that too is solved alone. A frame's result therefore does
//! not depend on its neighbours, and is bit for bit that of [`Profile::solve`].
//!
//! Source: as [`Profile`]; \[M23\] section 2.5.

use crate::error::QuestError;
use crate::profile::{Profile, second_pass, solve_guarded};
use crate::quartic::{FirstPass, Rows, first_pass};

/// Frames worked on together.
const LANES: usize = 8;

/// Directions as columns; one length.
#[derive(Clone, Copy, Debug)]
pub struct Vectors<'a> {
    /// First components.
    pub x: &'a [f64],
    /// Second components.
    pub y: &'a [f64],
    /// Third components.
    pub z: &'a [f64],
}

/// Where quaternions go, one column a component; inertial to tracker, scalar part not negative.
#[derive(Debug)]
pub struct QuaternionsMut<'a> {
    /// Vector part, x.
    pub x: &'a mut [f64],
    /// Vector part, y.
    pub y: &'a mut [f64],
    /// Vector part, z.
    pub z: &'a mut [f64],
    /// Scalar part.
    pub w: &'a mut [f64],
}

/// What became of a frame of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrameStatus {
    /// Its quaternion is written.
    #[default]
    Solved,
    /// Fewer than two stars, or a gap below [`MIN_GAP`](crate::MIN_GAP); its quaternion is NaN.
    Degenerate,
    /// Its profile is not finite, or a weight was negative; its quaternion is NaN.
    NotFinite,
}

/// Profiles of many frames, one column a matrix element.
///
/// ```
/// use quest::{FrameStatus, ProfileBatch, QuaternionsMut, Vectors, solve_batch_into};
/// // two frames of two stars each; the second tracker is turned by 180 degrees about z
/// let measured = Vectors { x: &[1., 0., -1., 0.], y: &[0., 1., 0., -1.], z: &[0.; 4] };
/// let reference = Vectors { x: &[1., 0., 1., 0.], y: &[0., 1., 0., 1.], z: &[0.; 4] };
/// let mut profiles = ProfileBatch::default();
/// profiles.accumulate(measured, reference, &[1.0; 4], &[0, 2, 4]);
///
/// let (mut x, mut y, mut z, mut w) = ([0.0; 2], [0.0; 2], [0.0; 2], [0.0; 2]);
/// let mut status = [FrameStatus::default(); 2];
/// let out = QuaternionsMut { x: &mut x, y: &mut y, z: &mut z, w: &mut w };
/// assert_eq!(solve_batch_into(&profiles, out, &mut status), 2);
/// assert!((w[0] - 1.0).abs() < 1e-15 && (z[1].abs() - 1.0).abs() < 1e-15);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProfileBatch {
    b: [Vec<f64>; 9],
}

impl ProfileBatch {
    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.b[0].len()
    }

    /// Sets the number of frames; new ones hold zeros, which are degenerate. Allocates only beyond
    /// the largest number held so far.
    pub fn resize(&mut self, frames: usize) {
        for column in &mut self.b {
            column.resize(frames, 0.0);
        }
    }

    /// The profile of one frame.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    #[must_use]
    pub fn profile(&self, frame: usize) -> Profile {
        Profile(std::array::from_fn(|k| self.b[k][frame]))
    }

    /// Sets the profile of one frame.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    pub fn set_profile(&mut self, frame: usize, profile: Profile) {
        for (column, value) in self.b.iter_mut().zip(profile.0) {
            column[frame] = value;
        }
    }

    /// Builds the profiles of frames whose rows follow each other: frame k has rows
    /// `first_row[k]..first_row[k + 1]`, so `first_row` is one longer than there are frames.
    ///
    /// Vectors are taken to be of unit length (an error of 1e-6 changes their weight by as much).
    /// Weights are normalised within each frame; a row of weight zero is left out whatever its
    /// vectors hold, a negative weight makes its frame [`FrameStatus::NotFinite`].
    ///
    /// # Panics
    ///
    /// If columns differ in length, or `first_row` is empty, decreases, or exceeds the rows.
    pub fn accumulate(
        &mut self,
        measured: Vectors<'_>,
        reference: Vectors<'_>,
        weights: &[f64],
        first_row: &[usize],
    ) {
        let rows = weights.len();
        for column in [
            measured.x,
            measured.y,
            measured.z,
            reference.x,
            reference.y,
            reference.z,
        ] {
            assert_eq!(column.len(), rows, "every column needs one entry a row");
        }
        assert!(
            !first_row.is_empty(),
            "first_row needs one entry more than frames"
        );
        self.resize(first_row.len() - 1);
        for (frame, ends) in first_row.windows(2).enumerate() {
            let range = ends[0]..ends[1];
            let b = frame_profile(
                [
                    &measured.x[range.clone()],
                    &measured.y[range.clone()],
                    &measured.z[range.clone()],
                ],
                [
                    &reference.x[range.clone()],
                    &reference.y[range.clone()],
                    &reference.z[range.clone()],
                ],
                &weights[range],
            );
            self.set_profile(frame, Profile(b));
        }
    }
}

/// One frame's profile at unit total weight; zeros without stars.
#[inline(always)]
fn frame_profile(w: [&[f64]; 3], v: [&[f64]; 3], weights: &[f64]) -> Rows {
    let n = weights.len();
    let (w, v) = (w.map(|c| &c[..n]), v.map(|c| &c[..n]));
    let mut b = [0.0; 9];
    let mut total = 0.0;
    for k in 0..n {
        let a = weights[k];
        if a == 0.0 {
            continue;
        }
        let a = if a > 0.0 { a } else { f64::NAN };
        total += a;
        let (x, y, z) = (a * w[0][k], a * w[1][k], a * w[2][k]);
        for j in 0..3 {
            b[j] += x * v[j][k];
            b[3 + j] += y * v[j][k];
            b[6 + j] += z * v[j][k];
        }
    }
    if total == 0.0 {
        return [0.0; 9];
    }
    let scale = 1.0 / total;
    b.map(|x| x * scale)
}

/// Solves every profile; returns how many frames were solved. Frames that were not hold NaN, and
/// `status` says why.
///
/// # Panics
///
/// If an output column differs in length from the batch.
pub fn solve_batch_into(
    profiles: &ProfileBatch,
    out: QuaternionsMut<'_>,
    status: &mut [FrameStatus],
) -> usize {
    let frames = profiles.frames();
    let QuaternionsMut { x, y, z, w } = out;
    for column in [&*x, &*y, &*z, &*w] {
        assert_eq!(column.len(), frames, "one quaternion a frame");
    }
    assert_eq!(status.len(), frames, "one status a frame");

    let mut solved = 0;
    let mut start = 0;
    while start < frames {
        let n = LANES.min(frames - start);
        let b = load(profiles, start, n);
        let (q, state) = solve_group(&b, n);
        x[start..start + n].copy_from_slice(&q[0][..n]);
        y[start..start + n].copy_from_slice(&q[1][..n]);
        z[start..start + n].copy_from_slice(&q[2][..n]);
        w[start..start + n].copy_from_slice(&q[3][..n]);
        status[start..start + n].copy_from_slice(&state[..n]);
        solved += state[..n]
            .iter()
            .filter(|&&s| s == FrameStatus::Solved)
            .count();
        start += n;
    }
    solved
}

/// Up to eight frames; the lanes left over hold the profile of three perfect stars.
#[inline(always)]
fn load(profiles: &ProfileBatch, start: usize, n: usize) -> [[f64; LANES]; 9] {
    let mut b = [[0.0; LANES]; 9];
    if n < LANES {
        for k in [0, 4, 8] {
            b[k] = [1.0 / 3.0; LANES];
        }
    }
    for (lane, column) in b.iter_mut().zip(&profiles.b) {
        lane[..n].copy_from_slice(&column[start..start + n]);
    }
    b
}

#[inline(always)]
fn rows(b: &[[f64; LANES]; 9], lane: usize) -> Rows {
    let mut out = [0.0; 9];
    for k in 0..9 {
        out[k] = b[k][lane];
    }
    out
}

#[inline(always)]
fn solve_group(b: &[[f64; LANES]; 9], n: usize) -> ([[f64; LANES]; 4], [FrameStatus; LANES]) {
    let mut q = [[0.0; LANES]; 4];
    let (mut lambda, mut gap_bound) = ([0.0; LANES], [0.0; LANES]);
    let (mut last_step, mut scalar2) = ([0.0; LANES], [0.0; LANES]);
    for l in 0..LANES {
        let pass = first_pass(&rows(b, l));
        for i in 0..4 {
            q[i][l] = pass.q[i];
        }
        (lambda[l], gap_bound[l]) = (pass.lambda, pass.gap_bound);
        (last_step[l], scalar2[l]) = (pass.last_step, pass.scalar2);
    }
    let pass = |q: &[[f64; LANES]; 4], l: usize| FirstPass {
        q: [q[0][l], q[1][l], q[2][l], q[3][l]],
        lambda: lambda[l],
        gap_bound: gap_bound[l],
        last_step: last_step[l],
        scalar2: scalar2[l],
    };
    let mut all = true;
    for l in 0..LANES {
        all &= pass(&q, l).is_final();
    }
    let mut status = [FrameStatus::Solved; LANES];
    if all {
        return (q, status);
    }

    let first = q;
    for l in 0..LANES {
        let pass = pass(&first, l);
        let (better, _) = second_pass(&rows(b, l), &pass);
        let keep = pass.is_final();
        for i in 0..4 {
            q[i][l] = if keep { first[i][l] } else { better[i] };
        }
    }
    for l in 0..n {
        if pass(&first, l).has_root() {
            continue;
        }
        let alone = solve_guarded(&rows(b, l));
        status[l] = match alone {
            Ok(_) => FrameStatus::Solved,
            Err(QuestError::NotFinite { .. }) => FrameStatus::NotFinite,
            Err(_) => FrameStatus::Degenerate,
        };
        let values = alone.map_or([f64::NAN; 4], |raw| raw.q);
        for i in 0..4 {
            q[i][l] = values[i];
        }
    }
    (q, status)
}
