//! Regressors: how an effect of unknown size enters a residual.
//!
//! A candidate is linear in its coefficients near zero: a residual (measured minus modelled) that
//! holds the effect with coefficients `c_j` is
//!
//! ```text
//! r = sum_j c_j column_j + nuisance + noise
//! ```
//!
//! Star columns are in px per unit of the coefficient, attitude columns in rad per unit (tracker axes,
//! `theta = log(q_meas q_ref^-1)`). Columns are raw: whoever fits projects out misalignment, constants
//! and whatever else the declared model leaves free. They are evaluated at modelled positions, never
//! at measured ones (on measured positions noise explains itself).
//!
//! What enters non-linearly is either searched ([`Candidate::nonlinear`]: an instant, a frequency, a
//! lag) or re-linearised ([`Candidate::refined`]: an exposure).
//!
//! Source: the catalogue of docs/effects.md; the first-order terms are derived in the file of each effect.

use core::fmt::Debug;
use std::collections::BTreeMap;

use focal_plane::{AttitudeSource, Camera, PointsMut, VectorsMut};
use nalgebra::{DMatrix, DMatrixView};

use crate::{Effect, EffectError, Parameter, PixelWaves, Surroundings};

/// Star rows at which regressors are evaluated: structure of arrays, all of one length.
#[derive(Clone, Copy)]
pub struct StarRows<'a> {
    /// Frame time stamps, s.
    pub t_s: &'a [f64],
    /// Modelled x (projection, misalignment, declared distortion), px.
    pub x_px: &'a [f64],
    /// Modelled y, px.
    pub y_px: &'a [f64],
    /// Where the light falls, x then y: the modelled position with all that effects shift it by, as far
    /// as that is known, px. What acts on the centroid is evaluated there.
    pub landed_px: [&'a [f64]; 2],
    /// How well that is known: variance of x and of y, px^2.
    pub landed_variance_px2: [&'a [f64]; 2],
    /// Velocity of the modelled x, px/s.
    pub vx_px_s: &'a [f64],
    /// Velocity of the modelled y, px/s.
    pub vy_px_s: &'a [f64],
    /// Acceleration of the modelled x, px/s^2.
    pub ax_px_s2: &'a [f64],
    /// Acceleration of the modelled y, px/s^2.
    pub ay_px_s2: &'a [f64],
    /// Magnitudes; NaN unknown.
    pub mag: &'a [f64],
    /// Colours B - V; NaN unknown.
    pub bv: &'a [f64],
    /// Usual fluxes of the stars as their logarithms to base 10; NaN unknown.
    pub log_flux: &'a [f64],
    /// Measured fluxes over the usual ones of their stars, as logarithms to base 10; NaN unknown.
    pub log_flux_change: &'a [f64],
    /// Middle of the star's window, x then y, px; NaN unknown, empty where there are no windows.
    pub window_px: [&'a [f64]; 2],
    /// Slots.
    pub slot: &'a [i32],
    /// Star identities.
    pub star_id: &'a [i64],
    /// Where waves in the pixel phase of these rows are kept once they are evaluated: for these positions,
    /// variances and camera alone, so that rows with others need their own, or none.
    pub waves: Option<&'a PixelWaves>,
    /// The attitude that the modelled positions follow. With it, shifts in time are evaluated on the
    /// path itself, not from velocity and acceleration; without it, inertial effects have no columns.
    pub attitude: Option<&'a dyn AttitudeSource>,
}

impl StarRows<'_> {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }
}

impl Debug for StarRows<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("StarRows")
            .field("rows", &self.len())
            .finish_non_exhaustive()
    }
}

/// Attitude rows at which regressors are evaluated.
#[derive(Clone, Copy)]
pub struct AttitudeRows<'a> {
    /// Time stamps, s.
    pub t_s: &'a [f64],
    /// Rate, rad/s, tracker axes; may be empty.
    pub wx_rad_s: &'a [f64],
    /// Rate about y.
    pub wy_rad_s: &'a [f64],
    /// Rate about z.
    pub wz_rad_s: &'a [f64],
    /// The reference attitude, if it is on hand.
    pub attitude: Option<&'a dyn AttitudeSource>,
}

impl AttitudeRows<'_> {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }
}

impl Debug for AttitudeRows<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("AttitudeRows")
            .field("rows", &self.len())
            .finish_non_exhaustive()
    }
}

/// Largest misalignment that an effect has, arcsec.
const MOST_ARCSEC: f64 = 1800.0;

