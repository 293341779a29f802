//! The sums of one block, in one pass over its rows.
//!
//! Columns are filled a few frames at a time and turned over, so that the columns of one
//! row lie side by side; those that are zero there are left out. What turns the camera
//! acts through the moments of a frame alone, axis by axis,
//!
//! ```text
//! M_k = A_k^T c     T^T A^T c = sum over axes and frames of T_k M_k     A^T A T = N_k T_k
//! ```
//!
//! Source: matrix products by blocks.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use block_regression::{Part, Symmetric};
use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, DVector, Dyn, Matrix3, Vector3};

use super::Block;
use super::by_frame::ByFrame;
use crate::star::columns::StarColumns;
use crate::star::frame_rotation::rotation_row;
use crate::star::layout::{Filled, Layout, zeros_in};

/// Frames whose columns are filled at once: enough for the matrix product to
/// dominate, few enough to stay in cache.
const CHUNK_FRAMES: usize = 16;
/// Frames whose turns are multiplied at once.
const TURN_FRAMES: usize = 4 * CHUNK_FRAMES;
/// Columns of a product that are formed at once: a product of columns with themselves
/// needs only what lies below the diagonal.
const PANEL: usize = 48;
/// Columns that are turned over at once.
const TURNED: usize = 8;
/// Two stars give four numbers for three angles; one gives none to spare.
pub(in crate::star) const SOLVING: usize = 2;

/// Bins of frames whose rotations are kept apart.
pub(super) struct SolvedBins<'a> {
    pub(super) frames: Cow<'a, [Range<usize>]>,
    /// Fewest stars of one that has a rotation.
    pub(super) least: usize,
    /// Whether every frame's are kept as well.
    pub(super) by_frame: bool,
}

impl SolvedBins<'_> {
    /// A bin each.
    pub(super) fn frames(frames: &Range<usize>) -> Self {
        Self {
            frames: frames.clone().map(|k| k..k + 1).collect(),
            least: SOLVING,
            by_frame: false,
        }
    }
}

/// M, three columns a bin, and N.
type Turned = (DMatrix<f64>, Vec<Matrix3<f64>>);

/// Sums of one block; columns stand in the order of [`Layout::places`].
pub(super) struct Sums {
    layout: Layout,
    /// D^T D, below the diagonal.
    shared: DMatrix<f64>,
    /// [D^T X; D^T Y].
    cross: DMatrix<f64>,
    /// X^T X + Y^T Y, below the diagonal.
    own: DMatrix<f64>,
    /// Products of all columns with T.
    turn: DMatrix<f64>,
    scalars: usize,
    /// M of each bin, three columns a bin, and N.
    bins: Option<Turned>,
    by_frame: Option<ByFrame>,
    /// Products of the rows of bins that have no attitude, and how many scalars.
    lost: Option<(DMatrix<f64>, usize)>,
    /// Columns of X and Y whose products are known better ([`super::paced`]), and these, below the diagonal.
    fast: Option<(Vec<usize>, DMatrix<f64>)>,
}

/// What [`Sums`] are in: nobody needs the values any more.
struct Space {
    shared: DMatrix<f64>,
    cross: DMatrix<f64>,
    own: DMatrix<f64>,
    turn: DMatrix<f64>,
    moments: DMatrix<f64>,
}

/// Scratch of the inner loop, and of one block after another.
pub(super) struct Scratch {
    space: Space,
    pub(super) filled: Filled,
    jacobian: Vec<[[f64; 3]; 2]>,
    /// N of each frame.
    normal: Vec<Matrix3<f64>>,
    axes: [Compact; 2],
    sums: [OwnSums; 2],
    /// M about each axis, a column a frame, of the last frames; and their T.
    moments: [DMatrix<f64>; 3],
    turn: DMatrix<f64>,
    held: usize,
    /// What one frame adds to M.
    frame: [Vec<f64>; 3],
    turns: Compact,
    product: Vec<f64>,
}

