//! Where a star would be seen a little later or earlier.
//!
//! ```text
//! P(t + d) = project( q(t + d) q(t)^-1 direction(P(t)) )
//!          ~ P + v d + a d^2 / 2                             without an attitude to follow
//! ```
//!
//! Source: the frames of `focal_plane` (`v_tracker = q v_inertial`).

use focal_plane::{AttitudeSource, Camera, Pixel};
use nalgebra::UnitQuaternion;

use crate::StarRows;

/// Gauss-Legendre nodes and weights on [-1, 1], exact to degree 15 (Abramowitz & Stegun, Table 25.4).
pub(crate) const GAUSS_LEGENDRE_8: [(f64, f64); 8] = [
    (-0.960_289_856_497_536_2, 0.101_228_536_290_376_26),
    (-0.796_666_477_413_626_7, 0.222_381_034_453_374_47),
    (-0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (-0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_47),
    (0.960_289_856_497_536_2, 0.101_228_536_290_376_26),
];

/// Follows the modelled path of star rows.
pub(crate) struct Path<'a> {
    camera: &'a Camera,
    rows: &'a StarRows<'a>,
    /// The attitude of the last row's time: rows of one frame share it.
    last: Option<(u64, UnitQuaternion<f64>)>,
}

impl<'a> Path<'a> {
    pub(crate) fn new(camera: &'a Camera, rows: &'a StarRows<'a>) -> Self {
        Self {
            camera,
            rows,
            last: None,
        }
    }

    /// Shift of row `i` between its time and `d_s` later, px.
    pub(crate) fn shift(&mut self, i: usize, d_s: f64) -> [f64; 2] {
        let at = self.rows.at(i);
        match self.seen(i, d_s) {
            Some(later) => [later.x - at.x, later.y - at.y],
            None => [
                d_s * (self.rows.vx_px_s[i] + 0.5 * d_s * self.rows.ax_px_s2[i]),
                d_s * (self.rows.vy_px_s[i] + 0.5 * d_s * self.rows.ay_px_s2[i]),
            ],
        }
    }

    fn seen(&mut self, i: usize, d_s: f64) -> Option<Pixel> {
        let (t_s, attitude) = (self.rows.t_s[i], self.rows.attitude?);
        let now = match self.last {
            Some((bits, q)) if bits == t_s.to_bits() => q,
            _ => attitude.attitude(t_s)?,
        };
        self.last = Some((t_s.to_bits(), now));
        let later = attitude.attitude(t_s + d_s)?;
        let v = self.camera.direction(self.rows.at(i));
        self.camera.project(&(later * (now.inverse() * v)))
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
