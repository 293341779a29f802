//! The likelihood over the plane of `ln tau` and noise ratio, and its maximum.
//!
//! A coarse net over the whole plane finds where to start; Newton's method climbs from there on
//! differences, with a search along each step, since a ridge can be narrow, oblique and curved.
//!
//! Source: Levenberg, Quart. Appl. Math. 2 (1944) 164, for the damping; docs/fogm-fit.md.

mod column;
mod region;

use super::likelihood::{LANES, Likelihood, Logs, Place, logs_of};
pub(crate) use region::{Range, Region, region};

/// The part of the plane that is searched.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    pub(crate) x: [f64; 2],
    pub(crate) u: [f64; 2],
    pub(crate) dt_s: f64,
    pub(crate) span_s: f64,
}

impl Plane {
    /// The plane of a series of `span_s` at steps of `dt_s`: its edges are beyond what any such
    /// series could tell from zero or infinity.
    pub(crate) fn new(dt_s: f64, span_s: f64) -> Self {
        let n = span_s / dt_s;
        Self {
            x: [(dt_s / 15.0).ln(), (50.0 * span_s).ln()],
            // white noise alone: even a random walk adds less than 1e-3 of its own scatter
            u: [-0.5 * (1e3 * n * n * n).ln(), 0.5 * (1e4 * n.sqrt()).ln()],
            dt_s,
            span_s,
        }
    }

    fn clip(&self, place: Place) -> Place {
        Place {
            x: place.x.clamp(self.x[0], self.x[1]),
            u: place.u.clamp(self.u[0], self.u[1]),
        }
    }
}

/// The best place found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Best {
    pub(crate) place: Place,
    pub(crate) ln_l: f64,
    pub(crate) ln_v: f64,
}

fn best_of(places: &[Place; LANES], values: &[(f64, f64); LANES]) -> Best {
    let mut best = 0;
    for l in 1..LANES {
        // NaN loses
        if values[l].0 > values[best].0 || values[best].0.is_nan() {
            best = l;
        }
    }
    Best {
        place: places[best],
        ln_l: values[best].0,
        ln_v: values[best].1,
    }
}

/// Local maxima of a coarse net over the whole plane, best first.
pub(crate) fn survey<L: Likelihood>(likelihood: &L, plane: &Plane, keep: usize) -> Vec<Place> {
    const NX: usize = 24;
    const NU: usize = 24;
    let at = |range: [f64; 2], k: usize, n: usize| {
        range[0] + (range[1] - range[0]) * (k as f64 + 0.5) / n as f64
    };
    let mut net = vec![f64::NEG_INFINITY; NX * NU];
    let place = |k: usize| Place {
        x: at(plane.x, k / NU, NX),
        u: at(plane.u, k % NU, NU),
    };
    for from in (0..NX * NU).step_by(LANES) {
        let places = std::array::from_fn(|l| place(from + l));
        for (l, (ln_l, _)) in likelihood.profile(&places).iter().enumerate() {
            net[from + l] = *ln_l;
        }
    }
    let mut peaks: Vec<usize> = (0..NX * NU)
        .filter(|k| {
            let (i, j) = (k / NU, k % NU);
            (i.saturating_sub(1)..=(i + 1).min(NX - 1)).all(|m| {
                (j.saturating_sub(1)..=(j + 1).min(NU - 1)).all(|o| net[m * NU + o] <= net[*k])
            })
        })
        .collect();
    peaks.sort_by(|a, b| net[*b].total_cmp(&net[*a]));
    peaks.truncate(keep);
    peaks.into_iter().map(place).collect()
}

