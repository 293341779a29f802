//! From what was found at star level to the report.
//!
//! ```text
//! added        what each effect explains, and what stands beside it
//! left         what is left beside them, and what its squares follow
//! considered   what was not added, and the size at which it would have shown
//! tables       residuals before and after, row by row
//! ```
//!
//! Not physics: the order of the report.

use std::borrow::Cow;

use block_regression::Folds;
use star_images::Formed;
use telemetry::Model;
use telemetry::report::{ConsideredEffect, Errors, FoundEffect, Report, Rows, Windows};

use crate::causes::commonness::Slow;
use crate::causes::description::Described;
use crate::error::CloseError;
use crate::evidence::Residuals;
use crate::findings;
use crate::image_level::ImageLevel;
use crate::noise_effects;
use crate::noise_level::noise_ratio;
use crate::outcome::Closed;
use crate::questions::hypothesis::{self, Grounds};
use crate::questions::needed::{ToExplain, length_beside};
use crate::residual_size;
use crate::search::orbits::Look;
use crate::search::refusal::Refused;
use crate::search::selection::columns_of;
use crate::search::{Found, fit};
use crate::situation::Situation;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use crate::star::reference_wander::REFERENCE_ERROR;
use crate::star::search::Wander;
use crate::star::settling::Settled;
use crate::unexplained::leftover::Series;
use added::{Added, power};

mod added;
mod considered;
mod left;
mod tables;

/// What the report is made of.
pub(crate) struct Finish<'a> {
    pub(crate) situation: &'a Situation<'a>,
    pub(crate) data: &'a StarData,
    pub(crate) folds: &'a Folds,
    pub(crate) measured: &'a StarEvidence<'a>,
    pub(crate) level: &'a StarEvidence<'a>,
    pub(crate) found: &'a Found,
    pub(crate) described: &'a Described,
    pub(crate) refused: &'a Refused,
    pub(crate) slow: Option<Slow>,
    pub(crate) oversize: Vec<ConsideredEffect>,
    pub(crate) wander: Option<&'a Wander>,
    /// Whether all that accelerates is a slow error of the reference's own path.
    pub(crate) only_errors_accelerate: bool,
    /// What was looked for without candidates.
    pub(crate) orbit: Option<Look>,
    pub(crate) settled: &'a Settled,
    pub(crate) image: Option<&'a ImageLevel>,
    /// Centroids formed anew from the same rows.
    pub(crate) formed: Option<&'a Formed>,
    /// Why the windows that there are tell nothing.
    pub(crate) unusable: Option<&'a str>,
}

impl Finish<'_> {
    pub(crate) fn residuals(&self, chosen: &[usize]) -> Result<Residuals, CloseError> {
        self.found.left_out_of_fold(self.level, self.folds, chosen)
    }

    /// The declared model at its best. Where it declares a slow error of the
    /// reference, under which all fits are, so is this one: what is added is held against it.
    fn before(&self, effects: &[FoundEffect]) -> Result<AtBest<'_>, CloseError> {
        let claimed = effects.iter().any(|e| e.id == REFERENCE_ERROR);
        let landed = self.settled.phase_error.is_some();
        if self.level.noise.is_some() && !claimed && !landed && self.image.is_none() {
            return Ok(AtBest {
                residual: Cow::Owned(self.residuals(&[])?),
                loglik: self.found.fitted.data_loglik(&[]),
            });
        }
        // that of the same rows
        let settled = self.settled.loglik.filter(|_| self.data.unformed == 0);
        let loglik = match settled {
            Some(known) => Some(known),
            None => fit(self.measured, self.folds, &[])?.data_loglik(&[]),
        };
        Ok(AtBest {
            residual: Cow::Borrowed(&self.settled.before),
            loglik,
        })
    }

    /// The better model at its best: `residual` is what the `added` groups leave. Where nothing at all was added that is
    /// the declared one, `before`: one fit, one figure.
    fn after<'r>(
        &self,
        before: &'r AtBest<'_>,
        added: Option<&[usize]>,
        residual: Residuals,
    ) -> AtBest<'r> {
        let Some(added) = added else {
            return AtBest {
                residual: Cow::Borrowed(&*before.residual),
                loglik: before.loglik,
            };
        };
        let set = columns_of(&self.found.fitted.groups, added);
        AtBest {
            residual: Cow::Owned(residual),
            loglik: self.found.fitted.data_loglik(&set),
        }
    }

    /// Why the raw windows tell nothing, and how many there are.
    fn unusable(&self) -> Option<String> {
        let all = self.situation.bundle.images.as_ref().map_or(0, |w| w.len());
        let why = self.unusable?;
        Some(format!("none of the {all} raw windows can be used: {why}"))
    }

    /// In sigmas of `model`.
    fn chi2_per_dof(&self, model: &Model, residual: &Residuals) -> Option<f64> {
        let declared = self.situation.model.noise.temporal_arcsec;
        declared.filter(|s| *s > 0.0)?;
        let situation = self.situation.believing(model);
        let square = noise_effects::in_declared_sigmas(&situation, self.data, residual)?;
        // with free attitudes three of each frame's numbers are spent
        Some(square / self.found.fitted.scalars)
    }

    /// `model` is the declared one, or that with what was added.
    fn errors(&self, model: &Model, best: &AtBest<'_>, attitude: Option<[f64; 3]>) -> Errors {
        let rms = residual_size::star_rms(&best.residual, self.data);
        Errors {
            star_rms_arcsec: Some(rms),
            attitude_rms_arcsec: attitude,
            log_psd_cost: None,
            chi2_per_dof: self.chi2_per_dof(model, &best.residual),
            loglik_per_frame: best.loglik.map(|l| l / self.data.frames.frames() as f64),
        }
    }

    fn rows(&self) -> Rows {
        let set_aside = self.data.outlier.iter().filter(|o| **o).count();
        Rows {
            used: self.data.t_s.len() - set_aside,
            outliers: set_aside - self.data.unplaced - self.data.unformed,
            outside_reference: self.data.outside_reference,
        }
    }
}

