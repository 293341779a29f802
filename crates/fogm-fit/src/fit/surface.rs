//! The likelihood over the plane of `ln tau` and noise ratio: its maximum, and the region that the
//! data cannot tell from it.
//!
//! ```text
//! region = { (x, u, v) : ln L >= ln L_max - 3.841/2 }        95 % by Wilks' theorem
//! interval of a parameter = its least and greatest value over the region
//! ```
//!
//! which is the interval of its profile likelihood. The plane is cut into columns of constant `tau`
//! from the maximum outwards, until a column lies outside the region; each column finds its own best
//! ratio first, so that narrow oblique ridges are followed. Where the region reaches the edge of the
//! plane, the data do not bound the parameter on that side.
//!
//! Source: Venzon & Moolgavkar, Applied Statistics 37 (1988) 87; Wilks, Ann. Math. Statist. 9 (1938) 60.

use super::likelihood::{LANES, Likelihood, Logs, Place, logs_of};

/// Half of the 95 % point of chi-square with one degree of freedom.
pub(crate) const DROP: f64 = 1.920_729_410_347_062;
/// The same for 99 %: beyond this a region must still be closed for a parameter to count as
/// estimated.
pub(crate) const CLOSED: f64 = 3.317_448_300_510_389;
/// By how much a column at a tip of the region may miss its floor.
const TIP: f64 = 0.02;
/// Distance of nodes in natural widths of a column.
const SPACING: f64 = 0.75;
/// Columns on either side of the maximum, at most.
const COLUMNS: usize = 60;

/// The part of the plane that is searched.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    pub(crate) x: [f64; 2],
    pub(crate) u: [f64; 2],
    pub(crate) dt_s: f64,
    pub(crate) span_s: f64,
}

impl Plane {
    /// The plane of a series of `span_s` at steps of `dt_s`: its edges are beyond what any such
    /// series could tell from zero or infinity.
    pub(crate) fn new(dt_s: f64, span_s: f64) -> Self {
        let n = span_s / dt_s;
        Self {
            x: [(dt_s / 15.0).ln(), (50.0 * span_s).ln()],
            // white noise alone: even a random walk adds less than 1e-3 of its own scatter
            u: [-0.5 * (1e3 * n * n * n).ln(), 0.5 * (1e4 * n.sqrt()).ln()],
            dt_s,
            span_s,
        }
    }

    fn clip(&self, place: Place) -> Place {
        Place {
            x: place.x.clamp(self.x[0], self.x[1]),
            u: place.u.clamp(self.u[0], self.u[1]),
        }
    }
}

/// The best place found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Best {
    pub(crate) place: Place,
    pub(crate) ln_l: f64,
    pub(crate) ln_v: f64,
}

fn best_of(places: &[Place; LANES], values: &[(f64, f64); LANES]) -> Best {
    let mut best = 0;
    for l in 1..LANES {
        // NaN loses
        if values[l].0 > values[best].0 || values[best].0.is_nan() {
            best = l;
        }
    }
    Best {
        place: places[best],
        ln_l: values[best].0,
        ln_v: values[best].1,
    }
}

/// Local maxima of a coarse net over the whole plane, best first.
pub(crate) fn survey<L: Likelihood>(likelihood: &L, plane: &Plane, keep: usize) -> Vec<Place> {
    const NX: usize = 24;
    const NU: usize = 24;
    let at = |range: [f64; 2], k: usize, n: usize| {
        range[0] + (range[1] - range[0]) * (k as f64 + 0.5) / n as f64
    };
    let mut net = vec![f64::NEG_INFINITY; NX * NU];
    let place = |k: usize| Place {
        x: at(plane.x, k / NU, NX),
        u: at(plane.u, k % NU, NU),
    };
    for from in (0..NX * NU).step_by(LANES) {
        let places = std::array::from_fn(|l| place(from + l));
        for (l, (ln_l, _)) in likelihood.profile(&places).iter().enumerate() {
            net[from + l] = *ln_l;
        }
    }
    let mut peaks: Vec<usize> = (0..NX * NU)
        .filter(|k| {
            let (i, j) = (k / NU, k % NU);
            (i.saturating_sub(1)..=(i + 1).min(NX - 1)).all(|m| {
                (j.saturating_sub(1)..=(j + 1).min(NU - 1)).all(|o| net[m * NU + o] <= net[*k])
            })
        })
        .collect();
    peaks.sort_by(|a, b| net[*b].total_cmp(&net[*a]));
    peaks.truncate(keep);
    peaks.into_iter().map(place).collect()
}

