//! The noise of each axis: what suits what is left best, and what the model declares.
//!
//! Not physics: fits made elsewhere.

use coloured_noise::{Coloured, Foreknown};

use crate::attitude::data::AttitudeData;
use crate::declared;
use crate::error::CloseError;
use crate::evidence::Residuals;
use crate::situation::Situation;

/// The slow noise that a hybrid model declares of each axis, or any model of the reference.
pub(super) fn declared_noise(
    situation: &Situation<'_>,
) -> Result<[Option<Foreknown>; 3], CloseError> {
    let Some(hem) = &situation.model.hem else {
        return Ok(declared::reference(&declared::effects(situation)?));
    };
    Ok([&hem.x, &hem.y, &hem.z].map(|axis| {
        let known = Foreknown {
            slow: axis.sigma_hsf_arcsec,
            tau_s: axis.tau_hsf_s,
        };
        (known.slow > 0.0 && known.tau_s > 0.0).then_some(known)
    }))
}

/// Noise of each axis without what it shares.
pub(super) fn fit_noise(data: &AttitudeData, residual: &Residuals) -> [Coloured; 3] {
    let axes = std::array::from_fn(|axis| residual.axes[axis].as_slice());
    noise_of(data, &data.unshared(axes))
}

/// Noise of each axis.
pub(super) fn fit_whole_noise(data: &AttitudeData, residual: &Residuals) -> [Coloured; 3] {
    let means = std::array::from_fn(|axis| data.binned(axis, &residual.axes[axis]));
    noise_of(data, &means)
}

/// Noise that suits means over the bins best.
fn noise_of(data: &AttitudeData, means: &[Vec<f64>; 3]) -> [Coloured; 3] {
    std::array::from_fn(|axis| Coloured::fit(&data.bins.t_s, &means[axis], &data.count[axis]))
}
