//! Effects on the noise level: what they make of the squares of the residuals.
//!
//! They move no centroid, so that no regressor shows them. What the stars of a frame
//! do not share is held against a model of its variance (`noise_effects/variance.rs`),
//! relative to the declared one; the level itself is free.
//!
//! ```text
//! sigma^2 = s^2 sigma_declared^2 10^(0.4 slope (m - 5)) + (arcsec_per_deg_s rate)^2,   spikes: rate, size
//! ```
//!
//! What the model declares of these effects is in `sigma_declared`: a finding is what
//! comes on top, and is written as an entry of its own behind it.
//!
//! Source: docs/effects.md (`magnitude_noise`, `rate_noise`, `outliers`).

mod bursts;
mod density;
mod follows;
mod judge;
mod levels;
mod quick;
mod rate_by_star;
mod rivals;
mod rows;
mod shared;
mod squares;
#[cfg(test)]
mod tests;
mod turning;
mod variance;

use std::collections::BTreeMap;

use block_regression::Folds;
use effects::longest_exposure_s;
use nalgebra::Matrix3;
use spectra::robust::median_step;
use telemetry::report::{ConsideredEffect, Estimate, FoundEffect};
use telemetry::{EffectEntry, EffectValue, Model};

use crate::declared;
use crate::error::CloseError;
use crate::evidence::{Amplitudes, Evidence, Residuals};
use crate::questions::hypothesis::SEEN;
use crate::search::Found;
use crate::search::empirical::Variable;
use crate::search::selection::{FAMILY_ALPHA, columns_of};
use crate::situation::Situation;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use crate::star::frame_rotation::Turns;
use density::DECLARED;
pub(crate) use follows::{NoiseFollows, noise_follows};
use judge::{Judged, Known, judge};
use quick::Quick;
use rows::{Row, Source, squared_rates};
pub(crate) use turning::{Motion, Turning, Varies};

/// Identities in the catalogue.
const MAGNITUDE: &str = "magnitude_noise";
const RATE: &str = "rate_noise";
const OUTLIERS: &str = "outliers";
/// Where noise is declared to be the same for all stars, less than this slope is none: over three magnitudes
/// the noise changes by 1.4 %.
const SLOPE_OF_NONE: f64 = 0.01;
/// A slope this near to a declared one is as declared, as is any of centroids of windows that are sent: photon
/// and read noise together follow a power of the flux only roughly, and their slope changes by this within
/// half a magnitude.
const SLOPE_OF_LIGHT: f64 = 0.1;
/// Size of the spikes, in sigmas of the noise, for which their share is given.
const SPIKE: f64 = 10.0;
/// Slopes beyond this are none.
const STEEPEST: f64 = 20.0;

/// What was found, and what was only considered.
#[derive(Clone, Debug, Default)]
pub(crate) struct NoiseEffects {
    pub(crate) effects: Vec<FoundEffect>,
    pub(crate) entries: Vec<EffectEntry>,
    /// Noise of a rate that is claimed, arcsec/(deg/s).
    rate: f64,
    /// Variance over the declared one beside a slope or a rate.
    level: Option<f64>,
    considered: Vec<ConsideredEffect>,
}

impl NoiseEffects {
    /// Sizes at which each effect that was not claimed would explain `excess` by itself: squared
    /// residual beyond the noise, arcsec^2, over all rows. Of spikes, those of [`SPIKE`] sigmas. None where it
    /// is not of a kind that the effect makes: only a slope of faint stars that are quieter, or more spikes than rows.
    pub(crate) fn need(
        &mut self,
        situation: &Situation<'_>,
        data: &StarData,
        excess: f64,
    ) -> Result<(), CloseError> {
        let declared = declared_variance(situation, data)?;
        let rows: Vec<usize> = (0..data.t_s.len()).filter(|&r| !data.outlier[r]).collect();
        // two axes a row
        let wanted = excess / (2.0 * rows.len().max(1) as f64);
        if wanted <= 0.0 {
            return Ok(());
        }
        let mean = |of: &dyn Fn(usize) -> f64| {
            let all = rows.iter().map(|&r| of(r)).filter(|v| v.is_finite());
            all.sum::<f64>() / rows.len().max(1) as f64
        };
        let rate = squared_rates(data);
        // rows of one star grow alike
        let mut of_star = vec![0.0; data.stars.len()];
        for &r in rows.iter().filter(|&&r| declared[r].is_finite()) {
            of_star[data.star[r]] += declared[r];
        }
        let grown = |slope: f64| {
            let each = data.stars.iter().zip(&of_star);
            let each = each.filter(|(star, _)| star.mag.is_finite());
            let more = |mag: f64| 10_f64.powf(0.4 * slope * (mag - 5.0)) - 1.0;
            each.map(|(star, sum)| sum * more(star.mag)).sum::<f64>() / rows.len().max(1) as f64
        };
        for entry in &mut self.considered {
            entry.needed = match entry.id.as_str() {
                MAGNITUDE => gentlest(wanted, &grown),
                RATE => Some((wanted / mean(&|r| rate[r])).sqrt()),
                OUTLIERS => Some(wanted / (SPIKE * SPIKE * mean(&|r| declared[r]))),
                _ => None,
            }
            .filter(|n| n.is_finite() && *n > 0.0)
            .filter(|n| entry.id != OUTLIERS || *n <= 1.0);
        }
        Ok(())
    }

