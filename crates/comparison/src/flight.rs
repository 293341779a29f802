//! A model flown along the measured motion: the residual that it would have shown.
//!
//! ```text
//! PBM   theta = log(q_model q_ref^-1),    q_model from the stars of each frame, [M23] Fig. 4
//! HEM   theta = log(q_lsf q_ref^-1) + FOGM + white,   q_lsf with the drawn distortion alone, Fig. 5
//! ```
//!
//! The reference is the truth of the simulation. Each draw has its own distortion, temporal noise and
//! error of the reference; a constant misalignment is no part of a spectrum, and is not drawn. Values
//! that the rule for outliers would mask in a measured series are set to the median of the draw.
//!
//! Source: \[M23\] Fig. 4, Fig. 5 and Section 4.2.1 (100 randomly drawn model variants).

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use effects::{Effect, FrameGeometry, ReferenceWander, Surroundings, VectorFrame};
use focal_plane::{
    ARCSEC_PER_RAD, AttitudeSeries, AttitudeSource, Camera, Points, PointsMut, Series, Vectors,
    rotation_vector,
};
use fogm_fit::{Fogm, FogmWhite};
use rayon::prelude::*;
use scenarios::{Declared, effect_parameters};
use spectra::{robust, standing_out};
use star_tracker::{Disturbance, HemState, Measured, NoiseStreams, Purpose, Rows, Scratch, stream};
use telemetry::report::StarSource;
use telemetry::{Bundle, Model, ModelKind};

use crate::ComparisonError;
use crate::stars::Stars;

/// Frames that are simulated at once: bounds the memory of a draw.
const BATCH: usize = 2048;

/// A model, ready to be flown.
#[derive(Debug)]
pub(crate) struct Flight<'a> {
    t_s: &'a [f64],
    truth: &'a AttitudeSeries,
    model: &'a Model,
    seed: u64,
    camera: Camera,
    /// None where the model needs none.
    stars: Option<Stars>,
    effects: Vec<Arc<dyn Effect>>,
    /// Ideal x and y of the stars of each batch of frames with all effects, px: the same in every draw. Empty
    /// for a hybrid model, whose optics are its own ([`star_tracker::Hem`]).
    ideal: Vec<[Vec<f64>; 2]>,
}

impl<'a> Flight<'a> {
    /// Prepares a model for the frames at `t_s`.
    ///
    /// # Errors
    ///
    /// A model that does not fit the bundle, an effect that cannot be built, no camera, no stars.
    pub(crate) fn new(
        model: &'a Model,
        bundle: &Bundle,
        truth: &'a AttitudeSeries,
        t_s: &'a [f64],
        seed: u64,
        notes: &mut Vec<String>,
    ) -> Result<Self, ComparisonError> {
        let hybrid = model.kind == ModelKind::Hem;
        if hybrid {
            scenarios::hybrid_processes(model)?;
        }
        let distorted = model.noise.distortion_arcsec.is_some_and(|s| s > 0.0);
        let (camera, effects, stars) = if !hybrid || distorted || !model.effects.is_empty() {
            let camera = camera(model, bundle)?;
            let effects = built(model, bundle, &camera, t_s, notes)?;
            let max_stars = model.tracker.max_stars;
            let stars = Stars::of(bundle, &camera, truth, t_s, max_stars, seed)?;
            (camera, effects, Some(stars))
        } else {
            // without stars nothing is projected: any camera does
            (Camera::from_focal_length_px([2, 2], 1.0)?, vec![], None)
        };
        let mut flight = Self {
            t_s,
            truth,
            model,
            seed,
            camera,
            stars,
            effects,
            ideal: vec![],
        };
        if !hybrid {
            flight.ideal = flight.ideal()?;
        }
        Ok(flight)
    }

    fn disturbances(&self) -> Vec<Arc<dyn Disturbance>> {
        let all = self.effects.iter();
        all.map(|effect| Arc::clone(effect) as Arc<dyn Disturbance>)
            .collect()
    }

