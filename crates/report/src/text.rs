//! A summary that a flight analyst can read, and paste into a report.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use closed_loop::{CONFUSABLE, Closed, NEEDED_SIGMA, is_beyond_chance, p_is};
use telemetry::report::{
    Confusable, ConsideredEffect, Dependence, Errors, Report, Selector, listed,
};

use crate::number::{decimal, number, number_to, tenths};
use crate::order::by_number;
use crate::set_aside;
use crate::verdict::sentence;
use crate::why_not::in_spite_of_its_gain;
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
    trimmed(&out)
}

/// Without the blanks that empty columns leave at the end of a row.
fn trimmed(text: &str) -> String {
    let rows = text.lines();
    rows.fold(String::new(), |all, row| all + row.trim_end() + "\n")
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
            .filter(|c| c.correlation.abs() >= CONFUSABLE)
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
            if let Some(manoeuvre) = c.manoeuvre.as_ref().filter(|_| !is_told_apart(c)) {
                wrapped(out, "            ", &manoeuvre.text);
            }
        }
    }
    if !report.effects.is_empty() {
        line!(out);
    }
}

/// Whether this data tells the two apart already, and better than the manoeuvre would.
fn is_told_apart(c: &Confusable) -> bool {
    let flown = c.manoeuvre.as_ref().map_or(0.0, |m| m.sigma);
    c.separation_sigma
        .is_some_and(|here| here > NEEDED_SIGMA && here > flown)
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

/// As wide as the longest name, and at least `usual`.
fn column<'a>(names: impl Iterator<Item = &'a str>, usual: usize) -> usize {
    names
        .map(|name| name.chars().count())
        .fold(usual, usize::max)
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
    let title = "Rival explanations, rms in arcsec out of fold";
    let width = column(
        closed.rivals.iter().map(|r| r.what.as_str()),
        title.len() + 5,
    );
    let mut row = format!("{title:<0$}", width + 2);
    for axis in axes {
        let _ = write!(row, "{axis:>9}");
    }
    line!(out, "{row}{:>12}", "gain, nats");
    for rival in &closed.rivals {
        let mut row = format!("  {:<width$}", rival.what);
        for rms in &rival.rms_arcsec {
            let _ = write!(row, " {:>8}", decimal(*rms, 4));
        }
        line!(out, "{row} {:>11}", tenths(rival.delta_loglik));
    }
    line!(out);
}

/// Effects that are told of those that were not added.
const FIRST: usize = 8;
/// Columns for what a row is about.
const NAMES: usize = 26;

