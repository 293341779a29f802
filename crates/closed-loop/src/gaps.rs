//! What is a gap in a series: nothing is averaged, followed or predicted across one.
//!
//! Not physics: bookkeeping of time.

use spectra::robust::median_step;

/// A longer step than this many medians is a gap: one missing sample is one, jitter is none.
pub(crate) const GAP_STEPS: f64 = 1.9;

/// The longest step of a series that is no gap, s; without steps, any.
pub(crate) fn longest_step(t_s: &[f64]) -> f64 {
    GAP_STEPS * median_step(t_s).unwrap_or(f64::INFINITY)
}
