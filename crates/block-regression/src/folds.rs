//! How the data is cut in time: folds for prediction, blocks for honest variances.
//!
//! Five contiguous folds, each predicted with every amplitude estimated on the
//! other four; with fewer than ten frames each frame is a fold of its own. Every
//! fold is cut again into contiguous blocks: sums over blocks are what a
//! cluster-robust variance needs, and a fold is a union of its blocks, so one
//! pass over the data serves both.
//!
//! Not physics: bookkeeping of time.

use std::ops::Range;

/// Folds of a data set with enough frames ([`Folds::cut`]).
const FOLDS: usize = 5;
/// Below this number of frames one frame is left out at a time.
const LEAVE_ONE_OUT_BELOW: usize = 10;
/// Blocks wanted over the whole span. A variance of p parameters
/// needs clearly more blocks than p; longer blocks hold longer correlations.
const BLOCKS: usize = 60;
/// A block shorter than this says little about correlation in time.
const MIN_BLOCK_FRAMES: usize = 8;
/// How firmly the noise of unrelated frames is held to be independent, in blocks:
/// their variances differ from that of independent noise by a third, not by factors,
/// since `2 / 20` is the squared relative scatter of a variance with so many degrees
/// of freedom. A handful of snapshots would otherwise never be sure of anything.
const UNRELATED_PRIOR: f64 = 20.0;

/// A partition of the frames `0..n` into folds of blocks, all contiguous.
///
/// A frame is what is measured at one instant: any number of scalars.
#[derive(Clone, Debug, PartialEq)]
pub struct Folds {
    /// Frames of each block, in time order.
    pub blocks: Vec<Range<usize>>,
    /// The fold of each block.
    pub fold_of_block: Vec<usize>,
    /// How many folds there are.
    pub count: usize,
    /// Blocks that the prior of independent noise counts for ([`Estimate`](crate::Estimate)): 0 where
    /// neighbours may share something.
    pub prior_blocks: f64,
}

impl Folds {
    /// Cuts `frames` frames into folds of (nearly) equal numbers of frames.
    pub fn cut(frames: usize) -> Self {
        Self::in_blocks(frames, MIN_BLOCK_FRAMES, 0.0)
    }

    /// As [`cut`](Self::cut) for frames that share nothing with their neighbours in time: a frame
    /// may be a block of its own.
    pub fn unrelated(frames: usize) -> Self {
        Self::in_blocks(frames, 1, UNRELATED_PRIOR)
    }

    fn in_blocks(frames: usize, least: usize, prior_blocks: f64) -> Self {
        let count = if frames < LEAVE_ONE_OUT_BELOW {
            frames.max(1)
        } else {
            FOLDS
        };
        let per_fold = (frames / count / least).clamp(1, BLOCKS / FOLDS);
        let pieces = count * per_fold;
        let edge = |k: usize| k * frames / pieces;
        Self {
            blocks: (0..pieces).map(|k| edge(k)..edge(k + 1)).collect(),
            fold_of_block: (0..pieces).map(|k| k / per_fold).collect(),
            count,
            prior_blocks,
        }
    }

    /// The same folds in blocks `times` as long; the last of a fold may be shorter.
    pub fn coarser(&self, times: usize) -> Self {
        let mut out = Self {
            blocks: Vec::new(),
            fold_of_block: Vec::new(),
            ..*self
        };
        let mut joined = 0;
        for (block, &fold) in self.blocks.iter().zip(&self.fold_of_block) {
            match out.blocks.last_mut() {
                Some(last) if joined < times && out.fold_of_block.last() == Some(&fold) => {
                    last.end = block.end;
                    joined += 1;
                }
                _ => {
                    out.blocks.push(block.clone());
                    out.fold_of_block.push(fold);
                    joined = 1;
                }
            }
        }
        out
    }

    /// One part in `parts` of each block, a later one in each block than in the one before, so that what
    /// comes again as blocks do is seen at all its stages.
    pub fn thinned(&self, parts: usize) -> Self {
        let part = |(k, block): (usize, &Range<usize>)| {
            let edge = |i: usize| block.start + i * block.len() / parts;
            edge(k % parts)..edge(k % parts + 1)
        };
        Self {
            blocks: self.blocks.iter().enumerate().map(part).collect(),
            fold_of_block: self.fold_of_block.clone(),
            ..*self
        }
    }

