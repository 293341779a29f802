//! The dark map, where one was estimated.

use std::collections::BTreeMap;

use figures::{Figure, Mark, Panel, Scale};
use telemetry::DarkMap;

use super::{Page, Run};
use crate::number::with_sigma;

/// Pixels farther apart than this belong to different windows.
const APART: f64 = 6.0;
/// Windows that get a panel each, and pixels in them; more share one map of the detector.
const WINDOWS: usize = 9;
const PIXELS: usize = 3000;
/// Cells to a side of that map.
const CELLS: f64 = 96.0;

pub(super) fn map(page: &mut Page, run: &Run<'_>) {
    let Some(dark) = run.closed.dark_map.as_ref().filter(|d| !d.dn.is_empty()) else {
        return;
    };
    let camera = run.bundle.camera.as_ref();
    let extent = |of: &[f64]| of.iter().fold(1.0_f64, |most, p| most.max(p.abs()));
    let half = camera.map_or_else(
        || [extent(&dark.x_px), extent(&dark.y_px)],
        |camera| camera.half_size_px(),
    );
    page.section("dark-map", "Dark map", |page| {
        let windows = windows(dark);
        let mut sorted = dark.dn.clone();
        sorted.sort_by(f64::total_cmp);
        let top = sorted[(sorted.len() - 1) * 99 / 100].max(f64::MIN_POSITIVE);
        let scale = Scale::Sequential([0.0, top]);
        let many = windows.len() > WINDOWS || dark.dn.len() > PIXELS;
        let (panels, size, note) = if many {
            let cell = (2.0 * half[0].max(half[1]) / CELLS).ceil().max(1.0);
            let panel = binned(dark, half, cell, scale);
            let note = format!("Each cell: the brightest of its {cell} by {cell} pixels.");
            (vec![panel], [640.0, 600.0], note)
        } else {
            let panels = windows.iter().map(|w| window(dark, w, scale)).collect();
            let note = "Each cell: one pixel of the detector; white was under no window.";
            (panels, [360.0, 300.0], note.to_owned())
        };
        let brightest = (0..dark.dn.len()).max_by(|&a, &b| dark.dn[a].total_cmp(&dark.dn[b]));
        let at = brightest.unwrap_or(0);
        let clear = (0..dark.dn.len())
            .filter(|&k| dark.dn[k] > 5.0 * dark.sigma_dn[k])
            .count();
        let title = format!(
            "{clear} of {} pixels are warm beyond 5σ; the warmest, at ({}, {}) px, has {} DN",
            dark.dn.len(),
            place(dark.x_px[at]),
            place(dark.y_px[at]),
            with_sigma(dark.dn[at], dark.sigma_dn[at]),
        );
        page.figure(
            &Figure::new(&title, panels).sized(size),
            &format!("Dark level of single pixels, in the unit of the images, estimated from all frames. {note} The scale ends at the 99th percentile. All values with their σ: dark_map.csv."),
        );
    });
}

fn place(px: f64) -> String {
    px.to_string().replace('-', "−")
}

/// Pixels by window: near one another on both axes.
fn windows(dark: &DarkMap) -> Vec<Vec<usize>> {
    let mut out: Vec<([f64; 4], Vec<usize>)> = vec![];
    for k in 0..dark.dn.len() {
        let (x, y) = (dark.x_px[k], dark.y_px[k]);
        let near = |b: &[f64; 4]| {
            x > b[0] - APART && x < b[1] + APART && y > b[2] - APART && y < b[3] + APART
        };
        match out.iter_mut().find(|(b, _)| near(b)) {
            Some((b, pixels)) => {
                *b = [b[0].min(x), b[1].max(x), b[2].min(y), b[3].max(y)];
                pixels.push(k);
            }
            None => out.push(([x, x, y, y], vec![k])),
        }
    }
    out.into_iter().map(|(_, pixels)| pixels).collect()
}

fn window(dark: &DarkMap, pixels: &[usize], scale: Scale) -> Panel {
    let pick = |of: &[f64]| -> Vec<f64> { pixels.iter().map(|&k| of[k]).collect() };
    let (x, y, dn) = (pick(&dark.x_px), pick(&dark.y_px), pick(&dark.dn));
    let middle = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let [cx, cy] = [middle(&x), middle(&y)].map(|v| place(v.round()));
    Panel::map(&format!("around ({cx}, {cy}) px")).with(Mark::cells(
        [&x, &y],
        [1.0; 2],
        &dn,
        scale,
        "dark level, DN",
    ))
}

fn binned(dark: &DarkMap, half: [f64; 2], cell: f64, scale: Scale) -> Panel {
    let mut cells: BTreeMap<[i64; 2], f64> = BTreeMap::new();
    for k in 0..dark.dn.len() {
        #[expect(clippy::cast_possible_truncation, reason = "a cell of a detector")]
        let at = [dark.x_px[k], dark.y_px[k]].map(|p| (p / cell).floor() as i64);
        let value = cells.entry(at).or_insert(f64::NEG_INFINITY);
        *value = value.max(dark.dn[k]);
    }
    let middle = |axis: usize| -> Vec<f64> {
        let of = |at: &[i64; 2]| (at[axis] as f64 + 0.5) * cell;
        cells.keys().map(of).collect()
    };
    let values: Vec<f64> = cells.values().copied().collect();
    Panel::focal_plane("warm pixels", half).with(Mark::cells(
        [&middle(0), &middle(1)],
        [cell; 2],
        &values,
        scale,
        "dark level, DN",
    ))
}