    /// Writes the level of the noise into a model that gets a slope or a rate: these say how it grows from there.
    pub(crate) fn set_level(&self, model: &mut Model) {
        let slope_or_rate = self.effects.iter().any(|e| e.id != OUTLIERS);
        let Some(level) = self.level.filter(|_| slope_or_rate) else {
            return;
        };
        // circular, where none is declared 1 arcsec an axis
        let declared = model.noise.temporal_arcsec.filter(|s| *s > 0.0);
        let declared = declared.unwrap_or(std::f64::consts::SQRT_2);
        model.noise.temporal_arcsec = Some(declared * level.sqrt());
    }

    /// Leaves out what was said of the noise's growth with magnitude: of centroids formed in another way
    /// than the declared ones it is another one.
    pub(crate) fn without_magnitude(mut self) -> Self {
        self.effects.retain(|e| e.id != MAGNITUDE);
        self.entries.retain(|e| e.id != MAGNITUDE);
        self.considered.retain(|c| c.id != MAGNITUDE);
        self
    }

    /// Puts what is known of the effects that were not claimed into the list.
    pub(crate) fn tell(&self, considered: &mut [ConsideredEffect]) {
        for known in &self.considered {
            for entry in considered.iter_mut().filter(|c| c.id == known.id) {
                entry.clone_from(known);
            }
        }
    }
}

/// Declared variance per axis of every row, arcsec^2; of 1 arcsec where no noise is
/// declared. Declared effects on the noise level count.
pub(crate) fn declared_variance(
    situation: &Situation<'_>,
    data: &StarData,
) -> Result<Vec<f64>, CloseError> {
    let circular = situation.model.noise.temporal_arcsec.filter(|s| *s > 0.0);
    // circular to per axis
    let sigma = circular.map_or(1.0, |s| s * std::f64::consts::FRAC_1_SQRT_2);
    let mut effects = declared::effects(situation)?;
    effects.retain(|e| e.stages().noise);
    let scale = data.camera.arcsec_per_px();
    let variance = (0..data.t_s.len()).map(|r| {
        let star = data.view(r);
        let speed = (data.velocity[0][r] * scale[0]).hypot(data.velocity[1][r] * scale[1]);
        let all = effects
            .iter()
            .fold(sigma, |s, e| e.noise_sigma_arcsec(&star, speed, s));
        all * all
    });
    Ok(variance.collect())
}

/// Squared residuals of the rows that count, each over its declared variance. Where the model declares that the reference
/// wanders, the rotation that the stars of a frame share has that variance S, too:
///
/// ```text
/// r' (V + A S A')^-1 r = r' V^-1 r - m' (1 + S N)^-1 S m      N = A' V^-1 A      m = A' V^-1 r
/// ```
///
/// Source: Woodbury 1950 (the inverse of a sum).
pub(crate) fn in_declared_sigmas(
    situation: &Situation<'_>,
    data: &StarData,
    residual: &Residuals,
) -> Option<f64> {
    let declared = declared_variance(situation, data).ok()?;
    let rows = (0..data.t_s.len()).filter(|&r| !data.outlier[r]);
    let squares = rows.map(|r| {
        let square: f64 = residual.axes.iter().map(|a| a[r] * a[r]).sum();
        square / declared[r]
    });
    let squares: f64 = squares.filter(|s| s.is_finite()).sum();
    let wander = declared::reference(&declared::effects(situation).ok()?);
    if data.free_attitude || wander.iter().all(Option::is_none) {
        return Some(squares);
    }
    let variance = wander.map(|axis| axis.map_or(0.0, |known| known.slow.powi(2)));
    let variance = Matrix3::from_diagonal(&variance.into());
    let weight: Vec<f64> = declared.iter().map(|v| v.sqrt().recip()).collect();
    let turns = Turns::of(data, [&residual.axes[0], &residual.axes[1]], &weight);
    let taken = turns.frames.iter().flatten().filter_map(|turn| {
        let shrunk = (Matrix3::identity() + variance * turn.normal).try_inverse()? * variance;
        Some(turn.moment.dot(&(shrunk * turn.moment)))
    });
    Some(squares - taken.sum::<f64>())
}

