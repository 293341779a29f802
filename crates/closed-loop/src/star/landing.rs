//! Where fits take the stars, and with them the light.
//!
//! Modelled positions start as projections. What is fitted shifts them, frames with attitudes of their own turn
//! by what their stars still agree on, and the declared centroid error is evaluated where the light then falls
//! ([`crate::star::light`]).
//!
//! Not physics: projection and shift added up.

use std::sync::Arc;

use block_regression::Folds;
use effects::{Candidate, Effect};
use focal_plane::{ARCSEC_PER_RAD, AttitudeSource};
use nalgebra::{DVector, UnitQuaternion, Vector3};
use rayon::prelude::*;

use crate::declared::OnCentroids;
use crate::error::CloseError;
use crate::evidence::{Amplitudes, Residuals};
use crate::search::Choice;
use crate::search::selection::columns_of;
use crate::star::data::{Light, StarData};
use crate::star::evidence::StarEvidence;
use crate::star::frame_rotation::{rotation_of, rotation_row};
use crate::star::light;

/// Light that falls this far off has another pixel phase: by a fifth of a radian.
const ELSEWHERE_PX: f64 = 0.03;
/// Sigmas by which stars seem to be shifted otherwise than they are, as the declared centroid error shifts along, that
/// do not matter.
const ALONG: f64 = 1.0;

/// What was fitted shifts each row by, arcsec, x and y.
pub(crate) struct Shifts {
    /// The declared model's unknowns alone.
    pub(crate) fitted: Vec<Vec<f64>>,
    /// With the effects that move the light.
    pub(crate) light: Vec<Vec<f64>>,
    /// With all effects: those that act on the centroid leave the light where it is.
    pub(crate) whole: Vec<Vec<f64>>,
}

impl Shifts {
    /// What the chosen effects and the nuisance beside them shift each row by, as all data have them.
    fn of(level: &StarEvidence<'_>, folds: &Folds, choice: Choice<'_>) -> Result<Self, CloseError> {
        let acts: [fn(&dyn Candidate) -> bool; 3] = [|_| false, |c| c.moves_light(), |_| true];
        let [fitted, light, whole] = modelled(level, folds, choice, acts)?;
        Ok(Self {
            fitted,
            light,
            whole,
        })
    }
}

/// What was found takes the light elsewhere.
pub(crate) struct Elsewhere {
    pub(crate) shifts: Shifts,
    /// What was chosen, in its polished form, and its place among the candidates.
    pub(crate) forms: Vec<(usize, Arc<dyn Candidate>)>,
    /// Those of them that no catalogue lists, once they are told from the others.
    pub(crate) put_forward: Vec<Arc<dyn Candidate>>,
}

impl Elsewhere {
    /// Tells what stands behind the first `listed` candidates from what the catalogue lists.
    pub(crate) fn split(&mut self, listed: usize) {
        let forms = self.forms.drain(..);
        let (forms, others): (Vec<_>, Vec<_>) = forms.partition(|(g, _)| *g < listed);
        self.forms = forms;
        self.put_forward = others.into_iter().map(|(_, c)| c).collect();
    }

    /// `None`: the light falls where it was taken to.
    pub(crate) fn of(
        level: &StarEvidence<'_>,
        folds: &Folds,
        choice: Choice<'_>,
        phase: &OnCentroids,
    ) -> Result<Option<Box<Self>>, CloseError> {
        if !takes_light_along(level, folds, choice, phase)? {
            return Ok(None);
        }
        Ok(Some(Box::new(Self {
            shifts: Shifts::of(level, folds, choice)?,
            forms: choice.forms(),
            put_forward: Vec::new(),
        })))
    }
}

/// Whether what was chosen takes the light off from where it was taken to fall by enough to matter.
pub(crate) fn takes_light_along(
    level: &StarEvidence<'_>,
    folds: &Folds,
    choice: Choice<'_>,
    phase: &OnCentroids,
) -> Result<bool, CloseError> {
    let [light] = modelled(level, folds, choice, [|c: &dyn Candidate| c.moves_light()])?;
    let data = level.data;
    let along =
        |v: f64| data.is_shifted_along(&light, phase, &level.weight, v * level.unit_arcsec2());
    let variance = choice.fitted.variance_beside(choice.chosen);
    Ok(data.lands_elsewhere(&light) || variance.is_some_and(along))
}

