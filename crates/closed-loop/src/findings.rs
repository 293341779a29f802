//! Findings turned into the report: effects with their sigmas, and what was considered.
//!
//! ```text
//! variance explained   share of the before mean square that goes, out of fold
//! detectable           5 sigma of the amplitude that was not added
//! needed               amplitude that explains what is left by itself (questions/needed.rs)
//! ```
//!
//! Source: docs/formats/report.md.

use std::collections::BTreeMap;

use effects::Surroundings;
use nalgebra::DMatrix;
use telemetry::report::{
    Confusable, ConsideredEffect, Dependence, Estimate, FoundEffect, RefusedSize, Selector, Verdict,
};
use telemetry::{EffectEntry, EffectValue};

use crate::error::CloseError;
use crate::questions::hypothesis::{Questions, SEEN};
use crate::questions::needed::ToExplain;
use crate::questions::told::Told;
use crate::search::empirical::EMPIRICAL;
use crate::search::group::is_believed;
use crate::search::refusal::{Refusal, Refused};
use crate::search::selection::columns_of;
use crate::search::{Found, family, first_column};

/// Correlations below this are not worth a reader's time.
pub const CONFUSABLE: f64 = 0.3;

/// The added effects, in the order added, with joint estimates from all data.
/// `explained` is the share of the before variance of each.
pub(crate) fn effects_found(
    found: &Found,
    chosen: &[usize],
    explained: &[f64],
    surroundings: &Surroundings<'_>,
    questions: &Questions,
) -> Result<(Vec<FoundEffect>, Vec<EffectEntry>), CloseError> {
    let set = columns_of(&found.fitted.groups, chosen);
    let mut effects = Vec::new();
    let mut entries = Vec::new();
    let Some(estimate) = found.fitted.fits.estimate(&set) else {
        return Ok((effects, entries));
    };
    for (k, &g) in chosen.iter().enumerate() {
        let candidate = found.candidates[g].as_ref();
        let (values, covariance) = amplitudes_of(found, g, &set, &estimate);
        let reported = effects::reported(candidate, &values, covariance.as_view(), surroundings)?;
        let judged = &found.selection.judged[g];
        // the realised effect's: an estimate may have turned signs round
        let selectors = candidate.realise(&values, surroundings)?.selectors();
        let mut parameters = BTreeMap::new();
        let mut written = BTreeMap::new();
        for (parameter, sigma) in reported {
            written.insert(parameter.name.clone(), EffectValue::Number(parameter.value));
            parameters.insert(
                parameter.name,
                Estimate {
                    value: parameter.value,
                    sigma: (sigma > 0.0).then_some(sigma),
                    unit: parameter.unit.to_owned(),
                    interval: None,
                },
            );
        }
        for (key, value) in &selectors {
            written.insert(key.clone(), EffectValue::Text(value.clone()));
        }
        if candidate.id() == EMPIRICAL {
            // in a model they stand as one list
            written.retain(|name, _| !name.starts_with('c') || name == "coefficients");
            written.insert(
                "coefficients".to_owned(),
                EffectValue::Numbers(values.clone()),
            );
        }
        effects.push(FoundEffect {
            id: candidate.id().to_owned(),
            selectors: told(&selectors),
            parameters,
            delta_loglik: judged.delta_loglik,
            p_value: judged.p_value,
            variance_explained: explained.get(k).copied(),
            confusable_with: if candidate.id() == EMPIRICAL {
                Vec::new()
            } else {
                confusable(found, g, questions)
            },
        });
        entries.push(EffectEntry::new(candidate.id(), written));
    }
    Ok((effects, entries))
}

/// Amplitudes of candidate `g` (zero for columns that the data cannot show) and
/// their covariance, out of a joint estimate on `set`.
pub(crate) fn amplitudes_of(
    found: &Found,
    g: usize,
    set: &[usize],
    estimate: &block_regression::Estimate,
) -> (Vec<f64>, DMatrix<f64>) {
    let p = found.candidates[g].coefficients().len();
    amplitudes_from(first_column(&found.candidates, g), p, set, estimate)
}

