//! The orbit whose aberration explains most of what turns the camera.
//!
//! Where no channel tells the velocity, an orbit has five unknowns, and four of them enter in no linear way. So
//! any velocity of each of some periods is fitted first, whose six coefficients are linear, the circle nearest
//! to that is picked, and taken to its best by fits about itself:
//!
//! ```text
//! explained by a period = c^T W c - min over circles (c - c(circle))^T W (c - c(circle))      W: inverse of the
//!                                                                                               errors of c
//! ```
//!
//! Of an orbit longer than the data a part of a turn is seen: periods are tried at steps of the cycles in the
//! span. Of several cycles there are as many periods as a spectrum has lines: those that were found are tried.
//!
//! Not physics: the order of the steps.

use core::f64::consts::TAU;
use std::sync::Arc;

use block_regression::{Estimate, Folds};
use effects::{
    Candidate, Coefficient, SHORTEST_ORBIT_S, Surroundings, could_be_about_a_planet, free_orbit,
    nearest_circles, orbit_could_show,
};
use focal_plane::{ARCSEC_PER_RAD, AttitudeSource, SPEED_OF_LIGHT_M_S};
use nalgebra::{DMatrix, Matrix6, SMatrix, SVector, Vector3, Vector6};
use telemetry::report::ConsideredEffect;

use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::findings::amplitudes_from;
use crate::search::selection::columns_of;
use crate::search::{Fitted, Found, fit};
use crate::unexplained::leftover::Track;

pub(crate) mod images;

/// The effect of a velocity.
const ABERRATION: &str = "velocity_aberration";
/// Cycles in the span of the periods that are tried: nearly constant, and by quarters to where there are lines.
const CYCLES: [f64; 8] = [0.05, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75];
/// What is less than two turns in the span may be told from nothing else: the bound for that, s.
const SHORTEST_TURN_S: f64 = 300.0;
const FEW_TURNS: f64 = 2.0;
/// Fits about the circle at most, and the change in nats from one to the next below which there are no more.
const ROUNDS: usize = 4;
const SETTLED: f64 = 0.1;
/// Nats of white noise below which an orbit is not worth a search.
const WORTH_A_SEARCH: f64 = 12.0;
/// Nats by which an orbit, which takes the shape in time that suits it, must be worth more than channels that
/// have theirs: its plane, phase and period are free.
pub(crate) const OWN_SHAPE: f64 = 15.0;
/// The coefficient of an orbit that is its speed, and in how many of its sigmas it is known.
const SPEED: &str = "speed_m_s";
const KNOWN: f64 = 3.0;
/// Sigmas by which period and speed may be off.
const BELIEVED: f64 = 2.0;
/// Share of what others explain of the same in white noise, below which it is no orbit.
const RIVAL: f64 = 0.5;

/// Periods that are tried whatever was found, s.
fn usual_periods(surroundings: &Surroundings<'_>) -> impl Iterator<Item = f64> {
    let length_s = surroundings.length_s();
    let periods = CYCLES.iter().map(move |cycles| length_s / cycles);
    periods.filter(|p| *p > SHORTEST_TURN_S)
}

/// What rotations that all stars share say of orbits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look {
    /// What any velocity that turns with one of the usual periods explains, nats.
    nats: f64,
    /// Speed of an orbit of any plane, once in the span, that would show at 5 sigma, m/s.
    detectable_m_s: f64,
}

impl Look {
    /// A look at less than all rows: at rotations about X and Y. `None` where no orbit could show.
    pub(crate) fn at(
        surroundings: &Surroundings<'_>,
        attitude: &dyn AttitudeSource,
        tracks: [&Track; 2],
    ) -> Option<Self> {
        if !orbit_could_show(surroundings) {
            return None;
        }
        let rows: Vec<Row> = (0..2)
            .flat_map(|k| Row::all(k, tracks[k], attitude))
            .collect();
        let (middle_s, length_s) = (surroundings.middle_s(), surroundings.length_s());
        let explained = |period_s| Some(Normal::of(&rows, period_s, middle_s).eliminated()?.1);
        let scalars = rows.len() as f64;
        let all: f64 = rows.iter().map(|r| r.value * r.value).sum();
        let most = usual_periods(surroundings)
            .filter_map(explained)
            .fold(0.0, f64::max);
        // A and B of a circle have a third of their square along each axis
        let (information, _) = Normal::of(&rows, length_s, middle_s).eliminated()?;
        Some(Self {
            nats: 0.5 * scalars * (all / (all - most).max(f64::MIN_POSITIVE)).ln(),
            detectable_m_s: 5.0 / (information.trace() / 3.0).sqrt(),
        })
    }

    /// Whether an orbit is worth a fit to all rows.
    pub(crate) fn follows(self) -> bool {
        self.nats > WORTH_A_SEARCH
    }

