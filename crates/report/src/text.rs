//! A summary that a flight analyst can read, and paste into a report.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use closed_loop::{Closed, p_is};
use telemetry::report::{Dependence, Errors, RefusedSize, Report, Selector, listed};

use crate::number::{decimal, number, number_to};
use crate::order::by_number;
use crate::set_aside;
use crate::verdict::sentence;
use crate::windows;

/// The findings of a run in words and numbers, some 20 lines of at most 100 columns.
#[must_use]
pub fn summary(closed: &Closed) -> String {
    let mut out = String::new();
    let report = &closed.report;
    verdict(&mut out, closed);
    figures(&mut out, report);
    effects(&mut out, report);
    hypotheses(&mut out, report);
    rivals(&mut out, closed);
    considered(&mut out, report);
    leftover(&mut out, report);
    out
}

/// Writing to a string cannot fail.
macro_rules! line {
    ($out:expr) => { $out.push('\n') };
    ($out:expr, $($arg:tt)*) => {{ let _ = writeln!($out, $($arg)*); }};
}

fn verdict(out: &mut String, closed: &Closed) {
    let report = &closed.report;
    let sentence = sentence(report);
    line!(out, "Verdict   {sentence}");
    line!(
        out,
        "Data      {} rows used, {} outliers, {} outside the reference; {} folds, every figure out of fold",
        report.rows.used,
        report.rows.outliers,
        report.rows.outside_reference,
        report.folds
    );
    for star in set_aside::stars(closed.stars.as_ref()) {
        line!(out, "          {star}");
    }
    for sentence in windows::sentences(report.windows.as_ref()) {
        wrapped(out, "          ", &sentence);
    }
    line!(out);
}

fn figures(out: &mut String, report: &Report) {
    line!(
        out,
        "{:<28} {:>11} {:>11} {:>9}",
        "",
        "before",
        "after",
        "ratio"
    );
    let (before, after) = (&report.before, &report.after);
    if let (Some(b), Some(a)) = (before.star_rms_arcsec, after.star_rms_arcsec) {
        for (k, axis) in ["x", "y"].into_iter().enumerate() {
            figure(out, &format!("star residual {axis}, arcsec"), b[k], a[k]);
        }
    }
    if let (Some(b), Some(a)) = (before.attitude_rms_arcsec, after.attitude_rms_arcsec) {
        for (k, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
            figure(
                out,
                &format!("attitude residual {axis}, arcsec"),
                b[k],
                a[k],
            );
        }
    }
    if let (Some(b), Some(a)) = (before.log_psd_cost, after.log_psd_cost) {
        for (k, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
            line!(
                out,
                "{:<28} {:>11} {:>11}",
                format!("log-PSD cost {axis}"),
                decimal(b[k], 3),
                decimal(a[k], 3)
            );
        }
    }
    for (name, get) in [
        (
            "chi2 per degree of freedom",
            (|e: &Errors| e.chi2_per_dof) as fn(&Errors) -> Option<f64>,
        ),
        ("log-likelihood per frame", |e| e.loglik_per_frame),
    ] {
        if let (Some(b), Some(a)) = (get(before), get(after)) {
            let [b, a] = [b, a].map(|value| decimal(value, 4));
            line!(out, "{name:<28} {b:>11} {a:>11}");
        }
    }
    line!(out);
}

fn figure(out: &mut String, name: &str, before: f64, after: f64) {
    let digits = if before < 1.0 { 4 } else { 3 };
    line!(
        out,
        "{name:<28} {:>11} {:>11} {:>9}",
        decimal(before, digits),
        decimal(after, digits),
        // nothing over nothing is no ratio
        decimal(after / before, 3)
    );
}

