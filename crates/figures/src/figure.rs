//! Panels side by side, with title, legend and a note below.
//!
//! Not physics: drawing.

use std::fmt::Write as _;

use crate::axis::{Laid, Tick};
use crate::mark::{Mark, Shape};
use crate::paint::{self, Arrows, Frame, escaped, text_px};
use crate::{Colour, Panel};

/// Room left of a frame, above, right and below it, px.
const LEFT: f64 = 68.0;
const ABOVE: f64 = 26.0;
const RIGHT: f64 = 16.0;
const BELOW: f64 = 44.0;
/// Room for a bar of colours, px.
const BAR: f64 = 74.0;
/// Height of a row of the legend, px.
const LEGEND: f64 = 18.0;
/// Height of a line of the title, px.
const TITLE: f64 = 18.0;
/// Height of a line of the note, px.
const NOTE: f64 = 16.0;
/// Edge of the whole figure, px.
const EDGE: f64 = 10.0;

/// A figure: panels in rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    title: String,
    note: Option<String>,
    panels: Vec<Panel>,
    columns: usize,
    panel_px: [f64; 2],
}

impl Figure {
    /// Panels in one row, 460 by 340 px each; more than three take several rows.
    #[must_use]
    pub fn new(title: &str, panels: Vec<Panel>) -> Self {
        Self {
            title: title.to_owned(),
            note: None,
            columns: panels.len().clamp(1, 3),
            panels,
            panel_px: [460.0, 340.0],
        }
    }

    /// The same with so many panels in a row.
    #[must_use]
    pub fn in_columns(self, columns: usize) -> Self {
        Self {
            columns: columns.max(1),
            ..self
        }
    }

    /// The same with panels of this size, px, axes and labels in it.
    #[must_use]
    pub fn sized(self, panel_px: [f64; 2]) -> Self {
        Self { panel_px, ..self }
    }

    /// The same with a sentence below.
    #[must_use]
    pub fn noted(self, note: &str) -> Self {
        Self {
            note: Some(note.to_owned()),
            ..self
        }
    }

    /// The figure as an SVG document, which may stand inside HTML as it is.
    #[must_use]
    pub fn svg(&self) -> String {
        let shared = self.shared_legend();
        let width = 2.0 * EDGE + self.columns as f64 * self.panel_px[0];
        let legend_rows = if shared {
            rows_of(&self.panels[0].marks, width - 2.0 * EDGE)
        } else {
            vec![]
        };
        // bold 14 px is wider than the 11 px of the estimate
        let title = wrapped(&self.title, (width - 2.0 * EDGE) / 1.36);
        let below_title = EDGE + 6.0 + TITLE * title.len().max(1) as f64;
        let head = below_title + legend_rows.len() as f64 * LEGEND + 4.0;
        let rows = self.panels.len().div_ceil(self.columns);
        let note = self
            .note
            .as_deref()
            .map_or_else(Vec::new, |note| wrapped(note, width - 2.0 * EDGE));
        let height = head + rows as f64 * self.panel_px[1] + note.len() as f64 * NOTE + EDGE;
        let mut out = String::new();
        // writing to a string cannot fail
        let _ = write!(
            out,
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0}" height="{height:.0}" viewBox="0 0 {width:.0} {height:.0}" font-family="DejaVu Sans, Verdana, Arial, sans-serif" font-size="11" fill="{}" role="img"><title>{}</title><rect width="100%" height="100%" fill="#ffffff"/>"##,
            Colour::INK.hex(),
            escaped(&self.title),
        );
        for (k, line) in title.iter().enumerate() {
            let y = EDGE + 14.0 + TITLE * k as f64;
            let _ = write!(
                out,
                r#"<text x="{EDGE}" y="{y}" font-size="14" font-weight="bold">{}</text>"#,
                escaped(line)
            );
        }
        legend(&mut out, &legend_rows, [EDGE, below_title], None);
        // panels stay comparable: all of them show as much more as the one that needs it most
        let each = self.panels.iter().enumerate().map(|(k, panel)| {
            let (column, row) = (k % self.columns, k / self.columns);
            let corner = [
                EDGE + column as f64 * self.panel_px[0],
                head + row as f64 * self.panel_px[1],
            ];
            Placed::new(panel, corner, self.panel_px, !shared)
        });
        let each: Vec<Placed<'_>> = each.collect();
        let factor = each.iter().map(Placed::widening).fold(1.0, f64::max);
        for placed in each {
            draw(&mut out, placed, factor);
        }
        for (k, line) in note.iter().enumerate() {
            let y = height - EDGE - (note.len() - 1 - k) as f64 * NOTE - 2.0;
            let _ = write!(
                out,
                r#"<text x="{EDGE}" y="{y:.1}">{}</text>"#,
                escaped(line)
            );
        }
        out.push_str("</svg>\n");
        out
    }

    /// Whether one legend says it for all panels.
    fn shared_legend(&self) -> bool {
        let looks = |panel: &Panel| -> Vec<(Option<String>, Colour)> {
            panel
                .marks
                .iter()
                .filter(|mark| mark.name.is_some())
                .map(|mark| (mark.name.clone(), mark.colour))
                .collect()
        };
        let arrows = |mark: &Mark| matches!(mark.shape, Shape::Arrows { .. });
        let Some(first) = self.panels.first() else {
            return false;
        };
        self.panels.len() > 1
            && self
                .panels
                .iter()
                .all(|panel| looks(panel) == looks(first) && !panel.marks.iter().any(arrows))
    }
}

