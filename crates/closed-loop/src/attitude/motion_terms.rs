//! What attitudes may follow of the motion, beside the effects that have a cause.
//!
//! With the rate or the angular acceleration (a, b, c) about tracker axes, over the largest of its components, a form
//! drives axes by
//!
//! ```text
//! across      x by b and c, y by a and c, z by a and b      own      each axis by its own
//! size        each by |.|                                   square   each by |.|^2
//! bent        each by its own times |its own|               squares  each by its own squared
//! direction   each by the sign of its own
//! ```
//!
//! A rate about an axis that turns it in proportion is a time tag, and a smear is an acceleration that does: `own` is
//! of an acceleration alone, and only where rates were measured: the error of a reference goes with its own curvature. Each form is a term by itself: all together they follow anything a little.
//!
//! Such a term predicts; it never explains.
//!
//! Source: least squares; what is even in a motion comes back on the way back, and what is odd does not.

use std::collections::BTreeMap;
use std::sync::Arc;

use effects::{
    AttitudeRows, Candidate, Coefficient, Effect, EffectError, StarRows, Surroundings, mean_turn,
};
use focal_plane::{ARCSEC_PER_RAD, AttitudeSource, Camera, PointsMut, VectorsMut};
use nalgebra::Vector3;

use crate::motion::Around;
use crate::noise_effects;
use crate::search::empirical::EMPIRICAL;

/// Share of the largest rate below which a direction fades: it has none at rest.
const AT_REST: f64 = 0.02;
/// Share of a reference's step over which its path is bent: little, so that it is the acceleration at the frame.
const BENT_OVER: f64 = 0.25;
/// Share of the largest component that a motion has to vary by, to be followed.
const STEADY: f64 = 1e-3;

/// Which motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    Rate,
    Acceleration,
}

/// What it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Across,
    Own,
    Size,
    Square,
    Bent,
    Squares,
    Direction,
}

/// One form of one motion, as columns.
#[derive(Clone, Debug)]
struct Term {
    motion: Motion,
    form: Form,
    /// Largest component, rad/s or rad/s^2.
    largest: f64,
    /// Over which the path is bent, s.
    over_s: f64,
    coefficients: Vec<Coefficient>,
}

/// The terms of a motion around frames at `t_s`; none where it is not known, or steady.
pub(super) fn terms(around: &Around, t_s: &[f64]) -> Vec<Arc<dyn Candidate>> {
    let mut terms: Vec<Arc<dyn Candidate>> = Vec::new();
    if !around.resolved() {
        return terms;
    }
    let over_s = BENT_OVER * around.step_s();
    for motion in [Motion::Rate, Motion::Acceleration] {
        let all = t_s.iter().filter_map(|&t| motion.at(around, t, over_s));
        let [least, most] = all.fold(
            [
                Vector3::repeat(f64::INFINITY),
                Vector3::repeat(f64::NEG_INFINITY),
            ],
            |[least, most], v| [least.inf(&v), most.sup(&v)],
        );
        let largest = least.amax().max(most.amax());
        let varies = largest.is_finite() && (most - least).max() > STEADY * largest;
        if !varies || largest == 0.0 {
            continue;
        }
        let forms = motion.forms(around.by_rates());
        terms.extend(forms.iter().map(|&form| {
            let count = if form == Form::Across { 6 } else { 3 };
            let coefficients = (0..count)
                .map(|k| Coefficient::new(format!("c{k}"), "arcsec", f64::INFINITY))
                .collect();
            let term = Term {
                motion,
                form,
                largest,
                over_s,
                coefficients,
            };
            Arc::new(term) as Arc<dyn Candidate>
        }));
    }
    terms
}

