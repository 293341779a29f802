//! What the search needs to know of a likelihood of FOGM plus white noise.
//!
//! ```text
//! q = sigma_HSF^2 (1 - a^2)                 variance that one step adds to the FOGM
//! x = ln tau,   u = ln sqrt(q / sigma_TN^2),   v = q + sigma_TN^2
//!
//! ln L(x, u, v) = -W ln v - A(x, u) - B(x, u) / v
//! ```
//!
//! The scale `v` is thus free of charge: at its best, `v = B/W`. In `(x, u)` the regions where the
//! data cannot tell are at the edges: `u` to minus infinity is white noise alone (whatever `tau`),
//! `u` to infinity FOGM alone, large `x` a random walk, small `x` white noise again.
//!
//! Source: the profile likelihood of a variance, e.g. Harvey, Forecasting, Structural Time Series
//! Models and the Kalman Filter (1989), section 3.4.2.

use crate::density::Step;

/// Points evaluated at once: as many chains as hide the latency of one.
pub(crate) const LANES: usize = 8;

/// A place in the plane of the two parameters that are not scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    /// ln tau, tau in s.
    pub(crate) x: f64,
    /// Half the log of the ratio of driving to white variance.
    pub(crate) u: f64,
}

/// The two numbers of a place.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Value {
    pub(crate) a: f64,
    pub(crate) b: f64,
}

/// The parameters of a place at v = 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Unit {
    pub(crate) step: Step,
    /// q.
    pub(crate) drive: f64,
    /// White variance.
    pub(crate) white: f64,
}

impl Unit {
    pub(crate) fn new(place: Place, dt_s: f64) -> Self {
        let r = (2.0 * place.u).exp();
        Self {
            step: Step::new(dt_s * (-place.x).exp()),
            drive: r / (1.0 + r),
            white: 1.0 / (1.0 + r),
        }
    }

    /// Variance of the FOGM.
    pub(crate) fn fogm(&self) -> f64 {
        self.drive / self.step.one_minus_a2
    }
}

/// True parameters as logarithms: `sigma_HSF`, `tau` in s, `sigma_TN`.
pub(crate) type Logs = [f64; 3];

/// The place and the log of v of given parameters.
pub(crate) fn place_of(logs: Logs, dt_s: f64) -> (Place, f64) {
    let step = Step::new(dt_s * (-logs[1]).exp());
    let drive = 2.0 * logs[0] + step.one_minus_a2.ln();
    let u = 0.5 * drive - logs[2];
    // ln(q + w^2) by the larger of the two
    let (high, low) = (drive.max(2.0 * logs[2]), drive.min(2.0 * logs[2]));
    (Place { x: logs[1], u }, high + (low - high).exp().ln_1p())
}

/// The parameters at a place with the log of v.
pub(crate) fn logs_of(place: Place, ln_v: f64, dt_s: f64) -> Logs {
    let unit = Unit::new(place, dt_s);
    [
        0.5 * (ln_v + unit.fogm().ln()),
        place.x,
        0.5 * (ln_v + unit.white.ln()),
    ]
}

/// A likelihood in the form above.
pub(crate) trait Likelihood {
    /// W.
    fn weight(&self) -> f64;
    /// A and B at each place.
    fn evaluate(&self, places: &[Place; LANES]) -> [Value; LANES];

    /// ln L at the best scale, and the log of that scale.
    fn profile(&self, places: &[Place; LANES]) -> [(f64, f64); LANES] {
        let w = self.weight();
        self.evaluate(places).map(|value| {
            let ln_v = (value.b / w).ln();
            (-(w * ln_v + value.a + w), ln_v)
        })
    }
}