/// A panel at its place.
struct Placed<'a> {
    panel: &'a Panel,
    corner: [f64; 2],
    /// Marks of the legend, where it has one of its own.
    legend: Vec<Vec<&'a Mark>>,
    frame: Frame,
}

impl<'a> Placed<'a> {
    fn new(panel: &'a Panel, corner: [f64; 2], size: [f64; 2], own_legend: bool) -> Self {
        let legend = if own_legend {
            rows_of(&panel.marks, size[0] - LEFT - RIGHT)
        } else {
            vec![]
        };
        let cells = |mark: &Mark| matches!(mark.shape, Shape::Cells { .. });
        let bar = panel.marks.iter().any(cells);
        let room_right = RIGHT + if bar { BAR } else { 0.0 };
        let above = ABOVE + legend.len() as f64 * LEGEND;
        let mut at = [corner[0] + LEFT, corner[1] + above];
        let mut px = [size[0] - LEFT - room_right, size[1] - above - BELOW];
        let mut x = Laid::new(&panel.x, panel.data(0), [0.0, px[0]]);
        let mut y = Laid::new(&panel.y, panel.data(1), [px[1], 0.0]);
        if panel.equal {
            let scale = x.px_per_unit().min(y.px_per_unit());
            let wanted = [&x, &y].map(|laid| scale * (laid.ends()[1] - laid.ends()[0]));
            at[0] += 0.5 * (px[0] - wanted[0]);
            px = wanted;
        }
        x = Laid::new(&panel.x, panel.data(0), [at[0], at[0] + px[0]]).with_ends(x.ends());
        y = Laid::new(&panel.y, panel.data(1), [at[1] + px[1], at[1]]).with_ends(y.ends());
        Self {
            panel,
            corner,
            legend,
            frame: Frame { at, px, x, y },
        }
    }

    /// How much wider the axes have to be for whole arrows.
    fn widening(&self) -> f64 {
        let of = |mark| Some(Arrows::of(mark, &self.frame)?.widening(mark, &self.frame));
        self.panel.marks.iter().filter_map(of).fold(1.0, f64::max)
    }
}

