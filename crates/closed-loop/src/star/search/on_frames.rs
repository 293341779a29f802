//! Forms of what turns the camera, on the moments of frames.
//!
//! An instant, a frequency or a lag is scanned, and what changed is put in its place, without a pass over the rows where
//! every frame's moments were kept ([`StarMoments::beside_turns`]).
//!
//! Not physics: which products are there already.

use std::ops::Range;
use std::sync::Arc;

use block_regression::{BlockGrams, Folds};
use effects::Candidate;
use nalgebra::DMatrix;

use crate::evidence::{Amplitudes, Evidence, Residuals};
use crate::search::{borrowed, first_column};
use crate::star::evidence::StarEvidence;
use crate::star::moments::StarMoments;

/// `level` with the moments of its frames, if they are there.
pub(super) struct OnFrames<'e, 'a> {
    level: &'e StarEvidence<'a>,
    moments: Option<StarMoments>,
}

impl<'e, 'a> OnFrames<'e, 'a> {
    /// `moments`: of any candidates.
    pub(super) fn of(level: &'e StarEvidence<'a>, moments: &StarMoments) -> Self {
        let fixed = level.precision().nrows();
        let narrowed = || moments.narrowed(fixed, level.residual_columns());
        Self {
            level,
            moments: moments.is_by_frame().then(narrowed),
        }
    }
}

impl Evidence for OnFrames<'_, '_> {
    fn precision(&self) -> DMatrix<f64> {
        self.level.precision()
    }

    fn relative(&self) -> Range<usize> {
        self.level.relative()
    }

    fn residual_columns(&self) -> usize {
        self.level.residual_columns()
    }

    fn variance_guess(&self) -> f64 {
        self.level.variance_guess()
    }

    fn grams(&self, folds: &Folds, candidates: &[&dyn Candidate]) -> BlockGrams {
        match &self.moments {
            Some(moments) if candidates.iter().all(|c| c.turns_camera()) => {
                let turns = self.level.turns(folds, candidates);
                let beside = moments.beside_turns(self.residual_columns(), &turns);
                self.level.under(&beside)
            }
            _ => self.level.grams(folds, candidates),
        }
    }

    fn residuals(
        &self,
        folds: &Folds,
        candidates: &[&dyn Candidate],
        amplitudes: &Amplitudes,
    ) -> Residuals {
        self.level.residuals(folds, candidates, amplitudes)
    }

    fn distance(&self, one: &dyn Candidate, other: &dyn Candidate, values: &[f64]) -> f64 {
        self.level.distance(one, other, values)
    }
}

/// The moments of candidates in the `forms` that they have now: by another pass, unless all that differ turn the camera.
pub(super) fn in_forms(
    white: &StarEvidence<'_>,
    folds: &Folds,
    moments: StarMoments,
    before: &[Arc<dyn Candidate>],
    forms: &[Arc<dyn Candidate>],
) -> StarMoments {
    let each = before.iter().zip(forms).enumerate();
    let changed = each.filter(|(_, (before, form))| !Arc::ptr_eq(before, form));
    let changed: Vec<usize> = changed.map(|(g, _)| g).collect();
    if !moments.is_by_frame() || !changed.iter().all(|&g| forms[g].turns_camera()) {
        // there is no room for the old products beside the new
        drop(moments);
        return white.moments_by_frame(folds, &borrowed(forms));
    }
    let fixed = white.precision().nrows();
    let columns = |&g: &usize| {
        let first = fixed + first_column(forms, g);
        first..first + forms[g].coefficients().len()
    };
    let which: Vec<usize> = changed.iter().flat_map(columns).collect();
    let turning: Vec<&dyn Candidate> = changed.iter().map(|&g| forms[g].as_ref()).collect();
    moments.with_turns(&which, &white.turns(folds, &turning))
}
