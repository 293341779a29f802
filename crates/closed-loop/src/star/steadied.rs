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

use coloured_noise::Rotations;
use focal_plane::{ARCSEC_PER_RAD, AttitudeSeries, Series, rotation_from_vector};
use nalgebra::Vector3;

use crate::star::data::StarData;
use crate::star::frame_rotation::Turns;
use crate::star::search::Wander;

/// `reference` less its slow error; `residual` by rows, arcsec: what the best fit leaves, that error with it.
/// `None` where hardly a frame tells of it.
pub(crate) fn steadied(
    data: &StarData,
    reference: &AttitudeSeries,
    wander: &Wander,
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
    let noise = &wander.noise;
    let frames = vec![1; t_s.len()];
    let slow = Rotations::new(t_s.clone(), theta, frames, inverse, noise.centroid).slow_part(noise);
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let series = slow.iter().map(|m| m[axis]).collect();
        Series::new(t_s.clone(), series).ok()
    });
    let (slow, back) = ([x?, y?, z?], data.turn().inverse());
    let (first, last) = (*t_s.first()?, *t_s.last()?);
    let steady = reference.t_s().iter().zip(reference.quaternions());
    let steady = steady.map(|(t, q)| {
        let error = slow.each_ref().map(|m| m.at(t.clamp(first, last)));
        let error = error.map(|m| m.unwrap_or(0.0) / ARCSEC_PER_RAD);
        rotation_from_vector(&(back * Vector3::from(error))) * q
    });
    let rates = reference.given_rates_rad_s().map(<[_]>::to_vec);
    let steady = AttitudeSeries::new(reference.t_s().to_vec(), steady.collect(), rates).ok()?;
    Some(steady.with_max_gap_s(reference.max_gap_s()))
}
