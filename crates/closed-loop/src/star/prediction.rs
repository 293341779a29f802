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
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use telemetry::Model;

    use super::*;
    use crate::star::data::StarData;
    use crate::star::frame_rotation::rotation_row;
    use crate::star::harness::{at_rest, silent};

    const STEP: [f64; 3] = [8.0, -8.0, 8.0];
    /// In the middle of the third of five folds.
    const AT_S: f64 = 30.25;
    const RATE_HZ: f64 = 2.0;
    const FRAMES: u32 = 120;
    /// Of the wander.
    const SIGMA: f64 = 1.0;
    const TAU_S: f64 = 200.0;
    const CENTROID: f64 = 0.1;

    /// Stars that `step` moves, beside a reference that wanders.
    fn moved<'a>(data: &'a StarData, step: &dyn Candidate, seed: u64) -> StarEvidence<'a> {
        let slow = Coloured {
            slow: SIGMA,
            tau_s: TAU_S,
            white: 0.0,
        };
        let mut model = Model::default();
        model.noise.distortion_arcsec = Some(1.0);
        model.noise.bias_arcsec = Some([10.0; 3]);
        let mut evidence = StarEvidence {
            noise: Some(CommonNoise {
                centroid: CENTROID,
                reference: [slow; 3],
            }),
            ..silent(data, &model)
        };
        let one = Folds::whole(data.frames.t_s.len());
        let size = amplitudes(&evidence, &one, STEP);
        let [shifts] = evidence.residuals_of(&one, &[step], [&size]);
        let mut residual = [0, 1].map(|axis| shifts.modelled[axis].clone());
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
        let stays = (-1.0 / (RATE_HZ * TAU_S)).exp();
        let mut turned = [0; 3].map(|_| SIGMA * draw());
        for frame in 0..data.frames.t_s.len() {
            turned = turned.map(|e| stays * e + SIGMA * (1.0 - stays * stays).sqrt() * draw());
            for row in data.frames.rows_of(frame) {
                let jacobian = rotation_row(data, row);
                for axis in 0..2 {
                    let shift: f64 = (0..3).map(|k| jacobian[axis][k] * turned[k]).sum();
                    residual[axis][row] += shift + CENTROID * draw();
                }
            }
        }
        evidence.residuals = Arc::new(vec![residual]);
        evidence
    }

    fn times_s() -> Vec<f64> {
        (0..FRAMES).map(|k| f64::from(k) / RATE_HZ).collect()
    }

    fn step() -> Box<dyn Candidate> {
        effects::step_at(AT_S, [0.0, f64::from(FRAMES) / RATE_HZ], 1)
    }

    /// The same in every fold.
    fn amplitudes(evidence: &StarEvidence<'_>, folds: &Folds, step: [f64; 3]) -> Amplitudes {
        Amplitudes {
            nuisance: vec![DVector::zeros(evidence.precision().nrows()); folds.count],
            candidates: vec![DVector::from_row_slice(&step); folds.count],
        }
    }

    /// Other folds tell a step by the levels before and after their gap of 12 s, over which the wander changes by
    /// `sqrt(2 (1 - exp(-12 / tau))) = 0.34`. Of innovations that know the fold, a mean to return to in 30 s would tell it
    /// to `sqrt(2 tau / 30) = 3.7`.
    #[test]
    fn the_fold_that_a_step_is_in_is_a_gap() {
        let data = at_rest(times_s());
        let step = step();
        let folds = Folds::cut(data.frames.t_s.len());
        let mut squares = 0.0;
        let draws = 10;
        for seed in 0..draws {
            let evidence = moved(&data, step.as_ref(), seed);
            let noise = evidence.noise.unwrap();
            let given = amplitudes(&evidence, &folds, [0.1; 3]);
            let told = evidence.to_predict(&noise, &folds, &[step.as_ref()], &given);
            for axis in 0..2 {
                squares += (told.candidates[2][axis] - STEP[axis]).powi(2);
            }
        }
        let rms = (squares / (2 * draws) as f64).sqrt();
        // 20 squares: 4 sigma is a factor of 1.6
        assert!((0.2..0.55).contains(&rms), "{rms}");
    }

    /// What is fitted to all data at once is no prediction.
    #[test]
    fn one_fold_alone_keeps_its_amplitudes() {
        let data = at_rest(times_s());
        let step = step();
        let evidence = moved(&data, step.as_ref(), 0);
        let noise = evidence.noise.unwrap();
        let one = Folds::whole(data.frames.t_s.len());
        let mut given = amplitudes(&evidence, &one, STEP);
        given.nuisance[0][0] = 0.7;
        let told = evidence.to_predict(&noise, &one, &[step.as_ref()], &given);
        assert_eq!(told.of_fold(0), given.of_fold(0));
    }
}
