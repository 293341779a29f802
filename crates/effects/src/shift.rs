//! Effects that shift an image by terms linear in their coefficients.
//!
//! ```text
//! dP(star) = sum_j c_j T_j(star, P)      px
//! ```
//!
//! One formula `T` serves both ways: forward, at the position the light comes through, and as the
//! columns of a fit, at the modelled position. The two positions differ by the declared distortion
//! at most, which is of second order.
//!
//! Source: linearity only; each effect's terms have their own.

use core::fmt::Debug;
use std::collections::BTreeMap;

use focal_plane::{Camera, Pixel, PointsMut, VectorsMut};
use star_tracker::{Disturbance, Stages, StarView};

use crate::candidate::check_columns;
use crate::{
    AttitudeRows, Candidate, Coefficient, Effect, EffectError, Nonlinear, Parameter, StarRows,
    Surroundings,
};

/// Most terms of one effect.
pub(crate) const MAX_TERMS: usize = 32;

/// The terms of one effect.
pub(crate) trait Shift: Clone + Debug + Send + Sync + 'static {
    /// Identity in the catalogue.
    fn id(&self) -> &'static str;
    /// Where it acts: the image before the declared distortion, or the centroid.
    fn stages(&self) -> Stages {
        Stages {
            image: true,
            ..Stages::NONE
        }
    }
    /// Coefficients in the order of the terms.
    fn coefficients(&self) -> Vec<Coefficient>;
    /// Whether it acts on a star there at all.
    fn reaches(&self, at: Pixel) -> bool {
        let _ = at;
        true
    }
    /// Shift per unit of each coefficient, px.
    fn terms(&self, star: &StarView, out: &mut [[f64; 2]]);
    /// What is to be expected of the terms where the position is known to these variances of x and of
    /// y, px^2.
    fn expected_terms(&self, star: &StarView, variance_px2: [f64; 2], out: &mut [[f64; 2]]) {
        let _ = variance_px2;
        self.terms(star, out);
    }
    /// Reported parameters of these values.
    fn parameters(&self, values: &[f64]) -> Vec<Parameter> {
        sizes(self.coefficients(), values)
    }
    /// What tells it from others of its kind.
    fn selectors(&self) -> BTreeMap<String, String> {
        BTreeMap::new()
    }
    /// See [`Candidate::nonlinear`].
    fn nonlinear(&self) -> Vec<Nonlinear> {
        Vec::new()
    }
    /// See [`Candidate::with_nonlinear`].
    fn with_nonlinear(&self, values: &[f64]) -> Option<Self> {
        let _ = values;
        None
    }
    /// See [`Candidate::refined`].
    fn refined(&self, values: &[f64]) -> Option<Self> {
        let _ = values;
        None
    }
    /// See [`Candidate::linear_about`].
    fn linear_about(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }
    /// See [`Candidate::beside_form`].
    fn beside_form(&self, values: &[(&'static str, f64)]) -> Option<Self> {
        let _ = values;
        None
    }
    /// Shift of these `values`, px, for those whose [`terms`](Self::terms) are linear only about some.
    fn shift_px(&self, star: &StarView, values: &[f64]) -> [f64; 2] {
        linear_px(self, star, values)
    }
    /// See [`Candidate::choices`].
    fn choices(&self) -> usize {
        0
    }
    /// See [`Candidate::stands_for`].
    fn stands_for(&self) -> f64 {
        1.0
    }
    /// See [`Candidate::credit`].
    fn credit(&self) -> f64 {
        1.0
    }
    /// See [`Candidate::reach_px`].
    fn reach_px(&self) -> Option<([f64; 2], f64)> {
        None
    }
    /// See [`Candidate::part`].
    fn part(&self) -> Option<u32> {
        None
    }
    /// See [`Candidate::of_parts`].
    fn of_parts(&self, parts: &[u32]) -> Option<Self> {
        let _ = parts;
        None
    }
}

/// Each coefficient as a parameter.
pub(crate) fn sizes(coefficients: Vec<Coefficient>, values: &[f64]) -> Vec<Parameter> {
    let each = coefficients.into_iter().zip(values);
    each.map(|(c, &value)| Parameter::new(c.name, value, c.unit))
        .collect()
}

/// Sum of the terms, each times its value, px.
pub(crate) fn linear_px<S: Shift>(shift: &S, star: &StarView, values: &[f64]) -> [f64; 2] {
    let mut terms = [[0.0; 2]; MAX_TERMS];
    shift.terms(star, &mut terms[..values.len()]);
    let mut sum = [0.0; 2];
    for (term, value) in terms.iter().zip(values) {
        sum[0] += value * term[0];
        sum[1] += value * term[1];
    }
    sum
}

/// A shift with its values.
#[derive(Clone, Debug)]
pub(crate) struct Shifted<S> {
    shift: S,
    values: Vec<f64>,
}

impl<S: Shift> Shifted<S> {
    pub(crate) fn new(shift: S, values: Vec<f64>) -> Self {
        assert!(values.len() <= MAX_TERMS, "at most {MAX_TERMS} terms");
        Self { shift, values }
    }
}

impl<S: Shift> Disturbance for Shifted<S> {
    fn stages(&self) -> Stages {
        self.shift.stages()
    }
    fn image_shift_px(&self, star: &StarView) -> [f64; 2] {
        self.shift.shift_px(star, &self.values)
    }
    fn centroid_shift_px(&self, star: &StarView) -> [f64; 2] {
        self.shift.shift_px(star, &self.values)
    }
}

impl<S: Shift> Effect for Shifted<S> {
    fn id(&self) -> &'static str {
        self.shift.id()
    }
    fn parameters(&self) -> Vec<Parameter> {
        self.shift.parameters(&self.values)
    }
    fn selectors(&self) -> BTreeMap<String, String> {
        self.shift.selectors()
    }
}

