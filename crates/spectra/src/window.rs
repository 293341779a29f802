//! Windows, and what they do to a line and to noise.
//!
//! All are sums of cosines, in the form for spectra: the period is the length, so that the first
//! sample is not repeated at the end.
//!
//! ```text
//! w[n] = sum_j (-1)^j a_j cos(2 pi j n / N),   n = 0..N-1
//! equivalent noise bandwidth = N sum w^2 / (sum w)^2    bins
//! coherent gain              = sum w / N
//! ```
//!
//! Source: Harris, Proc. IEEE 66 (1978) 51, Table 1; Nuttall, IEEE Trans. ASSP 29 (1981) 84; flat top: D'Antona & Ferrero (2006), p. 70.

use std::f64::consts::TAU;

/// A window of a segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Window {
    /// None: the narrowest line, and sidelobes that fall off slowest.
    Boxcar,
    /// Hann's: the usual choice for spectra.
    #[default]
    Hann,
    /// Hamming's (0.54, 0.46).
    Hamming,
    /// Blackman's (0.42, 0.5, 0.08).
    Blackman,
    /// Blackman-Harris of four terms: sidelobes at -92 dB.
    BlackmanHarris,
    /// Nuttall's minimum of four terms: sidelobes at -98 dB.
    Nuttall,
    /// Flat top of five terms: the height of a line is right wherever it lies in its bin.
    FlatTop,
}

impl Window {
    /// The coefficients `a_j`.
    fn coefficients(self) -> &'static [f64] {
        match self {
            Self::Boxcar => &[1.0],
            Self::Hann => &[0.5, 0.5],
            Self::Hamming => &[0.54, 0.46],
            Self::Blackman => &[0.42, 0.5, 0.08],
            Self::BlackmanHarris => &[0.358_75, 0.488_29, 0.141_28, 0.011_68],
            Self::Nuttall => &[0.363_581_9, 0.489_177_5, 0.136_599_5, 0.010_641_1],
            Self::FlatTop => &[
                0.215_578_95,
                0.416_631_58,
                0.277_263_158,
                0.083_578_947,
                0.006_947_368,
            ],
        }
    }

    /// Writes the window over the length of `out`.
    pub fn values_into(self, out: &mut [f64]) {
        let length = out.len();
        for (n, w) in out.iter_mut().enumerate() {
            let mut sign = 1.0;
            *w = 0.0;
            for (j, a) in self.coefficients().iter().enumerate() {
                // the phase is reduced as an integer: exact however long the window
                let phase = TAU * ((j * n) % length) as f64 / length as f64;
                *w += sign * a * phase.cos();
                sign = -sign;
            }
        }
    }

    /// The window over `length` samples.
    ///
    /// ```
    /// use spectra::{Window, noise_bandwidth_bins};
    /// let w = Window::Hann.values(64);
    /// assert!(w[0].abs() < 1e-16 && (w[32] - 1.0).abs() < 1e-15);
    /// assert!((noise_bandwidth_bins(&w) - 1.5).abs() < 1e-14);
    /// ```
    #[must_use]
    pub fn values(self, length: usize) -> Vec<f64> {
        let mut w = vec![0.0; length];
        self.values_into(&mut w);
        w
    }
}

/// Equivalent noise bandwidth of a window, in bins `fs/N`: 1 for none, 1.5 for Hann's.
///
/// A line of amplitude `A` stands at `A^2 / (2 df enbw)` in a density made with this window.
#[must_use]
pub fn noise_bandwidth_bins(window: &[f64]) -> f64 {
    let sum: f64 = window.iter().sum();
    let square: f64 = window.iter().map(|w| w * w).sum();
    window.len() as f64 * square / (sum * sum)
}

/// Coherent gain of a window: what becomes of the amplitude of a line at the middle of its bin.
#[must_use]
pub fn coherent_gain(window: &[f64]) -> f64 {
    window.iter().sum::<f64>() / window.len() as f64
}
