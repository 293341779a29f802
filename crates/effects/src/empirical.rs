//! Empirical terms: a smooth function of one variable in place of a cause that nobody knows.
//!
//! ```text
//! stars     dP = sum_k c_k field_k(v)   arcsec over arcsec per pixel,   z = (v - middle) / half
//!   smooth  (g, 0)  (0, g)  (-y g, x g)  (x g, y g)        g = P_1(z), P_2(z), P_3(z), x and y over half the detector
//!   x_px    (g, 0)  (0, g)                                 v the position
//!   phase   sin, cos of the pixel phase and of 2 to 6 times it, along its axis, then of it and of twice it, across
//!   two    the first two columns of x_px, y_px or a pixel phase times P_1(z) of the second variable
//! attitude  theta = sum_k c_k g_k(z) about x, then y, then z    arcsec, tracker axes
//! ```
//!
//! It predicts and never explains, so that the catalogue does not list it; a model may declare it.
//! How many coefficients there are is how many are given, as a list or as c0, c1, ...
//!
//! Source: Legendre polynomials; the fields are the first-order terms of a similarity of the image.

use std::collections::BTreeMap;

use focal_plane::{ARCSEC_PER_RAD, Camera, Series};
use nalgebra::Vector3;
use star_tracker::{Disturbance, Stages, StarView};

use crate::parameters::Reader;
use crate::{
    ActsOn, Effect, EffectError, EffectKind, Parameter, ParameterValue, Parameters, Surroundings,
};

const ID: &str = "empirical";
/// Orders of the polynomials.
const ORDERS: usize = 3;
/// Harmonics of a pixel phase along its axis, and across.
const HARMONICS: usize = 6;
const ACROSS: usize = 2;
/// Coefficients of two variables together.
const OF_A_PAIR: usize = 2;
/// Most coefficients: those of a pixel phase.
const MOST: usize = 2 * (HARMONICS + ACROSS);
const NAMES: [&str; MOST] = [
    "c0", "c1", "c2", "c3", "c4", "c5", "c6", "c7", "c8", "c9", "c10", "c11", "c12", "c13", "c14",
    "c15",
];
/// What the names of channels begin with, where they stand for a variable.
pub const CHANNEL: &str = "housekeeping:";

/// The kind; it has no candidates of its own.
#[derive(Debug)]
pub(crate) struct Kind;

#[derive(Clone, Debug)]
enum Variable {
    Position(usize),
    Phase(usize),
    Time,
    Magnitude,
    Colour,
    Channel(String, Series),
}

impl Variable {
    fn read(name: &str, surroundings: &Surroundings<'_>) -> Result<Self, EffectError> {
        Ok(match name {
            "x_px" => Self::Position(0),
            "y_px" => Self::Position(1),
            "pixel_phase_x" => Self::Phase(0),
            "pixel_phase_y" => Self::Phase(1),
            "time" => Self::Time,
            "mag" => Self::Magnitude,
            "colour" => Self::Colour,
            _ => {
                let Some(channel) = name.strip_prefix(CHANNEL) else {
                    return Err(EffectError::WrongType {
                        effect: ID,
                        name: "variable".to_owned(),
                        expected: "x_px, y_px, pixel_phase_x, pixel_phase_y, time, mag, colour or housekeeping:<channel>",
                    });
                };
                let series = surroundings.channels.get(channel);
                let series = series.ok_or_else(|| EffectError::NoChannel {
                    effect: ID,
                    channel: channel.to_owned(),
                })?;
                Self::Channel(channel.to_owned(), series.clone())
            }
        })
    }

    fn name(&self) -> String {
        match self {
            Self::Position(0) => "x_px".to_owned(),
            Self::Position(_) => "y_px".to_owned(),
            Self::Phase(0) => "pixel_phase_x".to_owned(),
            Self::Phase(_) => "pixel_phase_y".to_owned(),
            Self::Time => "time".to_owned(),
            Self::Magnitude => "mag".to_owned(),
            Self::Colour => "colour".to_owned(),
            Self::Channel(channel, _) => format!("{CHANNEL}{channel}"),
        }
    }
}

