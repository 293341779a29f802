//! What is particular to single pixels and columns: fixed, or switching.
//!
//! ```text
//! S = (1 + prnu n) (1 + a cos(2 pi (x cos p + y sin p)/pitch))      n: normal number of the pixel
//! D = max(0, dark + dsnu n) + warm e (on or off) + hot              e: exponential number of the pixel
//! ```
//!
//! A warm pixel that switches is a two-state Markov process with equal mean times on and off. So that
//! its state at any instant is a function of that instant alone, time is cut into blocks of 32 mean
//! times; each block starts from the stationary distribution and runs on its own numbers.
//!
//! Source: Janesick, Scientific Charge-Coupled Devices (2001), 3.3 (fringing), 4.2 (PRNU), 7.1 (dark
//! current); Hopkins & Hopkinson, "Random telegraph signals from proton-irradiated CCDs", IEEE Trans.
//! Nucl. Sci. 40 (1993) 1567.

use core::f64::consts::TAU;

use rand_distr::{Distribution, Exp1};
use serde::{Deserialize, Serialize};

use super::Detector;
use crate::ImagerError;
use crate::random::{Key, Use};

/// Mean times in a block of a switching pixel.
const BLOCK: f64 = 32.0;

/// Interference fringes: the sensitivity varies as a wave over the detector.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Fringe {
    /// Relative amplitude.
    pub amplitude: f64,
    /// Distance of crests, px.
    pub pitch_px: f64,
    /// Direction across the crests, from x towards y, deg.
    pub direction_deg: f64,
}

impl Fringe {
    pub(super) fn check(&self) -> Result<(), ImagerError> {
        let a = self.amplitude;
        ImagerError::check(
            "detector.fringe.amplitude",
            a,
            a.abs() < 1.0,
            "between -1 and 1",
        )?;
        ImagerError::positive("detector.fringe.pitch_px", self.pitch_px)?;
        ImagerError::finite("detector.fringe.direction_deg", self.direction_deg)
    }

    /// At the centre of a pixel, px from the first edges.
    fn sensitivity(&self, x: f64, y: f64) -> f64 {
        let (sin, cos) = self.direction_deg.to_radians().sin_cos();
        1.0 + self.amplitude * (TAU * (x * cos + y * sin) / self.pitch_px).cos()
    }
}

/// A single hot pixel.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct HotPixel {
    /// Column, from 0.
    pub column: i32,
    /// Row, from 0.
    pub row: i32,
    /// Dark current beyond that of others, electrons per second.
    pub e_s: f64,
}

impl HotPixel {
    pub(super) fn check(self) -> Result<(), ImagerError> {
        ImagerError::not_negative("detector.hot.e_s", self.e_s)
    }
}

/// The pixels of one detector: of one seed, whatever the draw.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelTraits<'a> {
    detector: &'a Detector,
    sensitivity: Key,
    dark: Key,
    telegraph: Key,
    column: Key,
}

impl<'a> PixelTraits<'a> {
    pub(crate) fn new(detector: &'a Detector, seed: u64) -> Self {
        let key = |purpose| Key::new(seed, 0, purpose);
        Self {
            detector,
            sensitivity: key(Use::Sensitivity),
            dark: key(Use::Dark),
            telegraph: key(Use::Telegraph),
            column: key(Use::Column),
        }
    }

    pub(super) fn sensitivity(&self, column: i32, row: i32) -> f64 {
        let mut s = 1.0;
        if self.detector.prnu > 0.0 {
            s += self.detector.prnu * pixel(self.sensitivity, column, row).normal();
        }
        if let Some(fringe) = &self.detector.fringe {
            s *= fringe.sensitivity(f64::from(column) + 0.5, f64::from(row) + 0.5);
        }
        s.max(0.0)
    }

