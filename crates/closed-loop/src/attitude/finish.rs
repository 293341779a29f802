//! From what was found at attitude level to the report.
//!
//! ```text
//! added          what each effect explains, and what stands beside it
//! to_explain     what one effect would have to explain
//! noise_follows  what the noise of what is left follows
//! ```
//!
//! Not physics: the order of the report.

use block_regression::Folds;
use coloured_noise::Coloured;
use telemetry::AttitudeResiduals;
use telemetry::report::{Errors, Report, Rows, Unattributed};

use crate::attitude::data::{AttitudeData, AttitudeEvidence};
use crate::attitude::fitted::{in_sample, residuals, tracks};
use crate::attitude::left::{by_axes, slow_leftover};
use crate::attitude::motion_terms;
use crate::attitude::spatial_errors::SpatialErrors;
use crate::error::CloseError;
use crate::evidence::Residuals;
use crate::findings;
use crate::follows;
use crate::motion::Around;
use crate::outcome::{Closed, Rival};
use crate::questions::hypothesis::{self, Grounds};
use crate::questions::needed::ToExplain;
use crate::residual_size;
use crate::search::Found;
use crate::search::orbits::Look;
use crate::search::refusal::Refused;
use crate::situation::Situation;
use crate::unexplained::leftover::Series;
use added::{Added, power};
use noise_follows::noise_follows;

mod added;
mod noise_follows;
mod to_explain;

/// A slow error of so many times the declared is as declared: over a few correlation times its size is known to
/// a half.
const WIDER: f64 = 2.0;

/// What the report is made of.
pub(super) struct Finish<'a> {
    pub(super) situation: &'a Situation<'a>,
    /// Under the noise that suits what was found.
    pub(super) evidence: AttitudeEvidence<'a>,
    pub(super) motion: &'a Around,
    pub(super) folds: &'a Folds,
    pub(super) found: &'a Found,
    pub(super) refused: &'a Refused,
    /// What the declared model leaves.
    pub(super) before: &'a Residuals,
    /// What it makes of crossing and changing stars.
    pub(super) changes: Option<&'a SpatialErrors>,
}

impl<'a> Finish<'a> {
    fn data(&self) -> &'a AttitudeData {
        self.evidence.data
    }

    fn chosen(&self) -> &[usize] {
        &self.found.selection.chosen
    }

    /// What this `set` leaves out of fold.
    fn residuals(&self, set: &[usize]) -> Result<Residuals, CloseError> {
        residuals(&self.evidence, self.folds, self.found, set)
    }

    /// What it leaves in sample.
    fn in_sample(&self, set: &[usize]) -> Option<Residuals> {
        in_sample(&self.evidence, self.found, set)
    }

    /// Slow errors that the declared model itself makes, arcsec.
    fn own_slow(&self) -> [f64; 3] {
        self.changes.map_or([0.0; 3], |c| c.slow_arcsec)
    }
}

