//! Holds the two sides of an effect against each other: the full model with the effect, and its columns.
//!
//! ```text
//! e(c) = | forward(c) - forward(0) - sum c_j column_j |   over all rows
//! ```
//!
//! Columns that are the derivative of the forward action leave only its second order: halving c
//! quarters e. A column that is wrong by any share halves e instead, so the gate
//! `e(c/2) < 0.3 e(c) + rounding` needs no tolerance to be chosen. Where the action is linear both are
//! rounding: positions of up to 512 px, a dozen operations each, stay within 1e-11 px.
//!
//! Source: Taylor's theorem.

use std::collections::BTreeMap;

use focal_plane::{
    AttitudeSource, Camera, PointsMut, Series, Vectors, VectorsMut, rotation_from_vector,
    rotation_vector,
};
use nalgebra::{UnitQuaternion, Vector3};
use star_tracker::{Measured, NoiseStreams, Pbm, Rows, Scratch};

use crate::{
    AttitudeRows, Candidate, FrameGeometry, Parameters, Scene, StarFacts, StarRows, Surroundings,
    WarmPixels,
};

/// Rounding of a position, px.
pub(crate) const ROUNDING_PX: f64 = 1e-10;

/// A motion with rates of up to 0.4 deg/s that never repeats: three sinusoids turning one after another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sway {
    /// Amplitude of the sway, rad.
    pub(crate) amplitude: f64,
}

impl AttitudeSource for Sway {
    fn attitude(&self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        let a = self.amplitude;
        let x = rotation_from_vector(&Vector3::new(a * (0.11 * t_s).sin(), 0.0, 0.0));
        let y = rotation_from_vector(&Vector3::new(0.0, a * (0.07 * t_s + 1.0).sin(), 0.0));
        let z = rotation_from_vector(&Vector3::new(0.0, 0.0, a * (0.05 * t_s + 2.0).sin()));
        Some(x * y * z * rotation_from_vector(&Vector3::new(0.4, -1.1, 0.3)))
    }
    /// Central difference of 1 ms: third derivatives of 1e-3 a rad/s^3 leave 1e-10 a rad/s.
    fn rate_rad_s(&self, t_s: f64) -> Option<Vector3<f64>> {
        let (before, after) = (self.attitude(t_s - 5e-4)?, self.attitude(t_s + 5e-4)?);
        Some(-rotation_vector(&after, &before) / 1e-3)
    }
    fn span_s(&self) -> [f64; 2] {
        [-1e9, 1e9]
    }
}

/// Stars, channels and times of the comparisons.
#[derive(Debug)]
pub(crate) struct Bench {
    pub(crate) camera: Camera,
    pub(crate) truth: Sway,
    pub(crate) channels: BTreeMap<String, Series>,
    pub(crate) frames: Option<FrameGeometry>,
    t_s: Vec<f64>,
    first_row: Vec<usize>,
    slot: Vec<i32>,
    star_id: Vec<i64>,
    mag: Vec<f64>,
    bv: Vec<f64>,
    u: [Vec<f64>; 3],
    facts: Vec<StarFacts>,
}

const STARS: u32 = 12;
const FRAMES: u32 = 60;

impl Bench {
    /// Twelve stars, symmetric about the boresight's mean place, for two minutes.
    pub(crate) fn new() -> Self {
        Self::with(Sway { amplitude: 0.05 })
    }

