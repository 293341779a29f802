//! How sure the parameters are that columns follow non-linearly: a frequency, a lag, an instant.
//!
//! Where the columns change smoothly with the parameter p, its error is that of one more linear
//! coefficient beside all others,
//!
//! ```text
//! column_p = sum_j c_j (column_j(p + h) - column_j(p - h)) / 2h
//! ```
//!
//! and the errors of the amplitudes are those beside it.
//!
//! An instant has no slope and no Gaussian error. Away from the true instant the log-likelihood
//! falls like a random walk with a drift of minus half its variance, whose top is exponential:
//!
//! ```text
//! P(top before or after > x) = 1 - (1 - e^-x)^2      5 % at x = 3.68
//! ```
//!
//! and so the interval holds every instant, amplitudes fitted anew, at which
//!
//! ```text
//! n ln (E(t) / E(best)) < 2 * 3.68 m
//! ```
//!
//! E being the squared error and m how much wider the amplitudes scatter than under white noise.
//! (A parameter with a Gaussian error has 3.84 there; an instant's interval with it holds the truth
//! in 73 of 100.) Distances are tried that grow from one step to the span.
//!
//! Source: Gauss-Newton linearisation; Siegmund 1988 (confidence sets in change-point problems).

use block_regression::{Estimate, Folds};
use effects::{AttitudeRows, Candidate, Coefficient, Effect, EffectError, StarRows, Surroundings};
use focal_plane::{Camera, PointsMut, VectorsMut};
use telemetry::report::FoundEffect;

use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::search::group::Group;
use crate::search::selection::columns_of;
use crate::search::{Found, first_column, fit, fit_whole};

/// 95 % point of twice the drop at the true instant, under noise that is as wide as it is taken for.
const DROP: f64 = 7.35;
/// Each distance tried is about this many times the last.
const GROWTH: f64 = 1.5;

