//! What can be free in a fit, one number each.
//!
//! Not physics: a list with units, scales and derivatives of `model`.

use focal_plane::ARCSEC_PER_RAD;
use nalgebra::{UnitQuaternion, Vector3};

use super::{Fitter, Rotating};

const TAU: f64 = core::f64::consts::TAU;

/// One number of a [`Rotating`] model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Free {
    /// Turn of the attitude at the epoch about a body axis, rad.
    Attitude(usize),
    /// Rate at the epoch about a body axis, rad/s.
    Rate(usize),
    /// Turn of the alignment about body x or y, rad.
    Misalignment(usize),
    /// `I3 / IT`.
    AxialRatio,
    /// `a` or `b` of the triaxiality.
    Triaxiality(usize),
    /// Torque along the angular momentum at the epoch, over IT, rad/s^2.
    SpinTorque,
    /// Torque across it, along the first or the second of two inertial directions, over IT, rad/s^2.
    CrossTorque(usize),
    /// Offset of a time-tag step, s.
    StepOffset(usize),
    /// Frequency of an oscillation, Hz.
    Frequency(usize),
    /// Cosine amplitude of an oscillation about a body axis, rad.
    Cos(usize, usize),
    /// Sine amplitude of an oscillation about a body axis, rad.
    Sin(usize, usize),
}

impl Free {
    /// The six of \[A01\]: attitude and angular momentum at the epoch.
    pub const SIX: [Self; 6] = [
        Self::Attitude(0),
        Self::Attitude(1),
        Self::Attitude(2),
        Self::Rate(0),
        Self::Rate(1),
        Self::Rate(2),
    ];

    /// Everything of one oscillation.
    #[must_use]
    pub fn oscillation(index: usize) -> [Self; 7] {
        [
            Self::Frequency(index),
            Self::Cos(index, 0),
            Self::Cos(index, 1),
            Self::Cos(index, 2),
            Self::Sin(index, 0),
            Self::Sin(index, 1),
            Self::Sin(index, 2),
        ]
    }

    /// Unit of values and sigmas.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Attitude(_) | Self::Misalignment(_) | Self::Cos(..) | Self::Sin(..) => "rad",
            Self::Rate(_) => "rad/s",
            Self::AxialRatio | Self::Triaxiality(_) => "",
            Self::SpinTorque | Self::CrossTorque(_) => "rad/s^2",
            Self::StepOffset(_) => "s",
            Self::Frequency(_) => "Hz",
        }
    }

    /// A change of the order of an arcsecond over the span: the unit in which the fit sees it.
    pub(super) fn scale(self, fitter: &Fitter<'_>, model: &Rotating) -> f64 {
        let arcsec = 1.0 / ARCSEC_PER_RAD;
        let half_s = fitter.half_s().max(fitter.observed().step_s);
        let spin = model.body.rate_rad_s.norm().max(arcsec / half_s);
        match self {
            Self::Attitude(_) | Self::Misalignment(_) | Self::Cos(..) | Self::Sin(..) => arcsec,
            Self::Rate(_) => arcsec / half_s,
            // a phase error of the nutation, a thousandth of a radian at the end of the span
            Self::AxialRatio | Self::Triaxiality(_) => 1e-3 / (spin * half_s).max(1.0),
            Self::SpinTorque | Self::CrossTorque(_) => arcsec / (half_s * half_s),
            Self::StepOffset(_) => arcsec / spin,
            Self::Frequency(_) => 1e-3 / (TAU * half_s),
        }
    }

    /// Whether it changes the motion of the body other than by a constant turn.
    pub(super) fn moves_body(self) -> bool {
        matches!(
            self,
            Self::Rate(_)
                | Self::AxialRatio
                | Self::Triaxiality(_)
                | Self::SpinTorque
                | Self::CrossTorque(_)
        )
    }

    /// Adds to the value. Turns are left to the caller: they do not commute.
    pub(super) fn change(self, model: &mut Rotating, by: f64) {
        let body = &mut model.body;
        match self {
            Self::Attitude(_) | Self::Misalignment(_) => {}
            Self::Rate(axis) => body.rate_rad_s[axis] += by,
            Self::AxialRatio => body.inertia.axial_ratio += by,
            Self::Triaxiality(which) => body.inertia.triaxial[which] += by,
            Self::SpinTorque | Self::CrossTorque(_) => {
                let axis = self.torque_axis(model);
                model.body.torque_rad_s2 += axis * by;
            }
            Self::StepOffset(index) => model.steps[index].offset_s += by,
            Self::Frequency(index) => model.oscillations[index].frequency_hz += by,
            Self::Cos(index, axis) => model.oscillations[index].cos_rad[axis] += by,
            Self::Sin(index, axis) => model.oscillations[index].sin_rad[axis] += by,
        }
    }

    /// The present value; none of a turn, which has no zero.
    #[must_use]
    pub fn value(self, model: &Rotating) -> Option<f64> {
        let body = &model.body;
        Some(match self {
            Self::Attitude(_) | Self::Misalignment(_) => return None,
            Self::Rate(axis) => body.rate_rad_s[axis],
            Self::AxialRatio => body.inertia.axial_ratio,
            Self::Triaxiality(which) => body.inertia.triaxial[which],
            Self::SpinTorque | Self::CrossTorque(_) => {
                self.torque_axis(model).dot(&body.torque_rad_s2)
            }
            Self::StepOffset(index) => model.steps[index].offset_s,
            Self::Frequency(index) => model.oscillations[index].frequency_hz,
            Self::Cos(index, axis) => model.oscillations[index].cos_rad[axis],
            Self::Sin(index, axis) => model.oscillations[index].sin_rad[axis],
        })
    }

    /// Along or across the angular momentum, inertial: body z and x turned to the epoch's momentum.
    fn torque_axis(self, model: &Rotating) -> Vector3<f64> {
        let body = &model.body;
        let l = body.epoch.inverse() * body.momentum_rad_s();
        let along = l.try_normalize(0.0).unwrap_or_else(Vector3::z);
        let x = body.epoch.inverse() * Vector3::x();
        let first = (x - along * along.dot(&x))
            .try_normalize(1e-6)
            .unwrap_or_else(|| along.cross(&Vector3::y()).normalize());
        match self {
            Self::CrossTorque(0) => first,
            Self::CrossTorque(_) => along.cross(&first),
            _ => along,
        }
    }

    /// Change of the residual about body axes with the value, rad per unit.
    pub(super) fn derivative(
        self,
        model: &Rotating,
        tau_s: f64,
        t_s: f64,
        q: &UnitQuaternion<f64>,
        rate: &Vector3<f64>,
    ) -> Vector3<f64> {
        let axis = |axis: usize| Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)));
        let angle = |index: usize| TAU * model.oscillations[index].frequency_hz * tau_s;
        match self {
            // the whole motion turns with its epoch
            Self::Attitude(i) => -(q * (model.body.epoch.inverse() * axis(i))),
            Self::Misalignment(i) => axis(i),
            Self::StepOffset(index) if t_s >= model.steps[index].at_s => *rate,
            Self::Frequency(index) => {
                let line = &model.oscillations[index];
                let (sin, cos) = angle(index).sin_cos();
                (line.cos_rad * sin - line.sin_rad * cos) * (TAU * tau_s)
            }
            Self::Cos(index, i) => -axis(i) * angle(index).cos(),
            Self::Sin(index, i) => -axis(i) * angle(index).sin(),
            _ => Vector3::zeros(),
        }
    }
}
