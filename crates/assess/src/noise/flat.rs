//! Flat intervals, and the variance pooled over them.
//!
//! ```text
//! var = sum_i N_i var(i) / sum_i N_i        means removed; both sums over the N intervals (erratum E13)
//! ```
//!
//! Flat is what varies least: of all intervals of the lengths asked for, the one with the smallest
//! variance is taken, then the next that does not overlap, until the share of the record is covered.
//!
//! Source: [A01] Eq. 6 and the text around it: 500 to 1000 s, half of the record about X and Y, 30 % about Z.

/// A flat interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatInterval {
    /// First and last time, s.
    pub span_s: [f64; 2],
    /// Frames.
    pub frames: usize,
    /// Standard deviation about its own mean.
    pub sigma: f64,
}

/// The flattest intervals that cover up to `share` of the record, in the order of time.
///
/// # Panics
/// If times and values differ in number.
#[must_use]
pub fn flat_intervals(
    t_s: &[f64],
    x: &[f64],
    step_s: f64,
    lengths_s: [f64; 2],
    share: f64,
) -> Vec<FlatInterval> {
    assert_eq!(t_s.len(), x.len(), "one time for each value");
    let whole = t_s[t_s.len() - 1] - t_s[0];
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    // sums of values and squares up to each frame: every interval is then a difference
    let mut sums = vec![[0.0; 2]; x.len() + 1];
    for (k, x) in x.iter().enumerate() {
        let d = x - mean;
        sums[k + 1] = [sums[k][0] + d, sums[k][1] + d * d];
    }
    let mut all = Vec::new();
    let grid = (lengths_s[0] / 10.0).max(step_s);
    let mut length = lengths_s[0];
    while length <= lengths_s[1] * (1.0 + 1e-9) && length <= whole {
        let mut from = t_s[0];
        while from + length <= t_s[t_s.len() - 1] + 0.5 * step_s {
            let a = t_s.partition_point(|t| *t < from);
            let b = t_s.partition_point(|t| *t < from + length);
            let n = b - a;
            if n as f64 * step_s > 0.9 * length && n > 10 {
                let [s, q] = [sums[b][0] - sums[a][0], sums[b][1] - sums[a][1]];
                let variance = (q - s * s / n as f64) / (n - 1) as f64;
                all.push(FlatInterval {
                    span_s: [t_s[a], t_s[b - 1]],
                    frames: n,
                    sigma: variance.max(0.0).sqrt(),
                });
            }
            from += grid;
        }
        length += grid;
    }
    all.sort_by(|a, b| a.sigma.total_cmp(&b.sigma));
    let mut out: Vec<FlatInterval> = Vec::new();
    let mut covered = 0.0;
    for interval in all {
        let [from, to] = interval.span_s;
        let length = to - from + step_s;
        if covered + length > share * (whole + step_s) * (1.0 + 1e-9) {
            continue;
        }
        let apart = |o: &FlatInterval| to < o.span_s[0] || from > o.span_s[1];
        if out.iter().all(apart) {
            covered += length;
            out.push(interval);
        }
    }
    out.sort_by(|a, b| a.span_s[0].total_cmp(&b.span_s[0]));
    out
}

/// \[A01\] Eq. 6 as a standard deviation; `None` without intervals.
///
/// ```
/// use assess::{FlatInterval, pooled_sigma};
/// let of = |frames, sigma| FlatInterval { span_s: [0.0, 1.0], frames, sigma };
/// let pooled = pooled_sigma(&[of(100, 1.0), of(300, 2.0)]).expect("two intervals");
/// assert!((pooled - (1300.0_f64 / 400.0).sqrt()).abs() < 1e-12);
/// ```
#[must_use]
pub fn pooled_sigma(intervals: &[FlatInterval]) -> Option<f64> {
    let frames: f64 = intervals.iter().map(|i| i.frames as f64).sum();
    let sum: f64 = intervals
        .iter()
        .map(|i| i.frames as f64 * i.sigma * i.sigma)
        .sum();
    (frames > 0.0).then(|| (sum / frames).sqrt())
}
