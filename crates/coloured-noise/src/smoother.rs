//! The slow part of the rotations of frames, given all of them.
//!
//! ```text
//! r_k-1 = F_k^-1 e_k + (I - K_k)^T D_k+1 r_k       r_n = 0;  a bin that is left out: e = 0, K = 0
//! b_1   = S r_0        b_k+1 = D_k+1 b_k + S (I - D_k+1^2) r_k
//! ```
//!
//! e: innovation of the [`Filter`], F its covariance, K its gain, D the decay, S = diag(slow^2). The means b are those of
//! least variance: what they err by has nothing in common with any of the rotations.
//!
//! Source: Koopman 1993 (disturbance smoother); Henderson 1975 (best linear unbiased prediction).

use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::common_noise::CommonNoise;
use crate::filter::Filter;

/// Of the rotations `theta`, three rows a bin, that `filter` is for.
pub(crate) fn slow_part(
    noise: &CommonNoise,
    filter: &Filter,
    theta: &DMatrix<f64>,
) -> Vec<Vector3<f64>> {
    let bins = filter.steps.len();
    let whitened = filter.innovations(0..bins, theta, &[0], &mut [Vector3::zeros()]);
    let mut told = vec![Vector3::zeros(); bins];
    let mut later = Vector3::zeros();
    for (bin, step) in filter.steps.iter().enumerate().rev() {
        if let Some(whitening) = &step.whitening {
            let own = whitening.transpose() * whitened.fixed_view::<3, 1>(3 * bin, 0);
            later = own + (Matrix3::identity() - step.gain).transpose() * later;
        }
        told[bin] = later;
        later.component_mul_assign(&step.decay);
    }
    let slow = Vector3::from(noise.reference.each_ref().map(|r| r.slow * r.slow));
    let mut last = Vector3::zeros();
    let steps = filter.steps.iter().zip(told);
    steps
        .map(|(step, told)| {
            let d = step.decay;
            let fresh = slow.zip_map(&d, |s, d| s * (1.0 - d * d));
            last = d.component_mul(&last) + fresh.component_mul(&told);
            last
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coloured::Coloured;
    use nalgebra::{DVector, SMatrix};
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Any rotations, of stars that know one mixture of axes better than the others, with a bin that has none:
    /// the means that the joint covariance of all rotations and slow parts gives, `C (C + R)^-1 theta`.
    #[test]
    fn the_means_are_those_of_the_joint_law() {
        const BINS: usize = 40;
        let mut rng = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(1);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let reference = [[0.5, 30.0, 0.1], [0.8, 8.0, 0.0], [0.0, 1.0, 0.3]]
            .map(|[slow, tau_s, white]| Coloured { white, slow, tau_s });
        let noise = CommonNoise {
            centroid: 0.4,
            reference,
        };
        let t_s: Vec<f64> = (0..BINS).map(|k| k as f64 + 0.2 * (k % 3) as f64).collect();
        let inverse: Vec<Option<Matrix3<f64>>> = (0..BINS)
            .map(|k| {
                let a = SMatrix::<f64, 6, 3>::from_fn(|_, _| normal());
                (k != 17).then(|| (a.transpose() * a).try_inverse())?
            })
            .collect();
        let theta = DVector::from_fn(3 * BINS, |_, _| normal());

        let covariance = DMatrix::from_fn(3 * BINS, 3 * BINS, |i, j| {
            let r = reference[i % 3];
            let apart = (t_s[i / 3] - t_s[j / 3]).abs();
            if i % 3 == j % 3 {
                r.slow * r.slow * (-apart / r.tau_s).exp()
            } else {
                0.0
            }
        });
        let rows: Vec<usize> = (0..3 * BINS).filter(|i| i / 3 != 17).collect();
        let mut all = covariance.select_rows(&rows).select_columns(&rows);
        for (n, &i) in rows.iter().enumerate().step_by(3) {
            let white = Matrix3::from_diagonal(&Vector3::from(reference.map(|r| r.white.powi(2))));
            let own = inverse[i / 3].expect("it has stars") * 0.16 + white;
            let mut place = all.fixed_view_mut::<3, 3>(n, n);
            place += own;
        }
        let weighed = all
            .cholesky()
            .expect("positive")
            .solve(&theta.select_rows(&rows));
        let expected = covariance.select_columns(&rows) * weighed;

        let filter = Filter::new(&noise, &t_s, &[1; BINS], &inverse);
        let theta = DMatrix::from_column_slice(3 * BINS, 1, theta.as_slice());
        for (bin, slow) in slow_part(&noise, &filter, &theta).iter().enumerate() {
            for axis in 0..3 {
                let off = slow[axis] - expected[3 * bin + axis];
                assert!(off.abs() < 1e-10, "bin {bin}, axis {axis}: {off:e}");
            }
        }
    }
}