    fn ideal(&self) -> Result<Vec<[Vec<f64>; 2]>, ComparisonError> {
        let any = Declared::draw(self.model, &self.camera, &self.disturbances(), self.seed, 0)?;
        let batches: Vec<Range<usize>> = self.batches().collect();
        let of = |scratch: &mut Scratch, frames: Range<usize>| {
            let mut first_row = vec![];
            let rows = self.rows(frames, &mut first_row);
            let [mut x, mut y] = [(); 2].map(|()| vec![0.0; rows.len()]);
            let out = PointsMut {
                x: &mut x,
                y: &mut y,
            };
            any.pbm.ideal_into(self.truth, rows, scratch, out);
            [x, y]
        };
        Ok(batches
            .into_par_iter()
            .map_init(Scratch::default, of)
            .collect())
    }

    fn batches(&self) -> impl Iterator<Item = Range<usize>> {
        let frames = self.t_s.len();
        (0..frames)
            .step_by(BATCH)
            .map(move |from| from..(from + BATCH).min(frames))
    }

    /// Rows of some frames: `first_row` is the caller's, and is filled.
    fn rows<'r>(&'r self, frames: Range<usize>, first_row: &'r mut Vec<usize>) -> Rows<'r> {
        if let Some(stars) = &self.stars {
            return stars.rows(self.t_s, frames, first_row);
        }
        first_row.clear();
        first_row.resize(frames.len() + 1, 0);
        starless(&self.t_s[frames], first_row)
    }

    /// Where its stars come from.
    pub(crate) fn stars(&self) -> StarSource {
        let stars = self.stars.as_ref();
        stars.map_or(StarSource::None, |stars| stars.source)
    }

    /// The residual of a draw about x, y, z, arcsec; NaN where the stars fix no attitude.
    ///
    /// # Errors
    ///
    /// Numbers of the model outside their range.
    pub(crate) fn draw(&self, draw: u64) -> Result<[Vec<f64>; 3], ComparisonError> {
        self.of(self.model, &self.disturbances(), draw)
    }

    /// The same of a hybrid model's processes and the wander of a declared reference, without distortion and without what
    /// other effects shift.
    ///
    /// # Errors
    ///
    /// As [`draw`](Self::draw).
    pub(crate) fn processes_alone(&self, draw: u64) -> Result<[Vec<f64>; 3], ComparisonError> {
        assert!(self.ideal.is_empty(), "only a hybrid model has processes");
        let mut model = self.model.clone();
        model.noise.distortion_arcsec = None;
        self.of(&model, &[], draw)
    }

    fn of(
        &self,
        model: &Model,
        disturbances: &[Arc<dyn Disturbance>],
        draw: u64,
    ) -> Result<[Vec<f64>; 3], ComparisonError> {
        let declared = Declared::draw(model, &self.camera, disturbances, self.seed, draw)?;
        let mut theta = self.fly(&declared, draw);
        let mut rng = stream(self.seed, draw, Purpose::Reference);
        let mut error = vec![0.0; self.t_s.len()];
        for wander in self.effects.iter().filter_map(|e| e.reference_wander()) {
            let ReferenceWander {
                sigma_arcsec,
                tau_s,
            } = wander;
            for axis in 0..3 {
                let process = FogmWhite::new(Fogm::new(sigma_arcsec[axis], tau_s[axis])?, 0.0)?;
                // the reference's error has the other sign, which no spectrum sees
                process.simulate_at_into(self.t_s, &mut rng, &mut error);
                theta[axis]
                    .iter_mut()
                    .zip(&error)
                    .for_each(|(t, e)| *t -= e);
            }
        }
        Ok(theta)
    }

    fn fly(&self, declared: &Declared, draw: u64) -> [Vec<f64>; 3] {
        let mut theta = [(); 3].map(|()| vec![f64::NAN; self.t_s.len()]);
        let mut streams = NoiseStreams::new(self.seed, draw);
        let mut state = HemState::new(self.seed, draw);
        let (mut scratch, mut out, mut first_row) =
            (Scratch::default(), Measured::default(), vec![]);
        for (batch, frames) in self.batches().enumerate() {
            let rows = self.rows(frames.clone(), &mut first_row);
            match &declared.hem {
                Some(hem) => hem.measure_into(
                    self.truth,
                    rows,
                    &mut state,
                    &mut streams,
                    &mut scratch,
                    &mut out,
                ),
                None => {
                    let [x, y] = &self.ideal[batch];
                    declared.pbm.measure_at_into(
                        self.truth,
                        rows,
                        Points { x, y },
                        &mut streams,
                        &mut scratch,
                        &mut out,
                    );
                }
            }
            for k in frames.clone() {
                let truth = self.truth.attitude(self.t_s[k]);
                if let (Some(q), Some(truth)) = (out.attitude(k - frames.start), truth) {
                    let error = rotation_vector(&q, &truth) * ARCSEC_PER_RAD;
                    for axis in 0..3 {
                        theta[axis][k] = error[axis];
                    }
                }
            }
        }
        theta
    }
}

