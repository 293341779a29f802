//! The residual of stars over the focal plane, and over position inside a pixel.

use std::collections::BTreeMap;

use figures::{Colour, FieldBins, Figure, Mark, Panel, PhaseBins, long_arrow};
use telemetry::StarResiduals;

use super::data::{View, rms};
use super::{Page, Run};
use crate::number::short;

/// Cells to a side of the field, and of the neighbourhood of one star.
const CELLS: usize = 12;
const LOCAL: usize = 9;
/// Cells with stars below which the field is looked at star by star.
const FEW: usize = 14;
/// Stars that are looked at.
const STARS: usize = 4;
/// Bins of a pixel.
const PHASES: usize = 24;

/// The detector under the stars.
struct Detector {
    /// Half its size, px.
    half: [f64; 2],
    /// Where the centre of a pixel is in it.
    centre: f64,
    /// Where the declared model expects each row, px: measured positions hold the noise that is to be
    /// looked at, and whatever is sorted by its own noise shows a pattern.
    at: [Vec<f64>; 2],
}

fn detector(run: &Run<'_>, stars: &StarResiduals) -> Option<Detector> {
    let model = run.closed.model.camera().ok().flatten();
    let camera = run.bundle.camera.clone().or(model)?;
    let scale = camera.arcsec_per_px();
    let expected = |axis: usize, measured: &[f64]| -> Vec<f64> {
        let pairs = measured.iter().zip(&stars.before_arcsec[axis]);
        pairs.map(|(p, r)| p - r / scale[axis]).collect()
    };
    Some(Detector {
        half: camera.half_size_px(),
        centre: camera.pixel_centre(),
        at: [expected(0, &stars.x_px), expected(1, &stars.y_px)],
    })
}

pub(super) fn focal_plane(page: &mut Page, run: &Run<'_>) {
    let Some(stars) = &run.closed.stars else {
        return;
    };
    let Some(Detector { half, at, .. }) = detector(run, stars) else {
        return;
    };
    let added = !run.closed.report.effects.is_empty();
    page.section("field", "Residual over the focal plane", |page| {
        let rows: Vec<usize> = (0..stars.t_s.len()).collect();
        let field = Field::of(stars, &at, &rows, [0.0; 2], half, CELLS);
        if field.before.x.len() >= FEW {
            over_the_detector(page, &field, half, added);
        } else {
            star_by_star(page, stars, &at, added);
        }
    });
}

/// Mean residuals in cells, arcsec.
struct Field {
    before: FieldBins,
    after: FieldBins,
    /// What the scatter of the rows leaves in the mean of a cell, rms of x and y together.
    chance: [f64; 2],
}

impl Field {
    /// Of these rows, in `cells` by `cells` around `centre`.
    fn of(
        stars: &StarResiduals,
        at: &[Vec<f64>; 2],
        rows: &[usize],
        centre: [f64; 2],
        half: [f64; 2],
        cells: usize,
    ) -> Self {
        let view = View::of_stars(stars);
        let pick = |values: &[f64], less: f64| -> Vec<f64> {
            rows.iter().map(|&r| values[r] - less).collect()
        };
        let (x, y) = (pick(&at[0], centre[0]), pick(&at[1], centre[1]));
        let least = if rows.len() > 1000 { 5 } else { 2 };
        let [before, after] = [0, 1].map(|when| {
            let d = [0, 1].map(|axis| pick(&view.kept(when, axis), 0.0));
            let mut bins = FieldBins::new([&x, &y], [&d[0], &d[1]], half, cells, least);
            bins.x.iter_mut().for_each(|x| *x += centre[0]);
            bins.y.iter_mut().for_each(|y| *y += centre[1]);
            let scatter = rms(d[0].iter().copied()).hypot(rms(d[1].iter().copied()));
            (bins, scatter)
        });
        let chance = [&before, &after]
            .map(|(bins, scatter)| rms(bins.count.iter().map(|n| scatter / (*n as f64).sqrt())));
        Self {
            before: before.0,
            after: after.0,
            chance,
        }
    }

    fn rms(&self) -> [f64; 2] {
        [&self.before, &self.after].map(size)
    }
}

