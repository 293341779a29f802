//! Marks as elements of SVG.
//!
//! Not physics: drawing.

use std::fmt::Write as _;

use crate::Colour;
use crate::axis::{Laid, nice_below, written};
use crate::mark::{Mark, Shape};
use crate::thin;

/// A frame on the page, with its axes.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    pub(crate) at: [f64; 2],
    pub(crate) px: [f64; 2],
    pub(crate) x: Laid,
    pub(crate) y: Laid,
}

impl Frame {
    fn place(&self, x: f64, y: f64) -> [f64; 2] {
        // far outside is as good as just outside, and keeps numbers short
        let near =
            |v: f64, from: f64, width: f64| v.clamp(from - 20.0 * width, from + 21.0 * width);
        [
            near(self.x.at(x), self.at[0], self.px[0]),
            near(self.y.at(y), self.at[1], self.px[1]),
        ]
    }
}

/// The longest arrow, in lengths of a long one.
const LONGEST: f64 = 2.0;
/// Room beyond the tip of an arrow: half the width of its head.
const HEAD_PX: f64 = 3.0;
/// Axes are made wider by this at most.
const WIDEST: f64 = 3.0;

/// The length of a long arrow: that which nine of ten stay below, or more where one, perhaps of another panel, is far
/// longer and would fill the frame. `None` without arrows.
#[must_use]
pub fn long_arrow(mut lengths: Vec<f64>, longest: f64) -> Option<f64> {
    lengths.sort_by(f64::total_cmp);
    let usual = lengths.get(lengths.len() * 9 / 10)?;
    Some(usual.max(longest / LONGEST))
}

/// How long arrows are.
#[derive(Clone, Debug)]
pub(crate) struct Arrows {
    px_per_unit: f64,
    key: f64,
    unit: String,
}

impl Arrows {
    /// The scale at which the longest tenth of the arrows just reaches the next one.
    pub(crate) fn of(mark: &Mark, frame: &Frame) -> Option<Self> {
        let Shape::Arrows {
            x,
            dx,
            dy,
            unit,
            long,
            ..
        } = &mark.shape
        else {
            return None;
        };
        let mut lengths: Vec<f64> = dx.iter().zip(dy).map(|(a, b)| a.hypot(*b)).collect();
        lengths.retain(|l| l.is_finite() && *l > 0.0);
        let longest = lengths.iter().copied().fold(0.0, f64::max);
        let long = long.or_else(|| long_arrow(lengths, longest))?;
        let spacing = (frame.px[0] * frame.px[1] / x.len() as f64).sqrt();
        // short enough for the longest to be inside a small frame
        let most = (frame.px[0].min(frame.px[1]) / 8.0).clamp(14.0, 34.0);
        let px_per_unit = spacing.clamp(14.0, most) / long;
        // the key is the longest round number that fits into its place in the legend
        let key = nice_below(26.0 / px_per_unit);
        Some(Self {
            px_per_unit,
            key,
            unit: unit.clone(),
        })
    }

    /// How much wider the axes of `frame` have to be for whole arrows to be inside, heads and all.
    pub(crate) fn widening(&self, mark: &Mark, frame: &Frame) -> f64 {
        let Shape::Arrows { x, y, dx, dy, .. } = &mark.shape else {
            return 1.0;
        };
        let mut factor: f64 = 1.0;
        for k in 0..x.len() {
            let from = frame.place(x[k], y[k]);
            let step = [dx[k] * self.px_per_unit, -dy[k] * self.px_per_unit];
            for axis in 0..2 {
                let half = 0.5 * frame.px[axis];
                let off = from[axis] - (frame.at[axis] + half);
                // what begins outside is not the frame's to hold
                if off.abs() > half || !step[axis].is_finite() {
                    continue;
                }
                // centre + off / factor + step has to be inside; a step alone may be too long for that
                let room = (half - HEAD_PX - step[axis] * off.signum()).max(half / WIDEST);
                factor = factor.max(off.abs() / room);
            }
        }
        factor.min(WIDEST)
    }

    pub(crate) fn key_text(&self) -> String {
        let decimals = (-self.key.log10().floor()).max(0.0);
        format!("{} {}", written(self.key, decimals), self.unit)
    }
}