    pub(crate) fn with(truth: Sway) -> Self {
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let base = truth.attitude(0.0).unwrap();
        let mut bench = Self {
            camera,
            truth,
            channels: channels(),
            frames: None,
            t_s: (0..FRAMES).map(|k| 2.0 * f64::from(k) + 0.37).collect(),
            first_row: vec![0],
            slot: Vec::new(),
            star_id: Vec::new(),
            mag: Vec::new(),
            bv: Vec::new(),
            u: Default::default(),
            facts: Vec::new(),
        };
        let stars: Vec<(StarFacts, Vector3<f64>)> = (0..STARS)
            .map(|s| {
                let (sin, cos) = (2.4 * f64::from(s)).sin_cos();
                let radius = 0.03 + 0.008 * f64::from(s);
                let facts = StarFacts {
                    star_id: 100 + i64::from(s),
                    mag: 2.0 + 0.3 * f64::from(s),
                    bv: -0.2 + 0.15 * f64::from(s),
                    remarkable: 0.0,
                };
                (
                    facts,
                    base.inverse() * Vector3::new(radius * cos, radius * sin, 1.0).normalize(),
                )
            })
            .collect();
        bench.facts = stars.iter().map(|(facts, _)| *facts).collect();
        for _ in 0..FRAMES {
            for (slot, (facts, u)) in (0..).zip(&stars) {
                bench.slot.push(slot);
                bench.star_id.push(facts.star_id);
                bench.mag.push(facts.mag);
                bench.bv.push(facts.bv);
                for axis in 0..3 {
                    bench.u[axis].push(u[axis]);
                }
            }
            bench.first_row.push(bench.slot.len());
        }
        bench
    }

