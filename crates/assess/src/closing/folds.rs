//! Out-of-fold residuals by the linear problem around a fit.
//!
//! Not physics: blocks of time.

use nalgebra::{DMatrix, DVector};

use crate::model::Fit;
use crate::{AssessError, Observed};

/// Contiguous blocks of time.
pub(crate) const FOLDS: usize = 5;

/// Block of a time.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the number of blocks"
)]
pub(crate) fn fold_of([first, last]: [f64; 2], t_s: f64) -> usize {
    let share = (t_s - first) / (last - first).max(f64::MIN_POSITIVE);
    (share * FOLDS as f64)
        .floor()
        .clamp(0.0, (FOLDS - 1) as f64) as usize
}

/// Residual about the tracker's axes, arcsec, each block predicted with parameters of the others.
pub(crate) fn out_of_fold(fit: &Fit, observed: &Observed) -> Result<[Vec<f64>; 3], AssessError> {
    let (j, r) = (&fit.minimum.jacobian, &fit.minimum.residuals);
    let n = j.ncols();
    let frames = observed.len();
    let ends = [observed.t_s[0], observed.t_s[frames - 1]];
    let folds: Vec<usize> = observed.t_s.iter().map(|t| fold_of(ends, *t)).collect();
    let mut gram = vec![DMatrix::zeros(n, n); FOLDS];
    let mut right = vec![DVector::zeros(n); FOLDS];
    let mut from = 0;
    while from < frames {
        let fold = folds[from];
        let run = folds[from..].iter().take_while(|f| **f == fold).count();
        let rows = j.rows(3 * from, 3 * run);
        gram[fold] += rows.tr_mul(&rows);
        right[fold] += rows.tr_mul(&r.rows(3 * from, 3 * run));
        from += run;
    }
    let all: DMatrix<f64> = gram.iter().fold(DMatrix::zeros(n, n), |sum, g| sum + g);
    let all_right: DVector<f64> = right.iter().fold(DVector::zeros(n), |sum, b| sum + b);
    let mut out: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(frames));
    let mut change = Vec::with_capacity(FOLDS);
    for fold in 0..FOLDS {
        let others = &all - &gram[fold];
        // columns of one length, and a ridge: what four blocks do not determine stays as it is
        let scale = others
            .diagonal()
            .map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
        let unit = DMatrix::from_fn(n, n, |i, k| {
            let ridge = if i == k { 1e-9 } else { 0.0 };
            others[(i, k)] * scale[i] * scale[k] + ridge
        });
        let wanted = (&right[fold] - &all_right).component_mul(&scale);
        let solved = unit
            .cholesky()
            .map(|c| c.solve(&wanted).component_mul(&scale));
        change.push(solved.ok_or_else(|| AssessError::Fit {
            what: "four of five blocks",
            reason: "they do not determine all parameters".into(),
        })?);
    }
    // residuals are over sigma: back to arcsec
    let sigma: [f64; 3] = std::array::from_fn(|axis| {
        let rows = (0..frames).map(|k| (r[3 * k + axis].abs(), fit.residual_arcsec[axis][k].abs()));
        let (white, arcsec) = rows.fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
        if white > 0.0 { arcsec / white } else { 1.0 }
    });
    for k in 0..frames {
        let d = &change[folds[k]];
        for (axis, out) in out.iter_mut().enumerate() {
            let row = 3 * k + axis;
            out.push(sigma[axis] * (r[row] + (j.row(row) * d)[0]));
        }
    }
    Ok(out)
}
