//! Series of a hybrid empirical model at any times.
//!
//! ```text
//! e(t_k) = b(t_k) + n_k,   b a FOGM from its stationary state, n white          arcsec, per axis
//! ```
//!
//! Axes have random numbers of their own: for x, y, z one after another, first the process, then the
//! white noise of each frame.
//!
//! Source: \[M23\] Fig. 5 and Eq. 15-16.

use fogm_fit::{Fogm, FogmError, FogmWhite};
use rand_core::Rng;
use telemetry::{HemAxes, HemAxis};

/// Process of an axis.
pub(crate) fn process(axis: HemAxis) -> Result<FogmWhite, FogmError> {
    FogmWhite::new(
        Fogm::new(axis.sigma_hsf_arcsec, axis.tau_hsf_s)?,
        axis.sigma_tn_arcsec,
    )
}

/// Processes about x, y, z.
pub(crate) fn processes(hem: &HemAxes) -> Result<[FogmWhite; 3], FogmError> {
    Ok([process(hem.x)?, process(hem.y)?, process(hem.z)?])
}

/// One series at `t_s`.
pub(crate) fn series<R: Rng + ?Sized>(process: FogmWhite, t_s: &[f64], rng: &mut R) -> Vec<f64> {
    let mut state = 0.0;
    let mut last_s = None;
    t_s.iter()
        .map(|&t| {
            match last_s {
                None => state = process.fogm().start(rng),
                Some(last) => process.fogm().step(&mut state, t - last, rng),
            }
            last_s = Some(t);
            process.measure(state, rng)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    use super::*;

    /// Samples 1 s and 3 s apart in turn, tau = 4 s: correlations e^-1/4 and e^-3/4 of neighbours. Of 4 10^4 pairs
    /// each, with some 10 samples to an independent one, the standard error is below 0.016.
    #[test]
    fn neighbours_are_as_alike_as_their_distance_says() -> Result<(), FogmError> {
        let t_s: Vec<f64> = (0..80_000)
            .map(|k| 2.0 * f64::from(k) + f64::from(k % 2))
            .collect();
        let process = FogmWhite::new(Fogm::new(1.0, 4.0)?, 0.0)?;
        let y = series(process, &t_s, &mut Xoshiro256PlusPlus::seed_from_u64(3));
        for (first, dt_s) in [(0, 3.0_f64), (1, 1.0)] {
            let pairs = (first..y.len() - 1).step_by(2);
            let n = pairs.clone().count() as f64;
            let product: f64 = pairs.map(|k| y[k] * y[k + 1]).sum::<f64>() / n;
            let want = (-dt_s / 4.0).exp();
            assert!(
                (product - want).abs() < 0.08,
                "{dt_s} s: {product}, but {want}"
            );
        }
        Ok(())
    }
}
