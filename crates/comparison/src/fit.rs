//! White noise and first-order Gauss-Markov process of each axis: the parameters of a HEM.
//!
//! ```text
//! start          least squares on logarithms of the spectrum, [M23] Eq. 19-20 with erratum E9
//! best           exact likelihood at the frames' times; of the spectrum where a band is chosen
//! log_psd_cost   [M23] Eq. 19 against draws of the fitted process, per degree of freedom
//! ```
//!
//! over bins of a tenth of a decade ([`crate::Ensemble`]): 1 on average for a residual that is
//! FOGM plus white, however long the series; larger by as much as the shape differs. Sigmas are true
//! standard deviations of one frame (erratum E6); `as_printed` is Eq. 17-20 to the letter on the raw
//! periodogram.
//!
//! Source: \[M23\] Eq. 15-20; errata E6 to E9.

use fogm_fit::{
    Convention, Estimate, Fit, FitOptions, Fogm, FogmWhite, HANN_BIN_CORRELATION, LogPsdFit,
    Preferred, fit_log_psd, fit_psd, fit_times,
};
use spectra::Psd;
use star_tracker::{Purpose, stream};
use telemetry::report::{
    AxisFit, AxisPrinted, FIT_FORMAT, FitAxes, FitReport, PreferredModel, Rows, WithSigma,
};
use telemetry::{Bundle, HemAxes, HemAxis, Model, ModelKind, ModelTracker};

use crate::ensemble::ensemble;
use crate::residual::masked;
use crate::{AXES, ComparisonError, Ensemble, Residual, Spectrum};

/// Draws of the fitted process, and their seed: the same fit says the same twice.
const DRAWS: u64 = 64;
const SEED: u64 = 1;

/// A cost per degree of freedom above which the shape counts as something else than FOGM plus white.
const POOR: f64 = 2.0;

/// Which frequencies count.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitSettings {
    /// Frequencies used, Hz; all of them if `None`.
    pub band_hz: Option<[f64; 2]>,
    /// Ranges left out, Hz: lines of something else.
    pub lines_hz: Vec<[f64; 2]>,
}

/// A fit with what it rests on.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// What `fit --json` prints.
    pub report: FitReport,
    /// The HEM of these parameters.
    pub model: Model,
    /// The residual that was fitted.
    pub residual: Residual,
    /// Averaged density of the residual about each axis, arcsec^2/Hz.
    pub measured: [Psd; 3],
    /// Mean density of draws of the fitted process at the same frequencies.
    pub modelled: [Vec<f64>; 3],
}

/// Fits the attitude residual of a bundle.
///
/// # Errors
///
/// As [`Residual::of`]; an axis that is no series or has no noise.
pub fn fit(bundle: &Bundle, settings: &FitSettings) -> Result<Fitted, ComparisonError> {
    let residual = Residual::of(bundle)?;
    let mut notes = first_notes(&residual);
    let mut started = Vec::with_capacity(3);
    for axis in 0..3 {
        started.push(Started::new(&residual, axis, settings)?);
    }
    let Ok(started) = <[Started; 3]>::try_from(started) else {
        unreachable!("three axes were fitted")
    };
    let drawn = drawn(&residual.t_s, &started)?;
    let axes = [0, 1, 2].map(|i| Axis::new(&started[i], &drawn[i], settings));
    for (axis, name) in axes.iter().zip(AXES) {
        notes.extend(axis.notes.iter().map(|note| format!("{name}: {note}")));
    }
    let [x, y, z] = axes;
    let with_outlier = residual.rows_with_outlier();
    let report = FitReport {
        format: FIT_FORMAT.to_owned(),
        axes: FitAxes {
            x: x.report.clone(),
            y: y.report.clone(),
            z: z.report.clone(),
        },
        rows: Some(Rows {
            used: residual.t_s.len() - with_outlier,
            outliers: with_outlier,
            outside_reference: residual.outside_reference,
        }),
        sample_rate_hz: Some(x.fs_hz),
        span_s: Some(residual.t_s[residual.t_s.len() - 1] - residual.t_s[0]),
        notes,
    };
    let model = hem(bundle, [x.process, y.process, z.process], x.fs_hz);
    Ok(Fitted {
        report,
        model,
        residual,
        measured: [x.measured, y.measured, z.measured],
        modelled: [x.modelled, y.modelled, z.modelled],
    })
}

pub(crate) fn first_notes(residual: &Residual) -> Vec<String> {
    let mut notes = vec![];
    if residual.unsolved > 0 {
        notes.push(format!(
            "{} frames have too few stars for an attitude",
            residual.unsolved
        ));
    }
    if residual.outside_reference > 0 {
        notes.push(format!(
            "{} frames lie outside the reference or in its gaps",
            residual.outside_reference
        ));
    }
    notes
}

/// An axis that was fitted.
struct Started {
    fit: Fit,
    printed: Option<LogPsdFit>,
    plan: Spectrum,
    measured: Psd,
    process: HemAxis,
    std_arcsec: f64,
    outliers: usize,
}

