//! Long, fast runs at two paces.
//!
//! Over a few frames of such a run most columns go in straight lines: place, motion, temperature. Those are
//! evaluated at two frames of each group, a and b; what changes faster (the pixel phase, a pixel that a star
//! crosses, the residual) is taken at every frame. Over the rows i of a star within a group of n frames,
//!
//! ```text
//! s_i = L_ia s_a + L_ib s_b     L_ia = (b - i) / (b - a)     L_ib = (i - a) / (b - a)
//! sum s s' = n/2 (s_a s'_a + s_b s'_b)     sum s f = s_a sum L_ia f_i + s_b sum L_ib f_i     sum f f' as it is
//! ```
//!
//! The first is exact where a and b lie (n^2 - 1)/12 in square from the middle, which of whole numbers 7 and 26
//! frames allow. So these are the products of a design whose slow columns are straight within each group: no
//! row is left out and nothing of the residual is averaged away. An effect of z sigma in a slow column loses
//! at most `LOST` z^2 of its square, and a description `ROUGHLY` z^2; which columns are slow is judged by
//! themselves, on part of the run.
//!
//! Source: Gauss quadrature over points that are equally spaced (Abramowitz & Stegun, Section 25.4).

#[cfg(test)]
mod tests;

use std::ops::Range;

use effects::Candidate;
use rayon::prelude::*;

use super::sums::{SOLVING, Scratch, SolvedBins, Sums};
use crate::star::columns::StarColumns;
use crate::star::data::StarData;
use crate::star::layout::{Filled, Layout};
use crate::star::nuisance::StarNuisance;

/// Frames of a group, and those where its slow columns are evaluated.
const SIZES: [(usize, [usize; 2]); 2] = [(26, [5, 20]), (7, [1, 5])];
/// Share of its square by which a slow column may differ from its lines.
const LOST: f64 = 3e-5;
/// The same where a column only describes.
const ROUGHLY: f64 = 3e-3;
/// Of so many groups one tells which columns are slow; how many of these are gone through at once.
const JUDGED: usize = 24;
const TOGETHER: usize = 8;
/// Frames are where equal steps put them within this share of a step.
const EVEN: f64 = 0.1;
/// Frames whose fast columns are filled at once.
const CHUNK_FRAMES: usize = 16;

/// A frame at which slow columns are evaluated.
#[derive(Clone, Debug)]
struct Node {
    frame: usize,
    /// The frames that it stands for, with another one.
    group: Range<usize>,
    other: Option<usize>,
}

impl Node {
    /// What frame `k` of the group gets of its columns.
    fn share(&self, k: usize) -> f64 {
        self.other.map_or(1.0, |other| {
            (k as f64 - other as f64) / (self.frame as f64 - other as f64)
        })
    }
}

/// See the module.
pub(super) struct Paced {
    /// The frames of the nodes.
    data: StarData,
    /// Root of the summed squares of what each of their rows stands for.
    weight: Vec<f64>,
    nodes: Vec<Node>,
    /// Candidates that are taken at every frame.
    fast: Vec<bool>,
    none: StarNuisance,
}

impl Paced {
    /// `None` where that is not worth while; no group crosses the ends of `stretches`.
    pub(super) fn of(columns: &StarColumns<'_>, stretches: &[Range<usize>]) -> Option<Self> {
        let data = columns.data;
        let frames = &data.frames;
        // what has no rotation would need its fast products apart
        if (0..frames.frames()).any(|k| counted(data, k) < SOLVING) {
            return None;
        }
        let tried = (0..SIZES.len()).filter_map(|first| {
            let nodes = nodes(columns, stretches, &SIZES[first..]);
            let (fast, cost) = judge(columns, &nodes, SIZES[first].0)?;
            Some((nodes, fast, cost))
        });
        let (nodes, fast, _) = tried.min_by(|a, b| a.2.total_cmp(&b.2))?;
        let mut weight = Vec::new();
        for node in &nodes {
            let squares = node.group.clone().map(|k| node.share(k).powi(2));
            let root = squares.sum::<f64>().sqrt();
            let rows = frames.rows_of(node.frame);
            weight.extend(rows.map(|r| root * columns.weight_of(r)));
        }
        let which: Vec<usize> = nodes.iter().map(|n| n.frame).collect();
        Some(Self {
            data: data.some_frames(&which),
            weight,
            nodes,
            fast,
            none: StarNuisance::none(),
        })
    }

