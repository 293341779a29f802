//! From a scenario to a bundle.
//!
//! ```text
//! motion -> truth -> sky -> rows -> physics-based model with the effects -> stars, attitude
//!             |                 \-> or hybrid model with the effects -> attitude
//!             \-> reference, rates        housekeeping -> effects
//! ```
//!
//! Every random number comes from the stream of its purpose (seed, draw, purpose), and everything runs
//! in one order on one thread: the same scenario gives the same bundle anywhere.
//!
//! Source: [M23] Section 2.6 and Figs. 4 and 5.

use std::path::Path;
use std::sync::Arc;

use effects::{Effect, FrameGeometry, Surroundings, VectorFrame};
use focal_plane::{Angle, AttitudeSeries, AttitudeSource, Camera, StarFrames, Vectors};
use nalgebra::Vector3;
use rand_distr::{Distribution, StandardNormal};
use star_tracker::{
    Disturbance, Hem, HemState, Measured, NoiseStreams, Pbm, Purpose, Rows, Scratch, Stages, stream,
};
use telemetry::{AttitudeTable, Bundle, Frames, Metadata, Model, QuaternionSigns, TrackerMeta};

use crate::declared::{Declared, effect_parameters};
use crate::housekeeping::Channels;
use crate::located::effect_error;
use crate::reference::Wander;
use crate::run::{Reported, Run};
use crate::sky::Seen;
use crate::{Motion, Scenario, ScenarioError};

/// A bundle with what it was made from.
#[derive(Clone, Debug)]
pub struct Simulated {
    /// What a user of the tracker gets.
    pub bundle: Bundle,
    /// True attitude.
    pub truth: AttitudeSeries,
    /// The tracker with everything that acts in it; of a hybrid model the part that follows the stars.
    pub pbm: Pbm,
    /// The hybrid model, where the scenario's is of that kind.
    pub hem: Option<Hem>,
    /// The effects of the scenario, in its order; they are among the disturbances of `pbm` too.
    pub effects: Vec<Arc<dyn Effect>>,
    /// Stars asked for and what came out, row by row of the frames of the run, rows left out included;
    /// a hybrid model has no positions, and without distortion no stars.
    pub measured: Measured,
    /// True inertial directions of these rows: x, y, z.
    pub direction: [Vec<f64>; 3],
    /// Slots and stars of these rows; their positions are NaN.
    pub rows: StarFrames,
}

/// The bundle of the scenario's own draw.
///
/// # Errors
/// A number outside its range, an effect that cannot be built, a recording that cannot be read, or a
/// field without stars.
pub fn simulate(scenario: &Scenario) -> Result<Bundle, ScenarioError> {
    Ok(simulate_with_truth(scenario, scenario.run.draw)?.bundle)
}