impl Started {
    fn new(
        residual: &Residual,
        axis: usize,
        settings: &FitSettings,
    ) -> Result<Self, ComparisonError> {
        let name = AXES[axis];
        let of_spectrum = |reason| ComparisonError::Spectrum { axis: name, reason };
        let of_fit = |reason| ComparisonError::Fit { axis: name, reason };
        let kept = residual.kept(axis);
        let std_arcsec = residual.std_arcsec(axis);
        ComparisonError::check_scatter(name, std_arcsec)?;
        let plan = Spectrum::new(&residual.t_s, &kept).map_err(of_spectrum)?;
        let options = FitOptions {
            band_hz: settings.band_hz,
            lines_hz: settings.lines_hz.clone(),
            ..FitOptions::default()
        };
        let fit = if settings.band_hz.is_none() && settings.lines_hz.is_empty() {
            fit_times(&residual.t_s, &kept, &options).map_err(of_fit)?
        } else {
            let options = FitOptions {
                bin_correlation: if plan.irregular() {
                    1.0
                } else {
                    HANN_BIN_CORRELATION
                },
                ..options.clone()
            };
            let fine = plan.fine(&kept).map_err(of_spectrum)?;
            check_band(&fine, settings)?;
            fit_psd(&usable(&fine), &options).map_err(of_fit)?
        };
        let raw = plan.raw(&kept).map_err(of_spectrum)?;
        Ok(Self {
            process: preferred_process(&fit, std_arcsec),
            // a spectrum that the printed form cannot be fitted to has no printed numbers
            printed: fit_log_psd(&usable(&raw), Convention::AsPrinted, &options).ok(),
            measured: plan.of(&kept).map_err(of_spectrum)?,
            fit,
            plan,
            std_arcsec,
            outliers: residual.outliers(axis),
        })
    }
}

/// A band without a frequency of the spectrum is told as that, with what there is.
fn check_band(fine: &Psd, settings: &FitSettings) -> Result<(), ComparisonError> {
    let Some([low_hz, high_hz]) = settings.band_hz else {
        return Ok(());
    };
    let mut there = fine.frequency_hz.iter().copied().filter(|f| *f > 0.0);
    if there.clone().any(|f| (low_hz..=high_hz).contains(&f)) {
        return Ok(());
    }
    let from_hz = there.next().unwrap_or(f64::NAN);
    Err(ComparisonError::EmptyBand {
        low_hz,
        high_hz,
        from_hz,
        nyquist_hz: there.next_back().unwrap_or(from_hz),
    })
}

/// Spectra of draws of the fitted processes.
fn drawn(t_s: &[f64], started: &[Started; 3]) -> Result<[Ensemble; 3], ComparisonError> {
    let plans = [0, 1, 2].map(|i| started[i].plan.clone());
    let process = |i: usize| {
        let HemAxis {
            sigma_hsf_arcsec,
            tau_hsf_s,
            sigma_tn_arcsec,
        } = started[i].process;
        Fogm::new(sigma_hsf_arcsec, tau_hsf_s)
            .and_then(|fogm| FogmWhite::new(fogm, sigma_tn_arcsec))
            .map_err(|reason| ComparisonError::Fit {
                axis: AXES[i],
                reason,
            })
    };
    let processes = [process(0)?, process(1)?, process(2)?];
    ensemble(&plans, DRAWS, |draw| {
        let mut rng = stream(SEED, draw, Purpose::Estimation);
        Ok(processes.map(|process| {
            let mut series = vec![0.0; t_s.len()];
            process.simulate_at_into(t_s, &mut rng, &mut series);
            series
        }))
    })
}

/// One axis as it is reported.
struct Axis {
    report: AxisFit,
    process: HemAxis,
    fs_hz: f64,
    measured: Psd,
    modelled: Vec<f64>,
    notes: Vec<String>,
}

impl Axis {
    fn new(started: &Started, drawn: &Ensemble, settings: &FitSettings) -> Self {
        let Started { fit, printed, .. } = started;
        let in_band = |f: f64| {
            settings
                .band_hz
                .is_none_or(|[low, high]| (low..=high).contains(&f))
                && !settings
                    .lines_hz
                    .iter()
                    .any(|[low, high]| (*low..=*high).contains(&f))
        };
        let standing = drawn.standing(&started.measured, 3, in_band);
        let cost = standing.map_or(f64::NAN, |standing| standing.cost);
        Self {
            notes: notes(fit, cost),
            report: AxisFit {
                sigma_hsf_arcsec: with_sigma(&fit.sigma_hsf),
                tau_hsf_s: with_sigma(&fit.tau_s),
                sigma_tn_arcsec: with_sigma(&fit.sigma_tn),
                as_printed: printed
                    .as_ref()
                    .map_or_else(AxisPrinted::default, |p| AxisPrinted {
                        sigma_hsf_arcsec: p.sigma_hsf.value(),
                        tau_hsf_s: p.tau_s.value(),
                        sigma_tn_arcsec: p.sigma_tn.value(),
                    }),
                log_psd_cost: cost,
                preferred: match fit.choice.preferred {
                    Preferred::White => PreferredModel::White,
                    Preferred::Fogm => PreferredModel::Fogm,
                    Preferred::FogmWhite => PreferredModel::FogmWhite,
                },
                outliers: Some(started.outliers),
                rms_arcsec: Some(started.std_arcsec),
            },
            process: started.process,
            fs_hz: started.plan.fs_hz(),
            measured: started.measured.clone(),
            modelled: drawn.mean(),
        }
    }
}

