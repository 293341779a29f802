//! Terms in one variable, without a physical cause: what a leftover follows.
//!
//! For a variable v the residual field is expanded in what a smooth dependence
//! on it could do. On the detector a scalar drives four simple fields,
//!
//! ```text
//! (g, 0)   (0, g)   (-y g, x g)   (x g, y g)      g = P_1(v), P_2(v), ..., v scaled to -1..1
//! ```
//!
//! a shift along each axis, a roll and a scale; on an attitude it drives each
//! axis. Motion drives the field it points along, and a pixel phase its own axis
//! by its first two harmonics. Such a term predicts; it never explains.
//!
//! Source: ordinary least squares on Legendre polynomials; the fields are the
//! first-order terms of a similarity transformation of the image.

use std::collections::BTreeMap;

use effects::{AttitudeRows, Candidate, Coefficient, Effect, EffectError, StarRows, Surroundings};
use focal_plane::{Camera, PointsMut, Series, VectorsMut};

/// Id under which empirical terms are listed.
pub(crate) const EMPIRICAL: &str = "empirical";

/// Orders of the polynomial in a smooth variable.
const ORDERS: usize = 3;

/// A variable that a leftover may follow.
#[derive(Clone, Debug)]
pub(crate) enum Variable {
    /// Detector position along one axis (0 = x).
    Position(usize),
    /// Pixel phase along one axis.
    Phase(usize),
    Time,
    /// Velocity of the image.
    Rate,
    /// Acceleration of the image.
    Acceleration,
    Magnitude,
    Colour,
    /// One constant shift a star.
    Star(Vec<i64>),
    /// A housekeeping channel.
    Housekeeping(String, Series),
}

impl Variable {
    /// The name in `unattributed.depends_on`.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Position(0) => "x_px".into(),
            Self::Position(_) => "y_px".into(),
            Self::Phase(0) => "pixel_phase_x".into(),
            Self::Phase(_) => "pixel_phase_y".into(),
            Self::Time => "time".into(),
            Self::Rate => "rate".into(),
            Self::Acceleration => "acceleration".into(),
            Self::Magnitude => "mag".into(),
            Self::Colour => "colour".into(),
            Self::Star(_) => "star".into(),
            Self::Housekeeping(channel, _) => format!("housekeeping:{channel}"),
        }
    }
}

/// One variable as columns.
#[derive(Clone, Debug)]
pub(crate) struct Empirical {
    variable: Variable,
    /// Middle and half range of the variable: scales it to -1..1.
    middle: f64,
    half: f64,
    /// Whether it moves stars, or attitudes.
    stars: bool,
    coefficients: Vec<Coefficient>,
}

impl Empirical {
    /// Columns in `variable`, which runs over `range` in the data.
    pub(crate) fn new(variable: Variable, range: [f64; 2], stars: bool) -> Option<Self> {
        let half = 0.5 * (range[1] - range[0]);
        let smooth = !matches!(variable, Variable::Star(_) | Variable::Phase(_));
        if smooth && (half.is_nan() || half <= 0.0) {
            return None;
        }
        let count = match &variable {
            Variable::Star(ids) => 2 * ids.len(),
            Variable::Phase(_) => 4,
            Variable::Position(_) => 2 * ORDERS,
            // A polynomial in time is only good outside its fold if it is straight.
            Variable::Time if stars => 4,
            Variable::Time => 3,
            Variable::Rate | Variable::Acceleration => 4,
            _ if stars => 4 * orders(&variable),
            _ => 3 * orders(&variable),
        };
        let coefficients = (0..count)
            .map(|k| Coefficient::new(format!("c{k}"), "arcsec", f64::INFINITY))
            .collect();
        Some(Self {
            variable,
            stars,
            middle: 0.5 * (range[0] + range[1]),
            half,
            coefficients,
        })
    }

    fn scaled(&self, value: f64) -> f64 {
        let z = (value - self.middle) / self.half;
        if z.is_finite() { z } else { 0.0 }
    }
}

/// Orders that a variable can tell apart: a switch has two values, and all its polynomials are one.
fn orders(variable: &Variable) -> usize {
    let Variable::Housekeeping(_, series) = variable else {
        return ORDERS;
    };
    let mut known: Vec<f64> = Vec::new();
    for value in series.value().iter().filter(|v| v.is_finite()) {
        if known.iter().all(|k| k.to_bits() != value.to_bits()) {
            known.push(*value);
        }
        if known.len() > ORDERS {
            break;
        }
    }
    known.len().saturating_sub(1).clamp(1, ORDERS)
}

/// Legendre polynomials `P_1`..`P_3`.
fn legendre(z: f64) -> [f64; ORDERS] {
    [z, 1.5 * z * z - 0.5, z * (2.5 * z * z - 1.5)]
}

