//! Averages of many points, for pictures of what a residual depends on.
//!
//! ```text
//! value = mean of the points of a cell,   sigma = s / sqrt n
//! ```
//!
//! Not physics: averages.

/// Means over position inside a pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhaseBins {
    /// Middle of each bin, 0 to 1.
    pub phase: Vec<f64>,
    /// Mean value.
    pub mean: Vec<f64>,
    /// Standard error of the mean; NaN below two points.
    pub sigma: Vec<f64>,
}

impl PhaseBins {
    /// Averages `value` over `bins` bins of `phase` (any number; its whole part does not count). Bins
    /// without a point are left out.
    ///
    /// ```
    /// let bins = figures::PhaseBins::new(&[0.1, 3.15, -0.3], &[1.0, 3.0, 7.0], 2);
    /// assert_eq!((bins.phase, bins.mean), (vec![0.25, 0.75], vec![2.0, 7.0]));
    /// ```
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    #[must_use]
    pub fn new(phase: &[f64], value: &[f64], bins: usize) -> Self {
        assert_eq!(phase.len(), value.len(), "one value for each phase");
        let mut sums = vec![Sums::default(); bins];
        for (p, v) in phase.iter().zip(value) {
            if p.is_finite() && v.is_finite() {
                sums[cell(p - p.floor(), bins)].add(*v);
            }
        }
        let mut out = Self::default();
        for (k, sums) in sums.iter().enumerate().filter(|(_, s)| s.n > 0.0) {
            out.phase.push((k as f64 + 0.5) / bins as f64);
            out.mean.push(sums.mean());
            out.sigma.push(sums.error());
        }
        out
    }
}

/// Means of vectors over a field.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FieldBins {
    /// Middle of each cell.
    pub x: Vec<f64>,
    /// Middle of each cell.
    pub y: Vec<f64>,
    /// Mean along x.
    pub dx: Vec<f64>,
    /// Mean along y.
    pub dy: Vec<f64>,
    /// Points in it.
    pub count: Vec<usize>,
}

impl FieldBins {
    /// Averages `dx, dy` over `cells` by `cells` cells of the field from `-half` to `half`. Cells with
    /// fewer than `least` points are left out, and so is what lies outside.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    #[must_use]
    pub fn new(
        at: [&[f64]; 2],
        d: [&[f64]; 2],
        half: [f64; 2],
        cells: usize,
        least: usize,
    ) -> Self {
        let n = at[0].len();
        assert!(
            at[1].len() == n && d[0].len() == n && d[1].len() == n,
            "one vector for each place"
        );
        let mut sums = vec![[Sums::default(); 2]; cells * cells];
        for k in 0..n {
            let part = [0, 1].map(|axis| 0.5 + 0.5 * at[axis][k] / half[axis]);
            let finite = d[0][k].is_finite() && d[1][k].is_finite();
            if finite && part.iter().all(|p| (0.0..=1.0).contains(p)) {
                let [i, j] = part.map(|p| cell(p, cells));
                for axis in 0..2 {
                    sums[j * cells + i][axis].add(d[axis][k]);
                }
            }
        }
        let mut out = Self::default();
        for (k, [sx, sy]) in sums.iter().enumerate() {
            if sx.n >= (least.max(1)) as f64 {
                let middle = |i: usize, half: f64| half * ((2 * i + 1) as f64 / cells as f64 - 1.0);
                out.x.push(middle(k % cells, half[0]));
                out.y.push(middle(k / cells, half[1]));
                out.dx.push(sx.mean());
                out.dy.push(sy.mean());
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a count"
                )]
                out.count.push(sx.n as usize);
            }
        }
        out
    }
}

/// Where most of a long series lies: its 5th, 50th and 95th percentile over stretches of one length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Envelope {
    /// Middle of each stretch.
    pub x: Vec<f64>,
    /// 5th percentile.
    pub low: Vec<f64>,
    /// Median.
    pub median: Vec<f64>,
    /// 95th percentile.
    pub high: Vec<f64>,
}

