//! How large what is left is.

use crate::evidence::Residuals;
use crate::star::data::StarData;

/// Root mean square of the entries that count; `None` if none does.
pub(crate) fn rms(values: &[f64], outlier: &[bool]) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0.0);
    for (v, out) in values.iter().zip(outlier) {
        if !out && v.is_finite() {
            sum += v * v;
            count += 1.0;
        }
    }
    (count > 0.0).then(|| (sum / count).sqrt())
}

/// Star residual per axis over all rows that count.
pub(crate) fn star_rms(residual: &Residuals, data: &StarData) -> [f64; 2] {
    std::array::from_fn(|a| rms(&residual.axes[a], &data.outlier).unwrap_or(f64::NAN))
}

/// Sum of the mean squares of both axes, arcsec^2.
pub(crate) fn star_power(residual: &Residuals, data: &StarData) -> f64 {
    star_rms(residual, data).iter().map(|v| v * v).sum()
}
