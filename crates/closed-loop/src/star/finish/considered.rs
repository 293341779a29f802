//! What was not added: the size at which it would explain what is left, and what speaks against it.
//!
//! Not physics: the order of the report.

use telemetry::report::{ConsideredEffect, FoundEffect, Unattributed};

use crate::causes::SMEAR;
use crate::findings;
use crate::image_level;
use crate::power::Power;
use crate::questions::needed::{self, ToExplain};
use crate::search::refusal::Refusal;
use crate::search::selection::columns_of;
use crate::star::finish::Finish;
use crate::star::reference_wander;

/// What one effect would have to explain of the squares of the fit: what is left, and what there was.
pub(super) fn squares_to_explain(
    f: &Finish<'_>,
    power: &Power,
    unattributed: &Unattributed,
) -> [Option<f64>; 2] {
    // of what is left, not of what there was
    let described = unattributed.variance_fraction.unwrap_or(0.0) * power.before / power.left;
    let described = unattributed.present.then_some(described.min(1.0));
    let fitted = &f.found.fitted;
    let chosen = columns_of(&fitted.groups, &f.found.selection.chosen);
    needed::of_fits(&fitted.fits, &chosen, declared_variance(f), described)
}

/// All that were tried and are not among the `effects`.
pub(super) fn list(
    f: &Finish<'_>,
    to_explain: &ToExplain<'_>,
    effects: &[FoundEffect],
) -> Vec<ConsideredEffect> {
    let surroundings = f.situation.surroundings();
    let mut considered = findings::considered(f.found, to_explain, f.refused, &surroundings);
    if let Some(orbit) = &f.orbit {
        orbit.tell(&mut considered);
    }
    for entry in &mut considered {
        if let Some(size) = f.oversize.iter().find(|c| c.id == entry.id) {
            entry.clone_from(size);
        }
    }
    if f.only_errors_accelerate {
        considered.iter_mut().for_each(not_along_own_path);
    }
    considered.retain(|c| !effects.iter().any(|e| e.id == c.id));
    considered
}

/// What sees the acceleration would see that of the path's own error alone: a size of it tells nothing.
fn not_along_own_path(entry: &mut ConsideredEffect) {
    if entry.id == SMEAR && entry.observable {
        entry.observable = false;
        entry.detectable = None;
        entry.needed = None;
        entry.refused = None;
        entry.against = Some(Refusal::OwnPath.why());
    }
}

/// The slow error of the reference beside the residual `left`, and what speaks `against` it.
pub(super) fn tell_wander(
    f: &Finish<'_>,
    left: &[Vec<f64>],
    excess: f64,
    against: Option<String>,
    considered: &mut [ConsideredEffect],
) {
    if let Some(mut entry) = reference_wander::consider(f.data, left, excess) {
        entry.against = against;
        considered
            .iter_mut()
            .filter(|c| c.id == entry.id)
            .for_each(|c| c.clone_from(&entry));
    }
}

/// Dark map and effective spots as the raw windows have judged them.
pub(super) fn tell_images(f: &Finish<'_>, considered: &mut Vec<ConsideredEffect>) {
    let Some(level) = f.image else {
        return;
    };
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

/// Squared residual over what the declared noise accounts for, arcsec^2; 0 where it is within the scatter of that, or no
/// noise is declared.
pub(super) fn excess(f: &Finish<'_>, power: &Power) -> f64 {
    let rows = f.data.counted() as f64;
    let scalars = f.found.fitted.scalars;
    let over = f.situation.model.noise.temporal_arcsec.and_then(|s| {
        let variance = 0.5 * s * s;
        needed::remarkable(rows * power.left - variance * scalars, variance, scalars)
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
