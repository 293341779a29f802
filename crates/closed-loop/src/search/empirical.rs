//! Terms in one variable, without a physical cause: what a leftover follows.
//!
//! For a variable v the residual field is expanded in what a smooth dependence
//! on it could do. On the detector a scalar drives four simple fields,
//!
//! ```text
//! (g, 0)   (0, g)   (-y g, x g)   (x g, y g)      g = P_1(v), P_2(v), ..., v scaled to -1..1
//! ```
//!
//! a shift along each axis, a roll and a scale (the time by what bends the scale alone: a frame's turns would be
//! those of a reference that errs slowly); on an attitude it drives each axis. Motion (a, b) drives each axis by
//! each of its own, by its squares a^2, b^2 and ab and by its size; a pixel phase its own axis by its first six
//! harmonics and the other by two, the place within the window its own axis. A rate also drives by its direction
//! alone, whatever its size: backlash does. Two variables together are what neither does alone,
//!
//! ```text
//! P_1(a) times the first columns of b, of a motion those of its size, too
//! ```
//!
//! A half or a quarter of the detector that is shifted as a whole, for its output or its mosaic, has two values, as has
//! what lies beyond an edge anywhere, or on a patch. The scale may be another one from an instant on: what bends with
//! the time takes three columns for it. The first waves of both pixel phases have four products.
//!
//! Such a term predicts; it never explains.
//!
//! Source: ordinary least squares on Legendre polynomials; the fields are the
//! first-order terms of a similarity transformation of the image.

use std::borrow::Cow;
use std::collections::BTreeMap;

use effects::{
    AttitudeRows, Candidate, Coefficient, Effect, EffectError, LARGEST_WAVE_PX, StarRows,
    Surroundings,
};
use focal_plane::{Camera, PointsMut, Series, VectorsMut};

use crate::search::LEADING;
use fields::Columns;
use variable::orders;
pub(crate) use variable::{Scale, Variable, about_mean, flux_of, range};

mod fields;
mod variable;

/// Id under which empirical terms are listed.
pub(crate) const EMPIRICAL: &str = "empirical";

/// Orders of the polynomial in a smooth variable.
const ORDERS: usize = 3;
/// Harmonics of a pixel phase along its own axis, and across.
pub(crate) const HARMONICS: usize = 6;
const ACROSS: usize = 2;
/// Products of the first waves in both pixel phases.
const PRODUCTS: usize = 4;
/// Fields that a variable of one number drives: a shift along each axis, a roll and a scale.
const FIELDS: usize = 4;
/// Columns of a variable that another one may multiply.
const OF_A_PAIR: usize = 2;
/// Where the columns of a motion start that are of its squares, of its size (the last that an acceleration has), along
/// it and bent, and of its direction alone.
const SQUARES: usize = 6;
const SIZE: usize = 12;
const BENT: usize = SIZE + 2;
const DIRECTION: usize = BENT + 2;
/// Columns of a rate.
const OF_A_RATE: usize = DIRECTION + 2;
/// Share of the largest rate below which a direction fades: it has none at rest.
const AT_REST: f64 = 0.02;

/// One variable, or two, as columns.
#[derive(Clone, Debug)]
pub(crate) struct Empirical {
    variable: Variable,
    scale: Scale,
    /// The variable whose first polynomial multiplies all columns.
    by: Option<(Variable, Scale)>,
    /// How many like it it was looked for among, if it was.
    among: Option<usize>,
    /// Whether it moves stars, or attitudes.
    stars: bool,
    coefficients: Vec<Coefficient>,
}

impl Empirical {
    /// Whether a model can declare it: of motion, stars, slots and windows it predicts only
    /// where it was fitted.
    pub(crate) fn is_declarable(&self, surroundings: &Surroundings<'_>) -> bool {
        let one = vec![1.0; self.coefficients.len()];
        self.realise(&one, surroundings).is_ok()
    }

