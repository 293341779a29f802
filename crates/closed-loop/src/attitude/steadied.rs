//! The path of the tracker where its reference errs slowly: less the error that both attitudes tell.
//!
//! A path through a reference's attitudes holds their error e, and so does what is left of the tracker's against
//! them: a smear by the error's own accelerations seems to act where nothing does (`star/steadied.rs`). Here the mean
//! of e is that of each axis' slow noise given all residuals,
//!
//! ```text
//! q' = exp(m) q      m = E[slow | theta_1 .. theta_n]      theta_k = slow_k + white_k
//! ```
//!
//! Slow noise of the tracker's own is put into the path with it. What that makes of its own accelerations goes against
//! what is left, and no exposure has a negative square.
//!
//! Source: as of `star/steadied.rs`.

use coloured_noise::{Coloured, CommonNoise, Rotations};
use focal_plane::AttitudeSeries;
use nalgebra::{Matrix3, Vector3};

use crate::attitude::data::AttitudeData;
use crate::evidence::Residuals;
use crate::motion::turned_by;

/// `reference` less what is slow of `noise` in `residual`, arcsec.
pub(crate) fn steadied(
    data: &AttitudeData,
    reference: &AttitudeSeries,
    residual: &Residuals,
    noise: &[Coloured; 3],
) -> Option<AttitudeSeries> {
    let rows = data.t_s.len();
    let white = Vector3::from(noise.map(|n| n.white * n.white));
    let counts = |k: usize| (0..3).all(|axis| !data.outlier[axis][k]);
    let covariance = |k: usize| counts(k).then(|| Matrix3::from_diagonal(&white));
    let theta = (0..rows).flat_map(|k| [0, 1, 2].map(|axis| residual.axes[axis][k]));
    let slow = CommonNoise {
        centroid: 1.0,
        reference: noise.map(|n| Coloured { white: 0.0, ..n }),
    };
    let rotations = Rotations::new(
        data.t_s.clone(),
        theta.collect(),
        vec![1; rows],
        (0..rows).map(covariance).collect(),
        1.0,
    );
    turned_by(reference, &data.t_s, &rotations.slow_part(&slow))
}

#[cfg(test)]
mod tests {
    use focal_plane::{ARCSEC_PER_RAD, AttitudeSource, rotation_from_vector, rotation_vector};
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    /// A wander e of s = 0.5 arcsec over T = 120 s at h = 0.25 s beside white noise of w = 0.13 arcsec: the smoothed
    /// error has a variance of about s^2 / sqrt(1 + 2 T s^2 / (h w^2)), here 0.046^2, an axis, and its product with what
    /// is left has a mean of zero where that of e itself is -s^2. The tracker's attitudes are a rotation theta from the
    /// reference's: the wrong sign would double the error.
    #[test]
    fn the_path_loses_the_error_of_its_reference() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
        let mut three = || Vector3::from_fn(|_, _| StandardNormal.sample(&mut rng));
        let (step_s, tau_s, size, white) = (0.25, 120.0, 0.5, 0.13);
        let kept = f64::exp(-step_s / tau_s);
        let mut wander: Vector3<f64> = size * three();
        let truth = |t: f64| rotation_from_vector(&Vector3::new(1.1e-3 * t, 0.0, 2e-4 * t));
        let turned = |arcsec: &Vector3<f64>, t: f64| {
            rotation_from_vector(&(arcsec / ARCSEC_PER_RAD)) * truth(t)
        };
        let (mut t_s, mut tracker, mut reference) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..2400 {
            let t = step_s * f64::from(k);
            t_s.push(t);
            tracker.push(turned(&(white * three()), t));
            reference.push(turned(&wander, t));
            wander = kept * wander + size * (1.0 - kept * kept).sqrt() * three();
        }
        let reference = AttitudeSeries::new(t_s.clone(), reference, None).unwrap();
        let data = AttitudeData::against(&t_s, &tracker, &reference);
        let residual = Residuals {
            axes: data.theta.to_vec(),
            modelled: Vec::new(),
        };
        let noise = [Coloured {
            white,
            slow: size,
            tau_s,
        }; 3];
        let path = steadied(&data, &reference, &residual, &noise).unwrap();
        let (mut square, mut product, mut had) = (0.0, 0.0, 0.0);
        for (k, &t) in data.t_s.iter().enumerate() {
            let off = |path: &AttitudeSeries| {
                rotation_vector(&path.attitude(t).unwrap(), &truth(t)) * ARCSEC_PER_RAD
            };
            let left = Vector3::new(
                residual.axes[0][k],
                residual.axes[1][k],
                residual.axes[2][k],
            );
            square += off(&path).norm_squared();
            product += off(&path).dot(&left);
            had += off(&reference).norm_squared();
        }
        let expected =
            size * size / (1.0 + 2.0 * tau_s * size * size / (step_s * white * white)).sqrt();
        let n = 3.0 * data.t_s.len() as f64;
        // a correlation time of the smoothed error is 60 of these, so that n counts as a sixtieth
        assert!(
            (square / n / expected - 1.0).abs() < 4.0 * (60.0 * 2.0 / n).sqrt(),
            "{} {expected}",
            square / n
        );
        assert!(
            (product / n).abs() < 0.05 * had / n,
            "{} {}",
            product / n,
            had / n
        );
    }
}
