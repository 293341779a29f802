//! A long series as means over short stretches.
//!
//! Coloured noise and slow effects live on times far longer than a sample; a
//! series of ten thousand samples says the same as means over a few. A bin is a
//! run of consecutive rows that crosses neither a gap nor a block; an effect is
//! averaged over the rows of the bin exactly as the residual is, so that nothing
//! is approximated but the white noise within a bin.
//!
//! Not physics: bookkeeping of time.

use std::ops::Range;

use block_regression::Folds;
use spectra::robust::median_step;

use crate::gaps::longest_step;

/// About as many bins as an attitude series is cut into at most.
pub(crate) const MOST: usize = 2400;

/// Consecutive rows that are averaged.
#[derive(Clone, Debug)]
pub(crate) struct Bins {
    /// Rows of each bin, in time order, all rows once.
    pub(crate) rows: Vec<Range<usize>>,
    /// Mean time of each bin, s.
    pub(crate) t_s: Vec<f64>,
    /// The folds in terms of bins.
    pub(crate) folds: Folds,
}

impl Bins {
    /// Whether a line at this frequency survives the means.
    pub(crate) fn resolve(&self, frequency_hz: f64) -> bool {
        median_step(&self.t_s).is_some_and(|step| frequency_hz < 0.5 / step)
    }

    /// Cuts the rows at `t_s`, whose folds are `folds`, into about `most` at most.
    pub(crate) fn cut(t_s: &[f64], folds: &Folds, most: usize) -> Self {
        let size = t_s.len().div_ceil(most).max(1);
        let gap = longest_step(t_s);
        let mut bins = Self {
            rows: Vec::new(),
            t_s: Vec::new(),
            folds: Folds {
                blocks: Vec::new(),
                fold_of_block: folds.fold_of_block.clone(),
                count: folds.count,
                prior_blocks: folds.prior_blocks,
            },
        };
        for block in &folds.blocks {
            let first = bins.rows.len();
            let mut start = block.start;
            for k in block.clone() {
                let last = k + 1 == block.end;
                if last || k + 1 - start == size || t_s[k + 1] - t_s[k] > gap {
                    bins.t_s
                        .push(t_s[start..=k].iter().sum::<f64>() / (k + 1 - start) as f64);
                    bins.rows.push(start..k + 1);
                    start = k + 1;
                }
            }
            bins.folds.blocks.push(first..bins.rows.len());
        }
        bins
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_hold_every_row_once_and_cross_no_gap() {
        let t_s: Vec<f64> = (0..10_007)
            .map(|k| f64::from(k) + if k >= 5003 { 99.0 } else { 0.0 })
            .collect();
        let folds = Folds::cut(t_s.len());
        let bins = Bins::cut(&t_s, &folds, MOST);
        assert_eq!(bins.rows[0].start, 0);
        assert_eq!(bins.rows.last().unwrap().end, t_s.len());
        assert!(bins.rows.windows(2).all(|w| w[0].end == w[1].start));
        assert!(bins.rows.iter().all(|r| !(r.start < 5003 && r.end > 5003)));
        assert!(bins.rows.len() < 2 * MOST);
        assert_eq!(bins.folds.blocks.len(), folds.blocks.len());
        for (b, f) in bins.folds.blocks.iter().zip(&folds.blocks) {
            assert_eq!(bins.rows[b.start].start, f.start);
            assert_eq!(bins.rows[b.end - 1].end, f.end);
        }
    }
}
