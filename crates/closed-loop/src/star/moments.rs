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
//! for bins; beside a reference with white noise the same with `N_b + P` for `N_b`
//! ([`crate::star::reference_noise`]); under a slow error of the reference, `R / sigma^2` and the products of the
//! innovations of theta ([`coloured_noise::CommonNoise`]). Sums go in the order of the data
//! within blocks: the numbers do not depend on the threads.
//!
//! Source: the partitioned normal equations of bundle adjustment (Brown 1958).

mod by_frame;
mod paced;
mod sums;
#[cfg(test)]
mod tests;

use std::sync::{Arc, OnceLock};

use block_regression::{BlockGrams, Folds, Gram, Symmetric};
use coloured_noise::{CommonNoise, Filter, Rotations};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rayon::prelude::*;

use self::by_frame::ByFrame;
use self::paced::Paced;
pub(super) use self::sums::SOLVING;
use self::sums::{Scratch, SolvedBins, Sums};
use crate::bins::Bins;
use crate::star::columns::StarColumns;

/// About as many bins as the rotations are averaged over at most.
pub(crate) const MOST_BINS: usize = 1200;
/// The same where the reference errs from one frame to the next by as much as the stars: within a bin, that would
/// be noise of the centroids.
pub(crate) const MOST_RESTLESS_BINS: usize = 6000;

/// Frames by columns of which every frame's moments are kept at most: 100 MB.
const MOST_BY_FRAME: usize = 100_000_000 / (3 * size_of::<f64>());

/// Blocks at least that one scratch is for.
const TOGETHER: usize = 4;

/// Blocks whose sums are added by one thread.
const ADDED: usize = 16;

/// A pivot below this share of its diagonal is rounding.
const SINGULAR: f64 = 1e-12;

/// Which rotations are kept apart.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Keep<'a> {
    /// None: white noise alone.
    None,
    /// Every frame's own, to be thrown away: its attitude is free.
    Free,
    /// Every frame's own, with this prior precision about each axis: the reference has white noise.
    Drawn([f64; 3]),
    /// Means over bins.
    Bins(&'a Bins),
    /// The same and, where there is room, the moments of every frame.
    BinsAndFrames(&'a Bins),
}

impl<'a> Keep<'a> {
    fn bins(self) -> Option<&'a Bins> {
        match self {
            Keep::Bins(bins) | Keep::BinsAndFrames(bins) => Some(bins),
            Keep::None | Keep::Free | Keep::Drawn(_) => None,
        }
    }
}

/// What the pass keeps of a block.
#[derive(Clone, Debug)]
struct Block {
    /// R; G where no rotation is kept apart.
    rest: Arc<Symmetric>,
    /// Products of the rows of bins without an attitude; they are not in R.
    lost: Option<Symmetric>,
    /// Scalars of G and of R.
    scalars: f64,
    rest_scalars: f64,
    /// Mean rotations, three rows a bin.
    theta: DMatrix<f64>,
    /// Inverse of N of each bin; `None`: no attitude there, and no rotation.
    inverse: Vec<Option<Matrix3<f64>>>,
    /// What the log-likelihood of the scalars lacks, nats.
    log_scale: f64,
    /// M and N of every frame, where these are kept and no bin has too few stars.
    by_frame: Option<ByFrame>,
}

impl Block {
    /// G of some columns.
    fn gram(&self, columns: &[usize]) -> Gram {
        let mut rest = shared(&self.rest, columns);
        if let Some(lost) = &self.lost {
            Arc::make_mut(&mut rest).add(1.0, &lost.picked(columns));
        }
        Gram::new(1.0, rest, self.whitened(columns))
    }

    /// Rows whose products are what the rotations take out of G.
    fn whitened(&self, columns: &[usize]) -> DMatrix<f64> {
        let mut whitened = self.theta.select_columns(columns);
        for (bin, inverse) in self.inverse.iter().enumerate() {
            let root = inverse.and_then(|v| v.cholesky()?.l().try_inverse());
            let part = whitened.fixed_rows::<3>(3 * bin).into_owned();
            whitened
                .fixed_rows_mut::<3>(3 * bin)
                .copy_from(&(root.unwrap_or_else(Matrix3::zeros) * part));
        }
        whitened
    }

    /// Scalars of R and of the bins' rotations.
    fn solved_scalars(&self) -> f64 {
        self.rest_scalars + 3.0 * self.inverse.iter().flatten().count() as f64
    }

    /// The block with every bin's rotation thrown away.
    fn freed(self) -> Self {
        Self {
            lost: None,
            scalars: self.rest_scalars,
            theta: DMatrix::zeros(0, self.rest.size()),
            inverse: Vec::new(),
            by_frame: None,
            ..self
        }
    }
}

