//! Rows that stand out: particle hits, stars mistaken for others.
//!
//! ```text
//! |r - median| > 8 (1.4826 MAD)      of its star, or of all stars that have few rows
//! ```
//!
//! Source: docs/formats/report.md (outliers); [`spectra::robust`].

use rayon::prelude::*;
use spectra::robust;
use spectra::standing_out::happened;

use crate::star::data::StarData;

/// A star with fewer rows has no scatter of its own: the median deviation of so many
/// is uncertain by a quarter.
const FEW_ROWS: usize = 10;

impl StarData {
    /// The same with the rows set aside whose centroids are not formed `anew`; `None` if there are none.
    pub(crate) fn formed_anew(&self, anew: &[bool]) -> Option<Self> {
        let lost = |r: &usize| !anew[*r] && !self.outlier[*r];
        let lost: Vec<usize> = (0..anew.len()).filter(lost).collect();
        if lost.is_empty() {
            return None;
        }
        let mut out = self.clone();
        for &r in &lost {
            out.outlier[r] = true;
        }
        out.unformed = lost.len();
        Some(out)
    }

    /// Rows that are no outliers.
    pub(crate) fn counted(&self) -> usize {
        self.outlier.iter().filter(|out| !**out).count()
    }

    /// Marks rows that stand out of each of `residuals`, of every row, and says how many: out of what other folds
    /// predict alone sound rows do too, where these know nothing of the distortion.
    ///
    /// A row is held against the rows of its star, or of all stars that have too few for
    /// a scatter of their own (snapshots of the sky hardly see a star twice). Where a
    /// frame's attitude comes from its own stars, one that was mistaken for another pulls
    /// all others off as well: of such a frame only the worst goes at a time. Where a third of the rows of frame after
    /// frame stands out, none does.
    pub(crate) fn mark_outliers(&mut self, residuals: &[&[Vec<f64>]]) -> usize {
        let mut rows = vec![0_usize; self.stars.len()];
        for &s in &self.star {
            rows[s] += 1;
        }
        let few = self.stars.len();
        let of = |&s: &usize| if rows[s] < FEW_ROWS { few } else { s };
        let group: Vec<usize> = self.star.iter().map(of).collect();
        let marked: Vec<Vec<bool>> = residuals
            .par_iter()
            .map(|axes| {
                let mut marked = self.outlier.clone();
                for axis in *axes {
                    robust::mark_outliers(axis, &group, few + 1, &mut marked);
                }
                marked
            })
            .collect();
        let stands_out = |r: usize| marked.iter().all(|marked| marked[r]);
        let size = |r: usize| residuals[0].iter().map(|a| a[r] * a[r]).sum::<f64>();
        let of_frame = |frame: usize| -> Vec<usize> {
            let rows = self.frames.rows_of(frame);
            rows.filter(|&r| !self.outlier[r] && stands_out(r))
                .collect()
        };
        let mut each: Vec<Vec<usize>> = (0..self.frames.frames()).map(of_frame).collect();
        if !self.free_attitude {
            let rows = |f: usize| self.frames.rows_of(f);
            let old = |f: usize| rows(f).filter(|&r| self.outlier[r]).count();
            let out: Vec<usize> = (each.iter().zip(0..))
                .map(|(new, f)| new.len() + old(f))
                .collect();
            let all: Vec<usize> = (0..each.len()).map(|f| rows(f).len()).collect();
            for (new, happened) in each.iter_mut().zip(happened(&out, &all)) {
                if happened {
                    new.clear();
                }
            }
        }
        let mut added = 0;
        for mut new in each {
            if self.free_attitude {
                let worst = new
                    .iter()
                    .copied()
                    .max_by(|&a, &b| size(a).total_cmp(&size(b)));
                new = worst.into_iter().collect();
            }
            added += new.len();
            for r in new {
                self.outlier[r] = true;
            }
        }
        added
    }
}
