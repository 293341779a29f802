//! Pixel phase harmonics: the centroid error is not the declared one.
//!
//! ```text
//! dx = x<k>_amplitude sin(k phi_x + x<k>_phase),    phi = 2 pi frac(P + 0.5 - pixel_centre)
//! ```
//!
//! and the same in y, arcsec at the centre's scale, beside the declared centroid error and evaluated
//! at the same distorted, noise-free position. As regressors the sine and the cosine of each order are
//! two coefficients (amplitude cos phase, amplitude sin phase); amplitude and phase are reported.
//! Where the position is known to a variance v (px^2) only, as from the noisy centroids themselves,
//! the columns are what is to be expected of the waves there, exp(-2 pi^2 k^2 v) of them: without
//! that an amplitude would come out smaller by as much.
//!
//! Source: \[M23\] Eq. 9-11, Step 3, with another periodic function in place of the triangle; the
//! characteristic function of a Gaussian.

use focal_plane::Camera;
use star_tracker::{Stages, StarView};

use crate::parameters::Reader;
use crate::pixel_wave::PixelWave;
use crate::shift::{Shift, ShiftCandidate, Shifted};
use crate::{
    ActsOn, Candidate, Coefficient, Effect, EffectError, EffectKind, Parameter, Parameters, Scene,
    Surroundings,
};

const ID: &str = "pixel_phase_harmonics";

/// Highest order.
const ORDERS: u32 = 4;
/// A wave of 2" on the pixels of \[M23\] (70"), as 1 sigma of what is plausible, px.
const PLAUSIBLE_PX: f64 = 0.03;
/// Largest amplitude of a wave in the pixel phase, px. A spot much smaller than a pixel has its centroid in the
/// pixel's middle: the error is a sawtooth of half a pixel either way, and order k of that is 1/(pi k).
pub const LARGEST_WAVE_PX: f64 = core::f64::consts::FRAC_1_PI;

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "the centroid error has harmonics in the pixel phase beside the declared one"
    }
    fn needs(&self) -> &'static str {
        "stars"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            stars: true,
            ..ActsOn::default()
        }
    }
    fn build(
        &self,
        parameters: &Parameters,
        surroundings: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let all: Vec<String> = (1..=ORDERS).flat_map(names_of).collect();
        let known: Vec<&str> = all.iter().map(String::as_str).collect();
        let reader = Reader::new(ID, parameters, &known)?;
        let mut orders = Vec::new();
        let mut values = Vec::new();
        for k in 1..=ORDERS {
            if !names_of(k).iter().any(|name| reader.has(name)) {
                continue;
            }
            orders.push(k);
            for [amplitude, phase] in names(k) {
                let amplitude = reader.number_or(&amplitude, 0.0)?;
                let (sin, cos) = reader.number_or(&phase, 0.0)?.sin_cos();
                values.extend([amplitude * cos, amplitude * sin]);
            }
        }
        if orders.is_empty() {
            return Err(EffectError::MissingParameter {
                effect: ID,
                name: "x<k>_amplitude_arcsec or y<k>_amplitude_arcsec, k = 1 to 4",
            });
        }
        Ok(Box::new(Shifted::new(
            Phase {
                camera: surroundings.camera.clone(),
                orders,
            },
            values,
        )))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        if !scene.has_stars {
            return Vec::new();
        }
        let camera = scene.surroundings.camera;
        (1..=ORDERS).map(|k| harmonics_of(camera, &[k])).collect()
    }
}

/// Harmonics of these orders (1 to 4) in both axes, of unknown size.
///
/// # Panics
///
/// For an order that does not exist.
pub fn harmonics_of(camera: &Camera, orders: &[u32]) -> Box<dyn Candidate> {
    assert!(
        orders.iter().all(|k| (1..=ORDERS).contains(k)),
        "orders are 1 to {ORDERS}"
    );
    ShiftCandidate::boxed(Phase {
        camera: camera.clone(),
        orders: orders.to_vec(),
    })
}

/// Names of amplitude and phase of order k, per axis.
fn names(k: u32) -> [[String; 2]; 2] {
    ["x", "y"].map(|axis| {
        [
            format!("{axis}{k}_amplitude_arcsec"),
            format!("{axis}{k}_phase_rad"),
        ]
    })
}

fn names_of(k: u32) -> Vec<String> {
    names(k).into_iter().flatten().collect()
}

#[derive(Clone, Debug)]
struct Phase {
    camera: Camera,
    orders: Vec<u32>,
}

