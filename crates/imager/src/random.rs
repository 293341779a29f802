//! Random numbers that depend on what they are for, and on nothing else.
//!
//! ```text
//! key = mix(mix(... mix(seed) ^ a) ^ b)           mix: finaliser of SplitMix64, a bijection
//! uniform = (key >> 11) 2^-53,   normals by Box-Muller from two uniforms
//! ```
//!
//! A frame has a stream of its own, and so has each of its stars: threads may take them in any order.
//! What belongs to the detector (sensitivity, dark current) is a function of the pixel alone, so that
//! no map is held.
//!
//! Source: Blackman & Vigna, "Scrambled linear pseudorandom number generators", ACM TOMS 47 (2021);
//! Steele, Lea & Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.

use core::f64::consts::TAU;

use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;

/// What numbers are for. The discriminants never change; new ones are added at the end.
#[derive(Clone, Copy, Debug)]
#[repr(u64)]
pub(crate) enum Use {
    Exposure = 1,
    Clock = 2,
    Reference = 3,
    Sensor = 4,
    Sensitivity = 5,
    Dark = 6,
    Telegraph = 7,
    Column = 8,
}

/// A key that further numbers are mixed into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Key(u64);

impl Key {
    pub(crate) fn new(seed: u64, draw: u64, purpose: Use) -> Self {
        Self(mix(seed)).with(draw).with(purpose as u64)
    }

    #[must_use]
    pub(crate) fn with(self, part: u64) -> Self {
        Self(mix(self.0 ^ part))
    }

    pub(crate) fn stream(self) -> Xoshiro256PlusPlus {
        Xoshiro256PlusPlus::seed_from_u64(self.0)
    }

    /// Uniform in [0, 1).
    pub(crate) fn uniform(self) -> f64 {
        // 53 bits are exact in a double
        (mix(self.0) >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Exponential with mean 1.
    pub(crate) fn exponential(self) -> f64 {
        -(1.0 - self.uniform()).ln()
    }

    pub(crate) fn normal(self) -> f64 {
        let radius = (2.0 * self.exponential()).sqrt();
        radius * (TAU * self.with(1).uniform()).cos()
    }
}

/// The finaliser of `SplitMix64` after its increment.
const fn mix(x: u64) -> u64 {
    let z = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and variance of 1e5 normals: standard errors 1/sqrt(n) and sqrt(2/n); a neighbour's number
    /// is independent: correlation below 5/sqrt(n).
    #[test]
    fn hashed_normals_are_normal_and_independent() {
        let n = 100_000_u32;
        let base = Key::new(3, 0, Use::Sensitivity);
        let x: Vec<f64> = (0..n).map(|k| base.with(u64::from(k)).normal()).collect();
        let count = f64::from(n);
        let mean = x.iter().sum::<f64>() / count;
        let variance = x.iter().map(|x| x * x).sum::<f64>() / count;
        let lag = x.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / count;
        assert!(mean.abs() < 5.0 / count.sqrt(), "{mean}");
        assert!(
            (variance - 1.0).abs() < 5.0 * (2.0 / count).sqrt(),
            "{variance}"
        );
        assert!(lag.abs() < 5.0 / count.sqrt(), "{lag}");
    }
}