impl Default for Scratch {
    fn default() -> Self {
        let empty = || DMatrix::zeros(0, 0);
        Self {
            space: Space {
                shared: empty(),
                cross: empty(),
                own: empty(),
                turn: empty(),
                moments: empty(),
            },
            filled: Filled::default(),
            jacobian: Vec::new(),
            normal: Vec::new(),
            axes: Default::default(),
            sums: Default::default(),
            moments: [empty(), empty(), empty()],
            turn: empty(),
            held: 0,
            frame: Default::default(),
            turns: Compact::default(),
            product: Vec::new(),
        }
    }
}

/// Products of the columns of an axis that are not all zero, as long as these are the same ones.
#[derive(Default)]
struct OwnSums {
    active: Vec<usize>,
    /// D^T X, a column each, and X^T X, below the diagonal.
    cross: Vec<f64>,
    own: Vec<f64>,
}

impl OwnSums {
    /// From now on of the columns `active`, beside `shared` polynomials.
    fn begin(&mut self, active: &[usize], shared: usize) {
        self.active.clear();
        self.active.extend_from_slice(active);
        for (sums, size) in [
            (&mut self.cross, shared * active.len()),
            (&mut self.own, active.len() * active.len()),
        ] {
            sums.clear();
            sums.resize(size, 0.0);
        }
    }
}

/// Columns that are not all zero, turned over: a column a row of the data.
#[derive(Default)]
struct Compact {
    active: Vec<usize>,
    values: Vec<f64>,
}

impl Compact {
    /// Of the first `rows` entries of each of `columns`, which are `stride` long.
    fn fill(&mut self, columns: &[f64], stride: usize, rows: usize) {
        let column = |c: usize| &columns[c * stride..c * stride + rows];
        let count = columns.len().checked_div(stride).unwrap_or(0);
        self.active.clear();
        self.active
            .extend((0..count).filter(|&c| !is_zero(column(c))));
        let width = self.active.len();
        self.values.clear();
        self.values.resize(width * rows, 0.0);
        for at in (0..width).step_by(TURNED) {
            let some = at..(at + TURNED).min(width);
            for i in 0..rows {
                let line = &mut self.values[i * width + some.start..i * width + some.end];
                for (out, &c) in line.iter_mut().zip(&self.active[some.clone()]) {
                    *out = columns[c * stride + i];
                }
            }
        }
    }

    /// A row of the data is a column.
    fn turned(&self) -> DMatrixView<'_, f64> {
        let width = self.active.len();
        let rows = self.values.len().checked_div(width).unwrap_or(0);
        DMatrixView::from_slice(&self.values, width, rows)
    }

    /// Some of the columns as they were.
    fn columns(&self, which: Range<usize>) -> DMatrixView<'_, f64, Dyn, Dyn> {
        let width = self.active.len();
        let rows = self.values.len() / width;
        let values = &self.values[which.start..];
        DMatrixView::from_slice_with_strides(values, rows, which.len(), width, 1)
    }
}

/// Whether all are zero, of either sign.
fn is_zero(values: &[f64]) -> bool {
    const LANES: usize = 8;
    let mut chunks = values.chunks_exact(LANES);
    let bits = |values: &[f64]| values.iter().fold(0, |all, v| all | v.to_bits());
    chunks.all(|some| bits(some) << 1 == 0) && bits(chunks.remainder()) << 1 == 0
}

/// A matrix of what was in `space`.
fn matrix(space: &mut Vec<f64>, rows: usize, columns: usize) -> DMatrixViewMut<'_, f64> {
    space.resize((rows * columns).max(space.len()), 0.0);
    DMatrixViewMut::from_slice(space, rows, columns)
}

impl Sums {
    pub(super) fn over(
        columns: &StarColumns<'_>,
        frames: Range<usize>,
        bins: Option<&SolvedBins<'_>>,
        scratch: &mut Scratch,
    ) -> Self {
        let layout = columns.layout();
        let fill = |chunk: Range<usize>, layout: &Layout, filled: &mut Filled| {
            columns.fill(chunk.clone(), layout, filled);
            columns.weigh(chunk, filled)
        };
        Self::filled_by(columns, layout, frames, bins, |end| end, fill, scratch)
    }

