//! What a fit leaves of attitudes, out of fold and in sample.
//!
//! Not physics: residuals of what was fitted elsewhere.

use block_regression::Folds;
use coloured_noise::Coloured;
use nalgebra::DVector;

use crate::attitude::data::{AttitudeData, AttitudeEvidence};
use crate::attitude::spatial_errors::SpatialErrors;
use crate::error::CloseError;
use crate::evidence::{Amplitudes, Evidence, Residuals};
use crate::motion::Around;
use crate::search::selection::columns_of;
use crate::search::{Found, amplitudes, borrowed};
use crate::situation::Situation;
use crate::unexplained::leftover::{self, Series};

/// Attitudes as evidence under this `noise`.
pub(super) fn evidence<'a>(
    data: &'a AttitudeData,
    situation: &Situation<'_>,
    noise: [Coloured; 3],
    motion: &'a Around,
) -> AttitudeEvidence<'a> {
    AttitudeEvidence {
        data,
        constant_sigma: situation
            .model
            .noise
            .bias_arcsec
            .map_or([f64::INFINITY; 3], |b| {
                b.map(|s| if s > 0.0 { s } else { f64::INFINITY })
            }),
        noise,
        motion: Some(motion),
    }
}

/// What the `chosen` leave out of fold.
pub(super) fn residuals(
    evidence: &AttitudeEvidence<'_>,
    folds: &Folds,
    found: &Found,
    chosen: &[usize],
) -> Result<Residuals, CloseError> {
    let columns = found
        .candidates
        .iter()
        .map(|c| c.coefficients().len())
        .sum();
    let amplitudes =
        amplitudes(&found.fitted, folds, chosen, columns).ok_or(CloseError::Singular)?;
    Ok(evidence.residuals(folds, &borrowed(&found.candidates), &amplitudes))
}

/// Residuals with the chosen effects estimated from all data: what other folds
/// predict has steps of its own where folds meet.
pub(super) fn in_sample(
    evidence: &AttitudeEvidence<'_>,
    found: &Found,
    chosen: &[usize],
) -> Option<Residuals> {
    let set = columns_of(&found.fitted.groups, chosen);
    let value = found.fitted.fits.estimate(&set)?.value;
    let list = borrowed(&found.candidates);
    let columns = list.iter().map(|c| c.coefficients().len()).sum();
    let mut beta = DVector::zeros(columns);
    for (i, &c) in set.iter().enumerate() {
        beta[c] = value[i];
    }
    let amplitudes = Amplitudes {
        nuisance: Vec::new(),
        candidates: vec![beta],
    };
    let folds = Folds::whole(evidence.data.t_s.len());
    Some(evidence.residuals(&folds, &list, &amplitudes))
}

/// What lines and jumps are looked for in: axes without the noise that they share, where a row counts on all of them.
pub(super) fn tracks(
    data: &AttitudeData,
    residual: &Residuals,
    changes: Option<&SpatialErrors>,
) -> Series {
    let (axes, outlier) = data.mixing.mix_rows(&residual.axes, &data.outlier);
    Series::of(&leftover::attitude_tracks(
        &data.t_s, &axes, &outlier, changes,
    ))
}
