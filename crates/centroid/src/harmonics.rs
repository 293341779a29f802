//! A harmonic series in the pixel phase, each axis with its own.
//!
//! ```text
//! c(phi) = sum_k amplitude_k sin(k phi + phase_k),   k = 1, 2, ...
//! ```
//!
//! summed by Clenshaw's recurrence from one sine and one cosine. The triangle of peak p has
//! amplitudes 8 p/pi^2 (1, 0, -1/9, 0, 1/25, ...) at phase 0.
//!
//! Source: generalises [M23] Eq. 10; Clenshaw, Math. Tables Aids Comput. 9 (1955) 118.

use std::f64::consts::PI;

use crate::phase;

/// One term of the series; its order is its place in the list, from 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Harmonic {
    /// Peak of the term, in any unit.
    pub amplitude: f64,
    /// Phase at a pixel edge, rad.
    pub phase_rad: f64,
}

/// Harmonic series of both axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Harmonics {
    terms: [Vec<Harmonic>; 2],
    /// (cosine, sine) coefficients of the same terms.
    waves: [Vec<[f64; 2]>; 2],
}

impl Harmonics {
    /// The series with the terms of order 1, 2, ... of each axis.
    ///
    /// ```
    /// use centroid::{CentroidError, Harmonic, Harmonics};
    /// use focal_plane::Pixel;
    ///
    /// let second = [Harmonic::default(), Harmonic { amplitude: 2.0, phase_rad: 0.0 }];
    /// let error = CentroidError::Harmonics(Harmonics::new(&second, &[]));
    /// let [x, y] = error.error_at(Pixel { x: 0.125, y: 0.125 }, 0.5);
    /// assert!((x - 2.0).abs() < 1e-14 && y == 0.0);
    /// ```
    pub fn new(x: &[Harmonic], y: &[Harmonic]) -> Self {
        let terms = [x.to_vec(), y.to_vec()];
        let waves = [x, y].map(|terms| {
            terms
                .iter()
                .map(|term| {
                    let (sin, cos) = term.phase_rad.sin_cos();
                    [term.amplitude * sin, term.amplitude * cos]
                })
                .collect()
        });
        Self { terms, waves }
    }

    /// The terms of x and of y.
    pub fn terms(&self) -> [&[Harmonic]; 2] {
        [&self.terms[0], &self.terms[1]]
    }

    /// Both axes scaled by their factor.
    #[must_use]
    pub fn scaled(&self, factor: [f64; 2]) -> Self {
        let scale = |axis: usize| -> Vec<Harmonic> {
            self.terms[axis]
                .iter()
                .map(|term| Harmonic {
                    amplitude: term.amplitude * factor[axis],
                    phase_rad: term.phase_rad,
                })
                .collect()
        };
        Self::new(&scale(0), &scale(1))
    }

    /// The series of one axis (0: x, 1: y) at a phase in turns.
    #[inline(always)] // part of every kernel
    pub(crate) fn value(&self, axis: usize, turns: f64) -> f64 {
        let (sin, cos) = phase::sin_cos_turns(turns);
        let twice = 2.0 * cos;
        let (mut c1, mut c2, mut s1, mut s2) = (0.0, 0.0, 0.0, 0.0);
        for [c, s] in self.waves[axis].iter().rev() {
            (c1, c2) = (c + twice * c1 - c2, c1);
            (s1, s2) = (s + twice * s1 - s2, s1);
        }
        c1 * cos - c2 + s1 * sin
    }

    /// Its mean over a position that is known to a variance, px^2.
    pub(crate) fn mean_value(&self, axis: usize, turns: f64, variance_px2: f64) -> f64 {
        if variance_px2 <= 0.0 {
            return self.value(axis, turns);
        }
        let each = (-2.0 * PI * PI * variance_px2).exp();
        let (mut sum, mut faded, mut ratio) = (0.0, each, each.powi(3));
        for (k, [c, s]) in (1..).zip(&self.waves[axis]) {
            let (sin, cos) = phase::sin_cos_turns(f64::from(k) * turns);
            sum += faded * (c * cos + s * sin);
            faded *= ratio;
            ratio *= each * each;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// Clenshaw's recurrence amplifies roundings by up to k^2 for the k-th term: 12 terms, 1e-13.
    #[test]
    fn recurrence_equals_the_plain_sum() {
        let terms: Vec<Harmonic> = (1..=12)
            .map(|k| Harmonic {
                amplitude: 1.0 / f64::from(k),
                phase_rad: 0.7 * f64::from(k * k),
            })
            .collect();
        let series = Harmonics::new(&terms, &terms[..3]);
        for i in -700..700 {
            let turns = f64::from(i) * 0.003_1;
            for (axis, terms) in series.terms().into_iter().enumerate() {
                let plain: f64 = (1..)
                    .zip(terms)
                    .map(|(k, t)| t.amplitude * (TAU * f64::from(k) * turns + t.phase_rad).sin())
                    .sum();
                let got = series.value(axis, turns);
                assert!((got - plain).abs() < 1e-13, "{turns}: {got} {plain}");
            }
        }
    }

    /// Cut after order n, the triangle's series leaves less than the sum of the terms left out,
    /// 8/pi^2 sum_{odd k > n} 1/k^2 < 8/pi^2 / (2 (n - 1)).
    #[test]
    fn triangle_is_a_series_of_odd_orders() {
        let n = 99_i32;
        let terms: Vec<Harmonic> = (1..=n)
            .map(|k| {
                let sign =
                    [0.0, 1.0, 0.0, -1.0][usize::from(k.unsigned_abs().to_le_bytes()[0] % 4)];
                Harmonic {
                    amplitude: sign * 8.0 / (PI * f64::from(k)).powi(2),
                    phase_rad: 0.0,
                }
            })
            .collect();
        let series = Harmonics::new(&terms, &[]);
        let tolerance = 8.0 / (PI * PI) / (2.0 * f64::from(n - 1));
        for i in 0..1000 {
            let turns = f64::from(i) / 1000.0;
            let wave = crate::triangle::wave(turns);
            assert!((series.value(0, turns) - wave).abs() < tolerance, "{turns}");
        }
    }
}