/// Makes the axes wider, both alike; gives the corners of what was shown before.
fn widen(frame: &mut Frame, factor: f64) -> [[f64; 2]; 2] {
    let [fx, fy] = frame.at;
    let [hx, hy] = frame.px.map(|px| 0.5 * px);
    for laid in [&mut frame.x, &mut frame.y] {
        let [low, high] = laid.ends();
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low) * factor);
        *laid = laid.clone().with_ends([middle - half, middle + half]);
    }
    let (cx, cy) = (fx + hx, fy + hy);
    let (rx, ry) = (hx / factor, hy / factor);
    [[cx - rx, cy - ry], [cx + rx, cy + ry]]
}

/// Paints a panel; the axes of arrows are made wider by `factor`.
fn draw(out: &mut String, placed: Placed<'_>, factor: f64) {
    let Placed {
        panel,
        corner,
        legend: legend_rows,
        mut frame,
    } = placed;
    let bar = panel.marks.iter().find_map(|mark| match &mark.shape {
        Shape::Cells { scale, label, .. } => Some((*scale, label.as_str())),
        _ => None,
    });
    let _ = write!(
        out,
        r#"<text x="{:.1}" y="{:.1}" font-size="12" font-weight="bold">{}</text>"#,
        corner[0] + LEFT,
        corner[1] + 17.0,
        escaped(&panel.title)
    );
    let arrows = panel.marks.iter().find_map(|mark| Arrows::of(mark, &frame));
    let inner = (arrows.is_some() && factor > 1.0).then(|| widen(&mut frame, factor));
    legend(
        out,
        &legend_rows,
        [corner[0] + LEFT, corner[1] + ABOVE - 2.0],
        arrows.as_ref(),
    );
    axes(out, panel, &frame);
    let [fx, fy] = frame.at;
    let [fw, fh] = frame.px;
    let _ = write!(
        out,
        r#"<svg x="{fx:.1}" y="{fy:.1}" width="{fw:.1}" height="{fh:.1}" viewBox="{fx:.1} {fy:.1} {fw:.1} {fh:.1}" overflow="hidden">"#
    );
    if let Some([[x0, y0], [x1, y1]]) = inner.filter(|_| panel.edged) {
        let _ = write!(
            out,
            r##"<path d="M{x0:.1} {y0:.1}H{x1:.1}V{y1:.1}H{x0:.1}Z" fill="none" stroke="#60666e" stroke-dasharray="2 3"/>"##
        );
    }
    for mark in &panel.marks {
        paint::mark(out, mark, &frame);
    }
    let _ = write!(
        out,
        r##"</svg><rect x="{fx:.1}" y="{fy:.1}" width="{fw:.1}" height="{fh:.1}" fill="none" stroke="#60666e"/>"##
    );
    if let Some((scale, label)) = bar {
        colour_bar(out, &frame, scale, label);
    }
}

fn axes(out: &mut String, panel: &Panel, frame: &Frame) {
    let [fx, fy] = frame.at;
    let [fw, fh] = frame.px;
    let grid = |tick: &Tick| {
        if tick.text.is_some() {
            "#dfe3e8"
        } else {
            "#f0f2f4"
        }
    };
    for tick in frame.x.ticks(fw / 62.0) {
        let px = tick.px;
        let _ = write!(
            out,
            r#"<path d="M{px:.1} {fy:.1}v{fh:.1}" stroke="{}"/>"#,
            grid(&tick)
        );
        if let Some(text) = &tick.text {
            let _ = write!(
                out,
                r#"<text x="{px:.1}" y="{:.1}" text-anchor="middle">{text}</text>"#,
                fy + fh + 15.0
            );
        }
    }
    for tick in frame.y.ticks(fh / 28.0) {
        let px = tick.px;
        let _ = write!(
            out,
            r#"<path d="M{fx:.1} {px:.1}h{fw:.1}" stroke="{}"/>"#,
            grid(&tick)
        );
        if let Some(text) = &tick.text {
            let _ = write!(
                out,
                r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{text}</text>"#,
                fx - 6.0,
                px + 4.0
            );
        }
    }
    let _ = write!(
        out,
        r#"<text x="{:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
        fx + 0.5 * fw,
        fy + fh + 33.0,
        escaped(&panel.x.label)
    );
    let (lx, ly) = (fx - 52.0, fy + 0.5 * fh);
    let _ = write!(
        out,
        r#"<text x="{lx:.1}" y="{ly:.1}" text-anchor="middle" transform="rotate(-90 {lx:.1} {ly:.1})">{}</text>"#,
        escaped(&panel.y.label)
    );
}

