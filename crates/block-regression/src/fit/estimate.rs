//! Amplitudes with their covariance, and what is asked of them.
//!
//! With Q the squared distance from zero under white noise and m the eigenvalues of the covariance over
//! that of white noise,
//!
//! ```text
//! Q / sum m ~ F(p e, p e (B - 1)),   e = (sum m)^2 / (p sum m^2)
//! ```
//!
//! and no tail is let below that of the widest direction, or of chi-squared ([`crate::Fits`]).
//!
//! Source: Box 1954 and Greenhouse & Geisser 1959 (F of unequal variances).

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use statrs::distribution::{ChiSquared, FisherSnedecor};

use super::symmetric;
use crate::tail::beyond;

/// A set of amplitudes from all data with their cluster-robust covariance.
///
/// An amplitude is in the unit of the residual over that of its column.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// One amplitude a column of the set.
    pub value: DVector<f64>,
    /// Its cluster-robust covariance.
    pub covariance: DMatrix<f64>,
    /// Its covariance if the noise were white.
    pub white: DMatrix<f64>,
    /// Blocks behind the covariance, those that its prior counts for included.
    pub blocks: f64,
}

impl Estimate {
    /// Probability that amplitudes `which` (positions in the set) are all zero
    /// and yet as far from it as this; 1 where there are too few blocks to tell.
    pub fn p_value(&self, which: &[usize]) -> f64 {
        let (p, b) = (which.len() as f64, self.blocks);
        if which.is_empty() || b <= p {
            return 1.0;
        }
        let (Some(square), Some(wider)) = (self.square(which), self.wider(which)) else {
            return 1.0;
        };
        let mean = wider.sum() / p;
        let likeness = wider.sum().powi(2) / (p * wider.norm_squared());
        let alike = f_tail(square / (p * mean), p * likeness, b);
        let worst = f_tail(square / wider.max(), 1.0, b);
        alike.max(worst).max(chi_squared_tail(square, p))
    }

    /// The same if the noise were white.
    pub fn white_p_value(&self, which: &[usize]) -> f64 {
        let tail = |square| chi_squared_tail(square, which.len() as f64);
        self.square(which).map_or(1.0, tail)
    }

    /// Squared distance of amplitudes `which` from zero if the noise were white.
    pub fn square(&self, which: &[usize]) -> Option<f64> {
        let value = DVector::from_fn(which.len(), |i, _| self.value[which[i]]);
        let white = Cholesky::new(part(&self.white, which))?;
        Some(value.dot(&white.solve(&value)))
    }

    /// How many times the variance of white noise the amplitudes `which` really have,
    /// along the directions in which that is a number.
    pub fn wider(&self, which: &[usize]) -> Option<DVector<f64>> {
        let root = Cholesky::new(part(&self.white, which))?.l();
        let half = root.solve_lower_triangular(&part(&self.covariance, which))?;
        let whole = root.solve_lower_triangular(&half.transpose())?;
        let values = SymmetricEigen::new(symmetric(whole)).eigenvalues;
        (values.max() > 0.0).then_some(values)
    }

    /// Squared distance of amplitudes `which` from zero under white noise, over that with their own
    /// covariance: how many times too large white noise makes what they gain. `None` if they cannot be
    /// told apart.
    pub fn excess(&self, which: &[usize]) -> Option<f64> {
        let value = DVector::from_fn(which.len(), |i, _| self.value[which[i]]);
        let own = Cholesky::new(part(&self.covariance, which))?;
        Some(self.square(which)? / value.dot(&own.solve(&value)))
    }

    /// The cluster-robust covariance with no variance below that of white noise.
    pub fn cautious_covariance(&self) -> DMatrix<f64> {
        let stretch =
            |k: usize| self.sigma(k) / self.covariance[(k, k)].sqrt().max(f64::MIN_POSITIVE);
        DMatrix::from_fn(self.value.len(), self.value.len(), |i, j| {
            stretch(i) * self.covariance[(i, j)] * stretch(j)
        })
    }

    /// Standard error of amplitude `k`.
    pub fn sigma(&self, k: usize) -> f64 {
        self.covariance[(k, k)]
            .max(self.white[(k, k)])
            .max(0.0)
            .sqrt()
    }
}

/// Rows and columns `which`.
fn part(matrix: &DMatrix<f64>, which: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(which.len(), which.len(), |i, j| {
        matrix[(which[i], which[j])]
    })
}

/// Chance of chi-squared of `p` parameters beyond `square`.
fn chi_squared_tail(square: f64, p: f64) -> f64 {
    ChiSquared::new(p).map_or(1.0, |law| beyond(&law, square))
}

/// Chance of F beyond `f` with `p` parameters, each with a variance from `blocks` blocks.
fn f_tail(f: f64, p: f64, blocks: f64) -> f64 {
    FisherSnedecor::new(p, p * (blocks - 1.0)).map_or(1.0, |law| beyond(&law, f))
}
