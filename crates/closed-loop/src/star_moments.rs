//! One pass over the stars, for every fit at every noise.
//!
//! Noise that the stars of a frame share shows in the rotation that they agree on and
//! nowhere else. So the pass keeps, block by block, the products of all columns, and
//! for short bins of frames what turns them into the mean rotation of each column,
//!
//! ```text
//! G = sum c c^T          N_b = sum A^T A    M_b = sum A^T c    theta_b = N_b^-1 M_b
//! R = G - sum_b M_b^T N_b^-1 M_b                        what no rotation of a bin explains
//! ```
//!
//! Under white noise a fit needs G; with a free attitude in every frame, R with frames
//! for bins; under a slow error of the reference, `R / sigma^2` and the products of the
//! innovations of theta ([`crate::common_noise`]). Sums go in the order of the data
//! within blocks: the numbers do not depend on the threads.
//!
//! Source: the partitioned normal equations of bundle adjustment (Brown 1958).

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rayon::prelude::*;

use crate::bins::Bins;
use crate::common_noise::{CommonNoise, Filter, Rotations};
use crate::folds::Folds;
use crate::gram::BlockGrams;
use crate::star_columns::{Filled, Layout, StarColumns};
use crate::star_data::StarData;
use crate::frame_rotation::rotation_row;

/// Frames whose columns are filled at once: enough for the matrix product to
/// dominate, few enough to stay in cache.
const CHUNK_FRAMES: usize = 32;
/// About as many bins as the rotations are averaged over at most.
pub(crate) const MOST_BINS: usize = 1200;

/// Two stars give four numbers for three angles; one gives none to spare.
const SOLVING: usize = 2;
/// A pivot below this share of its diagonal is rounding.
const SINGULAR: f64 = 1e-12;

/// Which rotations are kept apart.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Keep<'a> {
    /// None: white noise alone.
    None,
    /// Every frame's own, to be thrown away: its attitude is free.
    Free,
    /// Means over bins.
    Bins(&'a Bins),
}

/// What the pass keeps of a block.
#[derive(Clone, Debug)]
struct Block {
    gram: DMatrix<f64>,
    scalars: f64,
    rotations: Option<Kept>,
}

#[derive(Clone, Debug)]
struct Kept {
    /// R.
    rest: DMatrix<f64>,
    /// Independent scalars in it.
    rest_scalars: f64,
    /// Mean rotations, three rows a bin.
    theta: DMatrix<f64>,
    /// Inverse of N of each bin; `None`: no attitude there.
    inverse: Vec<Option<Matrix3<f64>>>,
}

/// See the module.
#[derive(Clone, Debug)]
pub(crate) struct StarMoments {
    blocks: Vec<Block>,
    /// Mean time of the bins, s.
    t_s: Vec<f64>,
    /// Frames of each bin.
    frames: Vec<usize>,
}

impl StarMoments {
    /// One pass over `columns`.
    pub(crate) fn accumulate(columns: &StarColumns<'_>, folds: &Folds, keep: Keep<'_>) -> Self {
        let blocks = (0..folds.blocks.len())
            .into_par_iter()
            .map(|b| {
                let frames = folds.blocks[b].clone();
                match keep {
                    Keep::None => Sums::over(columns, frames, None).block(),
                    Keep::Free => {
                        let own: Vec<Range<usize>> = frames.clone().map(|k| k..k + 1).collect();
                        Sums::over(columns, frames, Some(&own)).block().freed()
                    }
                    Keep::Bins(bins) => {
                        let own = &bins.rows[bins.folds.blocks[b].clone()];
                        Sums::over(columns, frames, Some(own)).block()
                    }
                }
            })
            .collect();
        let (t_s, frames) = match keep {
            Keep::Bins(bins) => (
                bins.t_s.clone(),
                bins.rows.iter().map(ExactSizeIterator::len).collect(),
            ),
            _ => (Vec::new(), Vec::new()),
        };
        Self {
            blocks,
            t_s,
            frames,
        }
    }

    /// The products under white noise.
    pub(crate) fn white(self) -> BlockGrams {
        let (gram, scalars) = self
            .blocks
            .into_iter()
            .map(|b| (b.gram, b.scalars))
            .unzip();
        BlockGrams {
            gram,
            scalars,
            log_scale: 0.0,
        }
    }