    /// The nodes of these frames.
    fn nodes_of(&self, frames: &Range<usize>) -> Range<usize> {
        let first = |k: usize| self.nodes.partition_point(|n| n.group.start < k);
        first(frames.start)..first(frames.end)
    }

    /// As [`Sums::over`], of the frames of a block.
    pub(super) fn sums(
        &self,
        columns: &StarColumns<'_>,
        frames: Range<usize>,
        bins: Option<&SolvedBins<'_>>,
        whole: &mut Scratch,
    ) -> Sums {
        let bins = bins.map(|bins| SolvedBins {
            frames: bins.frames.iter().map(|b| self.nodes_of(b)).collect(),
            least: bins.least,
            by_frame: false,
        });
        let slow = StarColumns {
            data: &self.data,
            weight: &self.weight,
            ..*columns
        };
        let listed = columns.candidates.iter().zip(&self.fast);
        let list: Vec<&dyn Candidate> = listed.filter(|(_, f)| **f).map(|(c, _)| *c).collect();
        let fast = StarColumns {
            nuisance: &self.none,
            candidates: &list,
            ..*columns
        };
        let layout = slow.layout_with(|c| self.fast[c]).leaving_out(&self.fast);
        let fast_layout = fast.layout_with(|_| true);
        let mut scratch = Scratch::default();
        let mut products = Sums::of_none(fast_layout.clone(), None, &mut scratch);
        let at = self.places(&slow);
        let fill = |nodes: Range<usize>, layout: &Layout, out: &mut Filled| {
            slow.fill(nodes.clone(), layout, out);
            slow.weigh(nodes.clone(), out);
            for own in &mut out.own {
                at.iter().for_each(|&place| own.column_mut(place).fill(0.0));
            }
            let all = self.nodes[nodes.start].group.start..self.nodes[nodes.end - 1].group.end;
            let mut count = 0;
            let mut node = nodes.start;
            for start in all.clone().step_by(CHUNK_FRAMES) {
                let some = start..(start + CHUNK_FRAMES).min(all.end);
                fast.fill(some.clone(), &fast_layout, &mut scratch.filled);
                count += fast.weigh(some.clone(), &mut scratch.filled);
                products.add_rows(&mut scratch);
                while self.nodes[node].group.end <= some.start {
                    node += 1;
                }
                let open = (node..nodes.end).take_while(|&n| self.nodes[n].group.start < some.end);
                for n in open {
                    self.join(&fast, some.clone(), &scratch, (n, nodes.start), &at, out);
                }
            }
            count
        };
        // the nodes of a group stand together
        let cut = |end: usize| {
            let [last, next] = [end - 1, end].map(|n| self.nodes.get(n).map(|n| n.group.start));
            if last == next { end - 1 } else { end }
        };
        let nodes = self.nodes_of(&frames);
        let sums = Sums::filled_by(&slow, layout, nodes, bins.as_ref(), cut, fill, whole);
        products.put_all(&mut scratch);
        sums.corrected(at, products)
    }

    /// Where the fast columns stand among the own ones of all.
    fn places(&self, columns: &StarColumns<'_>) -> Vec<usize> {
        let (misalignment, _, directions) = columns.nuisance.parts();
        let mut place = misalignment + directions;
        let mut out = Vec::new();
        for (candidate, fast) in columns.candidates.iter().zip(&self.fast) {
            let end = place + candidate.coefficients().len();
            if *fast {
                out.extend(place..end);
            }
            if *fast || !candidate.turns_camera() {
                place = end;
            }
        }
        out.extend(place..place + columns.residuals.len());
        out
    }

