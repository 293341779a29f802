//! A cut through the plane at one correlation time.
//!
//! The cut finds its own best ratio first, so that narrow oblique ridges are followed, then goes
//! outwards on both sides until it has fallen far enough. What was evaluated on the way are its
//! nodes, three quarters of a natural width (a drop of 1/2) apart near the top.
//!
//! Source: docs/fogm-fit.md.

use super::{Best, Plane};
use crate::fit::likelihood::{LANES, Likelihood, Place};

/// Distance of nodes in natural widths of a column.
const SPACING: f64 = 0.75;

/// A cut at constant `x`: nodes in increasing `u`.
#[derive(Clone, Debug)]
pub(super) struct Column {
    pub(super) x: f64,
    pub(super) best: Best,
    pub(super) nodes: Vec<Node>,
}

/// u, ln L and the log of the best scale.
pub(super) type Node = (f64, f64, f64);

/// The cut at `x`, searched from `guess` with nodes `width` apart, down to `floor` or the edges.
pub(super) fn column<L: Likelihood>(
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
pub(super) fn vertex(nodes: &[Node]) -> Option<(f64, f64)> {
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

/// Nodes with values in between by cubic interpolation.
pub(super) fn refined(nodes: &[Node]) -> Vec<Node> {
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