/// The same of the `p` columns from `first` on.
pub(crate) fn amplitudes_from(
    first: usize,
    p: usize,
    set: &[usize],
    estimate: &block_regression::Estimate,
) -> (Vec<f64>, DMatrix<f64>) {
    let at: Vec<Option<usize>> = (0..p)
        .map(|j| set.iter().position(|&c| c == first + j))
        .collect();
    let values = at
        .iter()
        .map(|a| a.map_or(0.0, |i| estimate.value[i]))
        .collect();
    let spread = estimate.cautious_covariance();
    let covariance = DMatrix::from_fn(p, p, |i, j| match (at[i], at[j]) {
        (Some(i), Some(j)) => spread[(i, j)],
        _ => 0.0,
    });
    (values, covariance)
}

/// Other catalogue effects whose columns resemble those of `g`, or that were asked about, the same on
/// another channel or star, and its twin.
fn confusable(found: &Found, g: usize, questions: &Questions) -> Vec<Confusable> {
    let own = found.candidates[g].id();
    let alike = |id: &str, selectors: &BTreeMap<String, String>, correlation: f64| Confusable {
        id: id.to_owned(),
        selectors: told(selectors),
        correlation,
        delta_loglik: None,
        separation_sigma: None,
        manoeuvre: None,
    };
    let mut list: Vec<Confusable> = effects::catalogue()
        .iter()
        .map(|kind| kind.id())
        .filter_map(|id| {
            let (other, correlation) = most_alike(found, g, id)?;
            let asked = id != own && questions.include(id);
            (correlation.abs() >= CONFUSABLE || asked)
                .then(|| alike(id, &found.candidates[other].selectors(), correlation))
        })
        .collect();
    let twin = found.candidates[g].twin();
    list.extend(twin.map(|twin| alike(twin.id, &twin.selectors, twin.correlation)));
    list.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    list
}

/// The form of effect `id`, of another cause than candidate `g` is, with the column most like one of that; and
/// their correlation.
pub(crate) fn most_alike(found: &Found, g: usize, id: &str) -> Option<(usize, f64)> {
    let fits = &found.fitted.fits;
    let cause = family(found.candidates[g].as_ref());
    let likeness = |other: usize| {
        let mut most = 0.0_f64;
        for &a in &found.fitted.groups[g].columns {
            for &b in &found.fitted.groups[other].columns {
                let likeness = fits.likeness(a, b);
                if likeness.abs() > most.abs() {
                    most = likeness;
                }
            }
        }
        most
    };
    (0..found.candidates.len())
        .filter(|&other| {
            let candidate = found.candidates[other].as_ref();
            candidate.id() == id && family(candidate) != cause
        })
        .map(|other| (other, likeness(other)))
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
}

/// Selectors as they are told.
pub(crate) fn told(selectors: &BTreeMap<String, String>) -> BTreeMap<String, Selector> {
    let selectors = selectors.iter();
    selectors
        .map(|(k, v)| (k.clone(), Selector::from(v.as_str())))
        .collect()
}

/// Every effect of the catalogue that was not added.
pub(crate) fn considered(
    found: &Found,
    to_explain: &ToExplain<'_>,
    against: &Refused,
    surroundings: &Surroundings<'_>,
) -> Vec<ConsideredEffect> {
    effects::catalogue()
        .iter()
        .filter(|kind| {
            !found
                .selection
                .chosen
                .iter()
                .any(|&g| found.candidates[g].id() == kind.id())
        })
        .map(|kind| consider(found, kind.id(), to_explain, against, surroundings))
        .collect()
}

