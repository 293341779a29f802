//! The velocity of a circular orbit, and the aberration that one of unknown size and plane makes.
//!
//! ```text
//! v(t) = s R (-sin a, cos a, 0),     a = 2 pi (t - m) / P,    R = Rz(node) Rx(inclination) Rz(phase at m)
//! dv   = ds v/s + s R (rho x e(a)) + s R e'(a) (2 pi (t - m)/P) k           e = (-sin a, cos a, 0)
//! ```
//!
//! m: the middle of the data. A velocity is linear in its size, but not in its plane, its phase and its
//! period: these enter as small turns rho (about the axes of R) and a small stretch k of the frequency, all
//! times s, so that five coefficients in m/s tell the orbit and every one that is near it, and beside
//! the first the others vanish once the columns are taken about the best orbit ([`Candidate::refined`]).
//!
//! Which orbit that is tells a fit without the law of circles: with inertial vectors A and B
//!
//! ```text
//! v(t) = A cos a + B sin a           a circle has A = s R y, B = -s R x
//! ```
//!
//! six coefficients for each period that is tried ([`free_orbit`]), and the circle nearest to them in units
//! of their errors ([`nearest_circles`]).
//!
//! Source: first-order stellar aberration, `focal_plane::aberrated`; Levenberg 1944 for the nearest circle.

use core::f64::consts::{FRAC_PI_2, TAU};

use focal_plane::{Camera, PointsMut, SPEED_OF_LIGHT_M_S, VectorsMut};
use nalgebra::{Matrix6, Rotation3, SMatrix, SVector, Vector3, Vector6};

use super::{Aberration, ID, Level, Velocity, moved_px};
use crate::candidate::check_columns;
use crate::path::Held;
use crate::{AttitudeRows, Candidate, Coefficient, Effect, EffectError, StarRows, Surroundings};

/// A year, s: sidereal.
const YEAR_S: f64 = 365.256_363 * 86_400.0;
/// Speed that would not surprise, m/s.
const PLAUSIBLE_M_S: f64 = 3000.0;
/// Largest turn, and share of the frequency, by which columns are taken elsewhere at once.
const STEP: f64 = 0.5;
/// Circles whose frames differ by more than this are two.
const APART: f64 = 0.1;
/// Beside the surface of solid osmium an orbit takes sqrt(3 pi / G rho) = 42 minutes, s: nature has no faster one.
pub const SHORTEST_ORBIT_S: f64 = 2500.0;
/// No planet is denser than the Earth, sqrt(3 pi / G rho) = 5061 s, and of the giants none than Neptune, s.
const BESIDE_THE_EARTH_S: f64 = 5061.0;
const BESIDE_A_GIANT_S: f64 = 9365.0;
/// G M of the heaviest of those that are no giants, and of Jupiter, m^3/s^2.
const EARTH_M3_S2: f64 = 3.986e14;
const JUPITER_M3_S2: f64 = 1.267e17;
/// How likely a faster one is beside the others: five nats. Against a slow error of the reference, which one to two turns
/// in the span follow nearly as well, its five parameters are worth a nat or two more in one of 30 draws.
const UNNATURAL: f64 = 1.0 / 150.0;
/// Steps towards the nearest circle.
const STEPS: usize = 30;
/// Coefficients of an orbit whose columns are linear about it.
const LINEAR: usize = 5;

/// A circular orbit.
#[derive(Clone, Debug)]
pub(super) struct Orbit {
    pub(super) speed_m_s: f64,
    pub(super) period_s: f64,
    pub(super) phase_rad: f64,
    pub(super) node_deg: f64,
    pub(super) inclination_deg: f64,
}