fn size(bins: &FieldBins) -> f64 {
    rms(bins.dx.iter().zip(&bins.dy).map(|(x, y)| x.hypot(*y)))
}

/// The length that nine of ten arrows before stay below; more where one, also after, is far longer.
fn long<'a>(fields: impl Iterator<Item = &'a Field>) -> f64 {
    let length = |f: &FieldBins| -> Vec<f64> {
        let pairs = f.dx.iter().zip(&f.dy);
        pairs.map(|(x, y)| x.hypot(*y)).collect()
    };
    let (mut before, mut longest) = (vec![], 0.0);
    for field in fields {
        before.extend(length(&field.before));
        longest = length(&field.after).into_iter().fold(longest, f64::max);
    }
    let longest = before.iter().copied().fold(longest, f64::max);
    long_arrow(before, longest).unwrap_or(f64::NAN)
}

fn arrows(panel: Panel, bins: &FieldBins, scale: f64, colour: Colour) -> Panel {
    panel.with(
        Mark::arrows([&bins.x, &bins.y], [&bins.dx, &bins.dy], "arcsec", colour)
            .to_scale(scale)
            .named("mean"),
    )
}

fn over_the_detector(page: &mut Page, field: &Field, half: [f64; 2], added: bool) {
    let scale = long(std::iter::once(field));
    let [before, after] = field.rms();
    let n = field.before.x.len();
    let mut panels = vec![arrows(
        Panel::focal_plane(if added { "before" } else { "measured" }, half),
        &field.before,
        scale,
        if added {
            Colour::BEFORE
        } else {
            Colour::MEASURED
        },
    )];
    let title = if added {
        panels.push(arrows(
            Panel::focal_plane("after, arrows to the same scale", half),
            &field.after,
            scale,
            Colour::AFTER,
        ));
        format!(
            "The mean residual of {n} cells goes from {} to {} arcsec rms (scatter alone: {})",
            short(before),
            short(after),
            short(field.chance[1])
        )
    } else {
        format!(
            "The mean residual of {n} cells is {} arcsec rms (scatter alone: {})",
            short(before),
            short(field.chance[0])
        )
    };
    page.figure(
        &Figure::new(&title, panels).sized([540.0, 560.0]),
        "Arrows: the mean residual of the rows that the declared model expects in each cell of the detector; the key is in the legend. Scatter alone: what the means of as many rows without any pattern would have.",
    );
}

fn star_by_star(page: &mut Page, stars: &StarResiduals, at: &[Vec<f64>; 2], added: bool) {
    let mut of: BTreeMap<i64, Vec<usize>> = BTreeMap::new();
    for row in (0..stars.t_s.len()).filter(|&row| !stars.outlier[row]) {
        of.entry(stars.star_id[row]).or_default().push(row);
    }
    let all = of.len();
    let mut list: Vec<(i64, Field, [[f64; 2]; 2])> = of
        .into_iter()
        .filter(|(_, rows)| rows.len() > 20)
        .map(|(star, rows)| {
            let ends = at.each_ref().map(|at| inner(&rows, at));
            let centre = ends.map(|[low, high]| 0.5 * (low + high));
            // a little room, and one scale on both axes
            let half = ends
                .iter()
                .map(|[low, high]| 0.55 * (high - low))
                .fold(0.05, f64::max);
            let field = Field::of(stars, at, &rows, centre, [half; 2], LOCAL);
            (star, field, centre.map(|c| [c - half, c + half]))
        })
        .collect();
    list.sort_by(|a, b| size(&b.1.before).total_cmp(&size(&a.1.before)));
    list.truncate(STARS);
    if list.is_empty() {
        page.paragraph("Not drawn: no star has enough rows.");
        return;
    }
    let scale = long(list.iter().map(|(_, field, _)| field));
    let panel = |star: i64, what: &str, [x, y]: [[f64; 2]; 2]| {
        Panel::map(&format!("star {star}{what}"))
            .x_over(x[0], x[1])
            .y_over(y[0], y[1])
    };
    let mut panels: Vec<Panel> = list
        .iter()
        .map(|(star, field, ends)| {
            let what = if added { ", before" } else { "" };
            let colour = if added {
                Colour::BEFORE
            } else {
                Colour::MEASURED
            };
            arrows(panel(*star, what, *ends), &field.before, scale, colour)
        })
        .collect();
    if added {
        panels.extend(list.iter().map(|(star, field, ends)| {
            arrows(
                panel(*star, ", after", *ends),
                &field.after,
                scale,
                Colour::AFTER,
            )
        }));
    }
    let mean = |k: usize| rms(list.iter().map(|(_, field, _)| field.rms()[k]));
    let title = if added {
        format!(
            "The mean residual in cells around each star goes from {} to {} arcsec rms",
            short(mean(0)),
            short(mean(1))
        )
    } else {
        format!(
            "The mean residual in cells around each star is {} arcsec rms",
            short(mean(0))
        )
    };
    let figure = Figure::new(&title, panels)
        .in_columns(list.len())
        .sized([1080.0 / list.len().max(3) as f64, 300.0]);
    page.figure(
        &figure,
        &format!(
            "The stars hardly move over the detector, so each is looked at where it was: the {} of {all} with the largest means. Arrows: the mean residual of the rows in each cell, all to one scale; the key is in the legend.",
            list.len()
        ),
    );
}