    /// Adds to the rows of a node, of which `first` is the first that is filled, its part of the fast columns
    /// of `frames`.
    fn join(
        &self,
        fast: &StarColumns<'_>,
        frames: Range<usize>,
        scratch: &Scratch,
        (n, first): (usize, usize),
        at: &[usize],
        out: &mut Filled,
    ) {
        let node = &self.nodes[n];
        let of = |k: usize| self.data.frames.first_row[k] - self.data.frames.first_row[first];
        let to_rows = of(n)..of(n + 1);
        let own = &self.weight[self.data.frames.rows_of(n)];
        let first_row = &fast.data.frames.first_row;
        let mut parts = vec![0.0; own.len()];
        for k in node.group.start.max(frames.start)..node.group.end.min(frames.end) {
            let weights = parts.iter_mut().zip(own).zip(&fast.weight[first_row[k]..]);
            for ((part, own), w) in weights {
                *part = if *own > 0.0 {
                    node.share(k) * w / own
                } else {
                    0.0
                };
            }
            let from = first_row[k] - first_row[frames.start];
            for (axis, out) in out.own.iter_mut().enumerate() {
                let all = &scratch.filled.own[axis];
                let (height, to_height) = (all.nrows(), out.nrows());
                for &column in scratch.active(axis) {
                    let values = &all.as_slice()[column * height + from..];
                    let to = &mut out.as_mut_slice()[at[column] * to_height..][to_rows.clone()];
                    for ((to, v), part) in to.iter_mut().zip(values).zip(&parts) {
                        *to += part * v;
                    }
                }
            }
        }
    }
}

/// Rows of a frame that are no outliers.
fn counted(data: &StarData, frame: usize) -> usize {
    let rows = data.frames.rows_of(frame);
    rows.filter(|&r| !data.outlier[r]).count()
}

/// Groups of these sizes, the largest that fit; frames that fit in none stand for themselves.
fn nodes(
    columns: &StarColumns<'_>,
    stretches: &[Range<usize>],
    sizes: &[(usize, [usize; 2])],
) -> Vec<Node> {
    let frames = &columns.data.frames;
    let like_the_last: Vec<bool> = (0..frames.frames())
        .map(|k| k > 0 && alike(columns, k - 1, k))
        .collect();
    let fits = |group: &Range<usize>| {
        let [first, last] = [group.start, group.end - 1].map(|k| frames.t_s[k]);
        let step = (last - first) / (group.len() - 1) as f64;
        let rows = frames.rows_of(group.start).len();
        let even = |k: usize| {
            let off = frames.t_s[k] - first - step * (k - group.start) as f64;
            off.abs() <= EVEN * step
        };
        counted(columns.data, group.start) == rows
            && (group.start + 1..group.end).all(|k| like_the_last[k] && even(k))
    };
    let mut nodes = Vec::new();
    for stretch in stretches {
        let mut at = stretch.start;
        while at < stretch.end {
            let groups = sizes.iter().map(|(size, nodes)| (at..at + size, nodes));
            let mut whole = groups.filter(|(group, _)| group.end <= stretch.end && fits(group));
            let (group, places) = match whole.next() {
                Some((group, places)) => (group, Some(places.map(|p| at + p))),
                None => (at..at + 1, None),
            };
            let others = places.map_or([(at, None); 2], |[a, b]| [(a, Some(b)), (b, Some(a))]);
            let count = if places.is_some() { 2 } else { 1 };
            nodes.extend(others.into_iter().take(count).map(|(frame, other)| Node {
                frame,
                group: group.clone(),
                other,
            }));
            at = group.end;
        }
    }
    nodes
}

/// Whether two frames have the same stars in the same order, without outliers, with the same weights.
fn alike(columns: &StarColumns<'_>, a: usize, b: usize) -> bool {
    let frames = &columns.data.frames;
    let (a, b) = (frames.rows_of(a), frames.rows_of(b));
    frames.star_id[a.clone()] == frames.star_id[b.clone()]
        && frames.slot[a.clone()] == frames.slot[b.clone()]
        && a.zip(b).all(|(a, b)| {
            let same = columns.weight[a].to_bits() == columns.weight[b].to_bits();
            same && !columns.data.outlier[b]
        })
}

