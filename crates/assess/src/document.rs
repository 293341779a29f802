//! What is written down: the contract's keys, and what else was found.
//!
//! Not physics: names and units.

use serde::Serialize;
use telemetry::AttitudeResiduals;
use telemetry::report::{
    AssessReport, ConsideredEffect, Errors, Estimate, FoundEffect, REPORT_FORMAT, Report, Rows,
    Unattributed, Verdict,
};

use crate::closing::{FOLDS, Term, fold_of, rms};
use crate::model::{Fit, Free};
use crate::start::euler_123;
use crate::{Assessment, Counts, Ecss, RequirementCheck, RotatorFindings};

/// `assess --json`: the keys of the contract first.
#[derive(Clone, Debug, Serialize)]
pub struct Document {
    /// The contract.
    #[serde(flatten)]
    pub report: AssessReport,
    /// Frames used and left out.
    pub frames: Counts,
    /// Plateau of each axis, s; `null` without one.
    pub plateau_axes_s: [Option<[f64; 2]>; 3],
    /// Uncertainty of the Allan figures, arcsec.
    pub allan_sigma_arcsec: [Option<f64>; 3],
    /// White noise from the floor of the spectrum, arcsec.
    pub spectral_floor_arcsec: [Option<f64>; 3],
    /// Its uncertainty, arcsec.
    pub spectral_floor_sigma_arcsec: [Option<f64>; 3],
    /// \[A01\] Eq. 6 over flat intervals, arcsec.
    pub flat_arcsec: [Option<f64>; 3],
    /// ECSS indices.
    pub ecss: Ecss,
    /// The requirement.
    pub requirement: Option<RequirementCheck>,
    /// The rigid body.
    pub rotator: Option<RotatorDocument>,
    /// The gyro.
    pub gyro: Option<GyroDocument>,
    /// What a reader should know.
    pub notes: Vec<String>,
}

/// The rigid body in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct RotatorDocument {
    /// Spin, revolutions a minute.
    pub spin_rpm: f64,
    /// Spin axis in the tracker.
    pub spin_axis: [f64; 3],
    /// Angle between angular momentum and body z, deg.
    pub nutation_deg: f64,
    /// `I3 / IT`.
    pub axial_ratio: f64,
    /// Mean residual about body axes before the misalignment, deg.
    pub mean_before_deg: [f64; 3],
    /// Standard deviation about body axes of what the axisymmetric body leaves, arcsec.
    pub body_arcsec: [f64; 3],
    /// Parameters of the last model by name.
    pub parameters: Vec<NamedEstimate>,
    /// The loop, in the form of `close`.
    pub closing: Report,
}

/// A parameter by name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NamedEstimate {
    /// Its name.
    pub name: String,
    /// Its value.
    #[serde(flatten)]
    pub estimate: Estimate,
}

/// The gyro in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct GyroDocument {
    /// Bias, arcsec/s.
    pub bias_arcsec_s: [f64; 3],
    /// Its 1 sigma.
    pub bias_sigma_arcsec_s: [f64; 3],
    /// Attitude at the first frame: x, y, z, w.
    pub epoch: [f64; 4],
    /// Its 1 sigma about the tracker's axes, arcsec.
    pub epoch_sigma_arcsec: [f64; 3],
    /// Random walk of the weights, arcsec per root second.
    pub walk_arcsec_rt_s: f64,
    /// Stretches without a gap.
    pub stretches: usize,
}

impl Assessment {
    /// Everything that is written down.
    #[must_use]
    pub fn document(&self) -> Document {
        let axes = &self.axes;
        Document {
            report: self.report.clone(),
            frames: self.counts,
            plateau_axes_s: axes.each_ref().map(|a| a.plateau.map(|p| p.span_s)),
            allan_sigma_arcsec: axes.each_ref().map(|a| a.allan.map(|r| r.error)),
            spectral_floor_arcsec: axes.each_ref().map(|a| a.floor.map(|r| r.sigma)),
            spectral_floor_sigma_arcsec: axes.each_ref().map(|a| a.floor.map(|r| r.error)),
            flat_arcsec: axes.each_ref().map(|a| a.flat_sigma),
            ecss: self.ecss.clone(),
            requirement: self.requirement,
            rotator: self.rotator.as_ref().map(|found| RotatorDocument {
                spin_rpm: found.spin_rpm,
                spin_axis: found.spin_axis.into(),
                nutation_deg: found.closing.last.model.body.nutation_rad().to_degrees(),
                axial_ratio: found.closing.last.model.body.inertia.axial_ratio,
                mean_before_deg: found.mean_before_deg,
                body_arcsec: found.body_arcsec,
                parameters: found.parameters(),
                closing: self.closing_report(found),
            }),
            gyro: self.gyro.as_ref().map(|gyro| GyroDocument {
                bias_arcsec_s: gyro.bias_arcsec_s,
                bias_sigma_arcsec_s: gyro.bias_sigma_arcsec_s,
                epoch: gyro.epoch.coords.into(),
                epoch_sigma_arcsec: gyro.epoch_sigma_arcsec,
                walk_arcsec_rt_s: gyro.walk_arcsec_rt_s,
                stretches: gyro.stretches,
            }),
            notes: self.notes.clone(),
        }
    }

