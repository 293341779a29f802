//! Velocity aberration that nobody corrected.
//!
//! ```text
//! stars, velocity inertial      u' = (u + scale v/c) / |...|                    before the tracker
//! stars, velocity in tracker    w' = (w + scale v/c) / |...|                    w = q u
//!   columns, at tangent (x, y), n = sqrt(1 + x^2 + y^2), b = v/c in tracker axes:
//!     dx = f n (b_x - x b_z),   dy = f n (b_y - y b_z)                          per unit of scale
//! attitude, between two cameras   theta = scale (b_t - b_r) x v/c               b: boresights, body axes
//! attitude, against the truth     theta = scale z x (q v)/c
//! ```
//!
//! # Sign of theta
//!
//! A tracker that sees apparent stars but takes them for catalogue ones finds the rotation theta that
//! best explains them: `theta x w ~ v/c - (w.v/c) w` for stars w around its boresight b. At `w = b`,
//! `(b x v) x b = v - (b.v) b`, so theta = b x v/c; its component along b is zero, and the variation
//! over the field (a change of scale about the boresight) no rotation can follow. This is
//! `v_meas = v_true + theta x v_true`, the error of one camera in body axes. Both cameras err like
//! this; the residual `log(q_meas q_ref^-1)` is the difference, `theta_t - theta_r = (b_t - b_r) x v/c`.
//! Two cameras along one boresight show nothing.
//!
//! Quaternion axis k of the files may point along or against axis k of the frame of the vectors
//! (`quaternion_signs`): the k-th component of theta carries that sign. Where the bundle does not know
//! the signs, they are selectors (`"0+-"`), where 0 claims nothing on an axis: its quaternion may not
//! be given in that frame at all. The candidates are the patterns that differ by more than the sign of
//! `scale` (a negative estimate turns all signs round) on the axes where the arm lets anything show.
//!
//! Without channels, an orbit makes the velocity ([`orbit`] for how it enters a residual): circular, of `speed_m_s` and `period_s`, with the
//! argument of latitude `phase_rad` at t = 0:
//!
//! ```text
//! v = speed Rz(node) Rx(inclination) (-sin a, cos a, 0),   a = 2 pi t / period + phase      inertial
//! ```
//!
//! Nor does a velocity that hardly changes need channels, where stars have a catalogue and frames turn freely: the
//! scale of a frame is `1 - b.v/c` for its boresight b, wherever it looks. It is told as an orbit of a year. An orbit of
//! hours changes that scale.
//!
//! Source: first-order stellar aberration, `focal_plane::aberrated`; derivation above.

use std::collections::BTreeMap;

use focal_plane::{
    AttitudeSource, Camera, Pixel, PointsMut, SPEED_OF_LIGHT_M_S, Series, VectorsMut, aberrated,
};
use nalgebra::Vector3;
use star_tracker::{Disturbance, Stages, StarView};

use crate::candidate::check_columns;
use crate::parameters::Reader;
use crate::path::Held;
use crate::{
    ActsOn, AttitudeRows, Candidate, Coefficient, Effect, EffectError, EffectKind, Parameter,
    Parameters, Scene, StarRows, Surroundings, VectorFrame,
};

const ID: &str = "velocity_aberration";
const ORBIT: [&str; 5] = [
    "speed_m_s",
    "period_s",
    "phase_rad",
    "node_deg",
    "inclination_deg",
];

/// Channel names and m/s per unit.
const CHANNELS: [([&str; 3], f64); 2] = [
    (["vx_m_s", "vy_m_s", "vz_m_s"], 1.0),
    (["vx_km_s", "vy_km_s", "vz_km_s"], 1000.0),
];

mod orbit;

