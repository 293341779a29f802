//! Whittle's likelihood of a spectrum, with its exact expectation.
//!
//! ```text
//! ln L = -sum_k (nu_k / 2c) [ln S(f_k) + P_k / S(f_k)]
//! ```
//!
//! for independent bins `P ~ S chi2_nu/nu`; `c` is by how much overlapping windows make neighbours
//! share their scatter. `S` is the sampled density, or, for a raw periodogram, its expectation for
//! the finite series: what leaks through the window then biases nothing.
//!
//! Source: Whittle, Arkiv foer Matematik 2 (1953) 423; Sykulski, Olhede, Guillaumin, Lilly & Early,
//! The debiased Whittle likelihood, Biometrika 106 (2019) 251.

use super::bins::Bins;
use super::likelihood::{LANES, Likelihood, Place, Unit, Value};

/// The likelihood of given bins.
#[derive(Debug)]
pub(crate) struct Whittle<'a> {
    bins: &'a Bins,
    correlation: f64,
    weight: f64,
}

impl<'a> Whittle<'a> {
    /// `correlation` is the `c` of the header.
    pub(crate) fn new(bins: &'a Bins, correlation: f64) -> Self {
        let dof: f64 = bins.samples.iter().map(|s| s.dof).sum();
        Self {
            bins,
            correlation,
            weight: 0.5 * dof / correlation,
        }
    }

    /// ln L at its best of white noise alone.
    pub(crate) fn white(&self) -> f64 {
        let fs = self.bins.fs_hz;
        let sum: f64 = self
            .bins
            .samples
            .iter()
            .map(|s| 0.5 * s.dof / self.correlation * s.psd * 0.5 * fs)
            .sum();
        let w = self.weight;
        -(w * (sum / w).ln() + w)
    }
}

impl Likelihood for Whittle<'_> {
    fn weight(&self) -> f64 {
        self.weight
    }

    fn evaluate(&self, places: &[Place; LANES]) -> [Value; LANES] {
        let fs = self.bins.fs_hz;
        places.map(|place| {
            let unit = Unit::new(place, 1.0 / fs);
            let fogm = unit.fogm();
            let mut value = Value::default();
            let window = self.bins.window.map(|n| (n, unit.step.end_of(n)));
            for s in &self.bins.samples {
                let gain = match window {
                    Some((n, end)) => unit.step.gain_on_grid(s.bin, n, end),
                    None => unit.step.gain(s.bin),
                };
                let level = fogm * gain + unit.white;
                let weight = 0.5 * s.dof / self.correlation;
                value.a += weight * level.ln();
                value.b += weight * 0.5 * fs * s.psd / level;
            }
            value
        })
    }
}