impl Variable {
    /// Whether it is a place on the detector.
    fn is_place(&self) -> bool {
        matches!(self, Self::Position(_) | Self::Phase(_))
    }

    /// Its value where it is no place; NaN where it is unknown.
    fn value(&self, star: &StarView) -> f64 {
        match self {
            Self::Time => star.t_s,
            Self::Magnitude => star.mag,
            Self::Colour => star.bv,
            Self::Channel(_, series) => series.at(star.t_s).unwrap_or(f64::NAN),
            Self::Position(_) | Self::Phase(_) => f64::NAN,
        }
    }
}

#[derive(Clone, Debug)]
struct Empirical {
    variable: Variable,
    camera: Camera,
    on_attitude: bool,
    middle: f64,
    half: f64,
    /// The second variable with its middle and half range.
    by: Option<(Variable, [f64; 2])>,
    values: Vec<f64>,
}

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "a smooth function of one variable, without a cause"
    }
    fn needs(&self) -> &'static str {
        "the variable that it follows"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            stars: true,
            attitude: true,
            ..ActsOn::default()
        }
    }
    fn build(
        &self,
        parameters: &Parameters,
        surroundings: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let mut known = vec!["variable", "acts_on", "middle", "half", "coefficients"];
        known.extend(["by_middle", "by_half"]);
        known.extend(NAMES);
        let reader = Reader::new(ID, parameters, &known)?;
        let (variable, by) = variables(&reader, surroundings)?;
        let on_attitude = acts_on_attitude(&reader, &variable)?;
        let values = coefficients(&reader)?;
        let most = match (&variable, on_attitude) {
            _ if by.is_some() => OF_A_PAIR,
            (Variable::Phase(_), _) => 2 * (HARMONICS + ACROSS),
            (Variable::Position(_), _) => 2 * ORDERS,
            (_, true) => 3 * ORDERS,
            (_, false) => 4 * ORDERS,
        };
        // of an attitude the coefficients are axis by axis: as many orders each
        let count = values.len();
        if count > most || on_attitude && count % 3 != 0 {
            return Err(EffectError::OutOfRange {
                effect: ID,
                name: "coefficients".to_owned(),
                value: count as f64,
                expected: "a number of coefficients that this variable has",
            });
        }
        let by_scale = [
            reader.number_or("by_middle", 0.0)?,
            positive(&reader, "by_half")?,
        ];
        Ok(Box::new(Empirical {
            variable,
            camera: surroundings.camera.clone(),
            on_attitude,
            middle: reader.number_or("middle", 0.0)?,
            half: positive(&reader, "half")?,
            by: by.map(|by| (by, by_scale)),
            values,
        }))
    }
}

/// The variable, and the one that multiplies it where there are two.
fn variables(
    reader: &Reader<'_>,
    surroundings: &Surroundings<'_>,
) -> Result<(Variable, Option<Variable>), EffectError> {
    let name = reader.text("variable")?;
    let name = name.ok_or(EffectError::MissingParameter {
        effect: ID,
        name: "variable",
    })?;
    let (name, second) = match name.split_once('*') {
        Some((first, second)) => (first, Some(second)),
        None => (name, None),
    };
    let variable = Variable::read(name, surroundings)?;
    let by = second.map(|second| Variable::read(second, surroundings));
    let by = by.transpose()?;
    if by
        .as_ref()
        .is_some_and(|by| !variable.is_place() || by.is_place())
    {
        return Err(EffectError::WrongType {
            effect: ID,
            name: "variable".to_owned(),
            expected: "of two variables first x_px, y_px or a pixel phase, then time, mag, colour or housekeeping:<channel>",
        });
    }
    Ok((variable, by))
}