    /// Columns in `variable`, which runs over `range` in the data.
    pub(crate) fn new(variable: Variable, range: [f64; 2], stars: bool) -> Option<Self> {
        let scale = Scale::new(range);
        let smooth = !matches!(
            variable,
            Variable::Star(_) | Variable::Slot(_) | Variable::Phase(_) | Variable::PhaseProduct
        );
        if smooth && !scale.varies() {
            return None;
        }
        let count = match &variable {
            Variable::Star(ids) => 2 * ids.len(),
            Variable::Slot(slots) => 2 * slots.len(),
            Variable::Phase(_) => 2 * (HARMONICS + ACROSS),
            Variable::Position(_) | Variable::Window => 2 * ORDERS,
            Variable::PhaseProduct => 2 * PRODUCTS,
            Variable::Half(_)
            | Variable::Quarter
            | Variable::Beyond { .. }
            | Variable::Patch { .. }
            | Variable::During { .. }
            | Variable::Since { .. } => 2,
            Variable::Time if stars => FIELDS * ORDERS,
            // A polynomial in time is only good outside its fold if it is straight.
            Variable::Time => 3,
            Variable::Rate => OF_A_RATE,
            Variable::Acceleration => BENT,
            _ if stars => FIELDS * orders(&variable),
            _ => 3 * orders(&variable),
        };
        Some(Self {
            variable,
            scale,
            by: None,
            among: None,
            stars,
            coefficients: coefficients(count),
        })
    }

    /// What `of` and `by` do to stars together and neither does alone.
    pub(crate) fn pair(
        of: Variable,
        of_range: [f64; 2],
        by: Variable,
        by_range: [f64; 2],
    ) -> Option<Self> {
        let mut term = Self::new(of, of_range, true)?;
        let scale = Scale::new(by_range);
        if !scale.varies() {
            return None;
        }
        if !term.is_of_many() {
            // a size that hardly changes, times the time or a channel, is the time or the channel
            let whole = matches!(by, Variable::Time | Variable::Housekeeping(..));
            let has_size = term.is_of_motion() && !whole;
            let of_size = if has_size { BENT - SIZE } else { 0 };
            let fields = if term.is_of_channel() && whole {
                // two channels turn a camera as one does
                FIELDS
            } else {
                OF_A_PAIR
            };
            term.coefficients.truncate(fields + of_size);
        }
        term.by = Some((by, scale));
        Some(term)
    }

    /// The same, which was looked for among so many like it.
    #[must_use]
    pub(crate) fn looked_for_among(self, among: usize) -> Self {
        Self {
            among: Some(among),
            ..self
        }
    }

    /// The same with waves in the pixel phase no larger than this camera's pixels let them be.
    #[must_use]
    pub(crate) fn on(mut self, camera: &Camera) -> Self {
        let scale = camera.arcsec_per_px();
        for (k, coefficient) in self.coefficients.iter_mut().enumerate() {
            let axis = match self.variable {
                Variable::Phase(axis) if k < 2 * HARMONICS => axis,
                Variable::Phase(axis) => 1 - axis,
                Variable::PhaseProduct => k / PRODUCTS,
                _ => break,
            };
            coefficient.upper = LARGEST_WAVE_PX * scale[axis];
            coefficient.lower = -coefficient.upper;
        }
        self
    }

    /// Whether it has a shift for each of many (stars, slots).
    pub(crate) fn is_of_many(&self) -> bool {
        matches!(self.variable, Variable::Star(_) | Variable::Slot(_))
    }

    /// Whether it is a constant of each star that stands in a catalogue.
    pub(crate) fn is_of_a_star(&self) -> bool {
        let of_star = matches!(
            self.variable,
            Variable::Magnitude | Variable::Colour | Variable::Brightness
        );
        of_star && self.by.is_none()
    }

    /// Its value, scaled, for a star of this magnitude, colour and logarithm of the flux; `None` where it is not of that.
    pub(crate) fn value_of_star(&self, [mag, bv, log_flux]: [f64; 3]) -> Option<f64> {
        let value = match self.variable {
            Variable::Magnitude => mag,
            Variable::Colour => bv,
            Variable::Flux => log_flux,
            Variable::Brightness => flux_of(mag),
            _ => return None,
        };
        Some(self.scale.of(value))
    }

