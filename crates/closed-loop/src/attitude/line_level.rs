//! The noise that is left at the frequencies around a line: what the line is held against.
//!
//! Noise that was fitted follows the spectrum on the whole, and around a given frequency only roughly. With the
//! innovations e of each axis, of unit variance where it follows,
//!
//! ```text
//! m = mean over n frequencies around f, and the axes, of |sum e_k exp(-2 pi i f' t_k)|^2 / N
//! q / (p m) ~ F(p, 2 n)          q: square of p amplitudes under the fitted noise
//! ```
//!
//! As many frequencies below the line as above: a density that falls over them has the line's own in the middle.
//!
//! Source: the F law of a ratio of two mean powers (Thomson 1982 tests lines so).

use std::f64::consts::TAU;

use coloured_noise::Coloured;

/// Independent frequencies on each side, at most, and those nearer than the first, which hold the line's own power.
const MOST: u32 = 30;
const GUARD: u32 = 2;
/// Cycles in the span below which there is no line but a trend: no frequency is taken there.
const FEWEST_CYCLES: f64 = 2.0;
/// Fewest frequencies on each side that tell a level.
const LEAST: usize = 5;

/// What is left around a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineLevel {
    /// Mean power over that of the fitted noise.
    pub(super) level: f64,
    /// Degrees of freedom that it is known with.
    pub(super) freedom: f64,
}

/// The level around `frequency_hz` of what is left of each axis, arcsec, at `t_s`, under its `noise`; `None` where
/// the line is so slow or so fast that too few frequencies lie around it.
pub(super) fn line_level(
    t_s: &[f64],
    left: &[Vec<f64>; 3],
    count: &[Vec<f64>; 3],
    noise: &[Coloured; 3],
    frequency_hz: f64,
) -> Option<LineLevel> {
    let span_s = t_s.last()? - t_s.first()?;
    let cycles = frequency_hz * span_s;
    let room = (cycles - FEWEST_CYCLES).min(0.5 * t_s.len() as f64 - cycles);
    let apart: Vec<f64> = (GUARD + 1..=GUARD + MOST)
        .map(f64::from)
        .take_while(|off| *off <= room)
        .collect();
    if apart.len() < LEAST {
        return None;
    }
    let rows = count.each_ref();
    let rows = rows.map(|n| n.iter().filter(|n| **n > 0.0).count().max(1) as f64);
    let white: [Vec<f64>; 3] = std::array::from_fn(|axis| {
        let mut white = left[axis].clone();
        noise[axis].whiten(t_s, &count[axis], &mut [&mut white]);
        white
    });
    let both_sides = apart.iter().flat_map(|off| [-off, *off]);
    let power = both_sides.map(|off| {
        let mut sums = [[0.0; 2]; 3];
        for (k, t) in t_s.iter().enumerate() {
            let turns = TAU * (frequency_hz + off / span_s) * (t - t_s[0]);
            let (sin, cos) = turns.sin_cos();
            for (sum, white) in sums.iter_mut().zip(&white) {
                sum[0] += cos * white[k];
                sum[1] += sin * white[k];
            }
        }
        let each = sums.iter().zip(&rows);
        each.map(|([c, s], rows)| (c * c + s * s) / rows)
            .sum::<f64>()
    });
    let frequencies = 6.0 * apart.len() as f64;
    Some(LineLevel {
        level: power.sum::<f64>() / frequencies,
        freedom: 2.0 * frequencies,
    })
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    const ROWS: usize = 600;

    /// White noise of 1 about each axis, and of `size` between 0.08 and 0.14 cycles a row.
    fn series(size: f64) -> [Vec<f64>; 3] {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        std::array::from_fn(|_| {
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let mut out: Vec<f64> = (0..ROWS).map(|_| normal()).collect();
            for k in 48..84 {
                let [c, s] = [normal(), normal()].map(|a| a * size * (2.0 / ROWS as f64).sqrt());
                for (row, value) in out.iter_mut().enumerate() {
                    let (sin, cos) = (TAU * (k * row) as f64 / ROWS as f64).sin_cos();
                    *value += c * cos + s * sin;
                }
            }
            out
        })
    }

    /// The level of n = 2 * 30 * 3 powers is known to 1/sqrt(n) = 7 %: 4 sigma. Between 0.08 and 0.14, where the
    /// noise is sqrt(1 + 2) times what was fitted, 3.
    #[test]
    fn the_level_is_that_around_the_line() {
        let t_s: Vec<f64> = (0..ROWS).map(|k| k as f64).collect();
        let count = std::array::from_fn(|_| vec![1.0; ROWS]);
        let noise = [Coloured::WHITE; 3];
        let at = |f: f64| {
            line_level(&t_s, &series(2.0_f64.sqrt()), &count, &noise, f)
                .expect("room on both sides")
        };
        let (loud, quiet) = (at(0.11), at(0.3));
        assert!(
            (quiet.level - 1.0).abs() < 0.3 && (quiet.freedom - 360.0).abs() < 1e-9,
            "{quiet:?}"
        );
        // 15 of 30 on each side
        let mixed = 0.5 * (3.0 + 1.0);
        assert!((loud.level - mixed).abs() < 0.3 * mixed, "{loud:?}");
        // six cycles leave none between a trend and the line's own
        assert!(line_level(&t_s, &series(0.0), &count, &noise, 0.01).is_none());
    }
}
