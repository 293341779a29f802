//! The report in tables: errors, effects, rivals, what was not added, what is left.

use closed_loop::{CONFUSABLE, Closed, is_beyond_chance};
use telemetry::report::{ConsideredEffect, Dependence, Errors, Estimate, FoundEffect, Report};

use super::Page;
use super::write::{Cell, datum, escaped, step};
use crate::number::{change, hertz, p_is, percent, probability, short, short_to, with_sigma};
use crate::order::by_number;
use crate::text::selectors;
use crate::why_not::why_not;

/// Variables that are told where nothing follows any.
const NEAREST: usize = 5;

/// Each effect with its size.
pub(super) fn in_a_line_each(page: &mut Page, report: &Report) {
    if report.effects.is_empty() {
        return;
    }
    page.raw("<ul>");
    for effect in &report.effects {
        let sizes: Vec<String> = by_number(&effect.parameters)
            .into_iter()
            .map(|(name, estimate)| format!("{name} = {}", size(estimate)))
            .collect();
        page.raw(&format!(
            "<li><strong>{}{}</strong>, {}: {}; {}{}</li>",
            escaped(&effect.id),
            escaped(&selectors(&effect.selectors)),
            escaped(meaning(&effect.id)),
            escaped(&sizes.join(", ")),
            escaped(&p_is(effect.p_value)),
            effect
                .variance_explained
                .map_or_else(String::new, |v| format!(
                    ", {} % of the variance",
                    percent(v)
                )),
        ));
    }
    page.raw("</ul>");
}

fn size(estimate: &Estimate) -> String {
    let value = match (estimate.sigma, estimate.interval) {
        (Some(sigma), _) => with_sigma(estimate.value, sigma),
        (None, Some([from, to])) => {
            format!(
                "{} (95 %: {} to {})",
                short_to(estimate.value, to - from),
                short_to(from, to - from),
                short_to(to, to - from)
            )
        }
        (None, None) => short(estimate.value),
    };
    if estimate.unit.is_empty() {
        value
    } else {
        format!("{value} {}", estimate.unit)
    }
}

/// What an effect is, in words.
fn meaning(id: &str) -> &'static str {
    let kinds = effects::catalogue();
    kinds
        .iter()
        .find(|kind| kind.id() == id)
        .map_or("a term without a cause", |kind| kind.summary())
}

/// The error before and after.
pub(super) fn numbers(page: &mut Page, report: &Report) {
    let mut rows = vec![];
    let (b, a) = (&report.before, &report.after);
    let star = [
        "star residual along x, arcsec rms",
        "star residual along y, arcsec rms",
    ];
    axes(
        &mut rows,
        "star_rms_arcsec",
        &star,
        b.star_rms_arcsec,
        a.star_rms_arcsec,
    );
    let attitude =
        ["X", "Y", "Z"].map(|axis| format!("attitude residual about {axis}, arcsec rms"));
    let names = attitude.each_ref().map(String::as_str);
    axes(
        &mut rows,
        "attitude_rms_arcsec",
        &names,
        b.attitude_rms_arcsec,
        a.attitude_rms_arcsec,
    );
    let costs =
        ["X", "Y", "Z"].map(|axis| format!("log-PSD cost about {axis} (1: as the model says)"));
    let names = costs.each_ref().map(String::as_str);
    axes(
        &mut rows,
        "log_psd_cost",
        &names,
        b.log_psd_cost,
        a.log_psd_cost,
    );
    // its best is 1, not 0
    if let (Some(_), Some(_)) = (b.log_psd_cost, a.log_psd_cost) {
        for row in rows.iter_mut().rev().take(3) {
            row[3] = Cell::number("");
        }
    }
    type Get = fn(&Errors) -> Option<f64>;
    let single: [(&str, &str, Get); 2] = [
        ("chi-squared per degree of freedom", "chi2_per_dof", |e| {
            e.chi2_per_dof
        }),
        ("log-likelihood per frame, nats", "loglik_per_frame", |e| {
            e.loglik_per_frame
        }),
    ];
    for (name, key, get) in single {
        if get(b).is_some() || get(a).is_some() {
            rows.push(vec![
                Cell::text(name),
                Cell::maybe(&format!("/before/{key}"), get(b)),
                Cell::maybe(&format!("/after/{key}"), get(a)),
                Cell::number(""),
            ]);
        }
    }
    page.section("numbers", "Error before and after", |page| {
        page.table(
            "Out of fold: every block of time is predicted from the others.",
            &["", "before", "after", "change"],
            rows,
        );
    });
}

