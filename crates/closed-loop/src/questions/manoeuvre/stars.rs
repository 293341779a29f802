//! Manoeuvres as this bundle's stars would show them.
//!
//! ```text
//! v_k = R(axis, k fov) v_0,   k = -1, 0, 1, ...     the pattern of stars, repeated along the slew
//! ```
//!
//! Source: `dv/dt = -omega x v` for a fixed star, the convention of `focal_plane::AttitudeSource`.

use block_regression::Folds;
use coloured_noise::CommonNoise;
use effects::Candidate;
use focal_plane::{Camera, StarFrames, rotation_from_vector};
use nalgebra::{DMatrix, UnitQuaternion, Vector3};
use spectra::robust::median_step;
use telemetry::Model;

use super::{Flown, information};
use crate::declared::OnCentroids;
use crate::star::data::{Inputs, Star, StarData};
use crate::star::evidence::StarEvidence;
use crate::star::nuisance::StarNuisance;
use crate::star::slow_price::SlowPrice;

/// Far beyond any catalogue: what tells a repeated star from its original.
const COPY: i64 = 1_000_000_007;
/// Most repetitions of the pattern to one side.
const MOST_COPIES: i64 = 50;

/// A tracker that sees the same number of stars wherever it turns.
pub(crate) struct Sky<'a> {
    camera: &'a Camera,
    model: &'a Model,
    /// What the model leaves open of the bundle.
    nuisance: StarNuisance,
    /// Stars of one frame, with their slots and how much their rows count.
    stars: Vec<Seen>,
    attitude: UnitQuaternion<f64>,
    free: [bool; 2],
    step_s: f64,
    /// Variance of a scalar, in the unit of the fit, and the noise that whitens.
    variance: f64,
    noise: Option<CommonNoise>,
    /// White noise of the reference.
    drawn: Option<[f64; 3]>,
}

/// A star in a slot.
#[derive(Clone)]
struct Seen {
    slot: i32,
    star: Star,
    /// Weight of its rows: the variance of a scalar is that of a row of weight 1.
    weight: f64,
}

impl<'a> Sky<'a> {
    /// The stars of the frame with most of them, of several the one nearest the middle.
    pub(crate) fn of(
        data: &'a StarData,
        model: &'a Model,
        weight: &[f64],
        variance: f64,
        noise: Option<CommonNoise>,
    ) -> Option<Self> {
        let frames = data.frames.frames();
        let frame = (0..frames).max_by_key(|&k| {
            let off = (2 * k).abs_diff(frames);
            (data.frames.rows_of(k).len(), usize::MAX - off)
        })?;
        let stars = data.frames.rows_of(frame).map(|row| Seen {
            slot: data.frames.slot[row],
            star: data.stars[data.star[row]].clone(),
            weight: weight[row],
        });
        Some(Self {
            camera: &data.camera,
            model,
            nuisance: StarNuisance::declared(model, data),
            stars: stars.collect(),
            attitude: data.attitude[frame],
            free: [data.free_attitude, data.free_directions],
            step_s: median_step(&data.frames.t_s)?,
            variance,
            noise,
            drawn: None,
        })
    }

    /// The same where the reference has white noise ([`StarEvidence::drawn`]).
    pub(crate) fn drawn(self, drawn: Option<[f64; 3]>) -> Self {
        Self { drawn, ..self }
    }

    pub(crate) fn attitude(&self) -> UnitQuaternion<f64> {
        self.attitude
    }

    /// Information on the candidates' columns along a manoeuvre.
    pub(crate) fn fly(&self, flown: &Flown, candidates: &[&dyn Candidate]) -> Option<DMatrix<f64>> {
        let (count, whole) = flown.frames(self.step_s);
        let t_s = flown.times(count);
        let series = flown.series(&t_s)?;
        let stars = self.stars_along(flown);
        let mut frames = StarFrames::new();
        for (&t, q) in t_s.iter().zip(series.quaternions()) {
            frames.begin(t);
            for Seen { slot, star, .. } in &stars {
                if let Some(at) = self.camera.project(&(q * star.direction))
                    && self.camera.contains(at)
                {
                    frames.push(*slot, star.id, at.x, at.y);
                }
            }
        }
        let seen = |id: i64| stars.iter().find(|s| s.star.id == id);
        let find = |id: i64| seen(id).map(|s| s.star.clone());
        let mut data = StarData::prepare(&Inputs {
            camera: self.camera,
            frames: &frames,
            reference: Some(&series),
            catalogue: Some(&find),
            phase: &OnCentroids::from(self.model),
            effects: &[],
        });
        [data.free_attitude, data.free_directions] = self.free;
        data.turn_back();
        data.follow(Some(flown));
        let none = || vec![0.0; data.t_s.len()];
        let of_star = data
            .stars
            .iter()
            .map(|s| seen(s.id).map_or(1.0, |s| s.weight));
        let of_star: Vec<f64> = of_star.collect();
        let weight: Vec<f64> = data.star.iter().map(|&s| of_star[s]).collect();
        let evidence = StarEvidence {
            data: &data,
            nuisance: self.nuisance.clone().of_stars(&data),
            residuals: vec![[none(), none()]].into(),
            motion: Some(flown),
            resolved: true,
            own_paths: false,
            sigma_guess_arcsec: 1.0,
            noise: None,
            weight: weight.into(),
            drawn: self.drawn,
            slow_price: SlowPrice::default(),
            kept: Vec::new(),
        };
        // nothing is predicted: only the sum over all is asked for
        let folds = Folds::whole(data.frames.frames());
        match &self.noise {
            // slow noise does not average out over the frames that are left out
            Some(noise) => information(
                &evidence.with_noise(noise),
                candidates,
                &folds,
                self.variance,
            ),
            None => {
                let thinned = self.variance * count as f64 / whole;
                information(&evidence, candidates, &folds, thinned)
            }
        }
    }

    fn stars_along(&self, flown: &Flown) -> Vec<Seen> {
        let axis = flown.axis();
        let fov = self.camera.fov().map(|f| f.rad());
        let fov = fov[0].max(fov[1]);
        // about the boresight the same stars stay
        let copies = if axis.z.abs() > 0.5 {
            0
        } else {
            let path = flown.path_rad();
            (1..=MOST_COPIES)
                .find(|&k| fov * k as f64 >= path)
                .unwrap_or(MOST_COPIES)
        };
        let first = if copies > 0 { -1 } else { 0 };
        (first..=copies)
            .flat_map(|k| {
                let angle: Vector3<f64> = axis * (fov * k as f64);
                let back = self.attitude.inverse();
                let turn = back * rotation_from_vector(&angle) * self.attitude;
                self.stars.iter().map(move |seen| Seen {
                    star: Star {
                        id: seen.star.id + COPY * k,
                        direction: turn * seen.star.direction,
                        ..seen.star.clone()
                    },
                    ..seen.clone()
                })
            })
            .collect()
    }
}
