//! From what was found at star level to the report: figures before and after, what stands beside each effect,
//! what is left, and the residuals.
//!
//! Not physics: the order of the report.

use block_regression::Folds;
use spectra::robust::median_step;
use star_images::Formed;
use telemetry::report::{ConsideredEffect, Errors, FoundEffect, Report, Rows, Windows};
use telemetry::{DarkMap, Model, StarResiduals};

use crate::causes::commonness::Slow;
use crate::causes::description::{self, Described};
use crate::causes::slow_left;
use crate::causes::star_constants::Constants;
use crate::error::CloseError;
use crate::evidence::Residuals;
use crate::figures;
use crate::image_level::{self, ImageLevel};
use crate::noise_effects;
use crate::noise_level::noise_ratio;
use crate::outcome::Closed;
use crate::questions::confusion;
use crate::questions::hypothesis::{self, Grounds};
use crate::questions::manoeuvre::stars::Sky;
use crate::questions::needed::{self, ToExplain, length_beside};
use crate::search::instants;
use crate::search::orbits::{Look, images};
use crate::search::refusal::Refused;
use crate::search::selection::columns_of;
use crate::search::{Found, fit};
use crate::situation::Situation;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use crate::star::own_attitude;
use crate::star::reference_wander::{self, Finding, REFERENCE_ERROR};
use crate::star::search::Wander;
use crate::star::settling::Settled;
use crate::unexplained::leftover::{self, Series};
use crate::unexplained::pattern::{self, Turned};
use crate::unexplained::star_series;

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

    /// What the declared model leaves out of fold, and its log-likelihood. Where it declares a slow error of the
    /// reference, under which all fits are, so is this one: what is added is held against it.
    fn declared_at_best(
        &self,
        effects: &[FoundEffect],
    ) -> Result<(Residuals, Option<f64>), CloseError> {
        let claimed = effects.iter().any(|e| e.id == REFERENCE_ERROR);
        let landed = self.settled.phase_error.is_some();
        if self.level.noise.is_some() && !claimed && !landed && self.image.is_none() {
            return Ok((self.residuals(&[])?, self.found.fitted.data_loglik(&[])));
        }
        // that of the same rows
        let settled = self.settled.loglik.filter(|_| self.data.unformed == 0);
        let loglik = match settled {
            Some(known) => Some(known),
            None => fit(self.measured, self.folds, &[])?.data_loglik(&[]),
        };
        Ok((self.settled.before.clone(), loglik))
    }

    /// What the chosen effects leave in sample beside the description of it, where there is one, arcsec.
    fn beside_description(&self) -> Result<Option<Vec<Vec<f64>>>, CloseError> {
        let terms = self.described.terms_left();
        if terms.is_empty() || self.level.learned() {
            return Ok(None);
        }
        let beside = self.level.keeping(&terms);
        let found = self.found.refitted(&beside, self.folds)?;
        Ok(noise_effects::in_sample(&beside, &found))
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
    fn errors(
        &self,
        model: &Model,
        residual: &Residuals,
        loglik: Option<f64>,
        attitude: Option<[f64; 3]>,
    ) -> Errors {
        let rms = figures::star_rms(residual, self.data);
        Errors {
            star_rms_arcsec: Some(rms),
            attitude_rms_arcsec: attitude,
            log_psd_cost: None,
            chi2_per_dof: self.chi2_per_dof(model, residual),
            loglik_per_frame: loglik.map(|l| l / self.data.frames.frames() as f64),
        }
    }
}

