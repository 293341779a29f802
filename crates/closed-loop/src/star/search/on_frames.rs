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

    /// The moments, and what candidates turn the frames of each block by, if they all turn the camera.
    fn turned(
        &self,
        folds: &Folds,
        candidates: &[&dyn Candidate],
    ) -> Option<(&StarMoments, Vec<DMatrix<f64>>)> {
        let all_turn = candidates.iter().all(|c| c.turns_camera());
        let moments = self.moments.as_ref().filter(|_| all_turn)?;
        Some((moments, self.level.turns(folds, candidates)))
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
        let Some((moments, turns)) = self.turned(folds, candidates) else {
            return self.level.grams(folds, candidates);
        };
        let beside = moments.beside_turns(self.residual_columns(), &turns);
        self.level.under(&beside)
    }

    fn grams_in_all(&self, folds: &Folds, candidates: &[&dyn Candidate]) -> BlockGrams {
        let white = self.level.noise.is_none();
        let turned = white.then(|| self.turned(folds, candidates)).flatten();
        let Some((moments, turns)) = turned else {
            return self.grams(folds, candidates).in_all(folds);
        };
        moments.white_beside_turns(self.residual_columns(), &turns)
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

#[cfg(test)]
mod tests {
    use telemetry::Model;

    use super::*;
    use crate::search::empirical::{Empirical, Variable};
    use crate::star::data::StarData;
    use crate::star::harness::{at_rest, silent};

    const SPAN_S: f64 = 60.0;

    fn evidence(data: &StarData) -> StarEvidence<'_> {
        let mut model = Model::default();
        model.noise.distortion_arcsec = Some(1.0);
        let rows = data.t_s.len();
        let residual = [1.3, 2.1].map(|f| (0..rows).map(|r| (f * r as f64).sin()).collect());
        StarEvidence {
            residuals: Arc::new(vec![residual]),
            // one that stands before all candidates
            kept: vec![Arc::new(of_star(data, 2))],
            ..silent(data, &model)
        }
    }

    fn of_star(data: &StarData, star: usize) -> Empirical {
        Empirical::new(Variable::Star(vec![data.stars[star].id]), [0.0, 1.0], true).unwrap()
    }

    fn step(at_s: f64) -> Arc<dyn Candidate> {
        effects::step_at(at_s, [0.0, SPAN_S], 1).into()
    }

    fn assert_same(ours: &BlockGrams, other: &BlockGrams) {
        let ((ours, scalars), (other, others)) = (ours.total(), other.total());
        let off = (&ours - &other).norm() / other.norm();
        assert!(
            off < 1e-11 && (scalars - others).abs() < 0.5,
            "off by {off}"
        );
    }

    /// Steps beside the nuisance and what is kept, and one of the candidates at another instant, are those of a pass:
    /// to rounding. What turns no camera is passed over.
    #[test]
    fn forms_on_frames_are_those_of_a_pass() {
        let data = at_rest((0..120).map(|k| 0.5 * f64::from(k)).collect());
        let (white, folds) = (evidence(&data), Folds::cut(data.frames.t_s.len()));
        let candidates: Vec<Arc<dyn Candidate>> =
            vec![Arc::new(of_star(&data, 0)), step(20.0), step(41.3)];
        let moments = white.moments_by_frame(&folds, &borrowed(&candidates));
        assert!(moments.is_by_frame());
        let on_frames = OnFrames::of(&white, &moments);
        let two = [step(11.1), step(33.3)];
        for tried in [&two[..], &candidates[..2]] {
            let tried = borrowed(tried);
            let other = white.grams(&folds, &tried);
            assert_same(&on_frames.grams(&folds, &tried), &other);
            assert_same(&on_frames.grams_in_all(&folds, &tried), &other);
        }
        for (g, other) in [(1, step(25.2)), (0, Arc::new(of_star(&data, 3)))] {
            let mut forms = candidates.clone();
            forms[g] = other;
            let ours = in_forms(&white, &folds, moments.clone(), &candidates, &forms);
            let other = white.moments(&folds, &borrowed(&forms));
            assert_same(&white.under(&ours), &white.under(&other));
        }
    }
}