    /// Orders of the polynomials that these columns have.
    pub(crate) fn orders_of(&self, columns: &[usize]) -> Vec<usize> {
        let mut orders: Vec<usize> = columns.iter().map(|k| k / FIELDS + 1).collect();
        orders.sort_unstable();
        orders.dedup();
        orders
    }

    /// Whether it is the motion alone.
    pub(crate) fn is_of_motion(&self) -> bool {
        let of_motion = matches!(self.variable, Variable::Rate | Variable::Acceleration);
        of_motion && self.by.is_none()
    }

    /// Whether it is the acceleration, alone or with another variable.
    pub(crate) fn is_of_acceleration(&self) -> bool {
        matches!(self.variable, Variable::Acceleration)
    }

    /// Whether it is the time alone.
    pub(crate) fn is_of_time(&self) -> bool {
        let of_time = matches!(
            self.variable,
            Variable::Time | Variable::Turning | Variable::During { .. } | Variable::Since { .. }
        );
        of_time && self.by.is_none()
    }

    /// Whether frames turn to and fro with the time.
    pub(crate) fn turns_to_and_fro(&self) -> bool {
        matches!(self.variable, Variable::Turning)
    }

    /// Whether frames turn with the time, to and fro or for a stretch of it.
    pub(crate) fn turns_frames(&self) -> bool {
        matches!(self.variable, Variable::Turning | Variable::During { .. })
    }

    /// Whether it is none of the usual terms: it stands where it was looked for, or turns frames to and fro.
    pub(crate) fn is_looked_for(&self) -> bool {
        self.among.is_some() || self.turns_to_and_fro()
    }

    /// What it pays for having been looked for, nats.
    pub(crate) fn scanned(&self) -> f64 {
        self.among.map_or(0.0, |among| (among.max(1) as f64).ln())
    }

    /// Whether it is a housekeeping channel alone.
    pub(crate) fn is_of_channel(&self) -> bool {
        self.channel_name().is_some()
    }

    /// The name of the channel that it is of alone.
    pub(crate) fn channel_name(&self) -> Option<&str> {
        match (&self.variable, &self.by) {
            (Variable::Housekeeping(name, _), None) => Some(name),
            _ => None,
        }
    }

    /// The channel that it is of alone, and the values of it that are -1 and 1.
    pub(crate) fn channel(&self) -> Option<(&Variable, &Series, [f64; 2])> {
        let Variable::Housekeeping(_, series) = &self.variable else {
            return None;
        };
        let Scale { middle, half } = self.scale;
        let alone = self.by.is_none();
        alone.then_some((&self.variable, series, [middle - half, middle + half]))
    }

    /// The same as a straight line.
    #[must_use]
    pub(crate) fn straight(mut self) -> Self {
        self.coefficients.truncate(FIELDS);
        self
    }

    /// Whether it is a channel, or two, by a form that was looked for.
    pub(crate) fn is_of_a_form(&self) -> bool {
        matches!(self.variable, Variable::Housekeeping(..)) && self.among.is_some()
    }

    /// Whether it is a shift of each star.
    pub(crate) fn is_of_stars(&self) -> bool {
        matches!(self.variable, Variable::Star(_)) && self.by.is_none()
    }

    /// Whether it is a pair that a motion takes part in by its size.
    fn has_size(&self) -> bool {
        let of_motion = matches!(self.variable, Variable::Rate | Variable::Acceleration);
        of_motion && self.by.is_some() && self.coefficients.len() > OF_A_PAIR
    }

    /// The name in `unattributed.depends_on`.
    pub(crate) fn name(&self) -> String {
        let mut both = vec![&self.variable];
        both.extend(self.by.as_ref().map(|(by, _)| by));
        both.sort_by_key(|v| v.rank());
        let names: Vec<String> = both.into_iter().map(Variable::name).collect();
        names.join("*")
    }