    /// No rows yet.
    pub(super) fn of_none(
        layout: Layout,
        bins: Option<&SolvedBins<'_>>,
        scratch: &mut Scratch,
    ) -> Self {
        let (shared, own, turn) = (layout.shared, layout.own.len(), layout.turn.len());
        let width = layout.width();
        let space = &mut scratch.space;
        let frames = bins.filter(|b| b.by_frame);
        let frames = frames.map(|b| b.frames.iter().map(ExactSizeIterator::len).sum());
        Self {
            shared: zeros_in(&mut space.shared, shared, shared),
            cross: zeros_in(&mut space.cross, 2 * shared, own),
            own: zeros_in(&mut space.own, own, own),
            turn: zeros_in(&mut space.turn, width, turn),
            scalars: 0,
            bins: bins.map(|b| {
                (
                    zeros_in(&mut space.moments, width, 3 * b.frames.len()),
                    vec![Matrix3::zeros(); b.frames.len()],
                )
            }),
            by_frame: frames.map(|frames| ByFrame::of_none(width, frames)),
            lost: None,
            fast: None,
            layout,
        }
    }

    /// `fill` fills some frames' rows, weighs them, and says how many count; `cut` says where they may end at
    /// the latest.
    pub(super) fn filled_by(
        columns: &StarColumns<'_>,
        layout: Layout,
        frames: Range<usize>,
        bins: Option<&SolvedBins<'_>>,
        cut: impl Fn(usize) -> usize,
        mut fill: impl FnMut(Range<usize>, &Layout, &mut Filled) -> usize,
        scratch: &mut Scratch,
    ) -> Self {
        let turn = layout.turn.len();
        let mut sums = Self::of_none(layout, bins, scratch);
        let used = |frame: usize| {
            let rows = columns.data.frames.rows_of(frame);
            rows.filter(|&r| !columns.data.outlier[r]).count()
        };
        let without: Vec<bool> = bins.map_or_else(Vec::new, |bins| {
            let stars = |r: &Range<usize>| r.clone().map(used).sum::<usize>();
            let frames = bins.frames.iter();
            frames.map(|r| stars(r) < bins.least).collect()
        });
        scratch.held = 0;
        let mut at = frames.start;
        let mut bin = 0;
        while at < frames.end {
            let chunk = at..cut((at + CHUNK_FRAMES).min(frames.end));
            at = chunk.end;
            sums.scalars += 2 * fill(chunk.clone(), &sums.layout, &mut scratch.filled);
            sums.add_rows(scratch);
            if bins.is_none() && turn == 0 {
                continue;
            }
            let held = scratch.moments(columns, chunk.clone(), &sums.layout);
            if turn > 0 && (scratch.held + CHUNK_FRAMES > TURN_FRAMES || at == frames.end) {
                sums.add_turns(scratch);
            }
            if turn == 0 {
                scratch.held = 0;
            }
            let Some(SolvedBins { frames: ranges, .. }) = bins else {
                continue;
            };
            if let Some(by_frame) = &mut sums.by_frame {
                by_frame.push(&scratch.moments, held, &scratch.normal);
            }
            for (k, frame) in chunk.enumerate() {
                while ranges[bin].end <= frame {
                    bin += 1;
                }
                if without[bin] {
                    sums.lose(columns, frame, k, scratch);
                } else if let Some((kept, normals)) = &mut sums.bins {
                    for (axis, moments) in scratch.moments.iter().enumerate() {
                        let mut kept = kept.column_mut(3 * bin + axis);
                        kept += moments.column(held + k);
                    }
                    normals[bin] += scratch.normal[k];
                }
            }
        }
        sums.put_all(scratch);
        sums
    }

    /// The products of columns `which` of X and Y are those of `better`, which has no others.
    pub(super) fn corrected(mut self, which: Vec<usize>, better: Self) -> Self {
        self.fast = Some((which, better.own));
        self
    }

    /// Adds what is held.
    pub(super) fn put_all(&mut self, scratch: &mut Scratch) {
        for axis in 0..2 {
            self.put(axis, &mut scratch.sums[axis]);
        }
    }

