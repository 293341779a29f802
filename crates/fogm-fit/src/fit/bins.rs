//! The bins that a fit sees: band, lines left out, averages over neighbours.
//!
//! ```text
//! periodogram  I(f_j) = 2/(n fs) |sum_k (y_k - mean) exp(-2 pi i j k/n)|^2,   f_j = j fs/n, 0 < j < n/2
//! ```
//!
//! The bins of a rectangular window are independent for white noise, know nothing of the mean, and
//! have a closed expectation ([`expected_periodogram`](crate::expected_periodogram)). Neighbours
//! whose frequencies differ by less than a few per cent are averaged: their degrees of freedom add.
//! The bins at 0 and fs/2 are not used: they are not doubled in a one-sided density.
//!
//! Source: Percival & Walden, Spectral Analysis for Physical Applications (1993), section 6.3 and 6.6.

use spectra::Psd;

use crate::FogmError;
use crate::density::Bin;
use crate::process::positive;

/// Frequencies that differ by less than this fraction share a bin.
const WIDTH: f64 = 0.04;
/// Bins that three parameters need at least.
const NEED: usize = 6;

/// One bin of a spectrum.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub(crate) frequency_hz: f64,
    pub(crate) bin: Bin,
    pub(crate) psd: f64,
    /// Degrees of freedom.
    pub(crate) dof: f64,
}

/// The bins of one fit.
#[derive(Clone, Debug)]
pub(crate) struct Bins {
    pub(crate) samples: Vec<Sample>,
    pub(crate) fs_hz: f64,
    /// Samples behind a raw periodogram, whose expectation is known; `None` for any other spectrum.
    pub(crate) window: Option<f64>,
}

/// Which frequencies count.
#[derive(Clone, Debug)]
pub(crate) struct Chosen<'a> {
    pub(crate) band_hz: Option<[f64; 2]>,
    pub(crate) lines_hz: &'a [[f64; 2]],
}

impl Chosen<'_> {
    fn check(&self) -> Result<(), FogmError> {
        for [from_hz, to_hz] in self.band_hz.iter().chain(self.lines_hz) {
            if !(from_hz <= to_hz && from_hz.is_finite() && to_hz.is_finite()) {
                return Err(FogmError::BadRange {
                    from_hz: *from_hz,
                    to_hz: *to_hz,
                });
            }
        }
        Ok(())
    }

    fn keeps(&self, f: f64, fs_hz: f64) -> bool {
        let inside = |[from, to]: &[f64; 2]| (*from..=*to).contains(&f);
        f > 0.0
            && f < 0.5 * fs_hz * (1.0 - 1e-9)
            && self.band_hz.as_ref().is_none_or(inside)
            && !self.lines_hz.iter().any(inside)
    }
}

impl Bins {
    pub(crate) fn of_psd(psd: &Psd, chosen: &Chosen<'_>) -> Result<Self, FogmError> {
        positive("fs_hz", psd.fs_hz)?;
        chosen.check()?;
        let n = psd.frequency_hz.len();
        if psd.psd.len() != n || psd.dof.len() != n {
            return Err(FogmError::LengthMismatch {
                frequencies: n,
                densities: psd.psd.len(),
                dofs: psd.dof.len(),
            });
        }
        let mut samples = vec![];
        for index in 0..n {
            let (frequency_hz, level, dof) =
                (psd.frequency_hz[index], psd.psd[index], psd.dof[index]);
            if !chosen.keeps(frequency_hz, psd.fs_hz) {
                continue;
            }
            if !(level.is_finite() && level > 0.0 && dof.is_finite() && dof > 0.0) {
                return Err(FogmError::BadBin {
                    index,
                    frequency_hz,
                    psd: level,
                    dof,
                });
            }
            samples.push(Sample {
                frequency_hz,
                bin: Bin::new(frequency_hz / psd.fs_hz),
                psd: level,
                dof,
            });
        }
        Self {
            samples,
            fs_hz: psd.fs_hz,
            window: None,
        }
        .enough()
    }

    /// The periodogram of `y` (no missing samples), averaged over close neighbours.
    pub(crate) fn of_series(y: &[f64], fs_hz: f64, chosen: &Chosen<'_>) -> Result<Self, FogmError> {
        chosen.check()?;
        let n = y.len();
        let plan = fourier::real_forward(n);
        let mean = y.iter().sum::<f64>() / n as f64;
        let mut input: Vec<f64> = y.iter().map(|v| v - mean).collect();
        let mut output = plan.make_output_vec();
        plan.process(&mut input, &mut output)
            .map_err(|_| FogmError::NotConverged)?;
        let scale = 2.0 / (n as f64 * fs_hz);
        let mut samples = vec![];
        let mut group = Group::default();
        for (j, c) in output.iter().enumerate() {
            let f = j as f64 * fs_hz / n as f64;
            if !chosen.keeps(f, fs_hz) {
                // a hole in the band ends a group
                group.close(fs_hz, n, &mut samples);
                continue;
            }
            if group.count > 0.0 && f > group.from * (1.0 + WIDTH) {
                group.close(fs_hz, n, &mut samples);
            }
            group.add(f, scale * c.norm_sqr());
        }
        group.close(fs_hz, n, &mut samples);
        Self {
            samples,
            fs_hz,
            window: Some(n as f64),
        }
        .enough()
    }

    fn enough(self) -> Result<Self, FogmError> {
        if self.samples.len() < NEED {
            return Err(FogmError::TooFew {
                what: "bins",
                got: self.samples.len(),
                need: NEED,
            });
        }
        Ok(self)
    }
}

/// Neighbours on their way into one bin.
#[derive(Default)]
struct Group {
    from: f64,
    count: f64,
    frequencies: f64,
    densities: f64,
}

impl Group {
    fn add(&mut self, f: f64, density: f64) {
        if self.count == 0.0 {
            self.from = f;
        }
        self.count += 1.0;
        self.frequencies += f;
        self.densities += density;
    }

    fn close(&mut self, fs_hz: f64, n: usize, out: &mut Vec<Sample>) {
        if self.count > 0.0 && self.densities > 0.0 {
            let frequency_hz = self.frequencies / self.count;
            // the leakage term alternates between neighbours: take it at a frequency of the grid
            let j = (frequency_hz / fs_hz * n as f64).round();
            out.push(Sample {
                frequency_hz,
                bin: Bin::new(j / n as f64),
                psd: self.densities / self.count,
                dof: 2.0 * self.count,
            });
        }
        *self = Self::default();
    }
}
