//! One test of the paper, flown in simulation: truth, stars and reference, and any model over them.
//!
//! ```text
//! residual = log(q_measured q_reference^-1)      tracker axes, arcsec; or against the truth
//! ```
//!
//! Source: \[M23\] Section 4.1 (residual: tracker minus filter), Sections 2.6 and 3.2 (the models).

use centroid::{CentroidError, Triangle};
use distortion::{DistortionField, LsfSigma};
use focal_plane::{ARCSEC_PER_RAD, Angle, AttitudeSeries, AttitudeSource, Camera, Vectors};
use fogm_fit::{Fogm, FogmWhite};
use nalgebra::UnitQuaternion;
use scenarios::{Motion, Scenario, Simulated, preset, simulate_with_truth};
use star_tracker::{
    Hem, HemState, Measured, NoiseStreams, Pbm, Purpose, Rows, Scratch, TemporalNoise, stream,
};

use crate::{Inputs, PaperError};

/// Errors about x, y, z, arcsec, frame by frame.
pub(crate) type Axes = [Vec<f64>; 3];

/// A scenario of the name, with the noise of `inputs` and its duration.
pub(crate) fn scenario(name: &str, inputs: &Inputs) -> Result<Scenario, PaperError> {
    let mut scenario = preset(name)?.scenario()?;
    let noise = &mut scenario.model.noise;
    noise.temporal_arcsec = Some(inputs.sigma_tn_arcsec);
    noise.centroid_arcsec = Some(inputs.sigma_hsf_arcsec);
    noise.distortion_arcsec = Some(inputs.sigma_lsf_arcsec);
    // the paper's residuals are without static misalignment
    noise.bias_arcsec = None;
    if let Some(duration_s) = &mut scenario.run.duration_s {
        *duration_s = (*duration_s * inputs.duration).round();
    }
    Ok(scenario)
}

/// The same looking elsewhere: `field` 0 is the preset's own, others are spread over the sky by the
/// golden angle.
pub(crate) fn towards(mut scenario: Scenario, field: u64) -> Scenario {
    if field == 0 {
        return scenario;
    }
    let start = match &mut scenario.motion {
        Motion::Hold(hold) => &mut hold.start,
        Motion::Slews(slews) => &mut slews.start,
        Motion::PhasePlane(cycle) => &mut cycle.start,
        _ => return scenario,
    };
    let k = field as f64;
    start.ra_deg = (137.507_764 * k).rem_euclid(360.0);
    start.dec_deg = (1.0 - 2.0 * (k * 0.618_034).fract()).asin().to_degrees();
    start.roll_deg = (73.0 * k).rem_euclid(360.0);
    scenario
}

/// A flight, and what any model needs to fly it again.
#[derive(Debug)]
pub(crate) struct Trial {
    name: String,
    seed: u64,
    made: Simulated,
    reference: Vec<UnitQuaternion<f64>>,
    truth: Vec<UnitQuaternion<f64>>,
    pub(crate) rate_hz: f64,
}

impl Trial {
    pub(crate) fn fly(name: &str, scenario: &Scenario, draw: u64) -> Result<Self, PaperError> {
        let made = simulate_with_truth(scenario, draw)?;
        let missing = |frame| PaperError::NoAttitude {
            name: name.to_owned(),
            frame,
        };
        let t_s = &made.rows.t_s;
        let at = |(frame, &t): (usize, &f64)| made.truth.attitude(t).ok_or_else(|| missing(frame));
        let truth = t_s
            .iter()
            .enumerate()
            .map(at)
            .collect::<Result<Vec<_>, _>>()?;
        // its grid goes through the first frame, and beyond both ends
        let table = made.bundle.reference.as_ref().ok_or_else(|| missing(0))?;
        let same = |t: &f64| table.t_s.partition_point(|r| *r < t - 1e-6);
        let sample = |(frame, t)| table.q.get(same(t)).copied().ok_or_else(|| missing(frame));
        let reference = t_s
            .iter()
            .enumerate()
            .map(sample)
            .collect::<Result<_, _>>()?;
        Ok(Self {
            name: name.to_owned(),
            seed: scenario.run.seed,
            reference,
            truth,
            rate_hz: scenario.run.rate_hz.unwrap_or(10.0),
            made,
        })
    }

    pub(crate) fn camera(&self) -> &Camera {
        self.made.pbm.camera()
    }

    pub(crate) fn path(&self) -> &AttitudeSeries {
        &self.made.truth
    }

    pub(crate) fn frames(&self) -> usize {
        self.truth.len()
    }

    /// Stars of the first frame.
    pub(crate) fn stars(&self) -> usize {
        self.made.rows.first_row[1]
    }

