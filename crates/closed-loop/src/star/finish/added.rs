//! What was added: what each effect explains, what stands beside it, and its entry in the model.
//!
//! Not physics: the order of the report.

use spectra::robust::median_step;
use telemetry::EffectEntry;
use telemetry::report::{FoundEffect, Unattributed};

use crate::error::CloseError;
use crate::evidence::Residuals;
use crate::findings;
use crate::follows;
use crate::image_level;
use crate::power::Power;
use crate::questions::confusion;
use crate::questions::manoeuvre::stars::Sky;
use crate::residual_size;
use crate::search::instants;
use crate::search::orbits::images;
use crate::search::selection::columns_of;
use crate::star::finish::Finish;
use crate::star::reference_wander::{self, Finding, REFERENCE_ERROR};

/// Mean squares; `plain`: what all that were chosen leave.
pub(super) fn power(f: &Finish<'_>, plain: &Residuals) -> Result<Power, CloseError> {
    let chosen = &f.found.selection.chosen;
    let of_first = |first: usize| -> Result<f64, CloseError> {
        if first == chosen.len() {
            return Ok(of_residual(f, plain));
        }
        Ok(of_residual(f, &f.residuals(&chosen[..first])?))
    };
    let before = of_residual(f, &f.settled.before);
    Power::of(before, of_first(0)?, chosen.len(), of_first)
}

fn of_residual(f: &Finish<'_>, residual: &Residuals) -> f64 {
    residual_size::star_power(residual, f.data)
}

/// What was added.
pub(super) struct Added {
    /// What was chosen, and a term without a cause.
    pub(super) groups: Vec<usize>,
    /// What is left out of fold with that term, if there is one.
    pub(super) with_term: Option<Residuals>,
    pub(super) effects: Vec<FoundEffect>,
    pub(super) entries: Vec<EffectEntry>,
    /// What speaks against a slow error of the reference that was found and is not added.
    pub(super) against_wander: Option<String>,
}

impl Added {
    /// All but effects on the noise level; `unattributed` is what is left beside the chosen.
    pub(super) fn of(
        f: &Finish<'_>,
        power: &Power,
        unattributed: &Unattributed,
    ) -> Result<Self, CloseError> {
        let surroundings = f.situation.surroundings();
        let questions = f.situation.questions;
        let mut groups = f.found.selection.chosen.clone();
        let mut with_term = None;
        if questions.empirical
            && let Some(g) = follows::best_empirical(f.found, unattributed, &surroundings)
        {
            groups.push(g);
            let left = f.residuals(&groups)?;
            with_term = Some(left);
        }
        let explained = power.explained(with_term.as_ref().map(|left| of_residual(f, left)));
        let (mut effects, entries) =
            findings::effects_found(f.found, &groups, &explained, &surroundings, questions)?;
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
        let mut added = Self {
            groups,
            with_term,
            effects,
            entries,
            against_wander: None,
        };
        added.put_images_first(f);
        added.add_wander(f);
        Ok(added)
    }

    /// What was learned of the detector, before all that was found in the centroids formed with it.
    fn put_images_first(&mut self, f: &Finish<'_>) {
        let Some((level, formed)) = f.image.zip(f.formed) else {
            return;
        };
        for (at, (effect, entry)) in image_level::effects(level, formed).into_iter().enumerate() {
            self.effects.insert(at, effect);
            self.entries.insert(at, entry);
        }
    }

    /// The slow error of the reference, where it was found and the model declares none.
    fn add_wander(&mut self, f: &Finish<'_>) {
        let declares = &f.situation.model.effects;
        let declared = declares.iter().any(|e| e.id == REFERENCE_ERROR);
        let wander = f.wander.filter(|_| !declared);
        let reference = f.situation.reference.as_ref();
        let step_s = reference.and_then(|r| median_step(r.t_s())).unwrap_or(0.0);
        match wander.and_then(|wander| reference_wander::finding(wander, step_s)) {
            Some(Finding::Named(effect, entry)) => {
                self.effects.push(*effect);
                self.entries.push(entry);
            }
            Some(Finding::Against(why)) => self.against_wander = Some(why.to_owned()),
            None => {}
        }
    }
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