/// Which candidates are fast, and about how many columns a frame has then; `None`: the declared unknowns are,
/// or there are too few groups of this size.
fn judge(columns: &StarColumns<'_>, nodes: &[Node], size: usize) -> Option<(Vec<bool>, f64)> {
    let each_frame = nodes
        .iter()
        .map(|n| n.group.len() as f64 / if n.other.is_some() { 2.0 } else { 1.0 });
    let frames = each_frame.sum::<f64>();
    let large = |n: &&Node| n.group.len() == size && n.other.is_some_and(|other| n.frame < other);
    let groups: Vec<&Node> = nodes.iter().filter(large).collect();
    if 2.0 * ((size * groups.len()) as f64) < frames {
        return None;
    }
    let judged: Vec<&Node> = groups.into_iter().step_by(JUDGED).collect();
    let layout = columns.layout();
    let (shared, own) = (layout.shared, layout.own.len());
    let count = shared + own + layout.turn.len();
    let sums = |some: &[&Node]| {
        let mut squares = vec![[0.0; 2]; count];
        let mut filled = Filled::default();
        for node in some {
            columns.fill(node.group.clone(), &layout, &mut filled);
            let rows = columns.data.frames.rows_of(node.frame).len();
            for (k, sums) in squares[..shared].iter_mut().enumerate() {
                add(sums, node, rows, |i| filled.shared[(k, i)]);
            }
            for axis in &filled.own {
                for (column, sums) in axis.column_iter().zip(&mut squares[shared..]) {
                    add(sums, node, rows, |i| column[i]);
                }
            }
            let turns = filled.turn.column_iter();
            for (column, sums) in turns.zip(&mut squares[shared + own..]) {
                add(sums, node, 3, |i| column[i]);
            }
        }
        squares
    };
    let each: Vec<_> = judged.par_chunks(TOGETHER).map(sums).collect();
    let whole = |c: usize, which: usize| each.iter().map(|s| s[c][which]).sum::<f64>();
    // a star that was not seen there tells nothing: NaN
    let lost: Vec<f64> = (0..count).map(|c| whole(c, 0) / whole(c, 1)).collect();
    let (misalignment, _, directions) = columns.nuisance.parts();
    let (mut place, mut turn) = (shared + misalignment + directions, shared + own);
    if lost[..place].iter().any(|l| *l > LOST) {
        return None;
    }
    let mut often = columns.residuals.len();
    let fast: Vec<bool> = columns
        .candidates
        .iter()
        .map(|candidate| {
            let p = candidate.coefficients().len();
            let at = if candidate.turns_camera() {
                &mut turn
            } else {
                &mut place
            };
            let own = *at..*at + p;
            *at = own.end;
            let mut seen = lost[own].iter().filter(|l| !l.is_nan()).peekable();
            let most = if candidate.describes() { ROUGHLY } else { LOST };
            let fast = seen.peek().is_none() || seen.any(|l| *l > most);
            often += if fast { p } else { 0 };
            fast
        })
        .collect();
    let seldom = (count - often) as f64 * nodes.len() as f64 / frames;
    let cost = often as f64 + seldom;
    (2.0 * cost < count as f64).then_some((fast, cost))
}

/// Adds what a column of `rows` a frame differs by from its lines over a group, and all of it, in square.
fn add(sums: &mut [f64; 2], node: &Node, rows: usize, value: impl Fn(usize) -> f64) {
    let Some(other) = node.other else { return };
    let first = node.group.start;
    for i in 0..rows {
        let at = |k: usize| value((k - first) * rows + i);
        let (a, b) = (at(node.frame), at(other));
        for k in node.group.clone() {
            let (share, v) = (node.share(k), at(k));
            sums[0] += (v - share * a - (1.0 - share) * b).powi(2);
            sums[1] += v * v;
        }
    }
}