/// The bundle of another draw of the same scenario, with the truth behind it.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_with_truth(scenario: &Scenario, draw: u64) -> Result<Simulated, ScenarioError> {
    let model = &scenario.model;
    scenario.run.check(model.kind)?;
    let seed = scenario.run.seed;
    let camera = camera(model)?;
    let rate_hz = scenario
        .run
        .rate_hz
        .or(model.tracker.update_rate_hz)
        .ok_or(ScenarioError::Missing {
            name: "run.rate_hz or tracker.update_rate_hz",
        })?;
    let (motion, run) = (&scenario.motion, &scenario.run);
    let (truth, t_s) = truth_and_times(motion, run, &scenario.folder, rate_hz, draw)?;
    let year = scenario
        .run
        .epoch
        .map_or(crate::sky::CATALOGUE_YEAR, |epoch| epoch.julian_year(0.0));
    let channels = match &scenario.housekeeping {
        Some(housekeeping) => housekeeping.channels(
            truth.span_s(),
            &mut stream(seed, draw, Purpose::Housekeeping),
        )?,
        None => Channels::default(),
    };
    let surroundings = Surroundings {
        camera: &camera,
        span_s: [t_s[0], t_s[t_s.len() - 1]],
        channels: &channels.series,
        frames: channels.vectors.then_some(INERTIAL),
    };
    let effects = build_effects(model, &surroundings)?;
    let mut disturbances: Vec<Arc<dyn Disturbance>> = bias(model, seed, draw).into_iter().collect();
    for effect in &effects {
        disturbances.push(effect.clone());
    }
    let Declared { pbm, hem } = Declared::draw(model, &camera, &disturbances, seed, draw)?;
    let seen = if hem.as_ref().is_none_or(Hem::needs_stars) {
        scenario.sky.follow(
            &camera,
            &truth,
            &t_s,
            model.tracker.max_stars,
            year,
            &mut stream(seed, draw, Purpose::StarField),
        )?
    } else {
        Seen::without_stars(&t_s)?
    };
    let measured = measure(&pbm, hem.as_ref(), &truth, &seen, seed, draw);
    let reports = |table| scenario.run.reports(table, model.kind);
    let bundle = Bundle {
        meta: metadata(scenario, rate_hz, draw, channels.vectors),
        camera: Some(camera),
        attitude: reports(Reported::Attitude).then(|| attitude_table(&t_s, &measured)),
        stars: reports(Reported::Stars)
            .then(|| star_frames(&seen.frames, &measured, scenario.run.position_step_px)),
        reference: reference(scenario, &truth, &t_s, rate_hz, &effects, draw)?,
        rates: rates(scenario, &truth, &t_s, rate_hz, draw)?,
        catalog: reports(Reported::Catalog).then_some(seen.catalogue),
        housekeeping: channels.table,
        ..Bundle::default()
    };
    Ok(Simulated {
        bundle,
        truth,
        pbm,
        hem,
        effects,
        measured,
        direction: seen.direction,
        rows: seen.frames,
    })
}

/// Vectors of simulated housekeeping are inertial.
const INERTIAL: FrameGeometry = FrameGeometry {
    tracker_boresight: None,
    reference_boresight: None,
    vectors_in: VectorFrame::Inertial,
    quaternion_signs: Some([1.0; 3]),
};

fn camera(model: &Model) -> Result<Camera, ScenarioError> {
    if model.tracker.pixels.is_none() {
        return Err(ScenarioError::Missing {
            name: "tracker.pixels",
        });
    }
    model.camera()?.ok_or(ScenarioError::Missing {
        name: "tracker.fov_deg or tracker.focal_length_px",
    })
}

/// True attitude, and the times of the frames.
pub(crate) fn truth_and_times(
    motion: &Motion,
    run: &Run,
    folder: &Path,
    rate_hz: f64,
    draw: u64,
) -> Result<(AttitudeSeries, Vec<f64>), ScenarioError> {
    let rng = stream(run.seed, draw, Purpose::Motion);
    let truth = motion.truth(span_s(motion, run)?, folder, &rng)?;
    let (start_s, frames) = times(motion, run, truth.span_s(), rate_hz);
    let t_s = (0..frames).map(|k| start_s + k as f64 / rate_hz).collect();
    Ok((truth, t_s))
}

/// Over which the motion has to be known, s.
pub(crate) fn span_s(motion: &Motion, run: &Run) -> Result<[f64; 2], ScenarioError> {
    let duration_s = match run.duration_s {
        Some(duration_s) => duration_s,
        None if matches!(motion, Motion::Recorded(_)) => 0.0,
        None => {
            return Err(ScenarioError::Missing {
                name: "run.duration_s",
            });
        }
    };
    Ok([-run.margin_s, duration_s + run.margin_s])
}