impl Orbit {
    /// Velocity, inertial.
    pub(super) fn m_s(&self, t_s: f64) -> Vector3<f64> {
        let (sin, cos) = (TAU * t_s / self.period_s + self.phase_rad).sin_cos();
        let node = Rotation3::from_axis_angle(&Vector3::z_axis(), self.node_deg.to_radians());
        let tilt =
            Rotation3::from_axis_angle(&Vector3::x_axis(), self.inclination_deg.to_radians());
        node * tilt * Vector3::new(-sin, cos, 0.0) * self.speed_m_s
    }
}

/// An orbit by its frame at `middle_s`: the velocity there is along y of `frame`, and its pole along z.
#[derive(Clone, Copy, Debug)]
struct Circle {
    frame: Rotation3<f64>,
    period_s: f64,
    middle_s: f64,
}

impl Circle {
    /// The five columns at a time, m/s per m/s, inertial.
    fn columns(&self, t_s: f64) -> [Vector3<f64>; LINEAR] {
        let angle = TAU * (t_s - self.middle_s) / self.period_s;
        let (sin, cos) = angle.sin_cos();
        let along = Vector3::new(-sin, cos, 0.0);
        let turned = |axis: Vector3<f64>| self.frame * axis.cross(&along);
        let later = self.frame * Vector3::new(-cos, -sin, 0.0);
        [
            self.frame * along,
            turned(Vector3::x()),
            turned(Vector3::y()),
            later,
            later * angle,
        ]
    }

    /// Speed and circle that coefficients tell; steps are no longer than [`STEP`].
    fn told_by(&self, values: &[f64]) -> Option<(f64, Self)> {
        let speed = values[0];
        if speed == 0.0 || !values.iter().all(|v| v.is_finite()) {
            return None;
        }
        let step = |k: usize| (values[k] / speed).clamp(-STEP, STEP);
        let turn = Rotation3::from_scaled_axis(Vector3::new(step(1), step(2), step(3)));
        // velocities the other way round are half an orbit ahead
        let ahead = if speed < 0.0 {
            core::f64::consts::PI
        } else {
            0.0
        };
        let ahead = Rotation3::from_axis_angle(&Vector3::z_axis(), ahead);
        let circle = Self {
            frame: self.frame * turn * ahead,
            period_s: self.period_s / (1.0 + step(4)),
            ..*self
        };
        Some((speed.abs(), circle))
    }

    fn orbit(&self, speed_m_s: f64) -> Orbit {
        let r = self.frame.matrix();
        let inclination = r[(2, 2)].clamp(-1.0, 1.0).acos();
        // of an orbit in the equator the node is where x is
        let [node, at_middle] = if inclination.sin() > 1e-9 {
            [r[(0, 2)].atan2(-r[(1, 2)]), r[(2, 0)].atan2(r[(2, 1)])]
        } else {
            [0.0, (r[(2, 2)] * r[(1, 0)]).atan2(r[(0, 0)])]
        };
        let phase = at_middle - TAU * self.middle_s / self.period_s;
        Orbit {
            speed_m_s,
            period_s: self.period_s,
            phase_rad: phase - TAU * (phase / TAU).round(),
            node_deg: node.to_degrees().rem_euclid(360.0),
            inclination_deg: inclination.to_degrees(),
        }
    }
}

/// Regressors of velocities: functions of time, inertial, m/s per unit of each coefficient.
trait Velocities: Clone + core::fmt::Debug + Send + Sync {
    const COUNT: usize;
    /// `out`: one a coefficient.
    fn at(&self, t_s: f64, out: &mut [Vector3<f64>]);
    /// Whether nature has such orbits.
    fn is_natural(&self) -> bool {
        true
    }
}

impl Velocities for Circle {
    const COUNT: usize = LINEAR;
    fn at(&self, t_s: f64, out: &mut [Vector3<f64>]) {
        out.copy_from_slice(&self.columns(t_s));
    }
    fn is_natural(&self) -> bool {
        self.period_s >= SHORTEST_ORBIT_S
    }
}

/// A and B of one period.
#[derive(Clone, Copy, Debug)]
struct Free {
    period_s: f64,
    middle_s: f64,
}