    pub(crate) fn surroundings(&self) -> Surroundings<'_> {
        Surroundings {
            camera: &self.camera,
            span_s: [self.t_s[0], self.t_s[self.t_s.len() - 1]],
            channels: &self.channels,
            frames: self.frames,
        }
    }

    pub(crate) fn scene<'s>(&'s self, warm: Option<&'s WarmPixels>) -> Scene<'s> {
        Scene {
            surroundings: self.surroundings(),
            has_stars: true,
            has_catalogue: true,
            has_reference: true,
            has_attitude: true,
            stars: &self.facts,
            exposure_s: Some(0.4),
            step_s: 2.0,
            warm,
        }
    }

    fn rows(&self) -> Rows<'_> {
        Rows {
            t_s: &self.t_s,
            first_row: &self.first_row,
            slot: &self.slot,
            star_id: &self.star_id,
            mag: &self.mag,
            bv: &self.bv,
            direction: Vectors {
                x: &self.u[0],
                y: &self.u[1],
                z: &self.u[2],
            },
        }
    }

    /// Noise-free positions, x then y.
    pub(crate) fn forward(&self, pbm: &Pbm) -> Vec<f64> {
        let n = self.slot.len();
        let mut out = vec![0.0; 2 * n];
        let (x, y) = out.split_at_mut(n);
        let left_out = pbm.positions_into(
            &self.truth,
            self.rows(),
            &mut Scratch::default(),
            PointsMut { x, y },
        );
        assert_eq!(left_out, 0, "every row is inside the span");
        out
    }

    /// Noise-free attitude errors against the truth, rad: all x, all y, all z.
    fn attitude_errors(&self, pbm: &Pbm) -> Vec<f64> {
        let mut measured = Measured::default();
        let mut streams = NoiseStreams::new(1, 0);
        pbm.measure_into(
            &self.truth,
            self.rows(),
            &mut streams,
            &mut Scratch::default(),
            &mut measured,
        );
        let theta: Vec<Vector3<f64>> = (0..self.t_s.len())
            .map(|k| {
                let truth = self.truth.attitude(self.t_s[k]).unwrap();
                rotation_vector(&measured.attitude(k).unwrap(), &truth)
            })
            .collect();
        (0..3)
            .flat_map(|axis| theta.iter().map(move |t| t[axis]))
            .collect()
    }

    /// Measured minus noise-free x of star `slot` in every frame, arcsec.
    pub(crate) fn noise_x_arcsec(&self, pbm: &Pbm, slot: usize, seed: u64) -> Vec<f64> {
        let mut measured = Measured::default();
        let mut streams = NoiseStreams::new(seed, 0);
        pbm.measure_into(
            &self.truth,
            self.rows(),
            &mut streams,
            &mut Scratch::default(),
            &mut measured,
        );
        let scale = self.camera.arcsec_per_px()[0];
        let noise = |row: usize| (measured.x_px[row] - measured.noise_free_x_px[row]) * scale;
        (0..self.t_s.len())
            .map(|k| noise(self.first_row[k] + slot))
            .collect()
    }

    /// Calls `use_rows` with the star rows of the undisturbed model.
    pub(crate) fn with_star_rows<T>(&self, use_rows: impl FnOnce(&StarRows<'_>) -> T) -> T {
        let n = self.slot.len();
        let pbm = Pbm::new(self.camera.clone());
        let at = |shift_s: f64| {
            let moved: Vec<f64> = self.t_s.iter().map(|t| t + shift_s).collect();
            let mut out = vec![0.0; 2 * n];
            let (x, y) = out.split_at_mut(n);
            let rows = Rows {
                t_s: &moved,
                ..self.rows()
            };
            pbm.positions_into(
                &self.truth,
                rows,
                &mut Scratch::default(),
                PointsMut { x, y },
            );
            out
        };
        // differences over 2 h = 2e-3 s: velocity to h^2/6 P''' = 1e-7 px/s, acceleration to
        // rounding / h^2 = 1e-7 px/s^2
        let h = 1e-3;
        let (before, now, after) = (at(-h), at(0.0), at(h));
        let v: Vec<f64> = (0..2 * n)
            .map(|i| (after[i] - before[i]) / (2.0 * h))
            .collect();
        let a: Vec<f64> = (0..2 * n)
            .map(|i| (after[i] - 2.0 * now[i] + before[i]) / (h * h))
            .collect();
        let t_s: Vec<f64> = (0..n).map(|row| self.t_s[row / STARS as usize]).collect();
        let unknown = vec![f64::NAN; n];
        use_rows(&StarRows {
            t_s: &t_s,
            x_px: &now[..n],
            y_px: &now[n..],
            landed_px: [&now[..n], &now[n..]],
            landed_variance_px2: [&vec![0.0; n], &vec![0.0; n]],
            vx_px_s: &v[..n],
            vy_px_s: &v[n..],
            ax_px_s2: &a[..n],
            ay_px_s2: &a[n..],
            mag: &self.mag,
            bv: &self.bv,
            log_flux: &unknown,
            log_flux_change: &unknown,
            window_px: [&unknown, &unknown],
            slot: &self.slot,
            star_id: &self.star_id,
            waves: None,
            attitude: Some(&self.truth),
        })
    }

    /// `sum c_j column_j` over the star rows, x then y, px.
    fn predicted(&self, candidate: &dyn Candidate, values: &[f64]) -> Vec<f64> {
        self.with_star_rows(|rows| {
            let n = rows.len();
            let mut x = vec![f64::NAN; n * values.len()];
            let mut y = x.clone();
            let out = PointsMut {
                x: &mut x,
                y: &mut y,
            };
            assert!(
                candidate.star_columns(&self.camera, rows, out),
                "it acts on stars"
            );
            let sum = |columns: &[f64], i: usize| -> f64 {
                values
                    .iter()
                    .enumerate()
                    .map(|(j, c)| c * columns[j * n + i])
                    .sum()
            };
            (0..n)
                .map(|i| sum(&x, i))
                .chain((0..n).map(|i| sum(&y, i)))
                .collect()
        })
    }

    /// The model with the effect of these coefficients.
    pub(crate) fn disturbed(&self, candidate: &dyn Candidate, values: &[f64]) -> Pbm {
        let effect = candidate.realise(values, &self.surroundings()).unwrap();
        Pbm::new(self.camera.clone()).with_disturbance(effect as Box<dyn star_tracker::Disturbance>)
    }

    /// Largest shift, and largest part of it that the columns do not tell, px.
    fn star_error(&self, candidate: &dyn Candidate, values: &[f64]) -> [f64; 2] {
        let without = self.forward(&Pbm::new(self.camera.clone()));
        let with = self.forward(&self.disturbed(candidate, values));
        let told = self.predicted(candidate, values);
        let shift = largest(with.iter().zip(&without).map(|(a, b)| a - b));
        let left = (0..told.len()).map(|i| with[i] - without[i] - told[i]);
        [shift, largest(left)]
    }

    /// Columns are the derivative of the forward action at zero (see the header), and tell at least 90 %
    /// of the shift at these values.
    pub(crate) fn stars_agree(&self, candidate: &dyn Candidate, values: &[f64]) {
        let [shift, left] = self.star_error(candidate, values);
        let half: Vec<f64> = values.iter().map(|v| 0.5 * v).collect();
        let [_, left_half] = self.star_error(candidate, &half);
        assert!(
            shift > 1e3 * ROUNDING_PX,
            "{candidate:?} moves nothing: {shift} px"
        );
        assert!(
            left < 0.1 * shift,
            "{candidate:?}: {left} of {shift} px are left"
        );
        assert!(
            left_half < 0.3 * left + ROUNDING_PX,
            "{candidate:?}: {left} px left at full and {left_half} px at half size"
        );
    }

    /// Columns refined at these values tell the shift exactly, but for `tolerance_px`.
    pub(crate) fn stars_agree_refined(
        &self,
        candidate: &dyn Candidate,
        values: &[f64],
        tolerance_px: f64,
    ) {
        let refined = candidate.refined(values).expect("it can be refined");
        let [shift, left] = self.star_error(refined.as_ref(), values);
        assert!(
            shift > 100.0 * tolerance_px,
            "{candidate:?} moves {shift} px only"
        );
        assert!(
            left < tolerance_px,
            "{candidate:?}: {left} of {shift} px are left"
        );
    }

    /// Largest attitude error that the effect makes in the full model, and largest part of it that
    /// the attitude columns do not tell, rad.
    pub(crate) fn attitude_error(&self, candidate: &dyn Candidate, values: &[f64]) -> [f64; 2] {
        let n = self.t_s.len();
        let rates: Vec<Vector3<f64>> = self
            .t_s
            .iter()
            .map(|&t| self.truth.rate_rad_s(t).unwrap())
            .collect();
        let w: Vec<Vec<f64>> = (0..3)
            .map(|a| rates.iter().map(|r| r[a]).collect())
            .collect();
        let rows = AttitudeRows {
            t_s: &self.t_s,
            wx_rad_s: &w[0],
            wy_rad_s: &w[1],
            wz_rad_s: &w[2],
            attitude: Some(&self.truth),
        };
        let mut columns = [0, 1, 2].map(|_| vec![f64::NAN; n * values.len()]);
        let [x, y, z] = &mut columns;
        assert!(
            candidate.attitude_columns(&rows, VectorsMut { x, y, z }),
            "it acts on the attitude"
        );
        let got = self.attitude_errors(&self.disturbed(candidate, values));
        let told = |axis: usize, i: usize| -> f64 {
            values
                .iter()
                .enumerate()
                .map(|(j, c)| c * columns[axis][j * n + i])
                .sum()
        };
        let left = (0..3 * n).map(|i| got[i] - told(i / n, i % n));
        [largest(got.iter().copied()), largest(left)]
    }
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most, v| {
        if v.is_nan() {
            f64::NAN
        } else {
            f64::max(most, v.abs())
        }
    })
}