    fn rows(&self) -> Rows<'_> {
        let [x, y, z] = &self.made.direction;
        Rows {
            t_s: &self.made.rows.t_s,
            first_row: &self.made.rows.first_row,
            slot: &[],
            star_id: &[],
            mag: &[],
            bv: &[],
            direction: Vectors { x, y, z },
        }
    }

    /// What the reference says of its own error about x, y, z, 1 sigma, arcsec.
    pub(crate) fn reference_sigma(&self) -> Result<[f64; 3], PaperError> {
        let table = self.made.bundle.reference.as_ref();
        let sigmas = table.and_then(|table| table.sigma_arcsec.as_ref()?.first().copied());
        sigmas.ok_or_else(|| PaperError::Preset {
            name: self.name.clone(),
            what: "no sigma of the reference",
        })
    }

    /// Where the star goes that is in the middle of the field at the first frame, x and y, px, frame by
    /// frame.
    pub(crate) fn middle_px(&self) -> Result<[Vec<f64>; 2], PaperError> {
        let star = self.truth[0].inverse() * nalgebra::Vector3::z();
        let mut path = [const { Vec::new() }; 2];
        for (frame, q) in self.truth.iter().enumerate() {
            let at = self
                .camera()
                .project(&(q * star))
                .ok_or_else(|| PaperError::NoAttitude {
                    name: self.name.clone(),
                    frame,
                })?;
            path[0].push(at.x);
            path[1].push(at.y);
        }
        Ok(path)
    }

    /// The straight line through that path, from end to end, px.
    pub(crate) fn migration_px(&self) -> Result<[f64; 2], PaperError> {
        let n = self.frames() as f64;
        let middle = 0.5 * (n - 1.0);
        let square = n * (n * n - 1.0) / 12.0;
        Ok(self.middle_px()?.map(|path| {
            let each = path.iter().enumerate();
            let product: f64 = each.map(|(k, x)| (k as f64 - middle) * x).sum();
            product / square * n
        }))
    }

    /// How fast stars cross the field by the turning of the tracker, px/s at the mean scale, frame by
    /// frame.
    pub(crate) fn rate_px_s(&self) -> Vec<f64> {
        let camera = self.camera();
        let scale = f64::from(camera.pixels()[0]) / camera.fov()[0].rad();
        let rates = self.made.rows.t_s.iter();
        rates
            .filter_map(|&t| self.made.truth.rate_rad_s(t))
            .map(|rate| rate.x.hypot(rate.y) * scale)
            .collect()
    }

    /// What the flight measured, against its reference.
    pub(crate) fn residual(&self) -> Result<Axes, PaperError> {
        self.against(&self.reference, &self.made.measured)
    }

    /// What the flight measured, against the truth.
    pub(crate) fn error(&self) -> Result<Axes, PaperError> {
        self.against(&self.truth, &self.made.measured)
    }

    /// Error of the reference itself.
    pub(crate) fn reference_error(&self) -> Axes {
        let mut axes = [const { Vec::new() }; 3];
        for (reference, truth) in self.reference.iter().zip(&self.truth) {
            push(&mut axes, reference, truth);
        }
        axes
    }

    fn against(
        &self,
        reference: &[UnitQuaternion<f64>],
        measured: &Measured,
    ) -> Result<Axes, PaperError> {
        let mut axes = [const { Vec::new() }; 3].map(|mut axis: Vec<f64>| {
            axis.reserve(reference.len());
            axis
        });
        for (frame, reference) in reference.iter().enumerate() {
            let q = measured
                .attitude(frame)
                .ok_or_else(|| PaperError::NoAttitude {
                    name: self.name.clone(),
                    frame,
                })?;
            push(&mut axes, &q, reference);
        }
        Ok(axes)
    }

    /// Error of a physics-based model over the same truth and stars.
    pub(crate) fn pbm(&self, pbm: &Pbm, draw: u64) -> Result<Axes, PaperError> {
        let mut out = Measured::default();
        let mut streams = NoiseStreams::new(self.seed + 1000, draw);
        let mut scratch = Scratch::default();
        pbm.measure_into(
            &self.made.truth,
            self.rows(),
            &mut streams,
            &mut scratch,
            &mut out,
        );
        self.against(&self.truth, &out)
    }

    /// Error of a hybrid model over the same truth and stars.
    pub(crate) fn hem(&self, hem: &Hem, draw: u64) -> Result<Axes, PaperError> {
        let mut out = Measured::default();
        let mut streams = NoiseStreams::new(self.seed + 1000, draw);
        let mut state = HemState::new(self.seed + 1000, draw);
        let mut scratch = Scratch::default();
        hem.measure_into(
            &self.made.truth,
            self.rows(),
            &mut state,
            &mut streams,
            &mut scratch,
            &mut out,
        );
        self.against(&self.truth, &out)
    }
}

fn push(axes: &mut Axes, q: &UnitQuaternion<f64>, reference: &UnitQuaternion<f64>) {
    let theta = focal_plane::rotation_vector(q, reference) * ARCSEC_PER_RAD;
    for (axis, value) in axes.iter_mut().zip(theta.iter()) {
        axis.push(*value);
    }
}

/// A distortion field of the paper's statistics.
pub(crate) fn field(inputs: &Inputs, draw: u64) -> Result<DistortionField, PaperError> {
    let sigma = LsfSigma::Circular(Angle::from_arcsec(inputs.sigma_lsf_arcsec));
    let mut rng = stream(77, draw, Purpose::Distortion);
    Ok(DistortionField::draw(7, sigma, &mut rng)?)
}

/// The physics-based model of the paper's numbers, with one field.
pub(crate) fn pbm(camera: &Camera, inputs: &Inputs, draw: u64) -> Result<Pbm, PaperError> {
    let triangle = Triangle::from_peak(inputs.sigma_hsf_arcsec);
    Ok(Pbm::new(camera.clone())
        .with_distortion(field(inputs, draw)?)
        .with_centroid_error(CentroidError::Triangle(triangle))
        .with_noise(TemporalNoise::circular_arcsec(inputs.sigma_tn_arcsec)?))
}

/// A hybrid model of three fits `[sigma_HSF, tau, sigma_TN]`, true standard deviations, without field.
pub(crate) fn hem(camera: &Camera, fits: [[f64; 3]; 3]) -> Result<Hem, PaperError> {
    let process = |[sigma, tau_s, white]: [f64; 3]| -> Result<FogmWhite, PaperError> {
        Ok(FogmWhite::new(Fogm::new(sigma, tau_s)?, white)?)
    };
    let [x, y, z] = fits;
    Ok(Hem::new(
        camera.clone(),
        [process(x)?, process(y)?, process(z)?],
    ))
}