impl Velocities for Free {
    const COUNT: usize = 6;
    fn at(&self, t_s: f64, out: &mut [Vector3<f64>]) {
        let (sin, cos) = (TAU * (t_s - self.middle_s) / self.period_s).sin_cos();
        for k in 0..3 {
            out[k] = Vector3::ith(k, cos);
            out[3 + k] = Vector3::ith(k, sin);
        }
    }
}

/// The same velocity all the time.
#[derive(Clone, Copy, Debug)]
struct Steady {
    middle_s: f64,
}

impl Velocities for Steady {
    const COUNT: usize = 3;
    fn at(&self, _: f64, out: &mut [Vector3<f64>]) {
        for (k, v) in out.iter_mut().enumerate() {
            *v = Vector3::ith(k, 1.0);
        }
    }
}

/// Most coefficients of any.
const MOST: usize = 6;

/// Calls `use_columns` with the number of each row and v/c in tracker axes, one a coefficient; false without
/// an attitude to turn by.
fn in_tracker<V: Velocities>(
    velocities: &V,
    attitude: Option<&dyn focal_plane::AttitudeSource>,
    t_s: &[f64],
    mut use_columns: impl FnMut(usize, &[Vector3<f64>]),
) -> bool {
    let Some(attitude) = attitude else {
        return false;
    };
    let mut held = Held::new(attitude);
    let mut now = [Vector3::zeros(); MOST];
    let now = &mut now[..V::COUNT];
    for (i, &t) in t_s.iter().enumerate() {
        // rows of one frame share their time
        if i == 0 || t.to_bits() != t_s[i - 1].to_bits() {
            velocities.at(t, now);
            let turn = held.at(t).map(|q| q.to_rotation_matrix());
            for v in now.iter_mut() {
                *v = turn.map_or_else(Vector3::zeros, |q| q * *v / SPEED_OF_LIGHT_M_S);
            }
        }
        use_columns(i, now);
    }
    true
}

/// Aberration by velocities of unknown size.
#[derive(Clone, Debug)]
struct OrbitCandidate<V> {
    velocities: V,
    coefficients: Vec<Coefficient>,
    picked_from: usize,
}

impl<V: Velocities> OrbitCandidate<V> {
    fn of(velocities: V, names: &[&str], picked_from: usize) -> Self {
        let coefficient = |name: &&str| Coefficient::new(*name, "m/s", PLAUSIBLE_M_S);
        Self {
            velocities,
            coefficients: names.iter().map(coefficient).collect(),
            picked_from,
        }
    }

    fn about(circle: Circle, picked_from: usize) -> OrbitCandidate<Circle> {
        const NAMES: [&str; LINEAR] = ["speed_m_s", "tilt_x", "tilt_y", "advance", "stretch"];
        OrbitCandidate::of(circle, &NAMES, picked_from)
    }
}

/// What the orbits of a candidate say, beside their columns.
trait Told {
    fn refined(&self, values: &[f64]) -> Option<Box<dyn Candidate>>;
    fn orbit(&self, values: &[f64]) -> Orbit;
}

impl Told for OrbitCandidate<Circle> {
    fn refined(&self, values: &[f64]) -> Option<Box<dyn Candidate>> {
        let (_, circle) = self.velocities.told_by(values)?;
        Some(Box::new(Self::about(circle, self.picked_from)))
    }
    fn orbit(&self, values: &[f64]) -> Orbit {
        let told = self.velocities.told_by(values);
        let (speed, circle) = told.unwrap_or((0.0, self.velocities));
        circle.orbit(speed)
    }
}

