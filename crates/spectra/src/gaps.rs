//! Runs of a series without gaps.
//!
//! Segments of a spectrum are laid inside runs only; no value is ever invented for a gap.
//!
//! ```text
//! a run breaks between n and n + 1 if |t[n+1] - t[n] - step| > tolerance step, or if x[n] is not finite
//! ```
//!
//! Source: this crate; for series with more gaps than runs see Scargle, Astrophys. J. 263 (1982) 835.

use std::ops::Range;

use crate::SpectraError;

/// The one run of a series without gaps.
///
/// ```
/// assert_eq!(spectra::whole(&[1.0, 2.0]), std::array::from_fn(|_| 0..2));
/// ```
#[must_use]
pub fn whole(x: &[f64]) -> [Range<usize>; 1] {
    std::array::from_fn(|_| 0..x.len())
}

/// Runs of finite values in a regularly sampled series whose gaps are marked by NaN.
///
/// ```
/// let runs = spectra::finite_runs(&[1.0, 2.0, f64::NAN, 3.0]);
/// assert_eq!(runs, [0..2, 3..4]);
/// ```
#[must_use]
pub fn finite_runs(x: &[f64]) -> Vec<Range<usize>> {
    runs(x, |_| true)
}

/// Runs in which the time goes on by `step_s` and every value is finite.
///
/// `tolerance` is the part of a step by which an interval may differ.
///
/// ```
/// let t_s = [0.0, 1.0, 2.0, 5.0, 6.0, 7.0];
/// let x = [0.1, 0.2, 0.3, 0.4, f64::NAN, 0.5];
/// assert_eq!(spectra::continuous_runs(&t_s, &x, 1.0, 0.01)?, [0..3, 3..4, 5..6]);
/// # Ok::<(), spectra::SpectraError>(())
/// ```
///
/// # Errors
///
/// [`SpectraError::NotPositive`] for `step_s` or `tolerance`, [`SpectraError::Unequal`] lengths,
/// [`SpectraError::NotIncreasing`] times (NaN among them).
pub fn continuous_runs(
    t_s: &[f64],
    x: &[f64],
    step_s: f64,
    tolerance: f64,
) -> Result<Vec<Range<usize>>, SpectraError> {
    SpectraError::positive("step_s", step_s)?;
    SpectraError::positive("tolerance", tolerance)?;
    if t_s.len() != x.len() {
        return Err(SpectraError::Unequal {
            first: t_s.len(),
            second: x.len(),
        });
    }
    increasing(t_s)?;
    Ok(runs(x, |n| {
        (t_s[n] - t_s[n - 1] - step_s).abs() <= tolerance * step_s
    }))
}

/// `Ok` if every time is finite and after the one before.
pub(crate) fn increasing(t_s: &[f64]) -> Result<(), SpectraError> {
    SpectraError::finite(t_s, 0)?;
    match t_s.windows(2).position(|w| w[1] <= w[0]) {
        None => Ok(()),
        Some(n) => Err(SpectraError::NotIncreasing {
            index: n + 1,
            time_s: t_s[n + 1],
        }),
    }
}

/// Runs of finite values; `joins(n)` says whether sample `n` goes on from `n - 1`.
fn runs(x: &[f64], joins: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let mut found: Vec<Range<usize>> = vec![];
    for n in (0..x.len()).filter(|n| x[*n].is_finite()) {
        match found.last_mut() {
            Some(last) if last.end == n && joins(n) => last.end = n + 1,
            _ => found.push(n..n + 1),
        }
    }
    found
}
