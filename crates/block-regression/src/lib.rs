//! Linear regression from sums over blocks of time: errors out of fold, and variances that stay
//! honest under coloured noise.
//!
//! The data is read once. Of every block of consecutive frames one matrix is kept,
//!
//! ```text
//! G_b = sum over the scalars of block b of c c^T,   c = [ nuisance | candidates | residuals ]
//! ```
//!
//! and everything else is algebra on these: fits of any set of candidate columns, with the nuisance
//! eliminated exactly, the squared error and likelihood of each fold predicted from the others, and
//! amplitudes with a covariance from the scatter between blocks (cluster-robust), which holds for noise
//! that is correlated within a block and for any level of it. Its p-values pay for the few blocks.
//!
//! | for | use |
//! |---|---|
//! | how time is cut: five folds, up to sixty blocks | [`Folds`] |
//! | rows of regressors and residual | [`Design`], [`Layout`] |
//! | one pass over them | [`BlockGrams::accumulate`] |
//! | sums that were formed in another way | [`Gram`], [`Symmetric`], [`Part`] |
//! | fits of any set of candidates | [`Fits`] |
//! | what they predict where they were not fitted | [`Fits::out_of_fold`], [`OutOfFold`] |
//! | amplitudes, standard errors, p-values | [`Fits::estimate`], [`Estimate`] |
//! | chances of ratios that may be no number | [`beyond`] |
//!
//! A frame is what was measured at one instant, in any number of scalars. Nuisance columns are in every
//! fit, each with a prior of its own precision or free; candidates are in a fit if they are asked for.
//! Blocks are summed in parallel, each in its own order: numbers do not depend on the number of threads.
//!
//! ```
//! use block_regression::{BlockGrams, Design, Fits, Folds, Layout};
//! use nalgebra::DMatrix;
//! use std::ops::Range;
//!
//! /// One scalar a frame.
//! struct Table(DMatrix<f64>);
//!
//! impl Design for Table {
//!     fn width(&self) -> usize {
//!         self.0.ncols()
//!     }
//!     fn fill(&self, frames: Range<usize>, out: &mut DMatrix<f64>) -> usize {
//!         *out = self.0.rows(frames.start, frames.len()).into_owned();
//!         frames.len()
//!     }
//! }
//!
//! // a constant that nobody asks about, a sine that acts, one that does not, and what was measured
//! let table = Table(DMatrix::from_fn(1000, 4, |k, column| {
//!     let t = k as f64;
//!     let noise = (0.618_034 * t * t).fract() - 0.5;
//!     let sine = (0.05 * t).sin();
//!     [1.0, sine, (0.31 * t).sin(), 3.0 + 0.2 * sine + noise][column]
//! }));
//! let layout = Layout {
//!     nuisance_precision: DMatrix::zeros(1, 1),
//!     relative: 0..0,
//!     candidates: 2,
//!     residuals: 1,
//! };
//!
//! let folds = Folds::cut(1000);
//! let grams = BlockGrams::accumulate(&table, &folds);
//! let fits = Fits::new(&grams, &folds, &layout, 1.0).expect("a constant is no singular nuisance");
//!
//! let both = fits.estimate(&[0, 1]).expect("two sines are two columns");
//! assert!((both.value[0] - 0.2).abs() < 5.0 * both.sigma(0));
//! assert!(both.p_value(&[0]) < 1e-6 && both.p_value(&[1]) > 1e-3);
//!
//! // the first predicts frames that it was not fitted to, the second does not
//! let worth = |set: &[usize]| fits.out_of_fold(set).map(|o| o.total_loglik());
//! assert!(worth(&[0]) > worth(&[]).map(|alone| alone + 50.0));
//! assert!(worth(&[0, 1]) < worth(&[0]).map(|alone| alone + 3.0));
//! ```
#![forbid(unsafe_code)]

mod fit;
mod folds;
mod gram;
mod symmetric;
mod tail;

pub use fit::{Estimate, Fits, Layout, OutOfFold};
pub use folds::Folds;
pub use gram::{BlockGrams, Design, FoldSums, Gram};
pub use symmetric::{Part, Symmetric};
pub use tail::beyond;
