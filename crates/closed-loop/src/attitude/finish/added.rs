//! What was added: what each effect explains, what stands beside it, and its entry in the model.
//!
//! Not physics: the order of the report.

use focal_plane::AttitudeSource as _;
use nalgebra::UnitQuaternion;
use spectra::robust::median_step;
use telemetry::EffectEntry;
use telemetry::report::{FoundEffect, Unattributed};

use crate::attitude::finish::Finish;
use crate::error::CloseError;
use crate::evidence::Residuals;
use crate::findings;
use crate::follows;
use crate::power::Power;
use crate::questions::confusion;
use crate::questions::manoeuvre::attitudes::fly;
use crate::residual_size;
use crate::search::{instants, orbits};

/// Mean squares over all axes.
pub(super) fn power(f: &Finish<'_>) -> Result<Power, CloseError> {
    let chosen = f.chosen();
    let before = of_residual(f, f.before);
    Power::of(before, before, chosen.len(), |first| {
        Ok(of_residual(f, &f.residuals(&chosen[..first])?))
    })
}

fn of_residual(f: &Finish<'_>, residual: &Residuals) -> f64 {
    (0..3)
        .filter_map(|a| residual_size::rms(&residual.axes[a], &f.data().outlier[a]))
        .map(|v| v * v)
        .sum()
}

/// What was added.
pub(super) struct Added {
    pub(super) effects: Vec<FoundEffect>,
    pub(super) entries: Vec<EffectEntry>,
    /// What is left out of fold with all of it.
    pub(super) after: Residuals,
}

impl Added {
    /// `plain` is what the chosen leave out of fold, `unattributed` what is left beside them.
    pub(super) fn of(
        f: &Finish<'_>,
        plain: &Residuals,
        power: &Power,
        unattributed: &Unattributed,
    ) -> Result<Self, CloseError> {
        let (surroundings, questions) = (f.situation.surroundings(), f.situation.questions);
        let (data, found) = (f.data(), f.found);
        let mut with_term = None;
        let mut groups = f.chosen().to_vec();
        let mut after = plain.clone();
        if questions.empirical
            && let Some(g) = follows::best_empirical(found, unattributed, &surroundings)
        {
            groups.push(g);
            after = f.residuals(&groups)?;
            with_term = Some(of_residual(f, &after));
        }
        let explained = power.explained(with_term);
        let (mut effects, entries) =
            findings::effects_found(found, &groups, &explained, &surroundings, questions)?;
        if effects.is_empty() {
            // nothing was added: constants that coloured noise weighs otherwise are no gain, and no loss
            after.clone_from(f.before);
        }
        tell_apart(f, &mut effects);
        let folds = &data.bins.folds;
        orbits::images::complete(&f.evidence, folds, found, &surroundings, &mut effects)?;
        instants::complete(
            &f.evidence,
            folds,
            found,
            &surroundings,
            median_step(&data.t_s).unwrap_or(1.0),
            &mut effects,
        )?;
        Ok(Self {
            effects,
            entries,
            after,
        })
    }
}

/// What else each effect could have been, and the motion that would tell.
fn tell_apart(f: &Finish<'_>, effects: &mut [FoundEffect]) {
    let data = f.data();
    let confusion = confusion::compare(f.found, effects);
    if let (false, Some(step), Some(&start)) = (
        confusion.is_empty(),
        median_step(&data.t_s),
        data.t_s.first(),
    ) {
        let sigma = f.evidence.constant_sigma;
        let noise = f.evidence.noise;
        // a velocity is seen from where the tracker points
        let reference = f.situation.reference.as_ref();
        let looking = reference.and_then(|r| r.attitude(start));
        let looking = looking.unwrap_or_else(UnitQuaternion::identity);
        confusion.tell(effects, start, looking, &|flown| {
            fly(
                flown,
                &confusion.candidates,
                step,
                sigma,
                noise,
                data.mixing,
            )
        });
    }
}