impl Told for OrbitCandidate<Free> {
    fn refined(&self, _: &[f64]) -> Option<Box<dyn Candidate>> {
        None
    }
    fn orbit(&self, values: &[f64]) -> Orbit {
        let all = Matrix6::identity();
        let nearest = circles_of(&Vector6::from_column_slice(values), &all);
        let Climbed { speed, frame, .. } = nearest[0];
        let Free { period_s, middle_s } = self.velocities;
        let circle = Circle {
            frame,
            period_s,
            middle_s,
        };
        circle.orbit(speed)
    }
}

impl Told for OrbitCandidate<Steady> {
    fn refined(&self, _: &[f64]) -> Option<Box<dyn Candidate>> {
        None
    }
    /// As an orbit about the Sun has it in the middle of the data, where it passes its northernmost or southernmost
    /// direction.
    fn orbit(&self, values: &[f64]) -> Orbit {
        let v = Vector3::new(values[0], values[1], values[2]);
        let speed_m_s = v.norm();
        let north = (v.z / speed_m_s.max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0);
        let phase = -TAU * self.velocities.middle_s / YEAR_S;
        Orbit {
            speed_m_s,
            period_s: YEAR_S,
            phase_rad: phase - TAU * (phase / TAU).round(),
            node_deg: (-v.x).atan2(v.y).to_degrees().rem_euclid(360.0),
            inclination_deg: north.asin().to_degrees(),
        }
    }
}

impl<V: Velocities> Candidate for OrbitCandidate<V>
where
    Self: Told,
{
    fn id(&self) -> &'static str {
        ID
    }
    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }
    fn slopes(&self) -> usize {
        usize::from(V::COUNT == LINEAR)
    }
    fn stands_for(&self) -> f64 {
        self.picked_from as f64
    }
    fn credit(&self) -> f64 {
        if self.velocities.is_natural() {
            1.0
        } else {
            UNNATURAL
        }
    }
    fn refined(&self, values: &[f64]) -> Option<Box<dyn Candidate>> {
        Told::refined(self, values)
    }
    fn acts_on_stars(&self) -> bool {
        true
    }
    fn acts_on_attitude(&self) -> bool {
        true
    }
    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        let n = rows.len();
        check_columns(V::COUNT, n, out.x.len());
        in_tracker(&self.velocities, rows.attitude, rows.t_s, |i, columns| {
            for (j, b) in columns.iter().enumerate() {
                [out.x[j * n + i], out.y[j * n + i]] = moved_px(camera, rows.at(i), b);
            }
        })
    }
    fn attitude_columns(&self, rows: &AttitudeRows<'_>, out: VectorsMut<'_>) -> bool {
        let n = rows.len();
        check_columns(V::COUNT, n, out.x.len());
        in_tracker(&self.velocities, rows.attitude, rows.t_s, |i, columns| {
            for (j, b) in columns.iter().enumerate() {
                let theta = Vector3::z().cross(b);
                out.x[j * n + i] = theta.x;
                out.y[j * n + i] = theta.y;
                out.z[j * n + i] = theta.z;
            }
        })
    }
    fn realise(
        &self,
        values: &[f64],
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        Ok(Box::new(Aberration {
            velocity: Velocity::Orbit(self.orbit(values)),
            level: Level::Inertial,
            scale: 1.0,
        }))
    }
}

/// Aberration by a velocity that hardly changes in `span_s`, as that of the Earth in a day.
pub(super) fn steady(span_s: [f64; 2]) -> Box<dyn Candidate> {
    const NAMES: [&str; 3] = ["vx_m_s", "vy_m_s", "vz_m_s"];
    let middle_s = 0.5 * (span_s[0] + span_s[1]);
    Box::new(OrbitCandidate::of(Steady { middle_s }, &NAMES, 1))
}

/// Whether an orbit could show: against an inertial reference that is no camera on the same spacecraft, and
/// where no channel tells the velocity.
pub fn orbit_could_show(surroundings: &Surroundings<'_>) -> bool {
    let camera = surroundings
        .frames
        .is_some_and(|f| f.reference_boresight.is_some());
    !camera && Velocity::channels(surroundings).is_none()
}