/// Frames without stars.
fn starless<'a>(t_s: &'a [f64], first_row: &'a [usize]) -> Rows<'a> {
    Rows {
        t_s,
        first_row,
        slot: &[],
        star_id: &[],
        mag: &[],
        bv: &[],
        direction: Vectors {
            x: &[],
            y: &[],
            z: &[],
        },
    }
}

/// Sets what a measured series would have masked to the median: values beyond 8 robust sigma where nothing lasts, and
/// frames without an attitude.
pub(crate) fn without_outliers(theta: &mut [f64]) {
    let mut out = vec![false; theta.len()];
    while standing_out::mark(theta, &mut out) > 0 {}
    let median = robust::median(&mut theta.to_vec()).unwrap_or(0.0);
    for (value, out) in theta.iter_mut().zip(out) {
        if out || !value.is_finite() {
            *value = median;
        }
    }
}

/// The camera of the model; what it leaves out is the bundle's.
pub(crate) fn camera(model: &Model, bundle: &Bundle) -> Result<Camera, ComparisonError> {
    let camera = model.camera_over(&bundle.meta.tracker)?;
    camera.ok_or(ComparisonError::NothingToCompare(
        "neither the model nor the bundle gives pixels and focal length under [tracker]",
    ))
}

fn built(
    model: &Model,
    bundle: &Bundle,
    camera: &Camera,
    t_s: &[f64],
    notes: &mut Vec<String>,
) -> Result<Vec<Arc<dyn Effect>>, ComparisonError> {
    let channels: BTreeMap<String, Series> = bundle
        .housekeeping
        .as_ref()
        .map(telemetry::Housekeeping::all_series)
        .unwrap_or_default();
    let frames = bundle.meta.frames.as_ref().map(|f| FrameGeometry {
        tracker_boresight: f.tracker_boresight,
        reference_boresight: f.reference_boresight,
        vectors_in: match f.vectors_in {
            Some(telemetry::VectorFrame::Inertial) => VectorFrame::Inertial,
            Some(telemetry::VectorFrame::Tracker) => VectorFrame::Tracker,
            Some(telemetry::VectorFrame::Body) | None => VectorFrame::Body,
        },
        quaternion_signs: f.quaternion_signs.known(),
    });
    let surroundings = Surroundings {
        camera,
        span_s: [t_s[0], t_s[t_s.len() - 1]],
        channels: &channels,
        frames,
    };
    let mut out: Vec<Arc<dyn Effect>> = vec![];
    for (index, entry) in model.effects.iter().enumerate() {
        let wrong = |error| scenarios::effect_error(model, index, error);
        if effects::kind(&entry.id).map_err(wrong)?.acts_on().images {
            notes.push(format!(
                "effect {} acts on raw images, and is left out of the ensemble",
                entry.id
            ));
            continue;
        }
        let parameters = effect_parameters(entry);
        let built = effects::build(&entry.id, &parameters, &surroundings);
        out.push(built.map_err(wrong)?.into());
    }
    Ok(out)
}

/// A frame that a draw has no value for.
pub(crate) fn missing(theta: &[Vec<f64>; 3], k: usize) -> bool {
    theta.iter().any(|axis| !axis[k].is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spikes_and_missing_frames_become_the_median() {
        let mut theta: Vec<f64> = (0..101).map(|k| f64::from(k % 5)).collect();
        theta[7] = 1e4;
        theta[8] = f64::NAN;
        without_outliers(&mut theta);
        assert!((theta[7] - 2.0).abs() < 1e-12 && (theta[8] - 2.0).abs() < 1e-12);
        assert!((theta[9] - 4.0).abs() < 1e-12, "the others stay");
    }
}
