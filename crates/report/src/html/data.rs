//! Rows behind the numbers: what was used, folds, stars, the better model; and the one view that all
//! pictures take of either kind of residual.

use std::collections::BTreeMap;

use telemetry::{AttitudeResiduals, StarResiduals};

use super::write::{Cell, count, escaped};
use super::{Page, Run};
use crate::number::short;
use crate::set_aside;
use crate::windows;

/// Longest model that is shown, bytes.
const MODEL: usize = 20_000;
/// Stars with a row each.
const STARS: usize = 24;

/// Residuals of one kind, rows in the order of time.
pub(super) struct View<'a> {
    /// `star` or `attitude`.
    pub(super) kind: &'static str,
    /// `along x` and so on.
    pub(super) axes: &'static [&'static str],
    pub(super) t_s: &'a [f64],
    before: &'a [Vec<f64>],
    after: &'a [Vec<f64>],
    outlier: &'a [bool],
    fold: &'a [u32],
}

impl<'a> View<'a> {
    /// Names of the axes of attitudes.
    pub(super) const ATTITUDE: &'static [&'static str] = &["about X", "about Y", "about Z"];

    pub(super) fn of_stars(rows: &'a StarResiduals) -> Self {
        Self {
            kind: "star",
            axes: &["along x", "along y"],
            t_s: &rows.t_s,
            before: &rows.before_arcsec,
            after: &rows.after_arcsec,
            outlier: &rows.outlier,
            fold: &rows.fold,
        }
    }

    pub(super) fn of_attitude(rows: &'a AttitudeResiduals) -> Self {
        Self {
            kind: "attitude",
            axes: Self::ATTITUDE,
            t_s: &rows.t_s,
            before: &rows.before_arcsec,
            after: &rows.after_arcsec,
            outlier: &rows.outlier,
            fold: &rows.fold,
        }
    }

    /// Both kinds, where they are.
    pub(super) fn all(run: &Run<'a>) -> Vec<Self> {
        let stars = run.closed.stars.as_ref().map(Self::of_stars);
        let attitude = run.closed.attitude.as_ref().map(Self::of_attitude);
        stars.into_iter().chain(attitude).collect()
    }

    /// Residual of an axis before (0) or after (1), outliers NaN.
    pub(super) fn kept(&self, when: usize, axis: usize) -> Vec<f64> {
        let values = [self.before, self.after][when];
        let pairs = values[axis].iter().zip(self.outlier);
        pairs
            .map(|(v, out)| if *out { f64::NAN } else { *v })
            .collect()
    }

    /// Rows left out.
    pub(super) fn outliers(&self) -> usize {
        self.outlier.iter().filter(|out| **out).count()
    }

    /// Smallest and largest time, s.
    pub(super) fn span_s(&self) -> [f64; 2] {
        self.t_s
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], t| {
                [low.min(*t), high.max(*t)]
            })
    }
}

/// Root mean square of the finite values; NaN without any.
pub(super) fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for v in values.filter(|v| v.is_finite()) {
        sum += v * v;
        n += 1.0;
    }
    (sum / n).sqrt()
}

/// What the numbers rest on.
pub(super) fn in_a_line(page: &mut Page, run: &Run<'_>) {
    let report = &run.closed.report;
    let spans = View::all(run).into_iter().map(|view| view.span_s());
    let [from, to] = spans.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], s| {
        [low.min(s[0]), high.max(s[1])]
    });
    let span = to - from;
    let over = match span {
        s if s > 2.0 * 86400.0 => format!(" over {} d", short(s / 86400.0)),
        s if s > 2.0 * 3600.0 => format!(" over {} h", short(s / 3600.0)),
        s if s.is_finite() => format!(" over {} s", short(s)),
        _ => String::new(),
    };
    page.raw(&format!(
        "<p>{} rows{over}, {} outliers left out, {} outside the reference; {} folds, every figure out of fold.</p>",
        count("/rows/used", report.rows.used),
        count("/rows/outliers", report.rows.outliers),
        count("/rows/outside_reference", report.rows.outside_reference),
        count("/folds", report.folds),
    ));
    for star in set_aside::stars(run.closed.stars.as_ref()) {
        page.paragraph(&star);
    }
    for sentence in windows::sentences(report.windows.as_ref()) {
        page.paragraph(&sentence);
    }
}

/// Rows, folds and stars.
pub(super) fn rows(page: &mut Page, run: &Run<'_>) {
    page.section("rows", "Rows, folds and stars", |page| {
        page.paragraph("Outliers are rows beyond 8 robust σ of the residual before; they are left out of every figure, the same rows before and after, and flagged in the tables of residuals.");
        page.raw(&format!("<p>The bundle holds: {}.</p>", escaped(&holds(run))));
        let meta = &run.bundle.meta;
        for (name, text) in [("Source", &meta.source), ("Licence", &meta.licence)] {
            if let Some(text) = text {
                page.raw(&format!("<p>{name}: {}</p>", escaped(text)));
            }
        }
        for view in View::all(run) {
            folds(page, &view);
        }
        if let Some(stars) = &run.closed.stars {
            by_star(page, stars);
        }
    });
}

