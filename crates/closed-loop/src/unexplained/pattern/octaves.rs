//! Which waves are looked for, what one pays for that, and which are like it.
//!
//! ```text
//! c = (kx Lx, ky Ly)                cycles of a wave over the extent
//! trials = 8 x 4 J K                K: wave vectors in the octave of |c|, of J octaves
//! usual  = mean power of waves of 0.5 to 1.1 |c| in any direction
//! ```
//!
//! 8 is for tops between them, and 4 for there being waves and rings, of which chance may make one in 200 runs.
//! Octaves share alike in that. Slow noise of stars that move on has the more power the longer a wave is,
//! so that waves as long and longer tell what is usual. It has more in some directions than in others, too: where powers
//! scatter by more than those of white noise do (chi-squared of 4: a relative variance V of 1/2), the wave is one of such,
//!
//! ```text
//! P/usual ~ F(4, f)        f = (8 V + 2)/(2 V - 1)         V = (f + 2)/(2 f - 8)
//! ```
//!
//! Source: weighted Bonferroni, Genovese, Roeder & Wasserman 2006.

use std::f64::consts::PI;

use block_regression::beyond;
use statrs::distribution::FisherSnedecor;

/// What each independent wave vector pays for: see the module.
pub(super) const CHANCES: f64 = 8.0 * 4.0;
/// Cycles over the extent within which a wave is one of pixel phase.
const PHASE_GUARD: f64 = 3.0;
/// Wave vectors that the mean power of such waves is of: each and its opposite are one.
const AROUND: usize = 128;
/// From which to which part of the cycles of a wave they are, and further from it than how many.
const SHORTER: f64 = 0.5;
const LONGER: f64 = 1.1;
const NEAR: f64 = 2.0;
/// Sigma of the relative variance of one power of white noise: of n it is known to this over root n.
const CHANCE: f64 = 1.5;

/// Waves whose power is usual.
#[derive(Clone, Debug)]
pub(super) struct Others {
    pub(super) waves: Vec<[f64; 2]>,
    /// As so many that know nothing of each other.
    pub(super) independent: f64,
}

impl Others {
    /// Chance of as much `power` where theirs, one a wave, is usual.
    pub(super) fn chance(&self, power: f64, powers: &[f64]) -> Option<f64> {
        let n = powers.len() as f64;
        let usual = powers.iter().sum::<f64>() / n;
        let square = |p: &f64| (p / usual - 1.0).powi(2);
        let scatter = powers.iter().map(square).sum::<f64>() / n - CHANCE / self.independent.sqrt();
        // freedom of the F that scatters as they do
        let uneven = (2.0 * scatter - 1.0).max(0.0) / (8.0 * scatter + 2.0).max(1.0);
        let freedom = (uneven + 0.25 / self.independent).recip();
        let law = FisherSnedecor::new(4.0, freedom).ok()?;
        Some(beyond(&law, power / usual))
    }
}

/// Wave vectors that others own.
#[derive(Clone, Copy, Debug)]
pub(super) struct Own {
    pub(super) extent: [f64; 2],
    /// Cycles over the extent that the distortion may have.
    pub(super) cycles: f64,
}

impl Own {
    /// A sunflower of wave vectors about as long as this one, and longer: slow noise of stars on their paths has the more
    /// power the longer a wave is. None is near it, nor the distortion's.
    pub(super) fn as_long_as(&self, k: [f64; 2]) -> Others {
        let longest = self.scale(k).sqrt() * self.cycles;
        let (least, most) = (self.cycles.max(SHORTER * longest), LONGER * longest);
        let golden = PI * (3.0 - 5.0_f64.sqrt());
        let squares = |part: f64| least * least + part * (most * most - least * least);
        let all = (0..AROUND).map(|j| {
            let r = squares((j as f64 + 0.5) / AROUND as f64).sqrt();
            let (s, c) = (golden * j as f64).sin_cos();
            [r * c / self.extent[0], r * s / self.extent[1]]
        });
        let far = |sign: f64, wave: &[f64; 2]| {
            let away = |a: usize| (wave[a] - sign * k[a]) * self.extent[a];
            away(0).hypot(away(1)) > NEAR
        };
        let waves: Vec<_> = all.filter(|w| far(1.0, w) && far(-1.0, w)).collect();
        // one a cycle, in half a plane
        let independent = 0.5 * PI * (squares(1.0) - squares(0.0));
        Others {
            independent: independent.min(waves.len() as f64).max(1.0),
            waves,
        }
    }

    /// Squared cycles of a wave over the extent, in units of the longest that is looked for.
    pub(super) fn scale(&self, k: [f64; 2]) -> f64 {
        let cycles = |a: usize| k[a] * self.extent[a];
        (cycles(0).powi(2) + cycles(1).powi(2)) / self.cycles.powi(2)
    }

    /// Octaves up to one cycle per pixel along both axes.
    fn octaves(&self) -> f64 {
        (0.5 * self.scale([1.0, 1.0]).log2()).ceil().max(1.0)
    }

    /// The octave of a wave.
    fn octave(&self, k: [f64; 2]) -> f64 {
        let octave = (0.5 * self.scale(k).log2()).floor();
        octave.clamp(0.0, self.octaves() - 1.0)
    }

    /// Wave vectors that one of this octave pays for: see the module.
    pub(super) fn trials(&self, k: [f64; 2]) -> f64 {
        self.trials_in(self.octave(k))
    }

    /// Of each octave the [scale](Self::scale) that its waves do not reach, and the wave vectors that one pays for.
    pub(super) fn prices(&self) -> impl Iterator<Item = (f64, f64)> {
        let octaves = self.octaves();
        (1..)
            .map(f64::from)
            .take_while(move |next| *next <= octaves)
            .map(move |next| {
                let last = next >= octaves;
                let up_to = if last {
                    f64::INFINITY
                } else {
                    (2.0 * next).exp2()
                };
                (up_to, self.trials_in(next - 1.0))
            })
    }

    fn trials_in(&self, octave: f64) -> f64 {
        let all = 2.0 * self.extent[0] * self.extent[1];
        let longest = self.cycles * octave.exp2();
        // between two half circles, but for what lies beyond a cycle per pixel
        let vectors = (1.5 * PI * longest * longest).min(all);
        (CHANCES * self.octaves() * vectors).max(1.0)
    }

    pub(super) fn excludes(&self, k: [f64; 2]) -> bool {
        let within = |x: f64, y: f64, cycles: f64| {
            let (x, y) = (
                (k[0].abs() - x) * self.extent[0],
                (k[1].abs() - y) * self.extent[1],
            );
            x * x + y * y < cycles * cycles
        };
        within(0.0, 0.0, self.cycles)
            || within(1.0, 0.0, PHASE_GUARD)
            || within(0.0, 1.0, PHASE_GUARD)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ladder of octaves says of every wave what it pays by itself.
    #[test]
    fn the_prices_are_those_of_the_waves() {
        let own = Own {
            extent: [1024.0, 700.0],
            cycles: 3.5,
        };
        for j in 1..2000 {
            let k = [0.013, 0.37].map(|step| (f64::from(j) * step).fract() - 0.5);
            let price = own.prices().find(|(up_to, _)| own.scale(k) < *up_to);
            let (_, trials) = price.expect("the last octave has no end");
            assert!((trials / own.trials(k) - 1.0).abs() < 1e-12, "{k:?}");
        }
    }
}