    /// Adds the products of D, X and Y.
    pub(super) fn add_rows(&mut self, scratch: &mut Scratch) {
        let Scratch {
            filled,
            axes,
            sums: held,
            ..
        } = scratch;
        let shared = &filled.shared;
        let n = shared.nrows();
        let flipped = shared.transpose();
        for start in (0..n).step_by(PANEL) {
            let panel = start..(start + PANEL).min(n);
            let left = shared.rows(start, n - start);
            self.shared
                .view_mut((start, start), (n - start, panel.len()))
                .gemm(1.0, &left, &flipped.columns(start, panel.len()), 1.0);
        }
        for axis in 0..2 {
            let (own, compact) = (&filled.own[axis], &mut axes[axis]);
            compact.fill(own.as_slice(), own.nrows(), own.nrows());
            if compact.active != held[axis].active {
                self.put(axis, &mut held[axis]);
                held[axis].begin(&compact.active, n);
            }
            let (turned, width) = (compact.turned(), compact.active.len());
            if width == 0 {
                continue;
            }
            let OwnSums { cross, own, .. } = &mut held[axis];
            DMatrixViewMut::from_slice(cross, n, width).gemm(
                1.0,
                shared,
                &compact.columns(0..width),
                1.0,
            );
            let mut own = DMatrixViewMut::from_slice(own, width, width);
            for start in (0..width).step_by(PANEL) {
                let panel = start..(start + PANEL).min(width);
                let left = turned.rows(start, width - start);
                own.view_mut((start, start), (width - start, panel.len()))
                    .gemm(1.0, &left, &compact.columns(panel), 1.0);
            }
        }
    }

    /// Adds what is held of an axis, which is then nothing.
    fn put(&mut self, axis: usize, held: &mut OwnSums) {
        let (n, width) = (self.layout.shared, held.active.len());
        let cross = DMatrixView::from_slice(&held.cross, n, width);
        let own = DMatrixView::from_slice(&held.own, width, width);
        for (j, &to) in held.active.iter().enumerate() {
            let mut into = self.cross.view_mut((axis * n, to), (n, 1));
            into += cross.column(j);
            let mut into = self.own.column_mut(to);
            for (from, &row) in own.column(j).iter().zip(&held.active).skip(j) {
                into[row] += from;
            }
        }
        held.active.clear();
    }

    /// Adds the products of all columns with T.
    fn add_turns(&mut self, scratch: &mut Scratch) {
        let Scratch {
            moments,
            turn,
            held,
            turns,
            product,
            ..
        } = scratch;
        let columns = turn.ncols() / 3;
        for (axis, moments) in moments.iter().enumerate() {
            let stride = turn.nrows();
            let own = axis * columns * stride..(axis + 1) * columns * stride;
            turns.fill(&turn.as_slice()[own], stride, *held);
            let width = turns.active.len();
            if width == 0 {
                continue;
            }
            let moments = moments.columns(0, *held);
            let mut product = matrix(product, moments.nrows(), width);
            product.gemm(1.0, &moments, &turns.columns(0..width), 0.0);
            for (from, &to) in product.column_iter().zip(&turns.active) {
                let mut into = self.turn.column_mut(to);
                into += from;
            }
        }
        *held = 0;
    }

    /// Puts the rows of frame `k` of the chunk among those of no rotation.
    fn lose(&mut self, columns: &StarColumns<'_>, frame: usize, k: usize, scratch: &Scratch) {
        let data = columns.data;
        let width = self.layout.width();
        let (lost, scalars) = self
            .lost
            .get_or_insert_with(|| (DMatrix::zeros(width, width), 0));
        let (shared, own) = (self.layout.shared, self.layout.own.len());
        let filled = &scratch.filled;
        let first = data.frames.first_row[frame - k];
        for row in data.frames.rows_of(frame).filter(|&r| !data.outlier[r]) {
            let jacobian = weighed_rotation(columns, row);
            let i = row - first;
            for axis in 0..2 {
                let mut line = DVector::zeros(width);
                line.rows_mut(axis * shared, shared)
                    .copy_from(&filled.shared.column(i));
                line.rows_mut(2 * shared, own)
                    .tr_copy_from(&filled.own[axis].row(i));
                let turned = filled.turn.fixed_rows::<3>(3 * k);
                for (j, t) in turned.column_iter().enumerate() {
                    line[2 * shared + own + j] = Vector3::from(jacobian[axis]).dot(&t);
                }
                lost.ger(1.0, &line, &line, 1.0);
            }
            *scalars += 2;
        }
    }

