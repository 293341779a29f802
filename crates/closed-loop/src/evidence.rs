//! What the loop asks of a kind of measurement.
//!
//! Stars and attitudes differ in what a row is, in what the declared model
//! leaves unknown, and in how a residual is weighed. Everything else (folds,
//! candidates, selection, refinement, figures) is one pipeline over this trait.
//!
//! Not physics: an interface.

use std::ops::Range;

use block_regression::{BlockGrams, Folds};
use effects::Candidate;
use nalgebra::{DMatrix, DVector};

/// Amplitudes to predict with: of each fold from the others.
#[derive(Clone, Debug)]
pub(crate) struct Amplitudes {
    /// Nuisance amplitudes, a fold each.
    pub(crate) nuisance: Vec<DVector<f64>>,
    /// Amplitudes of all candidate columns (zero where not chosen), a fold each.
    pub(crate) candidates: Vec<DVector<f64>>,
}

impl Amplitudes {
    /// All of a fold: nuisance, then candidates.
    pub(crate) fn of_fold(&self, fold: usize) -> DVector<f64> {
        let (nuisance, candidates) = (&self.nuisance[fold], &self.candidates[fold]);
        let all = nuisance.iter().chain(candidates.iter()).copied();
        DVector::from_iterator(nuisance.len() + candidates.len(), all)
    }
}

/// Residuals of every row, arcsec, in the measurement's own axes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Residuals {
    /// One series an axis: two for stars, three for attitudes.
    pub(crate) axes: Vec<Vec<f64>>,
    /// What the fitted unknowns and candidates shift each row by, arcsec.
    pub(crate) modelled: Vec<Vec<f64>>,
}

/// A kind of measurement.
pub(crate) trait Evidence: Sync {
    /// Prior precision of the nuisance columns, 1/arcsec^2 (or free: 0).
    fn precision(&self) -> DMatrix<f64>;
    /// Nuisance columns that are told by one another alone (see [`block_regression::Layout`]).
    fn relative(&self) -> Range<usize> {
        0..0
    }
    /// Residual columns (see [`block_regression::Layout`]).
    fn residual_columns(&self) -> usize;
    /// First guess of the noise variance of a scalar of the design.
    fn variance_guess(&self) -> f64;
    /// The normal equations with `candidates` in them, block by block.
    fn grams(&self, folds: &Folds, candidates: &[&dyn Candidate]) -> BlockGrams;
    /// Their sum over all blocks, as one.
    fn grams_in_all(&self, folds: &Folds, candidates: &[&dyn Candidate]) -> BlockGrams {
        self.grams(folds, candidates).in_all(folds)
    }
    /// Out-of-fold residuals of every row, outliers included.
    fn residuals(
        &self,
        folds: &Folds,
        candidates: &[&dyn Candidate],
        amplitudes: &Amplitudes,
    ) -> Residuals;
    /// How far two forms of a candidate shift the rows apart at the same `values`: the sum of
    /// squares, of the scalars of the design under white noise. Infinite where that is not known.
    fn distance(&self, _one: &dyn Candidate, _other: &dyn Candidate, _values: &[f64]) -> f64 {
        f64::INFINITY
    }
}
