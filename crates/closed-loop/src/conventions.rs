//! Tables in another convention than that of the format.
//!
//! A wrong reading of a column puts every star or attitude somewhere else: no normal equations have a solution then,
//! or residuals of degrees follow the stars. Where another usual reading brings what was measured to a twentieth
//! of the way or nearer, the table is in that convention, and it is said.
//!
//! Not physics: a check of input.

use crate::error::CloseError;
use crate::situation::Situation;

mod references;
mod stars;

/// Samples that are looked at.
const SAMPLES: usize = 200;
/// Share of half the field within which nothing is asked.
const NEAR: f64 = 0.1;
/// How many times nearer another convention has to be.
const NEARER: f64 = 20.0;

/// Refuses a reference that does not overlap what was measured, and what is in another convention.
pub(crate) fn check(situation: &Situation<'_>) -> Result<(), CloseError> {
    stars::check(situation)?;
    references::check(situation)
}

/// Half the field, rad.
fn field(situation: &Situation<'_>) -> f64 {
    let half = situation.camera.half_size_px();
    half[0].max(half[1]) / situation.camera.focal_length_px()[0]
}

/// The nearest of other readings, where it is so much nearer than `given` that it is the right one.
fn nearest<T>(given: f64, others: impl Iterator<Item = (f64, T)>) -> Option<(f64, T)> {
    others
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(angle, _)| NEARER * angle < given)
}