/// Newton's method on a stencil, with a search along each step; damped where the surface is not
/// curved down.
pub(crate) fn climb<L: Likelihood>(likelihood: &L, plane: &Plane, from: Place) -> Best {
    let start = plane.clip(from);
    let mut best = best_of(&[start; LANES], &likelihood.profile(&[start; LANES]));
    let mut h = [0.2, 0.2];
    for _ in 0..40 {
        let Place { x, u } = best.place;
        let places = [
            (0.0, 0.0),
            (h[0], 0.0),
            (-h[0], 0.0),
            (0.0, h[1]),
            (0.0, -h[1]),
            (h[0], h[1]),
            (-h[0], -h[1]),
            (0.0, 0.0),
        ]
        .map(|(dx, du)| Place {
            x: x + dx,
            u: u + du,
        });
        let f = likelihood.profile(&places).map(|v| v.0);
        let gradient = [(f[1] - f[2]) / (2.0 * h[0]), (f[3] - f[4]) / (2.0 * h[1])];
        let xx = (f[1] + f[2] - 2.0 * f[0]) / (h[0] * h[0]);
        let uu = (f[3] + f[4] - 2.0 * f[0]) / (h[1] * h[1]);
        let xu = (f[5] + f[6] - f[1] - f[2] - f[3] - f[4] + 2.0 * f[0]) / (2.0 * h[0] * h[1]);
        let step = downhill(gradient, [-xx, -xu, -uu]);
        let trial: [Place; LANES] = [4.0, 2.0, 1.4, 1.0, 0.6, 0.3, 0.08, 0.01].map(|t| {
            plane.clip(Place {
                x: x + t * step[0],
                u: u + t * step[1],
            })
        });
        let next = best_of(&trial, &likelihood.profile(&trial));
        let gained = next.ln_l - best.ln_l;
        let fine = [(-xx).max(1e-4).sqrt(), (-uu).max(1e-4).sqrt()].map(|c| 0.05 / c);
        let done = h[0] <= 2.0 * fine[0].min(0.2) && h[1] <= 2.0 * fine[1].min(0.2);
        if gained > 0.0 {
            best = next;
        }
        h = [fine[0].min(0.2), fine[1].min(0.2)];
        if done && (gained.is_nan() || gained < 1e-6) {
            break;
        }
    }
    best
}

/// The step of Newton's method for curvature `[xx, xu, uu]`, its eigenvalues made positive, its
/// length bounded.
fn downhill(gradient: [f64; 2], [xx, xu, uu]: [f64; 3]) -> [f64; 2] {
    let (mean, half) = (0.5 * (xx + uu), 0.5 * (xx - uu));
    let radius = half.hypot(xu);
    let angle = 0.5 * xu.atan2(half);
    let mut step = [0.0; 2];
    for (value, axis) in [
        (mean + radius, [angle.cos(), angle.sin()]),
        (mean - radius, [-angle.sin(), angle.cos()]),
    ] {
        let along = gradient[0] * axis[0] + gradient[1] * axis[1];
        let length = (along / value.abs().max(1e-3)).clamp(-1.5, 1.5);
        step[0] += length * axis[0];
        step[1] += length * axis[1];
    }
    step
}

/// The parameters at the best place, as logarithms.
pub(crate) fn logs_at(best: Best, plane: &Plane) -> Logs {
    logs_of(best.place, best.ln_v, plane.dt_s)
}

/// The best of FOGM alone: along the edge of the plane where white noise vanishes.
pub(crate) fn fogm_alone<L: Likelihood>(likelihood: &L, plane: &Plane) -> Best {
    let edge = |centre: f64, width: f64| -> [Place; LANES] {
        std::array::from_fn(|l| {
            plane.clip(Place {
                x: centre + width * (l as f64 - 3.5) / 3.5,
                u: plane.u[1],
            })
        })
    };
    let half = 0.5 * (plane.x[1] - plane.x[0]);
    let mut width = half;
    let places = edge(plane.x[0] + half, width);
    let mut best = best_of(&places, &likelihood.profile(&places));
    while width > 3e-3 {
        width /= 2.5;
        let places = edge(best.place.x, width);
        let next = best_of(&places, &likelihood.profile(&places));
        if next.ln_l > best.ln_l {
            best = next;
        }
    }
    best
}
