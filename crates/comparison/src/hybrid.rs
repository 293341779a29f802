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
