//! Manoeuvres as this bundle's attitudes would show them.
//!
//! Not physics: rows of attitudes along a motion.

use block_regression::Folds;
use coloured_noise::Coloured;
use effects::Candidate;
use nalgebra::DMatrix;

use super::{Flown, information};
use crate::attitude::data::{AttitudeData, AttitudeEvidence};
use crate::attitude::mixing::Mixing;
use crate::bins::MOST;

/// Information on the candidates' columns along a manoeuvre, with frames every `step_s`.
pub(crate) fn fly(
    flown: &Flown,
    candidates: &[&dyn Candidate],
    step_s: f64,
    constant_sigma: [f64; 3],
    noise: [Coloured; 3],
    mixing: Mixing,
) -> Option<DMatrix<f64>> {
    let (count, whole) = flown.frames(step_s);
    let t_s = flown.times(count);
    let series = flown.series(&t_s)?;
    let mut data = AttitudeData::against(&t_s, series.quaternions(), &series);
    // nothing is predicted: only the sum over all is asked for
    let folds = Folds::whole(data.t_s.len());
    data.rebin(&folds, MOST);
    data.mixing = mixing;
    let thinned = (count as f64 / whole).sqrt();
    let evidence = AttitudeEvidence {
        data: &data,
        constant_sigma,
        noise: noise.map(|n| Coloured {
            white: n.white * thinned,
            ..n
        }),
        motion: Some(flown),
    };
    information(&evidence, candidates, &data.bins.folds, 1.0)
}
