//! Time tag offset: a frame stamped t shows the sky of t + offset.
//!
//! ```text
//! forward     P(t + offset)
//! stars       dP = offset v            v: velocity of the image, px/s
//! attitude    theta = log( q(t + offset) q(t)^-1 ) ~ -offset omega        (dv/dt = -omega x v)
//! ```
//!
//! Re-linearised about an estimate, the columns become the chord of the path over that offset.
//!
//! Source: definition; the sign of theta follows from `v_meas = v + theta x v` and
//! `v(t + d) = v - d omega x v`.

use focal_plane::{Camera, PointsMut, VectorsMut};
use star_tracker::{Disturbance, Stages, StarView};

use crate::candidate::check_columns;
use crate::parameters::Reader;
use crate::path::{Path, mean_turn};
use crate::{
    ActsOn, AttitudeRows, Candidate, Coefficient, Effect, EffectError, EffectKind, Parameter,
    Parameters, Scene, StarRows, Surroundings,
};

const ID: &str = "time_tag_offset";
/// Largest offsets that a clock makes, or one frame taken for the next.
const MOST_S: f64 = 1.0;
const MOST_FRAMES: f64 = 1.5;

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "a frame stamped t shows the sky of t + offset_s"
    }
    fn needs(&self) -> &'static str {
        "stars, or an attitude with a reference, and a motion that the samples resolve"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            stars: true,
            ..ActsOn::default()
        }
    }
    fn build(
        &self,
        parameters: &Parameters,
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let reader = Reader::new(ID, parameters, &["offset_s"])?;
        Ok(Box::new(TimeTagOffset {
            offset_s: reader.required("offset_s")?,
        }))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        if !(scene.has_stars || scene.has_attitude && scene.has_reference) {
            return Vec::new();
        }
        let frames_s = scene.between_s().map_or(0.0, |s| MOST_FRAMES * s);
        let most_s = MOST_S.max(frames_s);
        vec![Box::new(OffsetCandidate::about(0.0, most_s))]
    }
}

#[derive(Clone, Debug)]
struct TimeTagOffset {
    offset_s: f64,
}

impl Disturbance for TimeTagOffset {
    fn stages(&self) -> Stages {
        Stages {
            instant: true,
            ..Stages::NONE
        }
    }
    fn time_shift_s(&self, _: &StarView) -> f64 {
        self.offset_s
    }
}

impl Effect for TimeTagOffset {
    fn id(&self) -> &'static str {
        ID
    }
    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new("offset_s", self.offset_s, "s")]
    }
}

#[derive(Clone, Debug)]
struct OffsetCandidate {
    about_s: f64,
    most_s: f64,
    coefficients: [Coefficient; 1],
}

impl OffsetCandidate {
    fn about(about_s: f64, most_s: f64) -> Self {
        let coefficient = Coefficient::new("offset_s", "s", 0.05)
            .at_least(-most_s)
            .at_most(most_s);
        Self {
            about_s,
            most_s,
            coefficients: [coefficient],
        }
    }
}

impl Candidate for OffsetCandidate {
    fn id(&self) -> &'static str {
        ID
    }
    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }
    fn refined(&self, values: &[f64]) -> Option<Box<dyn Candidate>> {
        values[0]
            .is_finite()
            .then(|| Box::new(Self::about(values[0], self.most_s)) as Box<dyn Candidate>)
    }
    fn acts_on_stars(&self) -> bool {
        true
    }
    fn acts_on_attitude(&self) -> bool {
        true
    }
    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        check_columns(1, rows.len(), out.x.len());
        if self.about_s.abs() < SMALLEST_S {
            out.x.copy_from_slice(rows.vx_px_s);
            out.y.copy_from_slice(rows.vy_px_s);
            return true;
        }
        let mut path = Path::new(camera, rows);
        for i in 0..rows.len() {
            let [dx, dy] = path.shift(i, self.about_s);
            out.x[i] = dx / self.about_s;
            out.y[i] = dy / self.about_s;
        }
        true
    }
    fn attitude_columns(&self, rows: &AttitudeRows<'_>, out: VectorsMut<'_>) -> bool {
        check_columns(1, rows.len(), out.x.len());
        let rated = rows.wx_rad_s.len() == rows.len();
        let mut hint = 0;
        for (i, &t_s) in rows.t_s.iter().enumerate() {
            let mut chord = || {
                let (source, d_s) = (rows.attitude?, self.about_s);
                if d_s.abs() < SMALLEST_S {
                    return source.rate_rad_s(t_s).map(|rate| -rate);
                }
                Some(mean_turn(source, t_s, d_s, 0.0, &mut hint)? / d_s)
            };
            let theta = match chord() {
                Some(theta) => theta,
                None if rated => {
                    -nalgebra::Vector3::new(rows.wx_rad_s[i], rows.wy_rad_s[i], rows.wz_rad_s[i])
                }
                None => return false,
            };
            out.x[i] = theta.x;
            out.y[i] = theta.y;
            out.z[i] = theta.z;
        }
        true
    }
    fn realise(
        &self,
        values: &[f64],
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        Ok(Box::new(TimeTagOffset {
            offset_s: values[0],
        }))
    }
}

/// Offsets below it are taken as zero: the chord of a path loses its digits in rounding.
const SMALLEST_S: f64 = 1e-6;