    /// Residuals before and after the loop, out of fold; `None` without a rigid body.
    #[must_use]
    pub fn residuals(&self) -> Option<AttitudeResiduals> {
        let rotator = self.rotator.as_ref()?;
        let (closing, t_s) = (&rotator.closing, &rotator.t_s);
        let (first, last) = (t_s[0], t_s[t_s.len() - 1]);
        #[expect(clippy::cast_possible_truncation, reason = "five folds")]
        let fold = |t: &f64| fold_of([first, last], *t) as u32;
        Some(AttitudeResiduals {
            t_s: t_s.clone(),
            before_arcsec: closing.before_arcsec.clone(),
            after_arcsec: closing.after_arcsec.clone(),
            fold: t_s.iter().map(fold).collect(),
            outlier: vec![false; t_s.len()],
        })
    }

    fn closing_report(&self, found: &RotatorFindings) -> Report {
        let closing = &found.closing;
        let errors = |x: &[Vec<f64>; 3]| Errors {
            attitude_rms_arcsec: Some(rms(x)),
            ..Errors::default()
        };
        let whole: f64 = rms(&closing.before_arcsec).iter().map(|x| x * x).sum();
        let effects = closing.added.iter().map(|added| {
            let share = |x: [f64; 3]| x.iter().map(|x| x * x).sum::<f64>() / whole;
            FoundEffect {
                id: added.term.id().into(),
                selectors: [].into(),
                parameters: found
                    .parameters_of(added.term, added.index)
                    .into_iter()
                    .map(|p| (p.name, p.estimate))
                    .collect(),
                delta_loglik: added.delta_loglik,
                p_value: added.p_value,
                variance_explained: Some(share(added.before_arcsec) - share(added.after_arcsec)),
                confusable_with: vec![],
            }
        });
        let left = closing
            .last
            .residual_arcsec
            .each_ref()
            .map(|x| crate::closing::lag_one(x));
        let coloured = left.iter().any(|c| *c > LEFT);
        let verdict = match (closing.added.is_empty(), coloured) {
            (true, false) => Verdict::Consistent,
            (false, false) => Verdict::Explained,
            (false, true) => Verdict::PartlyExplained,
            (true, true) => Verdict::Unexplained,
        };
        let rest: f64 = rms(&closing.after_arcsec).iter().map(|x| x * x).sum();
        Report {
            format: REPORT_FORMAT.into(),
            verdict,
            folds: FOLDS,
            rows: Rows {
                used: self.counts.used,
                outliers: self.counts.outliers,
                outside_reference: self.counts.outside,
            },
            windows: None,
            before: errors(&closing.before_arcsec),
            after: errors(&closing.after_arcsec),
            effects: effects.collect(),
            considered: closing
                .considered
                .iter()
                .map(|c| ConsideredEffect {
                    selectors: std::collections::BTreeMap::new(),
                    against: None,
                    id: c.term.id().into(),
                    delta_loglik: c.delta_loglik,
                    p_value: c.p_value,
                    observable: c.delta_loglik.is_some(),
                    detectable: None,
                    needed: None,
                    parameter: None,
                    unit: None,
                    refused: None,
                })
                .collect(),
            hypotheses: Vec::new(),
            unattributed: Unattributed {
                present: coloured,
                variance_fraction: coloured.then(|| rest / whole),
                ..Unattributed::default()
            },
        }
    }
}

/// Correlation of neighbours above which a residual is not what a white noise leaves.
const LEFT: f64 = 0.2;

fn estimate(value: f64, sigma: f64, unit: &str) -> Estimate {
    Estimate {
        value,
        sigma: Some(sigma),
        unit: unit.into(),
        interval: None,
    }
}

