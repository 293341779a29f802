//! Ensembles of models beside a measured residual: the figures of the paper for any model and bundle.
//!
//! ```text
//! error of a band   mean over its bins of 10 log10 P_measured - <10 log10 P_draws>     dB
//! ```
//!
//! Every draw goes through the estimate of the measured series, at the same times with the same gaps, so
//! that neither window nor bias of a logarithm (erratum E9) is in the difference.
//!
//! Source: \[M23\] Figs. 8, 11, 12, 13, 16, 17 and Eq. 19.

use telemetry::report::{
    COMPARE_FORMAT, CompareReport, ComparedAxes, ComparedAxis, ComparedBand, ComparedKind,
    ComparedModel, Rows, StarSource,
};
use telemetry::{Bundle, Model, ModelKind};

use rayon::prelude::*;
use spectra::Psd;

use crate::ensemble::ensemble;
use crate::fit::first_notes;
use crate::flight::{Flight, missing, without_outliers};
use crate::residual::{NEED, std_of};
use crate::{AXES, ComparisonError, Ensemble, Residual, Spectrum};

/// Ends of the bands, Hz: below, between and above. \[M23\] reads its figures at 3 mHz (where distortion
/// begins to matter) and at some 10 mHz; above 100 mHz there is white noise.
pub const BANDS_HZ: [f64; 3] = [3e-3, 10e-3, 100e-3];

/// Share of the measured standard deviation from which the reference's own error is worth a word.
const REFERENCE_SHARE: f64 = 0.1;

/// Share of the measured standard deviation below which a model has no error but rounding.
const SILENT: f64 = 1e-6;

/// Decibels of a natural logarithm.
const DB: f64 = 10.0 * std::f64::consts::LOG10_E;