/// The bins that a fit of logarithms can use: a density of zero has none.
fn usable(psd: &Psd) -> Psd {
    let keep: Vec<bool> = (0..psd.len())
        .map(|k| psd.psd[k] > 0.0 && psd.dof[k] > 0.0)
        .collect();
    let pick = |values: &[f64]| {
        let out: Vec<bool> = keep.iter().map(|keep| !keep).collect();
        let mut values = masked(values, &out);
        values.retain(|v| v.is_finite());
        values
    };
    Psd {
        frequency_hz: pick(&psd.frequency_hz),
        psd: pick(&psd.psd),
        dof: pick(&psd.dof),
        fs_hz: psd.fs_hz,
    }
}

/// The process of the model that the data ask for, as numbers that a simulation can use: where an
/// estimate is only a bound, the maximum of the likelihood itself.
fn preferred_process(fit: &Fit, std_arcsec: f64) -> HemAxis {
    let or_maximum = |estimate: &Estimate, i: usize| estimate.value().unwrap_or(fit.maximum[i]);
    let tau_hsf_s = or_maximum(&fit.tau_s, 1);
    match fit.choice.preferred {
        Preferred::White => HemAxis {
            sigma_hsf_arcsec: 0.0,
            tau_hsf_s,
            sigma_tn_arcsec: std_arcsec,
        },
        Preferred::Fogm => HemAxis {
            sigma_hsf_arcsec: or_maximum(&fit.sigma_hsf, 0),
            tau_hsf_s,
            sigma_tn_arcsec: 0.0,
        },
        Preferred::FogmWhite => HemAxis {
            sigma_hsf_arcsec: or_maximum(&fit.sigma_hsf, 0),
            tau_hsf_s,
            sigma_tn_arcsec: or_maximum(&fit.sigma_tn, 2),
        },
    }
}

fn with_sigma(estimate: &Estimate) -> WithSigma {
    let finite = |v: f64| v.is_finite().then_some(v);
    WithSigma {
        value: estimate.value(),
        sigma: estimate.sigma(),
        interval: estimate.interval().map(|ends| ends.map(finite)),
        reason: estimate.reason().map(|reason| reason.to_string()),
    }
}

/// What the data cannot tell of an axis, in words.
fn notes(fit: &Fit, cost: f64) -> Vec<String> {
    let mut notes = vec![];
    for (name, unit, estimate) in [
        ("sigma_HSF", "arcsec", &fit.sigma_hsf),
        ("tau_HSF", "s", &fit.tau_s),
        ("sigma_TN", "arcsec", &fit.sigma_tn),
    ] {
        let note = match estimate {
            Estimate::Estimated { .. } => continue,
            Estimate::UpperBound { limit, reason } => {
                format!(
                    "{name} is at most {} {unit} (95 %): {reason}",
                    short(*limit)
                )
            }
            Estimate::LowerBound { limit, reason } => {
                format!(
                    "{name} is at least {} {unit} (95 %): {reason}",
                    short(*limit)
                )
            }
            Estimate::Undetermined { reason } => {
                format!("the data do not tell {name}: {reason}")
            }
        };
        notes.push(note);
    }
    if cost > POOR {
        notes.push(format!(
            "log-PSD cost {cost:.1}, where FOGM plus white has 1: the process is something else, and the parameters describe this motion only"
        ));
    }
    notes
}

/// Four figures, and no decimals beyond them.
fn short(value: f64) -> String {
    match value {
        v if v >= 1000.0 => format!("{v:.0}"),
        v if v >= 1.0 => format!("{v:.2}"),
        v => format!("{v:.4}"),
    }
}

/// The model that `simulate` and `compare` read.
fn hem(bundle: &Bundle, [x, y, z]: [HemAxis; 3], fs_hz: f64) -> Model {
    let meta = &bundle.meta;
    Model {
        kind: ModelKind::Hem,
        title: Some(match &meta.title {
            Some(title) => format!("HEM fitted to: {title}"),
            None => "HEM fitted to a bundle".to_owned(),
        }),
        tracker: ModelTracker {
            pixels: meta.tracker.pixels,
            focal_length_px: meta.tracker.focal_length_px,
            fov_deg: meta.tracker.fov_deg,
            pixel_centre: meta.tracker.pixel_centre,
            update_rate_hz: Some(meta.sample_rate_hz.unwrap_or(fs_hz)),
            max_stars: None,
            exposure_s: meta.tracker.exposure_s,
        },
        hem: Some(HemAxes { x, y, z }),
        ..Model::default()
    }
}
