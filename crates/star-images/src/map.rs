//! The dark map as it is handed out, with an honest error for every pixel.
//!
//! ```text
//! m_p  = marginal variance of D_p with the spots unknown and nothing known of pixels beforehand
//! J_p  = (n-1)/n sum_k (D_p^k - mean_k D_p^k)^2        D^k learned without fold k, k = 1..n
//! k2   = max(1, median_p(J_p/m_p) / median(chi^2_{n-1}/(n-1)))
//! sigma_p^2 = max(m_p, ((n-1) J_p + (n-1) k2 m_p) / (2 (n-1)))
//! ```
//!
//! m knows what one star's spot and its pixels share, but neither warm pixels that
//! switch nor spots that change in time; the jackknife over stretches of time sees
//! both, with n - 1 degrees of freedom a pixel. k2 is what they say of all pixels
//! together, of those that are measured: pixels drawn to zero scatter less than their
//! errors. Each pixel's own jackknife is drawn half way to it. All maps are
//! taken against their mean over a group of pixels: a level has no meaning of its
//! own. The finished map counts from the lowest pixels of each group; nothing is
//! below zero.
//!
//! Source: Efron & Stein 1981, Annals of Statistics 9, 586 (jackknife).

use super::learn::Learned;
use super::robust::robust_median;
use super::sample::{Sample, levelled, mean};

/// One pixel of a dark map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DarkPixel {
    /// Centre of the pixel, centred px.
    pub x_px: f64,
    /// Centre of the pixel, centred px.
    pub y_px: f64,
    /// What it adds to every read-out, in the unit of the windows.
    pub dn: f64,
    /// 1 sigma of the pixel against the mean of its surroundings.
    pub sigma_dn: f64,
}

/// What each detector pixel under the windows adds, by itself, to every read-out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DarkMap {
    /// Every pixel that a window has covered.
    pub pixels: Vec<DarkPixel>,
}

impl DarkMap {
    /// Root mean square of the map about its mean: only contrasts mean anything.
    #[must_use]
    pub fn rms_dn(&self) -> f64 {
        let n = self.pixels.len().max(1) as f64;
        let mean = self.pixels.iter().map(|p| p.dn).sum::<f64>() / n;
        (self
            .pixels
            .iter()
            .map(|p| (p.dn - mean).powi(2))
            .sum::<f64>()
            / n)
            .sqrt()
    }
}

/// The map of `all`, its errors from itself and from the `folds` left out in turn.
pub(crate) fn of(sample: &Sample, folds: &[Learned], all: &Learned) -> DarkMap {
    let scatter = jackknife(sample, folds);
    let freedom = folds.len() as f64 - 1.0;
    let marginal = &all.dark_variance;
    let ratio = |p: usize| Some(scatter[p]? / marginal[p]);
    let own: Vec<f64> = (0..scatter.len())
        .filter(|&p| all.dark.share_of_data(p) > 0.5)
        .filter_map(ratio)
        .collect();
    let ratios = match own.len() {
        0..ENOUGH => (0..scatter.len()).filter_map(ratio).collect(),
        _ => own,
    };
    // Wilson & Hilferty 1931
    let median = (1.0 - 2.0 / (9.0 * freedom)).powi(3);
    let excess = robust_median(ratios).map_or(1.0, |r| (r / median).max(1.0));
    let variance = |p: usize| {
        let pooled = excess * marginal[p];
        scatter[p]
            .map_or(pooled, |own| 0.5 * (own + pooled))
            .max(marginal[p])
    };
    let value = levelled(&all.dark.value, &sample.group, &all.dark.seen, lowest);
    let pixels = (0..sample.centre.len())
        .filter(|&p| all.dark.seen[p])
        .map(|p| DarkPixel {
            x_px: sample.centre[p][0],
            y_px: sample.centre[p][1],
            dn: value[p].max(0.0) * sample.unit,
            sigma_dn: variance(p).sqrt() * sample.unit,
        })
        .collect();
    DarkMap { pixels }
}

/// Fewest pixels that a median is taken over: it is good to 20 % then.
const ENOUGH: usize = 20;
/// Share of the pixels that may lie below the level that counts as dark.
const LOWEST: f64 = 0.05;

/// The level that counts as dark.
fn lowest(mut values: Vec<f64>) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a count"
    )]
    let index = (LOWEST * values.len() as f64) as usize;
    values.get(index).copied()
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
    let maps: Vec<Vec<f64>> = folds
        .iter()
        .map(|l| levelled(&l.dark.value, &sample.group, &shared, mean))
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
