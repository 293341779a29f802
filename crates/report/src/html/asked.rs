//! What was asked by name, and which motion would tell effects apart.
//!
//! Not physics: tables.

use telemetry::report::{Hypothesis, HypothesisSize, Report};

use super::write::{Cell, Page, datum, escaped};
use crate::number::percent;
use crate::text::selectors;

/// Numbers that the words beside them tell already.
fn for_machines(at: &str, numbers: &[(&str, Option<f64>)]) -> String {
    numbers
        .iter()
        .filter_map(|(name, value)| Some(datum(&format!("{at}/{name}"), (*value)?, "")))
        .collect()
}

/// The motion for each pair of effects.
pub(super) fn apart(page: &mut Page, report: &Report) {
    let mut rows = Vec::new();
    for (k, effect) in report.effects.iter().enumerate() {
        for (i, c) in effect.confusable_with.iter().enumerate() {
            let Some(manoeuvre) = &c.manoeuvre else {
                continue;
            };
            let key = |name: &str| format!("/effects/{k}/confusable_with/{i}/{name}");
            let numbers = [
                ("axis/0", Some(manoeuvre.axis[0])),
                ("axis/1", Some(manoeuvre.axis[1])),
                ("axis/2", Some(manoeuvre.axis[2])),
                ("rate_deg_s", Some(manoeuvre.rate_deg_s)),
                ("duration_s", Some(manoeuvre.duration_s)),
                ("ramp_s", Some(manoeuvre.ramp_s)),
            ];
            rows.push(vec![
                Cell::text(&effect.id),
                Cell::text(&format!("{}{}", c.id, selectors(&c.selectors))),
                Cell::maybe(&key("delta_loglik"), c.delta_loglik),
                Cell::maybe(&key("separation_sigma"), c.separation_sigma),
                Cell::words(format!(
                    "{}{}",
                    escaped(&manoeuvre.text),
                    for_machines(&key("manoeuvre"), &numbers)
                )),
                Cell::datum(&key("manoeuvre/sigma"), manoeuvre.sigma),
            ]);
        }
    }
    if rows.is_empty() {
        return;
    }
    page.section("apart", "What else it could have been, and what would tell", |page| {
        page.table(
            "Gain: of the other effect in place of the one that was added. Sigmas: by which the other alone misses what was found, in this data and on the smallest of a library of manoeuvres that reaches 5, flown on paper with this bundle's stars, noise and rate.",
            &["added", "in its place", "gain, nats", "σ in this data", "manoeuvre", "σ on it"],
            rows,
        );
    });
}

/// The answers to what was asked.
pub(super) fn hypotheses(page: &mut Page, report: &Report) {
    if report.hypotheses.is_empty() {
        return;
    }
    page.section("hypotheses", "Asked by name", |page| {
        page.raw("<ul>");
        for (k, h) in report.hypotheses.iter().enumerate() {
            let numbers = [
                ("delta_loglik", h.delta_loglik),
                ("p_value", h.p_value),
                ("variance_share", h.variance_share),
                ("variance_share_at_most", h.variance_share_at_most),
            ];
            page.raw(&format!(
                "<li><strong>{}</strong>: {}.{}</li>",
                escaped(&h.id),
                escaped(&h.finding),
                for_machines(&format!("/hypotheses/{k}"), &numbers)
            ));
        }
        page.raw("</ul>");
        let mut rows = Vec::new();
        for (k, h) in report.hypotheses.iter().enumerate() {
            for (i, size) in h.sizes.iter().enumerate() {
                rows.push(row(k, i, h, size));
            }
        }
        if !rows.is_empty() {
            page.table(
                "Each beside the other effects added. Would show: at 5σ. Needed: to explain by itself what is left, or all that the declared model leaves. Natural: 1σ of the sizes that nature makes; believed: up to which the effect is named. At most: share of the squared residual beside what the declared unknowns imitate, with 95 %.",
                &["effect", "size in", "fitted", "± 1σ", "would show", "needed: left", "needed: all", "natural", "believed to", "at most, %"],
                rows,
            );
        }
    });
}

fn row(k: usize, i: usize, h: &Hypothesis, size: &HypothesisSize) -> Vec<Cell> {
    let of = |name: &str| format!("/hypotheses/{k}/sizes/{i}/{name}");
    let named = if size.unit.is_empty() {
        size.parameter.clone()
    } else {
        format!("{}, {}", size.parameter, size.unit)
    };
    let most = h
        .variance_share_at_most
        .map_or_else(|| Cell::number("–"), |v| Cell::number(&percent(v)));
    vec![
        Cell::text(&h.id),
        Cell::text(&named),
        Cell::maybe(&of("value"), size.value),
        Cell::maybe(&of("sigma"), size.sigma),
        Cell::maybe(&of("detectable"), size.detectable),
        Cell::maybe(&of("needed"), size.needed),
        Cell::maybe(&of("needed_alone"), size.needed_alone),
        Cell::maybe(&of("plausible"), size.plausible),
        Cell::maybe(&of("believed_to"), size.believed_to),
        most,
    ]
}
