//! What a plan of Welch's estimate is made of, and what it used of a series.
//!
//! Source: Welch (1967), see the parent module.

use crate::{Detrend, Window};

/// What a plan is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct WelchSettings {
    /// Samples of a segment.
    pub segment: usize,
    /// Samples that neighbouring segments share; any number below `segment`.
    pub overlap: usize,
    /// Window of a segment.
    pub window: Window,
    /// What is taken from each segment first.
    pub detrend: Detrend,
    /// Sampling frequency, Hz.
    pub fs_hz: f64,
}

impl WelchSettings {
    /// The usual choice: Hann's window, half overlap, mean removed.
    #[must_use]
    pub fn half_overlap(segment: usize, fs_hz: f64) -> Self {
        Self {
            segment,
            overlap: segment / 2,
            window: Window::Hann,
            detrend: Detrend::Constant,
            fs_hz,
        }
    }
}

/// What an estimate used of a series.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Segments averaged.
    pub segments: usize,
    /// Samples in at least one segment.
    pub samples_used: usize,
    /// Samples in none: gaps, runs shorter than a segment, ends of runs.
    pub samples_left_out: usize,
}