use orbit::Orbit;
pub use orbit::{
    SHORTEST_ORBIT_S, could_be_about_a_planet, free_orbit, nearest_circles, orbit_could_show,
};

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "the apparent direction is u + v/c, and nobody corrected it"
    }
    fn needs(&self) -> &'static str {
        "velocity channels (vx_km_s, vy_km_s, vz_km_s or in m/s), and for an attitude the boresights of [frames]; or an inertial reference, for an orbit that no channel tells; or a catalogue alone, for an orbit about a planet, and frames that look here and there for a steady velocity"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            stars: true,
            attitude: true,
            ..ActsOn::default()
        }
    }
    fn build(
        &self,
        parameters: &Parameters,
        surroundings: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let mut known = vec!["scale", "quaternion_signs"];
        known.extend(ORBIT);
        let reader = Reader::new(ID, parameters, &known)?;
        if reader.has("speed_m_s") {
            reader.exclude("speed_m_s", ["scale", "quaternion_signs"])?;
            let velocity = Velocity::Orbit(Orbit {
                speed_m_s: reader.required("speed_m_s")?,
                period_s: reader.within("period_s", [1e-3, 1e12], "positive")?,
                phase_rad: reader.number_or("phase_rad", 0.0)?,
                node_deg: reader.number_or("node_deg", 0.0)?,
                inclination_deg: reader.number_or("inclination_deg", 0.0)?,
            });
            return Ok(Box::new(Aberration {
                velocity,
                level: Level::Inertial,
                scale: 1.0,
            }));
        }
        reader.exclude("scale", ORBIT)?;
        let scale = reader.required("scale")?;
        let velocity = Velocity::channels(surroundings).ok_or(EffectError::NoChannel {
            effect: ID,
            channel: "vx_m_s, vy_m_s, vz_m_s (or vx_km_s, …)".to_owned(),
        })?;
        let signs = reader
            .text("quaternion_signs")?
            .map(parse_signs)
            .transpose()?;
        let level = Level::known(surroundings, signs)?;
        Ok(Box::new(Aberration {
            velocity,
            level,
            scale,
        }))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        let Some(velocity) = Velocity::channels(&scene.surroundings) else {
            // frames that turn freely show it by their scale alone, wherever they look
            let inertial = Level::known(&scene.surroundings, None) == Ok(Level::Inertial);
            let free = scene.has_stars && scene.has_catalogue && !scene.has_reference;
            let steady = (free && inertial).then(|| orbit::steady(scene.surroundings.span_s));
            return steady.into_iter().collect();
        };
        Level::possible(&scene.surroundings)
            .into_iter()
            .map(|(level, signs_free)| {
                let coefficients = [Coefficient::new("scale", "", 1.0)];
                let velocity = velocity.clone();
                Box::new(AberrationCandidate {
                    velocity,
                    level,
                    signs_free,
                    coefficients,
                }) as Box<dyn Candidate>
            })
            .collect()
    }
}

/// Where the velocity comes from.
#[derive(Clone, Debug)]
enum Velocity {
    Channels {
        axes: Box<[Series; 3]>,
        m_s_per_unit: f64,
    },
    Orbit(Orbit),
}

impl Velocity {
    fn channels(surroundings: &Surroundings<'_>) -> Option<Self> {
        CHANNELS.into_iter().find_map(|(names, m_s_per_unit)| {
            let mut axes = names.map(|name| surroundings.channels.get(name));
            let [x, y, z] = axes.each_mut().map(Option::take);
            Some(Self::Channels {
                axes: Box::new([x?.clone(), y?.clone(), z?.clone()]),
                m_s_per_unit,
            })
        })
    }

    /// v/c at a time; zero where the channels do not tell.
    fn over_c(&self, t_s: f64) -> Vector3<f64> {
        self.m_s(t_s) / SPEED_OF_LIGHT_M_S
    }

    fn m_s(&self, t_s: f64) -> Vector3<f64> {
        match self {
            Self::Channels { axes, m_s_per_unit } => {
                let [x, y, z] = axes.as_ref();
                let at = || Some(Vector3::new(x.at(t_s)?, y.at(t_s)?, z.at(t_s)?));
                at().unwrap_or_default() * *m_s_per_unit
            }
            Self::Orbit(orbit) => orbit.m_s(t_s),
        }
    }
}

/// Where the aberration shows.
#[derive(Clone, Debug, PartialEq)]
enum Level {
    /// On stars; velocity inertial.
    Inertial,
    /// On stars; velocity in tracker axes.
    Tracker,
    /// Between two cameras; velocity in the frame of the boresights.
    Cameras { arm: Vector3<f64>, signs: [f64; 3] },
}

