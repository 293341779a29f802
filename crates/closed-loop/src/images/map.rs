//! The dark map as it is handed out, with an honest error for every pixel.
//!
//! ```text
//! m_p  = marginal variance of D_p with the spots unknown
//! J_p  = (n-1)/n sum_k (D_p^k - mean_k D_p^k)^2        D^k learned without fold k, k = 1..n
//! k2   = max(1, median_p(J_p/m_p) / median(chi^2_{n-1}/(n-1)))
//! sigma_p^2 = max(m_p, ((n-1) J_p + (n-1) k2 m_p) / (2 (n-1)))
//! ```
//!
//! m knows what one star's spot and its pixels share, but neither warm pixels that
//! switch nor spots that change in time; the jackknife over stretches of time sees
//! both, with n - 1 degrees of freedom a pixel. k2 is what they say of all pixels
//! together, and each pixel's own jackknife is drawn half way to it. All maps are
//! taken against their mean over the pixels that belong to one star: a level there
//! has no meaning of its own.
//!
//! Source: Efron & Stein 1981, Annals of Statistics 9, 586 (jackknife).

use super::learn::Learned;
use super::robust_median;
use super::sample::Sample;
use super::{DarkMap, DarkPixel};

/// The map of `all`, its errors from itself and from the `folds` left out in turn.
pub(crate) fn of(sample: &Sample, folds: &[Learned], all: &Learned) -> DarkMap {
    let scatter = jackknife(sample, folds);
    let freedom = folds.len() as f64 - 1.0;
    let marginal = &all.dark_variance;
    let ratios: Vec<f64> = (0..scatter.len())
        .filter_map(|p| Some(scatter[p]? / marginal[p]))
        .collect();
    // Wilson & Hilferty 1931
    let median = (1.0 - 2.0 / (9.0 * freedom)).powi(3);
    let excess = robust_median(ratios).map_or(1.0, |r| (r / median).max(1.0));
    let variance = |p: usize| {
        let pooled = excess * marginal[p];
        scatter[p]
            .map_or(pooled, |own| 0.5 * (own + pooled))
            .max(marginal[p])
    };
    let pixels = (0..sample.centre.len())
        .filter(|&p| all.dark.seen[p])
        .map(|p| DarkPixel {
            x_px: sample.centre[p][0],
            y_px: sample.centre[p][1],
            dn: all.dark.value[p] * sample.unit,
            sigma_dn: variance(p).sqrt() * sample.unit,
        })
        .collect();
    DarkMap { pixels }
}

/// Delete-one variance of every pixel that all maps have seen.
fn jackknife(sample: &Sample, folds: &[Learned]) -> Vec<Option<f64>> {
    let pixels = sample.centre.len();
    if folds.len() < 2 {
        return vec![None; pixels];
    }
    let shared: Vec<bool> = (0..pixels)
        .map(|p| folds.iter().all(|l| l.dark.seen[p]))
        .collect();
    let owner = owners(sample);
    let maps: Vec<Vec<f64>> = folds
        .iter()
        .map(|learned| {
            let mut sum = vec![[0.0; 2]; sample.stars];
            for p in (0..pixels).filter(|&p| shared[p]) {
                let s = &mut sum[owner[p]];
                *s = [s[0] + learned.dark.value[p], s[1] + 1.0];
            }
            let level = |p: usize| sum[owner[p]][0] / f64::max(sum[owner[p]][1], 1.0);
            (0..pixels)
                .map(|p| learned.dark.value[p] - level(p))
                .collect()
        })
        .collect();
    let n = maps.len() as f64;
    (0..pixels)
        .map(|p| {
            let mean = maps.iter().map(|m| m[p]).sum::<f64>() / n;
            let square = maps.iter().map(|m| (m[p] - mean).powi(2)).sum::<f64>();
            shared[p].then_some((n - 1.0) / n * square)
        })
        .collect()
}

/// The first star that covers each pixel.
pub(crate) fn owners(sample: &Sample) -> Vec<usize> {
    let mut owner = vec![usize::MAX; sample.centre.len()];
    for w in 0..sample.windows() {
        for i in sample.cells_of(w) {
            let owner = &mut owner[sample.pixel[i]];
            *owner = (*owner).min(sample.star[w]);
        }
    }
    owner
}
