//! Read and photon noise from the residuals of the windows.
//!
//! ```text
//! var(m) = a + b max(m, 0)        fitted to (1.4826 MAD)^2 in bins of equal count of the model m
//! ```
//!
//! Weighted by 1/var^2, re-weighted with the fit: the relative error of a variance
//! from n residuals is the same in every bin.
//!
//! Source: photon transfer, Janesick, Scientific Charge-Coupled Devices (2001), section 2.2;
//! Rousseeuw & Croux 1993 for the scaled MAD.

use super::robust::{MAD_SCALE, robust_median};
use super::window_fit::PixelNoise;

/// Bins of the model.
const BINS: usize = 30;
/// Least residuals in a bin.
const MIN_IN_BIN: usize = 30;
const REWEIGHTINGS: usize = 5;
/// Least variance of a dark pixel, in the scaled unit of a sample.
pub(crate) const MIN_READ_VARIANCE: f64 = 1e-3;

/// Fits `a` and `b` to pairs (model, residual). `None` with too few of them.
pub(crate) fn fit(mut pairs: Vec<[f64; 2]>) -> Option<PixelNoise> {
    for p in &mut pairs {
        p[0] = p[0].max(0.0);
    }
    pairs.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let n = pairs.len();
    let bins = BINS.min(n / MIN_IN_BIN);
    let mut points = Vec::with_capacity(bins);
    for k in 0..bins {
        let bin = &pairs[k * n / bins..(k + 1) * n / bins];
        let centre = robust_median(bin.iter().map(|p| p[1]).collect())?;
        let mad = robust_median(bin.iter().map(|p| (p[1] - centre).abs()).collect())?;
        let mean = bin.iter().map(|p| p[0]).sum::<f64>() / bin.len() as f64;
        points.push([mean, (MAD_SCALE * mad).powi(2)]);
    }
    if points.is_empty() {
        return None;
    }
    let mut weight: Vec<f64> = points
        .iter()
        .map(|p| 1.0 / p[1].max(MIN_READ_VARIANCE))
        .collect();
    let mut noise = PixelNoise {
        a: MIN_READ_VARIANCE,
        b: 0.0,
    };
    for _ in 0..REWEIGHTINGS {
        noise = line(&points, &weight);
        for (w, p) in weight.iter_mut().zip(&points) {
            *w = 1.0 / noise.variance(p[0]);
        }
    }
    Some(noise)
}

/// Weighted least squares for a line with both coefficients kept in range.
fn line(points: &[[f64; 2]], weight: &[f64]) -> PixelNoise {
    let mut s = [0.0; 5];
    for (p, w) in points.iter().zip(weight) {
        let v = w * w;
        for (s, t) in s
            .iter_mut()
            .zip([1.0, p[0], p[0] * p[0], p[1], p[0] * p[1]])
        {
            *s += v * t;
        }
    }
    let [n, x, xx, y, xy] = s;
    let determinant = n * xx - x * x;
    // one bin, or one level of light: no slope to be seen
    let b = if determinant > 1e-12 * n * xx {
        (n * xy - x * y) / determinant
    } else {
        0.0
    };
    let b = b.max(0.0);
    let a = ((y - b * x) / n).max(MIN_READ_VARIANCE);
    PixelNoise { a, b }
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    /// The scaled MAD of n Gaussian residuals has relative error 1.166/sqrt(n), its
    /// square twice that. With 30 bins of 2000 over 0..1000 the line's slope is
    /// known to about 2 * 1.166 * sqrt(12/60000) = 3.3 % of itself; gate at 5 sigma.
    /// 2 % of hits of any size move the MAD by 0.02 * 1.25 and its square by 5 %.
    #[test]
    fn line_is_found_under_particle_hits() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        let pairs = (0..60_000)
            .map(|i| {
                let model = f64::from(i % 1000);
                let e: f64 = StandardNormal.sample(&mut rng);
                let hit = if i % 50 == 7 { 500.0 } else { 0.0 };
                [model, (9.0 + 0.5 * model).sqrt() * e + hit]
            })
            .collect();
        let noise = fit(pairs).unwrap();
        assert!((noise.b / 0.5 - 1.05).abs() < 0.17, "{noise:?}");
        assert!((noise.a - 9.0).abs() < 5.0, "{noise:?}");
    }

    #[test]
    fn few_or_constant_residuals_are_taken_in_stride() {
        assert!(fit(vec![[1.0, 2.0]; 5]).is_none());
        let noise = fit(vec![[1.0, 0.0]; 500]).unwrap();
        assert!((noise.a - MIN_READ_VARIANCE).abs() < 1e-15 && noise.b.abs() < 1e-15);
    }
}