/// A shift of unknown size.
#[derive(Clone, Debug)]
pub(crate) struct ShiftCandidate<S> {
    shift: S,
    coefficients: Vec<Coefficient>,
}

impl<S: Shift> ShiftCandidate<S> {
    pub(crate) fn boxed(shift: S) -> Box<dyn Candidate> {
        let coefficients = shift.coefficients();
        Box::new(Self {
            shift,
            coefficients,
        })
    }
}

impl<S: Shift> Candidate for ShiftCandidate<S> {
    fn id(&self) -> &'static str {
        self.shift.id()
    }
    fn selectors(&self) -> BTreeMap<String, String> {
        self.shift.selectors()
    }
    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }
    fn nonlinear(&self) -> Vec<Nonlinear> {
        self.shift.nonlinear()
    }
    fn with_nonlinear(&self, values: &[f64]) -> Option<Box<dyn Candidate>> {
        self.shift.with_nonlinear(values).map(Self::boxed)
    }
    fn refined(&self, values: &[f64]) -> Option<Box<dyn Candidate>> {
        self.shift.refined(values).map(Self::boxed)
    }
    fn linear_about(&self) -> Vec<(&'static str, f64)> {
        self.shift.linear_about()
    }
    fn beside_form(&self, values: &[(&'static str, f64)]) -> Option<Box<dyn Candidate>> {
        self.shift.beside_form(values).map(Self::boxed)
    }
    fn choices(&self) -> usize {
        self.shift.choices()
    }
    fn stands_for(&self) -> f64 {
        self.shift.stands_for()
    }
    fn credit(&self) -> f64 {
        self.shift.credit()
    }
    fn reach_px(&self) -> Option<([f64; 2], f64)> {
        self.shift.reach_px()
    }
    fn part(&self) -> Option<u32> {
        self.shift.part()
    }
    fn of_parts(&self, parts: &[u32]) -> Option<Box<dyn Candidate>> {
        self.shift.of_parts(parts).map(Self::boxed)
    }
    fn moves_light(&self) -> bool {
        self.shift.stages().image
    }
    fn acts_on_stars(&self) -> bool {
        true
    }
    fn acts_on_attitude(&self) -> bool {
        false
    }
    fn star_columns(&self, _: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        let (n, p) = (rows.len(), self.coefficients.len());
        check_columns(p, n, out.x.len());
        let mut terms = [[0.0; 2]; MAX_TERMS];
        out.x.fill(0.0);
        out.y.fill(0.0);
        let centroid = self.shift.stages().centroid;
        for i in 0..n {
            let at = if centroid { rows.landed(i) } else { rows.at(i) };
            if !self.shift.reaches(at) {
                continue;
            }
            let star = StarView { at, ..rows.view(i) };
            let variance = rows.landed_variance_px2.map(|v| v[i]);
            self.shift.expected_terms(&star, variance, &mut terms[..p]);
            for (j, term) in terms[..p].iter().enumerate() {
                out.x[j * n + i] = term[0];
                out.y[j * n + i] = term[1];
            }
        }
        true
    }
    fn attitude_columns(&self, _: &AttitudeRows<'_>, _: VectorsMut<'_>) -> bool {
        false
    }
    fn realise(
        &self,
        values: &[f64],
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        Ok(Box::new(Shifted::new(self.shift.clone(), values.to_vec())))
    }
}

impl StarRows<'_> {
    /// Row `i` as a disturbance sees it, at its modelled position.
    pub(crate) fn view(&self, i: usize) -> StarView {
        StarView {
            t_s: self.t_s[i],
            slot: self.slot[i],
            star_id: self.star_id[i],
            mag: self.mag[i],
            bv: self.bv[i],
            at: self.at(i),
        }
    }

    /// Where the light of row `i` falls.
    pub(crate) fn landed(&self, i: usize) -> Pixel {
        Pixel {
            x: self.landed_px[0][i],
            y: self.landed_px[1][i],
        }
    }

    /// Modelled position of row `i`.
    pub(crate) fn at(&self, i: usize) -> Pixel {
        Pixel {
            x: self.x_px[i],
            y: self.y_px[i],
        }
    }
}