    /// The same of some of the columns.
    pub(crate) fn white_of(&self, columns: &[usize]) -> BlockGrams {
        BlockGrams {
            gram: self.blocks.iter().map(|b| pick(&b.gram, columns)).collect(),
            scalars: self.blocks.iter().map(|b| b.scalars).collect(),
            log_scale: 0.0,
        }
    }

    /// Columns of the pass.
    pub(crate) fn width(&self) -> usize {
        self.blocks.first().map_or(0, |b| b.gram.ncols())
    }

    /// The products of `columns` under `noise`: of scalars of unit variance.
    pub(crate) fn under(&self, columns: &[usize], noise: &CommonNoise) -> BlockGrams {
        let kept: Vec<&Kept> = self
            .blocks
            .iter()
            .filter_map(|b| b.rotations.as_ref())
            .collect();
        let inverse: Vec<Option<Matrix3<f64>>> =
            kept.iter().flat_map(|k| k.inverse.iter().copied()).collect();
        let filter = Filter::new(noise, &self.t_s, &self.frames, &inverse);
        let mut log_scale = filter.log_scale;
        let weight = noise.centroid.powi(-2);
        let mut first = 0;
        let mut jobs = Vec::with_capacity(kept.len());
        let mut state = vec![Vector3::zeros(); columns.len()];
        for k in &kept {
            let steps = first..first + k.inverse.len();
            first = steps.end;
            log_scale -= k.rest_scalars * noise.centroid.ln();
            jobs.push((k, filter.innovations(steps, &k.theta, columns, &mut state)));
        }
        let gram = jobs
            .into_par_iter()
            .map(|(k, e)| {
                let mut gram = pick(&k.rest, columns) * weight;
                gram.gemm(1.0, &e.transpose(), &e, 1.0);
                gram
            })
            .collect();
        let scalars = kept.iter().map(|k| {
            let solved = k.inverse.iter().flatten().count();
            k.rest_scalars + 3.0 * solved as f64
        });
        BlockGrams {
            gram,
            scalars: scalars.collect(),
            log_scale,
        }
    }

    /// Rotations of the last of `columns` less `beta` times the others; `freedom` is
    /// what was fitted. `None` where hardly any frame has an attitude of its own.
    pub(crate) fn rotations(
        &self,
        columns: &[usize],
        beta: &DVector<f64>,
        freedom: usize,
    ) -> Option<Rotations> {
        let (&residual, fitted) = columns.split_last()?;
        let left = DVector::from_iterator(
            columns.len(),
            beta.iter().map(|b| -b).chain(std::iter::once(1.0)),
        );
        let (mut sse, mut rest) = (0.0, 0.0);
        let mut mean: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(self.t_s.len()));
        let mut count = mean.clone();
        for kept in self.blocks.iter().filter_map(|b| b.rotations.as_ref()) {
            sse += left.dot(&(pick(&kept.rest, columns) * &left));
            rest += kept.rest_scalars;
            let mut theta = kept.theta.column(residual).into_owned();
            for (&column, b) in fitted.iter().zip(beta.iter()) {
                theta.axpy(-b, &kept.theta.column(column), 1.0);
            }
            for (bin, inverse) in kept.inverse.iter().enumerate() {
                for axis in 0..3 {
                    mean[axis].push(theta[3 * bin + axis]);
                    count[axis].push(inverse.map_or(0.0, |v| v[(axis, axis)].recip()));
                }
            }
        }
        let freedom = rest - freedom as f64;
        (freedom > 0.0).then(|| {
            let frames = self.frames.iter().sum::<usize>();
            Rotations::new(
                self.t_s.clone(),
                mean,
                count,
                (sse.max(0.0) / freedom).sqrt(),
                frames as f64 / self.t_s.len().max(1) as f64,
            )
        })
    }
}

/// Rows and columns `columns` of a matrix.
fn pick(matrix: &DMatrix<f64>, columns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
        matrix[(columns[i], columns[j])]
    })
}

