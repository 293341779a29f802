//! Cross-spectra and coherence of two series, by Welch's method.
//!
//! ```text
//! xy(k)     = c_k / (K fs sum w^2) sum_s conj(X_s(k)) Y_s(k)      phase > 0: y leads x
//! coherence = |xy|^2 / (xx yy)                                    0 to 1
//! P(coherence > c | none) = (1 - c)^(nu/2 - 1)
//! ```
//!
//! With `nu/2` independent segments the last line is exact; for overlapping ones `nu` is the
//! equivalent number of degrees of freedom.
//!
//! Source: Carter, Proc. IEEE 75 (1987) 236, Sections II, III; Bendat & Piersol (2010), Section 9.2.

use std::ops::Range;

use fourier::Complex;

use crate::{Coverage, SpectraError, Welch, WelchScratch};

/// Spectra of two series and their cross-spectrum.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CrossSpectrum {
    /// Frequency of each bin, Hz.
    pub frequency_hz: Vec<f64>,
    /// One-sided density of the first series, its unit^2/Hz.
    pub xx: Vec<f64>,
    /// One-sided density of the second series.
    pub yy: Vec<f64>,
    /// One-sided cross-density `conj(X) Y`, unit of x times unit of y per Hz.
    pub xy: Vec<Complex<f64>>,
    /// Equivalent degrees of freedom of each bin.
    pub dof: Vec<f64>,
    /// Sampling frequency, Hz.
    pub fs_hz: f64,
}

/// Where [`Welch::process_cross_into`] writes; each slice holds [`Welch::bins`] values.
#[derive(Debug)]
pub struct CrossMut<'a> {
    /// Density of the first series.
    pub xx: &'a mut [f64],
    /// Density of the second series.
    pub yy: &'a mut [f64],
    /// Cross-density.
    pub xy: &'a mut [Complex<f64>],
}

impl CrossSpectrum {
    /// Magnitude-squared coherence of each bin, 0 to 1; 0 where a series has no power.
    ///
    /// Where there is no coherence its expectation is `2/nu`, not 0: see [`coherence_significance`].
    #[must_use]
    pub fn coherence(&self) -> Vec<f64> {
        let powers = self.xx.iter().zip(&self.yy).map(|(x, y)| x * y);
        powers
            .zip(&self.xy)
            .map(|(p, z)| if p > 0.0 { z.norm_sqr() / p } else { 0.0 })
            .collect()
    }

    /// Phase of the cross-density, rad in (-pi, pi]: positive where `y` leads `x`.
    #[must_use]
    pub fn phase_rad(&self) -> Vec<f64> {
        self.xy.iter().map(|z| z.arg()).collect()
    }
}

impl Welch {
    /// Writes the spectra of `x` and `y` and their cross-spectrum from the segments that fit inside
    /// `runs`; allocates nothing.
    ///
    /// # Errors
    ///
    /// [`SpectraError::Unequal`] lengths, and as [`Welch::process_into`].
    ///
    /// # Panics
    ///
    /// If a slice of `out` does not hold [`bins`](Self::bins) values, or `scratch` is of another plan.
    pub fn process_cross_into(
        &self,
        x: &[f64],
        y: &[f64],
        runs: &[Range<usize>],
        scratch: &mut WelchScratch,
        out: CrossMut<'_>,
    ) -> Result<Coverage, SpectraError> {
        let CrossMut { xx, yy, xy } = out;
        let bins = self.bins();
        assert!(
            xx.len() == bins && yy.len() == bins && xy.len() == bins,
            "one place for each of {bins} bins"
        );
        if x.len() != y.len() {
            return Err(SpectraError::Unequal {
                first: x.len(),
                second: y.len(),
            });
        }
        let coverage = self.coverage(x.len(), runs)?;
        xx.fill(0.0);
        yy.fill(0.0);
        xy.fill(Complex::ZERO);
        for start in self.starts(runs) {
            self.transform(x, start, scratch, false)?;
            self.transform(y, start, scratch, true)?;
            for k in 0..bins {
                let (a, b) = (scratch.first[k], scratch.second[k]);
                xx[k] += a.norm_sqr();
                yy[k] += b.norm_sqr();
                xy[k] += a.conj() * b;
            }
        }
        for k in 0..bins {
            let scale = self.scale(k, coverage.segments);
            xx[k] *= scale;
            yy[k] *= scale;
            xy[k] *= scale;
        }
        Ok(coverage)
    }

    /// Spectra of two series and their cross-spectrum, from their common `runs`.
    ///
    /// ```
    /// use spectra::{Welch, WelchSettings, coherence_significance, whole};
    ///
    /// let x: Vec<f64> = (0..600_i64).map(|n| (n * n * n % 101) as f64).collect();
    /// let y: Vec<f64> = x.iter().map(|v| -3.0 * v).collect();
    /// let welch = Welch::new(WelchSettings::half_overlap(60, 1.0))?;
    /// let cross = welch.process_cross(&x, &y, &whole(&x))?;
    /// assert!(cross.coherence()[5] > 1.0 - 1e-12);
    /// assert!(coherence_significance(0.01, cross.dof[5])? < 0.3);
    /// # Ok::<(), spectra::SpectraError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// As [`process_cross_into`](Self::process_cross_into).
    pub fn process_cross(
        &self,
        x: &[f64],
        y: &[f64],
        runs: &[Range<usize>],
    ) -> Result<CrossSpectrum, SpectraError> {
        let bins = self.bins();
        let mut cross = CrossSpectrum {
            frequency_hz: self.frequency_hz(),
            xx: vec![0.0; bins],
            yy: vec![0.0; bins],
            xy: vec![Complex::ZERO; bins],
            dof: self.dof(runs),
            fs_hz: self.settings().fs_hz,
        };
        let out = CrossMut {
            xx: &mut cross.xx,
            yy: &mut cross.yy,
            xy: &mut cross.xy,
        };
        self.process_cross_into(x, y, runs, &mut self.make_scratch(), out)?;
        Ok(cross)
    }
}

/// The coherence that two unrelated series exceed with probability `alpha` in a bin of `dof` degrees
/// of freedom: `1 - alpha^(1/(nu/2 - 1))`.
///
/// For a search among `m` independent bins give `alpha/m`. With two degrees of freedom or fewer every
/// coherence is 1, and so is the result.
///
/// # Errors
///
/// [`SpectraError::Probability`] outside (0, 1), [`SpectraError::NotPositive`] for `dof`.
pub fn coherence_significance(alpha: f64, dof: f64) -> Result<f64, SpectraError> {
    SpectraError::probability("alpha", alpha)?;
    SpectraError::positive("dof", dof)?;
    let others = 0.5 * dof - 1.0;
    if others <= 0.0 {
        return Ok(1.0);
    }
    Ok(-(alpha.ln() / others).exp_m1())
}
