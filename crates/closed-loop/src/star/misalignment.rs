//! The misalignment, taken exactly.
//!
//! A camera that looks some arcmin beside its reference sees its stars elsewhere than a small rotation
//! says: to second order by `theta^2` and more towards the edge of the field, 0.5 arcsec for 300 arcsec
//! of misalignment, which is a pattern like a lens that bends. So the stars are projected through the
//! rotation that was found, and what the fit adds to it is small:
//!
//! ```text
//! P(theta) = project( exp(theta) q u ) = P(theta0) + J (theta - theta0) + ...
//! r = measured - P(theta0) + J theta0 - ...        = J theta + ...
//! ```
//!
//! With `J theta0` put back, the amplitudes of the columns J are the whole angles: their prior stays
//! about zero, and sums over the misalignment's columns stay what they were.
//!
//! Source: Gauss-Newton; the rotation group as in `focal_plane::attitude`.

use std::sync::Arc;

use effects::Effect;
use focal_plane::{ARCSEC_PER_RAD, AttitudeSource, rotation_from_vector};
use nalgebra::{UnitQuaternion, Vector3};

use crate::star::data::StarData;

/// What the square of a rotation may move all rows together by, in squared sigmas of one.
const NEGLIGIBLE: f64 = 0.01;
/// Larger ones, 10 deg, are no misalignments: an angle that the stars do not tell.
const MOST_ARCSEC: f64 = 36_000.0;

impl StarData {
    /// Projects the stars through the misalignment `theta`, arcsec, if that is off from the one they were
    /// projected through by so much that its square shows in noise of `variance`, arcsec^2; says whether.
    /// Modelled positions are then bare projections.
    pub(crate) fn project_through(
        &mut self,
        theta: Vector3<f64>,
        variance: f64,
        reference: &dyn AttitudeSource,
        effects: &[Arc<dyn Effect>],
    ) -> bool {
        if theta.norm().is_nan() || theta.norm() > MOST_ARCSEC {
            return false;
        }
        let off = (theta - self.misalignment).norm_squared() / ARCSEC_PER_RAD;
        if off * off * self.t_s.len() as f64 <= NEGLIGIBLE * variance {
            return false;
        }
        let back = self.turn().inverse();
        self.misalignment = theta;
        let turn = self.turn();
        for q in &mut self.attitude {
            *q = turn * back * *q;
        }
        self.take_directions();
        self.place_beside(reference, effects);
        true
    }

    /// Places the stars by a reference that the camera is turned against.
    pub(super) fn place_beside(
        &mut self,
        reference: &dyn AttitudeSource,
        effects: &[Arc<dyn Effect>],
    ) {
        let turned = Turned {
            source: reference,
            turn: self.turn(),
        };
        self.place(Some(&turned), effects);
    }

    /// The misalignment that the projection goes through.
    pub(crate) fn turn(&self) -> UnitQuaternion<f64> {
        rotation_from_vector(&(self.misalignment / ARCSEC_PER_RAD))
    }

    /// What the misalignment's columns make of it on a row of `frame`, arcsec: in the projection already.
    pub(crate) fn turned_arcsec(&self, row: usize, frame: usize) -> [f64; 2] {
        if self.misalignment == Vector3::zeros() {
            return [0.0; 2];
        }
        self.misalignment_row(row, frame)
            .map(|axis| Vector3::from(axis).dot(&self.misalignment))
    }
}

/// A motion seen by a camera that is turned against it.
struct Turned<'a> {
    source: &'a dyn AttitudeSource,
    turn: UnitQuaternion<f64>,
}