/// See the module.
#[derive(Clone, Debug)]
pub(crate) struct StarMoments {
    blocks: Vec<Block>,
    /// Mean time of the bins, s.
    t_s: Vec<f64>,
    /// Frames of each bin.
    frames: Vec<usize>,
    /// Sums over the blocks, once they are asked for: of R, and of the products under white noise.
    rest: OnceLock<Symmetric>,
    rest_by_fold: OnceLock<Arc<Vec<Symmetric>>>,
    white: OnceLock<Symmetric>,
    fold_of_block: Vec<usize>,
}

impl StarMoments {
    /// One pass over `columns`.
    pub(crate) fn accumulate(columns: &StarColumns<'_>, folds: &Folds, keep: Keep<'_>) -> Self {
        // with a fortieth of the rows it saves nothing
        let long = columns.data.is_long();
        let paced = match keep {
            _ if !long => None,
            Keep::None => Paced::of(columns, &folds.blocks),
            Keep::Bins(bins) | Keep::BinsAndFrames(bins) => Paced::of(columns, &bins.rows),
            Keep::Free | Keep::Drawn(_) => None,
        };
        let room = || columns.layout().width() * columns.data.frames.frames() < MOST_BY_FRAME;
        let by_frame = matches!(keep, Keep::BinsAndFrames(_)) && !long && room();
        let sums = |frames, bins: Option<&SolvedBins<'_>>, scratch: &mut Scratch| match &paced {
            Some(paced) => paced.sums(columns, frames, bins, scratch),
            None => Sums::over(columns, frames, bins, scratch),
        };
        let block = |scratch: &mut Scratch, b: usize| {
            let frames = folds.blocks[b].clone();
            match keep {
                Keep::None => sums(frames, None, scratch).block(scratch),
                Keep::Free => {
                    let bins = SolvedBins::frames(&frames);
                    sums(frames, Some(&bins), scratch).block(scratch).freed()
                }
                Keep::Drawn(precision) => {
                    let bins = SolvedBins {
                        least: 1,
                        ..SolvedBins::frames(&frames)
                    };
                    sums(frames, Some(&bins), scratch).drawn(precision, scratch)
                }
                Keep::Bins(bins) | Keep::BinsAndFrames(bins) => {
                    let bins = SolvedBins {
                        frames: bins.rows[bins.folds.blocks[b].clone()].into(),
                        least: SOLVING,
                        by_frame,
                    };
                    sums(frames, Some(&bins), scratch).block(scratch)
                }
            }
        };
        let blocks = (0..folds.blocks.len())
            .into_par_iter()
            .with_min_len(TOGETHER)
            .map_init(Scratch::default, block)
            .collect();
        let (t_s, frames) = keep.bins().map_or_else(Default::default, |bins| {
            let frames = bins.rows.iter().map(ExactSizeIterator::len);
            (bins.t_s.clone(), frames.collect())
        });
        Self::of(blocks, t_s, frames, folds.fold_of_block.clone())
    }

    fn of(
        blocks: Vec<Block>,
        t_s: Vec<f64>,
        frames: Vec<usize>,
        fold_of_block: Vec<usize>,
    ) -> Self {
        Self {
            blocks,
            t_s,
            frames,
            rest: OnceLock::new(),
            rest_by_fold: OnceLock::new(),
            white: OnceLock::new(),
            fold_of_block,
        }
    }

    /// The products under white noise, of a pass that kept no rotation apart.
    pub(crate) fn white(self) -> BlockGrams {
        let log_scale = self.blocks.iter().map(|b| b.log_scale).sum();
        let (gram, scalars) = self
            .blocks
            .into_iter()
            .map(|b| {
                assert!(b.inverse.is_empty(), "rotations are in no block");
                (Gram::whole(b.rest), b.scalars)
            })
            .unzip();
        BlockGrams {
            gram,
            scalars,
            log_scale,
            known: None,
            by_source: Vec::new(),
        }
    }

    /// The sum over the blocks of the products under white noise, of some of the columns.
    pub(crate) fn white_in_all(&self, columns: &[usize]) -> BlockGrams {
        self.white_as_one(self.white_sum().picked(columns))
    }

    /// Their sum, as one block.
    fn white_as_one(&self, sum: Symmetric) -> BlockGrams {
        BlockGrams::whole(sum, self.blocks.iter().map(|b| b.scalars).sum())
    }

    /// The sum over the blocks of the products under white noise.
    fn white_sum(&self) -> &Symmetric {
        self.white.get_or_init(|| {
            let all: Vec<usize> = (0..self.width()).collect();
            let some = self.blocks.par_chunks(ADDED);
            let parts = some.map(|blocks| {
                let mut sum = Symmetric::zeros(all.len());
                for block in blocks {
                    if let Some(lost) = &block.lost {
                        sum.add(1.0, lost);
                    }
                    sum.add_products(1.0, &block.whitened(&all));
                }
                sum
            });
            let parts: Vec<Symmetric> = parts.collect();
            let mut sum = self.rest().clone();
            parts.iter().for_each(|part| sum.add(1.0, part));
            sum
        })
    }

    /// The sums of R over the blocks of each fold, where all columns are asked for.
    fn known(&self, columns: &[usize]) -> Option<Arc<Vec<Symmetric>>> {
        is_all(columns, self.width()).then(|| self.rest_by_fold().clone())
    }

    fn rest_by_fold(&self) -> &Arc<Vec<Symmetric>> {
        self.rest_by_fold.get_or_init(|| {
            let width = self.width();
            let folds = 0..self.fold_of_block.iter().map(|f| f + 1).max().unwrap_or(0);
            let of = |f| {
                let own = self.blocks.iter().zip(&self.fold_of_block);
                let own = own.filter(|(_, of)| **of == f);
                let mut sum = Symmetric::zeros(width);
                own.for_each(|(b, _)| sum.add(1.0, &b.rest));
                sum
            };
            Arc::new(folds.into_par_iter().map(of).collect())
        })
    }

    /// Sums what hypotheses need, those in `all` under white noise, too. Two that are scored side by side must find it
    /// there: a thread that waits for the parts of a sum may take up the other, which would wait for the same sum on the
    /// same thread.
    pub(crate) fn sum_up(&self, all: bool) {
        self.rest();
        if all {
            self.white_sum();
        }
    }

    /// The sum over the blocks of R.
    fn rest(&self) -> &Symmetric {
        self.rest.get_or_init(|| {
            let mut sum = Symmetric::zeros(self.width());
            let parts = self.rest_by_fold().iter();
            parts.for_each(|part| sum.add(1.0, part));
            sum
        })
    }

    /// The products of some of the columns under white noise.
    pub(crate) fn white_of(&self, columns: &[usize]) -> BlockGrams {
        BlockGrams {
            gram: self.blocks.par_iter().map(|b| b.gram(columns)).collect(),
            scalars: self.blocks.iter().map(|b| b.scalars).collect(),
            log_scale: 0.0,
            known: self
                .known(columns)
                .filter(|_| self.blocks.iter().all(|b| b.lost.is_none())),
            by_source: Vec::new(),
        }
    }

    /// Columns of the pass.
    pub(crate) fn width(&self) -> usize {
        self.blocks.first().map_or(0, |b| b.rest.size())
    }

    /// The products of `columns` under `noise`: of scalars of unit variance.
    pub(crate) fn under(&self, columns: &[usize], noise: &CommonNoise) -> BlockGrams {
        self.under_without(columns, noise, None)
    }

    /// The same where the rotations of the bins of the fold `gap` are not known.
    pub(crate) fn under_without(
        &self,
        columns: &[usize],
        noise: &CommonNoise,
        gap: Option<usize>,
    ) -> BlockGrams {
        let weight = noise.centroid.powi(-2);
        let (log_scale, innovations) = self.innovations(columns, noise, gap);
        let gram = self
            .blocks
            .par_iter()
            .zip(innovations)
            .map(|(k, e)| Gram::new(weight, shared(&k.rest, columns), e))
            .collect();
        BlockGrams {
            gram,
            scalars: self.blocks.iter().map(Block::solved_scalars).collect(),
            log_scale,
            known: self.known(columns),
            by_source: Vec::new(),
        }
    }

    /// The sum over the blocks of [`under`](Self::under).
    pub(crate) fn under_in_all(&self, columns: &[usize], noise: &CommonNoise) -> BlockGrams {
        let weight = noise.centroid.powi(-2);
        let (log_scale, innovations) = self.innovations(columns, noise, None);
        let mut gram = Symmetric::zeros(columns.len());
        gram.add(weight, &self.rest().picked(columns));
        for e in innovations {
            gram.add_products(1.0, &e);
        }
        let scalars = self.blocks.iter().map(Block::solved_scalars).sum();
        BlockGrams {
            log_scale,
            ..BlockGrams::whole(gram, scalars)
        }
    }

    /// Whitened innovations of the rotations, block by block, and what the log-likelihood of scalars
    /// under `noise` lacks. Those of the fold `gap` are not known.
    fn innovations(
        &self,
        columns: &[usize],
        noise: &CommonNoise,
        gap: Option<usize>,
    ) -> (f64, Vec<DMatrix<f64>>) {
        let folds = self.blocks.iter().zip(&self.fold_of_block);
        let inverse: Vec<Option<Matrix3<f64>>> = folds
            .flat_map(|(b, fold)| {
                let known = gap != Some(*fold);
                b.inverse.iter().map(move |v| v.filter(|_| known))
            })
            .collect();
        let filter = Filter::new(noise, &self.t_s, &self.frames, &inverse);
        let mut log_scale = filter.log_scale;
        let mut first = 0;
        let mut out = Vec::with_capacity(self.blocks.len());
        let mut state = vec![Vector3::zeros(); columns.len()];
        for k in &self.blocks {
            let steps = first..first + k.inverse.len();
            first = steps.end;
            log_scale -= k.rest_scalars * noise.centroid.ln();
            out.push(filter.innovations(steps, &k.theta, columns, &mut state));
        }
        (log_scale, out)
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
        let sse = self.rest().picked(columns).quadratic(&left);
        let mut rest = 0.0;
        let mut rotations = Vec::with_capacity(3 * self.t_s.len());
        let mut inverse = Vec::with_capacity(self.t_s.len());
        for kept in &self.blocks {
            rest += kept.rest_scalars;
            let mut theta = kept.theta.column(residual).into_owned();
            for (&column, b) in fitted.iter().zip(beta.iter()) {
                theta.axpy(-b, &kept.theta.column(column), 1.0);
            }
            rotations.extend_from_slice(theta.as_slice());
            inverse.extend_from_slice(&kept.inverse);
        }
        let freedom = rest - freedom as f64;
        (freedom > 0.0).then(|| {
            Rotations::new(
                self.t_s.clone(),
                rotations,
                self.frames.clone(),
                inverse,
                (sse.max(0.0) / freedom).sqrt(),
            )
        })
    }
}