/// Time of the first frame, s, and how many there are; the attitude is known over `known_s`.
pub(crate) fn times(motion: &Motion, run: &Run, known_s: [f64; 2], rate_hz: f64) -> (f64, u64) {
    let [first_s, last_s] = known_s;
    let (start_s, end_s) = match (motion, run.duration_s) {
        (Motion::Recorded(_), Some(duration_s)) => (first_s, last_s.min(first_s + duration_s)),
        // its last sample is a frame too
        (Motion::Recorded(_), None) => (first_s, last_s + 0.5 / rate_hz),
        (_, duration_s) => (0.0, duration_s.unwrap_or(0.0)),
    };
    let mut frames = 0;
    // half a millionth of a step: a duration that is a whole number of steps must not gain a frame
    while frames == 0 || frames as f64 / rate_hz < end_s - start_s - 5e-7 / rate_hz {
        frames += 1;
    }
    (start_s, frames)
}

/// The unknown constant misalignment of this draw.
fn bias(model: &Model, seed: u64, draw: u64) -> Option<Arc<dyn Disturbance>> {
    let mut rng = stream(seed, draw, Purpose::Bias);
    let theta_rad = Vector3::from(model.noise.bias_arcsec?.map(|sigma| {
        let normal: f64 = StandardNormal.sample(&mut rng);
        Angle::from_arcsec(sigma * normal).rad()
    }));
    Some(Arc::new(ConstantMisalignment { theta_rad }))
}

/// The unknown constant misalignment of one draw: part of the declared model, so no effect.
#[derive(Debug)]
struct ConstantMisalignment {
    theta_rad: Vector3<f64>,
}

impl Disturbance for ConstantMisalignment {
    fn stages(&self) -> Stages {
        Stages {
            attitude: true,
            ..Stages::NONE
        }
    }

    fn misalignment_rad(&self, _t_s: f64) -> Vector3<f64> {
        self.theta_rad
    }
}

fn build_effects(
    model: &Model,
    surroundings: &Surroundings<'_>,
) -> Result<Vec<Arc<dyn Effect>>, ScenarioError> {
    let entries = model.effects.iter().enumerate();
    entries
        .map(|(index, entry)| {
            effects::build(&entry.id, &effect_parameters(entry), surroundings)
                .map(Arc::from)
                .map_err(|error| effect_error(model, index, error))
        })
        .collect()
}

fn measure(
    pbm: &Pbm,
    hem: Option<&Hem>,
    truth: &AttitudeSeries,
    seen: &Seen,
    seed: u64,
    draw: u64,
) -> Measured {
    let [x, y, z] = &seen.direction;
    let rows = Rows {
        t_s: &seen.frames.t_s,
        first_row: &seen.frames.first_row,
        slot: &seen.frames.slot,
        star_id: &seen.frames.star_id,
        mag: &seen.mag,
        bv: &seen.bv,
        direction: Vectors { x, y, z },
    };
    let (mut out, mut scratch) = (Measured::default(), Scratch::default());
    let mut streams = NoiseStreams::new(seed, draw);
    match hem {
        Some(hem) => {
            let mut state = HemState::new(seed, draw);
            hem.measure_into(
                truth,
                rows,
                &mut state,
                &mut streams,
                &mut scratch,
                &mut out,
            );
        }
        None => pbm.measure_into(truth, rows, &mut streams, &mut scratch, &mut out),
    }
    out
}

fn attitude_table(t_s: &[f64], measured: &Measured) -> AttitudeTable {
    let solved = t_s
        .iter()
        .enumerate()
        .filter_map(|(k, &t)| Some((t, measured.attitude(k)?)));
    let (t_s, q) = solved.unzip();
    AttitudeTable { t_s, q }
}

