//! The region that the data cannot tell from the maximum, and the intervals that follow.
//!
//! ```text
//! region = { (x, u, v) : ln L >= ln L_max - 3.841/2 }        95 % by Wilks' theorem
//! interval of a parameter = its least and greatest value over the region
//! ```
//!
//! which is the interval of its profile likelihood. The plane is cut into columns of constant `tau`
//! from the maximum outwards, until a column lies outside the region. Where the region reaches the
//! edge of the plane, the data do not bound the parameter on that side.
//!
//! Source: Venzon & Moolgavkar, Applied Statistics 37 (1988) 87; Wilks, Ann. Math. Statist. 9 (1938) 60.

use super::column::{Column, column, refined, vertex};
use super::{Best, Plane, climb};
use crate::fit::likelihood::{LANES, Likelihood, Place, logs_of};

/// Half of the 95 % point of chi-square with one degree of freedom.
const DROP: f64 = 1.920_729_410_347_062;
/// The same for 99 %: beyond this a region must still be closed for a parameter to count as
/// estimated.
const CLOSED: f64 = 3.317_448_300_510_389;
/// By how much a column at a tip of the region may miss its floor.
const TIP: f64 = 0.02;
/// Columns on either side of the maximum, at most.
const COLUMNS: usize = 60;

/// What the data say of one parameter, as a logarithm: its interval, open where not bounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) open_low: bool,
    pub(crate) open_high: bool,
}

impl Range {
    const EMPTY: Self = Self {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
        open_low: false,
        open_high: false,
    };

    fn add(&mut self, low: f64, high: f64) {
        self.low = self.low.min(low);
        self.high = self.high.max(high);
    }
}

/// The region of 95 %.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    pub(crate) best: Best,
    /// `sigma_HSF`, `tau`, `sigma_TN`.
    pub(crate) ranges: [Range; 3],
    /// Upper end for `sigma_HSF` of correlation times from one step to the span.
    pub(crate) sigma_high_within_span: f64,
    /// `sigma_TN` for correlation times of one step and more, and where it is best there: what is
    /// correlated over less than a step is white to such a series.
    pub(crate) white: Range,
    pub(crate) best_white: f64,
}

/// The region around the maximum `best`, which is replaced should a better one turn up.
///
/// A side counts as open when the region of 99 % reaches the edge: a bound that 95 % would just
/// close, chance closes too often.
pub(crate) fn region<L: Likelihood>(likelihood: &L, plane: &Plane, best: Best) -> Region {
    let mut best = best;
    let mut cut = columns(likelihood, plane, best);
    for _ in 0..4 {
        let top = cut
            .iter()
            .map(|c| c.best)
            .max_by(|a, b| a.ln_l.total_cmp(&b.ln_l))
            .unwrap_or(best);
        if top.ln_l <= best.ln_l + 0.01 {
            break;
        }
        let next = climb(likelihood, plane, top.place);
        if next.ln_l <= best.ln_l {
            break;
        }
        best = next;
        cut = columns(likelihood, plane, best);
    }
    let wide = summarise(likelihood.weight(), plane, best, &cut, CLOSED);
    sharpen(likelihood, plane, best, &mut cut);
    let mut region = summarise(likelihood.weight(), plane, best, &cut, DROP);
    for (range, wide) in region.ranges.iter_mut().zip(wide.ranges) {
        range.open_low = wide.open_low;
        range.open_high = wide.open_high;
    }
    region.white.open_low = wide.white.open_low;
    region
}

/// Columns where the region of 95 % ends, and half-way there: on a narrow oblique ridge the extremes
/// of sigma lie at its very tips.
fn sharpen<L: Likelihood>(likelihood: &L, plane: &Plane, best: Best, cut: &mut Vec<Column>) {
    let floor = best.ln_l - DROP;
    let (low, high) = ends(cut, floor);
    for (end, first) in [(low, true), (high, false)] {
        let Some(end) = end else { continue };
        let inside = |c: &&Column| c.best.ln_l >= floor;
        let near = if first {
            cut.iter().find(inside)
        } else {
            cut.iter().rfind(inside)
        };
        let Some(near) = near.cloned() else { continue };
        for x in [0.5 * (near.x + end), end] {
            let guess = cut
                .windows(2)
                .find(|pair| pair[0].x <= x && x <= pair[1].x)
                .map_or(near.best.place.u, |pair| {
                    let (a, b) = (pair[0].best.place, pair[1].best.place);
                    a.u + (b.u - a.u) * (x - a.x) / (b.x - a.x)
                });
            cut.push(column(likelihood, plane, x, guess, width_of(&near), floor));
            cut.sort_by(|a, b| a.x.total_cmp(&b.x));
        }
    }
}