/// Whether a circle about a planet of the Sun may have this period, s, or one up to `longest_s`, and at least this
/// speed, m/s: `v^3 = 2 pi G M / P`.
pub fn could_be_about_a_planet(period_s: f64, longest_s: f64, least_m_s: f64) -> bool {
    let period_s = period_s.max(BESIDE_THE_EARTH_S);
    let heaviest = if period_s < BESIDE_A_GIANT_S {
        EARTH_M3_S2
    } else {
        JUPITER_M3_S2
    };
    period_s <= longest_s && least_m_s <= (TAU * heaviest / period_s).cbrt()
}

/// Aberration by any velocity that turns once in `period_s`, about the middle of `span_s`: six coefficients.
pub fn free_orbit(period_s: f64, span_s: [f64; 2]) -> Box<dyn Candidate> {
    const NAMES: [&str; 6] = ["x_cos", "y_cos", "z_cos", "x_sin", "y_sin", "z_sin"];
    let middle_s = 0.5 * (span_s[0] + span_s[1]);
    let free = Free { period_s, middle_s };
    Box::new(OrbitCandidate::of(free, &NAMES, 1))
}

/// The circular orbits nearest to `values` of [`free_orbit`] (m/s), whose `information` is the inverse of their
/// covariance: for each the square of the errors that it leaves of them less that of nothing at all, which is what the
/// circle explains. The nearest is first; second, if there is one, is the nearest of those that no small step leads to
/// the first: of a velocity along the boresight the stars tell little, and without it an orbit and its mirror image
/// behind the focal plane are the same. `picked_from`: so many periods.
pub fn nearest_circles(
    period_s: f64,
    span_s: [f64; 2],
    values: &Vector6<f64>,
    information: &Matrix6<f64>,
    picked_from: usize,
) -> Vec<(f64, Box<dyn Candidate>)> {
    // of what the data hardly tells, nothing is known but that it is no surprise
    let known = information + Matrix6::identity() / (PLAUSIBLE_M_S * PLAUSIBLE_M_S);
    let likely = known.cholesky().map(|c| c.solve(&(information * values)));
    let likely = likely.unwrap_or_else(Vector6::zeros);
    let whole = likely.dot(&(known * likely));
    let orbit = |found: &Climbed| {
        let circle = Circle {
            frame: found.frame,
            period_s,
            middle_s: 0.5 * (span_s[0] + span_s[1]),
        };
        let candidate = OrbitCandidate::<Circle>::about(circle, picked_from);
        (
            whole - found.left,
            Box::new(candidate) as Box<dyn Candidate>,
        )
    };
    circles_of(&likely, &known).iter().map(orbit).collect()
}

/// A and B of a circle.
fn coefficients(speed: f64, frame: &Rotation3<f64>) -> Vector6<f64> {
    let (a, b) = (frame * Vector3::y() * speed, frame * -Vector3::x() * speed);
    Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z)
}

/// A circle that no small step makes nearer.
#[derive(Clone, Copy, Debug)]
struct Climbed {
    /// Square of what it leaves.
    left: f64,
    speed: f64,
    frame: Rotation3<f64>,
}

/// The circle nearest to `values`, and the nearest that is another, if there is one: the best of climbs from 24 frames.
fn circles_of(values: &Vector6<f64>, information: &Matrix6<f64>) -> Vec<Climbed> {
    let quarters = |axis, n: u32| Rotation3::from_axis_angle(&axis, f64::from(n) * FRAC_PI_2);
    let poles = (0..4)
        .map(|n| quarters(Vector3::x_axis(), n))
        .chain([1, 3].map(|n| quarters(Vector3::y_axis(), n)));
    let starts = poles.flat_map(|pole| (0..4).map(move |n| pole * quarters(Vector3::z_axis(), n)));
    let mut climbed: Vec<Climbed> = starts
        .map(|frame| climb(values, information, frame))
        .collect();
    climbed.sort_by(|a, b| a.left.total_cmp(&b.left));
    let nearest = climbed[0].frame;
    // the norm is the angle times the root of 2
    let is_other = |c: &&Climbed| (c.frame.matrix() - nearest.matrix()).norm() > APART;
    let other = climbed.iter().find(is_other);
    [climbed[0]].into_iter().chain(other.copied()).collect()
}