/// Measured stars: rows that were left out are not there, and a frame without stars is a gap.
fn star_frames(asked: &StarFrames, measured: &Measured, step_px: f64) -> StarFrames {
    // a quotient of whole numbers is the double nearest to the decimal: it stays short in a file
    let per_px = (1.0 / step_px).round();
    let round = move |px: f64| match step_px > 0.0 {
        true if step_px < 1.0 && (per_px * step_px - 1.0).abs() < 1e-12 => {
            (px * per_px).round() / per_px
        }
        true => (px / step_px).round() * step_px,
        false => px,
    };
    let mut out = StarFrames::with_capacity(asked.frames(), asked.rows());
    for k in 0..asked.frames() {
        let kept = |row: &usize| !measured.x_px[*row].is_nan();
        if !asked.rows_of(k).any(|row| kept(&row)) {
            continue;
        }
        out.begin(asked.t_s[k]);
        for row in asked.rows_of(k).filter(kept) {
            let (x, y) = (round(measured.x_px[row]), round(measured.y_px[row]));
            out.push(asked.slot[row], asked.star_id[row], x, y);
        }
    }
    out
}

/// Multiples of a step from the first frame, one sample beyond the frames on either side.
fn sample_times(frames_s: &[f64], rate_hz: f64) -> Vec<f64> {
    let (first_s, last_s) = (frames_s[0], frames_s[frames_s.len() - 1]);
    let mut t_s = vec![first_s - 1.0 / rate_hz];
    let mut k = 0.0;
    while t_s[t_s.len() - 1] <= last_s {
        t_s.push(first_s + k / rate_hz);
        k += 1.0;
    }
    t_s
}

fn reference(
    scenario: &Scenario,
    truth: &AttitudeSeries,
    frames_s: &[f64],
    rate_hz: f64,
    effects: &[Arc<dyn Effect>],
    draw: u64,
) -> Result<Option<telemetry::ReferenceTable>, ScenarioError> {
    let Some(reference) = &scenario.reference else {
        return Ok(None);
    };
    let rate_hz = reference.rate_hz.unwrap_or(rate_hz);
    ScenarioError::check_positive("reference.rate_hz", rate_hz)?;
    let others: Vec<Wander> = effects
        .iter()
        .filter_map(|effect| effect.reference_wander())
        .map(|wander| Wander {
            sigma_arcsec: wander.sigma_arcsec,
            tau_s: wander.tau_s,
        })
        .collect();
    let mut rng = stream(scenario.run.seed, draw, Purpose::Reference);
    reference
        .table(truth, &sample_times(frames_s, rate_hz), &others, &mut rng)
        .map(Some)
}

fn rates(
    scenario: &Scenario,
    truth: &AttitudeSeries,
    frames_s: &[f64],
    rate_hz: f64,
    draw: u64,
) -> Result<Option<telemetry::RateTable>, ScenarioError> {
    let Some(gyro) = &scenario.rates else {
        return Ok(None);
    };
    let rate_hz = gyro.rate_hz.unwrap_or(rate_hz);
    ScenarioError::check_positive("rates.rate_hz", rate_hz)?;
    let mut rng = stream(scenario.run.seed, draw, Purpose::Gyro);
    gyro.table(truth, &sample_times(frames_s, rate_hz), &mut rng)
        .map(Some)
}

fn metadata(scenario: &Scenario, rate_hz: f64, draw: u64, vectors: bool) -> Metadata {
    let (run, tracker) = (&scenario.run, &scenario.model.tracker);
    let frames = Frames {
        vectors_in: Some(telemetry::VectorFrame::Inertial),
        quaternion_signs: QuaternionSigns::Known([1.0; 3]),
        ..Frames::default()
    };
    Metadata {
        title: run.title.clone().or_else(|| scenario.model.title.clone()),
        source: Some(telemetry::made_here("simulated", run.seed, draw)),
        epoch: run.epoch,
        time_scale: run.time_scale,
        sample_rate_hz: Some(rate_hz),
        tracker: TrackerMeta {
            pixels: tracker.pixels,
            focal_length_px: if tracker.fov_deg.is_some() {
                None
            } else {
                tracker.focal_length_px
            },
            fov_deg: tracker.fov_deg,
            exposure_s: tracker.exposure_s,
            pixel_centre: tracker.pixel_centre,
        },
        frames: vectors.then_some(frames),
        ..Metadata::default()
    }
}
