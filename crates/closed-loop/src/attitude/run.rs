//! The loop at attitude level: the tracker's own attitude against a reference.
//!
//! Not physics: the order of the steps.

use block_regression::Folds;
use coloured_noise::Coloured;
use effects::Scene;
use spectra::robust::median_step;
use spectra::standing_out::mark;

use crate::attitude::data::AttitudeData;
use crate::attitude::declared_effects;
use crate::attitude::finish::{Finish, finish};
use crate::attitude::fitted::{evidence, residuals};
use crate::attitude::inquiry::Inquiry;
use crate::attitude::mixing::Mixing;
use crate::attitude::noise::declared_noise;
use crate::attitude::search::Declared;
use crate::attitude::spatial_errors::SpatialErrors;
use crate::bins;
use crate::causes::SMEAR;
use crate::declared;
use crate::error::CloseError;
use crate::evidence::{Evidence, Residuals};
use crate::motion::{self, Around};
use crate::outcome::Closed;
use crate::search::refusal::Refusal;
use crate::search::{amplitudes, fit};
use crate::situation::Situation;

/// Fewest frames from which an effect and its noise can both be had.
const MIN_FRAMES: usize = 20;

pub(crate) fn run(
    situation: &Situation<'_>,
    progress: &dyn Fn(&str),
) -> Result<Closed, CloseError> {
    let table = situation
        .bundle
        .attitude
        .as_ref()
        .ok_or(CloseError::NothingToCompare("no attitude"))?;
    let reference = situation
        .reference
        .as_ref()
        .ok_or(CloseError::NothingToCompare(
            "the bundle has an attitude but no reference to hold it against",
        ))?;
    let mut data = AttitudeData::against(&table.t_s, &table.q, reference);
    if data.t_s.len() < MIN_FRAMES {
        return Err(CloseError::TooFewFrames {
            table: "attitude",
            frames: data.t_s.len(),
            need: MIN_FRAMES,
            why: "the others lie outside the reference or in its gaps",
        });
    }
    let folds = Folds::cut(data.t_s.len());
    let around = motion::around(reference, &data.t_s, 1.0);
    if !around.resolved() {
        data.rate = std::array::from_fn(|_| vec![0.0; data.t_s.len()]);
    }
    let effects = declared::effects(situation)?;
    if !effects.is_empty() {
        data.subtract(|t_s| declared_effects::rotation(&effects, &around, t_s));
    }
    progress("residuals of the declared model");
    let before = settle(&mut data, situation, &folds, &around)?;

    progress("searching for causes");
    let scene = scene(situation, &data);
    let changes = SpatialErrors::declared(situation, &data.t_s);
    let inquiry = Inquiry {
        situation,
        folds: &folds,
        scene: &scene,
        before: &before,
        declared: Declared {
            changes: changes.as_ref(),
            noise: declared_noise(situation)?,
        },
    };
    let mut searched = inquiry.search(&data, &around, &[])?;
    let steady = inquiry.steadier(&data, reference, &around, &searched);
    let motion = steady.as_ref().unwrap_or(&around);
    if steady.is_some() {
        progress("searching again along the path less the reference's slow error");
        searched = inquiry.search(&data, motion, &[])?;
    }
    if let Some(again) = inquiry.again(&mut data, motion, &searched, progress)? {
        searched = again;
    }
    if steady.is_some() && !searched.is_smeared() {
        let refused = &mut searched.refused;
        refused.insert(SMEAR.to_owned(), Refusal::OwnPath);
    }
    let found = &searched.found;
    let evidence = evidence(&data, situation, searched.noise, motion);
    let after = residuals(&evidence, &folds, found, &found.selection.chosen)?;
    let rivals = inquiry.rivals(&data, motion, &searched)?;
    progress("figures");
    let whole = Finish {
        situation,
        evidence,
        motion,
        folds: &folds,
        found,
        refused: &searched.refused,
        before: &before,
        changes: changes.as_ref(),
    };
    finish(&whole, after, searched.series, rivals)
}

/// The before residual, with outliers marked per axis.
fn settle(
    data: &mut AttitudeData,
    situation: &Situation<'_>,
    folds: &Folds,
    motion: &Around,
) -> Result<Residuals, CloseError> {
    let white = [Coloured::WHITE; 3];
    loop {
        data.rebin(folds, bins::MOST);
        let evidence = evidence(data, situation, white, motion);
        let fitted = fit(&evidence, &data.bins.folds, &[])?;
        let amplitudes = amplitudes(&fitted, folds, &[], 0).ok_or(CloseError::Singular)?;
        let before = evidence.residuals(folds, &[], &amplitudes);
        let each = before.axes.iter().zip(&mut data.outlier);
        let added: usize = each.map(|(axis, outlier)| mark(axis, outlier)).sum();
        if added == 0 {
            data.mixing = Mixing::of(&before, &data.outlier);
            return Ok(before);
        }
    }
}

fn scene<'a>(situation: &'a Situation<'_>, data: &AttitudeData) -> Scene<'a> {
    Scene {
        surroundings: situation.surroundings(),
        has_stars: false,
        has_catalogue: false,
        has_reference: true,
        has_attitude: true,
        stars: &[],
        exposure_s: situation.exposure_s(),
        step_s: median_step(&data.t_s).unwrap_or(f64::INFINITY),
        warm: None,
    }
}