fn columns<L: Likelihood>(likelihood: &L, plane: &Plane, best: Best) -> Vec<Column> {
    let floor = best.ln_l - CLOSED;
    let centre = column(likelihood, plane, best.place.x, best.place.u, 0.3, floor);
    let mut all = vec![centre.clone()];
    for side in [-1.0, 1.0] {
        let edge = if side < 0.0 { plane.x[0] } else { plane.x[1] };
        let mut last = centre.clone();
        let mut before: Option<(f64, f64)> = None;
        let mut step = first_step(likelihood, plane, &centre, side);
        for _ in 0..COLUMNS {
            let room = (edge - last.x).abs();
            if room < 1e-9 {
                break;
            }
            let x = last.x + side * step.min(room);
            // follow the ridge
            let drift = before.map_or(0.0, |(bx, bu)| (last.best.place.u - bu) / (last.x - bx));
            let guess = last.best.place.u + drift.clamp(-3.0, 3.0) * (x - last.x);
            let next = column(likelihood, plane, x, guess, width_of(&last), floor);
            let fell = last.best.ln_l - next.best.ln_l;
            before = Some((last.x, last.best.place.u));
            let out = next.best.ln_l < floor - 0.3;
            all.push(next.clone());
            last = next;
            if out {
                break;
            }
            if fell.abs() < 0.15 {
                step *= 1.5;
            } else if fell > 1.0 {
                step *= 0.7;
            }
        }
    }
    all.sort_by(|a, b| a.x.total_cmp(&b.x));
    all
}

/// A first step in x that costs about 0.1 of the log-likelihood.
fn first_step<L: Likelihood>(likelihood: &L, plane: &Plane, centre: &Column, side: f64) -> f64 {
    let Place { x, u } = centre.best.place;
    // the profile falls by at most as much as along constant u
    let steps = [0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.0];
    let places = steps.map(|s| plane.clip(Place { x: x + side * s, u }));
    let values = likelihood.profile(&places);
    let first = (0..LANES).find(|l| centre.best.ln_l - values[*l].0 > 0.1);
    steps[first.unwrap_or(LANES - 1)]
}

fn width_of(column: &Column) -> f64 {
    vertex(&column.nodes).map_or(1.0, |(_, natural)| natural.clamp(1e-3, 2.0))
}