    /// The frames of each fold.
    pub fn fold_ranges(&self) -> Vec<Range<usize>> {
        (0..self.count)
            .map(|f| {
                let mut of = self
                    .blocks
                    .iter()
                    .zip(&self.fold_of_block)
                    .filter(|(_, g)| **g == f);
                let first = of.next().map_or(0..0, |(b, _)| b.clone());
                first.start..of.next_back().map_or(first.end, |(b, _)| b.end)
            })
            .collect()
    }

    /// One fold of everything, for what is not predicted.
    pub fn whole(frames: usize) -> Self {
        Self {
            blocks: std::iter::once(0..frames).collect(),
            fold_of_block: vec![0],
            count: 1,
            prior_blocks: 0.0,
        }
    }

    /// The fold of each frame as tables have it.
    pub fn column(&self) -> Vec<u32> {
        let narrow = |f| u32::try_from(f).unwrap_or(u32::MAX);
        self.fold_of_frame().into_iter().map(narrow).collect()
    }

    /// The fold of each frame, one entry a frame.
    pub fn fold_of_frame(&self) -> Vec<usize> {
        let mut fold = Vec::new();
        for (block, &f) in self.blocks.iter().zip(&self.fold_of_block) {
            fold.extend(std::iter::repeat_n(f, block.len()));
        }
        fold
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_frame_is_in_one_block_and_folds_are_contiguous() {
        for frames in [1, 4, 9, 10, 11, 83, 1592, 100_003] {
            let folds = Folds::cut(frames);
            assert_eq!(folds.blocks.first().unwrap().start, 0);
            assert_eq!(folds.blocks.last().unwrap().end, frames);
            assert!(folds.blocks.windows(2).all(|w| w[0].end == w[1].start));
            let fold = folds.fold_of_frame();
            assert_eq!(fold.len(), frames);
            assert!(fold.windows(2).all(|w| w[0] == w[1] || w[1] == w[0] + 1));
            assert_eq!(folds.count, if frames < 10 { frames } else { 5 });
            assert_eq!(*fold.last().unwrap() + 1, folds.count);
        }
    }

    #[test]
    fn coarser_blocks_stay_within_their_folds() {
        let folds = Folds::cut(100_003);
        let coarse = folds.coarser(5);
        assert_eq!(coarse.fold_ranges(), folds.fold_ranges());
        // twelve to a fold: 5, 5 and 2
        assert_eq!((folds.blocks.len(), coarse.blocks.len()), (60, 15));
        assert_eq!(coarse.blocks[0].end, folds.blocks[4].end);
        assert!(coarse.blocks.windows(2).all(|w| w[0].end == w[1].start));
    }

    #[test]
    fn thinned_blocks_are_every_part_in_turn() {
        let folds = Folds::cut(100_003);
        let thin = folds.thinned(8);
        assert_eq!(thin.fold_of_block, folds.fold_of_block);
        for (k, (part, block)) in thin.blocks.iter().zip(&folds.blocks).enumerate() {
            let expected = block.start + (k % 8) * block.len() / 8;
            assert_eq!(part.start, expected);
            assert!(part.end <= block.end && part.len().abs_diff(block.len() / 8) <= 1);
        }
    }

    #[test]
    fn a_dozen_snapshots_are_a_block_each_or_two() {
        let folds = Folds::unrelated(12);
        assert_eq!((folds.count, folds.blocks.len()), (5, 10));
        assert!(folds.blocks.iter().all(|b| (1..=2).contains(&b.len())));
        assert_eq!(Folds::unrelated(7).blocks.len(), 7);
        assert_eq!(
            Folds::unrelated(9000).blocks.len(),
            Folds::cut(9000).blocks.len()
        );
    }

    #[test]
    fn folds_differ_by_one_block_rounding_only() {
        let folds = Folds::cut(1592);
        let fold = folds.fold_of_frame();
        for f in 0..5 {
            let n = fold.iter().filter(|&&g| g == f).count();
            assert!((318..=319).contains(&n), "fold {f} has {n} frames");
        }
    }
}
