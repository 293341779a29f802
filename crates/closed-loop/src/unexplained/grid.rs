//! The frequencies at which lines are looked for.
//!
//! Not physics: bookkeeping of frequencies.

use spectra::robust::median_step;

/// Independent frequencies that are looked at at most, over those that as many samples without a gap have: N samples
/// hold N numbers, N/2 frequencies, and over gaps nine times as long as all that was sampled nearly all others are
/// fringes of these.
const MOST_FRINGES: f64 = 10.0;

/// Time, s, over which samples at `t_s` tell frequencies apart: their span, but for gaps that are far longer than all that
/// was sampled.
pub(crate) fn coherent_s(t_s: &[f64]) -> f64 {
    let (Some(first), Some(last), Some(step)) = (t_s.first(), t_s.last(), median_step(t_s)) else {
        return 0.0;
    };
    (last - first).min(MOST_FRINGES * t_s.len() as f64 * step)
}

/// Evenly spaced frequencies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    pub(crate) first_hz: f64,
    pub(crate) step_hz: f64,
    pub(crate) bins: usize,
}

impl Grid {
    /// From `cycles` in the `span_s` to half the rate of samples `step_s` apart, `finer` points in 1/span; `None`
    /// where these are fewer than `fewest`.
    pub(crate) fn of(
        span_s: f64,
        step_s: f64,
        cycles: f64,
        finer: usize,
        fewest: usize,
    ) -> Option<Self> {
        let step_hz = 1.0 / (finer as f64 * span_s);
        let first_hz = cycles / span_s;
        let bins = ((0.5 / step_s - first_hz) / step_hz).floor();
        // no samples, or no time between them
        if !bins.is_finite() || bins < fewest as f64 {
            return None;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a positive number of grid points, limited by the number of samples"
        )]
        let bins = bins as usize;
        Some(Self {
            first_hz,
            step_hz,
            bins,
        })
    }

    pub(crate) fn at(&self, k: usize) -> f64 {
        self.first_hz + k as f64 * self.step_hz
    }
}

/// The frequency of most `power` within a `step` of `f`, by halves of it down to 1/4000.
pub(crate) fn top(f: f64, step: f64, power: impl Fn(f64) -> f64) -> f64 {
    let (mut centre, mut width) = (f, step);
    for _ in 0..12 {
        let best = [-1.0, -0.5, 0.0, 0.5, 1.0]
            .map(|s| centre + s * width)
            .into_iter()
            .filter(|f| *f > 0.0)
            .max_by(|a, b| power(*a).total_cmp(&power(*b)));
        centre = best.unwrap_or(centre);
        width *= 0.5;
    }
    centre
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A gap as long as what was sampled leaves the span as it is, one of weeks no more than the samples tell.
    #[test]
    fn gaps_of_weeks_make_no_frequencies() {
        let with_gap = |gap_s: f64| -> Vec<f64> {
            let each = (0..600).map(f64::from);
            each.map(|t| if t < 300.0 { t } else { t + gap_s })
                .collect()
        };
        let told = [
            &with_gap(0.0)[..],
            &with_gap(3000.0),
            &with_gap(1e6),
            &[1.0],
        ]
        .map(coherent_s);
        for (told, truth) in told.iter().zip([599.0, 3599.0, 6000.0, 0.0]) {
            assert!((told - truth).abs() < 1e-9, "{told} for {truth}");
        }
    }
}