    /// The products, in the order of the Gram matrix.
    fn product(&self, places: &[usize]) -> Symmetric {
        let (shared, own) = (self.layout.shared, self.layout.own.len());
        let (polynomials, rest) = places.split_at(2 * shared);
        let (own, turns) = rest.split_at(own);
        let fast = self.fast.as_ref();
        let fast = fast.map(|(which, better)| {
            let which: Vec<usize> = which.iter().map(|&k| own[k]).collect();
            (better, which)
        });
        let part = |values, rows, columns| Part {
            values,
            rows,
            columns,
        };
        let axes = polynomials.chunks_exact(shared.max(1));
        let axes = axes.map(|axis| part(&self.shared, axis, axis));
        let others = [
            part(&self.own, own, own),
            part(&self.cross, polynomials, own),
            part(&self.turn, places, turns),
        ];
        let fast = fast
            .iter()
            .map(|(better, which)| part(better, which, which));
        Symmetric::of_parts(self.layout.width(), axes.chain(others).chain(fast))
    }

    /// R, with the rotations of the bins kept apart.
    pub(super) fn block(self, scratch: &mut Scratch) -> Block {
        let (mut block, bins) = self.apart(scratch);
        if let Some((moments, normals)) = bins {
            block.keep_apart(moments, &normals);
        }
        block
    }

    /// What rotations of the frames that have a prior of this `precision` do not explain.
    pub(super) fn drawn(self, precision: [f64; 3], scratch: &mut Scratch) -> Block {
        let (mut block, bins) = self.apart(scratch);
        if let Some((moments, normals)) = bins {
            block.draw(&moments, &normals, precision);
        }
        block
    }

    /// G, and M and N of the bins. What they were summed in goes back.
    fn apart(self, scratch: &mut Scratch) -> (Block, Option<Turned>) {
        let places = self.layout.places();
        let mut order = vec![0; places.len()];
        for (from, &to) in places.iter().enumerate() {
            order[to] = from;
        }
        let mut rest = self.product(&places);
        let lost = self.lost.as_ref();
        let lost = lost.map(|(lost, _)| Symmetric::of_lower(lost).picked(&order));
        let mut scalars = self.scalars;
        if let (Some((_, count)), Some(lost)) = (&self.lost, &lost) {
            rest.add(-1.0, lost);
            scalars -= count;
        }
        let width = order.len();
        let by_frame = self.by_frame.filter(|_| lost.is_none());
        let block = Block {
            rest: Arc::new(rest),
            lost,
            scalars: self.scalars as f64,
            rest_scalars: scalars as f64,
            theta: DMatrix::zeros(0, width),
            inverse: Vec::new(),
            log_scale: 0.0,
            by_frame: by_frame.map(|by_frame| by_frame.in_order(&order)),
        };
        let space = &mut scratch.space;
        let bins = self.bins.map(|(summed, normals)| {
            let moments = summed.select_rows(&order).transpose();
            space.moments = summed;
            (moments, normals)
        });
        space.shared = self.shared;
        space.cross = self.cross;
        space.own = self.own;
        space.turn = self.turn;
        (block, bins)
    }
}

impl Scratch {
    /// Columns of X or Y that were not all zero when their products were added last.
    pub(super) fn active(&self, axis: usize) -> &[usize] {
        &self.axes[axis].active
    }

