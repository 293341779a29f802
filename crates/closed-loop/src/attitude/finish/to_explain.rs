//! What one effect would have to explain of the squares of attitudes, and how long its columns are.
//!
//! Not physics: sums of squares.

use telemetry::report::Unattributed;

use crate::attitude::data::{AttitudeData, AttitudeEvidence};
use crate::attitude::finish::Finish;
use crate::attitude::noise::fit_whole_noise;
use crate::evidence::Residuals;
use crate::questions::needed::remarkable;
use crate::residual_size;
use crate::search::{Found, borrowed};

/// What is left, and what there was, arcsec^2; `plain` is what the chosen leave out of fold.
pub(super) fn squares(
    f: &Finish<'_>,
    plain: &Residuals,
    unattributed: &Unattributed,
) -> [Option<f64>; 2] {
    let bare = f.in_sample(&[]).unwrap_or_else(|| f.before.clone());
    let with = f.in_sample(f.chosen()).unwrap_or_else(|| plain.clone());
    let described = unattributed.variance_fraction.unwrap_or(0.0);
    let described = unattributed.present.then_some(described);
    unexplained(f.data(), [&bare, &with], described)
}

/// Squared length of each candidate column about its mean on every axis, arcsec^2.
pub(super) fn column_lengths(evidence: &AttitudeEvidence<'_>, found: &Found) -> Vec<f64> {
    let data = evidence.data;
    let binned = evidence.plain(&borrowed(&found.candidates));
    let m = data.bins.rows.len();
    let length = |column: &[f64]| -> f64 {
        (0..3)
            .map(|axis| {
                let (values, count) = (&column[axis * m..(axis + 1) * m], &data.count[axis]);
                let all = || values.iter().zip(count);
                let rows: f64 = count.iter().sum();
                let mean = all().map(|(v, n)| v * n).sum::<f64>() / rows.max(1.0);
                all().map(|(v, n)| n * (v - mean) * (v - mean)).sum::<f64>()
            })
            .sum()
    };
    binned
        .column_iter()
        .skip(3)
        .map(|column| length(column.as_slice()))
        .collect()
}

/// Squared residual beyond the white noise of the axes on which it stands out of that, arcsec^2. Each by itself:
/// the noise about the boresight would hide what the others hold.
fn beyond_white(data: &AttitudeData, residual: &Residuals) -> Option<f64> {
    let noise = fit_whole_noise(data, residual);
    let mut whole = None;
    for axis in 0..3 {
        let rows: f64 = data.count[axis].iter().sum();
        let white = noise[axis].white * noise[axis].white;
        let square = residual_size::rms(&residual.axes[axis], &data.outlier[axis])?.powi(2);
        if let Some(excess) = remarkable(rows * (square - white), white, rows) {
            *whole.get_or_insert(0.0) += excess;
        }
    }
    whole
}

/// What is left of the squared residual `with` what was added, arcsec^2, and all that is left of `bare`, without it.
/// `described` is the share of the latter that follows something; `None` where nothing is left.
fn unexplained(
    data: &AttitudeData,
    [bare, with]: [&Residuals; 2],
    described: Option<f64>,
) -> [Option<f64>; 2] {
    let square = |r: &Residuals| -> f64 {
        let axis = |a: usize| {
            let rows: f64 = data.count[a].iter().sum();
            Some(rows * residual_size::rms(&r.axes[a], &data.outlier[a])?.powi(2))
        };
        (0..3).filter_map(axis).sum()
    };
    let left = described.map(|share| {
        let over = beyond_white(data, with).unwrap_or(0.0);
        over.max(share * square(bare))
    });
    let all = (square(bare) - square(with)).max(0.0) + left.unwrap_or(0.0);
    [left, Some(all)].map(|excess| excess.filter(|e| *e > 0.0))
}
