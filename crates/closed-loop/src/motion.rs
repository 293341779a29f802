//! Whether the samples of a motion resolve it.
//!
//! Rates and accelerations from differences of a series of attitudes are motion
//! only where its neighbours predict a sample. Where they do not (jitter faster
//! than the samples, or noise larger than the motion), the differences hold the
//! same noise as the residual against that series, and a time tag or a smear
//! "explains" it without being there. The test is the error of the cubic through
//! four neighbours,
//!
//! ```text
//! e_k = q_k - (-q_{k-2} + 4 q_{k-1} + 4 q_{k+1} - q_{k+2}) / 6
//! ```
//!
//! against the step `q_{k+1} - q_k`: for white noise of variance s^2 they have
//! variances (1 + 34/36) s^2 and 2 s^2, so nearly alike; for a resolved motion the
//! error is of fourth order in the step.
//!
//! Source: Lagrange interpolation; the errors-in-variables trap of regression.

mod around;

pub(crate) use around::Around;

use focal_plane::{AttitudeSource, rotation_vector};
use nalgebra::{UnitQuaternion, Vector3};

use crate::situation::Situation;

/// Largest ratio of prediction error to step at which the motion is resolved.
const RESOLVED: f64 = 0.3;

/// Whether a series of attitudes tells how the tracker moved between them.
pub(crate) fn resolved(q: &[UnitQuaternion<f64>]) -> bool {
    let (mut error, mut step, mut count) = (0.0, 0.0, 0_u32);
    for w in q.windows(5) {
        let [a, b, d, e]: [Vector3<f64>; 4] = [0, 1, 3, 4].map(|k| rotation_vector(&w[k], &w[2]));
        let predicted = (4.0 * (b + d) - a - e) / 6.0;
        error += predicted.norm_squared();
        step += d.norm_squared();
        count += 1;
    }
    count > 0 && error <= RESOLVED * RESOLVED * step
}

/// The reference as a motion around each frame, where its samples resolve one.
pub(crate) fn resolved_motion(
    situation: &Situation<'_>,
    t_s: &[f64],
) -> Option<Box<dyn AttitudeSource>> {
    let reference = situation.reference.as_ref()?;
    // Rates that were measured do not come from differences.
    let known = situation
        .bundle
        .reference
        .as_ref()
        .is_some_and(|r| r.rates_rad_s.is_some());
    (known || resolved(reference.quaternions()))
        .then(|| Box::new(Around::new(reference, t_s)) as Box<dyn AttitudeSource>)
}

#[cfg(test)]
mod tests {
    use super::*;
    use focal_plane::rotation_from_vector;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    fn series(noise: f64) -> Vec<UnitQuaternion<f64>> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        (0..500)
            .map(|k| {
                let t = f64::from(k) * 0.5;
                let path = Vector3::new((0.02 * t).sin(), 0.3 * (0.05 * t).cos(), 0.1 * t) * 1e-3;
                rotation_from_vector(&(path + Vector3::new(normal(), normal(), normal()) * noise))
            })
            .collect()
    }

    #[test]
    fn a_smooth_path_is_resolved_and_noise_is_not() {
        assert!(resolved(&series(1e-6)));
        assert!(!resolved(&series(1e-3)));
    }
}
