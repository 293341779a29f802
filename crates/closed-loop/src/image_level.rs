//! Which explanation of an image-level leftover the data supports.
//!
//! Centroids are formed anew with the dark map taken off, and again with an
//! effective spot fitted to the pixels. Each step has to earn its place out of
//! fold, block by block; a function of pixel phase, the rival explanation, is
//! tried on every level on the same footing.
//!
//! Not physics: the comparison.

use std::collections::BTreeMap;

use effects::Candidate;
use statrs::distribution::{ContinuousCDF, StudentsT};
use telemetry::report::{Estimate, FoundEffect, Selector};
use telemetry::{EffectEntry, EffectValue};

use crate::close::Rival;
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::figures;
use crate::fit::OutOfFold;
use crate::folds::Folds;
use crate::images::{DARK_MAP, DARK_MAP_FILE, EFFECTIVE_PSF, Formed};
use crate::search::{amplitudes, borrowed, fit};
use crate::selection::{FAMILY_ALPHA, columns_of};
use crate::star_data::StarData;
use crate::star_design::StarEvidence;

/// One way of forming centroids, and what it is called.
pub(crate) struct Level<'a> {
    pub(crate) name: &'static str,
    pub(crate) evidence: &'a StarEvidence<'a>,
}

/// What one step from a level to the next brought.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) delta_loglik: f64,
    pub(crate) p_value: f64,
    /// Share of the before mean square, out of fold.
    pub(crate) explained: f64,
    pub(crate) stands: bool,
}

/// The outcome of the comparison.
#[derive(Clone, Debug)]
pub(crate) struct ImageLevel {
    pub(crate) rivals: Vec<Rival>,
    pub(crate) dark_map: Step,
    pub(crate) effective_psf: Step,
}

/// Compares `[measured, dark map + first moments, dark map + effective spot]`.
pub(crate) fn compare(
    levels: &[Level<'_>; 3],
    phase: &[Box<dyn Candidate>],
    folds: &Folds,
    data: &StarData,
) -> Result<ImageLevel, CloseError> {
    let mut rivals = Vec::new();
    let mut scores = Vec::new();
    for level in levels {
        scores.push(rivals_of(level, phase, folds, data, &mut rivals)?);
    }
    let zero = rivals.first().map_or(0.0, |r| r.delta_loglik);
    for rival in &mut rivals {
        rival.delta_loglik -= zero;
    }
    let whole = scores[0].total_sse();
    let dark_map = step(&scores[1], &scores[0], whole);
    let effective_psf = step(&scores[2], &scores[usize::from(dark_map.stands)], whole);
    Ok(ImageLevel { rivals, dark_map, effective_psf })
}

/// A level by itself and with the best phase term; returns the score by itself.
fn rivals_of(
    level: &Level<'_>,
    phase: &[Box<dyn Candidate>],
    folds: &Folds,
    data: &StarData,
    rivals: &mut Vec<Rival>,
) -> Result<OutOfFold, CloseError> {
    let fitted = fit(level.evidence, folds, &borrowed(phase))?;
    let base = fitted.fits.out_of_fold(&[]).ok_or(CloseError::Singular)?;
    let best = (0..phase.len())
        .filter(|&g| !fitted.groups[g].columns.is_empty())
        .filter_map(|g| Some((g, fitted.fits.out_of_fold(&columns_of(&fitted.groups, &[g]))?)))
        .max_by(|a, b| a.1.total_loglik().total_cmp(&b.1.total_loglik()));
    let columns = phase.iter().map(|c| c.coefficients().len()).sum();
    let mut tell = |what: String, set: &[usize], loglik: f64| -> Result<(), CloseError> {
        let amplitudes = amplitudes(&fitted, folds, set, columns).ok_or(CloseError::Singular)?;
        let residual = level.evidence.residuals(folds, &borrowed(phase), &amplitudes);
        rivals.push(Rival {
            what,
            rms_arcsec: figures::star_rms(&residual, data).to_vec(),
            delta_loglik: loglik,
        });
        Ok(())
    };
    tell(level.name.to_owned(), &[], base.total_loglik())?;
    if let Some((g, score)) = best {
        tell(format!("{} + pixel_phase_harmonics", level.name), &[g], score.total_loglik())?;
    }
    Ok(base)
}

/// Gain of one score over another, block by block: its mean against its scatter
/// is honest however the errors within a block hang together.
fn step(with: &OutOfFold, without: &OutOfFold, whole: f64) -> Step {
    let gain: Vec<f64> = with.loglik.iter().zip(&without.loglik).map(|(a, b)| a - b).collect();
    let total: f64 = gain.iter().sum();
    let p_value = one_sided(&gain);
    Step {
        delta_loglik: total,
        p_value,
        explained: (without.total_sse() - with.total_sse()) / whole,
        stands: total > 0.0 && p_value < FAMILY_ALPHA,
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
    StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |law| law.sf(mean / (variance / n).sqrt()))
}

/// The adopted steps as effects of the report and entries of the model.
pub(crate) fn effects(level: &ImageLevel, formed: &Formed) -> Vec<(FoundEffect, EffectEntry)> {
    let mut out = Vec::new();
    if level.dark_map.stands {
        let pixels = formed.map.pixels.len() as f64;
        let rms = formed.map.rms_dn();
        // The rms of n independent pixels is known to rms/sqrt(2 n).
        let numbers = [("pixels", pixels, None, ""), ("rms_dn", rms, Some(rms / (2.0 * pixels.max(1.0)).sqrt()), "DN")];
        out.push(entry(DARK_MAP, &level.dark_map, Some(DARK_MAP_FILE), &numbers));
    }
    if level.effective_psf.stands {
        let mut widths: Vec<f64> = formed.fwhm_px.clone();
        let fwhm = crate::robust::median(&mut widths).unwrap_or(f64::NAN);
        let n = widths.len().max(1) as f64;
        let scatter = (widths.iter().map(|w| (w - fwhm).powi(2)).sum::<f64>() / n).sqrt();
        out.push(entry(EFFECTIVE_PSF, &level.effective_psf, None, &[("fwhm_px", fwhm, Some(scatter), "px")]));
    }
    out
}

fn entry(
    id: &str,
    step: &Step,
    file: Option<&str>,
    numbers: &[(&str, f64, Option<f64>, &str)],
) -> (FoundEffect, EffectEntry) {
    let mut written: BTreeMap<String, EffectValue> = BTreeMap::new();
    let mut selectors = BTreeMap::new();
    if let Some(file) = file {
        written.insert("file".to_owned(), EffectValue::Text(file.to_owned()));
        selectors.insert("file".to_owned(), Selector::Text(file.to_owned()));
    }
    let mut parameters = BTreeMap::new();
    for &(name, value, sigma, unit) in numbers {
        written.insert(name.to_owned(), EffectValue::Number(value));
        parameters
            .insert(name.to_owned(), Estimate { value, sigma, unit: unit.to_owned(), interval: None });
    }
    let effect = FoundEffect {
        id: id.to_owned(),
        selectors,
        parameters,
        delta_loglik: step.delta_loglik,
        p_value: step.p_value,
        variance_explained: Some(step.explained),
        confusable_with: Vec::new(),
    };
    (effect, EffectEntry::new(id, written))
}
