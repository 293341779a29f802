//! Noise that a parabola leaves in windows of a span.
//!
//! ```text
//! x = a + b u + c u^2 + noise,   u = 2 (t - middle) / span,   3 degrees of freedom a window
//! ```
//!
//! Windows are tiles, which use every frame once, or, as the paper has them, stretches around chosen
//! local maxima. A window with a gap is left out.
//!
//! Source: [A01], "we have selected ten of the local maxima and applied a parabolic fit to each".

use nalgebra::{Matrix3, Vector3};

/// Shortest and longest span of \[A01\] Fig. 2, s.
const SPANS_S: [f64; 2] = [5.0, 160.0];
/// Steps without a frame that make a gap: an outlier or two may be missing.
const GAP_STEPS: f64 = 3.5;
/// Fewest frames in a window.
const FEWEST: usize = 6;

/// Where windows are.
#[derive(Clone, Debug, PartialEq)]
pub enum Windows {
    /// One after the other.
    Tiles,
    /// Around these times, s.
    Around(Vec<f64>),
}

/// Noise at one span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpanNoise {
    /// Span, s.
    pub span_s: f64,
    /// Pooled standard deviation, unit of the series.
    pub sigma: f64,
    /// Mean of the windows' standard deviations, as \[A01\] Fig. 2 has it.
    pub mean_sigma: f64,
    /// Degrees of freedom of `sigma`.
    pub dof: f64,
    /// Windows.
    pub windows: usize,
    /// Variance of the windows' variances over that of Gaussian noise of one size: above 1 where the noise
    /// comes and goes.
    pub unevenness: f64,
}

/// Spans to try: octaves from 5 to 160 s, or as many steps of a record that is sampled more slowly;
/// none longer than a quarter of the record.
#[must_use]
pub fn spans_s(t_s: &[f64], step_s: f64) -> Vec<f64> {
    let whole = t_s[t_s.len() - 1] - t_s[0];
    let first = SPANS_S[0].max(8.0 * step_s);
    let last = SPANS_S[1].max(32.0 * first).min(0.25 * whole);
    let mut out = Vec::new();
    let mut span = first;
    while span <= last * (1.0 + 1e-9) && out.len() < 40 {
        out.push(span);
        span *= 2.0;
    }
    out
}

/// Noise at a span; `None` where no window holds enough frames.
///
/// # Panics
/// If times and values differ in number.
#[must_use]
pub fn noise_at_span(
    t_s: &[f64],
    x: &[f64],
    step_s: f64,
    span_s: f64,
    windows: &Windows,
) -> Option<SpanNoise> {
    assert_eq!(t_s.len(), x.len(), "one time for each value");
    let (mut rss, mut dof, mut sigmas, mut frees) = (0.0, 0.0, Vec::new(), Vec::new());
    let mut add = |from_s: f64, start: usize| -> usize {
        // half a step of slack: rounding must not move a frame into the next window
        let end = start + t_s[start..].partition_point(|t| *t < from_s + span_s - 1e-6 * step_s);
        let n = end - start;
        let whole = n as f64 * step_s > 0.7 * span_s;
        let gap = t_s[start..end]
            .windows(2)
            .any(|t| t[1] - t[0] > GAP_STEPS * step_s);
        if n >= FEWEST
            && whole
            && !gap
            && let Some(left) = without_parabola(&t_s[start..end], &x[start..end])
        {
            let free = (n - 3) as f64;
            rss += left;
            dof += free;
            sigmas.push((left / free).sqrt());
            frees.push(free);
        }
        end
    };
    match windows {
        Windows::Tiles => {
            // anew after each gap, so that long windows are always made of whole short ones
            let (mut start, mut from_s) = (0, t_s[0]);
            while start < t_s.len() {
                let end = add(from_s, start);
                let gap = |k: &usize| t_s[*k] - t_s[*k - 1] > GAP_STEPS * step_s;
                match (start + 1..t_s.len().min(end + 1)).find(gap) {
                    Some(after) => (start, from_s) = (after, t_s[after]),
                    None => (start, from_s) = (end, from_s + span_s),
                }
            }
        }
        Windows::Around(middles) => {
            for middle in middles {
                let from = middle - 0.5 * span_s;
                let start = t_s.partition_point(|t| *t < from);
                if start < t_s.len() {
                    add(from, start);
                }
            }
        }
    }
    if sigmas.is_empty() {
        return None;
    }
    let pooled = rss / dof;
    // each window's variance scatters by 2 sigma^4 / free
    let scatter: f64 = sigmas
        .iter()
        .zip(&frees)
        .map(|(s, free)| (s * s / pooled - 1.0).powi(2) * free / 2.0)
        .sum();
    Some(SpanNoise {
        unevenness: scatter / sigmas.len() as f64,
        span_s,
        sigma: (rss / dof).sqrt(),
        mean_sigma: sigmas.iter().sum::<f64>() / sigmas.len() as f64,
        dof,
        windows: sigmas.len(),
    })
}

/// Sum of squares after a parabola.
fn without_parabola(t_s: &[f64], x: &[f64]) -> Option<f64> {
    let (first, last) = (t_s[0], t_s[t_s.len() - 1]);
    let (middle, half) = (0.5 * (first + last), 0.5 * (last - first));
    let row = |t: f64| {
        let u = (t - middle) / half;
        Vector3::new(1.0, u, u * u)
    };
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    let (mut gram, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (t, x) in t_s.iter().zip(x) {
        let row = row(*t);
        gram += row * row.transpose();
        right += row * (x - mean);
    }
    let c = gram.cholesky()?.solve(&right);
    let left = |(t, x): (&f64, &f64)| (x - mean - row(*t).dot(&c)).powi(2);
    Some(t_s.iter().zip(x).map(left).sum())
}

/// Times of the highest local maxima of the series' running mean over `smooth_s`, at most `count`, at
/// least `apart_s` from each other and from the ends.
#[must_use]
pub fn local_maxima(t_s: &[f64], x: &[f64], smooth_s: f64, apart_s: f64, count: usize) -> Vec<f64> {
    let n = t_s.len();
    let mut sum = vec![0.0; n + 1];
    for k in 0..n {
        sum[k + 1] = sum[k] + x[k];
    }
    let smooth: Vec<f64> = (0..n)
        .map(|k| {
            let from = t_s.partition_point(|t| *t < t_s[k] - 0.5 * smooth_s);
            let to = t_s.partition_point(|t| *t <= t_s[k] + 0.5 * smooth_s);
            (sum[to] - sum[from]) / (to - from) as f64
        })
        .collect();
    let inside =
        |k: &usize| t_s[*k] - t_s[0] >= 0.5 * apart_s && t_s[n - 1] - t_s[*k] >= 0.5 * apart_s;
    let mut order: Vec<usize> = (0..n).filter(inside).collect();
    order.sort_by(|a, b| smooth[*b].total_cmp(&smooth[*a]));
    let mut out: Vec<f64> = Vec::new();
    for k in order {
        if out.len() == count {
            break;
        }
        // the highest point of its neighbourhood: not a flank of one that is higher
        let from = t_s.partition_point(|t| *t < t_s[k] - 0.5 * apart_s);
        let to = t_s.partition_point(|t| *t <= t_s[k] + 0.5 * apart_s);
        let top = smooth[from..to].iter().all(|s| *s <= smooth[k]);
        if top && out.iter().all(|t| (t - t_s[k]).abs() >= apart_s) {
            out.push(t_s[k]);
        }
    }
    out
}