/// Rate and acceleration at `t_s`, arcsec/s and arcsec/s^2; NaN where they are not known.
pub(super) fn motions(around: &Around, t_s: &[f64]) -> [(&'static str, noise_effects::Motion); 2] {
    let step_s = around.step_s();
    [(Motion::Rate, 1), (Motion::Acceleration, 2)].map(|(motion, order)| {
        let at = |&t: &f64| motion.at(around, t, BENT_OVER * step_s);
        let known = t_s.iter().map(at);
        let all: Vec<_> = known
            .map(|m| m.unwrap_or_else(|| Vector3::repeat(f64::NAN)) * ARCSEC_PER_RAD)
            .collect();
        // rates that come along may be made of the same attitudes
        let of_attitudes = noise_effects::Motion::error(order, step_s);
        let axes = std::array::from_fn(|a| all.iter().map(|m| m[a]).collect());
        (motion.name(), noise_effects::Motion { axes, of_attitudes })
    })
}

/// Whether it is one of these terms.
pub(super) fn is_of_motion(candidate: &dyn Candidate) -> bool {
    candidate.id() == EMPIRICAL
        && candidate
            .selectors()
            .get("variable")
            .is_some_and(|v| v == Motion::Rate.name() || v == Motion::Acceleration.name())
}

impl Motion {
    /// The name in `unattributed.depends_on`.
    fn name(self) -> &'static str {
        match self {
            Self::Rate => "rate",
            Self::Acceleration => "acceleration",
        }
    }

    fn forms(self, measured: bool) -> &'static [Form] {
        use Form::{Across, Bent, Direction, Own, Size, Square, Squares};
        match self {
            Self::Rate => &[Across, Size, Square, Bent, Squares, Direction],
            Self::Acceleration if measured => &[Across, Size, Squares, Own],
            Self::Acceleration => &[Across, Size, Squares],
        }
    }

    /// Its value at a time: rad/s, or rad/s^2 from how the path is bent over `over_s` on both sides.
    fn at(self, source: &dyn AttitudeSource, t_s: f64, over_s: f64) -> Option<Vector3<f64>> {
        if self == Self::Rate {
            return source.rate_rad_s(t_s);
        }
        let mut hint = 0;
        let mut turn = |d_s: f64| mean_turn(source, t_s, d_s, 0.0, &mut hint);
        // the tracker turns by what the sky does the other way
        Some((turn(over_s)? + turn(-over_s)?) / -(over_s * over_s))
    }
}

impl Form {
    /// What drives each axis, coefficient by coefficient, of a motion `m` over its largest component.
    fn drives(self, m: &Vector3<f64>) -> [Vector3<f64>; 6] {
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
        let by = |of: [f64; 3]| {
            let none = Vector3::zeros();
            [x * of[0], y * of[1], z * of[2], none, none, none]
        };
        let each = |f: fn(f64) -> f64| by([f(m.x), f(m.y), f(m.z)]);
        match self {
            Self::Across => [x * m.y, x * m.z, y * m.x, y * m.z, z * m.x, z * m.y],
            Self::Own => each(|v| v),
            Self::Size => by([m.norm(); 3]),
            Self::Square => by([m.norm_squared(); 3]),
            Self::Bent => each(|v| v * v.abs()),
            Self::Squares => each(|v| v * v),
            Self::Direction => each(|v| v / (v * v + AT_REST * AT_REST).sqrt()),
        }
    }
}

impl Candidate for Term {
    fn id(&self) -> &'static str {
        EMPIRICAL
    }

    fn selectors(&self) -> BTreeMap<String, String> {
        BTreeMap::from([("variable".to_owned(), self.motion.name().to_owned())])
    }

    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }

    fn describes(&self) -> bool {
        true
    }

    fn acts_on_stars(&self) -> bool {
        false
    }

    fn acts_on_attitude(&self) -> bool {
        true
    }

    fn star_columns(&self, _: &Camera, _: &StarRows<'_>, _: PointsMut<'_>) -> bool {
        false
    }

    fn attitude_columns(&self, rows: &AttitudeRows<'_>, out: VectorsMut<'_>) -> bool {
        let (n, count) = (rows.len(), self.coefficients.len());
        assert_eq!(out.x.len(), count * n, "one block a coefficient");
        let Some(source) = rows.attitude else {
            return false;
        };
        for (i, &t_s) in rows.t_s.iter().enumerate() {
            let motion = self.motion.at(source, t_s, self.over_s).unwrap_or_default();
            let drives = self.form.drives(&(motion / self.largest));
            for (k, drive) in drives.iter().take(count).enumerate() {
                let theta = drive / ARCSEC_PER_RAD;
                out.x[k * n + i] = theta.x;
                out.y[k * n + i] = theta.y;
                out.z[k * n + i] = theta.z;
            }
        }
        true
    }

    /// It predicts only along the motion it was fitted to: it cannot be declared.
    fn realise(&self, _: &[f64], _: &Surroundings<'_>) -> Result<Box<dyn Effect>, EffectError> {
        Err(EffectError::WrongType {
            effect: EMPIRICAL,
            name: "variable".to_owned(),
            expected: "no motion",
        })
    }
}
