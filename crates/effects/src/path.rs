//! Where a star would be seen a little later or earlier.
//!
//! ```text
//! P(t + d) = project( q(t + d) q(t)^-1 direction(P(t)) )
//!          ~ P + v d + a d^2 / 2                             without an attitude to follow
//! ```
//!
//! Source: the frames of `focal_plane` (`v_tracker = q v_inertial`).

use focal_plane::{AttitudeSource, Camera, rotation_vector};
use nalgebra::{UnitQuaternion, Vector3};
use star_tracker::GAUSS_LEGENDRE_8;

use crate::StarRows;

/// Mean turn of the tracker from `t_s` to an exposure of `exposure_s` about `t_s + shift_s`, rad, tracker axes:
/// the mean of `log( q(t + shift + s) q(t)^-1 )`. `None` where `source` does not know the path. `hint` is that of
/// [`AttitudeSource::turn`].
pub fn mean_turn(
    source: &dyn AttitudeSource,
    t_s: f64,
    shift_s: f64,
    exposure_s: f64,
    hint: &mut usize,
) -> Option<Vector3<f64>> {
    let mut turn = |d_s: f64| {
        let turn = source.turn(t_s, d_s, hint)?;
        Some(rotation_vector(&turn, &UnitQuaternion::identity()))
    };
    if exposure_s <= 0.0 {
        return turn(shift_s);
    }
    let mut mean = Vector3::zeros();
    for (node, weight) in GAUSS_LEGENDRE_8 {
        mean += turn(shift_s + 0.5 * exposure_s * node)? * (0.5 * weight);
    }
    Some(mean)
}

/// Follows the modelled path of star rows.
pub(crate) struct Path<'a> {
    camera: &'a Camera,
    rows: &'a StarRows<'a>,
    hint: usize,
}

impl<'a> Path<'a> {
    pub(crate) fn new(camera: &'a Camera, rows: &'a StarRows<'a>) -> Self {
        Self {
            camera,
            rows,
            hint: 0,
        }
    }

    /// Shift of row `i` between its time and `d_s` later, px.
    pub(crate) fn shift(&mut self, i: usize, d_s: f64) -> [f64; 2] {
        let turn = self.turn(i, d_s);
        self.shift_by(i, d_s, turn.as_ref())
    }

    /// How the tracker turns between the time of row `i` and `d_s` later: the same for all rows of a
    /// frame. `None` without an attitude to follow.
    pub(crate) fn turn(&mut self, i: usize, d_s: f64) -> Option<UnitQuaternion<f64>> {
        let attitude = self.rows.attitude?;
        attitude.turn(self.rows.t_s[i], d_s, &mut self.hint)
    }

    /// Shift of row `i` by a [`turn`](Self::turn), px.
    pub(crate) fn shift_by(
        &self,
        i: usize,
        d_s: f64,
        turn: Option<&UnitQuaternion<f64>>,
    ) -> [f64; 2] {
        let at = self.rows.at(i);
        let later = turn.and_then(|q| self.camera.project(&(q * self.camera.direction(at))));
        match later {
            Some(later) => [later.x - at.x, later.y - at.y],
            None => [
                d_s * (self.rows.vx_px_s[i] + 0.5 * d_s * self.rows.ax_px_s2[i]),
                d_s * (self.rows.vy_px_s[i] + 0.5 * d_s * self.rows.ay_px_s2[i]),
            ],
        }
    }
}

/// Attitude at a time, remembered while the time stays the same.
pub(crate) struct Held<'a> {
    source: &'a dyn AttitudeSource,
    last: Option<(u64, Option<UnitQuaternion<f64>>)>,
}

impl<'a> Held<'a> {
    pub(crate) fn new(source: &'a dyn AttitudeSource) -> Self {
        Self { source, last: None }
    }

    pub(crate) fn at(&mut self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        match self.last {
            Some((bits, q)) if bits == t_s.to_bits() => q,
            _ => {
                let q = self.source.attitude(t_s);
                self.last = Some((t_s.to_bits(), q));
                q
            }
        }
    }
}
