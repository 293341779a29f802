//! The constant level under first moments.
//!
//! ```text
//! e(L) = sum (m - D - L)(p - s) / sum (m - D - L)      over the pixels of a window
//! L minimises the scatter of e about its mean over the windows of a star
//! ```
//!
//! A level that is left in pulls every first moment towards the middle of its
//! window, and so does light of the spot beyond the window's edge. Background, dark
//! level and the spot's own pedestal cannot be told apart; what a first moment needs
//! is the level at which it follows the star, at s.
//!
//! m is what the fitted spot shows there, without noise: of values with noise a level that pulls
//! towards the middle has less scatter, for it pulls the noise along, and that pull would be an error of the spot.
//!
//! Source: gain of a truncated first moment, expanded to first order in the level.

use super::sample::Sample;

/// Gauss-Newton steps; the first already lands where the error is linear.
const STEPS: usize = 5;
/// Prior standard deviation of the level, in mean signals of a pixel.
const PRIOR: f64 = 0.2;

/// The level for the star with these windows, which show `shown` (with the map) where the star is `at`.
pub(crate) fn fit(
    sample: &Sample,
    windows: &[usize],
    at: impl Fn(usize) -> [f64; 2],
    shown: &[f64],
    dark: &[f64],
    start: f64,
) -> f64 {
    let n = sample.cells.len() as f64;
    // light, and moments of light and of a level of one about the star
    let sums: Vec<[f64; 5]> = windows
        .iter()
        .map(|&w| {
            let mut sum = [0.0; 5];
            let at = at(w);
            for (i, &[c, r]) in sample.cells_of(w).zip(&sample.cells) {
                let q = shown[i] - dark[sample.pixel[i]];
                let x = sample.corner[w][0] + c as f64 - at[0];
                let y = sample.corner[w][1] + r as f64 - at[1];
                for (s, t) in sum.iter_mut().zip([q, q * x, q * y, x, y]) {
                    *s += t;
                }
            }
            sum
        })
        .collect();
    let count = sums.len() as f64;
    if sums.len() < 3 {
        return start;
    }
    let signal = sums.iter().map(|s| s[0]).sum::<f64>() / (count * n) - start;
    let mut level = start;
    for _ in 0..STEPS {
        let (mut curvature, mut gradient, mut power) = (0.0, 0.0, 0.0);
        for axis in 0..2 {
            let point = |s: &[f64; 5]| {
                let light = s[0] - level * n;
                let e = (s[1 + axis] - level * s[3 + axis]) / light;
                [e, (n * e - s[3 + axis]) / light]
            };
            let mean = sums
                .iter()
                .map(point)
                .fold([0.0; 2], |m, p| [m[0] + p[0], m[1] + p[1]]);
            for p in sums.iter().map(point) {
                let (e, d) = (p[0] - mean[0] / count, p[1] - mean[1] / count);
                curvature += d * d;
                gradient += d * e;
                power += e * e;
            }
        }
        let prior = power / (2.0 * count) / (PRIOR * signal).powi(2);
        let step = -(gradient + prior * (level - start)) / (curvature + prior);
        if !step.is_finite() {
            return start;
        }
        level += step.clamp(-PRIOR * signal.abs(), PRIOR * signal.abs());
    }
    level
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::few_windows;
    use super::*;

    /// The spot of 0.9 px in 4 by 4 pixels loses light at the edges, and its first
    /// moment lags behind by several hundredths of a pixel at the known background;
    /// at the fitted level most of that is gone, wherever the search starts.
    #[test]
    fn first_moments_follow_the_star_at_the_fitted_level() {
        let sample = few_windows(200);
        let windows: Vec<usize> = (0..sample.windows()).collect();
        let dark = vec![0.0; sample.centre.len()];
        let scatter = |level: f64| {
            let error = |w: usize| {
                let mut sum = [0.0; 2];
                for (i, &[c, _]) in sample.cells_of(w).zip(&sample.cells) {
                    let q = sample.z[i] - level;
                    sum = [
                        sum[0] + q,
                        sum[1] + q * (sample.corner[w][0] + c as f64 - sample.start[w][0]),
                    ];
                }
                sum[1] / sum[0]
            };
            let errors: Vec<f64> = windows.iter().map(|&w| error(w)).collect();
            let mean = errors.iter().sum::<f64>() / errors.len() as f64;
            (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / errors.len() as f64).sqrt()
        };
        let known = sample.background[0];
        let from = |start: f64| {
            let at = |w: usize| sample.start[w];
            fit(&sample, &windows, at, &sample.z, &dark, start)
        };
        let (level, again) = (from(known), from(known + 30.0));
        assert!(level > known, "light beyond the edge needs a higher level");
        assert!(scatter(known) > 0.02, "{}", scatter(known));
        assert!(
            scatter(level) < 0.25 * scatter(known),
            "{} {}",
            scatter(level),
            scatter(known)
        );
        assert!((again - level).abs() < 2.0, "{again} {level}");
        for step in [-3.0, 3.0] {
            assert!(scatter(level + step) > 0.99 * scatter(level));
        }
    }
}
