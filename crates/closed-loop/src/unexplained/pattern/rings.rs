//! A pattern that is round about the boresight: zones of a lens, a ghost of its rim.
//!
//! What is left is split along and across the direction from the boresight, and searched for one wave along the radius,
//!
//! ```text
//! r_a(rho) = c_a cos 2 pi k rho + s_a sin 2 pi k rho      a = outwards, across; rho, phi: radius, px, and angle, turns
//! ```
//!
//! as waves across the detector are ([`super`]): the transform of the residuals on pixels of the radius, the strongest
//! peaks once they have paid for their octave, the exact sums at these, the same three chances. Of waves along one line
//! there are as many as cycles. What power is usual tell spirals,
//!
//! ```text
//! cos 2 pi (k rho + m phi)              m = 2 to 9 turns either way, k as of the ring or a cycle more or less
//! ```
//!
//! which no ring holds.
//!
//! Source: as of [`super`].

use core::f64::consts::TAU;

use block_regression::Folds;
use fourier::Complex;

use super::octaves::{CHANCES, Others};
use super::{Field, LEAST_EXTENT_PX, LEAST_MOTION, Pattern, REFINED, climb, could_show};

/// Bins of the radius in a pixel: waves of up to a quarter of a cycle per pixel.
const BINS: f64 = 0.5;
/// Waves of the transform in a cycle over the extent.
const FINER: usize = 4;
/// Bins of the transform at most: places of a detector keep below it by far, those that an effect of the model moves off it
/// may be anywhere.
const MOST_BINS: usize = 1 << 16;
/// A peak of the transform grows by less than this where it is refined: a quarter of a cycle at most loses
/// 1 - sinc^2(1/4) = 0.19.
const REFINES: f64 = 1.25;
/// Turns of the spirals whose power is usual.
const TURNS: std::ops::RangeInclusive<i32> = 2..=9;

impl Field {
    /// Places become radii and angles, and residuals those outwards and across.
    pub(super) fn round(&mut self) {
        let [outwards, across] = &mut self.residual;
        for rows in &self.stars {
            for row in rows.clone() {
                let (x, y) = (self.x_px[row], self.y_px[row]);
                let radius = x.hypot(y);
                let (c, s) = if radius > 0.0 {
                    (x / radius, y / radius)
                } else {
                    (1.0, 0.0)
                };
                let (rx, ry) = (outwards[row], across[row]);
                (outwards[row], across[row]) = (c * rx + s * ry, c * ry - s * rx);
                (self.x_px[row], self.y_px[row]) = (radius, y.atan2(x) / TAU);
            }
            // a mean along x and y is none outwards
            for axis in [&mut *outwards, &mut *across] {
                let mean = axis[rows.clone()].iter().sum::<f64>() / rows.len() as f64;
                axis[rows.clone()].iter_mut().for_each(|r| *r -= mean);
            }
        }
    }

    /// The ring that is beyond doubt in a field that is [round](Self::round); the distortion has waves of fewer `cycles`
    /// across the detector.
    pub(super) fn ring(
        &self,
        as_left: &dyn Fn() -> Self,
        folds: &Folds,
        cycles: f64,
    ) -> Option<Pattern> {
        let variance = self.variance();
        let [extent, _] = self.extent();
        let none = variance.iter().any(|v| v.is_nan() || *v <= 0.0);
        if none || extent < LEAST_EXTENT_PX {
            return None;
        }
        // across the detector are two radii
        let range = Range {
            extent,
            fewest: 0.5 * cycles,
        };
        let power = |[k, _]: [f64; 2]| {
            let sums = self.sums([k, 0.0]);
            let moves = sums.normal.trace() / self.rows() as f64;
            if range.holds(k) && moves > LEAST_MOTION {
                sums.power(variance)
            } else {
                0.0
            }
        };
        let worth = |peak: &(f64, [f64; 2])| peak.0 - 2.0 * range.trials(peak.1[0]).ln();
        let step = [0.25 / extent, 0.0];
        let better = |a: &(f64, [f64; 2]), b: &(f64, [f64; 2])| worth(a).total_cmp(&worth(b));
        let peaks = self.ring_peaks(variance, range).into_iter();
        let peaks: Vec<_> = peaks.map(|k| (power([k, 0.0]), [k, 0.0])).collect();
        let &(most, k) = peaks.iter().max_by(|a, b| better(a, b))?;
        if !could_show(REFINES * most, range.trials(k[0])) {
            return None;
        }
        let best = peaks
            .into_iter()
            .map(|peak| climb(&power, peak, step, 1))
            .max_by(better)?;
        let (most, wave) = climb(&power, best, step.map(|s| 0.25 * s), 3);
        let trials = range.trials(wave[0]);
        if !range.holds(wave[0]) {
            return None;
        }
        let found = Pattern {
            wave,
            ring: true,
            trials,
            power: most,
            p_value: 1.0,
            explained: 0.0,
            extent: [extent; 2],
        };
        self.beyond_doubt(found, || range.spirals(wave[0]), as_left, folds)
    }

