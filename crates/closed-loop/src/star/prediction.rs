//! Amplitudes to predict a fold with beside a slow error of the reference.
//!
//! Innovations of other folds know what came before them in the fold that is left out: of a step within it they tell next
//! to nothing. So its bins are left out of the filter, and the other folds tell what acts by its level before and after.
//!
//! Of a rotation that wanders for as long as the run lasts, generalised least squares believes the changes from frame
//! to frame and knows little of the mean: a constant that suits the other folds may be off by several sigmas of the wander
//! in an outer one. What is predicted is a fold's residual, of which the plain mean of the other folds is closer:
//!
//! ```text
//! theta_f = (sum w^2 A' A + s^2 P)^-1 sum w^2 A' (r - shift_f)     over the rows of other folds
//! ```
//!
//! A: columns of the misalignment; `shift_f`: what everything else that was fitted without fold f shifts a row by; P: prior
//! precision; s: noise of a row of weight 1.
//!
//! Source: Aitken 1935 (generalised least squares), of a series with a gap; ordinary least squares.

use std::ops::Range;

use block_regression::{Fits, Folds};
use coloured_noise::CommonNoise;
use effects::Candidate;
use nalgebra::{DVector, Matrix3, Vector3};
use rayon::prelude::*;

use crate::evidence::{Amplitudes, Evidence};
use crate::search::layout_of;
use crate::star::evidence::{StarEvidence, chunks_of};
use crate::star::layout::Filled;

/// Normal equations of three angles.
#[derive(Clone, Copy, Default)]
struct Normal {
    matrix: Matrix3<f64>,
    moment: Vector3<f64>,
}

impl Normal {
    fn add(&mut self, other: &Self) {
        self.matrix += other.matrix;
        self.moment += other.moment;
    }
}