fn colour_bar(out: &mut String, frame: &Frame, scale: crate::Scale, label: &str) {
    const STEPS: usize = 48;
    let [low, high] = scale.ends();
    let (bx, fy, fh) = (frame.at[0] + frame.px[0] + 12.0, frame.at[1], frame.px[1]);
    let step = fh / STEPS as f64;
    for k in 0..STEPS {
        let value = low + (high - low) * (k as f64 + 0.5) / STEPS as f64;
        let _ = write!(
            out,
            r#"<rect x="{bx:.1}" y="{:.2}" width="12" height="{:.2}" fill="{}"/>"#,
            fy + fh - (k + 1) as f64 * step,
            step + 0.3,
            scale.colour(value).hex()
        );
    }
    let axis = crate::Axis::linear(label).over(low, high);
    for tick in Laid::new(&axis, None, [fy + fh, fy]).ticks(fh / 38.0) {
        let _ = write!(
            out,
            r#"<text x="{:.1}" y="{:.1}">{}</text>"#,
            bx + 16.0,
            tick.px + 4.0,
            tick.text.unwrap_or_default()
        );
    }
    let (lx, ly) = (bx + 62.0, fy + 0.5 * fh);
    let _ = write!(
        out,
        r#"<text x="{lx:.1}" y="{ly:.1}" text-anchor="middle" transform="rotate(-90 {lx:.1} {ly:.1})">{}</text>"#,
        escaped(label)
    );
}

/// Marks with a name, in rows that fit into `width`.
fn rows_of(marks: &[Mark], width: f64) -> Vec<Vec<&Mark>> {
    let mut rows: Vec<Vec<&Mark>> = vec![];
    let mut used = f64::INFINITY;
    for mark in marks.iter().filter(|mark| mark.name.is_some()) {
        let needs = entry_px(mark);
        match rows.last_mut() {
            Some(row) if used + needs <= width => {
                row.push(mark);
                used += needs;
            }
            _ => {
                rows.push(vec![mark]);
                used = needs;
            }
        }
    }
    rows
}

/// Width of an entry, px; arrows have their key behind their name.
fn entry_px(mark: &Mark) -> f64 {
    let name = mark.name.as_deref().unwrap_or_default();
    let key = match &mark.shape {
        Shape::Arrows { unit, .. } => 60.0 + text_px(unit),
        _ => 0.0,
    };
    48.0 + text_px(name) + key
}

fn legend(out: &mut String, rows: &[Vec<&Mark>], at: [f64; 2], arrows: Option<&Arrows>) {
    for (k, row) in rows.iter().enumerate() {
        let mut x = at[0];
        let y = at[1] + (k as f64 + 0.5) * LEGEND;
        for mark in row {
            let name = mark.name.as_deref().unwrap_or_default();
            paint::swatch(out, mark, [x, y], arrows);
            let key = match (&mark.shape, arrows) {
                (Shape::Arrows { .. }, Some(arrows)) => format!(", key {}", arrows.key_text()),
                _ => String::new(),
            };
            let _ = write!(
                out,
                r#"<text x="{:.1}" y="{:.1}">{}{}</text>"#,
                x + 32.0,
                y + 4.0,
                escaped(name),
                escaped(&key)
            );
            x += entry_px(mark);
        }
    }
}