/// Newton's method on a stencil, with a search along each step; damped where the surface is not
/// curved down.
pub(crate) fn climb<L: Likelihood>(likelihood: &L, plane: &Plane, from: Place) -> Best {
    let start = plane.clip(from);
    let mut best = best_of(&[start; LANES], &likelihood.profile(&[start; LANES]));
    let mut h = [0.2, 0.2];
    for _ in 0..40 {
        let Place { x, u } = best.place;
        let places = [
            (0.0, 0.0),
            (h[0], 0.0),
            (-h[0], 0.0),
            (0.0, h[1]),
            (0.0, -h[1]),
            (h[0], h[1]),
            (-h[0], -h[1]),
            (0.0, 0.0),
        ]
        .map(|(dx, du)| Place {
            x: x + dx,
            u: u + du,
        });
        let f = likelihood.profile(&places).map(|v| v.0);
        let gradient = [(f[1] - f[2]) / (2.0 * h[0]), (f[3] - f[4]) / (2.0 * h[1])];
        let xx = (f[1] + f[2] - 2.0 * f[0]) / (h[0] * h[0]);
        let uu = (f[3] + f[4] - 2.0 * f[0]) / (h[1] * h[1]);
        let xu = (f[5] + f[6] - f[1] - f[2] - f[3] - f[4] + 2.0 * f[0]) / (2.0 * h[0] * h[1]);
        let step = downhill(gradient, [-xx, -xu, -uu]);
        let trial: [Place; LANES] = [4.0, 2.0, 1.4, 1.0, 0.6, 0.3, 0.08, 0.01].map(|t| {
            plane.clip(Place {
                x: x + t * step[0],
                u: u + t * step[1],
            })
        });
        let next = best_of(&trial, &likelihood.profile(&trial));
        let gained = next.ln_l - best.ln_l;
        let fine = [(-xx).max(1e-4).sqrt(), (-uu).max(1e-4).sqrt()].map(|c| 0.05 / c);
        let done = h[0] <= 2.0 * fine[0].min(0.2) && h[1] <= 2.0 * fine[1].min(0.2);
        if gained > 0.0 {
            best = next;
        }
        h = [fine[0].min(0.2), fine[1].min(0.2)];
        if done && (gained.is_nan() || gained < 1e-6) {
            break;
        }
    }
    best
}

/// The step of Newton's method for curvature `[xx, xu, uu]`, its eigenvalues made positive, its
/// length bounded.
fn downhill(gradient: [f64; 2], [xx, xu, uu]: [f64; 3]) -> [f64; 2] {
    let (mean, half) = (0.5 * (xx + uu), 0.5 * (xx - uu));
    let radius = half.hypot(xu);
    let angle = 0.5 * xu.atan2(half);
    let mut step = [0.0; 2];
    for (value, axis) in [
        (mean + radius, [angle.cos(), angle.sin()]),
        (mean - radius, [-angle.sin(), angle.cos()]),
    ] {
        let along = gradient[0] * axis[0] + gradient[1] * axis[1];
        let length = (along / value.abs().max(1e-3)).clamp(-1.5, 1.5);
        step[0] += length * axis[0];
        step[1] += length * axis[1];
    }
    step
}

/// A cut at constant `x`: nodes in increasing `u`.
#[derive(Clone, Debug)]
struct Column {
    x: f64,
    best: Best,
    nodes: Vec<Node>,
}

/// u, ln L and the log of the best scale.
type Node = (f64, f64, f64);

/// The cut at `x`, searched from `guess` with nodes `width` apart, down to `floor` or the edges.
fn column<L: Likelihood>(
    likelihood: &L,
    plane: &Plane,
    x: f64,
    guess: f64,
    width: f64,
    floor: f64,
) -> Column {
    let mut nodes = vec![];
    let mut add = |us: [f64; LANES]| {
        let places = us.map(|u| plane.clip(Place { x, u }));
        for (place, (ln_l, ln_v)) in places.iter().zip(likelihood.profile(&places)) {
            if ln_l.is_finite() {
                nodes.push((place.u, ln_l, ln_v));
            }
        }
        nodes.sort_by(|a: &Node, b: &Node| a.0.total_cmp(&b.0));
        nodes.dedup_by(|a, b| a.0 - b.0 < 1e-12);
        nodes.clone()
    };
    let around =
        |centre: f64, d: f64| std::array::from_fn(|l| centre + SPACING * d * (l as f64 - 3.5));
    let mut d = width;
    let mut all = add(around(guess.clamp(plane.u[0], plane.u[1]), d));
    for _ in 0..12 {
        let Some((u, natural)) = vertex(&all) else {
            // the best is the last node: go on beyond it, unless the plane ends there
            let top = highest(&all);
            let u = all.get(top).map_or(guess, |n| n.0);
            if u <= plane.u[0] || u >= plane.u[1] {
                break;
            }
            d *= 2.0;
            all = add(around(u, d));
            continue;
        };
        let top = highest(&all);
        let apart = all[top + 1].0 - all[top - 1].0;
        if apart < 2.6 * SPACING * natural {
            d = natural;
            break;
        }
        d = natural;
        all = add(around(u, d));
    }
    // outwards until the column has fallen below the floor
    for side in [-1.0, 1.0] {
        for _ in 0..6 {
            let end = if side < 0.0 { all.first() } else { all.last() };
            let Some((u, ln_l, _)) = end.copied() else {
                break;
            };
            if ln_l < floor || u <= plane.u[0] || u >= plane.u[1] {
                break;
            }
            all = add(
                [1.0, 2.0, 3.2, 5.0, 8.0, 13.0, 21.0, 34.0].map(|t| u + side * SPACING * d * t)
            );
        }
    }
    let mut best = all
        .get(highest(&all))
        .copied()
        .unwrap_or((guess, f64::NEG_INFINITY, 0.0));
    if let Some((u, _)) = vertex(&all)
        && let Some(node) = interpolated(&all, u)
        && node.1 > best.1
    {
        best = node;
    }
    Column {
        x,
        best: Best {
            place: Place { x, u: best.0 },
            ln_l: best.1,
            ln_v: best.2,
        },
        nodes: all,
    }
}