impl RotatorFindings {
    /// Parameters of the last model: inertial spin axis, rate, misalignment, and all terms.
    #[must_use]
    pub fn parameters(&self) -> Vec<NamedEstimate> {
        let fit = &self.closing.last;
        let mut out: Vec<NamedEstimate> = ["spin_axis_ra_deg", "spin_axis_dec_deg"]
            .into_iter()
            .zip(fit.spin_axis_deg())
            .map(|(name, [value, sigma])| NamedEstimate {
                name: name.into(),
                estimate: estimate(value, sigma, "deg"),
            })
            .collect();
        out.extend((0..3).filter_map(|axis| {
            let [value, sigma] = fit.estimate(Free::Rate(axis))?;
            Some(NamedEstimate {
                name: format!("rate_{}_deg_s", ["x", "y", "z"][axis]),
                estimate: estimate(value.to_degrees(), sigma.to_degrees(), "deg/s"),
            })
        }));
        out.extend(self.parameters_of(Term::Misalignment, 0));
        for added in self
            .closing
            .added
            .iter()
            .filter(|a| a.term != Term::Misalignment)
        {
            out.extend(self.parameters_of(added.term, added.index));
        }
        out
    }

    /// Parameters of one term in the last model.
    #[must_use]
    pub fn parameters_of(&self, term: Term, index: usize) -> Vec<NamedEstimate> {
        let fit = &self.closing.last;
        let plain = |name: &str, free: Free, scale: f64, unit: &str| {
            let [value, sigma] = fit.estimate(free)?;
            Some(NamedEstimate {
                name: name.into(),
                estimate: estimate(value * scale, sigma * scale, unit),
            })
        };
        let arcsec = focal_plane::ARCSEC_PER_RAD;
        let found = match term {
            Term::Misalignment => return self.misalignment(fit),
            Term::InertiaRatio => vec![plain("axial_ratio", Free::AxialRatio, 1.0, "")],
            Term::Triaxiality => vec![
                plain("a", Free::Triaxiality(0), 1.0, ""),
                plain("b", Free::Triaxiality(1), 1.0, ""),
            ],
            Term::SpinRateChange => {
                vec![plain(
                    "along_arcsec_s2",
                    Free::SpinTorque,
                    arcsec,
                    "arcsec/s^2",
                )]
            }
            Term::SlowTorque => vec![
                plain(
                    "across_1_arcsec_s2",
                    Free::CrossTorque(0),
                    arcsec,
                    "arcsec/s^2",
                ),
                plain(
                    "across_2_arcsec_s2",
                    Free::CrossTorque(1),
                    arcsec,
                    "arcsec/s^2",
                ),
            ],
            Term::TimeTagStep => vec![plain("offset_s", Free::StepOffset(index), 1.0, "s")],
            Term::Oscillation => {
                let mut out = vec![plain("frequency_hz", Free::Frequency(index), 1.0, "Hz")];
                for (axis, name) in ["x", "y", "z"].iter().enumerate() {
                    let cos = format!("body_{name}_cos_arcsec");
                    let sin = format!("body_{name}_sin_arcsec");
                    out.push(plain(&cos, Free::Cos(index, axis), arcsec, "arcsec"));
                    out.push(plain(&sin, Free::Sin(index, axis), arcsec, "arcsec"));
                }
                out
            }
        };
        found.into_iter().flatten().collect()
    }

    /// phi and theta of \[A01\] Eq. 2, with the covariance of the two turns of the alignment carried over.
    fn misalignment(&self, fit: &Fit) -> Vec<NamedEstimate> {
        let at = |free| fit.free.iter().position(|f| *f == free);
        let nominal = &self.start.nominal;
        let (Some(x), Some(y), Some([phi, theta])) = (
            at(Free::Misalignment(0)),
            at(Free::Misalignment(1)),
            euler_123(&fit.model.to_body, nominal),
        ) else {
            return vec![];
        };
        // derivatives of the two angles with the two turns, numerically
        let h = 1e-6;
        let turned = |axis: usize| {
            let turn = nalgebra::Vector3::from_fn(|i, _| if i == axis { h } else { 0.0 });
            let to_body = focal_plane::rotation_from_vector(&turn) * fit.model.to_body;
            euler_123(&to_body, nominal).map(|[p, t]| [(p - phi) / h, (t - theta) / h])
        };
        let (Some(dx), Some(dy)) = (turned(0), turned(1)) else {
            return vec![];
        };
        let c = &fit.covariance;
        let sigma = |k: usize| {
            let (a, b) = (dx[k], dy[k]);
            (a * a * c[(x, x)] + 2.0 * a * b * c[(x, y)] + b * b * c[(y, y)]).sqrt()
        };
        let named = |name: &str, value: f64, k: usize| NamedEstimate {
            name: name.into(),
            estimate: estimate(value.to_degrees(), sigma(k).to_degrees(), "deg"),
        };
        vec![named("phi_deg", phi, 0), named("theta_deg", theta, 1)]
    }
}