fn considered(out: &mut String, report: &Report) {
    let (mut tried, unseen): (Vec<_>, Vec<_>) =
        report.considered.iter().partition(|c| c.observable);
    // those without a fit of their own come last
    let gain = |c: &ConsideredEffect| c.delta_loglik.unwrap_or(f64::NEG_INFINITY);
    tried.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    if !tried.is_empty() {
        line!(
            out,
            "Considered and not added (gain in nats, its chance, size that would have shown at 5 sigma):"
        );
        let (told, more) = tried.split_at(FIRST.min(tried.len()));
        let width = column(told.iter().map(|c| c.id.as_str()), NAMES);
        for c in told {
            let size = match (&c.parameter, c.detectable, &c.unit) {
                (Some(parameter), Some(d), Some(unit)) if c.refused.is_none() => {
                    format!("{parameter} {} {unit}", number(d))
                }
                _ => String::new(),
            };
            let on = selectors(&c.selectors);
            let gain = c.delta_loglik.map_or("-".to_owned(), tenths);
            let chance = c.p_value.map_or(String::new(), p_is);
            line!(
                out,
                "  {:<width$} {gain:>8}   {chance:<11} {size}{on}",
                c.id
            );
            if let Some(why) = in_spite_of_its_gain(c, report) {
                wrapped(out, "    ", &why);
            }
        }
        if let Some(next) = more.first() {
            let above = match next.delta_loglik {
                Some(gain) => format!("none above {} nats", tenths(gain)),
                None => "without a fit of their own".to_owned(),
            };
            line!(out, "  and {} more, {above}", more.len());
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
    let (noise, shared) = (&left.noise_depends_on, &left.shared_noise_depends_on);
    let of_noise = |d: &Dependence| noise.contains(d) || shared.contains(d);
    let told = left.depends_on.iter().filter(|d| is_beyond_chance(d));
    let told: Vec<&Dependence> = told.collect();
    if told.iter().any(|d| !of_noise(d)) {
        line!(
            out,
            "What is left follows (share of its variance, out of fold):"
        );
        follows(out, told);
    }
    if !noise.is_empty() {
        line!(out, "The noise level follows (rms change of its variance):");
        follows(out, noise.iter().collect());
    }
    if !shared.is_empty() {
        line!(
            out,
            "The noise that all stars of a frame share follows (rms change of its variance):"
        );
        follows(out, shared.iter().collect());
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

fn follows(out: &mut String, mut told: Vec<&Dependence>) {
    told.truncate(5);
    let width = column(told.iter().map(|d| d.variable.as_str()), 34);
    for d in told {
        line!(
            out,
            "  {:<width$} {:>6.1} %   {}",
            d.variable,
            100.0 * d.variance_explained,
            p_is(d.p_value)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> Report {
        crate::bare::report(telemetry::report::Verdict::Unexplained)
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

    fn tried(id: &str, delta_loglik: Option<f64>) -> ConsideredEffect {
        ConsideredEffect {
            id: id.to_owned(),
            selectors: BTreeMap::new(),
            delta_loglik,
            p_value: delta_loglik.map(|_| 0.5),
            observable: true,
            detectable: Some(0.2),
            needed: None,
            against: None,
            parameter: Some("scale".to_owned()),
            unit: Some(String::new()),
            refused: None,
        }
    }

    /// Rows that are not printed are counted, and what has no gain is not more than what loses a little.
    #[test]
    fn what_was_considered_is_all_accounted_for() {
        let mut report = report();
        report.considered = (0..7).map(|k| tried("a", Some(f64::from(k)))).collect();
        report.considered.push(tried("without", None));
        report
            .considered
            .push(tried("next_to_nothing", Some(-0.04)));
        report.considered.push(tried("loses", Some(-3.0)));
        report.considered[6].p_value = Some(2e-5);
        let mut out = String::new();
        considered(&mut out, &report);
        let out = trimmed(&out);
        assert!(!out.contains("-0.0"), "{out}");
        assert!(
            !out.contains("  without") && out.contains("next_to_nothing"),
            "{out}"
        );
        assert!(
            out.contains("  and 2 more, none above -3.0 nats\n"),
            "{out}"
        );
        assert!(
            out.contains("p = 2.0e-5") && out.contains("visible alone, but"),
            "{out}"
        );
        assert!(out.lines().all(|row| row == row.trim_end()), "{out}");
    }

    /// Asked about is not alike; and nobody needs to fly what the data has told better.
    #[test]
    fn what_is_told_apart_is_no_likeness() {
        let of = |id: &str, correlation: f64, here: f64| Confusable {
            id: id.to_owned(),
            selectors: BTreeMap::new(),
            correlation,
            delta_loglik: None,
            separation_sigma: Some(here),
            manoeuvre: Some(telemetry::report::Manoeuvre {
                kind: "slew".to_owned(),
                axis: [0.0, 0.0, 1.0],
                rate_deg_s: 0.2,
                duration_s: 60.0,
                ramp_s: 12.0,
                sigma: 11.0,
                text: format!("a slew tells {id}"),
            }),
        };
        let mut report = report();
        report.effects = vec![telemetry::report::FoundEffect {
            id: "rolling_shutter".to_owned(),
            selectors: BTreeMap::new(),
            parameters: BTreeMap::new(),
            delta_loglik: 50.0,
            p_value: 1e-9,
            variance_explained: None,
            confusable_with: vec![
                of("time_tag_offset", 0.6, 584.0),
                of("step_misalignment", -0.4, 7.0),
                of("exposure_smear", 0.002, 3.0),
            ],
        }];
        let mut out = String::new();
        effects(&mut out, &report);
        let alike = "looks like time_tag_offset (+0.60), step_misalignment (-0.40)\n";
        assert!(out.contains(alike), "{out}");
        assert!(!out.contains("a slew tells time_tag_offset"), "{out}");
        assert!(out.contains("a slew tells step_misalignment"), "{out}");
        assert!(out.contains("a slew tells exposure_smear"), "{out}");
    }

    /// A long name moves no column of the others.
    #[test]
    fn columns_are_as_wide_as_their_names() {
        let long = "housekeeping:a_temperature_somewhere*housekeeping:another";
        let of = |variable: &str| Dependence {
            variable: variable.to_owned(),
            variance_explained: 0.05,
            p_value: 1e-6,
        };
        let mut out = String::new();
        let all = [of(long), of("rate")];
        follows(&mut out, all.iter().collect());
        let at: Vec<_> = out.lines().map(|row| row.find('%')).collect();
        assert!(at[0].is_some() && at[0] == at[1], "{out}");
    }
}