fn highest(nodes: &[Node]) -> usize {
    (0..nodes.len())
        .max_by(|a, b| nodes[*a].1.total_cmp(&nodes[*b].1))
        .unwrap_or(0)
}

/// Vertex and natural width of the parabola through the highest node and its neighbours; `None` at
/// either end.
fn vertex(nodes: &[Node]) -> Option<(f64, f64)> {
    let top = highest(nodes);
    if top == 0 || top + 1 >= nodes.len() {
        return None;
    }
    let (um, u0, up) = (nodes[top - 1].0, nodes[top].0, nodes[top + 1].0);
    let (left, right) = (u0 - um, up - u0);
    let (sl, sr) = (
        (nodes[top].1 - nodes[top - 1].1) / left,
        (nodes[top + 1].1 - nodes[top].1) / right,
    );
    let curvature = ((sl - sr) * 2.0 / (left + right)).max(1e-2);
    let slope = (sl * right + sr * left) / (left + right);
    Some((
        u0 + (slope / curvature).clamp(-left, right),
        curvature.sqrt().recip(),
    ))
}

/// Cubic interpolation between nodes at `u`; `None` outside or for fewer than four.
fn interpolated(nodes: &[Node], u: f64) -> Option<Node> {
    let k = nodes.partition_point(|n| n.0 <= u).checked_sub(1)?;
    if k + 1 >= nodes.len() || nodes.len() < 4 {
        return None;
    }
    let from = k.saturating_sub(1).min(nodes.len() - 4);
    let four = &nodes[from..from + 4];
    let (mut f, mut v) = (0.0, 0.0);
    for (i, node) in four.iter().enumerate() {
        let mut weight = 1.0;
        for (j, other) in four.iter().enumerate() {
            if i != j {
                weight *= (u - other.0) / (node.0 - other.0);
            }
        }
        f += weight * node.1;
        v += weight * node.2;
    }
    // between nodes far apart a cubic may overshoot
    let (low, high) = (
        nodes[k].1.min(nodes[k + 1].1),
        nodes[k].1.max(nodes[k + 1].1),
    );
    Some((u, f.clamp(low - 0.1, high + 0.1), v))
}

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
    /// sigma_HSF, tau, sigma_TN.
    pub(crate) ranges: [Range; 3],
    /// Upper end for sigma_HSF of correlation times within the span.
    pub(crate) sigma_high_within_span: f64,
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
            if column.x <= plane.span_s.ln() {
                within = within.max(large[0]);
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

/// Nodes with values in between by cubic interpolation.
fn refined(nodes: &[Node]) -> Vec<Node> {
    const PARTS: usize = 6;
    let mut out = Vec::with_capacity(nodes.len() * PARTS);
    for pair in nodes.windows(2) {
        out.push(pair[0]);
        for part in 1..PARTS {
            let u = pair[0].0 + (pair[1].0 - pair[0].0) * part as f64 / PARTS as f64;
            out.extend(interpolated(nodes, u));
        }
    }
    out.extend(nodes.last());
    out
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

/// The parameters at the best place, as logarithms.
pub(crate) fn logs_at(best: Best, plane: &Plane) -> Logs {
    logs_of(best.place, best.ln_v, plane.dt_s)
}

/// The best of FOGM alone: along the edge of the plane where white noise vanishes, from a net over
/// all `tau`, or near `from` where that is given.
pub(crate) fn fogm_alone<L: Likelihood>(likelihood: &L, plane: &Plane, from: Option<f64>) -> Best {
    let edge = |centre: f64, width: f64| -> [Place; LANES] {
        std::array::from_fn(|l| {
            plane.clip(Place {
                x: centre + width * (l as f64 - 3.5) / 3.5,
                u: plane.u[1],
            })
        })
    };
    let half = 0.5 * (plane.x[1] - plane.x[0]);
    let (centre, mut width) = from.map_or((plane.x[0] + half, half), |x| (x, 0.5));
    let places = edge(centre, width);
    let mut best = best_of(&places, &likelihood.profile(&places));
    while width > 3e-3 {
        width /= 2.5;
        let places = edge(best.place.x, width);
        let next = best_of(&places, &likelihood.profile(&places));
        if next.ln_l > best.ln_l {
            best = next;
        }
    }
    best
}