fn consider(
    found: &Found,
    id: &str,
    to_explain: &ToExplain<'_>,
    against: &Refused,
    surroundings: &Surroundings<'_>,
) -> ConsideredEffect {
    let best = (0..found.candidates.len())
        .filter(|&g| found.candidates[g].id() == id && found.selection.judged[g].observable)
        .max_by(|&a, &b| {
            found.selection.judged[a]
                .delta_loglik
                .total_cmp(&found.selection.judged[b].delta_loglik)
        });
    let mut entry = ConsideredEffect {
        id: id.to_owned(),
        selectors: BTreeMap::new(),
        delta_loglik: None,
        p_value: None,
        observable: best.is_some(),
        detectable: None,
        needed: None,
        parameter: None,
        unit: None,
        refused: refused(found, id, surroundings),
        against: None,
    };
    let is_meant = |of: &str| match best {
        Some(g) => family(found.candidates[g].as_ref()) == of,
        None => of.split('/').next() == Some(id),
    };
    let why = against.iter().find(|(of, _)| is_meant(of));
    entry.against = why.map(|(_, refusal)| refusal.why());
    let Some(g) = best else { return entry };
    let judged = &found.selection.judged[g];
    entry.delta_loglik = Some(judged.delta_loglik);
    entry.p_value = Some(judged.p_value);
    let first = first_column(&found.candidates, g);
    let candidate = found.candidates[g].as_ref();
    let group = &found.fitted.groups[g];
    let added = columns_of(&found.fitted.groups, &found.selection.chosen);
    let mut set = added.clone();
    set.extend(&group.columns);
    if let (Some(estimate), Some(&column)) =
        (found.fitted.fits.estimate(&set), group.columns.first())
    {
        let own = added.len();
        let shows = judged.stands() || entry.refused.is_some() || entry.against.is_some();
        if !shows && !group.could_show(&estimate, own) {
            entry.observable = false;
            return entry;
        }
        let told = Told::of_magnitude(candidate, column - first, surroundings);
        entry.detectable = Some(told.size(SEEN * estimate.sigma(own)));
        entry.needed = to_explain.needed(column, &added).map(|n| told.size(n));
        entry.selectors = self::told(&candidate.selectors());
        entry.parameter = Some(told.name);
        entry.unit = Some(told.unit);
    }
    entry
}

/// What an effect that shows changes with, if that is why it was not added: the likeliest, as the share that it explains
/// out of fold of what is left.
pub(crate) fn changing(found: &Found, against: &Refused) -> Option<Dependence> {
    let changes = (0..found.candidates.len()).filter_map(|g| {
        let why = against.get(&family(found.candidates[g].as_ref()))?;
        let Refusal::Change(variable) = why else {
            return None;
        };
        let judged = &found.selection.judged[g];
        judged.stands().then_some((variable, judged))
    });
    let (variable, judged) =
        changes.max_by(|a, b| a.1.delta_loglik.total_cmp(&b.1.delta_loglik))?;
    Some(Dependence {
        variable: variable.clone(),
        variance_explained: -(-2.0 * judged.delta_loglik / found.fitted.scalars).exp_m1(),
        p_value: judged.p_value,
    })
}

/// Why none of an effect's forms was added although one would be for all but its size.
fn refused(found: &Found, id: &str, surroundings: &Surroundings<'_>) -> Option<RefusedSize> {
    let judged = &found.selection.judged;
    let of_size = |g: &usize| {
        let j = &judged[*g];
        found.candidates[*g].id() == id && !j.credible && j.stands_but_for_size()
    };
    let g = (0..found.candidates.len())
        .filter(of_size)
        .max_by(|&a, &b| judged[a].delta_loglik.total_cmp(&judged[b].delta_loglik))?;
    let group = &found.fitted.groups[g];
    let mut set = columns_of(&found.fitted.groups, &found.selection.chosen);
    let own = set.len();
    set.extend(&group.columns);
    let estimate = found.fitted.fits.estimate(&set)?;
    let first = first_column(&found.candidates, g);
    group.columns.iter().enumerate().find_map(|(k, column)| {
        let (value, [low, high]) = (estimate.value[own + k], group.bounds[k]);
        if is_believed(&estimate, own + k, [low, high]) {
            return None;
        }
        let candidate = found.candidates[g].as_ref();
        let told = Told::of_magnitude(candidate, column - first, surroundings);
        let (value, believed) = told.beyond(value, [low, high]);
        Some(RefusedSize {
            value,
            believed,
            parameter: told.name,
            unit: told.unit,
        })
    })
}

/// The finding in one word; empirical terms never count as explanation.
pub(crate) fn verdict(effects: &[FoundEffect], left: bool) -> Verdict {
    match (effects.iter().any(|e| e.id != EMPIRICAL), left) {
        (false, false) => Verdict::Consistent,
        (true, false) => Verdict::Explained,
        (true, true) => Verdict::PartlyExplained,
        (false, true) => Verdict::Unexplained,
    }
}