/// Completes sigmas and intervals of the effects of the selection, in its order. `step_s` is the step
/// between rows.
pub(crate) fn complete(
    evidence: &dyn Evidence,
    folds: &Folds,
    found: &Found,
    surroundings: &Surroundings<'_>,
    step_s: f64,
    effects: &mut [FoundEffect],
) -> Result<(), CloseError> {
    let chosen = &found.selection.chosen;
    let mut slopes: Vec<(usize, &'static str, Slope)> = Vec::new();
    let set = columns_of(&found.fitted.groups, chosen);
    let Some(estimate) = found.fitted.fits.estimate(&set) else {
        return Ok(());
    };
    for (k, &g) in chosen.iter().enumerate() {
        let candidate = found.candidates[g].as_ref();
        for (j, parameter) in candidate.nonlinear().into_iter().enumerate() {
            let Some(difference) = parameter.difference else {
                let interval = instant(evidence, folds, found, g, j, surroundings, step_s)?;
                if let Some(told) = effects[k].parameters.get_mut(parameter.name) {
                    told.interval = interval;
                }
                continue;
            };
            let (values, _) = crate::findings::amplitudes_of(found, g, &set, &estimate);
            let slope = Slope::of(candidate, j, difference, values);
            slopes.extend(slope.map(|s| (k, parameter.name, s)));
        }
    }
    if slopes.is_empty() {
        return Ok(());
    }
    let mut list: Vec<&dyn Candidate> = chosen
        .iter()
        .map(|&g| found.candidates[g].as_ref())
        .collect();
    list.extend(slopes.iter().map(|s| &s.2 as &dyn Candidate));
    let fitted = fit(evidence, folds, &list)?;
    let all: Vec<usize> = (0..list.len()).collect();
    let Some(joint) = fitted.fits.estimate(&columns_of(&fitted.groups, &all)) else {
        return Ok(());
    };
    widen(found, &fitted.groups, &estimate, &joint, effects);
    let mut at: usize = fitted.groups[..chosen.len()]
        .iter()
        .map(|group| group.columns.len())
        .sum();
    for (group, (k, name, _)) in fitted.groups[chosen.len()..].iter().zip(&slopes) {
        if group.columns.is_empty() {
            continue;
        }
        if let Some(told) = effects[*k].parameters.get_mut(*name) {
            told.sigma = Some(joint.sigma(at));
        }
        at += 1;
    }
    Ok(())
}

/// Amplitudes are known less well where a lag or a frequency that changes with them is not known either:
/// from `alone` to `joint`, which has the slopes too.
fn widen(
    found: &Found,
    groups: &[Group],
    alone: &Estimate,
    joint: &Estimate,
    effects: &mut [FoundEffect],
) {
    let mut at = 0;
    for (k, &g) in found.selection.chosen.iter().enumerate() {
        let columns = &found.fitted.groups[g].columns;
        if groups[k].columns.len() != columns.len() {
            return;
        }
        let before = first_column(&found.candidates, g);
        for &column in columns {
            let name = &found.candidates[g].coefficients()[column - before].name;
            let wider = joint.sigma(at) / alone.sigma(at);
            if let Some(sigma) = effects[k]
                .parameters
                .get_mut(name)
                .and_then(|told| told.sigma.as_mut())
            {
                *sigma *= wider.max(1.0);
            }
            at += 1;
        }
    }
}

/// Bounds of the instant that is parameter `j` of candidate `g`, beside the others that were chosen.
fn instant(
    evidence: &dyn Evidence,
    folds: &Folds,
    found: &Found,
    g: usize,
    j: usize,
    surroundings: &Surroundings<'_>,
    step_s: f64,
) -> Result<Option<[f64; 2]>, CloseError> {
    let candidate = found.candidates[g].as_ref();
    let now: Vec<f64> = candidate.nonlinear().iter().map(|n| n.value).collect();
    let span = surroundings.span_s;
    let mut times = vec![now[j]];
    for sign in [-1.0, 1.0] {
        let mut distance = step_s;
        while (span[0]..=span[1]).contains(&(now[j] + sign * distance)) {
            times.push(now[j] + sign * distance);
            distance = (distance + step_s).max(GROWTH * distance);
        }
    }
    times.sort_by(f64::total_cmp);
    let variants: Vec<(f64, Box<dyn Candidate>)> = times
        .into_iter()
        .filter_map(|t| {
            let mut values = now.clone();
            values[j] = t;
            Some((t, candidate.with_nonlinear(&values)?))
        })
        .collect();
    let count = variants.len();
    let mut list: Vec<&dyn Candidate> = variants.iter().map(|v| v.1.as_ref()).collect();
    let others = found.selection.chosen.iter().filter(|&&c| c != g);
    list.extend(others.map(|&c| found.candidates[c].as_ref()));
    let fitted = fit_whole(evidence, folds, &list)?;
    let errors: Vec<(f64, f64)> = (0..count)
        .filter_map(|v| {
            let set: Vec<usize> = std::iter::once(v).chain(count..list.len()).collect();
            let error = fitted.fits.error(&columns_of(&fitted.groups, &set))?;
            Some((variants[v].0, error))
        })
        .collect();
    let Some(best) = errors
        .iter()
        .map(|e| e.1)
        .min_by(f64::total_cmp)
        .filter(|e| *e > 0.0)
    else {
        return Ok(None);
    };
    let drop = DROP * wider(found, g);
    let possible = |e: &(f64, f64)| fitted.scalars * (e.1 / best).ln() < drop;
    let (Some(first), Some(last)) = (
        errors.iter().position(possible),
        errors.iter().rposition(possible),
    ) else {
        return Ok(None);
    };
    // the drop lies somewhere between the last that is possible and the next
    let low = errors[first.saturating_sub(1)].0;
    let high = errors[(last + 1).min(errors.len() - 1)].0;
    Ok(Some([low, high]))
}

/// How much wider the amplitudes of candidate `g` scatter than under white noise; at least 1.
fn wider(found: &Found, g: usize) -> f64 {
    let groups = &found.fitted.groups;
    let chosen = &found.selection.chosen;
    let first: usize = chosen
        .iter()
        .take_while(|&&c| c != g)
        .map(|&c| groups[c].columns.len())
        .sum();
    let which: Vec<usize> = (first..first + groups[g].columns.len()).collect();
    let estimate = found.estimate();
    let mean = estimate.and_then(|e| Some(e.wider(&which)?.mean()));
    mean.unwrap_or(1.0).max(1.0)
}

/// The slope of a candidate's shift along one non-linear parameter, as a candidate of its own.
#[derive(Debug)]
struct Slope {
    /// The candidate on both sides, and how far apart they are.
    sides: [Box<dyn Candidate>; 2],
    width: f64,
    values: Vec<f64>,
    coefficient: [Coefficient; 1],
}

impl Slope {
    fn of(candidate: &dyn Candidate, j: usize, h: f64, values: Vec<f64>) -> Option<Self> {
        let now: Vec<f64> = candidate.nonlinear().iter().map(|n| n.value).collect();
        let side = |shift: f64| {
            let mut moved = now.clone();
            moved[j] += shift;
            candidate.with_nonlinear(&moved)
        };
        // at the edge of its range a parameter has one side
        let (low, below) = side(-h).map_or((0.0, side(0.0)?), |c| (-h, c));
        let (high, above) = side(h).map_or((0.0, side(0.0)?), |c| (h, c));
        (high > low).then(|| Self {
            sides: [below, above],
            width: high - low,
            values,
            coefficient: [Coefficient::new("slope", "", f64::INFINITY)],
        })
    }

    /// Combines the columns of both sides: `columns[side][axis]` into `out[axis]`.
    fn combine(&self, n: usize, columns: &[Vec<Vec<f64>>; 2], out: &mut [&mut [f64]]) {
        for (axis, out) in out.iter_mut().enumerate() {
            out.fill(0.0);
            for (sign, side) in [-1.0, 1.0].into_iter().zip(columns) {
                for (j, value) in self.values.iter().enumerate() {
                    let factor = sign * value / self.width;
                    for (o, c) in out.iter_mut().zip(&side[axis][j * n..(j + 1) * n]) {
                        *o += factor * c;
                    }
                }
            }
        }
    }
}

impl Candidate for Slope {
    fn id(&self) -> &'static str {
        self.sides[0].id()
    }

    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficient
    }

    fn acts_on_stars(&self) -> bool {
        self.sides[0].acts_on_stars()
    }

    fn acts_on_attitude(&self) -> bool {
        self.sides[0].acts_on_attitude()
    }

    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        let n = rows.len();
        let mut columns = [(); 2].map(|()| vec![vec![0.0; self.values.len() * n]; 2]);
        for (side, columns) in self.sides.iter().zip(&mut columns) {
            let [x, y] = columns.as_mut_slice() else {
                return false;
            };
            if !side.star_columns(camera, rows, PointsMut { x, y }) {
                return false;
            }
        }
        self.combine(n, &columns, &mut [out.x, out.y]);
        true
    }

    fn attitude_columns(&self, rows: &AttitudeRows<'_>, out: VectorsMut<'_>) -> bool {
        let n = rows.len();
        let mut columns = [(); 2].map(|()| vec![vec![0.0; self.values.len() * n]; 3]);
        for (side, columns) in self.sides.iter().zip(&mut columns) {
            let [x, y, z] = columns.as_mut_slice() else {
                return false;
            };
            if !side.attitude_columns(rows, VectorsMut { x, y, z }) {
                return false;
            }
        }
        self.combine(n, &columns, &mut [out.x, out.y, out.z]);
        true
    }

    fn realise(
        &self,
        _: &[f64],
        surroundings: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        self.sides[0].realise(&self.values, surroundings)
    }
}
