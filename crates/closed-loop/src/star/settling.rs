//! The declared model at its best.
//!
//! What it leaves unknown is fitted, modelled positions move with it, and so does the declared
//! centroid error there; what stands out of that residual is an outlier. A few rounds settle it. Before
//! anything stands out, stars are projected through the misalignment that was found.
//!
//! Not physics: fits until positions and outliers stand still.

use block_regression::Folds;

use crate::declared;
use crate::error::CloseError;
use crate::evidence::{Evidence, Residuals};
use crate::search::{amplitudes, fit};
use crate::situation::Situation;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use nalgebra::DVector;

/// Fits of the declared unknowns, each at better modelled positions: at most, and at least.
const SETTLING_ROUNDS: usize = 4;
const LEAST_ROUNDS: usize = 2;
/// Most projections: from a degree two do, each leaves the square of the last.
const TURNS: usize = 8;

/// The declared model at its best.
pub(crate) struct Settled {
    pub(crate) before: Residuals,
    /// Log-likelihood out of fold; `None` where rows were left out since.
    pub(crate) loglik: Option<f64>,
    /// The declared centroid error in it, px, where it is no longer that of the data.
    pub(crate) phase_error: Option<[Vec<f64>; 2]>,
}

/// Fits what the declared model leaves unknown, moves the modelled positions and
/// marks outliers, until both stand still; returns the before residual.
pub(crate) fn settle(
    data: &mut StarData,
    situation: &Situation<'_>,
    phase: &centroid::CentroidError,
    folds: &Folds,
) -> Result<Settled, CloseError> {
    let (mut round, mut turns) = (0, 0);
    loop {
        let (mut before, loglik, variance, misalignment) = {
            let evidence = StarEvidence::new(data, situation, vec![data.measured_residual()], None);
            let fitted = fit(&evidence, folds, &[])?;
            let amplitudes = amplitudes(&fitted, folds, &[], 0).ok_or(CloseError::Singular)?;
            let loglik = fitted.fits.out_of_fold(&[]).map(|o| o.data_loglik());
            let variance = fitted.fits.variance(&[]).unwrap_or(0.0);
            (
                evidence.residuals(folds, &[], &amplitudes),
                loglik,
                variance,
                evidence.nuisance.misalignment_of(&fitted.fits.nuisance(
                    None,
                    &[],
                    &DVector::zeros(0),
                )),
            )
        };
        if let Some((theta, reference)) = misalignment.zip(situation.reference.as_ref())
            && turns < TURNS
        {
            let effects = declared::effects(situation)?;
            if data.project_through(theta, variance, reference, &effects) {
                // beside the misalignment the distortion is what it was
                data.move_modelled(&mut before, phase);
                turns += 1;
                continue;
            }
        }
        let added = data.mark_outliers(&before.axes);
        round += 1;
        if round >= SETTLING_ROUNDS && (added == 0 || round > 3 * SETTLING_ROUNDS) {
            let loglik = loglik.filter(|_| added == 0);
            return Ok(Settled {
                before,
                loglik,
                phase_error: None,
            });
        }
        if data.free_attitude {
            data.turn_frames(&before.modelled);
        }
        let moved = data.move_modelled(&mut before, phase);
        // all rows together by less than the noise of one: another fit would move them by a hundredth of that
        if round >= LEAST_ROUNDS && added == 0 && !data.free_attitude && moved < variance {
            return Ok(Settled {
                before,
                loglik,
                phase_error: None,
            });
        }
    }
}