/// From a start by damped Gauss-Newton steps.
fn climb(values: &Vector6<f64>, information: &Matrix6<f64>, start: Rotation3<f64>) -> Climbed {
    // the best speed of a frame
    let judged = |frame: Rotation3<f64>| {
        let unit = coefficients(1.0, &frame);
        let weighed = information * unit;
        let speed = (weighed.dot(values) / weighed.dot(&unit)).max(0.0);
        let left = values - unit * speed;
        Climbed {
            left: left.dot(&(information * left)),
            speed,
            frame,
        }
    };
    let mut at = judged(start);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let Climbed { speed, frame, .. } = at;
        let turned = |axis: Vector3<f64>| {
            let dx = frame * axis.cross(&Vector3::x());
            let dy = frame * axis.cross(&Vector3::y());
            Vector6::new(dy.x, dy.y, dy.z, -dx.x, -dx.y, -dx.z) * speed.max(1e-9)
        };
        let slopes = SMatrix::<f64, 6, 4>::from_columns(&[
            coefficients(1.0, &frame),
            turned(Vector3::x()),
            turned(Vector3::y()),
            turned(Vector3::z()),
        ]);
        let left = values - coefficients(speed, &frame);
        let mut normal = slopes.transpose() * information * slopes;
        let gradient: SVector<f64, 4> = slopes.transpose() * information * left;
        for k in 0..4 {
            normal[(k, k)] *= 1.0 + damping;
            normal[(k, k)] += f64::MIN_POSITIVE;
        }
        let Some(step) = normal.cholesky().map(|c| c.solve(&gradient)) else {
            break;
        };
        let turn = Vector3::new(step[1], step[2], step[3]).map(|s| s.clamp(-STEP, STEP));
        let next = judged(frame * Rotation3::from_scaled_axis(turn));
        if next.left <= at.left {
            at = next;
            damping *= 0.3;
        } else {
            damping *= 10.0;
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN_S: [f64; 2] = [300.0, 2700.0];

    fn circle(turn: [f64; 3]) -> Circle {
        Circle {
            frame: Rotation3::from_scaled_axis(Vector3::from(turn)),
            period_s: 2100.0,
            middle_s: 1500.0,
        }
    }

    /// What a candidate tells is the orbit of the catalogue: the velocity of its first column at all times,
    /// whatever the plane, that of the equator and its other side included.
    #[test]
    fn an_orbit_is_its_parameters() {
        for turn in [
            [0.3, -1.2, 0.8],
            [0.0, 0.0, 1.0],
            [core::f64::consts::PI, 0.0, 0.0],
            [2.0, 2.0, 0.1],
        ] {
            let circle = circle(turn);
            let orbit = circle.orbit(3.0);
            for t_s in [0.0, 1500.0, 1900.0, 7000.0] {
                let apart = orbit.m_s(t_s) - circle.columns(t_s)[0] * 3.0;
                assert!(apart.norm() < 1e-12, "{turn:?} at {t_s}: {apart}");
            }
        }
    }

    /// A satellite in 700 km goes round in 5930 s at 7.5 km/s; a focal length that follows a wave of 2700 s, or of 5000 s by
    /// 60 ppm, goes round nothing.
    #[test]
    fn orbits_are_about_planets() {
        assert!(could_be_about_a_planet(5930.0, 5930.0, 7500.0));
        assert!(!could_be_about_a_planet(2700.0, 2900.0, 4800.0));
        assert!(could_be_about_a_planet(4700.0, 5300.0, 7300.0));
        assert!(!could_be_about_a_planet(5000.0, 6000.0, 18_000.0));
        assert!(could_be_about_a_planet(10_800.0, 10_800.0, 41_000.0));
        // beside each of them, at the speed there
        let speed = |mu: f64, radius: f64| (mu / radius).sqrt();
        let period = |mu: f64, radius: f64| TAU * (radius.powi(3) / mu).sqrt();
        let earth = period(EARTH_M3_S2, 6.371e6);
        assert!((earth / BESIDE_THE_EARTH_S - 1.0).abs() < 1e-3, "{earth}");
        let neptune = period(6.8365e15, 2.4764e7);
        assert!((neptune / BESIDE_A_GIANT_S - 1.0).abs() < 3e-3, "{neptune}");
        assert!((speed(EARTH_M3_S2, 6.371e6) - (TAU * EARTH_M3_S2 / earth).cbrt()).abs() < 1e-6);
    }

    /// Columns are slopes: a hundredth of the speed in each of the others changes the velocity by what they
    /// say, but for second orders of 1e-4 (times the cycles from the middle, squared, for the stretch).
    #[test]
    fn columns_tell_the_orbits_nearby() {
        let circle = circle([0.3, -1.2, 0.8]);
        for k in 1..LINEAR {
            let mut values = [100.0, 0.0, 0.0, 0.0, 0.0];
            values[k] = 1.0;
            let (speed, near) = circle.told_by(&values).unwrap();
            for t_s in [500.0, 1400.0, 2500.0] {
                let columns = circle.columns(t_s);
                let told: Vector3<f64> = (0..LINEAR).map(|j| columns[j] * values[j]).sum();
                let apart = near.orbit(speed).m_s(t_s) - told;
                assert!(apart.norm() < 100.0 * 1e-4 * 10.0, "{k} at {t_s}: {apart}");
            }
            assert!((near.orbit(speed).m_s(500.0) - circle.orbit(100.0).m_s(500.0)).norm() > 0.1);
        }
        // a velocity of the other sign
        let (speed, other) = circle.told_by(&[-100.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        let sum = other.orbit(speed).m_s(700.0) + circle.orbit(100.0).m_s(700.0);
        assert!(speed > 0.0 && sum.norm() < 1e-9);
    }

    /// The circle is found from its own A and B to rounding, and, where one direction is not measured, up to
    /// what that hides: A and B across it.
    #[test]
    fn the_nearest_circle_is_the_circle() {
        for turn in [[0.3, -1.2, 0.8], [2.0, 2.0, 0.1], [0.0, 0.1, -2.0]] {
            let frame = Rotation3::from_scaled_axis(Vector3::from(turn));
            let values = coefficients(7000.0, &frame);
            let mut information = Matrix6::identity();
            let found = circles_of(&values, &information)[0];
            assert!((found.speed - 7000.0).abs() < 1e-6);
            let apart = found.frame.matrix() - frame.matrix();
            assert!(apart.norm() < 1e-9, "{turn:?}: {apart}");
            information[(2, 2)] = 0.0;
            information[(5, 5)] = 0.0;
            let mut there = false;
            for found in circles_of(&values, &information) {
                let left = information * (values - coefficients(found.speed, &found.frame));
                assert!(left.norm() < 1.0, "{turn:?}: {left}");
                there |= (found.frame.matrix() - frame.matrix()).norm() < 1e-6;
            }
            assert!(there, "{turn:?} or its mirror image is lost");
        }
        let values = Vector6::new(0.0, 5.0, 0.0, 0.0, 5.0, 0.0);
        let nearest = nearest_circles(2000.0, SPAN_S, &values, &Matrix6::identity(), 1);
        let explained = nearest[0].0;
        assert!(
            explained < 49.0,
            "a line is no circle that lies in a plane with z: {explained}"
        );
    }
}
