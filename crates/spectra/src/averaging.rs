//! Averages over bins that widen with frequency.
//!
//! Groups are as wide as one part of a decade, never narrower than a bin. Each is the mean of its
//! bins weighted by their degrees of freedom:
//!
//! ```text
//! psd = sum p_i psd_i,   p_i = nu_i / sum nu
//! nu  = 2 / sum_ij p_i p_j 2 / sqrt(nu_i nu_j) c_|i-j|
//! ```
//!
//! where `c_j` is the correlation of the estimates of bins `j` apart: windows and tapers spread one
//! bin over its neighbours, so that the degrees of freedom do not simply add.
//!
//! Source: Percival & Walden (1993), Sections 6.7, 7.10 for the correlations of bins; the sum is the variance of a mean.

use std::ops::Range;

use crate::{Psd, SpectraError};

/// A plan that averages the bins of one grid into groups of equal width in the logarithm.
///
/// ```
/// use spectra::{LogAverage, Psd};
///
/// let frequency_hz: Vec<f64> = (0..=1000).map(|k| f64::from(k) * 1e-3).collect();
/// let flat = Psd { psd: vec![2.0; 1001], dof: vec![2.0; 1001], frequency_hz, fs_hz: 2.0 };
/// let average = LogAverage::new(&flat, 10.0)?;
/// let smooth = average.apply(&flat, &[1.0]);
/// assert!(smooth.len() < 30 && smooth.psd.iter().all(|p| (p - 2.0).abs() < 1e-12));
/// assert!((smooth.dof.iter().sum::<f64>() - 1998.0).abs() < 1e-9); // none lost but 0 and fs/2
/// # Ok::<(), spectra::SpectraError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct LogAverage {
    groups: Vec<Range<usize>>,
    /// Weight of each bin in its group.
    weights: Vec<f64>,
}

impl LogAverage {
    /// A plan for the grid of `psd`, with `per_decade` groups to a factor of ten.
    ///
    /// The bins at 0 and at fs/2, which are not doubled, belong to no group.
    ///
    /// # Errors
    ///
    /// [`SpectraError::NotPositive`] for `per_decade`, [`SpectraError::NotIncreasing`] frequencies
    /// (in Hz), [`SpectraError::TooShort`] if no bin lies between 0 and fs/2.
    pub fn new(psd: &Psd, per_decade: f64) -> Result<Self, SpectraError> {
        SpectraError::positive("per_decade", per_decade)?;
        crate::gaps::increasing(&psd.frequency_hz)?;
        let inside = |f: &f64| *f > 0.0 && *f < 0.5 * psd.fs_hz * (1.0 - 1e-12);
        let first = psd.frequency_hz.iter().position(inside);
        let first = first.ok_or(SpectraError::TooShort { got: 0, need: 1 })?;
        let group_of = |f: f64| (per_decade * (f / psd.frequency_hz[first]).log10() + 1e-9).floor();
        let mut groups: Vec<Range<usize>> = vec![];
        let mut current = f64::NAN;
        let bins = psd.frequency_hz.iter().enumerate().skip(first);
        for (k, f) in bins.take_while(|(_, f)| inside(f)) {
            let group = group_of(*f);
            match groups.last_mut() {
                Some(last) if group <= current => last.end = k + 1,
                _ => groups.push(k..k + 1),
            }
            current = group;
        }
        let mut weights = psd.dof.clone();
        for group in &groups {
            let sum: f64 = psd.dof[group.clone()].iter().sum();
            weights[group.clone()].iter_mut().for_each(|w| *w /= sum);
        }
        Ok(Self { groups, weights })
    }

    /// The bins of each group.
    #[must_use]
    pub fn groups(&self) -> &[Range<usize>] {
        &self.groups
    }

    /// Writes the weighted mean of `values`, one a bin, over each group; allocates nothing.
    ///
    /// A model of a steep spectrum must be averaged in the same way before it is compared.
    ///
    /// # Panics
    ///
    /// If `values` does not hold one for each bin, or `out` one for each group.
    pub fn means_into(&self, values: &[f64], out: &mut [f64]) {
        assert_eq!(values.len(), self.weights.len(), "one value a bin");
        assert_eq!(out.len(), self.groups.len(), "one place a group");
        for (o, group) in out.iter_mut().zip(&self.groups) {
            let pairs = values[group.clone()]
                .iter()
                .zip(&self.weights[group.clone()]);
            *o = pairs.map(|(v, w)| v * w).sum();
        }
    }

    /// The averaged density, at the mean frequency of each group.
    ///
    /// `correlation[j]` is the correlation of the estimates of bins `j` apart, beginning with 1:
    /// [`Welch::bin_correlation`](crate::Welch::bin_correlation),
    /// [`Multitaper::bin_correlation`](crate::Multitaper::bin_correlation), or `&[1.0]` for bins
    /// that are independent. Terms beyond its end are 0.
    ///
    /// # Panics
    ///
    /// If `psd` has not the number of bins of the plan, or `correlation` is empty.
    #[must_use]
    pub fn apply(&self, psd: &Psd, correlation: &[f64]) -> Psd {
        assert!(!correlation.is_empty(), "at least the bin itself");
        let mut averaged = Psd {
            frequency_hz: vec![0.0; self.groups.len()],
            psd: vec![0.0; self.groups.len()],
            dof: vec![],
            fs_hz: psd.fs_hz,
        };
        self.means_into(&psd.frequency_hz, &mut averaged.frequency_hz);
        self.means_into(&psd.psd, &mut averaged.psd);
        for group in &self.groups {
            // relative standard deviation of each bin times its weight, over sqrt 2
            let spread: Vec<f64> = group
                .clone()
                .map(|i| self.weights[i] / psd.dof[i].sqrt())
                .collect();
            let lagged = |j: usize| -> f64 {
                let pairs = spread.iter().zip(&spread[j..]);
                pairs.map(|(a, b)| a * b).sum()
            };
            let reach = correlation.len().min(spread.len());
            let others: f64 = (1..reach).map(|j| correlation[j] * lagged(j)).sum();
            averaged
                .dof
                .push(1.0 / (correlation[0] * lagged(0) + 2.0 * others));
        }
        averaged
    }
}