/// Words in lines of at most `width` px.
fn wrapped(text: &str, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = vec![];
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_px(line) + text_px(word) + 6.0 <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Axis, Scale};

    fn every_mark() -> Panel {
        let x = [0.0, 1.0, 2.0, f64::NAN, 4.0];
        let y = [1.0, 3.0, 2.0, 5.0, -1.0];
        Panel::new(
            "all < & >",
            Axis::linear("x, s"),
            Axis::linear("y, \"arcsec\""),
        )
        .with(Mark::band(&x, &y, &y.map(|v| v + 1.0), Colour::DRAWS).named("band"))
        .with(Mark::draws(&x, &[y.to_vec(), y.to_vec()], Colour::DRAWS).named("draws"))
        .with(Mark::line(&x, &y, Colour::MODEL).dashed().named("line"))
        .with(Mark::points(&x, &y, 2.0, Colour::MEASURED).named("points"))
        .with(Mark::with_errors(&x, &y, &[0.5; 5], Colour::BOUND).named("errors"))
        .with(Mark::arrows([&x, &y], [&y, &x], "arcsec", Colour::INK).named("arrows"))
        .with(Mark::cells(
            [&x, &y],
            [0.2, 0.2],
            &y,
            Scale::Diverging(3.0),
            "value, DN",
        ))
        .with(Mark::vertical(1.5, Colour::INK))
        .with(Mark::horizontal(0.5, Colour::INK).named("rule"))
    }

    /// Every number is finite, every tag closed, and what a reader needs is there.
    #[test]
    fn the_document_is_whole() {
        let figure = Figure::new("A & B", vec![every_mark(), every_mark()]).noted("One sentence.");
        let svg = figure.svg();
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        for wanted in [
            "A &amp; B",
            "all &lt; &amp; &gt;",
            "x, s",
            "&quot;arcsec&quot;",
            "value, DN",
            "One sentence.",
        ] {
            assert!(svg.contains(wanted), "no {wanted}");
        }
        let mut open = vec![];
        for tag in svg.split('<').skip(1) {
            let name: &str = tag.split([' ', '>', '/']).next().unwrap_or_default();
            if let Some(closed) = tag.strip_prefix('/') {
                let closed = closed.split('>').next().unwrap_or_default();
                assert_eq!(open.pop(), Some(closed.to_owned()));
            } else if !tag.split('>').next().unwrap_or_default().ends_with('/') {
                open.push(name.to_owned());
            }
        }
        assert!(open.is_empty(), "left open: {open:?}");
        assert_eq!(svg, figure.svg(), "the same figure twice");
    }

    #[test]
    fn empty_figures_are_drawn() {
        let none = Figure::new("none", vec![]).svg();
        assert!(none.ends_with("</svg>\n"));
        let bare = Figure::new("bare", vec![Panel::psd("x", "arcsec²/Hz")]).svg();
        assert!(bare.contains("frequency, Hz") && !bare.contains("NaN"));
        let zeros = Panel::psd("x", "1").with(Mark::line(&[1.0, 2.0], &[0.0, -1.0], Colour::MODEL));
        assert!(!Figure::new("zeros", vec![zeros]).svg().contains("NaN"));
    }

    /// Two panels of one legend share it; of two legends each has its own.
    #[test]
    fn one_legend_says_it_for_all() {
        let panel = |name: &str| {
            Panel::time("t", "arcsec")
                .with(Mark::line(&[0.0, 1.0], &[1.0, 2.0], Colour::MODEL).named(name))
        };
        let count = |panels| Figure::new("f", panels).svg().matches(">mean<").count();
        assert_eq!(count(vec![panel("mean"), panel("mean")]), 1);
        assert_eq!(count(vec![panel("mean"), panel("other")]), 1);
        assert_eq!(count(vec![panel("mean"), panel("other"), panel("mean")]), 2);
    }

    /// Arrows that point outwards at the edge of the detector, one of them far longer than the others.
    #[test]
    fn whole_arrows_are_inside_the_frame() {
        let side: Vec<f64> = (0..12).map(|k| 2.0 * f64::from(k) - 11.0).collect();
        let at = |n: usize| -> [Vec<f64>; 2] {
            let of = |k: usize| side[k * 11 / n];
            let places = (0..=n).flat_map(|i| (0..=n).map(move |j| [of(i), of(j)]));
            let places: Vec<[f64; 2]> = places.collect();
            [0, 1].map(|axis| places.iter().map(|p| p[axis]).collect())
        };
        for (n, size) in [
            (11, [540.0, 560.0]),
            (2, [270.0, 300.0]),
            (1, [270.0, 300.0]),
        ] {
            let [x, y] = at(n);
            let mut d = [x.clone(), y.clone()];
            d.iter_mut().for_each(|d| d[0] *= 9.0);
            let mark = Mark::arrows([&x, &y], [&d[0], &d[1]], "arcsec", Colour::INK);
            let panel = Panel::focal_plane("p", [12.0; 2]).with(mark);
            let svg = Figure::new("f", vec![panel]).sized(size).svg();
            let (head, inside) = svg.split_once(r#"overflow="hidden">"#).unwrap();
            let frame = head.rsplit_once("viewBox=\"").unwrap().1;
            let [fx, fy, fw, fh] = numbers(frame)[..] else {
                unreachable!("four numbers make a viewBox")
            };
            let arrows = inside
                .split("<path")
                .find(|p| p.contains(r#"stroke-width="1.1""#));
            let d = arrows.unwrap().split('"').nth(1).unwrap();
            let points = numbers(d);
            assert!(points.len() >= 4 * (n + 1) * (n + 1), "all are drawn");
            for p in points.chunks(2) {
                let inside = (fx..=fx + fw).contains(&p[0]) && (fy..=fy + fh).contains(&p[1]);
                assert!(inside, "{n}: {p:?} in {fx} {fy} {fw} {fh}");
            }
            assert!(inside.contains("stroke-dasharray"), "the edge is drawn");
        }
    }

    /// The numbers of a text.
    fn numbers(text: &str) -> Vec<f64> {
        text.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'))
            .filter_map(|word| word.parse().ok())
            .collect()
    }

    /// Arrows a tenth as long have the key of the longer ones when drawn to their scale, and a key of
    /// their own otherwise.
    #[test]
    fn arrows_of_two_panels_share_a_scale() {
        let at = [0.0, 1.0, 2.0];
        let key = |length: f64, scale: Option<f64>| {
            let mark = Mark::arrows([&at, &at], [&[length; 3], &[0.0; 3]], "arcsec", Colour::INK);
            let mark = match scale {
                Some(value) => mark.to_scale(value),
                None => mark,
            };
            let panel = Panel::map("p").with(mark.named("mean"));
            let svg = Figure::new("f", vec![panel]).svg();
            let text = svg.split("mean, key ").nth(1).unwrap_or_default();
            text.split('<').next().unwrap_or_default().to_owned()
        };
        assert_eq!(key(2.0, None), key(0.2, Some(2.0)));
        assert_ne!(key(2.0, None), key(0.2, None));
        assert_eq!(key(0.2, None), key(0.2, Some(f64::NAN)));
    }

    #[test]
    fn a_pixel_is_square_on_the_focal_plane() {
        let panel = Panel::focal_plane("f", [512.0, 256.0]).with(Mark::points(
            &[-512.0, 512.0],
            &[-256.0, 256.0],
            1.0,
            Colour::MEASURED,
        ));
        let svg = Figure::new("f", vec![panel]).svg();
        let frame = svg.split("<svg ").nth(2).unwrap_or_default();
        let value = |key: &str| -> f64 {
            let rest = frame.split(&format!("{key}=\"")).nth(1).unwrap_or_default();
            rest.split('"')
                .next()
                .unwrap_or_default()
                .parse()
                .unwrap_or(f64::NAN)
        };
        assert!(
            (value("width") / value("height") - 2.0).abs() < 0.01,
            "{frame}"
        );
    }
}