/// Sums of one block.
struct Sums {
    layout: Layout,
    /// D^T D, D^T X and D^T Y, X^T X + Y^T Y.
    shared: DMatrix<f64>,
    cross: [DMatrix<f64>; 2],
    own: DMatrix<f64>,
    scalars: usize,
    /// M and N of each bin.
    bins: Option<(DMatrix<f64>, Vec<Matrix3<f64>>)>,
    /// Rows of bins that have no attitude.
    lost: Option<Box<Sums>>,
}

impl Sums {
    fn over(
        columns: &StarColumns<'_>,
        frames: Range<usize>,
        bins: Option<&[Range<usize>]>,
    ) -> Self {
        let layout = columns.layout();
        let mut sums = Self::zero(layout);
        sums.bins = bins.map(|b| {
            (
                DMatrix::zeros(3 * b.len(), layout.width()),
                vec![Matrix3::zeros(); b.len()],
            )
        });
        let used = |frame: usize| {
            let rows = columns.data.frames.rows_of(frame);
            rows.filter(|&r| !columns.data.outlier[r]).count()
        };
        let without: Vec<bool> = bins.map_or_else(Vec::new, |ranges| {
            let stars = |r: &Range<usize>| r.clone().map(used).sum::<usize>();
            ranges.iter().map(|r| stars(r) < SOLVING).collect()
        });
        let mut filled = Filled::default();
        let mut jacobian = Vec::new();
        let mut at = frames.start;
        let mut bin = 0;
        while at < frames.end {
            let chunk = at..(at + CHUNK_FRAMES).min(frames.end);
            columns.fill(chunk.clone(), &mut filled);
            sums.scalars += 2 * columns.mask(chunk.clone(), &mut filled);
            sums.add(&filled);
            if let (Some(ranges), Some((moments, normals))) = (bins, &mut sums.bins) {
                let first = columns.data.frames.first_row[chunk.start];
                for frame in chunk.clone() {
                    while ranges[bin].end <= frame {
                        bin += 1;
                    }
                    if without[bin] {
                        let rows = columns.data.frames.rows_of(frame);
                        let local = rows.start - first..rows.end - first;
                        let lost = sums
                            .lost
                            .get_or_insert_with(|| Box::new(Self::zero(layout)));
                        lost.scalars += 2 * used(frame);
                        lost.add(&filled.rows(local));
                        continue;
                    }
                    add_frame(
                        columns.data,
                        frame,
                        first,
                        &filled,
                        layout,
                        &mut jacobian,
                        (moments, 3 * bin),
                        &mut normals[bin],
                    );
                }
            }
            at = chunk.end;
        }
        sums
    }

    fn zero(layout: Layout) -> Self {
        let (shared, own) = (layout.shared, layout.own());
        Self {
            layout,
            shared: DMatrix::zeros(shared, shared),
            cross: [DMatrix::zeros(shared, own), DMatrix::zeros(shared, own)],
            own: DMatrix::zeros(own, own),
            scalars: 0,
            bins: None,
            lost: None,
        }
    }

    fn add(&mut self, filled: &Filled) {
        let shared = filled.shared.transpose();
        self.shared.gemm(1.0, &shared, &filled.shared, 1.0);
        for axis in 0..2 {
            let own = &filled.own[axis];
            self.cross[axis].gemm(1.0, &shared, own, 1.0);
            self.own.gemm(1.0, &own.transpose(), own, 1.0);
        }
    }

    /// The products in the order of a Gram matrix.
    fn gram(&self) -> DMatrix<f64> {
        let layout = self.layout;
        let mut gram = DMatrix::zeros(layout.width(), layout.width());
        for j in 0..layout.shared {
            for i in 0..layout.shared {
                for axis in 0..2 {
                    gram[(layout.shared_at(i, axis), layout.shared_at(j, axis))] =
                        self.shared[(i, j)];
                }
            }
        }
        for j in 0..layout.own() {
            let column = layout.own_at(j);
            for i in 0..layout.own() {
                gram[(layout.own_at(i), column)] = self.own[(i, j)];
            }
            for axis in 0..2 {
                for i in 0..layout.shared {
                    let row = layout.shared_at(i, axis);
                    gram[(row, column)] = self.cross[axis][(i, j)];
                    gram[(column, row)] = self.cross[axis][(i, j)];
                }
            }
        }
        gram
    }

