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

use block_regression::Folds;
use effects::{Candidate, Surroundings, free_orbit, nearest_circle, orbit_could_show};
use focal_plane::AttitudeSource;
use nalgebra::{Matrix6, SMatrix, SVector, Vector3, Vector6};

use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::search::selection::columns_of;
use crate::search::{Found, fit};
use crate::unexplained::leftover::Track;

/// Cycles in the span of the periods that are tried: nearly constant, and by quarters to where there are lines.
const CYCLES: [f64; 8] = [0.05, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75];
/// Beside the surface of solid osmium an orbit takes sqrt(3 pi / G rho) = 42 minutes, s: a faster line is none.
const SHORTEST_S: f64 = 2500.0;
/// What is shorter than two cycles may be told from nothing else: the bound for that, s.
const SHORTEST_TURN_S: f64 = 300.0;
/// Fits about the circle.
const ROUNDS: usize = 4;
/// Nats of white noise below which an orbit is not worth a search.
const WORTH_A_SEARCH: f64 = 12.0;
/// Share of what others explain of the same in white noise, below which it is no orbit.
const RIVAL: f64 = 0.5;

/// Periods that are tried whatever was found, s.
fn usual_periods(surroundings: &Surroundings<'_>) -> impl Iterator<Item = f64> {
    let length_s = surroundings.length_s();
    let periods = CYCLES.iter().map(move |cycles| length_s / cycles);
    periods.filter(|p| *p > SHORTEST_TURN_S)
}

/// Whether rotations that all stars share follow any orbit: a look at less than all rows.
pub(crate) fn might_show(
    surroundings: &Surroundings<'_>,
    attitude: &dyn AttitudeSource,
    tracks: [&Track; 2],
) -> bool {
    if !orbit_could_show(surroundings) {
        return false;
    }
    let rows: Vec<_> = tracks
        .iter()
        .enumerate()
        .flat_map(|(axis, track)| {
            let square: f64 = track
                .value
                .iter()
                .zip(&track.weight)
                .map(|(v, w)| w * v * v)
                .sum();
            let scale = (track.t_s.len() as f64 / square.max(f64::MIN_POSITIVE)).sqrt();
            (0..track.t_s.len()).filter_map(move |k| {
                let weight = scale * track.weight[k].sqrt();
                let turn = attitude.attitude(track.t_s[k])?.inverse();
                // of z x (q v) about this axis
                let seen = turn
                    * if axis == 0 {
                        -Vector3::y()
                    } else {
                        Vector3::x()
                    };
                Some((
                    axis,
                    track.t_s[k],
                    seen * weight,
                    weight,
                    track.value[k] * weight,
                ))
            })
        })
        .collect();
    let scalars = rows.len() as f64;
    let middle_s = surroundings.middle_s();
    usual_periods(surroundings).any(|period_s| {
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        for (axis, t_s, seen, weight, value) in &rows {
            let (sin, cos) = (TAU * (t_s - middle_s) / period_s).sin_cos();
            let mut row = SVector::<f64, 9>::zeros();
            row[*axis] = *weight;
            row.fixed_rows_mut::<3>(2).copy_from(&(seen * cos));
            row.fixed_rows_mut::<3>(5).copy_from(&(seen * sin));
            row[8] = *value;
            normal.ger(1.0, &row, &row, 1.0);
        }
        let columns = normal.fixed_view::<8, 8>(0, 0).into_owned();
        let moment = normal.fixed_view::<8, 1>(0, 8).into_owned();
        let all = normal[(8, 8)];
        let ridge = SMatrix::<f64, 8, 8>::identity() * (1e-9 * columns.trace());
        let explained = (columns + ridge)
            .cholesky()
            .map_or(0.0, |c| moment.dot(&c.solve(&moment)));
        0.5 * scalars * (all / (all - explained).max(f64::MIN_POSITIVE)).ln() > WORTH_A_SEARCH
    })
}

/// The orbit, if it is worth a search: beside those effects that were `found` which do not turn the camera, and
/// held against those that do, or against what slow noise explains, `slow` nats.
pub(crate) fn propose(
    evidence: &dyn Evidence,
    folds: &Folds,
    surroundings: &Surroundings<'_>,
    found: &Found,
    slow: f64,
) -> Result<Option<Arc<dyn Candidate>>, CloseError> {
    if !orbit_could_show(surroundings) {
        return Ok(None);
    }
    let (turn, not_turn): (Vec<_>, Vec<_>) = found.chosen().partition(|c| c.turns_camera());
    let span_s = surroundings.span_s;
    let lines = turn.iter().flat_map(|c| c.nonlinear());
    let lines = lines.filter(|n| n.unit == "Hz").map(|n| n.value.recip());
    let lines = lines.filter(|p| *p > SHORTEST_S);
    let periods: Vec<f64> = usual_periods(surroundings).chain(lines).collect();
    let free: Vec<Box<dyn Candidate>> = periods.iter().map(|&p| free_orbit(p, span_s)).collect();
    let mut all: Vec<&dyn Candidate> = free.iter().map(AsRef::as_ref).collect();
    all.extend(&not_turn);
    let fitted = fit(evidence, folds, &all)?;
    let beside: Vec<usize> = (periods.len()..all.len()).collect();
    let best = (0..periods.len())
        .filter_map(|k| {
            let set = [&[k], &beside[..]].concat();
            let estimate = fitted.fits.estimate(&columns_of(&fitted.groups, &set))?;
            // six columns a period, of which some may not show
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
            // neighbours overlap by half
            let count = periods.len().div_ceil(2);
            Some(nearest_circle(
                periods[k],
                span_s,
                &values,
                &information,
                count,
            ))
        })
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let Some((explained, orbit)) = best else {
        return Ok(None);
    };
    if 0.5 * explained < WORTH_A_SEARCH {
        return Ok(None);
    }
    let mut orbit: Arc<dyn Candidate> = orbit.into();
    let mut nats = 0.0;
    for _ in 0..ROUNDS {
        let mut all: Vec<&dyn Candidate> = vec![orbit.as_ref()];
        all.extend(&not_turn);
        all.extend(&turn);
        let fitted = fit(evidence, folds, &all)?;
        let columns = |groups: std::ops::Range<usize>| {
            columns_of(&fitted.groups, &groups.collect::<Vec<usize>>())
        };
        let with = columns(0..1 + not_turn.len());
        let without = columns(1..1 + not_turn.len());
        let others = columns(1..all.len());
        let error = |set: &[usize]| fitted.fits.error(set).unwrap_or(f64::INFINITY);
        let gain = |set: &[usize]| 0.5 * fitted.scalars * (error(&without) / error(set)).ln();
        nats = gain(&with);
        if nats < WORTH_A_SEARCH || nats < RIVAL * gain(&others).max(slow) {
            return Ok(None);
        }
        let Some(estimate) = fitted.fits.estimate(&with) else {
            break;
        };
        let mut values = vec![0.0; orbit.coefficients().len()];
        for (i, &column) in fitted.groups[0].columns.iter().enumerate() {
            values[column] = estimate.value[i];
        }
        let Some(better) = orbit.refined(&values) else {
            break;
        };
        orbit = better.into();
    }
    Ok((nats >= WORTH_A_SEARCH).then_some(orbit))
}
