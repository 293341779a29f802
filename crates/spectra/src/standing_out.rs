//! What stands out of sample after sample is no outlier: something turned the camera, or the reference.
//!
//! Not physics: bookkeeping of rows.

use crate::robust;

/// Samples in a row, and part of their rows: where more than that stands out something happened.
const TOGETHER: usize = 16;
const PART: usize = 3;
/// Part of all rows from which what happened matters: a tracker loses its stars for a minute now and then.
const LASTS: usize = 20;

/// Of each sample whether it lies among 16 in a row of which more than a third of the rows stand out, and all that do
/// so are a twentieth of the rows or more; `out` of `all` of the rows of each sample stand out.
///
/// ```
/// // the last thirty of a hundred samples
/// let out: Vec<usize> = (0..100).map(|k| usize::from(k >= 70)).collect();
/// assert!(spectra::standing_out::happened(&out, &[1; 100])[99]);
/// // one sample alone is an outlier
/// let out: Vec<usize> = (0..100).map(|k| usize::from(k == 70)).collect();
/// assert!(!spectra::standing_out::happened(&out, &[1; 100])[70]);
/// ```
#[must_use]
pub fn happened(out: &[usize], all: &[usize]) -> Vec<bool> {
    let mut happened = vec![false; out.len()];
    let starts = out.windows(TOGETHER).zip(all.windows(TOGETHER)).enumerate();
    for (first, (out, all)) in starts {
        let (out, all): (usize, usize) = (out.iter().sum(), all.iter().sum());
        if PART * out > all {
            happened[first..first + TOGETHER].fill(true);
        }
    }
    let there = out.iter().zip(&happened).filter(|(_, happened)| **happened);
    let there: usize = there.map(|(out, _)| out).sum();
    if LASTS * there < all.iter().sum() {
        happened.fill(false);
    }
    happened
}

/// Marks the values of a series that stand out by the rule of [`robust`], but where something
/// [`happened`]; returns how many were added.
///
/// # Panics
///
/// Unless both slices have one length.
pub fn mark(value: &[f64], marked: &mut [bool]) -> usize {
    let mut out = marked.to_vec();
    robust::mark_outliers(value, &vec![0; value.len()], 1, &mut out);
    let count: Vec<usize> = out.iter().map(|o| usize::from(*o)).collect();
    let happened = happened(&count, &vec![1; count.len()]);
    let mut added = 0;
    for (k, marked) in marked.iter_mut().enumerate() {
        if out[k] && !*marked && !happened[k] {
            *marked = true;
            added += 1;
        }
    }
    added
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ops::Range;

    /// So many samples of one row, of which these stand out.
    fn lost(these: Range<usize>, of: usize) -> Vec<usize> {
        (0..of).map(|k| usize::from(these.contains(&k))).collect()
    }

    /// Of 100 samples of four rows all stand out from the sixtieth on, and one row of every third before: only what
    /// stands out throughout has happened, and what lies within 16 samples of it.
    #[test]
    fn what_stands_out_throughout_has_happened() {
        let out: Vec<usize> = (0..100)
            .map(|k| if k < 60 { usize::from(k % 3 == 0) } else { 4 })
            .collect();
        let happened = happened(&out, &[4; 100]);
        assert!(happened[60..].iter().all(|h| *h));
        assert!(happened[..44].iter().all(|h| !*h));
    }

    /// Twenty samples of a thousand are lost: outliers, however many follow one another.
    #[test]
    fn what_does_not_last_is_outliers() {
        assert!(
            happened(&lost(500..520, 1000), &[1; 1000])
                .iter()
                .all(|h| !*h)
        );
    }

    /// A burst of five samples is none of sixteen, and a run of fewer samples than that is not judged.
    #[test]
    fn a_burst_is_outliers() {
        assert!(happened(&lost(20..25, 40), &[1; 40]).iter().all(|h| !*h));
        assert_eq!(happened(&[1; 9], &[1; 9]), [false; 9]);
    }
}
