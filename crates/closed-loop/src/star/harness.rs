//! Data of a few stars, for tests.
//!
//! Not physics: helpers of tests.

use std::sync::Arc;

use focal_plane::{AttitudeSeries, Camera, Pixel, StarFrames};
use nalgebra::UnitQuaternion;
use telemetry::Model;

use crate::declared::OnCentroids;
use crate::star::data::{Inputs, Star, StarData};
use crate::star::evidence::StarEvidence;
use crate::star::nuisance::StarNuisance;
use crate::star::slow_price::SlowPrice;

/// Places of six stars in a detector of 1024 pixels, from its centre, px.
pub(crate) const STARS: [[f64; 2]; 6] = [
    [300.0, 90.0],
    [-250.0, 330.0],
    [-160.0, -320.0],
    [190.0, -190.0],
    [10.0, 60.0],
    [-390.0, -40.0],
];

/// What an untilted camera of 20 degrees at rest saw of [`STARS`] at these times.
pub(crate) fn at_rest(t_s: Vec<f64>) -> StarData {
    let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
    let mut frames = StarFrames::new();
    for &t in &t_s {
        frames.begin(t);
        for (id, [x, y]) in (0..).zip(STARS) {
            frames.push(id, i64::from(id), x, y);
        }
    }
    let q = vec![UnitQuaternion::identity(); t_s.len()];
    let reference = AttitudeSeries::new(t_s, q, None).unwrap();
    seen(&camera, &frames, Some(&reference), &STARS)
}

/// What `frames` saw of stars that an untilted `camera` has at `places`, px; the id of a star is its place
/// among them.
pub(crate) fn seen(
    camera: &Camera,
    frames: &StarFrames,
    reference: Option<&AttitudeSeries>,
    places: &[[f64; 2]],
) -> StarData {
    let find = |id: i64| {
        let [x, y] = *places.get(usize::try_from(id).ok()?)?;
        Some(Star {
            id,
            mag: 5.0,
            bv: 0.6,
            direction: camera.direction(Pixel { x, y }),
        })
    };
    StarData::prepare(&Inputs {
        camera,
        frames,
        reference,
        catalogue: Some(&find),
        phase: &OnCentroids::default(),
        effects: &[],
    })
}

/// White evidence of rows of equal weight that show nothing.
pub(crate) fn silent<'a>(data: &'a StarData, model: &Model) -> StarEvidence<'a> {
    let rows = data.t_s.len();
    StarEvidence {
        data,
        nuisance: StarNuisance::declared(model, data),
        residuals: Arc::new(vec![[vec![0.0; rows], vec![0.0; rows]]]),
        motion: None,
        resolved: false,
        own_paths: false,
        sigma_guess_arcsec: 1.0,
        noise: None,
        weight: Arc::new(vec![1.0; rows]),
        drawn: None,
        slow_price: SlowPrice::default(),
        kept: Vec::new(),
    }
}