pub(crate) fn mark(out: &mut String, mark: &Mark, frame: &Frame) {
    let mut stroke = |d: &str, more: &str| {
        let (colour, opacity) = (mark.colour.hex(), mark.opacity);
        let _ = write!(
            out,
            r#"<path d="{d}" fill="none" stroke="{colour}" stroke-opacity="{opacity}"{more}/>"#
        );
    };
    match &mark.shape {
        Shape::Lines {
            lines,
            width,
            dashed,
        } => {
            let mut d = String::new();
            for [x, y] in lines {
                let points: Vec<[f64; 2]> =
                    x.iter().zip(y).map(|(x, y)| frame.place(*x, *y)).collect();
                path(&mut d, &thin::line(&points));
            }
            let dash = if *dashed {
                r#" stroke-dasharray="6 4""#
            } else {
                ""
            };
            let width = format!(r#" stroke-width="{width}" stroke-linejoin="round"{dash}"#);
            stroke(&d, &width);
        }
        Shape::Band { x, low, high } => band(out, mark, frame, [x, low, high]),
        Shape::Points {
            x,
            y,
            sigma,
            radius,
        } => {
            let bars = bars(frame, [x, y, sigma]);
            if !bars.is_empty() {
                stroke(&bars, "");
            }
            let mut d = String::new();
            for [px, py] in thin::points(x.iter().zip(y).map(|(x, y)| frame.place(*x, *y))) {
                let _ = write!(d, "M{px:.1} {py:.1}h0");
            }
            let width = 2.0 * radius;
            let round = format!(r#" stroke-width="{width:.1}" stroke-linecap="round""#);
            stroke(&d, &round);
        }
        Shape::Arrows { x, y, dx, dy, .. } => {
            let Some(scale) = Arrows::of(mark, frame) else {
                return;
            };
            let mut d = String::new();
            for k in 0..x.len() {
                let from = frame.place(x[k], y[k]);
                let step = [dx[k] * scale.px_per_unit, -dy[k] * scale.px_per_unit];
                arrow(&mut d, from, step);
            }
            stroke(&d, r#" stroke-width="1.1" stroke-linejoin="round""#);
        }
        Shape::Cells {
            x,
            y,
            size,
            value,
            scale,
            ..
        } => {
            let each = x.iter().zip(y).zip(value);
            for ((x, y), value) in each.filter(|(_, value)| value.is_finite()) {
                cell(out, frame, [*x, *y], *size, scale.colour(*value));
            }
        }
        Shape::VerticalRule { x } => {
            let px = frame.x.at(*x);
            if px.is_finite() {
                let d = format!("M{px:.1} {:.1}v{:.1}", frame.at[1], frame.px[1]);
                stroke(&d, RULE);
            }
        }
        Shape::HorizontalRule { y } => {
            let px = frame.y.at(*y);
            if px.is_finite() {
                let d = format!("M{:.1} {px:.1}h{:.1}", frame.at[0], frame.px[0]);
                stroke(&d, RULE);
            }
        }
    }
}

/// How a rule is dashed.
const RULE: &str = r#" stroke-dasharray="3 3""#;

/// The area between `low` and `high`, run by run.
fn band(out: &mut String, mark: &Mark, frame: &Frame, [x, low, high]: [&[f64]; 3]) {
    let mut d = String::new();
    for run in runs(x, low, high) {
        let there = run.clone().map(|k| frame.place(x[k], high[k]));
        let back = run.rev().map(|k| frame.place(x[k], low[k]));
        let points: Vec<[f64; 2]> = there.chain(back).collect();
        path(&mut d, &points);
        d.push('Z');
    }
    let (colour, opacity) = (mark.colour.hex(), mark.opacity);
    // a rim: where the band is thinner than a pixel, it is all that shows
    let rim = (2.0 * opacity).min(1.0);
    let _ = write!(
        out,
        r#"<path d="{d}" fill="{colour}" fill-opacity="{opacity}" stroke="{colour}" stroke-opacity="{rim}" stroke-width="0.7" stroke-linejoin="round"/>"#
    );
}

/// The bars of errors, of points that have one.
fn bars(frame: &Frame, [x, y, sigma]: [&[f64]; 3]) -> String {
    let mut d = String::new();
    for ((x, y), s) in x.iter().zip(y).zip(sigma) {
        let ends = [frame.place(*x, y - s), frame.place(*x, y + s)];
        if ends.iter().flatten().all(|v| v.is_finite()) {
            path(&mut d, &ends);
        }
    }
    d
}

/// A cell about `[x, y]`.
fn cell(out: &mut String, frame: &Frame, [x, y]: [f64; 2], size: [f64; 2], colour: Colour) {
    let low = frame.place(x - 0.5 * size[0], y + 0.5 * size[1]);
    let high = frame.place(x + 0.5 * size[0], y - 0.5 * size[1]);
    if low.iter().chain(&high).all(|v| v.is_finite()) {
        // a fraction of a pixel more closes the seams
        let _ = write!(
            out,
            r#"<rect x="{:.1}" y="{:.1}" width="{:.1}" height="{:.1}" fill="{}"/>"#,
            low[0],
            low[1],
            (high[0] - low[0]).max(0.8) + 0.1,
            (high[1] - low[1]).max(0.8) + 0.1,
            colour.hex()
        );
    }
}

/// What stands for a mark in the legend, 26 px wide from `at`.
pub(crate) fn swatch(out: &mut String, mark: &Mark, at: [f64; 2], arrows: Option<&Arrows>) {
    let [x, y] = at;
    let (colour, opacity) = (mark.colour.hex(), mark.opacity);
    let line = |width: f64, dash: &str| {
        format!(
            r#"<path d="M{x:.1} {y:.1}h26" stroke="{colour}" stroke-opacity="{opacity}" stroke-width="{width}"{dash}/>"#
        )
    };
    let drawn = match &mark.shape {
        Shape::Lines { width, dashed, .. } => line(
            width.max(1.2),
            if *dashed {
                r#" stroke-dasharray="6 4""#
            } else {
                ""
            },
        ),
        Shape::Band { .. } => format!(
            r#"<rect x="{x:.1}" y="{:.1}" width="26" height="10" fill="{colour}" fill-opacity="{opacity}"/>"#,
            y - 5.0
        ),
        Shape::Points { radius, .. } => format!(
            r#"<circle cx="{:.1}" cy="{y:.1}" r="{:.1}" fill="{colour}"/>"#,
            x + 13.0,
            radius.clamp(1.5, 4.0)
        ),
        Shape::Arrows { .. } => {
            let mut d = String::new();
            if let Some(arrows) = arrows {
                arrow(&mut d, [x, y], [arrows.key * arrows.px_per_unit, 0.0]);
            }
            format!(r#"<path d="{d}" fill="none" stroke="{colour}" stroke-width="1.1"/>"#)
        }
        Shape::Cells { .. } => format!(
            r#"<rect x="{:.1}" y="{:.1}" width="10" height="10" fill="{colour}"/>"#,
            x + 8.0,
            y - 5.0
        ),
        Shape::VerticalRule { .. } | Shape::HorizontalRule { .. } => {
            line(1.0, r#" stroke-dasharray="3 3""#)
        }
    };
    out.push_str(&drawn);
}

fn path(d: &mut String, points: &[[f64; 2]]) {
    let mut pen_down = false;
    for [x, y] in points {
        if !(x.is_finite() && y.is_finite()) {
            pen_down = false;
            continue;
        }
        let _ = write!(d, "{}{x:.1} {y:.1}", if pen_down { 'L' } else { 'M' });
        pen_down = true;
    }
}

fn arrow(d: &mut String, [x, y]: [f64; 2], [dx, dy]: [f64; 2]) {
    let length = dx.hypot(dy);
    if !(x.is_finite() && y.is_finite() && length.is_finite()) {
        return;
    }
    let (ex, ey) = (x + dx, y + dy);
    let _ = write!(d, "M{x:.1} {y:.1}L{ex:.1} {ey:.1}");
    if length > 2.0 {
        let head = (0.35 * length).min(5.0) / length;
        let (bx, by) = (ex - head * dx, ey - head * dy);
        let (nx, ny) = (-0.45 * head * dy, 0.45 * head * dx);
        let _ = write!(
            d,
            "M{:.1} {:.1}L{ex:.1} {ey:.1}L{:.1} {:.1}",
            bx + nx,
            by + ny,
            bx - nx,
            by - ny
        );
    }
}

/// Runs of places where all three are finite.
fn runs(x: &[f64], low: &[f64], high: &[f64]) -> Vec<std::ops::Range<usize>> {
    let mut out: Vec<std::ops::Range<usize>> = vec![];
    for k in 0..x.len() {
        if x[k].is_finite() && low[k].is_finite() && high[k].is_finite() {
            match out.last_mut() {
                Some(run) if run.end == k => run.end = k + 1,
                _ => out.push(k..k + 1),
            }
        }
    }
    out
}

/// Width of a text at 11 px, about.
pub(crate) fn text_px(text: &str) -> f64 {
    6.6 * text.chars().count() as f64
}

/// Text that is safe inside an element and an attribute.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}