    /// Parts by which it is judged, beside all of it: a straight line before what bends,
    /// a single star or slot. Positions among the coefficients.
    pub(crate) fn parts(&self) -> Vec<Vec<usize>> {
        let n = self.coefficients.len();
        let mut parts: Vec<Vec<usize>> = if self.is_of_many() {
            (0..n).step_by(2).map(|k| vec![k, k + 1]).collect()
        } else {
            let leading = LEADING.iter().filter(|l| **l < n);
            leading.map(|l| (0..*l).collect()).collect()
        };
        if self.is_of_motion() {
            // its square, its squares, its size
            let squares = |count: usize| (SQUARES..SQUARES + count).collect();
            parts.extend([squares(2), squares(4), squares(6), vec![SIZE, SIZE + 1]]);
            if n == OF_A_RATE {
                // along the motion, bent; its direction alone
                let [along, across] = [DIRECTION, DIRECTION + 1];
                parts.extend([vec![0, BENT], vec![along], vec![along, across]]);
            }
        } else if self.has_size() {
            parts.push((OF_A_PAIR..n).collect());
        } else if matches!(self.variable, Variable::Phase(_)) {
            // its own axis, and the other
            let own = 2 * HARMONICS;
            if n > own {
                parts.extend([(0..own).collect(), vec![own, own + 1], (own..n).collect()]);
            }
        } else if matches!(self.variable, Variable::PhaseProduct) {
            parts = vec![(0..PRODUCTS).collect(), (PRODUCTS..n).collect()];
        } else if matches!(self.variable, Variable::Since { .. }) {
            // nothing before it
            parts.push(vec![0]);
        } else if self.is_of_a_form() {
            parts.extend((0..n).map(|field| vec![field]));
        } else if n == FIELDS * ORDERS {
            // what bends alone, and the scale
            parts.extend([vec![4, 5], (4..8).collect(), vec![3]]);
            if matches!(self.variable, Variable::Housekeeping(..)) {
                // one field, however it bends: a camera turns about one axis
                let bent = |field: usize| (field..n).step_by(FIELDS).collect();
                parts.extend((0..FIELDS).map(bent));
            }
        }
        parts.push((0..n).collect());
        parts
    }
}

impl Empirical {
    /// `part` and what bends as well: a cause is not as straight as what describes it. Of many stars only those that
    /// are meant; of a motion all that is not in proportion to it; of one number the same fields. What else is in
    /// proportion is left to the effects that it would hide: a motion's first columns are a time tag, a rolling
    /// shutter and a smear.
    pub(crate) fn bending(&self, part: &[usize]) -> Vec<usize> {
        let of_number = self.by.is_none()
            && matches!(
                self.variable,
                Variable::Time
                    | Variable::Turning
                    | Variable::Magnitude
                    | Variable::Colour
                    | Variable::Flux
                    | Variable::Brightening
                    | Variable::Brightness
                    | Variable::Housekeeping(..)
            );
        let belongs = |k: &usize| {
            if self.is_of_motion() {
                *k >= SQUARES
            } else if of_number {
                part.iter().any(|p| p % FIELDS == k % FIELDS)
            } else {
                !self.is_of_many()
            }
        };
        let all = 0..self.coefficients.len();
        all.filter(|k| part.contains(k) || belongs(k)).collect()
    }
}

fn coefficients(count: usize) -> Vec<Coefficient> {
    (0..count)
        .map(|k| Coefficient::new(format!("c{k}"), "arcsec", f64::INFINITY))
        .collect()
}

/// Legendre polynomials `P_1`..`P_3`.
pub(crate) fn legendre(z: f64) -> [f64; ORDERS] {
    [z, 1.5 * z * z - 0.5, z * (2.5 * z * z - 1.5)]
}