impl Phase {
    /// The terms at a position known to these variances.
    fn expected(&self, at_px: [f64; 2], variance_px2: [f64; 2], out: &mut [[f64; 2]]) {
        let [scale_x, scale_y] = self.camera.arcsec_per_px();
        let wave = |axis: usize| {
            let phase_rad = self.camera.phase_rad(at_px[axis]);
            PixelWave::at(phase_rad, variance_px2[axis]).orders()
        };
        let highest = self.orders.iter().max().copied().unwrap_or(0);
        for (order, (x, y)) in (1..=highest).zip(wave(0).zip(wave(1))) {
            let chunks = self.orders.iter().zip(out.chunks_exact_mut(4));
            for (_, terms) in chunks.filter(|(k, _)| **k == order) {
                terms[0] = [x[0] / scale_x, 0.0];
                terms[1] = [x[1] / scale_x, 0.0];
                terms[2] = [0.0, y[0] / scale_y];
                terms[3] = [0.0, y[1] / scale_y];
            }
        }
    }
}

impl Shift for Phase {
    fn id(&self) -> &'static str {
        ID
    }
    fn stages(&self) -> Stages {
        Stages {
            centroid: true,
            ..Stages::NONE
        }
    }
    fn coefficients(&self) -> Vec<Coefficient> {
        let mut all = Vec::new();
        for k in &self.orders {
            for (axis, scale) in ["x", "y"].into_iter().zip(self.camera.arcsec_per_px()) {
                let largest = LARGEST_WAVE_PX * scale;
                for wave in ["sin", "cos"] {
                    let name = format!("{axis}{k}_{wave}_arcsec");
                    let coefficient = Coefficient::new(name, "arcsec", PLAUSIBLE_PX * scale);
                    all.push(coefficient.at_least(-largest).at_most(largest));
                }
            }
        }
        all
    }
    // an order is a part
    fn part(&self) -> Option<u32> {
        match self.orders[..] {
            [order] => Some(order),
            _ => None,
        }
    }
    fn of_parts(&self, parts: &[u32]) -> Option<Self> {
        let orders = parts.to_vec();
        Some(Self {
            orders,
            ..self.clone()
        })
    }
    fn terms(&self, star: &StarView, out: &mut [[f64; 2]]) {
        self.expected([star.at.x, star.at.y], [0.0; 2], out);
    }
    fn expected_terms(&self, star: &StarView, variance_px2: [f64; 2], out: &mut [[f64; 2]]) {
        self.expected([star.at.x, star.at.y], variance_px2, out);
    }
    fn parameters(&self, values: &[f64]) -> Vec<Parameter> {
        let mut all = Vec::new();
        for (&k, four) in self.orders.iter().zip(values.chunks_exact(4)) {
            for ([amplitude, phase], wave) in names(k).into_iter().zip(four.chunks_exact(2)) {
                all.push(Parameter::new(amplitude, wave[0].hypot(wave[1]), "arcsec"));
                all.push(Parameter::new(phase, wave[1].atan2(wave[0]), "rad"));
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use super::*;
    use crate::StarRows;
    use crate::harness::Bench;
    use focal_plane::PointsMut;

    /// Of a wave of order k at a position known to v, exp(-2 pi^2 k^2 v) is to be expected, along each axis by
    /// its own v; what has all but gone counts for nothing.
    #[test]
    fn waves_fade_where_the_position_is_uncertain() {
        let bench = Bench::new();
        let candidate = harmonics_of(&bench.camera, &[1, 2]);
        let columns = |v: [f64; 2]| {
            bench.with_star_rows(|rows| {
                let n = rows.len();
                let variance = v.map(|v| vec![v; n]);
                let rows = StarRows {
                    landed_variance_px2: [&variance[0], &variance[1]],
                    ..*rows
                };
                let (mut x, mut y) = (vec![0.0; 8 * n], vec![0.0; 8 * n]);
                let out = PointsMut {
                    x: &mut x,
                    y: &mut y,
                };
                assert!(candidate.star_columns(&bench.camera, &rows, out));
                [x, y].map(|axis| axis.chunks(n).map(<[f64]>::to_vec).collect::<Vec<_>>())
            })
        };
        let (known, faded) = (columns([0.0; 2]), columns([0.01, 0.07]));
        let left = |k: f64, v: f64| (-2.0 * PI * PI * k * k * v).exp();
        // of the second order along y, exp(-5.5), less than a hundredth is left
        let shares = [[left(1.0, 0.01), left(1.0, 0.07)], [left(2.0, 0.01), 0.0]];
        for (order, shares) in shares.iter().enumerate() {
            for (axis, share) in shares.iter().enumerate() {
                for column in 4 * order..4 * (order + 1) {
                    let both = known[axis][column].iter().zip(&faded[axis][column]);
                    for (plain, got) in both {
                        assert!((got - share * plain).abs() < 1e-15, "{order} {axis}");
                    }
                }
            }
        }
        assert!(known[0][0].iter().any(|v| v.abs() > 1e-3));
    }
}