/// One linear coefficient of a candidate.
#[derive(Clone, Debug, PartialEq)]
pub struct Coefficient {
    /// Name; that of the parameter where the two are the same.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// 1 sigma of plausible sizes, in `unit`. No prior of the fit: sizes far beyond it are not believed.
    pub plausible: f64,
    /// Smallest physical value (0 for a squared exposure), or minus infinity.
    pub lower: f64,
    /// Largest value that an instrument could have, where that does not follow from `plausible`: a size
    /// that enters in square has squares of very different sizes. Otherwise infinity.
    pub upper: f64,
}

impl Coefficient {
    /// A coefficient of either sign.
    pub fn new(name: impl Into<String>, unit: &'static str, plausible: f64) -> Self {
        Self {
            name: name.into(),
            unit,
            plausible,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
        }
    }

    /// The same of a misalignment, whatever is plausible up to half a degree: steps of mounts, and references in other
    /// frames. Beyond that a rotation is no small angle.
    #[must_use]
    pub fn as_misalignment(self) -> Self {
        self.at_least(-MOST_ARCSEC).at_most(MOST_ARCSEC)
    }

    /// The same, not below `lower`.
    #[must_use]
    pub fn at_least(self, lower: f64) -> Self {
        Self { lower, ..self }
    }

    /// The same, not above `upper`.
    #[must_use]
    pub fn at_most(self, upper: f64) -> Self {
        Self { upper, ..self }
    }
}

/// A parameter that the columns follow non-linearly; the caller searches it.
#[derive(Clone, Debug, PartialEq)]
pub struct Nonlinear {
    /// Name, that of the parameter.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Its value in this candidate.
    pub value: f64,
    /// Range to search.
    pub range: [f64; 2],
    /// Step within which the columns hardly change: the first step of a refinement.
    pub step: f64,
    /// Difference to either side over which the slope of the columns is to be taken; `None`: an instant has no slope.
    pub difference: Option<f64>,
}

/// Share of the step that makes a slope of columns that are smooth.
pub(crate) const DIFFERENCE: f64 = 0.02;

/// Another effect of the catalogue that looks like a candidate whatever the data.
#[derive(Clone, Debug, PartialEq)]
pub struct Twin {
    /// Identity in the catalogue.
    pub id: &'static str,
    /// What tells which form of it.
    pub selectors: BTreeMap<String, String>,
    /// Correlation of the two.
    pub correlation: f64,
}