    pub(super) fn dark_e_s(&self, column: i32, row: i32, t_s: f64) -> f64 {
        let d = self.detector;
        let mut dark = d.dark_e_s;
        if d.dsnu_e_s > 0.0 {
            dark += d.dsnu_e_s * pixel(self.dark, column, row).normal();
        }
        dark = dark.max(0.0);
        if d.warm_share > 0.0 {
            let key = pixel(self.dark, column, row).with(2);
            if key.uniform() < d.warm_share {
                let switches = key.with(1).uniform() < d.telegraph_share;
                if !switches || self.is_on(column, row, t_s) {
                    dark += d.warm_e_s * key.with(2).exponential();
                }
            }
        }
        let hot = d
            .hot
            .iter()
            .filter(|hot| (hot.column, hot.row) == (column, row));
        dark + hot.map(|hot| hot.e_s).sum::<f64>()
    }

    pub(super) fn column_e(&self, column: i32) -> f64 {
        if self.detector.column_e == 0.0 {
            return 0.0;
        }
        self.detector.column_e * self.column.with(index(column)).normal()
    }

    fn is_on(&self, column: i32, row: i32, t_s: f64) -> bool {
        let mean_s = self.detector.telegraph_s;
        let block = (t_s / (BLOCK * mean_s)).floor();
        // to_bits: any two blocks differ
        let key = pixel(self.telegraph, column, row).with(block.to_bits());
        let mut on = key.uniform() < 0.5;
        let mut rng = key.with(1).stream();
        let mut left_s = t_s - block * BLOCK * mean_s;
        loop {
            let stays: f64 = Exp1.sample(&mut rng);
            left_s -= mean_s * stays;
            if left_s < 0.0 {
                return on;
            }
            on = !on;
        }
    }
}

fn pixel(key: Key, column: i32, row: i32) -> Key {
    key.with(index(column)).with(index(row))
}

fn index(k: i32) -> u64 {
    u64::from(k.cast_unsigned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half of the time on, and a change of state over dt with probability (1 - exp(-2 dt/mean))/2;
    /// 4000 pixels, binomial standard error; blocks cost less than 1/32 of that.
    #[test]
    fn a_switching_pixel_is_a_telegraph_signal() {
        let detector = Detector {
            telegraph_s: 50.0,
            ..Detector::default()
        };
        let traits = PixelTraits::new(&detector, 5);
        let n = 4000_i32;
        let state = |k: i32, t: f64| traits.is_on(k, 7, t);
        let on = (0..n).filter(|&k| state(k, 1000.0)).count() as f64 / f64::from(n);
        let changed = (0..n)
            .filter(|&k| state(k, 1000.0) != state(k, 1020.0))
            .count();
        let p = 0.5 * (1.0 - (-2.0 * 20.0 / 50.0_f64).exp());
        let error = |p: f64| 5.0 * (p * (1.0 - p) / f64::from(n)).sqrt();
        assert!((on - 0.5).abs() < error(0.5), "{on}");
        let changed = changed as f64 / f64::from(n);
        assert!((changed - p).abs() < error(p), "{changed} against {p}");
    }

    /// The traits of a pixel stay with it, and their spread is the one asked for.
    #[test]
    fn spreads_are_those_asked_for() {
        let detector = Detector {
            prnu: 0.01,
            dark_e_s: 1000.0,
            dsnu_e_s: 30.0,
            column_e: 4.0,
            ..Detector::default()
        };
        let traits = PixelTraits::new(&detector, 5);
        let n = 40_000_i32;
        let spread = |f: &dyn Fn(i32) -> f64| {
            let mean = (0..n).map(f).sum::<f64>() / f64::from(n);
            (
                mean,
                ((0..n).map(|k| (f(k) - mean).powi(2)).sum::<f64>() / f64::from(n)).sqrt(),
            )
        };
        let off = 5.0 / (2.0 * f64::from(n)).sqrt();
        let (mean, rms) = spread(&|k| traits.sensitivity(k % 200, k / 200));
        assert!(
            (mean - 1.0).abs() < 1e-3 && (rms / 0.01 - 1.0).abs() < off,
            "{mean} {rms}"
        );
        let (_, rms) = spread(&|k| traits.dark_e_s(k % 200, k / 200, 0.0));
        assert!((rms / 30.0 - 1.0).abs() < off, "{rms}");
        let (_, rms) = spread(&|k| traits.column_e(k));
        assert!((rms / 4.0 - 1.0).abs() < off, "{rms}");
        assert!((traits.sensitivity(3, 4) - traits.sensitivity(3, 4)).abs() == 0.0);
    }
}