impl Level {
    /// The level that the bundle's frames say, with the signs of the quaternion axes if it needs them.
    fn known(
        surroundings: &Surroundings<'_>,
        signs: Option<[f64; 3]>,
    ) -> Result<Self, EffectError> {
        let Some(frames) = surroundings.frames else {
            return Ok(Self::Inertial);
        };
        match frames.vectors_in {
            VectorFrame::Inertial => Ok(Self::Inertial),
            VectorFrame::Tracker if frames.reference_boresight.is_none() => Ok(Self::Tracker),
            VectorFrame::Tracker | VectorFrame::Body => {
                let arm = arm(surroundings).ok_or(EffectError::NoFrames {
                    effect: ID,
                    needed: "tracker_boresight and reference_boresight",
                })?;
                let signs = signs.or(frames.quaternion_signs).ok_or(EffectError::NoFrames {
                    effect: ID,
                    needed: "quaternion_signs (or give them as a parameter, for instance \"+-+\")",
                })?;
                Ok(Self::Cameras { arm, signs })
            }
        }
    }

    /// The levels that could be, and whether all their signs may be turned round together.
    fn possible(surroundings: &Surroundings<'_>) -> Vec<(Self, bool)> {
        if let Ok(level) = Self::known(surroundings, None) {
            return vec![(level, false)];
        }
        let Some(arm) = arm(surroundings) else {
            return Vec::new();
        };
        let mut patterns = Vec::new();
        for code in 0..27_u32 {
            let signs = [code / 9, code / 3 % 3, code % 3].map(|digit| f64::from(digit) - 1.0);
            // of two patterns that differ in all signs, the one whose first claim is positive
            let first = signs.iter().find(|s| **s != 0.0);
            let idle = (0..3).any(|k| signs[k] != 0.0 && !axis_shows(&arm, k));
            if first == Some(&1.0) && !idle {
                patterns.push((Self::Cameras { arm, signs }, true));
            }
        }
        patterns
    }

    fn selectors(&self) -> BTreeMap<String, String> {
        match self {
            Self::Cameras { signs, .. } => {
                let text = signs
                    .map(|s| match s {
                        s if s < 0.0 => '-',
                        s if s > 0.0 => '+',
                        _ => '0',
                    })
                    .iter()
                    .collect();
                BTreeMap::from([("quaternion_signs".to_owned(), text)])
            }
            Self::Inertial | Self::Tracker => BTreeMap::new(),
        }
    }
}

/// `b_t - b_r` in the frame of the vectors; `None` without both boresights.
fn arm(surroundings: &Surroundings<'_>) -> Option<Vector3<f64>> {
    let frames = surroundings.frames?;
    let tracker = match frames.vectors_in {
        VectorFrame::Tracker => Vector3::z(),
        VectorFrame::Body => frames.tracker_boresight?.normalize(),
        VectorFrame::Inertial => return None,
    };
    Some(tracker - frames.reference_boresight?.normalize())
}

/// Whether arm x v has a component along axis `k` for any v: it needs an arm across that axis.
fn axis_shows(arm: &Vector3<f64>, k: usize) -> bool {
    let across = arm[(k + 1) % 3].hypot(arm[(k + 2) % 3]);
    across > 1e-3 * arm.norm()
}

fn parse_signs(text: &str) -> Result<[f64; 3], EffectError> {
    let signs: Vec<f64> = text
        .chars()
        .filter_map(|c| match c {
            '+' => Some(1.0),
            '-' => Some(-1.0),
            '0' => Some(0.0),
            _ => None,
        })
        .collect();
    <[f64; 3]>::try_from(signs)
        .ok()
        .filter(|_| text.len() == 3)
        .ok_or(EffectError::WrongType {
            effect: ID,
            name: "quaternion_signs".to_owned(),
            expected: "three of +, - and 0, for instance \"0+-\"",
        })
}

/// Signed components of arm x v/c.
fn between_cameras(arm: &Vector3<f64>, signs: &[f64; 3], over_c: &Vector3<f64>) -> Vector3<f64> {
    arm.cross(over_c).component_mul(&Vector3::from(*signs))
}