fn effects(out: &mut String, report: &Report) {
    for effect in &report.effects {
        line!(
            out,
            "Added     {}{}",
            effect.id,
            selectors(&effect.selectors)
        );
        for (name, estimate) in by_number(&effect.parameters) {
            let unit = if estimate.unit.is_empty() {
                String::new()
            } else {
                format!(" {}", estimate.unit)
            };
            let sigma = estimate
                .sigma
                .map_or_else(String::new, |s| format!(" +- {}", number(s)));
            let width = estimate.interval.map(|[low, high]| high - low);
            let known_to = estimate.sigma.or(width).unwrap_or(f64::NAN);
            let bounds = estimate.interval.map_or_else(String::new, |[low, high]| {
                let [low, high] = [low, high].map(|end| number_to(end, known_to));
                format!(" (95 %: {low} to {high})")
            });
            line!(
                out,
                "            {name} = {}{sigma}{unit}{bounds}",
                number_to(estimate.value, known_to)
            );
        }
        let share = effect.variance_explained.map_or(String::new(), |v| {
            format!(", {:.1} % of the variance before", 100.0 * v)
        });
        line!(
            out,
            "            gain {} nats out of fold, {}{share}",
            decimal(effect.delta_loglik, 1),
            p_is(effect.p_value)
        );
        let alike: Vec<String> = effect
            .confusable_with
            .iter()
            .take(3)
            .map(|c| {
                let on = selectors(&c.selectors);
                format!("{}{on} ({:+.2})", c.id, c.correlation)
            })
            .collect();
        if !alike.is_empty() {
            line!(out, "            looks like {}", alike.join(", "));
        }
        for c in effect.confusable_with.iter().take(3) {
            if let Some(here) = c.separation_sigma {
                let on = selectors(&c.selectors);
                let here = format!("this data tells it from {}{on} at {here:.1} sigma", c.id);
                wrapped(out, "            ", &here);
            }
            if let Some(manoeuvre) = &c.manoeuvre {
                wrapped(out, "            ", &manoeuvre.text);
            }
        }
    }
    if !report.effects.is_empty() {
        line!(out);
    }
}

/// The answers to what was asked by name.
fn hypotheses(out: &mut String, report: &Report) {
    for h in &report.hypotheses {
        line!(out, "Asked     {}", h.id);
        wrapped(out, "            ", &h.finding);
    }
    if !report.hypotheses.is_empty() {
        line!(out);
    }
}

/// Lines of at most 98 columns, each behind `indent`.
fn wrapped(out: &mut String, indent: &str, text: &str) {
    let mut row = indent.to_owned();
    for word in text.split(' ') {
        if row.len() > indent.len() && row.chars().count() + word.chars().count() + 1 > 98 {
            line!(out, "{row}");
            row = format!("{indent}  ");
        }
        if row.trim().is_empty() {
            row.push_str(word);
        } else {
            let _ = write!(row, " {word}");
        }
    }
    line!(out, "{row}");
}

pub(crate) fn selectors(of: &BTreeMap<String, Selector>) -> String {
    if of.is_empty() {
        return String::new();
    }
    format!(" ({})", listed(of))
}

fn rivals(out: &mut String, closed: &Closed) {
    if closed.rivals.is_empty() {
        return;
    }
    let axes: &[&str] = if closed.stars.is_some() {
        &["x", "y"]
    } else {
        &["X", "Y", "Z"]
    };
    let mut row = format!("{:<52}", "Rival explanations, rms in arcsec out of fold");
    for axis in axes {
        let _ = write!(row, "{axis:>9}");
    }
    line!(out, "{row}{:>12}", "gain, nats");
    for rival in &closed.rivals {
        let mut row = format!("  {:<50}", rival.what);
        for rms in &rival.rms_arcsec {
            let _ = write!(row, " {:>8}", decimal(*rms, 4));
        }
        line!(out, "{row} {:>11}", decimal(rival.delta_loglik, 1));
    }
    line!(out);
}

/// Why an effect was refused by its size.
pub(crate) fn of_size(size: &RefusedSize) -> String {
    let [least, most] = size.believed.map(number);
    let RefusedSize {
        parameter,
        unit,
        value,
        ..
    } = size;
    format!(
        "of a size that nature does not make: {parameter} {} {unit} (believed: {least} to {most})",
        number(*value)
    )
}