impl Candidate for Empirical {
    fn id(&self) -> &'static str {
        EMPIRICAL
    }

    fn selectors(&self) -> BTreeMap<String, String> {
        BTreeMap::from([("variable".to_owned(), self.variable.name())])
    }

    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }

    fn acts_on_stars(&self) -> bool {
        true
    }

    fn acts_on_attitude(&self) -> bool {
        matches!(self.variable, Variable::Time | Variable::Housekeeping(..))
    }

    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        let n = rows.len();
        assert_eq!(
            out.x.len(),
            self.coefficients.len() * n,
            "one block a coefficient"
        );
        out.x.fill(0.0);
        out.y.fill(0.0);
        let per_arcsec = camera.arcsec_per_px().map(|s| 1.0 / s);
        let half = camera.half_size_px();
        // of a time, which the rows of a frame share
        let mut of_frame = [0.0; ORDERS];
        for i in 0..n {
            if i == 0 || rows.t_s[i].to_bits() != rows.t_s[i - 1].to_bits() {
                let t_s = rows.t_s[i];
                of_frame = match &self.variable {
                    Variable::Time => legendre(self.scaled(t_s)),
                    Variable::Housekeeping(_, series) => {
                        legendre(series.at(t_s).map_or(0.0, |v| self.scaled(v)))
                    }
                    _ => of_frame,
                };
            }
            let mut put = |k: usize, dx: f64, dy: f64| {
                out.x[k * n + i] = dx * per_arcsec[0];
                out.y[k * n + i] = dy * per_arcsec[1];
            };
            let (x, y) = (rows.x_px[i] / half[0], rows.y_px[i] / half[1]);
            let orders = self.coefficients.len() / 4;
            let mut fields = |g: [f64; ORDERS]| {
                for (k, g) in g.into_iter().enumerate().take(orders) {
                    put(4 * k, g, 0.0);
                    put(4 * k + 1, 0.0, g);
                    put(4 * k + 2, -y * g, x * g);
                    put(4 * k + 3, x * g, y * g);
                }
            };
            match &self.variable {
                Variable::Time | Variable::Housekeeping(..) => fields(of_frame),
                Variable::Magnitude => fields(legendre(self.scaled(rows.mag[i]))),
                Variable::Colour => fields(legendre(self.scaled(rows.bv[i]))),
                Variable::Position(axis) => {
                    let p = if *axis == 0 {
                        rows.x_px[i]
                    } else {
                        rows.y_px[i]
                    };
                    for (k, g) in legendre(self.scaled(p)).into_iter().enumerate() {
                        put(2 * k, g, 0.0);
                        put(2 * k + 1, 0.0, g);
                    }
                }
                Variable::Phase(axis) => {
                    let p = if *axis == 0 {
                        rows.x_px[i]
                    } else {
                        rows.y_px[i]
                    };
                    let (sin, cos) = camera.phase_rad(p).sin_cos();
                    for (k, g) in [sin, cos, 2.0 * sin * cos, 1.0 - 2.0 * sin * sin]
                        .into_iter()
                        .enumerate()
                    {
                        if *axis == 0 {
                            put(k, g, 0.0);
                        } else {
                            put(k, 0.0, g);
                        }
                    }
                }
                Variable::Rate | Variable::Acceleration => {
                    let (a, b) = if matches!(self.variable, Variable::Rate) {
                        (rows.vx_px_s[i], rows.vy_px_s[i])
                    } else {
                        (rows.ax_px_s2[i], rows.ay_px_s2[i])
                    };
                    let (a, b) = (a / self.half, b / self.half);
                    put(0, a, b);
                    put(1, -b, a);
                    put(2, y * a, y * b);
                    put(3, x * a, x * b);
                }
                Variable::Star(ids) => {
                    if let Some(k) = ids.iter().position(|&id| id == rows.star_id[i]) {
                        put(2 * k, 1.0, 0.0);
                        put(2 * k + 1, 0.0, 1.0);
                    }
                }
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
        for axis in &axes {
            debug_assert_eq!(axis.len(), self.coefficients.len() * n);
        }
        let rad = 1.0 / focal_plane::ARCSEC_PER_RAD;
        for (a, axis) in axes.into_iter().enumerate() {
            axis.fill(0.0);
            for i in 0..n {
                let z = match &self.variable {
                    Variable::Time => self.scaled(rows.t_s[i]),
                    Variable::Housekeeping(_, series) => {
                        series.at(rows.t_s[i]).map_or(0.0, |v| self.scaled(v))
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
        let parameters = effects::empirical_parameters(
            &self.variable.name(),
            !self.stars,
            [self.middle, if self.half > 0.0 { self.half } else { 1.0 }],
            values,
        );
        effects::build(EMPIRICAL, &parameters, surroundings)
    }
}