/// A temperature, a switch and a velocity (inertial, km/s) over the bench's two minutes.
fn channels() -> BTreeMap<String, Series> {
    let t: Vec<f64> = (0..140).map(f64::from).collect();
    let series =
        |f: &dyn Fn(f64) -> f64| Series::new(t.clone(), t.iter().map(|&t| f(t)).collect()).unwrap();
    BTreeMap::from([
        (
            "ccd_temp_c".to_owned(),
            series(&|t| -9.0 + 2.0 * (0.05 * t).sin() + 0.01 * t),
        ),
        (
            "heater_on".to_owned(),
            series(&|t| if t.rem_euclid(40.0) < 15.0 { 1.0 } else { 0.0 }),
        ),
        (
            "vx_km_s".to_owned(),
            series(&|t| 20.0 + 5.0 * (0.06 * t).cos()),
        ),
        (
            "vy_km_s".to_owned(),
            series(&|t| -15.0 + 5.0 * (0.06 * t).sin()),
        ),
        ("vz_km_s".to_owned(), series(&|t| 7.0 - 0.02 * t)),
        (
            "bus_voltage".to_owned(),
            series(&|t| 28.0 + 0.1 * (0.3 * t).sin()),
        ),
    ])
}

/// Parameters of an effect as a model file would hold them: numbers and selectors.
pub(crate) fn as_given(effect: &dyn crate::Effect) -> Parameters {
    let mut all = Parameters::new();
    for parameter in effect.parameters() {
        all.insert(parameter.name, parameter.value.into());
    }
    for (name, value) in effect.selectors() {
        all.insert(name, value.into());
    }
    all
}
