//! Random streams: one per (seed, draw, purpose), so that a result never depends on the number of
//! threads or on how draws are split over machines.
//!
//! ```text
//! h = mix(mix(mix(seed) ^ draw) ^ purpose)          mix: the finaliser of SplitMix64
//! state of xoshiro256++ = four outputs of SplitMix64 started at h
//! ```
//!
//! Each purpose has its own stream: switching spikes on, say, leaves the temporal noise as it was.
//! Streams are told apart by 64 bits; among n streams a pair coincides with probability n^2 / 2^65,
//! 2.7e-8 for a million streams.
//!
//! Source: Blackman & Vigna, "Scrambled linear pseudorandom number generators", ACM TOMS 47 (2021),
//! xoshiro256++ seeded by `SplitMix64` as its authors recommend.

use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;

/// What the numbers of a stream are for. The discriminants are part of the documented streams: they
/// never change, and new ones are added at the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[repr(u32)]
pub enum Purpose {
    /// Coefficients of the distortion residual.
    Distortion = 1,
    /// Temporal noise of the centroids.
    TemporalNoise = 2,
    /// Generated stars and their replacements.
    StarField = 3,
    /// Disturbance torques, slew jitter and other motion.
    Motion = 4,
    /// Spikes.
    Spikes = 5,
    /// Error of the reference.
    Reference = 6,
    /// Unknown constant misalignment.
    Bias = 7,
    /// Gyro noise.
    Gyro = 8,
    /// Housekeeping channels.
    Housekeeping = 9,
    /// Resampling and other estimation.
    Estimation = 10,
    /// Attitude noise of the hybrid model.
    HybridNoise = 11,
}

/// The stream of this seed, draw and purpose.
///
/// ```
/// use rand_core::Rng;
/// use star_tracker::{Purpose, stream};
///
/// let first = stream(7, 0, Purpose::TemporalNoise).next_u64();
/// assert_eq!(first, stream(7, 0, Purpose::TemporalNoise).next_u64());
/// assert_ne!(first, stream(7, 1, Purpose::TemporalNoise).next_u64());
/// ```
pub fn stream(seed: u64, draw: u64, purpose: Purpose) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(mix(mix(mix(seed) ^ draw) ^ u64::from(purpose as u32)))
}

/// Streams that one run of the model consumes.
#[derive(Clone, Debug)]
pub struct NoiseStreams {
    /// Temporal noise: two normals per row, whether or not the row is usable.
    pub noise: Xoshiro256PlusPlus,
    /// Spikes: as many numbers per row as the disturbances ask for.
    pub spikes: Xoshiro256PlusPlus,
}

impl NoiseStreams {
    /// The streams of one draw.
    pub fn new(seed: u64, draw: u64) -> Self {
        Self {
            noise: stream(seed, draw, Purpose::TemporalNoise),
            spikes: stream(seed, draw, Purpose::Spikes),
        }
    }
}

/// The finaliser of `SplitMix64` after its increment: a bijection of 64 bits.
const fn mix(x: u64) -> u64 {
    let z = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use rand_core::Rng;

    use super::*;

    /// First output of `SplitMix64` from state 0, from the authors' reference program.
    #[test]
    fn mix_is_splitmix64() {
        assert_eq!(mix(0), 0xe220_a839_7b1d_cdaf);
    }

    #[test]
    fn neighbouring_streams_share_nothing() {
        let purposes = [Purpose::Distortion, Purpose::TemporalNoise, Purpose::Spikes];
        let mut firsts = std::collections::HashSet::new();
        for seed in 0..20 {
            for draw in 0..20 {
                for purpose in purposes {
                    firsts.insert(stream(seed, draw, purpose).next_u64());
                }
            }
        }
        assert_eq!(firsts.len(), 20 * 20 * 3, "all first outputs differ");
    }

    /// Streams of neighbouring draws are uncorrelated: the sample correlation of n = 1e5 pairs has
    /// standard error 1 / sqrt n.
    #[test]
    fn neighbouring_draws_are_uncorrelated() {
        let n = 100_000_u32;
        let (mut a, mut b) = (
            stream(1, 0, Purpose::TemporalNoise),
            stream(1, 1, Purpose::TemporalNoise),
        );
        let uniform = |bits: u64| (bits >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
        let sum: f64 = (0..n)
            .map(|_| uniform(a.next_u64()) * uniform(b.next_u64()))
            .sum();
        let correlation = 12.0 * sum / f64::from(n);
        assert!(
            correlation.abs() < 5.0 / f64::from(n).sqrt(),
            "correlation {correlation}"
        );
    }
}
