//! An assessment from a bundle: which way, what is left, and what of it is noise.
//!
//! ```text
//! total      standard deviation of the tracker against what stands in for the truth     [A01] Table 1
//! inherent   white noise of one frame, from the plateau                                 [A01] Table 2
//! ```
//!
//! With a gyro the gyro stands in for the truth, with a reference the reference, otherwise a rigid body.
//! Axes are the tracker's.
//!
//! Source: [A01], Tables 1 and 2.

use focal_plane::AttitudeSource;
use nalgebra::Vector3;
use telemetry::Bundle;
use telemetry::report::{ASSESS_FORMAT, AssessMethod, AssessReport};

use crate::closing::{self, Closing};
use crate::ecss::{Ecss, ecss};
use crate::gyro::{GyroSolution, gyro_solution};
use crate::noise::{AxisNoise, axis_noise};
use crate::start::{Start, start};
use crate::{AssessError, Counts, Inertia, Observed, alignment};

/// Revolutions a minute up to which the tracker of \[A01\] has its full accuracy, and beyond which it is
/// expected to lose its stars.
pub const SPIN_LIMITS_RPM: [f64; 2] = [0.6, 1.0];

/// What an analyst may know beside the quaternions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// What stands in for the truth; by default the best that the bundle has.
    pub method: Option<AssessMethod>,
    /// Principal moments of inertia about body x, y, z, any unit; by default ratios are estimated.
    pub inertia: Option<[f64; 3]>,
    /// Rows of the matrix from tracker to body; by default the spin axis is body z.
    pub alignment: Option<[[f64; 3]; 3]>,
    /// Attitude accuracy that is required of each axis, arcsec.
    pub requirement_arcsec: Option<f64>,
    /// Gyro angle random walk, arcsec per root second; by default estimated.
    pub gyro_walk_arcsec_rt_s: Option<f64>,
    /// Window of the ECSS indices, s; default a hundredth of the record, and ten steps at least.
    pub window_s: Option<f64>,
}

impl Options {
    /// What is given must act: a number that the method passes over would seem to be in the result.
    fn check_used(&self, method: AssessMethod) -> Result<(), AssessError> {
        let rotator = AssessMethod::RigidRotator;
        for (given, there, needs) in [
            ("inertia", self.inertia.is_some(), rotator),
            ("alignment", self.alignment.is_some(), rotator),
            (
                "gyro_walk",
                self.gyro_walk_arcsec_rt_s.is_some(),
                AssessMethod::Gyro,
            ),
        ] {
            if there && needs != method {
                let [needs, method] = [needs, method].map(name);
                return Err(AssessError::NotUsed {
                    given,
                    needs,
                    method,
                });
            }
        }
        Ok(())
    }
}

fn name(method: AssessMethod) -> &'static str {
    match method {
        AssessMethod::RigidRotator => "rigid_rotator",
        AssessMethod::Gyro => "gyro",
        AssessMethod::Reference => "reference",
    }
}

/// A requirement against what was found.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RequirementCheck {
    /// Required of each axis, arcsec.
    pub required_arcsec: f64,
    /// Total, 1 sigma, over the requirement.
    pub share: [f64; 3],
    /// Whether 1 sigma is inside, as \[A01\] Table 1 compares them.
    pub met_at_one_sigma: bool,
    /// Whether 3 sigma is.
    pub met_at_three_sigma: bool,
}

impl RequirementCheck {
    /// Compares totals with a requirement, both arcsec.
    ///
    /// ```
    /// let image = assess::RequirementCheck::new(360.0, [61.0, 67.0, 88.0]);
    /// assert!(image.met_at_one_sigma && image.met_at_three_sigma);
    /// ```
    #[must_use]
    pub fn new(required_arcsec: f64, total_arcsec: [f64; 3]) -> Self {
        let share = total_arcsec.map(|total| total / required_arcsec);
        let within = |k: f64| share.iter().all(|s| k * s <= 1.0);
        Self {
            required_arcsec,
            share,
            met_at_one_sigma: within(1.0),
            met_at_three_sigma: within(3.0),
        }
    }
}

/// The rigid body route.
#[derive(Clone, Debug)]
pub struct RotatorFindings {
    /// Times of the frames that the body was fitted to, s: all, or every so many of a long record.
    pub t_s: Vec<f64>,
    /// Where it began.
    pub start: Start,
    /// The loop.
    pub closing: Closing,
    /// Spin, revolutions a minute.
    pub spin_rpm: f64,
    /// Spin axis in the tracker, unit.
    pub spin_axis: Vector3<f64>,
    /// Mean of the first model's residual about body axes, deg: what a misalignment leaves.
    pub mean_before_deg: [f64; 3],
    /// Residual of the aligned axisymmetric body about body axes, standard deviation, arcsec.
    pub body_arcsec: [f64; 3],
}