    /// Says what was looked for without a candidate of its own.
    pub(crate) fn tell(self, considered: &mut [ConsideredEffect]) {
        for entry in considered {
            if entry.id == ABERRATION && !entry.observable && self.detectable_m_s.is_finite() {
                entry.observable = true;
                entry.detectable = Some(self.detectable_m_s);
                entry.parameter = Some("speed_m_s".to_owned());
                entry.unit = Some("m/s".to_owned());
            }
        }
    }
}

/// Whether one of `others` explains the same as the orbit that was found first, or nearly: `rivals` as sets of
/// candidates with their gains, nats.
pub(crate) fn is_beaten(
    found: &Found,
    rivals: &[(Vec<usize>, f64)],
    others: fn(&dyn Candidate) -> bool,
) -> bool {
    let gain = |of: &dyn Fn(usize) -> bool| {
        let alone = rivals
            .iter()
            .filter(|(set, _)| set.len() == 1 && of(set[0]));
        alone
            .map(|(_, gain)| *gain)
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let orbit = gain(&|g| found.fitted.groups[g].slopes > 0);
    let others = gain(&|g| others(found.candidates[g].as_ref()));
    orbit.is_finite() && others > orbit - OWN_SHAPE
}

/// A rotation about one axis, in units of its noise.
struct Row {
    axis: usize,
    t_s: f64,
    weight: f64,
    /// Rotation by inertial velocities along each axis, per m/s.
    seen: Vector3<f64>,
    value: f64,
}

impl Row {
    fn all<'a>(
        axis: usize,
        track: &'a Track,
        attitude: &'a dyn AttitudeSource,
    ) -> impl Iterator<Item = Self> + 'a {
        let squares = track
            .value
            .iter()
            .zip(&track.weight)
            .map(|(v, w)| w * v * v);
        let scale = (track.t_s.len() as f64 / squares.sum::<f64>().max(f64::MIN_POSITIVE)).sqrt();
        // of z x (q v)/c about this axis
        let across = [-Vector3::y(), Vector3::x()][axis] * (ARCSEC_PER_RAD / SPEED_OF_LIGHT_M_S);
        (0..track.t_s.len()).filter_map(move |k| {
            let weight = scale * track.weight[k].sqrt();
            Some(Self {
                axis,
                t_s: track.t_s[k],
                weight,
                seen: attitude.attitude(track.t_s[k])?.inverse() * across * weight,
                value: track.value[k] * weight,
            })
        })
    }
}

/// Products of two constants, six velocities and what was measured.
struct Normal(SMatrix<f64, 9, 9>);

impl Normal {
    fn of(rows: &[Row], period_s: f64, middle_s: f64) -> Self {
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        for r in rows {
            let (sin, cos) = (TAU * (r.t_s - middle_s) / period_s).sin_cos();
            let mut row = SVector::<f64, 9>::zeros();
            row[r.axis] = r.weight;
            row.fixed_rows_mut::<3>(2).copy_from(&(r.seen * cos));
            row.fixed_rows_mut::<3>(5).copy_from(&(r.seen * sin));
            row[8] = r.value;
            normal.ger(1.0, &row, &row, 1.0);
        }
        Self(normal)
    }

    /// Information of the velocities beside the constants, and the square that they explain.
    fn eliminated(&self) -> Option<(Matrix6<f64>, f64)> {
        let part = |i, j| self.0[(i, j)];
        let mut left = SMatrix::<f64, 7, 7>::from_fn(|i, j| part(i + 2, j + 2));
        for c in (0..2).filter(|&c| part(c, c) > 0.0) {
            left -=
                SMatrix::<f64, 7, 7>::from_fn(|i, j| part(i + 2, c) * part(c, j + 2) / part(c, c));
        }
        let information = left.fixed_view::<6, 6>(0, 0).into_owned();
        let moment = left.fixed_view::<6, 1>(0, 6).into_owned();
        // along the boresight nothing shows
        let ridge = Matrix6::identity() * (1e-6 * information.trace());
        let step = (information + ridge).cholesky()?.solve(&moment);
        Some((information, moment.dot(&step)))
    }
}

/// What an orbit could be in the place of: it turns the camera, or, where frames turn freely (`by_scale`), stretches
/// what they see from the boresight.
fn is_rival(candidate: &dyn Candidate, by_scale: bool) -> bool {
    if !by_scale {
        return candidate.turns_camera();
    }
    let scale = |c: &Coefficient| c.name == "k0";
    match candidate.id() {
        ABERRATION | "focal_length_drift" => true,
        "optical_distortion" => candidate.coefficients().iter().all(scale),
        _ => false,
    }
}