fn acts_on_attitude(reader: &Reader<'_>, variable: &Variable) -> Result<bool, EffectError> {
    match reader.text("acts_on")? {
        None | Some("stars") => Ok(false),
        Some("attitude") if matches!(variable, Variable::Time | Variable::Channel(..)) => Ok(true),
        Some(_) => Err(EffectError::WrongType {
            effect: ID,
            name: "acts_on".to_owned(),
            expected: "\"stars\", or of time and channels \"attitude\"",
        }),
    }
}

/// A number above zero; 1 where it is not given.
fn positive(reader: &Reader<'_>, name: &'static str) -> Result<f64, EffectError> {
    let value = reader.number_or(name, 1.0)?;
    if value <= 0.0 {
        return Err(EffectError::OutOfRange {
            effect: ID,
            name: name.to_owned(),
            value,
            expected: "positive",
        });
    }
    Ok(value)
}

/// As a list or by their names, up to the last that is given; those between that are not are zero.
fn coefficients(reader: &Reader<'_>) -> Result<Vec<f64>, EffectError> {
    let mut values = Vec::new();
    if let Some(list) = reader.text("coefficients")? {
        reader.exclude("coefficients", NAMES)?;
        for number in list.split(',') {
            let value = number.trim().parse::<f64>().ok().filter(|v| v.is_finite());
            let value = value.ok_or_else(|| EffectError::WrongType {
                effect: ID,
                name: "coefficients".to_owned(),
                expected: "an array of numbers",
            })?;
            values.push(Some(value));
        }
    } else {
        for name in NAMES {
            values.push(reader.number(name)?);
        }
    }
    let given = values.iter().rposition(Option::is_some);
    let last = given.ok_or(EffectError::MissingParameter {
        effect: ID,
        name: "c0",
    })?;
    values.truncate(last + 1);
    Ok(values.into_iter().map(|v| v.unwrap_or(0.0)).collect())
}

impl Empirical {
    /// `P_1`..`P_3` of a value; of the middle where it is unknown.
    fn orders(&self, value: f64) -> [f64; ORDERS] {
        let z = (value - self.middle) / self.half;
        let z = if z.is_finite() { z } else { 0.0 };
        [z, 1.5 * z * z - 0.5, z * (2.5 * z * z - 1.5)]
    }

    fn at_time(&self, t_s: f64) -> [f64; ORDERS] {
        match &self.variable {
            Variable::Channel(_, series) => series
                .at(t_s)
                .map_or_else(|| self.orders(self.middle), |v| self.orders(v)),
            _ => self.orders(t_s),
        }
    }

    fn shift_px(&self, star: &StarView) -> [f64; 2] {
        let half = self.camera.half_size_px();
        let (x, y) = (star.at.x / half[0], star.at.y / half[1]);
        let mut sum = [0.0; 2];
        let times = self.by.as_ref().map_or(1.0, |(by, [middle, half])| {
            let z = (by.value(star) - middle) / half;
            if z.is_finite() { z } else { 0.0 }
        });
        let mut put = |k: usize, dx: f64, dy: f64| {
            if let Some(c) = self.values.get(k) {
                sum[0] += times * c * dx;
                sum[1] += times * c * dy;
            }
        };
        match &self.variable {
            Variable::Position(axis) => {
                let p = [star.at.x, star.at.y][*axis];
                for (k, g) in self.orders(p).into_iter().enumerate() {
                    put(2 * k, g, 0.0);
                    put(2 * k + 1, 0.0, g);
                }
            }
            Variable::Phase(axis) => {
                let phase = self.camera.phase_rad([star.at.x, star.at.y][*axis]);
                let along = [1.0 - *axis as f64, *axis as f64];
                for k in 0..HARMONICS {
                    let (sin, cos) = ((k + 1) as f64 * phase).sin_cos();
                    put(2 * k, sin * along[0], sin * along[1]);
                    put(2 * k + 1, cos * along[0], cos * along[1]);
                    if k < ACROSS {
                        let first = 2 * (HARMONICS + k);
                        put(first, sin * along[1], sin * along[0]);
                        put(first + 1, cos * along[1], cos * along[0]);
                    }
                }
            }
            smooth => {
                let orders = match smooth {
                    Variable::Magnitude => self.orders(star.mag),
                    Variable::Colour => self.orders(star.bv),
                    _ => self.at_time(star.t_s),
                };
                for (k, g) in orders.into_iter().enumerate() {
                    put(4 * k, g, 0.0);
                    put(4 * k + 1, 0.0, g);
                    put(4 * k + 2, -y * g, x * g);
                    put(4 * k + 3, x * g, y * g);
                }
            }
        }
        let scale = self.camera.arcsec_per_px();
        [sum[0] / scale[0], sum[1] / scale[1]]
    }
}