/// Declared outliers: share and size of each kind.
fn declared_outliers(situation: &Situation<'_>) -> Result<[[f64; 2]; DECLARED], CloseError> {
    let mut declared = Vec::new();
    for effect in declared::effects(situation)? {
        if effect.id() == OUTLIERS {
            let value = |name: &str| {
                let all = effect.parameters();
                all.iter().find(|p| p.name == name).map_or(0.0, |p| p.value)
            };
            declared.push([value("rate"), value("size_arcsec")]);
        }
    }
    Ok(of_few_kinds(declared))
}

/// Spikes of any number of kinds as those of [`DECLARED`]: the nearest in size are one, of their mean square.
fn of_few_kinds(mut declared: Vec<[f64; 2]>) -> [[f64; 2]; DECLARED] {
    declared.retain(|[share, _]| *share > 0.0);
    declared.sort_by(|a, b| a[1].total_cmp(&b[1]));
    while declared.len() > DECLARED {
        let ratio = |k: &usize| declared[k + 1][1] / declared[*k][1];
        let near = (0..declared.len() - 1).min_by(|a, b| ratio(a).total_cmp(&ratio(b)));
        let k = near.unwrap_or(0);
        let [more, larger] = declared.remove(k + 1);
        let [share, size] = declared[k];
        let square = (share * size * size + more * larger * larger) / (share + more);
        declared[k] = [share + more, square.sqrt()];
    }
    let mut out = [[0.0; 2]; DECLARED];
    out.iter_mut()
        .zip(declared)
        .for_each(|(out, kind)| *out = kind);
    out
}

/// Largest noise of a rate that nature makes, arcsec/(deg/s): of a spot that is smeared over the longest exposure any
/// point, a uniform spread.
fn most_rate(situation: &Situation<'_>, data: &StarData) -> f64 {
    let longest_s = longest_exposure_s(median_step(&data.frames.t_s), situation.exposure_s());
    3600.0 * longest_s / 12.0_f64.sqrt()
}

/// Looks for effects on the noise in the `residual` that the stars leave at `level`; `variables` with their ranges may
/// be what it follows.
pub(crate) fn claim(
    situation: &Situation<'_>,
    level: &StarEvidence<'_>,
    residual: &[Vec<f64>],
    folds: &Folds,
    variables: &[(Variable, [f64; 2])],
) -> Result<NoiseEffects, CloseError> {
    let data = level.data;
    let declared = declared_variance(situation, data)?;
    let rate = squared_rates(data);
    let source = Source {
        data,
        residual,
        declared: &declared,
        rate: &rate,
        folds,
    };
    let make = |belief: &dyn Fn(&Row) -> [f64; 2]| source.rows(belief);
    let follows_light =
        situation.model.effects.iter().any(|e| e.id == MAGNITUDE) || situation.windows.is_some();
    let rows = data.rows(0..data.t_s.len(), None, None);
    let rivals = rivals::rivals(&rows, variables);
    let known = Known {
        moving: level.resolved,
        least_slope: if follows_light {
            SLOPE_OF_LIGHT
        } else {
            SLOPE_OF_NONE
        },
        most_rate: most_rate(situation, data),
        outliers: declared_outliers(situation)?,
        rivals: &rivals,
    };
    let Some(mut verdicts) = judge(&make, folds, known) else {
        return Ok(NoiseEffects::default());
    };
    if verdicts.magnitude.stands || verdicts.rate.stands {
        let quick = Quick::of(data, residual, [&declared, &rate]);
        let [declared, rate] = &quick.squares;
        let source = Source {
            residual: &quick.residual,
            declared,
            rate,
            ..source
        };
        let make = |belief: &dyn Fn(&Row) -> [f64; 2]| source.rows(belief);
        // what follows another variable does so in differences, too
        let known = Known {
            rivals: &[],
            ..known
        };
        if let Some(fast) = judge(&make, folds, known) {
            verdicts.magnitude = verdicts.magnitude.beside(&fast.magnitude);
            verdicts.rate = verdicts.rate.beside(&fast.rate);
        }
    }
    let rate = &verdicts.rate;
    let mut out = NoiseEffects {
        level: verdicts.level,
        rate: if rate.stands { rate.values[0][0] } else { 0.0 },
        ..NoiseEffects::default()
    };
    out.add(MAGNITUDE, &[("slope", "")], &verdicts.magnitude);
    out.add(
        RATE,
        &[("arcsec_per_deg_s", "arcsec/(deg/s)")],
        &verdicts.rate,
    );
    // a square that is estimated as none has no error
    let least = source.least_rate(SEEN);
    for entry in out.considered.iter_mut().filter(|c| c.id == RATE) {
        entry.detectable = entry.detectable.or(least);
    }
    out.add(
        OUTLIERS,
        &[("rate", ""), ("size_arcsec", "arcsec")],
        &verdicts.outliers,
    );
    Ok(out)
}