impl Envelope {
    /// The series `x, y`, `x` in any order, over so many stretches. A stretch without a value is NaN,
    /// so that a gap stays a gap.
    ///
    /// ```
    /// let t: Vec<f64> = (0..200).map(f64::from).collect();
    /// let envelope = figures::Envelope::new(&t, &t, 2);
    /// assert!((envelope.median[0] - 50.0).abs() < 1.0 && envelope.high[0] < 100.0);
    /// ```
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    #[must_use]
    pub fn new(x: &[f64], y: &[f64], stretches: usize) -> Self {
        assert_eq!(x.len(), y.len(), "one y for each x");
        let mut out = Self::default();
        let first = x.iter().copied().fold(f64::INFINITY, f64::min);
        let last = x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let width = last - first;
        if !(width > 0.0 && width.is_finite()) {
            return out;
        }
        let mut values = vec![vec![]; stretches];
        for (x, y) in x.iter().zip(y) {
            if x.is_finite() && y.is_finite() {
                values[cell((x - first) / width, stretches)].push(*y);
            }
        }
        for (k, values) in values.iter_mut().enumerate() {
            values.sort_by(f64::total_cmp);
            let at = |part: f64| values.get(cell(part, values.len().max(1))).copied();
            out.x
                .push(first + width * (k as f64 + 0.5) / stretches as f64);
            out.low.push(at(0.05).unwrap_or(f64::NAN));
            out.median.push(at(0.5).unwrap_or(f64::NAN));
            out.high.push(at(0.95).unwrap_or(f64::NAN));
        }
        out
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    n: f64,
    mean: f64,
    square: f64,
}

impl Sums {
    /// Welford's update: no digits are lost where the mean is large.
    fn add(&mut self, v: f64) {
        self.n += 1.0;
        let d = v - self.mean;
        self.mean += d / self.n;
        self.square += d * (v - self.mean);
    }

    fn mean(&self) -> f64 {
        self.mean
    }

    fn error(&self) -> f64 {
        if self.n < 2.0 {
            return f64::NAN;
        }
        (self.square / (self.n - 1.0) / self.n).sqrt()
    }
}

/// Cell of a part from 0 to 1.
fn cell(part: f64, cells: usize) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an index, cut to the cells there are"
    )]
    let k = (part * cells as f64).max(0.0) as usize;
    k.min(cells - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_hold_their_own_points() {
        let (x, y) = ([-9.0, -8.0, 9.0, 50.0], [-9.0, -7.0, 9.0, 0.0]);
        let (dx, dy) = ([1.0, 3.0, 5.0, 9.0], [0.0, 0.0, -2.0, 9.0]);
        let bins = FieldBins::new([&x, &y], [&dx, &dy], [10.0, 10.0], 2, 1);
        assert_eq!((bins.x, bins.y), (vec![-5.0, 5.0], vec![-5.0, 5.0]));
        assert_eq!((bins.dx, bins.dy), (vec![2.0, 5.0], vec![0.0, -2.0]));
        assert_eq!(bins.count, [2, 1]);
    }

    #[test]
    fn a_gap_stays_a_gap() {
        let x = [0.0, 1.0, 2.0, 8.0, 9.0, 10.0];
        let envelope = Envelope::new(&x, &[1.0; 6], 5);
        assert!(envelope.median[2].is_nan() && envelope.low[0] > 0.0 && envelope.high[4] > 0.0);
        assert!(Envelope::new(&[1.0], &[1.0], 5).x.is_empty());
    }

    /// Standard error of 0, 1, ..., 9: sqrt(55/6 / 10).
    #[test]
    fn the_error_is_that_of_the_mean() {
        let value: Vec<f64> = (0..10).map(f64::from).collect();
        let bins = PhaseBins::new(&[0.5; 10], &value, 1);
        assert!((bins.sigma[0] - (55.0_f64 / 60.0).sqrt()).abs() < 1e-12);
    }
}