    /// M of every frame and column, about each axis, and N of every frame; returns where the first
    /// frame is held.
    fn moments(
        &mut self,
        columns: &StarColumns<'_>,
        frames: Range<usize>,
        layout: &Layout,
    ) -> usize {
        let data = columns.data;
        let held = self.held;
        self.held += frames.len();
        let first = data.frames.first_row[frames.start];
        let last = data.frames.first_row[frames.end];
        self.jacobian.clear();
        self.jacobian
            .extend((first..last).map(|row| weighed_rotation(columns, row)));
        let (shared, own) = (layout.shared, layout.own.len());
        let turns = layout.turn.len();
        if self.turn.shape() != (TURN_FRAMES, 3 * turns) {
            self.turn = DMatrix::zeros(TURN_FRAMES, 3 * turns);
        }
        for (axis, moments) in self.moments.iter_mut().enumerate() {
            if moments.nrows() != layout.width() {
                *moments = DMatrix::zeros(layout.width(), TURN_FRAMES);
            }
            moments.columns_mut(held, frames.len()).fill(0.0);
            for (j, from) in self.filled.turn.column_iter().enumerate() {
                let mut into = self.turn.column_mut(axis * turns + j);
                for k in 0..frames.len() {
                    into[held + k] = from[3 * k + axis];
                }
            }
        }
        self.normal.clear();
        for (k, frame) in frames.enumerate() {
            let rows = data.frames.rows_of(frame);
            let rows = rows.start - first..rows.end - first;
            let mut normal = Matrix3::zeros();
            for a in self.jacobian[rows.clone()].iter().flatten() {
                let a = Vector3::from(*a);
                normal += a * a.transpose();
            }
            for (axis, compact) in self.axes.iter().enumerate() {
                let turns = self.jacobian[rows.clone()].iter().map(|j| j[axis]);
                let polynomials = &self.filled.shared.as_slice()[rows.start * shared..];
                let [x, y, z] = &mut self.frame;
                weigh(turns.clone(), polynomials, shared, [x, y, z]);
                for (moments, sums) in self.moments.iter_mut().zip(&self.frame) {
                    let from = (held + k) * layout.width() + axis * shared;
                    moments.as_mut_slice()[from..from + shared].copy_from_slice(sums);
                }
                let width = compact.active.len();
                let values = &compact.values[rows.start * width..];
                let [x, y, z] = &mut self.frame;
                weigh(turns, values, width, [x, y, z]);
                for (moments, sums) in self.moments.iter_mut().zip(&self.frame) {
                    let mut moments = moments.column_mut(held + k);
                    for (sum, &place) in sums.iter().zip(&compact.active) {
                        moments[2 * shared + place] += sum;
                    }
                }
            }
            for (j, turn) in self.filled.turn.column_iter().enumerate() {
                let turned = normal * turn.fixed_rows::<3>(3 * k);
                for about in 0..3 {
                    self.moments[about][(2 * shared + own + j, held + k)] = turned[about];
                }
            }
            self.normal.push(normal);
        }
        held
    }
}

/// Rotation columns of a row, times its weight.
fn weighed_rotation(columns: &StarColumns<'_>, row: usize) -> [[f64; 3]; 2] {
    let weight = columns.weight_of(row);
    if weight > 0.0 {
        rotation_row(columns.data, row).map(|axis| axis.map(|a| weight * a))
    } else {
        [[0.0; 3]; 2]
    }
}

/// Sums of rows of `values`, each `width` long, with the three weights of each row.
fn weigh(
    weights: impl Iterator<Item = [f64; 3]> + Clone,
    values: &[f64],
    width: usize,
    out: [&mut Vec<f64>; 3],
) {
    // as many as registers hold
    const LANES: usize = 8;
    let [x, y, z] = out.map(|out| {
        out.clear();
        out.resize(width, 0.0);
        &mut out[..]
    });
    let whole = width - width % LANES;
    for at in (0..whole).step_by(LANES) {
        let mut sums = [[0.0; LANES]; 3];
        for (i, w) in weights.clone().enumerate() {
            let row = &values[i * width + at..i * width + at + LANES];
            for l in 0..LANES {
                sums[0][l] += w[0] * row[l];
                sums[1][l] += w[1] * row[l];
                sums[2][l] += w[2] * row[l];
            }
        }
        x[at..at + LANES].copy_from_slice(&sums[0]);
        y[at..at + LANES].copy_from_slice(&sums[1]);
        z[at..at + LANES].copy_from_slice(&sums[2]);
    }
    for at in whole..width {
        for (i, w) in weights.clone().enumerate() {
            let value = values[i * width + at];
            x[at] += w[0] * value;
            y[at] += w[1] * value;
            z[at] += w[2] * value;
        }
    }
}