/// What the nuisance and those of the chosen effects that are asked for shift each row by, arcsec.
fn modelled<const N: usize>(
    level: &StarEvidence<'_>,
    folds: &Folds,
    choice: Choice<'_>,
    acts: [fn(&dyn Candidate) -> bool; N],
) -> Result<[Vec<Vec<f64>>; N], CloseError> {
    let fits = &choice.fitted.fits;
    let set = columns_of(&choice.fitted.groups, choice.chosen);
    let only = choice.only();
    let beta = match set.is_empty() {
        true => DVector::zeros(0),
        false => fits.estimate(&set).ok_or(CloseError::Singular)?.value,
    };
    let nuisance = fits.nuisance(None, &set, &beta);
    let with = acts.map(|acts| {
        let mut amplitudes = only.spread(&beta);
        let mut first = 0;
        for candidate in &only.candidates {
            let own = candidate.coefficients().len();
            if !acts(*candidate) {
                amplitudes.rows_mut(first, own).fill(0.0);
            }
            first += own;
        }
        Amplitudes {
            nuisance: vec![nuisance.clone(); folds.count],
            candidates: vec![amplitudes; folds.count],
        }
    });
    let each = level.residuals_of(folds, &only.candidates, with.each_ref());
    Ok(each.map(|r| r.modelled))
}

impl StarData {
    /// The measured residual less `shift`, arcsec.
    fn left(&self, shift: &[Vec<f64>]) -> [Vec<f64>; 2] {
        let mut left = self.measured_residual();
        for (left, shift) in left.iter_mut().zip(shift) {
            left.iter_mut().zip(shift).for_each(|(l, s)| *l -= s);
        }
        left
    }

    /// Turns each frame's own attitude by what its stars still agree on, once `shift` (arcsec,
    /// what the fitted unknowns move each row by) is out, and projects the stars anew, `effects` being those that
    /// the model declares. The first attitudes know neither the unknowns nor the declared effects, and hold stars
    /// that were mistaken for others: they are off by pixels and more.
    ///
    /// Returns the sum of the squares, arcsec^2, by which the rows moved otherwise than as the columns of a small
    /// rotation say: what is wrong with a fit beside the attitudes as they were.
    pub(crate) fn turn_frames(&mut self, shift: &[Vec<f64>], effects: &[Arc<dyn Effect>]) -> f64 {
        let left = self.left(shift);
        let scale = self.camera.arcsec_per_px();
        let mut expected = self.projected.clone();
        for frame in 0..self.frames.frames() {
            let Some(theta) = rotation_of(self, frame, &left) else {
                continue;
            };
            let turn = UnitQuaternion::from_scaled_axis(theta / ARCSEC_PER_RAD);
            self.attitude[frame] = turn * self.attitude[frame];
            for row in self.frames.rows_of(frame) {
                let jacobian = rotation_row(self, row);
                for axis in 0..2 {
                    expected[axis][row] += Vector3::from(jacobian[axis]).dot(&theta) / scale[axis];
                }
            }
        }
        let own = self.own_motion();
        self.project_with(own.as_ref().map(|m| m as &dyn AttitudeSource), effects);
        let squares = (0..self.t_s.len())
            .filter(|&row| !self.outlier[row])
            .map(|row| {
                let off = |axis: usize| self.projected[axis][row] - expected[axis][row];
                (0..2).map(|a| (off(a) * scale[a]).powi(2)).sum::<f64>()
            });
        squares.sum()
    }

    /// Moves the modelled positions to projection + what the residuals `inside` were modelled by (misalignment,
    /// distortion and directions as all data have them), and evaluates the declared centroid error where the
    /// light fell.
    /// Takes its change out of `residual`; returns the sum of its squares, arcsec^2.
    pub(crate) fn move_modelled(
        &mut self,
        inside: &Residuals,
        residual: &mut Residuals,
        phase: &OnCentroids,
    ) -> f64 {
        let scale = self.camera.arcsec_per_px();
        let known = self.phase_error.clone();
        self.light = light::of(self, [&inside.axes[0], &inside.axes[1]]);
        self.fall_at(self.shifted(&inside.modelled), None, phase);
        let mut squares = 0.0;
        for axis in 0..2 {
            for (row, known) in known[axis].iter().enumerate() {
                let change = (self.phase_error[axis][row] - known) * scale[axis];
                residual.axes[axis][row] -= change;
                if !self.outlier[row] {
                    squares += change * change;
                }
            }
        }
        squares
    }

