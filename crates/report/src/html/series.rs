//! The residual against time.

use figures::{Axis, Colour, Envelope, Figure, Mark, Panel};
use rayon::prelude::*;

use super::data::View;
use super::{Page, Run};
use crate::number::short;

/// Rows up to which single points are drawn.
const POINTS: usize = 2000;
/// Stretches of an envelope, and of the medians that the title speaks of.
const STRETCHES: usize = 300;
const MEDIANS: usize = 40;

pub(super) fn over_time(page: &mut Page, run: &Run<'_>) {
    page.section("time", "Residual against time", |page| {
        for view in View::all(run) {
            one(page, &view, !run.closed.report.effects.is_empty());
        }
    });
}

fn one(page: &mut Page, view: &View<'_>, added: bool) {
    let [first, last] = view.span_s();
    let (unit, seconds) = match last - first {
        span if span > 4.0 * 86400.0 => ("d", 86400.0),
        span if span > 3.0 * 3600.0 => ("h", 3600.0),
        _ => ("s", 1.0),
    };
    let t: Vec<f64> = view.t_s.iter().map(|t| t / seconds).collect();
    let axes: Vec<(String, Panel)> = view
        .axes
        .par_iter()
        .enumerate()
        .map(|(axis, name)| one_axis(view, added, (axis, name), (unit, &t)))
        .collect();
    let (said, panels): (Vec<_>, Vec<_>) = axes.into_iter().unzip();
    let verb = if added { "go from" } else { "are" };
    let figure = Figure::new(
        &format!(
            "Slow swings of the {} residual {verb} {}",
            view.kind,
            said.join(", ")
        ),
        panels,
    )
    .in_columns(1)
    .sized([1080.0, 210.0]);
    let how = if view.t_s.len() > POINTS {
        format!("Medians, and the middle 90 % of the rows, over each {STRETCHES}th of the span.")
    } else {
        "A point for each row, and the medians.".to_owned()
    };
    page.figure(
        &figure,
        &format!(
            "Swings: from the lowest to the highest median of {MEDIANS} stretches of the span, peak to peak. {how} A gap is a gap in the data; {} rows with an outlier are left out.",
            view.outliers()
        ),
    );
}

/// What there is to say of an axis, and its panel.
fn one_axis(
    view: &View<'_>,
    added: bool,
    (axis, name): (usize, &str),
    (unit, t): (&str, &[f64]),
) -> (String, Panel) {
    let kept = [0, 1].map(|when| view.kept(when, axis));
    let swing = kept.each_ref().map(|values| swing(t, values));
    let said = if added {
        format!("{} to {} arcsec {name}", short(swing[0]), short(swing[1]))
    } else {
        format!("{} arcsec {name}", short(swing[0]))
    };
    let y = Axis::linear("residual, arcsec");
    let mut panel = Panel::new(name, Axis::linear(&format!("time, {unit}")), y);
    let looks: &[(usize, Colour, &str)] = if added {
        &[(0, Colour::BEFORE, "before"), (1, Colour::AFTER, "after")]
    } else {
        &[(0, Colour::MEASURED, "measured")]
    };
    for &(when, colour, label) in looks {
        panel = drawn(panel, t, &kept[when], colour, label);
    }
    (said, panel)
}

/// Before is an area or points, after lies over it as lines or points.
fn drawn(panel: Panel, t: &[f64], y: &[f64], colour: Colour, label: &str) -> Panel {
    if t.len() <= POINTS {
        let e = Envelope::new(t, y, MEDIANS);
        return panel
            .with(Mark::points(t, y, 1.2, colour).at_opacity(0.6).named(label))
            .with(
                Mark::line(&e.x, &e.median, colour)
                    .wide(2.2)
                    .named(&format!("{label}, medians")),
            );
    }
    let e = Envelope::new(t, y, STRETCHES);
    let middle = format!("{label}, middle 90 %");
    let panel = if colour == Colour::AFTER {
        let ends = vec![[e.x.clone(), e.low.clone()], [e.x.clone(), e.high.clone()]];
        panel.with(Mark::lines(ends, 0.9, colour).named(&middle))
    } else {
        panel.with(
            Mark::band(&e.x, &e.low, &e.high, colour)
                .at_opacity(0.35)
                .named(&middle),
        )
    };
    panel.with(
        Mark::line(&e.x, &e.median, colour)
            .wide(1.9)
            .named(&format!("{label}, median")),
    )
}

/// Range of the medians over stretches of the span.
fn swing(t: &[f64], y: &[f64]) -> f64 {
    let medians = Envelope::new(t, y, MEDIANS).median;
    let finite = medians.iter().filter(|v| v.is_finite());
    let [low, high] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
        [low.min(*v), high.max(*v)]
    });
    (high - low).max(0.0)
}