/// `plain`: what the chosen effects leave out of fold; `inside`: in sample, where that is known, with its
/// series.
pub(crate) fn finish(
    f: &Finish<'_>,
    plain: Residuals,
    inside: Option<(Vec<Vec<f64>>, Series)>,
) -> Result<Closed, CloseError> {
    let chosen = &f.found.selection.chosen;
    let power = |residual: &Residuals| figures::star_power(residual, f.data);
    let whole = power(&f.settled.before);
    let mut explained = Vec::new();
    let power_of = |first: usize| -> Result<f64, CloseError> {
        if first == chosen.len() {
            return Ok(power(&plain));
        }
        Ok(power(&f.residuals(&chosen[..first])?))
    };
    let mut last = power_of(0)?;
    for k in 1..=chosen.len() {
        let now = power_of(k)?;
        explained.push((last - now) / whole);
        last = now;
    }
    let surroundings = f.situation.surroundings();
    // what is left is judged before a term without a cause is added
    let mut unattributed = f.described.follows(last / whole);

    let questions = f.situation.questions;
    let mut added = chosen.clone();
    let mut after = None;
    if questions.empirical
        && let Some(g) = figures::best_empirical(f.found, &unattributed, &surroundings)
    {
        added.push(g);
        let with_term = f.residuals(&added)?;
        explained.push((last - power(&with_term)) / whole);
        after = Some(with_term);
    }
    let (mut effects, mut entries) =
        figures::effects_found(f.found, &added, &explained, &surroundings, questions)?;
    tell_apart(f, &mut effects);
    images::complete(f.level, f.folds, f.found, &surroundings, &mut effects)?;
    instants::complete(
        f.level,
        f.folds,
        f.found,
        &surroundings,
        median_step(&f.data.frames.t_s).unwrap_or(1.0),
        &mut effects,
    )?;
    if let Some((level, formed)) = f.image.zip(f.formed) {
        for (at, (effect, entry)) in image_level::effects(level, formed).into_iter().enumerate() {
            effects.insert(at, effect);
            entries.insert(at, entry);
        }
    }
    let mut model = f.situation.model.clone();
    let declared = model.effects.iter().any(|e| e.id == REFERENCE_ERROR);
    let wander = f.wander.filter(|_| !declared);
    let reference = f.situation.reference.as_ref();
    let step_s = reference.and_then(|r| median_step(r.t_s())).unwrap_or(0.0);
    let mut against_wander = None;
    match wander.and_then(|wander| reference_wander::finding(wander, step_s)) {
        Some(Finding::Named(effect, entry)) => {
            effects.push(*effect);
            entries.push(entry);
        }
        Some(Finding::Against(why)) => against_wander = Some(why.to_owned()),
        None => {}
    }
    let weight = &f.level.weight;
    let (inside, series) = inside.unzip();
    let residual = inside.as_deref().unwrap_or(&plain.axes);
    let series =
        series.unwrap_or_else(|| Series::of(&leftover::star_tracks(f.data, residual, weight)));
    let learned = f.level.learned();
    let turned = Turned::of(f.data, [&residual[0], &residual[1]], weight);
    let (noise, ((leftover, own), pattern)) = rayon::join(
        || {
            // what is described is no noise
            let beside = f.beside_description()?;
            let slow = match &beside {
                Some(beside) => slow_left(f.level, Some(beside)),
                None => f.slow,
            };
            let residual = beside.as_deref().unwrap_or(residual);
            let noise = noise_effects::claim(f.situation, f.level, residual, f.folds)?;
            Ok::<_, CloseError>((noise, slow))
        },
        || {
            let order = f.situation.model.noise.distortion_order;
            rayon::join(
                || {
                    // frames whose attitudes are free have turned already
                    let free = f.data.free_attitude;
                    let own = if free { residual } else { &turned.known };
                    let alone = || match residual {
                        [x, y] if free => [x.clone(), y.clone()],
                        _ => turned.whole(),
                    };
                    // a learned spot errs by where the star lies, and so slowly
                    let own = if learned {
                        star_series::OwnSeries::default()
                    } else {
                        star_series::search(f.data, own, alone, weight)
                    };
                    (series.describe(), own)
                },
                || pattern::search(f.data, residual, &turned, weight, f.folds, order, learned),
            )
        },
    );
    drop(turned);
    let (mut noise, slow) = noise?;
    let mut noise_left = noise_effects::NoiseFollows::default();
    if f.image.is_some_and(ImageLevel::new_noise) {
        noise = noise.without_magnitude();
    }
    if f.formed.is_none() && !f.data.frames_are_unrelated() {
        let of = description::of_noise(f.situation, f.data);
        let claimed = &noise;
        noise_left =
            noise_effects::noise_follows(f.situation, f.level, residual, f.folds, claimed, &of)?;
    }
    effects.extend(noise.effects.iter().cloned());
    entries.extend(noise.entries.iter().cloned());
    model.effects.extend(entries);
    noise.set_level(&mut model);

    leftover.tell(&mut unattributed);
    if let Some(pattern) = pattern {
        pattern.tell(&mut unattributed, last / whole);
    }
    if let Some(slow) = slow {
        slow.tell(&mut unattributed, last / whole);
    }
    own.tell(&mut unattributed, last / whole);
    if let Some(constants) = Constants::of(f.level, f.found, inside.as_deref()) {
        constants.tell(f.described, last / whole, &mut unattributed);
    }
    noise_left.tell(&mut unattributed);
    // what no variable predicts may be an effect that changes with one
    if !unattributed.present
        && let Some(change) = figures::changing(f.found, f.refused)
    {
        unattributed.present = true;
        unattributed.variance_fraction = Some(change.variance_explained * last / whole);
        let list = &mut unattributed.depends_on;
        list.retain(|d| d.variable != change.variable);
        list.insert(0, change);
    }
    let fits = &f.found.fitted.fits;
    // of what is left, not of what there was
    let described = unattributed.variance_fraction.unwrap_or(0.0) * whole / last;
    let described = unattributed.present.then_some(described.min(1.0));
    let declared = declared_variance(f);
    let [left, alone] = needed::of_fits(
        fits,
        &columns_of(&f.found.fitted.groups, chosen),
        declared,
        described,
    );
    let to_explain = ToExplain {
        left,
        alone,
        length: &|column, others| length_beside(fits, column, others),
    };
    let mut considered = figures::considered(f.found, &to_explain, f.refused, &surroundings);
    if let Some(orbit) = &f.orbit {
        orbit.tell(&mut considered);
    }
    for entry in &mut considered {
        if let Some(size) = f.oversize.iter().find(|c| c.id == entry.id) {
            entry.clone_from(size);
        }
    }
    considered.retain(|c| !effects.iter().any(|e| e.id == c.id));
    // a noise that is as loud everywhere is the declared level's fault, and no effect's
    let squares = if unattributed.present {
        excess(f, last)
    } else {
        0.0
    };
    noise.need(f.situation, f.data, squares)?;
    noise.tell(&mut considered);
    if let Some(mut entry) = reference_wander::consider(f.data, &plain.axes, squares) {
        entry.against = against_wander;
        considered
            .iter_mut()
            .filter(|c| c.id == entry.id)
            .for_each(|c| c.clone_from(&entry));
    }
    if let Some(level) = f.image {
        for (id, step) in [
            (image_level::DARK_MAP, &level.dark_map),
            (image_level::EFFECTIVE_PSF, &level.effective_psf),
        ] {
            considered.retain(|c| !(step.stands && c.id == id));
            for entry in considered.iter_mut().filter(|c| c.id == id) {
                entry.delta_loglik = Some(step.delta_loglik);
                entry.p_value = Some(step.p_value);
                entry.observable = true;
            }
        }
    }

    let set_aside = f.data.outlier.iter().filter(|o| **o).count();
    let used = f.data.t_s.len() - set_aside;
    let (before, before_loglik) = f.declared_at_best(&effects)?;
    let nothing_added = effects.is_empty();
    // one fit, one figure
    let (after, after_loglik) = if nothing_added {
        (before.clone(), before_loglik)
    } else {
        let set = columns_of(&f.found.fitted.groups, &added);
        let after = after.unwrap_or(plain);
        (after, f.found.fitted.data_loglik(&set))
    };
    let noise_ratio = noise_ratio(f.chi2_per_dof(&model, &after), used);
    let hypotheses = hypothesis::answer(
        f.situation.questions,
        &Grounds {
            found: f.found,
            surroundings,
            to_explain: &to_explain,
            something_left: unattributed.present,
            noise_ratio,
            resolved: f.level.resolved,
            unusable: f.unusable(),
            effects: &effects,
            considered: &considered,
        },
    );

    let mut attitude =
        own_attitude::residuals(f.situation, f.data, f.folds, f.settled, &before, &after);
    if let Some(attitude) = attitude.as_mut().filter(|_| nothing_added) {
        attitude.after_arcsec.clone_from(&attitude.before_arcsec);
    }
    let attitude_rms = |series: &[Vec<f64>; 3], outlier: &[bool]| {
        std::array::from_fn(|a| figures::rms(&series[a], outlier).unwrap_or(f64::NAN))
    };
    let report = Report {
        format: telemetry::report::REPORT_FORMAT.to_owned(),
        verdict: figures::verdict(&effects, unattributed.present),
        folds: f.folds.count,
        rows: Rows {
            used,
            outliers: set_aside - f.data.unplaced - f.data.unformed,
            outside_reference: f.data.outside_reference,
        },
        // the rest of it is told by whoever knows the rows that are none here
        windows: f.formed.map(|_| Windows {
            rows_left_out: f.data.unformed,
            ..Windows::default()
        }),
        before: f.errors(
            f.situation.model,
            &before,
            before_loglik,
            attitude
                .as_ref()
                .map(|a| attitude_rms(&a.before_arcsec, &a.outlier)),
        ),
        after: f.errors(
            &model,
            &after,
            after_loglik,
            attitude
                .as_ref()
                .map(|a| attitude_rms(&a.after_arcsec, &a.outlier)),
        ),
        effects,
        considered,
        hypotheses,
        unattributed,
    };
    let [ax, ay]: [Vec<f64>; 2] = after.axes.try_into().unwrap_or_default();
    let [bx, by]: [Vec<f64>; 2] = before.axes.try_into().unwrap_or_default();
    let fold_of_frame = f.folds.column();
    let frames = &f.data.frames;
    let fold = (0..frames.frames())
        .flat_map(|k| std::iter::repeat_n(fold_of_frame[k], frames.rows_of(k).len()))
        .collect();
    Ok(Closed {
        report,
        model,
        stars: Some(StarResiduals {
            t_s: f.data.t_s.clone(),
            slot: frames.slot.clone(),
            star_id: frames.star_id.clone(),
            x_px: frames.x_px.clone(),
            y_px: frames.y_px.clone(),
            before_arcsec: [bx, by],
            after_arcsec: [ax, ay],
            fold,
            outlier: f.data.outlier.clone(),
        }),
        attitude,
        dark_map: f
            .formed
            .filter(|_| f.image.is_some_and(|level| level.dark_map.stands))
            .map(|formed| DarkMap {
                x_px: formed.map.pixels.iter().map(|p| p.x_px).collect(),
                y_px: formed.map.pixels.iter().map(|p| p.y_px).collect(),
                dn: formed.map.pixels.iter().map(|p| p.dn).collect(),
                sigma_dn: formed.map.pixels.iter().map(|p| p.sigma_dn).collect(),
            }),
        rivals: f
            .image
            .map(|level| level.rivals.clone())
            .unwrap_or_default(),
    })
}