/// Everything that was found.
#[derive(Clone, Debug)]
pub struct Assessment {
    /// The machine-readable part of the contract.
    pub report: AssessReport,
    /// What was found in the frames.
    pub counts: Counts,
    /// Median step, s.
    pub step_s: f64,
    /// Times of the residual, s.
    pub t_s: Vec<f64>,
    /// Residual about the tracker's axes, arcsec.
    pub residual_arcsec: [Vec<f64>; 3],
    /// Noise of each axis.
    pub axes: [AxisNoise; 3],
    /// ECSS indices.
    pub ecss: Ecss,
    /// The requirement, if one was given.
    pub requirement: Option<RequirementCheck>,
    /// The rigid body route.
    pub rotator: Option<RotatorFindings>,
    /// The gyro route.
    pub gyro: Option<GyroSolution>,
    /// What a reader should know, in words.
    pub notes: Vec<String>,
}

/// Assesses a bundle; `tell` hears what is being done.
///
/// # Errors
/// No attitude, a method whose table is missing, or data that determine nothing.
pub fn assess(
    bundle: &Bundle,
    options: &Options,
    tell: &dyn Fn(&str),
) -> Result<Assessment, AssessError> {
    let attitude = bundle.attitude.as_ref().ok_or(AssessError::NoAttitude)?;
    for (name, value) in [
        ("the requirement", options.requirement_arcsec),
        ("the window", options.window_s),
    ] {
        if let Some(value) = value {
            AssessError::positive(name, value)?;
        }
    }
    let method = options.method.unwrap_or(match bundle {
        Bundle { rates: Some(_), .. } => AssessMethod::Gyro,
        Bundle {
            reference: Some(_), ..
        } => AssessMethod::Reference,
        _ => AssessMethod::RigidRotator,
    });
    options.check_used(method)?;
    tell("cleaning");
    let mut observed = Observed::new(&attitude.t_s, &attitude.q)?;
    let mut out = match method {
        AssessMethod::Gyro => by_gyro(bundle, &mut observed, options)?,
        AssessMethod::Reference => by_reference(bundle, &mut observed)?,
        AssessMethod::RigidRotator => by_rotator(&observed, options, tell)?,
    };
    tell("noise");
    out.finish(&observed, options, method)
}

/// A residual on its way to an assessment.
struct Found {
    t_s: Vec<f64>,
    residual_arcsec: [Vec<f64>; 3],
    /// Where the first holds too fast systematics: the residual of a better model.
    whiter: Option<[Vec<f64>; 3]>,
    rotator: Option<RotatorFindings>,
    gyro: Option<GyroSolution>,
    notes: Vec<String>,
}

/// White noise by second differences, for weights: `x[i+2] - 2 x[i+1] + x[i]` has 6 sigma^2.
fn quick_noise(residual: &[Vec<f64>; 3]) -> [f64; 3] {
    let noise: [f64; 3] = std::array::from_fn(|axis| {
        let d: Vec<f64> = residual[axis]
            .windows(3)
            .map(|w| w[2] - 2.0 * w[1] + w[0])
            .collect();
        crate::observed::robust_sigma(&d) / 6.0_f64.sqrt()
    });
    // an axis without noise must not outweigh the others beyond what a fit can bear
    let most = noise.iter().fold(1e-3, |most: f64, n| most.max(*n));
    noise.map(|n| n.max(1e-2 * most))
}

/// Frames that a rigid body is fitted to at most: evenly taken out of more. Fits and folds cost some
/// hundred evaluations of each, and slow errors need no more.
const MOST_FRAMES: usize = 20_000;

