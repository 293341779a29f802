//! Non-linear least squares by Gauss-Newton, with a covariance that holds for coloured residuals.
//!
//! ```text
//! p <- p - (J^T J)^-1 J^T r
//! cov = A^-1 S A^-1,   A = J^T J,   S = sum_|l| <= L (1 - |l| / (L + 1)) sum_k g_k g_{k+l}^T
//! g_k = J_k^T r_k      of one frame
//! ```
//!
//! With white residuals S is A times their variance. Slow systematics make neighbouring frames agree
//! in their errors, and J^T J alone would promise too much.
//!
//! Source: Newey & West, Econometrica 55 (1987) 703 (covariance); `argmin` (Gauss-Newton).

use argmin::core::{Error, Executor, Jacobian, Operator, State};
use argmin::solver::gaussnewton::GaussNewton;
use nalgebra::{DMatrix, DVector};

use crate::AssessError;

/// A problem: residuals, and how they change with each parameter.
pub(crate) trait Problem {
    /// Residuals, `width` for each frame.
    fn residuals(&self, p: &DVector<f64>) -> Result<DVector<f64>, AssessError>;
    /// Derivatives of the residuals, one column for each parameter.
    fn jacobian(&self, p: &DVector<f64>) -> Result<DMatrix<f64>, AssessError>;
}

/// A minimum.
#[derive(Clone, Debug)]
pub(crate) struct Minimum {
    pub(crate) p: DVector<f64>,
    pub(crate) residuals: DVector<f64>,
    pub(crate) jacobian: DMatrix<f64>,
}

struct Adapter<'a, P>(&'a P);

impl<P: Problem> Operator for Adapter<'_, P> {
    type Param = DVector<f64>;
    type Output = DVector<f64>;

    fn apply(&self, p: &DVector<f64>) -> Result<DVector<f64>, Error> {
        Ok(self.0.residuals(p)?)
    }
}

impl<P: Problem> Jacobian for Adapter<'_, P> {
    type Param = DVector<f64>;
    type Jacobian = DMatrix<f64>;

    fn jacobian(&self, p: &DVector<f64>) -> Result<DMatrix<f64>, Error> {
        Ok(self.0.jacobian(p)?)
    }
}

/// Minimises from a start; `settled` is the change of the residuals' norm at which it ends.
pub(crate) fn minimise(
    problem: &impl Problem,
    start: DVector<f64>,
    settled: f64,
    what: &'static str,
) -> Result<Minimum, AssessError> {
    let at_start = problem.residuals(&start)?.norm();
    let fail = |reason: String| AssessError::Fit { what, reason };
    let mut last = String::new();
    // full steps first; shorter ones where those overshoot
    for gamma in [1.0, 0.4] {
        let solver = GaussNewton::new()
            .with_gamma(gamma)
            .and_then(|solver| solver.with_tolerance(settled))
            .map_err(|e| fail(e.to_string()))?;
        let start = start.clone();
        let done = Executor::new(Adapter(problem), solver)
            .configure(|state| state.param(start).max_iters(15))
            .run();
        let done = match done {
            Ok(done) => done,
            Err(error) => {
                last = error.to_string();
                continue;
            }
        };
        let state = done.state();
        // the best is the last, or one before it by less than what counts as settled
        let Some(p) = state.get_best_param().or(state.get_param()) else {
            continue;
        };
        let residuals = problem.residuals(p)?;
        let norm = residuals.norm();
        if norm.is_finite() && norm <= at_start * (1.0 + 1e-9) + settled {
            let jacobian = problem.jacobian(p)?;
            let p = p.clone();
            return Ok(Minimum {
                p,
                residuals,
                jacobian,
            });
        }
        last = format!("residuals grow from {at_start:.3e} to {norm:.3e}");
    }
    Err(fail(last))
}

impl Minimum {
    /// Covariance of the parameters for residuals of `width` to a frame, correlated over `lags` frames; no
    /// variance is less than that of frames that do not go together.
    pub(crate) fn covariance(
        &self,
        width: usize,
        lags: usize,
        what: &'static str,
    ) -> Result<DMatrix<f64>, AssessError> {
        let n = self.p.len();
        let frames = self.residuals.len() / width;
        let a = self.jacobian.tr_mul(&self.jacobian);
        let inverse = a.try_inverse().ok_or_else(|| AssessError::Fit {
            what,
            reason: "the data do not determine all parameters".into(),
        })?;
        let mut scores = DMatrix::zeros(n, frames);
        for k in 0..frames {
            let rows = self.jacobian.rows(k * width, width);
            let r = self.residuals.rows(k * width, width);
            scores.set_column(k, &rows.tr_mul(&r));
        }
        let alone = &scores * scores.transpose();
        let mut s = alone.clone();
        let lags = lags.min(frames.saturating_sub(1));
        for lag in 1..=lags {
            let m = frames - lag;
            let product = scores.columns(0, m) * scores.columns(lag, m).transpose();
            let weight = 1.0 - lag as f64 / (lags + 1) as f64;
            s += (&product + product.transpose()) * weight;
        }
        let spare = (width * frames).saturating_sub(n).max(1) as f64;
        let small = (width * frames) as f64 / spare;
        let mut together = &inverse * s * &inverse * small;
        // what is fitted takes its share of the residuals at low frequency, which is all that the lags see:
        // the sum over them comes out small. No residuals that go together tell more than free ones
        let alone = &inverse * alone * &inverse * small;
        let factor = DVector::from_fn(n, |i, _| (alone[(i, i)] / together[(i, i)]).max(1.0).sqrt());
        for i in 0..n {
            for j in 0..n {
                together[(i, j)] *= factor[i] * factor[j];
            }
        }
        Ok(together)
    }
}
