//! The plateau of the noise against the span, found by a test and not by eye.
//!
//! ```text
//! var(s^2_k) = V_k = 2 s^4 / dof_k,   var(s^2_j - s^2_k) = V_j - V_k   for j shorter than k
//! plateau:  the spans, from the shortest, up to which s^2 rises by less than 8 percent or 3 sigma
//! noise:    s^2 = sigma^2 + c T over the plateau, c >= 0, at T = 0
//! ```
//!
//! Spans are octaves, so that a long window is made of two short ones and its parabola is among theirs: the
//! longer is the more efficient estimate of the same white noise, and a difference has the difference of
//! the variances; steps from one span to the next are then independent, and with the last
//! value make the regression. Processes with short memory (Gauss-Markov, a random walk) leave a parabola's
//! residual that grows with the span; the intercept is free of it. A plateau is at least a factor of two
//! in span: otherwise there is none, and the noise is not told.
//!
//! Source: Hausman, Econometrica 46 (1978) 1251 (variance of the difference from an efficient estimate);
//! [A01] Fig. 2.

use super::SpanNoise;

/// Sigmas by which the variance must rise over that of the shortest span to leave the plateau.
const RISE_SIGMAS: f64 = 3.0;
/// And the part of it: a smaller rise is that of a slow process, and the intercept takes it off.
const RISE_PART: f64 = 0.08;
/// Sigmas by which the last span may stand above the line.
const JUMP_SIGMAS: f64 = 2.5;
/// Longest over shortest span of a plateau, at least.
const LEAST_RATIO: f64 = 1.99;

/// A plateau, and the noise on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plateau {
    /// Shortest and longest span, s.
    pub span_s: [f64; 2],
    /// White noise, 1 sigma of a frame, unit of the series.
    pub sigma: f64,
    /// Its own 1 sigma.
    pub error: f64,
}

/// The plateau of noise against span, spans ascending; `None` without one.
#[must_use]
pub fn find_plateau(spans: &[SpanNoise]) -> Option<Plateau> {
    let first = spans.first()?;
    let square = |s: &SpanNoise| s.sigma * s.sigma;
    // the noise of the shortest span sets the scale of all errors; more where it comes and goes
    let scale = 2.0 * square(first).powi(2) * first.unevenness.max(1.0);
    let variance = |s: &SpanNoise| scale / s.dof;
    let mut on: Vec<&SpanNoise> = vec![first];
    for span in &spans[1..] {
        let rise = square(span) - square(first);
        let spread = (variance(first) - variance(span)).max(1e-3 * variance(span));
        let part = RISE_PART * square(first);
        // what tiles cut off at gaps may leave fewer degrees of freedom than a shorter span has; and noise
        // that falls with the span is another stretch's
        if rise.abs() > part.max(RISE_SIGMAS * spread.sqrt()) || span.dof < first.dof {
            break;
        }
        on.push(span);
    }
    // what rises at once, at the longest span, is no slow process: the line must hold there as well
    loop {
        let last = *on.last()?;
        if last.span_s / first.span_s < LEAST_RATIO {
            return None;
        }
        let [level, error, slope] = line(&on, &square, &variance)?;
        let before = on[on.len() - 2];
        let spread = (variance(before) - variance(last)).max(1e-3 * variance(last));
        let jump = square(last) - square(before) - slope * (last.span_s - before.span_s);
        if on.len() > 2 && jump > JUMP_SIGMAS * spread.sqrt() {
            on.pop();
            continue;
        }
        if level <= 0.0 {
            return None;
        }
        let sigma = level.sqrt();
        return Some(Plateau {
            span_s: [first.span_s, last.span_s],
            sigma,
            error: error / (2.0 * sigma),
        });
    }
}

/// `sigma^2`, its error, and `c`.
fn line(
    on: &[&SpanNoise],
    square: &impl Fn(&SpanNoise) -> f64,
    variance: &impl Fn(&SpanNoise) -> f64,
) -> Option<[f64; 3]> {
    /// Of 1 and of the span how much, the value, and its variance.
    type Row = (f64, f64, f64, f64);
    let last = on.last()?;
    // independent rows: the last value, and each step down to it
    let mut rows = vec![(1.0, last.span_s, square(last), variance(last))];
    for pair in on.windows(2) {
        let spread = variance(pair[0]) - variance(pair[1]);
        if spread > 0.0 {
            let rise = square(pair[0]) - square(pair[1]);
            rows.push((0.0, pair[0].span_s - pair[1].span_s, rise, spread));
        }
    }
    let sum = |f: &dyn Fn(&Row) -> f64| rows.iter().map(|r| f(r) / r.3).sum::<f64>();
    let (aa, ab, bb) = (
        sum(&|r| r.0 * r.0),
        sum(&|r| r.0 * r.1),
        sum(&|r| r.1 * r.1),
    );
    let (ay, by) = (sum(&|r| r.0 * r.2), sum(&|r| r.1 * r.2));
    let det = aa * bb - ab * ab;
    let slope = if det > 0.0 {
        (aa * by - ab * ay) / det
    } else {
        0.0
    };
    Some(if slope > 0.0 {
        [(bb * ay - ab * by) / det, (bb / det).sqrt(), slope]
    } else {
        // white noise cannot fall with the span: the constant, by its most efficient estimate
        [square(last), variance(last).sqrt(), 0.0]
    })
}