    fn block(self) -> Block {
        let gram = self.gram();
        let lost = self.lost.as_ref();
        let rest = lost.map_or_else(|| gram.clone(), |l| &gram - l.gram());
        let scalars = self.scalars - lost.map_or(0, |l| l.scalars);
        let rotations = self
            .bins
            .map(|(moments, normals)| kept(rest, scalars, moments, &normals));
        Block {
            gram,
            scalars: self.scalars as f64,
            rotations,
        }
    }
}

/// Adds a frame's moments to its bin's.
#[expect(clippy::too_many_arguments, reason = "one inner loop, its scratch with it")]
fn add_frame(
    data: &StarData,
    frame: usize,
    first: usize,
    filled: &Filled,
    layout: Layout,
    jacobian: &mut Vec<[[f64; 3]; 2]>,
    (moments, at): (&mut DMatrix<f64>, usize),
    normal: &mut Matrix3<f64>,
) {
    let rows = data.frames.rows_of(frame);
    let local = rows.start - first..rows.end - first;
    jacobian.clear();
    for row in rows {
        let j = if data.outlier[row] {
            [[0.0; 3]; 2]
        } else {
            rotation_row(data, row)
        };
        for a in j.map(Vector3::from) {
            *normal += a * a.transpose();
        }
        jacobian.push(j);
    }
    let mut add = |column: usize, axis: usize, values: &[f64]| {
        let mut sum = Vector3::zeros();
        for (j, v) in jacobian.iter().zip(values) {
            sum += Vector3::from(j[axis]) * *v;
        }
        for k in 0..3 {
            moments[(at + k, column)] += sum[k];
        }
    };
    let n = filled.shared.nrows();
    let values = |m: &DMatrix<f64>, column: usize| -> Range<usize> {
        debug_assert_eq!(m.nrows(), n);
        column * n + local.start..column * n + local.end
    };
    for k in 0..layout.shared {
        let part = &filled.shared.as_slice()[values(&filled.shared, k)];
        for axis in 0..2 {
            add(layout.shared_at(k, axis), axis, part);
        }
    }
    for k in 0..layout.own() {
        for axis in 0..2 {
            let own = &filled.own[axis];
            add(layout.own_at(k), axis, &own.as_slice()[values(own, k)]);
        }
    }
}

fn kept(
    mut rest: DMatrix<f64>,
    scalars: usize,
    mut moments: DMatrix<f64>,
    normals: &[Matrix3<f64>],
) -> Kept {
    let mut rest_scalars = scalars as f64;
    let mut inverse = Vec::with_capacity(normals.len());
    let mut whitened = DMatrix::zeros(moments.nrows(), moments.ncols());
    for (bin, normal) in normals.iter().enumerate() {
        let solved = normal
            .cholesky()
            .filter(|c| {
                let pivots = c.l_dirty().diagonal();
                (0..3).all(|k| pivots[k].powi(2) > SINGULAR * normal[(k, k)])
            })
            .and_then(|c| Some((c.l().try_inverse()?, c.inverse())));
        let Some((root, whole)) = solved else {
            moments.rows_mut(3 * bin, 3).fill(0.0);
            inverse.push(None);
            continue;
        };
        let part = moments.fixed_rows::<3>(3 * bin).into_owned();
        whitened.fixed_rows_mut::<3>(3 * bin).copy_from(&(root * &part));
        moments.fixed_rows_mut::<3>(3 * bin).copy_from(&(whole * &part));
        rest_scalars -= 3.0;
        inverse.push(Some(whole));
    }
    rest.gemm(-1.0, &whitened.transpose(), &whitened, 1.0);
    Kept {
        rest,
        rest_scalars,
        theta: moments,
        inverse,
    }
}

impl Block {
    /// The block with every bin's rotation thrown away.
    fn freed(self) -> Self {
        match self.rotations {
            Some(kept) => Self {
                gram: kept.rest,
                scalars: kept.rest_scalars,
                rotations: None,
            },
            None => self,
        }
    }
}