/// How many draws, and which.
#[derive(Clone, Debug, PartialEq)]
pub struct CompareSettings {
    /// Draws of each model, at least 8.
    pub draws: u64,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for CompareSettings {
    /// 100 draws, as the paper.
    fn default() -> Self {
        Self {
            draws: 100,
            seed: 1,
        }
    }
}

/// An ensemble with what it is of.
#[derive(Clone, Debug)]
pub struct Flown {
    /// Title of the model, or its file.
    pub name: String,
    /// Kind of the model.
    pub kind: ModelKind,
    /// About x, y, z.
    pub axes: [Ensemble; 3],
    /// The same without distortion, of a hybrid model that has one: \[M23\] Fig. 13.
    pub without_distortion: Option<[Ensemble; 3]>,
    /// The residual of the first draw about x, y, z at the times of the measured one, arcsec.
    pub first: [Vec<f64>; 3],
}

/// A comparison with all that its figures show.
#[derive(Clone, Debug)]
pub struct Compared {
    /// What `compare --json` prints.
    pub report: CompareReport,
    /// The measured residual.
    pub residual: Residual,
    /// Its averaged density about x, y, z, arcsec^2/Hz.
    pub measured: [Psd; 3],
    /// The model, and those beside it.
    pub models: Vec<Flown>,
}

/// Holds `model`, and `others` beside it, against what was measured.
///
/// # Errors
///
/// As [`Residual::of`]; a model that cannot be flown; fewer than 8 draws.
pub fn compare(
    model: &Model,
    others: &[Model],
    bundle: &Bundle,
    settings: &CompareSettings,
    progress: &dyn Fn(&str),
) -> Result<Compared, ComparisonError> {
    if settings.draws < 8 {
        return Err(ComparisonError::TooFewDraws {
            got: settings.draws,
        });
    }
    let residual = Residual::of(bundle)?;
    let truth = Residual::reference(bundle)?;
    let mut notes = first_notes(&residual);
    let models: Vec<&Model> = std::iter::once(model).chain(others).collect();
    let prepared: Vec<Result<_, ComparisonError>> = models
        .par_iter()
        .map(|model| {
            let mut said = vec![];
            let (t_s, seed) = (&residual.t_s, settings.seed);
            let flight = Flight::new(model, bundle, &truth, t_s, seed, &mut said)
                .map_err(|error| error.of_model(model))?;
            Ok((flight, said))
        })
        .collect();
    let mut flights = vec![];
    for prepared in prepared {
        let (flight, said) = prepared?;
        flights.push(flight);
        notes.extend(said);
    }
    let first: Vec<Result<_, ComparisonError>> =
        flights.par_iter().map(|flight| flight.draw(0)).collect();
    let first: Vec<[Vec<f64>; 3]> = first.into_iter().collect::<Result<_, _>>()?;
    let lost: Vec<bool> = (0..residual.t_s.len())
        .map(|k| first.iter().any(|theta| missing(theta, k)))
        .collect();
    let count = lost.iter().filter(|lost| **lost).count();
    check_flown(residual.t_s.len(), count)?;
    if count > 0 {
        notes.push(format!(
            "{count} frames are left out: the model has no attitude there (no stars, or an exposure beyond the reference)"
        ));
    }
    let kept = [0, 1, 2].map(|axis| crate::residual::masked(&residual.kept(axis), &lost));
    let mut plans = vec![];
    let mut measured = vec![];
    for (kept, axis) in kept.iter().zip(AXES) {
        ComparisonError::check_scatter(axis, std_of(kept))?;
        let of_spectrum = |reason| ComparisonError::Spectrum { axis, reason };
        let plan = Spectrum::new(&residual.t_s, kept).map_err(of_spectrum)?;
        measured.push(plan.of(kept).map_err(of_spectrum)?);
        plans.push(plan);
    }
    let (Ok(plans), Ok(measured)) = (
        <[Spectrum; 3]>::try_from(plans),
        <[Psd; 3]>::try_from(measured),
    ) else {
        unreachable!("three axes were planned")
    };
    let mut flown = vec![];
    let mut compared = vec![];
    for ((flight, model), first) in flights.iter().zip(&models).zip(first) {
        let name = name_of(model);
        let silent = [0, 1, 2].map(|axis| std_of(&first[axis]) <= SILENT * std_of(&kept[axis]));
        if silent == [true; 3] {
            return Err(ComparisonError::NoNoise { model: name });
        }
        for (axis, _) in AXES.iter().zip(silent).filter(|(_, silent)| *silent) {
            notes.push(format!(
                "{name} has no error about {axis}: nothing to hold against"
            ));
        }
        progress(&format!("{} draws of {name}", settings.draws));
        let draws = |whole: bool| {
            ensemble(&plans, settings.draws, |draw| {
                let mut theta = match whole {
                    true if draw == 0 => first.clone(),
                    true => flight.draw(draw)?,
                    false => flight.processes_alone(draw)?,
                };
                theta.iter_mut().for_each(|axis| without_outliers(axis));
                Ok::<_, ComparisonError>(theta)
            })
        };
        let axes = draws(true)?;
        let plain = model.kind == ModelKind::Hem && flight.stars() != StarSource::None;
        compared.push(ComparedModel {
            name: name.clone(),
            kind: match model.kind {
                ModelKind::Pbm => ComparedKind::Pbm,
                ModelKind::Hem => ComparedKind::Hem,
            },
            stars: flight.stars(),
            axes: standings(&axes, &measured, &first, silent),
        });
        flown.push(Flown {
            name,
            kind: model.kind,
            axes,
            without_distortion: if plain { Some(draws(false)?) } else { None },
            first,
        });
    }
    notes.extend(reference_note(bundle, &models, &kept));
    let with_outlier = residual.rows_with_outlier();
    let mut compared = compared.into_iter();
    let Some(model) = compared.next() else {
        unreachable!("the model itself is among them")
    };
    let report = CompareReport {
        format: COMPARE_FORMAT.to_owned(),
        draws: settings.draws,
        seed: settings.seed,
        rows: Rows {
            used: residual.t_s.len() - with_outlier,
            outliers: with_outlier,
            outside_reference: residual.outside_reference,
        },
        sample_rate_hz: plans[0].fs_hz(),
        span_s: residual.t_s[residual.t_s.len() - 1] - residual.t_s[0],
        measured_std_arcsec: [0, 1, 2].map(|axis| std_of(&kept[axis])),
        model,
        others: compared.collect(),
        notes,
    };
    Ok(Compared {
        report,
        residual,
        measured,
        models: flown,
    })
}

/// Refuses draws that leave fewer frames than a spectrum needs.
fn check_flown(frames: usize, lost: usize) -> Result<(), ComparisonError> {
    if frames - lost >= NEED {
        Ok(())
    } else {
        Err(ComparisonError::NothingFlown { frames, lost })
    }
}

/// The reference's own error is in the measured residual; a model has it only where it declares it.
fn reference_note(bundle: &Bundle, models: &[&Model], kept: &[Vec<f64>; 3]) -> Option<String> {
    let sigmas = bundle.reference.as_ref()?.sigma_arcsec.as_ref()?;
    let typical = [0, 1, 2].map(|axis| {
        let mut of: Vec<f64> = sigmas.iter().map(|sigma| sigma[axis]).collect();
        spectra::robust::median(&mut of).unwrap_or(0.0)
    });
    let seen = (0..3).any(|axis| typical[axis] > REFERENCE_SHARE * std_of(&kept[axis]));
    let declared = |model: &&Model| model.effects.iter().any(|e| e.id == "reference_error");
    if !seen || models.iter().all(declared) {
        return None;
    }
    let [x, y, z] = typical;
    Some(format!(
        "the reference gives its own error as {x:.3}, {y:.3}, {z:.3} arcsec (1 sigma): it is part of the measured residual, and of a model only if that declares the effect reference_error"
    ))
}

fn name_of(model: &Model) -> String {
    match (&model.title, model.file.is_empty()) {
        (Some(title), _) => title.clone(),
        (None, false) => model.file.clone(),
        (None, true) => "model".to_owned(),
    }
}

fn standings(
    drawn: &[Ensemble; 3],
    measured: &[Psd; 3],
    first: &[Vec<f64>; 3],
    silent: [bool; 3],
) -> ComparedAxes {
    let axis = |i: usize| axis(&drawn[i], &measured[i], &first[i], silent[i]);
    ComparedAxes {
        x: axis(0),
        y: axis(1),
        z: axis(2),
    }
}

fn axis(drawn: &Ensemble, measured: &Psd, first: &[f64], silent: bool) -> ComparedAxis {
    let whole = drawn.standing(measured, 0, |_| !silent);
    let mut from_hz = 0.0;
    let mut bands = vec![];
    for to_hz in BANDS_HZ.map(Some).into_iter().chain([None]) {
        let inside = |f: f64| !silent && f >= from_hz && to_hz.is_none_or(|to| f < to);
        let standing = drawn.standing(measured, 0, inside);
        bands.push(ComparedBand {
            from_hz,
            to_hz,
            bins: standing.map_or(0, |s| s.bins),
            error_db: standing.map(|s| s.error * DB),
            sigma_db: standing.map(|s| s.sigma * DB),
            rms_db: standing.map(|s| s.rms * DB),
            cost: standing.map(|s| s.cost),
        });
        from_hz = to_hz.unwrap_or(f64::INFINITY);
    }
    ComparedAxis {
        model_std_arcsec: std_of(first),
        log_psd_cost: whole.map_or(f64::NAN, |s| s.cost),
        above_3_sigma: whole.map_or(f64::NAN, |s| s.above),
        bands,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of no frames there is no spectrum, and no scatter that could be rounding.
    #[test]
    fn draws_without_attitudes_are_refused() {
        assert!(check_flown(20, 4).is_ok());
        let refused = check_flown(20, 20).unwrap_err().to_string();
        assert!(refused.contains("20 of the 20 frames"), "{refused}");
    }
}