/// A model at its best.
struct AtBest<'a> {
    /// What it leaves out of fold.
    residual: Cow<'a, Residuals>,
    loglik: Option<f64>,
}

/// `plain`: what the chosen effects leave out of fold; `inside`: in sample, where that is known, with its
/// series.
pub(crate) fn finish(
    f: &Finish<'_>,
    plain: Residuals,
    inside: Option<(Vec<Vec<f64>>, Series)>,
) -> Result<Closed, CloseError> {
    let power = power(f, &plain)?;
    // what is left is judged before a term without a cause is added
    let mut unattributed = f.described.follows(power.share_left());
    let Added {
        groups,
        with_term,
        mut effects,
        entries,
        against_wander,
    } = Added::of(f, &power, &unattributed)?;

    let (inside, series) = inside.unzip();
    let residual = inside.as_deref().unwrap_or(&plain.axes);
    let (mut noise, left) = left::look(f, residual, series)?;
    effects.extend(noise.effects.iter().cloned());
    let mut model = f.situation.model.clone();
    model.effects.extend(entries);
    model.effects.extend(noise.entries.iter().cloned());
    noise.set_level(&mut model);
    left.tell(f, inside.as_deref(), &power, &mut unattributed);

    let fits = &f.found.fitted.fits;
    let [left, alone] = considered::squares_to_explain(f, &power, &unattributed);
    let to_explain = ToExplain {
        left,
        alone,
        length: &|column, others| length_beside(fits, column, others),
    };
    let mut considered = considered::list(f, &to_explain, &effects);
    // a noise that is as loud everywhere is the declared level's fault, and no effect's
    let squares = if unattributed.present {
        considered::excess(f, &power)
    } else {
        0.0
    };
    noise.need(f.situation, f.data, squares)?;
    noise.tell(&mut considered);
    considered::tell_wander(f, &plain.axes, squares, against_wander, &mut considered);
    considered::tell_images(f, &mut considered);

    let rows = f.rows();
    let before = f.before(&effects)?;
    let nothing_added = effects.is_empty();
    let added = (!nothing_added).then_some(groups.as_slice());
    let after = f.after(&before, added, with_term.unwrap_or(plain));
    let hypotheses = hypothesis::answer(
        f.situation.questions,
        &Grounds {
            found: f.found,
            surroundings: f.situation.surroundings(),
            to_explain: &to_explain,
            something_left: unattributed.present,
            noise_ratio: noise_ratio(f.chi2_per_dof(&model, &after.residual), rows.used),
            resolved: f.level.resolved,
            unusable: f.unusable(),
            effects: &effects,
            considered: &considered,
        },
    );
    let attitude = tables::attitude(f, &before.residual, &after.residual, nothing_added);
    let [attitude_before, attitude_after] = tables::attitude_rms(attitude.as_ref());
    let report = Report {
        format: telemetry::report::REPORT_FORMAT.to_owned(),
        verdict: findings::verdict(&effects, unattributed.present),
        folds: f.folds.count,
        rows,
        // the rest of it is told by whoever knows the rows that are none here
        windows: f.formed.map(|_| Windows {
            rows_left_out: f.data.unformed,
            ..Windows::default()
        }),
        before: f.errors(f.situation.model, &before, attitude_before),
        after: f.errors(&model, &after, attitude_after),
        effects,
        considered,
        hypotheses,
        unattributed,
    };
    let rivals = f.image.map(|level| level.rivals.clone());
    Ok(Closed {
        report,
        model,
        stars: Some(tables::stars(f, &before.residual, &after.residual)),
        attitude,
        dark_map: tables::dark_map(f),
        rivals: rivals.unwrap_or_default(),
    })
}
