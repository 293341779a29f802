//! How well an account of the centroids predicts, out of fold and block by block.
//!
//! Source: Student's t over the blocks (1908).

use std::sync::Arc;

use block_regression::{Folds, OutOfFold, beyond};
use effects::Candidate;
use statrs::distribution::StudentsT;

use super::Step;
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::outcome::Rival;
use crate::residual_size;
use crate::search::selection::{FAMILY_ALPHA, columns_of};
use crate::search::{Fitted, amplitudes, borrowed, fit};
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;

/// Nats that a claim has to bring at least: pixels that are hardly off zero are no map.
pub(super) const LEAST_GAIN: f64 = 6.0;

/// Squared error and log-likelihood of each block, out of fold.
#[derive(Clone, Debug)]
pub(super) struct Score {
    sse: Vec<f64>,
    loglik: Vec<f64>,
}

impl Score {
    /// The noise of a fold is that of the *predictions* of the others: what was
    /// learned from windows follows their noise, and looks better on them than it is.
    fn new(error: &OutOfFold, folds: &Folds) -> Self {
        let of = &folds.fold_of_block;
        let loglik = (0..error.sse.len())
            .map(|b| {
                let others = || (0..error.sse.len()).filter(|&o| of[o] != of[b]);
                let scalars: f64 = others().map(|o| error.scalars[o]).sum();
                let variance = others().map(|o| error.sse[o]).sum::<f64>() / scalars.max(1.0);
                let variance = variance.max(f64::MIN_POSITIVE);
                -0.5 * (error.scalars[b] * (std::f64::consts::TAU * variance).ln()
                    + error.sse[b] / variance)
            })
            .collect();
        Self {
            sse: error.sse.clone(),
            loglik,
        }
    }

    pub(super) fn total(&self) -> f64 {
        self.loglik.iter().sum()
    }

    /// Squared error of all blocks.
    pub(super) fn squares(&self) -> f64 {
        self.sse.iter().sum()
    }
}

/// A level out of fold, by itself and with the best function of pixel phase.
pub(super) struct Scored<'a> {
    pub(super) evidence: &'a StarEvidence<'a>,
    pub(super) alone: Score,
    phase: Option<Score>,
}

impl Scored<'_> {
    pub(super) fn best(&self) -> &Score {
        self.phase
            .as_ref()
            .filter(|p| p.total() > self.alone.total())
            .unwrap_or(&self.alone)
    }
}

/// The account that predicts best, pixel phase beside it or not; of two alike the latter.
pub(super) fn best_of<'s, 'a>(first: &'s Scored<'a>, others: &[&'s Scored<'a>]) -> &'s Scored<'a> {
    others.iter().fold(first, |best, other| {
        if other.best().total() < best.best().total() {
            best
        } else {
            other
        }
    })
}

/// Which predicts better by itself.
pub(super) fn better_of<'s, 'a>(a: &'s Scored<'a>, b: &'s Scored<'a>) -> &'s Scored<'a> {
    if a.alone.total() > b.alone.total() {
        a
    } else {
        b
    }
}

/// The score with some columns.
fn scored(fitted: &Fitted, set: &[usize], folds: &Folds) -> Option<Score> {
    let scored = fitted.fits.out_of_fold_by_block(set)?;
    Some(Score::new(&scored, folds))
}

/// The score with each candidate that is observable, and its number.
fn with_one(fitted: &Fitted, folds: &Folds) -> impl Iterator<Item = (usize, Score)> {
    let observable = (0..fitted.groups.len()).filter(|&g| !fitted.groups[g].columns.is_empty());
    observable.filter_map(move |g| {
        let set = columns_of(&fitted.groups, &[g]);
        Some((g, scored(fitted, &set, folds)?))
    })
}

/// A level by itself and with the best phase term, both among the `rivals` if it has a name.
pub(super) fn score<'a>(
    name: Option<&str>,
    evidence: &'a StarEvidence<'a>,
    phase: &[Arc<dyn Candidate>],
    folds: &Folds,
    data: &StarData,
    rivals: &mut Vec<Rival>,
) -> Result<Scored<'a>, CloseError> {
    let fitted = fit(evidence, folds, &borrowed(phase))?;
    let alone = scored(&fitted, &[], folds).ok_or(CloseError::Singular)?;
    let best = with_one(&fitted, folds).max_by(|a, b| a.1.total().total_cmp(&b.1.total()));
    if let Some(name) = name {
        let columns = phase.iter().map(|c| c.coefficients().len()).sum();
        let mut tell = |what: String, set: &[usize], loglik: f64| -> Result<(), CloseError> {
            let amplitudes =
                amplitudes(&fitted, folds, set, columns).ok_or(CloseError::Singular)?;
            let residual = evidence.residuals(folds, &borrowed(phase), &amplitudes);
            rivals.push(Rival {
                what,
                rms_arcsec: residual_size::star_rms(&residual, data).to_vec(),
                delta_loglik: loglik,
            });
            Ok(())
        };
        tell(name.to_owned(), &[], alone.total())?;
        if let Some((g, score)) = &best {
            tell(
                format!("{name} + pixel_phase_harmonics"),
                &[*g],
                score.total(),
            )?;
        }
    }
    Ok(Scored {
        evidence,
        alone,
        phase: best.map(|b| b.1),
    })
}

/// A level beside the effect of the catalogue that improves it most: what moves the stars may be far larger than
/// what a pixel that switches does.
pub(super) fn beside_others(
    evidence: &StarEvidence<'_>,
    others: &[Arc<dyn Candidate>],
    folds: &Folds,
) -> Result<Score, CloseError> {
    let fitted = fit(evidence, folds, &borrowed(others))?;
    with_one(&fitted, folds)
        .map(|(_, score)| score)
        .chain(scored(&fitted, &[], folds))
        .max_by(|a, b| a.total().total_cmp(&b.total()))
        .ok_or(CloseError::Singular)
}

/// Gain of one score over another, block by block: its mean against its scatter
/// is honest however the errors within a block hang together.
pub(super) fn step(with: &Score, without: &Score, whole: f64) -> Step {
    let gain: Vec<f64> = with
        .loglik
        .iter()
        .zip(&without.loglik)
        .map(|(a, b)| a - b)
        .collect();
    let total: f64 = gain.iter().sum();
    let p_value = one_sided(&gain);
    Step {
        delta_loglik: total,
        p_value,
        explained: (without.squares() - with.squares()) / whole,
        stands: total > LEAST_GAIN && p_value < FAMILY_ALPHA,
    }
}

/// Chance of a mean this far above zero: Student's t over the blocks.
fn one_sided(gain: &[f64]) -> f64 {
    let n = gain.len() as f64;
    let mean = gain.iter().sum::<f64>() / n;
    let variance = gain.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0);
    if variance.is_nan() || variance <= 0.0 {
        return if mean > 0.0 { 0.0 } else { 1.0 };
    }
    StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |law| beyond(&law, mean / (variance / n).sqrt()))
}