/// `plain`: what the chosen effects leave out of fold; `series`: that of what they leave in sample, where that is known.
pub(super) fn finish(
    f: &Finish<'_>,
    plain: Residuals,
    series: Option<Series>,
    rivals: Vec<Rival>,
) -> Result<Closed, CloseError> {
    let (situation, data, found) = (f.situation, f.data(), f.found);
    let power = power(f)?;
    let share = power.share_left();
    // what is left is judged before a term without a cause is added
    let mut unattributed = follows::unattributed(found, share, |c| !motion_terms::is_of_motion(c));
    let with = |g: usize| f.residuals(&[f.chosen(), &[g]].concat());
    let own = f.own_slow();
    let described = by_axes(data, found, &plain, &with, own, share, &mut unattributed)?;
    let Added {
        effects,
        entries,
        after,
    } = Added::of(f, &plain, &power, &unattributed)?;
    let mut model = situation.model.clone();
    model.effects.extend(entries);
    let inside = beside(f, described);
    let left = inside.as_ref().unwrap_or(&plain);
    tell_slow(f, left, share, &mut unattributed);
    let noise = noise_follows(f, left);
    let series = series.unwrap_or_else(|| tracks(data, &plain, f.changes));
    let surroundings = situation.surroundings();
    let reference = situation.reference.as_ref().zip(series.across());
    let look = reference.and_then(|(path, tracks)| Look::at(&surroundings, path, tracks));
    series.describe().tell(&mut unattributed);
    noise.tell(&mut unattributed);

    let lengths = to_explain::column_lengths(&f.evidence, found);
    let [left, alone] = to_explain::squares(f, &plain, &unattributed);
    let to_explain = ToExplain {
        left,
        alone,
        length: &|column, _| lengths[column],
    };
    let mut considered = findings::considered(found, &to_explain, f.refused, &surroundings);
    if let Some(look) = look {
        look.tell(&mut considered);
    }
    let hypotheses = hypothesis::answer(
        situation.questions,
        &Grounds {
            found,
            surroundings,
            to_explain: &to_explain,
            something_left: unattributed.present,
            noise_ratio: None,
            resolved: f.motion.resolved(),
            unusable: None,
            effects: &effects,
            considered: &considered,
        },
    );
    let outlier: Vec<bool> = (0..data.t_s.len())
        .map(|k| (0..3).any(|a| data.outlier[a][k]))
        .collect();
    let outliers = outlier.iter().filter(|o| **o).count();
    let report = Report {
        format: telemetry::report::REPORT_FORMAT.to_owned(),
        verdict: findings::verdict(&effects, unattributed.present),
        folds: f.folds.count,
        rows: Rows {
            used: data.t_s.len() - outliers,
            outliers,
            outside_reference: data.outside_reference,
        },
        windows: None,
        before: errors(data, f.before),
        after: errors(data, &after),
        effects,
        considered,
        hypotheses,
        unattributed,
    };
    Ok(Closed {
        report,
        model,
        stars: None,
        attitude: Some(table(f, after, outlier)),
        dark_map: None,
        rivals,
    })
}

/// What is left in sample beside the chosen and the term that it is `described` by: what acts in one fold alone is
/// predicted by no other, and would be slow noise out of fold.
fn beside(f: &Finish<'_>, described: Option<usize>) -> Option<Residuals> {
    let told: Vec<usize> = f.chosen().iter().copied().chain(described).collect();
    f.in_sample(&told)
}

/// Tells what is slow of what is `left`.
fn tell_slow(f: &Finish<'_>, left: &Residuals, share: f64, unattributed: &mut Unattributed) {
    let declared = match &f.situation.model.hem {
        Some(hem) => [&hem.x, &hem.y, &hem.z].map(|axis| WIDER * axis.sigma_hsf_arcsec),
        None => f.own_slow(),
    };
    slow_leftover(f.data(), left, declared, unattributed, share);
}

fn errors(data: &AttitudeData, residual: &Residuals) -> Errors {
    Errors {
        star_rms_arcsec: None,
        attitude_rms_arcsec: Some(std::array::from_fn(|a| {
            residual_size::rms(&residual.axes[a], &data.outlier[a]).unwrap_or(f64::NAN)
        })),
        log_psd_cost: None,
        chi2_per_dof: None,
        loglik_per_frame: Some(loglik_per_frame(data, residual)),
    }
}

/// Log-likelihood of all rows a row, under the noise that suits them best, nats.
fn loglik_per_frame(data: &AttitudeData, residual: &Residuals) -> f64 {
    let total: f64 = (0..3)
        .map(|axis| {
            let count: Vec<f64> = data.outlier[axis]
                .iter()
                .map(|out| f64::from(u8::from(!out)))
                .collect();
            let series = &residual.axes[axis];
            Coloured::fit(&data.t_s, series, &count).log_likelihood(&data.t_s, series, &count)
        })
        .sum();
    total / data.t_s.len() as f64
}

/// The residuals before and after, row by row.
fn table(f: &Finish<'_>, after: Residuals, outlier: Vec<bool>) -> AttitudeResiduals {
    let [bx, by, bz]: [Vec<f64>; 3] = f.before.axes.clone().try_into().unwrap_or_default();
    let [ax, ay, az]: [Vec<f64>; 3] = after.axes.try_into().unwrap_or_default();
    AttitudeResiduals {
        t_s: f.data().t_s.clone(),
        before_arcsec: [bx, by, bz],
        after_arcsec: [ax, ay, az],
        fold: f.folds.column(),
        outlier,
    }
}