/// One way in which an effect could be in the data.
pub trait Candidate: Debug + Send + Sync {
    /// Identity of the effect in the catalogue.
    fn id(&self) -> &'static str;
    /// What tells this candidate from others of its effect.
    fn selectors(&self) -> BTreeMap<String, String> {
        BTreeMap::new()
    }
    /// The linear coefficients.
    fn coefficients(&self) -> &[Coefficient];
    /// The non-linear parameters with their present values.
    fn nonlinear(&self) -> Vec<Nonlinear> {
        Vec::new()
    }
    /// How many discrete choices this candidate has made that the data has to decide (signs that the
    /// bundle leaves open, on which side of a star a pixel is); each is to be paid for like a coefficient.
    fn choices(&self) -> usize {
        0
    }
    /// How many of its coefficients are the slope of a parameter that is otherwise searched (a period, in steps):
    /// such a one is paid for by the forms that were looked at, as one that is [`nonlinear`](Self::nonlinear) is.
    fn slopes(&self) -> usize {
        0
    }
    /// How many forms of its effect were looked at for each that is proposed, this one among them: a form
    /// that was chosen out of many by this very data has to pay for all of them.
    fn stands_for(&self) -> f64 {
        1.0
    }
    /// How likely such a form is beside the others of its effect, of 1: a less likely one pays more for having been
    /// looked at, and the others pay less (weighted Bonferroni, Genovese, Roeder & Wasserman 2006).
    fn credit(&self) -> f64 {
        1.0
    }
    /// Middle and half-width, px, of the square of the detector outside which it does nothing, where stars pass by it;
    /// `None`: it acts everywhere, or on the same stars all the time.
    fn reach_px(&self) -> Option<([f64; 2], f64)> {
        None
    }
    /// The same candidate with other values of [`nonlinear`](Self::nonlinear), in its order; `None`
    /// when a value is out of range or there is nothing to change.
    fn with_nonlinear(&self, values: &[f64]) -> Option<Box<dyn Candidate>> {
        let _ = values;
        None
    }
    /// The same candidate with columns re-linearised so that `column x value` is the exact shift at
    /// `values`; `None` when the columns are exact already.
    fn refined(&self, values: &[f64]) -> Option<Box<dyn Candidate>> {
        let _ = values;
        None
    }
    /// The values of its coefficients about which its columns were [`refined`](Self::refined), where other forms of its
    /// effect have coefficients of these names; empty: none, or they have not.
    fn linear_about(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }
    /// The same candidate with columns re-linearised about those of these values, by name, that are its own: another
    /// form of its effect was found there.
    fn beside_form(&self, values: &[(&'static str, f64)]) -> Option<Box<dyn Candidate>> {
        let _ = values;
        None
    }
    /// Another effect of the catalogue that may have made the same columns in any data, where there is one.
    fn twin(&self) -> Option<Twin> {
        None
    }
    /// Whether it moves stars.
    fn acts_on_stars(&self) -> bool;
    /// Whether it moves the attitude as a whole in a way that attitude rows alone can show.
    fn acts_on_attitude(&self) -> bool;
    /// Whether the star columns are what [`attitude_columns`](Self::attitude_columns) make of every
    /// star alike, as a small rotation of the camera: then nothing else need be evaluated.
    fn turns_camera(&self) -> bool {
        false
    }
    /// Whether the light itself falls elsewhere; what acts on the centroid alone leaves it where it is, and the phase
    /// in the pixel with it.
    fn moves_light(&self) -> bool {
        true
    }
    /// Whether it tells what something follows and not why: a thousandth of its size is nothing to it.
    fn describes(&self) -> bool {
        false
    }
    /// Which part of its effect it is, where the effect has parts: several of them may act together, and are
    /// then told as [one](Self::of_parts).
    fn part(&self) -> Option<u32> {
        None
    }
    /// All `parts` of its effect in one; `None` where it has none.
    fn of_parts(&self, parts: &[u32]) -> Option<Box<dyn Candidate>> {
        let _ = parts;
        None
    }
    /// Star columns, px per unit: `out` holds coefficient after coefficient, each `rows.len()` long.
    /// Returns false, leaving `out` unspecified, when it does not act on stars or lacks what it needs.
    ///
    /// # Panics
    /// When `out` is not `coefficients().len() * rows.len()` long.
    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool;
    /// Attitude columns, rad per unit, tracker axes; layout and answer as in
    /// [`star_columns`](Self::star_columns).
    ///
    /// # Panics
    /// When `out` is not `coefficients().len() * rows.len()` long.
    fn attitude_columns(&self, rows: &AttitudeRows<'_>, out: VectorsMut<'_>) -> bool;
    /// The effect with these coefficients.
    ///
    /// # Errors
    /// When a coefficient is out of its physical range.
    ///
    /// # Panics
    /// When there is not one value per coefficient.
    fn realise(
        &self,
        values: &[f64],
        surroundings: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError>;
}

/// The parameters that an effect with these coefficients reports, with 1 sigma from the covariance of
/// the coefficients.
///
/// Coefficients need not be the parameters (a cosine and a sine become an amplitude and a phase), so
/// the covariance goes through the derivative of [`Candidate::realise`], taken by central differences
/// of a hundredth of a standard deviation.
///
/// # Errors
/// Those of [`Candidate::realise`].
///
/// # Panics
/// When the shapes of `values`, `covariance` and the candidate's coefficients differ.
pub fn reported(
    candidate: &dyn Candidate,
    values: &[f64],
    covariance: DMatrixView<'_, f64>,
    surroundings: &Surroundings<'_>,
) -> Result<Vec<(Parameter, f64)>, EffectError> {
    let n = values.len();
    assert_eq!(
        n,
        candidate.coefficients().len(),
        "one value per coefficient"
    );
    assert_eq!(
        covariance.shape(),
        (n, n),
        "square covariance of the coefficients"
    );
    let parameters = candidate.realise(values, surroundings)?.parameters();
    let mut jacobian = DMatrix::zeros(parameters.len(), n);
    for j in 0..n {
        let sigma = covariance[(j, j)].max(0.0).sqrt();
        if sigma <= 0.0 {
            continue;
        }
        let step = 0.01 * sigma;
        let mut moved = values.to_vec();
        moved[j] = values[j] + step;
        let above = candidate.realise(&moved, surroundings)?.parameters();
        moved[j] = (values[j] - step).max(candidate.coefficients()[j].lower);
        let below = candidate.realise(&moved, surroundings)?.parameters();
        let width = values[j] + step - moved[j];
        for (i, parameter) in parameters.iter().enumerate() {
            // a phase or a node may wrap between the two
            let change = parameter.shorter(above[i].value - below[i].value);
            jacobian[(i, j)] = change / width;
        }
    }
    let spread = &jacobian * covariance * jacobian.transpose();
    Ok(parameters
        .into_iter()
        .enumerate()
        .map(|(i, p)| (p, spread[(i, i)].max(0.0).sqrt()))
        .collect())
}

/// Panics unless a buffer holds one column of `rows` for each of `coefficients`.
pub(crate) fn check_columns(coefficients: usize, rows: usize, got: usize) {
    assert_eq!(
        got,
        coefficients * rows,
        "one column of {rows} rows for each coefficient"
    );
}