fn by_rotator(
    observed: &Observed,
    options: &Options,
    tell: &dyn Fn(&str),
) -> Result<Found, AssessError> {
    let inertia = options.inertia.map(Inertia::principal).transpose()?;
    let given = options.alignment.map(alignment).transpose()?;
    let every = observed.len().div_ceil(MOST_FRAMES);
    let fitted = observed.every(every);
    tell("rigid body");
    let start = start(&fitted, inertia, given)?;
    let fitter = crate::Fitter::new(&fitted, fitted.middle_s());
    let noise = quick_noise(&fitter.residual_arcsec(&start.model)?);
    let closing = closing::close(&fitted, &start, noise, tell)?;
    let body = closing.axisymmetric.residual_body_arcsec();
    let aligned = &closing.aligned;
    let rate = aligned.model.to_body.inverse() * aligned.model.body.momentum_rad_s();
    let spin_rpm = aligned.model.body.rate_rad_s.norm() * 60.0 / core::f64::consts::TAU;
    let mut notes = Vec::new();
    if every > 1 {
        notes.push(format!(
            "the rigid body is fitted to one frame of every {every}, {} of them; the noise is that of all",
            fitted.len()
        ));
    }
    if spin_rpm > SPIN_LIMITS_RPM[0] {
        let beyond = if spin_rpm > SPIN_LIMITS_RPM[1] {
            "beyond which the tracker of [A01] is expected to lose its stars"
        } else {
            "up to which the tracker of [A01] keeps its accuracy"
        };
        let limit = SPIN_LIMITS_RPM[usize::from(spin_rpm > SPIN_LIMITS_RPM[1])];
        notes.push(format!(
            "the spin of {spin_rpm:.2} rpm is above {limit} rpm, {beyond}"
        ));
    }
    if !start.spinning {
        notes.push(
            "the attitude does not turn once: a constant rate stands in for the truth".into(),
        );
    } else if !start.ratio_seen {
        notes.push("no nutation shows: nothing can be said of the moments of inertia".into());
    }
    let axis = rate.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
    let of_all = crate::Fitter::new(observed, fitter.epoch_s());
    Ok(Found {
        t_s: observed.t_s.clone(),
        residual_arcsec: of_all.residual_arcsec(&aligned.model)?,
        whiter: Some(of_all.residual_arcsec(&closing.last.model)?),
        rotator: Some(RotatorFindings {
            t_s: fitted.t_s.clone(),
            spin_rpm,
            spin_axis: axis,
            mean_before_deg: body.each_ref().map(|x| mean(x) / 3600.0),
            body_arcsec: aligned.residual_body_arcsec().map(|x| deviation(&x)),
            start,
            closing,
        }),
        gyro: None,
        notes,
    })
}

fn by_gyro(
    bundle: &Bundle,
    observed: &mut Observed,
    options: &Options,
) -> Result<Found, AssessError> {
    let rates = bundle.rates.as_ref().ok_or(AssessError::NoTable {
        method: "gyro",
        table: "rates",
    })?;
    let walk = options.gyro_walk_arcsec_rt_s;
    // once for the residual, from which the noise of the weights follows
    let rough = gyro_solution(observed, rates, [1.0; 3], Some(0.0))?;
    let noise = quick_noise(&rough.residual_arcsec);
    let found = gyro_solution(observed, rates, noise, walk)?;
    observed.counts.outside = observed.len() - found.t_s.len();
    observed.counts.used = found.t_s.len();
    let mut notes = Vec::new();
    if found.stretches > 1 {
        notes.push(format!(
            "the gyro has gaps: {} stretches, each with an epoch attitude of its own",
            found.stretches
        ));
    }
    Ok(Found {
        t_s: found.t_s.clone(),
        residual_arcsec: found.residual_arcsec.clone(),
        whiter: None,
        rotator: None,
        gyro: Some(found),
        notes,
    })
}

fn by_reference(bundle: &Bundle, observed: &mut Observed) -> Result<Found, AssessError> {
    let table = bundle.reference.as_ref().ok_or(AssessError::NoTable {
        method: "reference",
        table: "reference",
    })?;
    let series = table.series()?;
    let mut t_s = Vec::new();
    let mut residual: [Vec<f64>; 3] = Default::default();
    for (t, q) in observed.t_s.iter().zip(&observed.q) {
        let Some(reference) = series.attitude(*t) else {
            continue;
        };
        let e = focal_plane::rotation_vector(q, &reference);
        t_s.push(*t);
        for (axis, out) in residual.iter_mut().enumerate() {
            out.push(focal_plane::Angle::from_rad(e[axis]).arcsec());
        }
    }
    observed.counts.outside = observed.len() - t_s.len();
    observed.counts.used = t_s.len();
    const NEED: usize = 20;
    if t_s.len() < NEED {
        return Err(AssessError::TooFew {
            got: t_s.len(),
            need: NEED,
            why: " inside the span of the reference",
        });
    }
    Ok(Found {
        t_s,
        residual_arcsec: residual,
        whiter: None,
        rotator: None,
        gyro: None,
        notes: vec!["the error of the reference is part of total and inherent".into()],
    })
}