fn is_all(columns: &[usize], width: usize) -> bool {
    columns.len() == width && columns.iter().enumerate().all(|(i, &c)| i == c)
}

/// Rows and columns `columns` of a matrix, without a copy where that is all.
fn shared(matrix: &Arc<Symmetric>, columns: &[usize]) -> Arc<Symmetric> {
    if is_all(columns, matrix.size()) {
        matrix.clone()
    } else {
        Arc::new(matrix.picked(columns))
    }
}

impl Block {
    /// Takes out of R what rotations of frames with these M and N explain that have a prior of this
    /// precision.
    fn draw(&mut self, moments: &DMatrix<f64>, normals: &[Matrix3<f64>], precision: [f64; 3]) {
        let prior = Matrix3::from_diagonal(&precision.into());
        let mut whitened = DMatrix::zeros(moments.nrows(), moments.ncols());
        for (frame, normal) in normals.iter().enumerate() {
            let Some(root) = (normal + prior).cholesky().map(|c| c.l()) else {
                continue;
            };
            let part = moments.fixed_rows::<3>(3 * frame);
            if let Some(inverse) = root.try_inverse() {
                whitened
                    .fixed_rows_mut::<3>(3 * frame)
                    .copy_from(&(inverse * part));
            }
            // half of ln det of I + N P^-1
            self.log_scale -= (0..3)
                .map(|k| root[(k, k)].ln() - 0.5 * precision[k].ln())
                .sum::<f64>();
        }
        Arc::make_mut(&mut self.rest).add_products(-1.0, &whitened);
    }