fn holds(run: &Run<'_>) -> String {
    let bundle = run.bundle;
    let mut out = vec![];
    if let Some(stars) = &bundle.stars {
        out.push(format!(
            "{} star measurements in {} frames",
            stars.rows(),
            stars.frames()
        ));
    }
    if let Some(attitude) = &bundle.attitude {
        out.push(format!("{} attitudes", attitude.t_s.len()));
    }
    if let Some(reference) = &bundle.reference {
        out.push(format!("a reference of {} attitudes", reference.t_s.len()));
    }
    let there = [
        (bundle.catalog.is_some(), "a catalogue"),
        (bundle.images.is_some(), "raw pixel windows"),
        (bundle.rates.is_some(), "gyro rates"),
        (bundle.housekeeping.is_some(), "housekeeping"),
    ];
    out.extend(there.iter().filter(|t| t.0).map(|t| t.1.to_owned()));
    out.join(", ")
}

fn folds(page: &mut Page, view: &View<'_>) {
    let mut blocks: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (row, fold) in view.fold.iter().enumerate() {
        blocks.entry(*fold).or_default().push(row);
    }
    // a snapshot a fold: its rows are in the parquet file
    if blocks.len() > 12 {
        return;
    }
    let mut head = vec![
        "fold".to_owned(),
        "from, s".to_owned(),
        "to, s".to_owned(),
        "rows".to_owned(),
    ];
    for axis in view.axes {
        head.push(format!("{axis}, before"));
        head.push("after".to_owned());
    }
    let kept: Vec<[Vec<f64>; 2]> = (0..view.axes.len())
        .map(|axis| [0, 1].map(|when| view.kept(when, axis)))
        .collect();
    let table = blocks
        .iter()
        .map(|(fold, rows)| {
            let times = rows.iter().map(|&r| view.t_s[r]);
            let used = rows.iter().filter(|&&r| !view.outlier[r]).count();
            let mut row = vec![
                Cell::text(&fold.to_string()),
                Cell::number(&seconds(times.clone().fold(f64::INFINITY, f64::min))),
                Cell::number(&seconds(times.fold(f64::NEG_INFINITY, f64::max))),
                Cell::number(&used.to_string()),
            ];
            for axis in &kept {
                row.extend(
                    axis.iter()
                        .map(|values| Cell::number(&short(rms(rows.iter().map(|&r| values[r]))))),
                );
            }
            row
        })
        .collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    page.table(
        &format!(
            "The {} residual of each fold, arcsec rms, predicted from the other folds; rows without any outlier.",
            view.kind
        ),
        &head,
        table,
    );
}

fn seconds(t: f64) -> String {
    format!("{t:.1}").replace('-', "−")
}

fn by_star(page: &mut Page, stars: &StarResiduals) {
    let view = View::of_stars(stars);
    let mut of: BTreeMap<(i64, i32), Vec<usize>> = BTreeMap::new();
    for row in (0..stars.t_s.len()).filter(|&row| !stars.outlier[row]) {
        of.entry((stars.star_id[row], stars.slot[row]))
            .or_default()
            .push(row);
    }
    let kept: Vec<[Vec<f64>; 2]> = (0..2)
        .map(|axis| [0, 1].map(|when| view.kept(when, axis)))
        .collect();
    let all = of.len();
    let mut list: Vec<(_, Vec<usize>, [f64; 4])> = of
        .into_iter()
        .map(|(key, rows)| {
            let value = |axis: usize, when: usize| rms(rows.iter().map(|&r| kept[axis][when][r]));
            let four = [value(0, 0), value(0, 1), value(1, 0), value(1, 1)];
            (key, rows, four)
        })
        .collect();
    list.sort_by(|a, b| (b.2[1].hypot(b.2[3])).total_cmp(&a.2[1].hypot(a.2[3])));
    list.truncate(STARS);
    let some = if all > STARS {
        format!(" The first {STARS} of {all}.")
    } else {
        String::new()
    };
    let rows = list
        .into_iter()
        .map(|((star, slot), rows, four)| {
            let mut row = vec![
                Cell::text(&star.to_string()),
                Cell::number(&slot.to_string()),
                Cell::number(&rows.len().to_string()),
            ];
            row.extend(four.iter().map(|v| Cell::number(&short(*v))));
            row
        })
        .collect();
    page.table(
        &format!("The residual of each star, arcsec rms, largest after first.{some}"),
        &[
            "star",
            "slot",
            "rows",
            "along x, before",
            "after",
            "along y, before",
            "after",
        ],
        rows,
    );
}

/// The better model, as it is in its file.
pub(super) fn model(page: &mut Page, run: &Run<'_>) {
    let text = run.closed.model.to_toml();
    page.section("model", "The model with what was added", |page| {
        if text.len() > MODEL {
            page.paragraph("See model.toml beside this page: it is too long to be shown.");
        } else {
            page.raw(&format!("<pre>{}</pre>", escaped(text.trim_end())));
        }
    });
}