#[derive(Clone, Debug)]
struct Aberration {
    velocity: Velocity,
    level: Level,
    scale: f64,
}

impl Disturbance for Aberration {
    fn stages(&self) -> Stages {
        match self.level {
            Level::Inertial => Stages {
                direction: true,
                ..Stages::NONE
            },
            Level::Tracker => Stages {
                tracker_direction: true,
                ..Stages::NONE
            },
            Level::Cameras { .. } => Stages {
                attitude: true,
                ..Stages::NONE
            },
        }
    }
    fn direction(&self, star: &StarView, u: Vector3<f64>) -> Vector3<f64> {
        aberrated(&u, &(self.velocity.m_s(star.t_s) * self.scale))
    }
    fn tracker_direction(&self, star: &StarView, v: Vector3<f64>) -> Vector3<f64> {
        aberrated(&v, &(self.velocity.m_s(star.t_s) * self.scale))
    }
    fn misalignment_rad(&self, t_s: f64) -> Vector3<f64> {
        match &self.level {
            Level::Cameras { arm, signs } => {
                between_cameras(arm, signs, &self.velocity.over_c(t_s)) * self.scale
            }
            Level::Inertial | Level::Tracker => Vector3::zeros(),
        }
    }
}

impl Effect for Aberration {
    fn id(&self) -> &'static str {
        ID
    }
    fn parameters(&self) -> Vec<Parameter> {
        match &self.velocity {
            Velocity::Channels { .. } => vec![Parameter::new("scale", self.scale, "")],
            Velocity::Orbit(orbit) => vec![
                Parameter::new("speed_m_s", orbit.speed_m_s, "m/s"),
                Parameter::new("period_s", orbit.period_s, "s"),
                Parameter::new("phase_rad", orbit.phase_rad, "rad"),
                Parameter::new("node_deg", orbit.node_deg, "deg"),
                Parameter::new("inclination_deg", orbit.inclination_deg, "deg"),
            ],
        }
    }
    fn selectors(&self) -> BTreeMap<String, String> {
        self.level.selectors()
    }
}

#[derive(Clone, Debug)]
struct AberrationCandidate {
    velocity: Velocity,
    level: Level,
    /// Whether the bundle leaves the signs open.
    signs_free: bool,
    coefficients: [Coefficient; 1],
}

impl AberrationCandidate {
    /// v/c in tracker axes for the star levels.
    fn in_tracker(&self, t_s: f64, attitude: Option<&mut Held<'_>>) -> Option<Vector3<f64>> {
        let over_c = self.velocity.over_c(t_s);
        match self.level {
            Level::Inertial => Some(attitude?.at(t_s)? * over_c),
            Level::Tracker => Some(over_c),
            Level::Cameras { .. } => None,
        }
    }

    fn needs(&self, attitude: Option<&dyn AttitudeSource>) -> bool {
        self.level != Level::Inertial || attitude.is_some()
    }
}