fn axes<const N: usize>(
    rows: &mut Vec<Vec<Cell>>,
    key: &str,
    names: &[&str; N],
    before: Option<[f64; N]>,
    after: Option<[f64; N]>,
) {
    let (Some(before), Some(after)) = (before, after) else {
        return;
    };
    for k in 0..N {
        let ratio = 100.0 * (after[k] / before[k] - 1.0);
        let change = if ratio.is_finite() {
            format!("{} %", change(ratio))
        } else {
            "–".to_owned()
        };
        rows.push(vec![
            Cell::text(names[k]),
            Cell::datum(&format!("/before/{key}/{k}"), before[k]),
            Cell::datum(&format!("/after/{key}/{k}"), after[k]),
            Cell::number(&change),
        ]);
    }
}

/// What was added, with all parameters.
pub(super) fn effects(page: &mut Page, report: &Report) {
    page.section("effects", "What was added", |page| {
        if report.effects.is_empty() {
            page.paragraph("Nothing: no effect of the catalogue predicts the residual out of fold.");
            return;
        }
        let rows = report
            .effects
            .iter()
            .enumerate()
            .map(|(k, effect)| row_of(k, effect))
            .collect();
        page.table(
            "In the order added, estimated jointly; ± is 1σ. Gain in out-of-fold log-likelihood; share of the variance before; in brackets the likeness of the columns of two effects in this data, from −1 to 1.",
            &["effect", "parameters", "gain, nats", "p", "share, %", "hard to tell from"],
            rows,
        );
    });
}

fn row_of(k: usize, effect: &FoundEffect) -> Vec<Cell> {
    let parameters: Vec<String> = by_number(&effect.parameters)
        .into_iter()
        .map(|(name, e)| {
            format!(
                "<span class=\"v\">{} = {}</span>",
                escaped(name),
                estimate(k, name, e)
            )
        })
        .collect();
    let likeness = effect.confusable_with.iter().enumerate();
    let alike: Vec<String> = likeness
        .map(|(i, c)| {
            // asked about, and none that it could be taken for
            let unlike = if c.correlation.abs() < CONFUSABLE {
                "unlike "
            } else {
                ""
            };
            let shown = format!("{:+.2}", c.correlation).replace('-', "−");
            let key = format!("/effects/{k}/confusable_with/{i}/correlation");
            format!(
                "{unlike}{}{} ({})",
                escaped(&c.id),
                escaped(&selectors(&c.selectors)),
                datum(&key, c.correlation, &shown)
            )
        })
        .collect();
    let or_dash = |list: &[String], between: &str| match list {
        [] => "–".to_owned(),
        list => list.join(between),
    };
    let key = |name: &str| format!("/effects/{k}/{name}");
    vec![
        Cell::words(format!(
            "<strong>{}</strong>{}<br/><small>{}</small>",
            escaped(&effect.id),
            escaped(&selectors(&effect.selectors)),
            escaped(meaning(&effect.id))
        )),
        Cell::words(or_dash(&parameters, "<br/>")),
        Cell::datum(&key("delta_loglik"), effect.delta_loglik),
        Cell::html(datum(
            &key("p_value"),
            effect.p_value,
            &probability(effect.p_value),
        )),
        effect.variance_explained.map_or_else(
            || Cell::number("–"),
            |v| Cell::html(datum(&key("variance_explained"), v, &percent(v))),
        ),
        Cell::words(or_dash(&alike, "<br/>")),
    ]
}

/// Value, sigma or interval, and unit.
fn estimate(k: usize, name: &str, e: &Estimate) -> String {
    let at = format!("/effects/{k}/parameters/{}", step(name));
    let value = |shown: &str| datum(&format!("{at}/value"), e.value, shown);
    let mut out = match e.sigma {
        Some(sigma) => {
            let both = value(&with_sigma(e.value, sigma));
            // the sigma is in the text already; this is for machines
            format!("{both}{}", datum(&format!("{at}/sigma"), sigma, ""))
        }
        None => value(&short(e.value)),
    };
    if let Some([from, to]) = e.interval {
        out.push_str(&format!(
            " <small>(95 %: {} to {})</small>",
            datum(
                &format!("{at}/interval/0"),
                from,
                &short_to(from, to - from)
            ),
            datum(&format!("{at}/interval/1"), to, &short_to(to, to - from))
        ));
    }
    if !e.unit.is_empty() {
        out.push(' ');
        out.push_str(&escaped(&e.unit));
    }
    out
}