impl Disturbance for Empirical {
    fn stages(&self) -> Stages {
        Stages {
            attitude: self.on_attitude,
            centroid: !self.on_attitude,
            ..Stages::NONE
        }
    }
    fn misalignment_rad(&self, t_s: f64) -> Vector3<f64> {
        if !self.on_attitude {
            return Vector3::zeros();
        }
        let orders = self.at_time(t_s);
        let each = self.values.len() / 3;
        let axis = |a: usize| -> f64 {
            let own = &self.values[a..];
            (0..each).map(|k| own[3 * k] * orders[k]).sum()
        };
        Vector3::new(axis(0), axis(1), axis(2)) / ARCSEC_PER_RAD
    }
    fn centroid_shift_px(&self, star: &StarView) -> [f64; 2] {
        self.shift_px(star)
    }
}

impl Effect for Empirical {
    fn id(&self) -> &'static str {
        ID
    }
    fn parameters(&self) -> Vec<Parameter> {
        let mut all: Vec<Parameter> = NAMES
            .iter()
            .zip(&self.values)
            .map(|(name, &value)| Parameter::new(*name, value, "arcsec"))
            .collect();
        all.push(Parameter::new("middle", self.middle, ""));
        all.push(Parameter::new("half", self.half, ""));
        if let Some((_, [middle, half])) = &self.by {
            all.push(Parameter::new("by_middle", *middle, ""));
            all.push(Parameter::new("by_half", *half, ""));
        }
        all
    }
    fn selectors(&self) -> BTreeMap<String, String> {
        let on = if self.on_attitude {
            "attitude"
        } else {
            "stars"
        };
        BTreeMap::from([
            (
                "variable".to_owned(),
                match &self.by {
                    Some((by, _)) => format!("{}*{}", self.variable.name(), by.name()),
                    None => self.variable.name(),
                },
            ),
            ("acts_on".to_owned(), on.to_owned()),
        ])
    }
}

/// What a term with these coefficients is declared by: middle and half range of its
/// variable, and of the second one.
pub fn empirical_parameters(
    variable: &str,
    on_attitude: bool,
    [middle, half]: [f64; 2],
    by: Option<[f64; 2]>,
    values: &[f64],
) -> Parameters {
    let on = if on_attitude { "attitude" } else { "stars" };
    let mut all = Parameters::from([
        ("variable".to_owned(), ParameterValue::from(variable)),
        ("acts_on".to_owned(), ParameterValue::from(on)),
        ("middle".to_owned(), ParameterValue::from(middle)),
        ("half".to_owned(), ParameterValue::from(half)),
    ]);
    if let Some([middle, half]) = by {
        all.insert("by_middle".to_owned(), ParameterValue::from(middle));
        all.insert("by_half".to_owned(), ParameterValue::from(half));
    }
    for (k, &value) in values.iter().enumerate() {
        all.insert(format!("c{k}"), ParameterValue::from(value));
    }
    all
}