/// The orbit, if it is worth a search: held against those effects that were `found` which it could be in the place of,
/// or against what slow noise explains, `slow` nats (`None`: that is not known), and beside the others. `by_scale`:
/// frames turn freely, and know a velocity by their scale alone.
pub(crate) fn propose(
    evidence: &dyn Evidence,
    folds: &Folds,
    surroundings: &Surroundings<'_>,
    found: &Found,
    slow: Option<f64>,
    by_scale: bool,
) -> Result<Option<Arc<dyn Candidate>>, CloseError> {
    if !orbit_could_show(surroundings) {
        return Ok(None);
    }
    let (rivals, others): (Vec<_>, Vec<_>) = found.chosen().partition(|c| is_rival(*c, by_scale));
    let span_s = surroundings.span_s;
    let lines = rivals.iter().flat_map(|c| c.nonlinear());
    let lines = lines.filter(|n| n.unit == "Hz").map(|n| n.value.recip());
    let lines = lines.filter(|p| *p > SHORTEST_ORBIT_S);
    let periods: Vec<f64> = usual_periods(surroundings).chain(lines).collect();
    let free: Vec<Box<dyn Candidate>> = periods.iter().map(|&p| free_orbit(p, span_s)).collect();
    let mut all: Vec<&dyn Candidate> = free.iter().map(AsRef::as_ref).collect();
    all.extend(&others);
    let fitted = fit(evidence, folds, &all)?;
    let beside: Vec<usize> = (periods.len()..all.len()).collect();
    let best = (0..periods.len())
        .filter_map(|k| {
            let set = [&[k], &beside[..]].concat();
            let (values, information) = velocities(&fitted, k, &set)?;
            // neighbours overlap by half
            let count = periods.len().div_ceil(2);
            let circles = nearest_circles(periods[k], span_s, &values, &information, count);
            Some((circles.first()?.0, circles))
        })
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let Some((explained, circles)) = best else {
        return Ok(None);
    };
    if 0.5 * explained < WORTH_A_SEARCH {
        return Ok(None);
    }
    let beside = Beside {
        evidence,
        folds,
        surroundings,
        others,
        rivals,
        slow,
    };
    // the one that is likelier once it is at its best; of two alike the nearer circle
    let mut likelier: Option<Likely> = None;
    for (_, circle) in circles {
        if let Some(other) = beside.at_its_best(circle.into())?
            && likelier.as_ref().is_none_or(|l| l.nats < other.nats)
        {
            likelier = Some(other);
        }
    }
    let Some(Likely {
        orbit,
        nats,
        bounds,
    }) = likelier
    else {
        return Ok(None);
    };
    // a fit may end at more turns than it was tried at
    let fastest_s = SHORTEST_ORBIT_S.min(surroundings.length_s() / FEW_TURNS);
    let period_s = period_s(orbit.as_ref(), surroundings).unwrap_or(f64::INFINITY);
    let is_fast = period_s < fastest_s;
    // whatever is slow stretches the field as some orbit does
    let is_none = by_scale && !bounds.hold_a_planet(period_s);
    let stands =
        nats >= WORTH_A_SEARCH && !is_fast && !is_none && !beside.slow_makes(orbit.as_ref(), nats);
    Ok(stands.then_some(orbit))
}

/// The six coefficients of candidate `k` of those fitted in `set`, a [`free_orbit`] with none but such before it, and
/// the inverse of their covariance under white noise.
fn velocities(fitted: &Fitted, k: usize, set: &[usize]) -> Option<(Vector6<f64>, Matrix6<f64>)> {
    let estimate = fitted.fits.estimate(&columns_of(&fitted.groups, set))?;
    // of six columns some may not show
    let own = &fitted.groups[k].columns;
    let white = estimate.white.view((0, 0), (own.len(), own.len()));
    let inverse = white.clone_owned().cholesky()?.inverse();
    let mut values = Vector6::zeros();
    let mut information = Matrix6::zeros();
    for (i, a) in own.iter().enumerate() {
        values[a - 6 * k] = estimate.value[i];
        for (j, b) in own.iter().enumerate() {
            information[(a - 6 * k, b - 6 * k)] = inverse[(i, j)];
        }
    }
    Some((values, information))
}

/// An orbit, and what it gains, nats.
struct Likely {
    orbit: Arc<dyn Candidate>,
    nats: f64,
    bounds: Bounds,
}

/// What the period may be at most, and the speed at least.
#[derive(Clone, Copy)]
struct Bounds {
    longest_s: f64,
    least_m_s: f64,
}

impl Bounds {
    /// Nothing is known.
    const NONE: Self = Self {
        longest_s: f64::INFINITY,
        least_m_s: 0.0,
    };