impl Candidate for Empirical {
    fn id(&self) -> &'static str {
        EMPIRICAL
    }

    fn selectors(&self) -> BTreeMap<String, String> {
        BTreeMap::from([("variable".to_owned(), self.name())])
    }

    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }

    fn describes(&self) -> bool {
        true
    }

    fn acts_on_stars(&self) -> bool {
        true
    }

    fn acts_on_attitude(&self) -> bool {
        self.by.is_none() && matches!(self.variable, Variable::Time | Variable::Housekeeping(..))
    }

    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        let mut columns = Columns::new(self, camera, rows, out);
        let by = self.by.as_ref();
        let by = by.map(|(by, scale)| (by.values(rows), scale));
        let values = self.variable.values(rows);
        let [waves, other_waves] = match self.variable {
            Variable::Phase(axis) => [rows.pixel_waves(camera, axis), Cow::default()],
            Variable::PhaseProduct => [0, 1].map(|axis| rows.pixel_waves(camera, axis)),
            _ => Default::default(),
        };
        for i in 0..rows.len() {
            let times = by.as_ref().map_or(1.0, |(by, scale)| scale.of(by[i]));
            let row = columns.row(i, times);
            match &self.variable {
                Variable::Position(_) => row.position(self.scale.of(values[i])),
                Variable::Phase(axis) => row.phase(*axis, &waves[i]),
                Variable::PhaseProduct => row.phases(&waves[i], &other_waves[i]),
                Variable::Window => row.window([
                    self.scale.of(rows.x_px[i] - rows.window_px[0][i]),
                    self.scale.of(rows.y_px[i] - rows.window_px[1][i]),
                ]),
                Variable::Rate | Variable::Acceleration => {
                    let motion = if matches!(self.variable, Variable::Rate) {
                        [rows.vx_px_s[i], rows.vy_px_s[i]]
                    } else {
                        [rows.ax_px_s2[i], rows.ay_px_s2[i]]
                    };
                    let Scale { middle, half } = self.scale;
                    row.motion(motion.map(|v| v / half), middle / half);
                }
                Variable::Half(_)
                | Variable::Quarter
                | Variable::Beyond { .. }
                | Variable::Patch { .. }
                | Variable::During { .. } => row.whole(values[i]),
                Variable::Since { .. } => row.scale_since(values[i]),
                Variable::Star(ids) => {
                    row.one_of(ids.iter().position(|&id| id == rows.star_id[i]));
                }
                Variable::Slot(slots) => {
                    row.one_of(slots.iter().position(|&slot| slot == rows.slot[i]));
                }
                Variable::Time => row.number(self.scale.of(values[i]), true),
                _ => row.number(self.scale.of(values[i]), false),
            }
        }
        true
    }

    fn attitude_columns(&self, rows: &AttitudeRows<'_>, out: VectorsMut<'_>) -> bool {
        let n = rows.len();
        assert_eq!(
            out.x.len(),
            self.coefficients.len() * n,
            "one block a coefficient"
        );
        let axes = [out.x, out.y, out.z];
        let rad = 1.0 / focal_plane::ARCSEC_PER_RAD;
        for (a, axis) in axes.into_iter().enumerate() {
            axis.fill(0.0);
            for i in 0..n {
                let z = match &self.variable {
                    Variable::Time => self.scale.of(rows.t_s[i]),
                    Variable::Housekeeping(_, series) => {
                        series.at(rows.t_s[i]).map_or(0.0, |v| self.scale.of(v))
                    }
                    _ => return false,
                };
                for (k, g) in legendre(z)
                    .into_iter()
                    .enumerate()
                    .take(self.coefficients.len() / 3)
                {
                    axis[(3 * k + a) * n + i] = g * rad;
                }
            }
        }
        true
    }

    /// Terms in motion or in single stars predict only where they were fitted: they cannot be declared.
    fn realise(
        &self,
        values: &[f64],
        surroundings: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let of_a_form = self.is_of_a_form();
        if of_a_form
            || matches!(
                self.variable,
                Variable::Half(_)
                    | Variable::Quarter
                    | Variable::Beyond { .. }
                    | Variable::Patch { .. }
                    | Variable::PhaseProduct
                    | Variable::Turning
                    | Variable::During { .. }
                    | Variable::Since { .. }
            )
        {
            return Err(EffectError::WrongType {
                effect: EMPIRICAL,
                name: "variable".to_owned(),
                expected: "a place, a time or a channel, not a half of the detector or of the run, a turn to and fro or a threshold",
            });
        }
        let parameters = effects::empirical_parameters(
            &self.name(),
            !self.stars,
            [
                self.scale.middle,
                if self.scale.varies() {
                    self.scale.half
                } else {
                    1.0
                },
            ],
            self.by.as_ref().map(|(_, by)| [by.middle, by.half]),
            values,
        );
        effects::build(EMPIRICAL, &parameters, surroundings)
    }
}

#[cfg(test)]
mod tests;