/// What else each effect could have been, and the motion that would tell.
fn tell_apart(f: &Finish<'_>, effects: &mut [FoundEffect]) {
    let confusion = confusion::compare(f.found, effects);
    let set = columns_of(&f.found.fitted.groups, &f.found.selection.chosen);
    let sky = f.found.fitted.fits.variance(&set).and_then(|variance| {
        let noise = f.wander.filter(|_| f.level.noise.is_some());
        let sky = Sky::of(
            f.data,
            f.situation.model,
            &f.level.weight,
            variance,
            noise.map(|w| w.noise),
        )?;
        Some(sky.drawn(f.level.drawn))
    });
    if let (Some(sky), Some(&start)) = (sky, f.data.frames.t_s.first())
        && !confusion.is_empty()
    {
        confusion.tell(effects, start, sky.attitude(), &|flown| {
            sky.fly(flown, &confusion.candidates)
        });
    }
}

/// Squared residual over what the declared noise accounts for, arcsec^2; 0 where it is within the scatter of that, or no
/// noise is declared.
fn excess(f: &Finish<'_>, power: f64) -> f64 {
    let rows = f.data.counted() as f64;
    let scalars = f.found.fitted.scalars;
    let over = f.situation.model.noise.temporal_arcsec.and_then(|s| {
        let variance = 0.5 * s * s;
        needed::remarkable(rows * power - variance * scalars, variance, scalars)
    });
    over.unwrap_or(0.0)
}

/// The declared variance of one of the fit's scalars, in their unit: rows count by the noise of their stars there.
fn declared_variance(f: &Finish<'_>) -> Option<f64> {
    let sigma = f.situation.model.noise.temporal_arcsec?;
    let rows = (0..f.data.t_s.len()).filter(|&r| !f.data.outlier[r]);
    let weights: f64 = rows.map(|r| f.level.weight[r].powi(2)).sum();
    let rows = (f.data.counted() as f64).max(1.0);
    Some(0.5 * sigma * sigma * weights / rows / f.level.unit_arcsec2())
}
