//! The declared model at its best.
//!
//! What it leaves unknown is fitted, modelled positions move with it, and so does the declared
//! centroid error there; what stands out of that residual is an outlier. A few rounds settle it. Before
//! anything stands out, stars are projected through the misalignment that was found, and directions that nothing
//! else tells are taken where the fit has them.
//!
//! Not physics: fits until positions and outliers stand still.

use block_regression::Folds;

use crate::declared;
use crate::error::CloseError;
use crate::evidence::{Amplitudes, Residuals};
use crate::search::{amplitudes, fit};
use crate::situation::Situation;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use nalgebra::DVector;

/// Fits of the declared unknowns, each at better modelled positions: at most, and at least, where frames have
/// attitudes of their own too.
const MOST_ROUNDS: usize = 12;
const LEAST_ROUNDS: [usize; 2] = [2, 4];
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
    phase: &declared::OnCentroids,
    folds: &Folds,
) -> Result<Settled, CloseError> {
    let (mut round, mut turns) = (0, 0);
    let least = LEAST_ROUNDS[usize::from(data.free_attitude)];
    let mut last = f64::INFINITY;
    let effects = declared::effects(situation)?;
    loop {
        let (mut before, inside, loglik, variance, misalignment, directions) = {
            let evidence = StarEvidence::new(data, situation, vec![data.measured_residual()], None);
            let fitted = fit(&evidence, folds, &[])?;
            let amplitudes = amplitudes(&fitted, folds, &[], 0).ok_or(CloseError::Singular)?;
            let none = DVector::zeros(0);
            let whole = fitted.fits.nuisance(None, &[], &none);
            let misalignment = evidence.nuisance.misalignment_of(&whole);
            let unknown = evidence.nuisance.directions();
            let directions = (!unknown.is_empty()).then(|| whole.rows_range(unknown).into_owned());
            let inside = Amplitudes {
                nuisance: vec![whole; folds.count],
                candidates: vec![none; folds.count],
            };
            let loglik = fitted.data_loglik(&[]);
            let variance = fitted.fits.variance(&[]).unwrap_or(0.0);
            // where other folds have no stars they know little of the distortion, and so of where the light fell
            let [before, inside] = evidence.residuals_of(folds, &[], [&amplitudes, &inside]);
            (before, inside, loglik, variance, misalignment, directions)
        };
        if let Some((theta, reference)) = misalignment.zip(situation.reference.as_ref())
            && turns < TURNS
            && data.project_through(theta, variance, reference, &effects)
        {
            // beside the misalignment the distortion is what it was
            data.move_modelled(&inside, &mut before, phase);
            turns += 1;
            continue;
        }
        if let Some(directions) = directions
            && turns < TURNS
            && data.move_directions(
                directions.as_slice(),
                situation.reference.as_ref(),
                &effects,
            )
        {
            turns += 1;
            continue;
        }
        let added = data.mark_outliers(&[&before.axes, &inside.axes]);
        round += 1;
        let mut turned = 0.0;
        if data.free_attitude {
            turned = data.turn_frames(&inside.modelled, &effects);
        }
        let moved = turned + data.move_modelled(&inside, &mut before, phase);
        // steep centroid errors move where they are evaluated, and attitudes what the columns of a rotation are: each
        // round leaves a share of what the one before did, and what is left of all rows together is less than the
        // noise of one
        let settled = moved * (moved / last).min(1.0) < variance;
        last = moved;
        if round >= least && added == 0 && settled || round >= MOST_ROUNDS {
            return Ok(Settled {
                before,
                loglik: loglik.filter(|_| added == 0),
                phase_error: None,
            });
        }
    }
}
