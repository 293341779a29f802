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

use focal_plane::AttitudeSeries;
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
    let flights = prepared(
        &models,
        bundle,
        &truth,
        &residual,
        settings.seed,
        &mut notes,
    )?;
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
    let measured = Measured::of(&residual, &lost)?;
    let against = Against {
        measured: &measured,
        draws: settings.draws,
        progress,
    };
    let mut flown = vec![];
    let mut compared = vec![];
    for ((flight, model), first) in flights.iter().zip(models.iter().copied()).zip(first) {
        let (figures, standing) = against.fly(flight, model, first, &mut notes)?;
        flown.push(figures);
        compared.push(standing);
    }
    notes.extend(reference_note(bundle, &models, &measured.kept));
    let used = (0..lost.len()).filter(|&k| !lost[k] && !residual.is_outlier(k));
    let mut compared = compared.into_iter();
    let Some(model) = compared.next() else {
        unreachable!("the model itself is among them")
    };
    let report = CompareReport {
        format: COMPARE_FORMAT.to_owned(),
        draws: settings.draws,
        seed: settings.seed,
        rows: Rows {
            used: used.count(),
            outliers: residual.rows_with_outlier(),
            outside_reference: residual.outside_reference,
        },
        sample_rate_hz: measured.plans[0].fs_hz(),
        span_s: residual.t_s[residual.t_s.len() - 1] - residual.t_s[0],
        measured_std_arcsec: measured.kept.each_ref().map(|kept| std_of(kept)),
        model,
        others: compared.collect(),
        notes,
    };
    Ok(Compared {
        report,
        residual,
        measured: measured.density,
        models: flown,
    })
}

/// The models along the measured motion, ready to be drawn.
fn prepared<'a>(
    models: &[&'a Model],
    bundle: &Bundle,
    truth: &'a AttitudeSeries,
    residual: &'a Residual,
    seed: u64,
    notes: &mut Vec<String>,
) -> Result<Vec<Flight<'a>>, ComparisonError> {
    let prepared: Vec<Result<_, ComparisonError>> = models
        .par_iter()
        .map(|&model| {
            let mut said = vec![];
            let flight = Flight::new(model, bundle, truth, &residual.t_s, seed, &mut said)
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
    Ok(flights)
}

/// The measured residual where all models have an attitude, and its spectra.
struct Measured {
    /// About x, y, z, arcsec; NaN where it is left out.
    kept: [Vec<f64>; 3],
    plans: [Spectrum; 3],
    /// arcsec^2/Hz.
    density: [Psd; 3],
}

impl Measured {
    fn of(residual: &Residual, lost: &[bool]) -> Result<Self, ComparisonError> {
        let kept = [0, 1, 2].map(|axis| crate::residual::masked(&residual.kept(axis), lost));
        let mut plans = vec![];
        let mut density = vec![];
        for (kept, axis) in kept.iter().zip(AXES) {
            ComparisonError::check_scatter(axis, std_of(kept))?;
            let of_spectrum = |reason| ComparisonError::Spectrum { axis, reason };
            let plan = Spectrum::new(&residual.t_s, kept).map_err(of_spectrum)?;
            density.push(plan.of(kept).map_err(of_spectrum)?);
            plans.push(plan);
        }
        let (Ok(plans), Ok(density)) = (
            <[Spectrum; 3]>::try_from(plans),
            <[Psd; 3]>::try_from(density),
        ) else {
            unreachable!("three axes were planned")
        };
        Ok(Self {
            kept,
            plans,
            density,
        })
    }
}

/// What each model is held against.
struct Against<'a> {
    measured: &'a Measured,
    draws: u64,
    progress: &'a dyn Fn(&str),
}

impl Against<'_> {
    /// The ensemble of one model, whose `first` draw is there, and how it stands.
    fn fly(
        &self,
        flight: &Flight<'_>,
        model: &Model,
        first: [Vec<f64>; 3],
        notes: &mut Vec<String>,
    ) -> Result<(Flown, ComparedModel), ComparisonError> {
        let measured = self.measured;
        let name = name_of(model);
        let silent =
            [0, 1, 2].map(|axis| std_of(&first[axis]) <= SILENT * std_of(&measured.kept[axis]));
        if silent == [true; 3] {
            return Err(ComparisonError::NoNoise { model: name });
        }
        for (axis, _) in AXES.iter().zip(silent).filter(|(_, silent)| *silent) {
            notes.push(format!(
                "{name} has no error about {axis}: nothing to hold against"
            ));
        }
        (self.progress)(&format!("{} draws of {name}", self.draws));
        let draws = |whole: bool| {
            ensemble(&measured.plans, self.draws, |draw| {
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
        let without_distortion = if plain { Some(draws(false)?) } else { None };
        let standing = ComparedModel {
            name: name.clone(),
            kind: match model.kind {
                ModelKind::Pbm => ComparedKind::Pbm,
                ModelKind::Hem => ComparedKind::Hem,
            },
            stars: flight.stars(),
            axes: standings(&axes, &measured.density, &first, silent),
        };
        let flown = Flown {
            name,
            kind: model.kind,
            axes,
            without_distortion,
            first,
        };
        Ok((flown, standing))
    }
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