/// Other explanations of the same residual.
pub(super) fn rivals(page: &mut Page, closed: &Closed) {
    page.section("rivals", "Rival explanations", |page| {
        let Some(best) = closed
            .rivals
            .iter()
            .max_by(|a, b| a.delta_loglik.total_cmp(&b.delta_loglik))
        else {
            page.paragraph("None was worked out in place of what was added. What each other effect gains beside it is in the next table.");
            return;
        };
        page.paragraph(&format!(
            "Each line is an account of its own, in place of what was added, out of fold. The most likely of them is {}, by {} nats over the declared model.",
            best.what,
            short(best.delta_loglik)
        ));
        let axes: &[&str] = if closed.stars.is_some() {
            &["rms along x, arcsec", "rms along y, arcsec"]
        } else {
            &["rms about X, arcsec", "rms about Y, arcsec", "rms about Z, arcsec"]
        };
        let mut head = vec!["explanation"];
        head.extend(axes);
        head.push("gain, nats");
        let rows = closed
            .rivals
            .iter()
            .map(|rival| {
                let mut row = vec![Cell::text(&rival.what)];
                row.extend(rival.rms_arcsec.iter().map(|rms| Cell::number(&short(*rms))));
                row.push(Cell::number(&short(rival.delta_loglik)));
                row
            })
            .collect();
        page.table("", &head, rows);
    });
}

/// What was not added, and why.
pub(super) fn considered(page: &mut Page, report: &Report) {
    page.section("considered", "Considered and not added", |page| {
        let mut seen: Vec<(usize, &ConsideredEffect)> = report
            .considered
            .iter()
            .enumerate()
            .filter(|(_, c)| c.observable)
            .collect();
        let gain = |c: &ConsideredEffect| c.delta_loglik.unwrap_or(f64::NEG_INFINITY);
        seen.sort_by(|a, b| gain(b.1).total_cmp(&gain(a.1)));
        if !seen.is_empty() {
            page.table(
                "Gain and p beside what was added. Detectable: the size that would have shown at 5σ; needed: the size that would explain what is left by itself.",
                &["effect", "size in", "detectable", "needed", "gain, nats", "p", "why not"],
                seen.into_iter().map(|(k, c)| considered_row(k, c, report)).collect(),
            );
        }
        let unseen: Vec<&ConsideredEffect> =
            report.considered.iter().filter(|c| !c.observable).collect();
        if !unseen.is_empty() {
            page.raw(&format!("<p>Not observable in this data ({} effects: what they need is not in the bundle, or the motion does not show them):</p><ul>", unseen.len()));
            for c in unseen {
                page.raw(&format!(
                    "<li>{}: {}</li>",
                    escaped(&c.id),
                    escaped(meaning(&c.id))
                ));
            }
            page.raw("</ul>");
        }
    });
}

fn considered_row(k: usize, c: &ConsideredEffect, report: &Report) -> Vec<Cell> {
    let key = |name: &str| format!("/considered/{k}/{name}");
    let p = c.p_value.map_or_else(
        || Cell::number("–"),
        |p| Cell::html(datum(&key("p_value"), p, &probability(p))),
    );
    let unit = c.unit.as_deref().filter(|unit| !unit.is_empty());
    let size = match (c.parameter.as_deref(), unit) {
        (Some(parameter), Some(unit)) => format!("{parameter}, {unit}"),
        (Some(parameter), None) => parameter.to_owned(),
        (None, _) => "–".to_owned(),
    };
    vec![
        Cell::words(format!(
            "{}{}<br/><small>{}</small>",
            escaped(&c.id),
            escaped(&selectors(&c.selectors)),
            escaped(meaning(&c.id))
        )),
        Cell::text(&size),
        Cell::maybe(&key("detectable"), c.detectable),
        Cell::maybe(&key("needed"), c.needed),
        Cell::maybe(&key("delta_loglik"), c.delta_loglik),
        p,
        Cell::text(&why_not(c, report)),
    ]
}

/// Rows of a list of variables, which stands under `list`.
fn dependences(list: &str, all: &[Dependence]) -> Vec<Vec<Cell>> {
    let row = |(k, d): (usize, &Dependence)| {
        let key = |name: &str| format!("/unattributed/{list}/{k}/{name}");
        let v = d.variance_explained;
        vec![
            Cell::text(&d.variable),
            Cell::html(datum(&key("variance_explained"), v, &percent(v))),
            Cell::html(datum(&key("p_value"), d.p_value, &probability(d.p_value))),
        ]
    };
    all.iter().enumerate().map(row).collect()
}