fn considered(out: &mut String, report: &Report) {
    let (seen, unseen): (Vec<_>, Vec<_>) = report.considered.iter().partition(|c| c.observable);
    let mut tried = seen;
    tried.sort_by(|a, b| {
        b.delta_loglik
            .unwrap_or(0.0)
            .total_cmp(&a.delta_loglik.unwrap_or(0.0))
    });
    if !tried.is_empty() {
        line!(
            out,
            "Considered and not added (gain in nats; size that would have shown at 5 sigma):"
        );
        for c in tried.iter().take(8) {
            let size = match (&c.parameter, c.detectable, &c.unit) {
                _ if c.refused.is_some() => c.refused.iter().map(of_size).collect(),
                (Some(parameter), Some(d), Some(unit)) => {
                    format!("{parameter} {} {unit}", number(d))
                }
                _ => String::new(),
            };
            let gain = c.delta_loglik.map_or("-".to_owned(), |g| decimal(g, 1));
            line!(out, "  {:<26} {gain:>8}   {size}", c.id);
            if let Some(why) = &c.against {
                line!(out, "    not named: {why}");
            }
        }
    }
    if !unseen.is_empty() {
        let names: Vec<&str> = unseen.iter().map(|c| c.id.as_str()).collect();
        let mut row = String::from("Not observable in this data:");
        for name in names {
            if row.len() + name.len() + 2 > 98 {
                line!(out, "{row}");
                row = String::from("   ");
            }
            row.push(' ');
            row.push_str(name);
        }
        line!(out, "{row}");
    }
}

fn leftover(out: &mut String, report: &Report) {
    let left = &report.unattributed;
    if !left.present {
        return;
    }
    let noise = &left.noise_depends_on;
    if left.depends_on.iter().any(is_certain) && left.depends_on != *noise {
        line!(
            out,
            "What is left follows (share of its variance, out of fold):"
        );
        follows(out, &left.depends_on);
    }
    if !noise.is_empty() {
        line!(out, "The noise level follows (rms change of its variance):");
        follows(out, noise);
    }
    let list = |values: &[f64]| -> String {
        let texts: Vec<String> = values.iter().copied().map(number).collect();
        texts.join(", ")
    };
    if !left.lines_hz.is_empty() {
        let lines = format!("Lines in its spectrum, Hz: {}", list(&left.lines_hz));
        wrapped(out, "", &lines);
    }
    if !left.jumps_s.is_empty() {
        wrapped(out, "", &format!("Jumps, at s: {}", list(&left.jumps_s)));
    }
}

/// Whether that is beyond chance: where nothing is, what comes nearest is listed in the report.
pub(crate) fn is_certain(d: &Dependence) -> bool {
    d.p_value < 0.01 && d.variance_explained > 0.0
}

fn follows(out: &mut String, list: &[Dependence]) {
    for d in list.iter().filter(|d| is_certain(d)).take(5) {
        line!(
            out,
            "  {:<34} {:>6.1} %   {}",
            d.variable,
            100.0 * d.variance_explained,
            p_is(d.p_value)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use telemetry::report::{REPORT_FORMAT, Rows, Unattributed};

    fn report() -> Report {
        Report {
            format: REPORT_FORMAT.to_owned(),
            verdict: telemetry::report::Verdict::Unexplained,
            folds: 5,
            rows: Rows {
                used: 100,
                outliers: 0,
                outside_reference: 0,
            },
            windows: None,
            before: Errors::default(),
            after: Errors::default(),
            effects: vec![],
            considered: vec![],
            hypotheses: vec![],
            unattributed: Unattributed::default(),
        }
    }

    #[test]
    fn large_numbers_stand_apart() {
        let mut report = report();
        report.before.star_rms_arcsec = Some([123_456_789.5; 2]);
        report.after = Errors {
            loglik_per_frame: Some(-123_456_789.5),
            ..report.before.clone()
        };
        report.before.loglik_per_frame = Some(-987_654_321.5);
        let mut out = String::new();
        figures(&mut out, &report);
        let words: Vec<&str> = out.split_whitespace().collect();
        for word in ["123456789.500", "-987654321.5000", "-123456789.5000"] {
            assert!(words.contains(&word), "no {word} in:\n{out}");
        }
    }

    #[test]
    fn lines_and_jumps_that_are_left_are_told() {
        let mut report = report();
        report.unattributed.present = true;
        report.unattributed.lines_hz = vec![0.0125, 0.25];
        report.unattributed.jumps_s = vec![812.5];
        let mut out = String::new();
        leftover(&mut out, &report);
        assert_eq!(
            out,
            "Lines in its spectrum, Hz: 0.0125, 0.25\nJumps, at s: 812.5\n"
        );
    }
}