fn summarise(weight: f64, plane: &Plane, best: Best, columns: &[Column], drop: f64) -> Region {
    let floor = best.ln_l - drop;
    let mut ranges = [Range::EMPTY; 3];
    let mut within = f64::NEG_INFINITY;
    let mut white = Range::EMPTY;
    let (mut best_white, mut top) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    let logs = logs_of(best.place, best.ln_v, plane.dt_s);
    for (range, value) in ranges.iter_mut().zip(logs) {
        range.add(value, value);
    }
    for column in columns {
        if column.best.ln_l < floor - TIP {
            continue;
        }
        // a column at the tip of the region holds one point of it
        let tip = logs_of(column.best.place, column.best.ln_v, plane.dt_s);
        ranges[0].add(tip[0], tip[0]);
        ranges[2].add(tip[2], tip[2]);
        let from_step = column.x >= plane.dt_s.ln();
        if from_step {
            white.add(tip[2], tip[2]);
            if column.best.ln_l > top {
                (best_white, top) = (tip[2], column.best.ln_l);
            }
        }
        for node in refined(&column.nodes) {
            let (u, excess) = (node.0, node.1 - floor);
            if excess < 0.0 {
                continue;
            }
            let place = Place { x: column.x, u };
            // W (t - 1 - ln t) = excess, t = best v / v: below one it is the larger v
            let [t_low, t_high] = roots(excess / weight);
            let large = logs_of(place, node.2 - t_low.ln(), plane.dt_s);
            let small = logs_of(place, node.2 - t_high.ln(), plane.dt_s);
            ranges[0].add(small[0], large[0]);
            ranges[2].add(small[2], large[2]);
            if from_step && column.x <= plane.span_s.ln() {
                within = within.max(large[0]);
            }
            if from_step {
                white.add(small[2], large[2]);
                white.open_low |= u >= plane.u[1] - 1e-9;
            }
            ranges[0].open_low |= u <= plane.u[0] + 1e-9;
            ranges[2].open_low |= u >= plane.u[1] - 1e-9;
        }
    }
    let (low, high) = ends(columns, floor);
    ranges[1].add(low.unwrap_or(plane.x[0]), high.unwrap_or(plane.x[1]));
    ranges[1].open_low = low.is_none() || ranges[0].open_low;
    ranges[1].open_high = high.is_none() || ranges[0].open_low;
    ranges[0].open_high = high.is_none();
    ranges[0].open_low |= low.is_none();
    Region {
        best,
        ranges,
        sigma_high_within_span: within,
        white,
        best_white,
    }
}

/// Where the profile over the columns crosses the floor; `None` where it does not.
fn ends(columns: &[Column], floor: f64) -> (Option<f64>, Option<f64>) {
    let crossing = |inside: &Column, outside: &Column, further: Option<&Column>| {
        // in the square root of the drop the profile is nearly straight
        let top = columns
            .iter()
            .map(|c| c.best.ln_l)
            .fold(f64::NEG_INFINITY, f64::max);
        let root = |c: &Column| (top - c.best.ln_l).max(0.0).sqrt();
        let (r0, r1, target) = (root(inside), root(outside), (top - floor).sqrt());
        let straight = inside.x + (outside.x - inside.x) * (target - r0) / (r1 - r0);
        let Some(third) = further else {
            return straight;
        };
        // a parabola through three
        let r2 = root(third);
        if r2 >= r0 {
            return straight;
        }
        let l0 = (target - r1) * (target - r2) / ((r0 - r1) * (r0 - r2));
        let l1 = (target - r0) * (target - r2) / ((r1 - r0) * (r1 - r2));
        let l2 = (target - r0) * (target - r1) / ((r2 - r0) * (r2 - r1));
        let x = l0 * inside.x + l1 * outside.x + l2 * third.x;
        let (from, to) = (inside.x.min(outside.x), inside.x.max(outside.x));
        if (from..=to).contains(&x) {
            x
        } else {
            straight
        }
    };
    let first = columns.iter().position(|c| c.best.ln_l >= floor);
    let last = columns.iter().rposition(|c| c.best.ln_l >= floor);
    let low = first
        .filter(|k| *k > 0)
        .map(|k| crossing(&columns[k], &columns[k - 1], columns.get(k + 1)));
    let high = last.filter(|k| *k + 1 < columns.len()).map(|k| {
        let further = if k > 0 { columns.get(k - 1) } else { None };
        crossing(&columns[k], &columns[k + 1], further)
    });
    (low, high)
}

/// Both solutions of `t - 1 - ln t = e`, `e >= 0`.
fn roots(e: f64) -> [f64; 2] {
    let solve = |mut t: f64| {
        for _ in 0..40 {
            let f = t - 1.0 - t.ln() - e;
            let slope = 1.0 - 1.0 / t;
            if slope == 0.0 {
                break;
            }
            let next = t - f / slope;
            let next = if next > 0.0 { next } else { 0.5 * t };
            let moved = (next - t).abs();
            t = next;
            if moved < 1e-12 * t {
                break;
            }
        }
        t
    };
    if e < 1e-14 {
        return [1.0, 1.0];
    }
    let r = (2.0 * e).sqrt();
    // below one: exp(-1 - e) is a lower bound, and Newton from there climbs monotonically
    [solve((-1.0 - e).exp().max(1.0 - r)), solve(1.0 + r + e)]
}