    /// Takes the rotations of bins with these M and N out of R.
    fn keep_apart(&mut self, mut moments: DMatrix<f64>, normals: &[Matrix3<f64>]) {
        let mut whitened = DMatrix::zeros(moments.nrows(), moments.ncols());
        for (bin, normal) in normals.iter().enumerate() {
            let solved = normal
                .cholesky()
                .filter(|c| {
                    let pivots = c.l_dirty().diagonal();
                    (0..3).all(|k| pivots[k].powi(2) > SINGULAR * normal[(k, k)])
                })
                .and_then(|c| Some((c.l().try_inverse()?, c.inverse())));
            let part = moments.fixed_rows::<3>(3 * bin).into_owned();
            let mut theta = moments.fixed_rows_mut::<3>(3 * bin);
            if let Some((root, whole)) = solved {
                theta.copy_from(&(whole * &part));
                let mut whitened = whitened.fixed_rows_mut::<3>(3 * bin);
                whitened.copy_from(&(root * &part));
                self.rest_scalars -= 3.0;
                self.inverse.push(Some(whole));
            } else {
                theta.fill(0.0);
                self.inverse.push(None);
            }
        }
        let rest = Arc::make_mut(&mut self.rest);
        let whole = rest.diagonal();
        rest.add_products(-1.0, &whitened);
        for k in 0..rest.size() {
            // what rounding leaves of a column that is a rotation of every bin
            if rest.at(k, k) < SINGULAR * whole[k] {
                rest.clear(k);
            }
        }
        self.theta = moments;
    }
}