impl StarEvidence<'_> {
    /// `amplitudes`, each fold's from the others, under this `noise` of the evidence: see the module. One fold alone is
    /// not predicted: its amplitudes are its own.
    pub(super) fn to_predict(
        &self,
        noise: &CommonNoise,
        folds: &Folds,
        candidates: &[&dyn Candidate],
        amplitudes: &Amplitudes,
    ) -> Amplitudes {
        if folds.count < 2 {
            return amplitudes.clone();
        }
        let across = self.across_gaps(noise, folds, candidates, amplitudes);
        let told = across.as_ref().unwrap_or(amplitudes);
        self.with_plain_misalignment(folds, candidates, told)
    }

    /// The same amplitudes as the other folds tell them across the gap that each leaves; `None` where nothing turns the
    /// camera as a whole, or where centroids were learned outside each fold.
    fn across_gaps(
        &self,
        noise: &CommonNoise,
        folds: &Folds,
        candidates: &[&dyn Candidate],
        amplitudes: &Amplitudes,
    ) -> Option<Amplitudes> {
        if self.learned() || !candidates.iter().any(|c| c.turns_camera()) {
            return None;
        }
        let moments = self.moments(folds, candidates);
        let columns: Vec<usize> = (0..moments.width()).collect();
        let layout = layout_of(self, candidates);
        let fitted = |c: &usize| amplitudes.candidates.iter().any(|a| a[*c] != 0.0);
        let set: Vec<usize> = (0..layout.candidates).filter(fitted).collect();
        let mut out = amplitudes.clone();
        for fold in 0..folds.count {
            let grams = moments.under_without(&columns, noise, Some(fold));
            let fits = Fits::new(&grams, folds, &layout, 1.0)?;
            // what acts in that fold alone is as the fit has it
            let Some(beta) = fits.amplitudes_without(fold, &set) else {
                continue;
            };
            out.nuisance[fold] = fits.nuisance(Some(fold), &set, &beta);
            for (&c, value) in set.iter().zip(beta.iter()) {
                out.candidates[fold][c] = *value;
            }
        }
        Some(out)
    }

    /// `amplitudes` with the misalignment, where there is one, that the rows of other folds have in the plain mean.
    fn with_plain_misalignment(
        &self,
        folds: &Folds,
        candidates: &[&dyn Candidate],
        amplitudes: &Amplitudes,
    ) -> Amplitudes {
        let mut out = amplitudes.clone();
        if self.nuisance.parts().0 == 0 {
            return out;
        }
        for nuisance in &mut out.nuisance {
            nuisance.rows_mut(0, 3).fill(0.0);
        }
        let all = self.all(candidates);
        let columns = self.bare_columns(&all);
        let layout = columns.layout();
        let whole: Vec<DVector<f64>> = (0..folds.count).map(|f| out.of_fold(f)).collect();
        let told = |filled: &mut Filled, (fold, frames): &(usize, Range<usize>)| {
            columns.fill(frames.clone(), &layout, filled);
            let of_fold = |f: usize| {
                if f == *fold {
                    return Normal::default();
                }
                let shift = columns.shift(frames.clone(), &layout, filled, &whole[f]);
                self.normal_of(frames.clone(), filled, f, &shift)
            };
            (0..folds.count).map(of_fold).collect::<Vec<Normal>>()
        };
        let chunks = chunks_of(folds);
        let each: Vec<Vec<Normal>> = chunks.par_iter().map_init(Filled::default, told).collect();
        let precision = self.precision();
        let prior = precision.fixed_view::<3, 3>(0, 0) * self.unit_arcsec2();
        for (f, nuisance) in out.nuisance.iter_mut().enumerate() {
            let mut normal = Normal::default();
            each.iter().for_each(|of_folds| normal.add(&of_folds[f]));
            let theta = (normal.matrix + prior).try_inverse();
            let theta = theta.map(|inverse| inverse * normal.moment);
            let was = amplitudes.nuisance[f].fixed_rows::<3>(0).into_owned();
            nuisance.rows_mut(0, 3).copy_from(&theta.unwrap_or(was));
        }
        out
    }

    /// Of the rows of `frames`, whose columns are filled, less their `shift`: the residual is that of a fold.
    fn normal_of(
        &self,
        frames: Range<usize>,
        filled: &Filled,
        fold: usize,
        shift: &[DVector<f64>; 2],
    ) -> Normal {
        let data = self.data;
        let rows = data.frames.first_row[frames.start]..data.frames.first_row[frames.end];
        let residual = self.residual(fold);
        let mut normal = Normal::default();
        for (i, row) in rows.enumerate() {
            let left = [0, 1].map(|a| residual[a][row] - shift[a][i]);
            if data.outlier[row] || left.iter().any(|l| !l.is_finite()) {
                continue;
            }
            let weight = self.weight[row].powi(2);
            for (own, left) in filled.own.iter().zip(left) {
                let turned = Vector3::from_fn(|k, _| own[(i, k)]);
                normal.matrix += turned * turned.transpose() * weight;
                normal.moment += turned * (left * weight);
            }
        }
        normal
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use coloured_noise::Coloured;
    use telemetry::Model;

    use super::*;
    use crate::star::data::StarData;
    use crate::star::harness::at_rest;
    use crate::star::nuisance::StarNuisance;
    use crate::star::slow_price::SlowPrice;

    const STEP: [f64; 3] = [3.0, -2.0, 5.0];
    const AT_S: f64 = 24.75;

    /// Stars that a step at [`AT_S`] moves, beside a reference that wanders by an arcsecond.
    fn stepped<'a>(data: &'a StarData, step: &dyn Candidate) -> StarEvidence<'a> {
        let rows = data.t_s.len();
        let slow = Coloured {
            slow: 1.0,
            tau_s: 20.0,
            white: 0.0,
        };
        let mut evidence = StarEvidence {
            data,
            nuisance: StarNuisance::declared(&Model::default(), data),
            residuals: Arc::new(vec![[vec![0.0; rows], vec![0.0; rows]]]),
            motion: None,
            resolved: false,
            own_paths: false,
            sigma_guess_arcsec: 1.0,
            noise: Some(CommonNoise {
                centroid: 0.1,
                reference: [slow; 3],
            }),
            weight: Arc::new(vec![1.0; rows]),
            drawn: None,
            slow_price: SlowPrice::default(),
            kept: Vec::new(),
        };
        let all = Folds::whole(data.frames.t_s.len());
        let shifts = evidence.residuals_of(&all, &[step], [&amplitudes(1, STEP)]);
        let [x, y] = [0, 1].map(|axis| shifts[0].modelled[axis].clone());
        evidence.residuals = Arc::new(vec![[x, y]]);
        evidence
    }

    fn amplitudes(folds: usize, step: [f64; 3]) -> Amplitudes {
        Amplitudes {
            nuisance: vec![DVector::zeros(3); folds],
            candidates: vec![DVector::from_row_slice(&step); folds],
        }
    }

    /// Other folds see the levels before and after. Of a single fold there are none: what it is fitted with stays.
    #[test]
    fn a_step_is_told_across_its_own_fold_and_in_all_data_by_itself() {
        let t_s: Vec<f64> = (0..120).map(|k| 0.5 * f64::from(k)).collect();
        let data = at_rest(t_s);
        let step = effects::step_at(AT_S, [0.0, 60.0], 1);
        let candidates = [step.as_ref()];
        let evidence = stepped(&data, step.as_ref());
        let noise = evidence.noise.unwrap();
        let told = |folds: &Folds, given: [f64; 3]| {
            evidence.to_predict(&noise, folds, &candidates, &amplitudes(folds.count, given))
        };
        let frames = data.frames.t_s.len();
        let known = amplitudes(1, STEP);
        assert_eq!(
            told(&Folds::whole(frames), STEP).of_fold(0),
            known.of_fold(0)
        );
        let folds = Folds::cut(frames);
        let predicted = told(&folds, [0.1, 0.1, 0.1]);
        for fold in 0..folds.count {
            for (got, want) in predicted.candidates[fold].iter().zip(STEP) {
                // drawn to nothing by a prior of its own size, beside a wander of 1 arcsec
                let drawn = want.powi(2) / (want.powi(2) + 2.0);
                let share = got / want;
                assert!(share > 0.9 * drawn && share < 1.01, "{fold}: {got} {want}");
            }
        }
    }
}
