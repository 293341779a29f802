//! Vectors that are of unit length but for rounding.
//!
//! Source: the binomial series of an inverse root.

use nalgebra::Vector3;

use crate::error::QuestError;

/// How far from 1 a vector's length may be. Within this it is scaled to unit length.
pub const UNIT_TOLERANCE: f64 = 1e-6;

/// `1/|v|` of a vector checked to be nearly unit: with `e = |v|^2 - 1`, below 2e-6, the series to
/// second order leaves `5/16 e^3 < 3e-18`.
pub(crate) fn inverse_length(v: &Vector3<f64>) -> f64 {
    let e = v.norm_squared() - 1.0;
    1.0 - e * (0.5 - 0.375 * e)
}

pub(crate) fn check(set: &'static str, vectors: &[Vector3<f64>]) -> Result<(), QuestError> {
    for (index, v) in vectors.iter().enumerate() {
        if !v.iter().all(|x| x.is_finite()) {
            return Err(QuestError::NotFinite { set, index });
        }
        // the root only for those near or beyond the limit
        if (v.norm_squared() - 1.0).abs() > UNIT_TOLERANCE {
            let length = v.norm();
            if (length - 1.0).abs() > UNIT_TOLERANCE {
                return Err(QuestError::NotUnit { set, index, length });
            }
        }
    }
    Ok(())
}