/// Where 98 % of the rows are.
fn inner(rows: &[usize], at: &[f64]) -> [f64; 2] {
    let mut values: Vec<f64> = rows.iter().map(|&r| at[r]).collect();
    values.sort_by(f64::total_cmp);
    let cut = values.len() / 100;
    [values[cut], values[values.len() - 1 - cut]]
}

pub(super) fn pixel_phase(page: &mut Page, run: &Run<'_>) {
    let Some(stars) = &run.closed.stars else {
        return;
    };
    let Some(Detector { centre, at, .. }) = detector(run, stars) else {
        return;
    };
    let added = !run.closed.report.effects.is_empty();
    let view = View::of_stars(stars);
    let mut said = vec![];
    let mut panels = vec![];
    for (axis, name) in view.axes.iter().enumerate() {
        let phase: Vec<f64> = at[axis].iter().map(|p| p + 0.5 - centre).collect();
        let bins = [0, 1].map(|when| PhaseBins::new(&phase, &view.kept(when, axis), PHASES));
        let [before, after] = bins.each_ref().map(|b| rms(b.mean.iter().copied()));
        let chance = bins.each_ref().map(|b| rms(b.sigma.iter().copied()))[usize::from(added)];
        said.push(if added {
            format!(
                "{} to {} arcsec {name} (scatter alone: {})",
                short(before),
                short(after),
                short(chance)
            )
        } else {
            format!(
                "{} arcsec {name} (scatter alone: {})",
                short(before),
                short(chance)
            )
        });
        let mut panel = Panel::phase(
            &format!("residual {name}, phase {name}"),
            "mean residual, arcsec",
        )
        .with(Mark::horizontal(0.0, Colour::INK));
        let looks: &[(usize, Colour, &str)] = if added {
            &[(0, Colour::BEFORE, "before"), (1, Colour::AFTER, "after")]
        } else {
            &[(0, Colour::MEASURED, "measured")]
        };
        for &(when, colour, label) in looks {
            let b = &bins[when];
            // beside each other, so that equal ones are both seen
            let aside = (when as f64 - 0.5) * 0.4 / PHASES as f64;
            let phase: Vec<f64> = b.phase.iter().map(|p| p + aside).collect();
            panel = panel.with(
                Mark::with_errors(&phase, &b.mean, &b.sigma, colour)
                    .named(&format!("{label} ± 1σ")),
            );
        }
        panels.push(panel);
    }
    let verb = if added { "goes from" } else { "is" };
    page.section("phase", "Residual over position inside a pixel", |page| {
        page.figure(
            &Figure::new(
                &format!("The rms over pixel phase {verb} {}", said.join(", ")),
                panels,
            )
            .sized([540.0, 320.0]),
            "Means of all stars over a 24th of a pixel, at the position that the declared model expects. Scatter alone: what such means have without any dependence on phase. An error bar takes the rows of a bin as independent.",
        );
    });
}