impl Candidate for AberrationCandidate {
    fn id(&self) -> &'static str {
        ID
    }
    fn selectors(&self) -> BTreeMap<String, String> {
        self.level.selectors()
    }
    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }
    fn choices(&self) -> usize {
        match &self.level {
            Level::Cameras { signs, .. } if self.signs_free => {
                signs.iter().filter(|s| **s != 0.0).count()
            }
            _ => 0,
        }
    }
    fn acts_on_stars(&self) -> bool {
        true
    }
    fn acts_on_attitude(&self) -> bool {
        true
    }
    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        check_columns(1, rows.len(), out.x.len());
        if !self.needs(rows.attitude) {
            return false;
        }
        let mut attitude = rows.attitude.map(Held::new);
        for (i, &t_s) in rows.t_s.iter().enumerate() {
            let [dx, dy] = if let Level::Cameras { arm, signs } = &self.level {
                let theta = between_cameras(arm, signs, &self.velocity.over_c(t_s));
                camera
                    .rotation_jacobian(rows.at(i))
                    .map(|j| j[0] * theta.x + j[1] * theta.y + j[2] * theta.z)
            } else {
                let b = self.in_tracker(t_s, attitude.as_mut()).unwrap_or_default();
                moved_px(camera, rows.at(i), &b)
            };
            out.x[i] = dx;
            out.y[i] = dy;
        }
        true
    }
    fn attitude_columns(&self, rows: &AttitudeRows<'_>, out: VectorsMut<'_>) -> bool {
        check_columns(1, rows.len(), out.x.len());
        if !self.needs(rows.attitude) {
            return false;
        }
        let mut attitude = rows.attitude.map(Held::new);
        for (i, &t_s) in rows.t_s.iter().enumerate() {
            let theta = if let Level::Cameras { arm, signs } = &self.level {
                between_cameras(arm, signs, &self.velocity.over_c(t_s))
            } else {
                let b = self.in_tracker(t_s, attitude.as_mut()).unwrap_or_default();
                Vector3::z().cross(&b)
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
        let (mut level, mut scale) = (self.level.clone(), values[0]);
        if let Level::Cameras { signs, .. } = &mut level
            && self.signs_free
            && scale < 0.0
        {
            *signs = signs.map(|s| -s);
            scale = -scale;
        }
        Ok(Box::new(Aberration {
            velocity: self.velocity.clone(),
            level,
            scale,
        }))
    }
}

/// Shift of a star at `at` when its direction w becomes w + d, d small, px.
///
/// ```text
/// w = (x, y, 1)/n:   dX/Z = n (d_x - x d_z),   dY/Z = n (d_y - y d_z)
/// ```
pub(crate) fn moved_px(camera: &Camera, at: Pixel, d: &Vector3<f64>) -> [f64; 2] {
    let t = camera.tangent(at);
    let n = (1.0 + t.x * t.x + t.y * t.y).sqrt();
    let [fx, fy] = camera.focal_length_px();
    [fx * n * (d.x - t.x * d.z), fy * n * (d.y - t.y * d.z)]
}

#[cfg(test)]
mod tests {
    use core::f64::consts::FRAC_PI_2;

    use focal_plane::{
        PointsMut as Out, UniformRotation, Vectors, rotation_from_vector, rotation_vector,
    };
    use nalgebra::UnitQuaternion;
    use star_tracker::{Measured, NoiseStreams, Pbm, Rows, Scratch};

    use super::*;

    /// A velocity along x at t = 0, constant in direction over the instants used.
    fn orbit(speed_m_s: f64, phase_rad: f64, node_deg: f64, inclination_deg: f64) -> Orbit {
        Orbit {
            speed_m_s,
            period_s: 6000.0,
            phase_rad,
            node_deg,
            inclination_deg,
        }
    }

    /// Attitude error, body axes, of a camera along `boresight` that ignores aberration by `velocity`
    /// (body axes), from the full model with 7 x 7 stars.
    fn error_of_camera(boresight: &Vector3<f64>, velocity: &Vector3<f64>) -> Vector3<f64> {
        let body_to_camera = UnitQuaternion::rotation_between(boresight, &Vector3::z()).unwrap();
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let stars: Vec<Vector3<f64>> = (0..49_u32)
            .map(|s| Pixel {
                x: 150.0 * (f64::from(s % 7) - 3.0),
                y: 150.0 * (f64::from(s / 7) - 3.0),
            })
            .map(|at| camera.direction(at))
            .collect();
        let axis = |k: usize| stars.iter().map(|v| v[k]).collect::<Vec<f64>>();
        let (x, y, z) = (axis(0), axis(1), axis(2));
        let in_camera = body_to_camera * velocity;
        let channel = |value: f64| Series::new(vec![-1.0, 1.0], vec![value; 2]).unwrap();
        let pbm = Pbm::new(camera).with_disturbance(Box::new(Aberration {
            velocity: Velocity::Channels {
                axes: Box::new([
                    channel(in_camera.x),
                    channel(in_camera.y),
                    channel(in_camera.z),
                ]),
                m_s_per_unit: 1.0,
            },
            level: Level::Tracker,
            scale: 1.0,
        }) as Box<dyn Disturbance>);
        let rows = Rows {
            t_s: &[0.0],
            first_row: &[0, 49],
            slot: &[],
            star_id: &[],
            mag: &[],
            bv: &[],
            direction: Vectors {
                x: &x,
                y: &y,
                z: &z,
            },
        };
        let mut measured = Measured::default();
        let mut streams = NoiseStreams::new(1, 0);
        let truth = UniformRotation::default();
        pbm.measure_into(
            &truth,
            rows,
            &mut streams,
            &mut Scratch::default(),
            &mut measured,
        );
        let error = rotation_vector(&measured.attitude(0).unwrap(), &UnitQuaternion::identity());
        body_to_camera.inverse() * error
    }

    /// What two cameras measure apart, each simulated in full, is `(b_t - b_r) x v/c`. For a field
    /// symmetric about its boresight the least-squares rotation is b x v/c times
    /// `<w_z> / (1 - <w_x^2>) = 1 + O(<r^2>^2)`, r^2 = 0.02 on average: 1e-3 covers it. Orders beyond
    /// the first in v/c are below 1e-4.
    #[test]
    fn two_simulated_cameras_differ_by_the_formula() {
        let tracker = Vector3::new(-0.587_785, 0.0, 0.809_017).normalize();
        let reference = Vector3::new(0.587_785, 0.0, 0.809_017).normalize();
        for velocity in [
            [8000.0, 0.0, 0.0],
            [0.0, 9000.0, 0.0],
            [3000.0, -5000.0, 7000.0],
        ] {
            let velocity = Vector3::from(velocity);
            let got = error_of_camera(&tracker, &velocity) - error_of_camera(&reference, &velocity);
            let over_c = velocity / SPEED_OF_LIGHT_M_S;
            let told = between_cameras(&(tracker - reference), &[1.0; 3], &over_c);
            assert!((got - told).norm() < 1.1e-3 * over_c.norm(), "{got} {told}");
        }
    }

    #[test]
    fn the_orbit_starts_at_its_phase_and_turns_with_its_plane() {
        let at = |orbit: Orbit, t_s: f64| Velocity::Orbit(orbit).m_s(t_s);
        // argument of latitude -90 deg: the ascending node lies ahead by a quarter
        let v = at(orbit(7500.0, -FRAC_PI_2, 0.0, 0.0), 0.0);
        assert!((v - Vector3::new(7500.0, 0.0, 0.0)).norm() < 1e-9);
        // at the ascending node of a polar orbit the velocity points north
        let v = at(orbit(7500.0, 0.0, 40.0, 90.0), 0.0);
        assert!((v - Vector3::new(0.0, 0.0, 7500.0)).norm() < 1e-9);
        // half a period later it points south, wherever the node is
        let v = at(orbit(7500.0, 0.0, 40.0, 90.0), 3000.0);
        assert!((v + Vector3::new(0.0, 0.0, 7500.0)).norm() < 1e-8);
    }

    /// \[M23\]-like field: a star across the velocity moves by v/c toward it, 20.5 arcsec at 29.8 km/s.
    #[test]
    fn stars_move_toward_the_velocity() {
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let pbm = Pbm::new(camera.clone()).with_disturbance(Box::new(Aberration {
            velocity: Velocity::Orbit(orbit(29_785.0, -FRAC_PI_2, 0.0, 0.0)),
            level: Level::Inertial,
            scale: 1.0,
        }) as Box<dyn Disturbance>);
        let truth = UniformRotation {
            at_start: rotation_from_vector(&Vector3::zeros()),
            ..UniformRotation::default()
        };
        let rows = Rows {
            t_s: &[0.0],
            first_row: &[0, 1],
            slot: &[],
            star_id: &[],
            mag: &[],
            bv: &[],
            direction: Vectors {
                x: &[0.0],
                y: &[0.0],
                z: &[1.0],
            },
        };
        let (mut x, mut y) = ([0.0], [0.0]);
        let out = Out {
            x: &mut x,
            y: &mut y,
        };
        pbm.positions_into(&truth, rows, &mut Scratch::default(), out);
        let moved = x[0] * camera.arcsec_per_px()[0];
        assert!((moved - 20.49).abs() < 0.01 && y[0].abs() < 1e-9, "{moved}");
    }
}