impl AttitudeSource for Turned<'_> {
    fn attitude(&self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        Some(self.turn * self.source.attitude(t_s)?)
    }

    fn attitude_near(&self, t_s: f64, hint: &mut usize) -> Option<UnitQuaternion<f64>> {
        Some(self.turn * self.source.attitude_near(t_s, hint)?)
    }

    fn turn(&self, t_s: f64, d_s: f64, hint: &mut usize) -> Option<UnitQuaternion<f64>> {
        Some(self.turn * self.source.turn(t_s, d_s, hint)? * self.turn.inverse())
    }

    fn rate_rad_s(&self, t_s: f64) -> Option<Vector3<f64>> {
        Some(self.turn * self.source.rate_rad_s(t_s)?)
    }

    fn span_s(&self) -> [f64; 2] {
        self.source.span_s()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::declared::OnCentroids;
    use crate::motion;
    use crate::star::data::{Inputs, Star};
    use effects::{ParameterValue, Parameters, Surroundings};
    use focal_plane::{AttitudeSeries, Camera, StarFrames};
    use std::collections::BTreeMap;

    const FRAMES: usize = 40;

    fn path(turn: UnitQuaternion<f64>) -> AttitudeSeries {
        let t_s: Vec<f64> = (0..FRAMES).map(|k| 0.5 * k as f64).collect();
        let swing = |t: &f64| Vector3::new(0.02 * (0.3 * t).sin(), 0.01 * t, -0.015 * t);
        let q = t_s
            .iter()
            .map(|t| turn * rotation_from_vector(&swing(t)))
            .collect();
        AttitudeSeries::new(t_s, q, None).unwrap()
    }

    /// Half a degree off, with a declared time tag of 40 ms (pixels): projected through the misalignment
    /// stars are where the true attitude has them, the residual is what the columns make of the
    /// misalignment, and the modelled position is the projection.
    #[test]
    fn projected_through_it_stars_are_where_they_are() {
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let theta = Vector3::new(900.0, -1200.0, 1500.0);
        let askew = path(rotation_from_vector(&(theta / ARCSEC_PER_RAD)).inverse());
        let straight = path(UnitQuaternion::identity());
        let channels = BTreeMap::new();
        let surroundings = Surroundings {
            camera: &camera,
            span_s: [0.0, 20.0],
            channels: &channels,
            frames: None,
        };
        let mut parameters = Parameters::new();
        parameters.insert("offset_s".to_owned(), ParameterValue::Number(0.04));
        let tag = effects::build("time_tag_offset", &parameters, &surroundings).unwrap();
        let effects: [Arc<dyn Effect>; 1] = [tag.into()];
        let places = [[0.05, 0.08], [-0.07, 0.03], [0.02, -0.09]];
        let star = |id: i64| {
            let [x, y] = *places.get(usize::try_from(id).ok()?)?;
            let direction = Vector3::new(x, y, 1.0).normalize();
            Some(Star {
                id,
                mag: 4.0,
                bv: 0.5,
                direction,
            })
        };
        let mut frames = StarFrames::new();
        for &t in &straight.t_s()[1..FRAMES - 1] {
            frames.begin(t);
            for id in 0..3 {
                frames.push(id, i64::from(id), 0.0, 0.0);
            }
        }
        let data = |reference| {
            StarData::prepare(&Inputs {
                camera: &camera,
                frames: &frames,
                reference: Some(reference),
                catalogue: Some(&star),
                phase: &OnCentroids::default(),
                effects: &effects,
            })
        };
        let (mut data, mut truth) = (data(&askew), data(&straight));
        // on the way, and back from too far
        for almost in [theta * 0.9, theta * 1.3, theta] {
            assert!(data.project_through(almost, 1e-4, &askew, &effects));
        }
        assert!(!data.project_through(theta + Vector3::x() * 0.1, 1e-4, &askew, &effects));
        let shift: [Vec<f64>; 2] = [0, 1].map(|axis| {
            (0..data.frames.frames())
                .flat_map(|k| data.frames.rows_of(k).map(move |row| (row, k)))
                .map(|(row, k)| data.turned_arcsec(row, k)[axis])
                .collect()
        });
        let (residual, bare) = (data.measured_residual(), truth.measured_residual());
        for axis in 0..2 {
            for row in 0..data.t_s.len() {
                let off = data.projected[axis][row] - truth.projected[axis][row];
                assert!(off.abs() < 1e-9, "row {row}: {off} px");
                let left = residual[axis][row] - shift[axis][row] - bare[axis][row];
                assert!(left.abs() < 1e-6, "row {row}: {left} arcsec");
            }
        }
        // and move as they do
        let t_s = data.frames.t_s.clone();
        data.follow(Some(
            &motion::around(&askew, &t_s, 1.0).turned(&data.turn()),
        ));
        truth.follow(Some(&motion::around(&straight, &t_s, 1.0)));
        for axis in 0..2 {
            for row in 0..data.t_s.len() {
                let (v, its) = (data.velocity[axis][row], truth.velocity[axis][row]);
                assert!(
                    (v - its).abs() < 1e-6 * (1.0 + its.abs()),
                    "row {row}: {v} {its} px/s"
                );
            }
        }
        assert!(shift[0].iter().any(|s| s.abs() > 900.0));
    }
}