    /// Where this takes each row from its projection, px.
    fn shifted(&self, shift_arcsec: &[Vec<f64>]) -> [Vec<f64>; 2] {
        let scale = self.camera.arcsec_per_px();
        let of_frame = |k: usize| {
            self.frames.rows_of(k).map(move |row| {
                let turned = self.turned_arcsec(row, k);
                let at = |axis: usize| {
                    let shift = shift_arcsec[axis][row] - turned[axis];
                    self.projected[axis][row] + shift / scale[axis]
                };
                (at(0), at(1))
            })
        };
        let frames = (0..self.frames.frames()).into_par_iter();
        let (x, y) = frames.flat_map_iter(of_frame).unzip();
        [x, y]
    }

    /// Takes the light to fall where it is modelled.
    pub(crate) fn lands_as_modelled(&mut self) {
        self.light = Light::as_modelled(self.t_s.len());
    }

    /// Whether `shift_arcsec`, with the effects that were found, takes the light off from where it was
    /// taken to fall by enough for its pixel phase to be another one.
    pub(crate) fn lands_elsewhere(&self, shift_arcsec: &[Vec<f64>]) -> bool {
        let at = self.light.beside(&self.shifted(shift_arcsec));
        let known = self.landed();
        let (mut squares, mut count) = (0.0, 0.0);
        for row in (0..self.t_s.len()).filter(|&r| !self.outlier[r]) {
            for axis in 0..2 {
                squares += (at[axis][row] - known[axis][row]).powi(2);
            }
            count += 2.0;
        }
        squares > ELSEWHERE_PX * ELSEWHERE_PX * count
    }

    /// Whether the declared centroid error shifts stars along with that by enough to matter, for rows of this `weight`
    /// and, at weight 1, this `variance`, arcsec^2: star by star, for as one moves on through the phases that is nothing.
    fn is_shifted_along(
        &self,
        shift_arcsec: &[Vec<f64>],
        phase: &OnCentroids,
        weight: &[f64],
        variance: f64,
    ) -> bool {
        let at = self.light.beside(&self.shifted(shift_arcsec));
        let known = self.landed();
        let error = self.centroid_error_px(at.each_ref().map(Vec::as_slice), phase);
        let scale = self.camera.arcsec_per_px();
        let mut along = 0.0;
        for axis in 0..2 {
            let mut sums = vec![[0.0; 2]; self.stars.len()];
            for row in (0..self.t_s.len()).filter(|&r| !self.outlier[r]) {
                let off = at[axis][row] - known[axis][row];
                let change = error[axis][row] - self.phase_error[axis][row];
                let sum = &mut sums[self.star[row]];
                sum[0] += weight[row] * off * change;
                sum[1] += weight[row] * off * off;
            }
            let seen = sums.iter().filter(|s| s[1] > 0.0);
            let of_stars: f64 = seen.map(|[both, own]| both * both / own).sum();
            along += of_stars * scale[axis] * scale[axis] / variance;
        }
        along > ALONG * ALONG
    }

    /// Evaluates the declared centroid error where `shifts` take the light. Columns of what moves
    /// the image are those where that motion starts from: projection + what was fitted, without it.
    pub(crate) fn land(
        &mut self,
        shifts: &Shifts,
        phase: &OnCentroids,
        effects: &[Arc<dyn Effect>],
    ) {
        if self.free_attitude {
            self.turn_frames(&shifts.whole, effects);
        }
        let left = self.left(&shifts.whole);
        self.light = light::of(self, left.each_ref().map(Vec::as_slice));
        let carried = self.shifted(&shifts.light);
        self.fall_at(self.shifted(&shifts.fitted), Some(carried), phase);
    }
}
