//! The path of the tracker where its reference errs slowly: less the error that the stars tell.
//!
//! A path through a reference's attitudes holds their error e, and so do the residuals against them. A walk's
//! second differences go with the walk itself: what follows the acceleration of such a path seems to act where
//! nothing does. Rotations of the frames tell the mean of e given all residuals,
//!
//! ```text
//! q' = exp(m) q      m = E[e | theta^_1 .. theta^_n]      E[(e - m) theta^_k] = 0 for all k
//! ```
//!
//! so that what the path still errs by has nothing in common with the residuals. Less than the whole error is taken
//! out, never more than the stars tell of it: the reference remains what residuals are held against.
//!
//! Source: Henderson 1975 (best linear unbiased prediction); Fuller 1987 (regression calibration).

use coloured_noise::{CommonNoise, Rotations};
use focal_plane::AttitudeSeries;
use nalgebra::Vector3;

use crate::motion::turned_by;
use crate::star::data::StarData;
use crate::star::frame_rotation::Turns;

/// `reference` less its slow error; `residual` by rows, arcsec: what the best fit leaves, that error with it.
/// `None` where hardly a frame tells of it.
pub(crate) fn steadied(
    data: &StarData,
    reference: &AttitudeSeries,
    noise: &CommonNoise,
    residual: [&[f64]; 2],
    weight: &[f64],
) -> Option<AttitudeSeries> {
    let turns = Turns::of(data, residual, weight).frames;
    let inverse: Vec<_> = turns
        .iter()
        .map(|turn| turn.as_ref()?.normal.try_inverse())
        .collect();
    let theta = turns
        .iter()
        .map(|turn| turn.as_ref().map_or_else(Vector3::zeros, |t| t.theta))
        .flat_map(|theta| [theta.x, theta.y, theta.z])
        .collect();
    let t_s = &data.frames.t_s;
    let frames = vec![1; t_s.len()];
    let slow = Rotations::new(t_s.clone(), theta, frames, inverse, noise.centroid).slow_part(noise);
    let back = data.turn().inverse();
    let slow: Vec<_> = slow.iter().map(|m| back * m).collect();
    turned_by(reference, t_s, &slow)
}