    /// Of an orbit of `period_s` that these amplitudes of one nearby led to: speed first and stretch last, whose variance
    /// is 0 where it does not show.
    fn of(period_s: f64, values: &[f64], covariance: &DMatrix<f64>) -> Self {
        let last = values.len() - 1;
        let sigma = |k: usize| match covariance[(k, k)] {
            0.0 => f64::INFINITY,
            variance => variance.sqrt(),
        };
        let speed = values[0].abs();
        Self {
            longest_s: period_s * (1.0 + BELIEVED * sigma(last) / speed),
            least_m_s: speed - BELIEVED * sigma(0),
        }
    }

    fn hold_a_planet(self, period_s: f64) -> bool {
        could_be_about_a_planet(period_s, self.longest_s, self.least_m_s)
    }
}

/// What an orbit is fitted beside, and held against.
struct Beside<'a> {
    evidence: &'a dyn Evidence,
    folds: &'a Folds,
    surroundings: &'a Surroundings<'a>,
    others: Vec<&'a dyn Candidate>,
    rivals: Vec<&'a dyn Candidate>,
    slow: Option<f64>,
}

impl Beside<'_> {
    /// Whether it is an orbit that nature does not have, and a slow error makes it as well as it makes anything.
    fn slow_makes(&self, orbit: &dyn Candidate, nats: f64) -> bool {
        is_too_fast(orbit, self.surroundings) && nats < self.slow.unwrap_or(0.0) + OWN_SHAPE
    }

    /// `orbit` after fits about itself; `None` where it is not worth a search, or others explain as much.
    fn at_its_best(&self, mut orbit: Arc<dyn Candidate>) -> Result<Option<Likely>, CloseError> {
        let mut nats = 0.0;
        let mut bounds = Bounds::NONE;
        for _ in 0..ROUNDS {
            let mut all: Vec<&dyn Candidate> = vec![orbit.as_ref()];
            all.extend(&self.others);
            all.extend(&self.rivals);
            let fitted = fit(self.evidence, self.folds, &all)?;
            let columns = |groups: std::ops::Range<usize>| {
                columns_of(&fitted.groups, &groups.collect::<Vec<usize>>())
            };
            let first = 1 + self.others.len();
            let with = columns(0..first);
            let without = columns(1..first);
            let error = |set: &[usize]| fitted.fits.error(set).unwrap_or(f64::INFINITY);
            let gain = |set: &[usize]| fitted.nats(error(&without), error(set));
            let before = std::mem::replace(&mut nats, gain(&with));
            let others = gain(&columns(1..all.len()));
            let rivals = others.max(self.slow.unwrap_or(0.0));
            if nats < WORTH_A_SEARCH || nats < RIVAL * rivals {
                return Ok(None);
            }
            // beside white noise it would be chosen in the place of the best of the others, or beside all of them
            if self.slow == Some(0.0) {
                let one = |g: usize| gain(&[&without[..], &columns(g..g + 1)].concat());
                let best = (first..all.len()).map(one).fold(0.0, f64::max);
                let more = gain(&columns(0..all.len())) - others;
                if nats < best - OWN_SHAPE && more < WORTH_A_SEARCH {
                    return Ok(None);
                }
            }
            if self.slow_makes(orbit.as_ref(), nats) {
                break;
            }
            let Some(estimate) = fitted.fits.estimate(&with) else {
                break;
            };
            let count = orbit.coefficients().len();
            let (values, covariance) = amplitudes_from(0, count, &with, &estimate);
            let Some(better) = orbit.refined(&values) else {
                break;
            };
            orbit = better.into();
            if let Some(period_s) = period_s(orbit.as_ref(), self.surroundings) {
                bounds = Bounds::of(period_s, &values, &covariance);
            }
            if (nats - before).abs() < SETTLED {
                break;
            }
        }
        Ok(Some(Likely {
            orbit,
            nats,
            bounds,
        }))
    }
}

/// Whether the speed of what stands as an orbit is not known, by its estimate from column `first` on: such an orbit
/// lends its shape to any drift.
pub(crate) fn has_no_speed(orbit: &dyn Candidate, estimate: &Estimate, first: usize) -> bool {
    let told = orbit.coefficients().first();
    told.is_some_and(|c| c.name == SPEED)
        && estimate.value[first].abs() < KNOWN * estimate.sigma(first)
}

/// Whether it is an orbit that turns faster than nature has any.
pub(crate) fn is_too_fast(orbit: &dyn Candidate, surroundings: &Surroundings<'_>) -> bool {
    period_s(orbit, surroundings).is_some_and(|period_s| period_s < SHORTEST_ORBIT_S)
}

/// The period of an orbit as it stands, at whatever speed.
fn period_s(orbit: &dyn Candidate, surroundings: &Surroundings<'_>) -> Option<f64> {
    let mut itself = vec![0.0; orbit.coefficients().len()];
    itself[0] = 1.0;
    let told = orbit.realise(&itself, surroundings).ok()?.parameters();
    Some(told.iter().find(|p| p.name == "period_s")?.value)
}