/// The gentlest slope of either sign at which `gain` reaches `wanted`, by halving.
fn gentlest(wanted: f64, gain: &dyn Fn(f64) -> f64) -> Option<f64> {
    let side = |sign: f64| {
        if gain(sign * STEEPEST) < wanted {
            return None;
        }
        let (mut low, mut high) = (0.0, STEEPEST);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if gain(sign * middle) < wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(sign * high)
    };
    [side(1.0), side(-1.0)]
        .into_iter()
        .flatten()
        .min_by(|a, b| a.abs().total_cmp(&b.abs()))
}

impl NoiseEffects {
    fn add(&mut self, id: &str, names: &[(&str, &str)], judged: &Judged) {
        if !judged.observable {
            return;
        }
        if !judged.stands {
            let [_, sigma] = judged.values[0];
            let significant = judged.p_value < FAMILY_ALPHA && judged.gain > 0.0;
            self.considered.push(ConsideredEffect {
                selectors: BTreeMap::new(),
                against: judged.against.filter(|_| significant).map(str::to_owned),
                id: id.to_owned(),
                delta_loglik: Some(judged.gain),
                p_value: Some(judged.p_value),
                observable: true,
                // a slope has to differ from the declared one, a rate adds in square; of spikes, the fewest
                // that make a share
                detectable: match id {
                    OUTLIERS | RATE => judged.least_seen,
                    MAGNITUDE => Some(judged.least + SEEN * sigma),
                    _ => None,
                },
                needed: None,
                parameter: Some(names[0].0.to_owned()),
                unit: Some(names[0].1.to_owned()),
                refused: None,
            });
            return;
        }
        let mut parameters = BTreeMap::new();
        let mut written = BTreeMap::new();
        for ((name, unit), [value, sigma]) in names.iter().zip(judged.values) {
            written.insert((*name).to_owned(), EffectValue::Number(value));
            parameters.insert(
                (*name).to_owned(),
                Estimate {
                    value,
                    sigma: (sigma > 0.0).then_some(sigma),
                    unit: (*unit).to_owned(),
                    interval: None,
                },
            );
        }
        self.effects.push(FoundEffect {
            id: id.to_owned(),
            selectors: BTreeMap::new(),
            parameters,
            delta_loglik: judged.gain,
            p_value: judged.p_value,
            variance_explained: None,
            confusable_with: Vec::new(),
        });
        self.entries.push(EffectEntry::new(id, written));
    }
}

/// Residuals with everything estimated from all data: a mean predicted from other
/// folds has an error of its own, which is no noise of the rows. `None` where
/// centroids themselves depend on the fold.
pub(crate) fn in_sample(level: &StarEvidence<'_>, found: &Found) -> Option<Vec<Vec<f64>>> {
    if level.residuals.len() != 1 {
        return None;
    }
    let set = columns_of(&found.fitted.groups, &found.selection.chosen);
    let value = found.fitted.fits.estimate(&set)?.value;
    let only = found.only(&found.selection.chosen);
    let amplitudes = Amplitudes {
        nuisance: vec![found.fitted.fits.nuisance(None, &set, &value)],
        candidates: vec![only.spread(&value)],
    };
    let whole = Folds::whole(level.data.frames.frames());
    Some(level.residuals(&whole, &only.candidates, &amplitudes).axes)
}