impl Found {
    fn finish(
        &mut self,
        observed: &Observed,
        options: &Options,
        method: AssessMethod,
    ) -> Result<Assessment, AssessError> {
        let step_s = observed.step_s;
        let mut axes = Vec::with_capacity(3);
        for axis in 0..3 {
            let mut noise = axis_noise(&self.t_s, &self.residual_arcsec[axis], step_s)?;
            if noise.plateau.is_none()
                && let Some(whiter) = &self.whiter
            {
                let other = axis_noise(&self.t_s, &whiter[axis], step_s)?;
                if other.plateau.is_some() {
                    noise = other;
                    let name = ["X", "Y", "Z"][axis];
                    self.notes.push(format!(
                        "{name}: no plateau in what the axisymmetric body leaves; that of the last model is taken"
                    ));
                }
            }
            axes.push(noise);
        }
        let axes: [AxisNoise; 3] = match axes.try_into() {
            Ok(axes) => axes,
            Err(_) => unreachable!("three axes went in"),
        };
        for (axis, noise) in ["X", "Y", "Z"].iter().zip(&axes) {
            judge(axis, noise, &mut self.notes);
        }
        let total = self.residual_arcsec.each_ref().map(|x| deviation(x));
        let of = |f: &dyn Fn(&AxisNoise) -> Option<f64>| {
            axes.each_ref().map(|a| f(a).unwrap_or(f64::NAN))
        };
        let any = |x: [f64; 3]| x.iter().any(|x| x.is_finite()).then_some(x);
        let plateaus = || axes.iter().filter_map(|a| a.plateau);
        let from = plateaus().map(|p| p.span_s[0]).fold(0.0, f64::max);
        let to = plateaus()
            .map(|p| p.span_s[1])
            .fold(f64::INFINITY, f64::min);
        let report = AssessReport {
            format: ASSESS_FORMAT.into(),
            total_arcsec: Some(total),
            inherent_arcsec: any(of(&|a| a.plateau.map(|p| p.sigma))),
            inherent_sigma_arcsec: any(of(&|a| a.plateau.map(|p| p.error))),
            method,
            plateau_s: (to.is_finite() && from <= to).then_some([from, to]),
            allan_white_arcsec: any(of(&|a| a.allan.map(|r| r.sigma))),
        };
        let whole = self.t_s[self.t_s.len() - 1] - self.t_s[0];
        let window_s = options
            .window_s
            .unwrap_or((0.01 * whole).max(10.0 * step_s));
        let ecss = ecss(
            &self.t_s,
            &self.residual_arcsec,
            step_s,
            window_s,
            10.0 * window_s,
        );
        let requirement = options
            .requirement_arcsec
            .map(|required| RequirementCheck::new(required, total));
        Ok(Assessment {
            report,
            counts: observed.counts,
            step_s,
            t_s: std::mem::take(&mut self.t_s),
            residual_arcsec: std::mem::take(&mut self.residual_arcsec),
            axes,
            ecss,
            requirement,
            rotator: self.rotator.take(),
            gyro: self.gyro.take(),
            notes: std::mem::take(&mut self.notes),
        })
    }
}

/// Says whether the ways to the noise agree.
fn judge(axis: &str, noise: &AxisNoise, notes: &mut Vec<String>) {
    let rivals = [
        ("Allan deviation", noise.allan),
        ("spectral floor", noise.floor),
    ];
    match noise.plateau {
        None => notes.push(format!(
            "{axis}: no plateau, the noise grows with the span from the shortest on; the white noise is not known"
        )),
        Some(plateau) => {
            for (name, rival) in rivals {
                let Some(rival) = rival else { continue };
                let pair = [[plateau.sigma, plateau.error], [rival.sigma, rival.error]];
                if !crate::noise::agree(pair[0], pair[1]) {
                    notes.push(format!(
                        "{axis}: plateau {:.3} +- {:.3} and {name} {:.3} +- {:.3} arcsec disagree",
                        plateau.sigma, plateau.error, rival.sigma, rival.error
                    ));
                }
            }
        }
    }
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// Standard deviation about the mean.
pub(crate) fn deviation(x: &[f64]) -> f64 {
    let mean = mean(x);
    let sum: f64 = x.iter().map(|x| (x - mean).powi(2)).sum();
    (sum / (x.len() as f64 - 1.0).max(1.0)).sqrt()
}