    /// The waves that are worth most, cycles/px.
    fn ring_peaks(&self, variance: [f64; 2], range: Range) -> Vec<f64> {
        let low = self.x_px.iter().copied().fold(f64::INFINITY, f64::min);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "bins from the lowest radius"
        )]
        let bin = |at: f64| (BINS * (at - low)) as usize;
        // of more bins a wave has the phase of those that it turns whole cycles from
        let most = bin(low + range.extent).min(MOST_BINS / FINER - 1);
        let n = (FINER * (most + 1)).next_power_of_two();
        let mut line = vec![Complex::new(0.0, 0.0); n];
        let scale = variance.map(|v| v.sqrt().recip());
        for (rows, weight) in self.stars.iter().zip(&self.weight) {
            for row in rows.clone() {
                let [out, across] = [0, 1].map(|a| weight * self.residual[a][row] * scale[a]);
                line[bin(self.x_px[row]) % n] += Complex::new(out, across);
            }
        }
        fourier::forward(n).process(&mut line);
        let rows = self.weighed_rows();
        let mut peaks: Vec<(f64, f64)> = (1..n / 2)
            .map(|j| {
                let k = BINS * j as f64 / n as f64;
                let power = (line[j].norm_sqr() + line[n - j].norm_sqr()) / rows;
                (power - 2.0 * range.trials(k).ln(), k)
            })
            .filter(|(_, k)| range.holds(*k))
            .collect();
        peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut waves: Vec<f64> = Vec::new();
        for (_, k) in peaks {
            if waves.len() < REFINED && waves.iter().all(|w| (w - k).abs() * range.extent > 0.75) {
                waves.push(k);
            }
        }
        waves
    }
}

/// The waves along the radius that are looked for.
#[derive(Clone, Copy, Debug)]
struct Range {
    /// Of the radii, px.
    extent: f64,
    /// Cycles over it.
    fewest: f64,
}

impl Range {
    fn holds(self, k: f64) -> bool {
        k * self.extent >= self.fewest && k < 0.5 * BINS
    }

    /// Spirals of such a wave.
    fn spirals(self, k: f64) -> Others {
        let waves = TURNS.flat_map(|m| [m, -m]).flat_map(|turns| {
            let cycles = [-1.0, 0.0, 1.0];
            cycles.map(|more| [k + more / self.extent, f64::from(turns)])
        });
        let waves: Vec<[f64; 2]> = waves.collect();
        Others {
            independent: waves.len() as f64,
            waves,
        }
    }

    /// Waves that one of its octave pays for, which share alike.
    fn trials(self, k: f64) -> f64 {
        let octaves = (0.5 * BINS * self.extent / self.fewest)
            .log2()
            .ceil()
            .max(1.0);
        let octave = (k * self.extent / self.fewest).log2().floor();
        let longest = self.fewest * octave.clamp(0.0, octaves - 1.0).exp2();
        (CHANCES * octaves * longest).max(1.0)
    }
}