/// What no effect explains.
pub(super) fn leftover(page: &mut Page, report: &Report) {
    let left = &report.unattributed;
    page.section("leftover", "What is left", |page| {
        let share = left.variance_fraction.map_or_else(String::new, |v| {
            format!(
                " Its share of the variance before: {} %.",
                datum("/unattributed/variance_fraction", v, &percent(v))
            )
        });
        let follows = left.depends_on.iter().chain(&left.noise_depends_on);
        let follows = follows.chain(&left.shared_noise_depends_on);
        let first = match (left.present, follows.clone().any(is_beyond_chance)) {
            (true, true) => "Something is left that follows a variable and that no effect explains.",
            (true, false) => "Something is left in time that follows no variable and that no effect explains.",
            (false, _) => "Nothing is left that follows any variable: the rest behaves as noise.",
        };
        page.raw(&format!("<p>{first}{share}</p>"));
        if left.depends_on.is_empty() {
            page.paragraph("No variable was there to be tried.");
        } else {
            let told = if left.present {
                &left.depends_on[..]
            } else {
                &left.depends_on[..NEAREST.min(left.depends_on.len())]
            };
            let rows = dependences("depends_on", told);
            if told.len() < left.depends_on.len() {
                page.raw(&format!(
                    "<p>Of {} variables that were tried, those that come nearest:</p>",
                    left.depends_on.len()
                ));
            }
            page.table(
                "Smooth functions of one variable, judged out of fold beside what was added. A share below zero predicts worse than nothing.",
                &["follows", "share of what is left, %", "p"],
                rows,
            );
        }
        if !left.noise_depends_on.is_empty() {
            page.table(
                "What the noise level follows: squares of what is left, beside the effects on the noise.",
                &["follows", "rms change of the variance, %", "p"],
                dependences("noise_depends_on", &left.noise_depends_on),
            );
        }
        if !left.shared_noise_depends_on.is_empty() {
            page.table(
                "What the noise follows that all stars of a frame share: that of the reference, or of time tags.",
                &["follows", "rms change of the variance, %", "p"],
                dependences("shared_noise_depends_on", &left.shared_noise_depends_on),
            );
        }
        let list = |name: &str, values: &[f64], shown: fn(f64) -> String| {
            let items: Vec<String> = values
                .iter()
                .enumerate()
                .map(|(k, v)| datum(&format!("/unattributed/{name}/{k}"), *v, &shown(*v)))
                .collect();
            if items.is_empty() {
                "none reported".to_owned()
            } else {
                items.join(", ")
            }
        };
        page.raw(&format!(
            "<p>Lines in the spectrum: {}. Jumps: {}.</p>",
            list("lines_hz", &left.lines_hz, hertz),
            list("jumps_s", &left.jumps_s, |t| format!("{} s", short(t)))
        ));
    });
}

#[cfg(test)]
mod tests {
    use telemetry::report::Verdict;

    use super::*;
    use crate::bare;

    fn written(report: &Report, section: fn(&mut Page, &Report)) -> String {
        let mut page = Page::new("", "");
        section(&mut page, report);
        page.finish()
    }

    /// Of many variables that nothing follows the nearest are shown; where something is left all are.
    #[test]
    fn where_nothing_is_left_few_variables_are_told() {
        let mut report = bare::report(Verdict::Consistent);
        let variable = |k: i32| Dependence {
            variable: format!("channel_{k}"),
            variance_explained: 0.0,
            p_value: 1.0,
        };
        report.unattributed.depends_on = (0..67).map(variable).collect();
        let page = written(&report, leftover);
        assert!(page.contains("Of 67 variables"), "{page}");
        assert!(
            page.contains("channel_4<") && !page.contains("channel_5<"),
            "{page}"
        );
        report.unattributed.present = true;
        assert!(written(&report, leftover).contains("channel_66<"));
    }

    /// A cost whose best is 1 has no change in percent; an error has.
    #[test]
    fn a_cost_has_no_change_in_percent() {
        let mut report = bare::report(Verdict::Explained);
        for (errors, cost) in [(&mut report.before, 4.0), (&mut report.after, 2.0)] {
            errors.log_psd_cost = Some([cost; 3]);
        }
        let page = written(&report, numbers);
        assert!(
            page.contains("log-PSD cost") && !page.contains(" %<"),
            "{page}"
        );
        (report.before.star_rms_arcsec, report.after.star_rms_arcsec) =
            (Some([2.0; 2]), Some([1.0; 2]));
        assert!(written(&report, numbers).contains("−50.0 %<"));
    }
}
