//! The series of one star, and what functions of time take of it.

use crate::unexplained::grid::Grid;

/// Points on each side of a step.
const MIN_SIDE: usize = 8;

/// One star's series in units of its noise, both axes.
pub(super) struct Own {
    pub(super) t_s: Vec<f64>,
    value: [Vec<f64>; 2],
    /// Squares of its rows, both axes.
    pub(super) rows_squares: f64,
    /// Rows that a point is the mean of: its variance is one over it.
    count: Vec<f64>,
    /// Sums of the rows, and of both axes over them, before each point.
    before: Vec<f64>,
    running: [Vec<f64>; 2],
}

/// Sums of two functions of time over the points of a star, and of their products with each axis.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    cc: f64,
    cs: f64,
    ss: f64,
    score: [[f64; 2]; 2],
}

impl Sums {
    /// Sizes of the two on each axis; none where they are not told apart.
    fn sizes(&self) -> [[f64; 2]; 2] {
        let determinant = self.cc * self.ss - self.cs * self.cs;
        self.score.map(|[c, s]| {
            let sizes = [self.ss * c - self.cs * s, self.cc * s - self.cs * c];
            if determinant > 0.0 {
                sizes.map(|size| size / determinant)
            } else {
                [0.0; 2]
            }
        })
    }

    /// Squares that the two take of both axes.
    fn squares(&self) -> f64 {
        let each = self.sizes().into_iter().zip(self.score);
        each.map(|([a, b], [c, s])| a * c + b * s).sum()
    }
}

impl Own {
    /// With the sums of the rows.
    pub(super) fn of(
        t_s: Vec<f64>,
        value: [Vec<f64>; 2],
        count: Vec<f64>,
        rows_squares: f64,
    ) -> Self {
        let sums = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let mut all = vec![0.0];
            for k in 0..count.len() {
                all.push(all[k] + of(k));
            }
            all
        };
        Self {
            before: sums(&|k| count[k]),
            running: [0, 1].map(|a| sums(&|k| count[k] * value[a][k])),
            t_s,
            value,
            rows_squares,
            count,
        }
    }

    /// Squares that a step at `t` takes of both axes, in units of the noise.
    pub(super) fn step_square(&self, t: f64) -> Option<f64> {
        let at = self.t_s.partition_point(|v| *v < t);
        if at < MIN_SIDE || at + MIN_SIDE > self.t_s.len() {
            return None;
        }
        let (n, total) = (self.before[at], self.before[self.t_s.len()]);
        let square = |running: &Vec<f64>| {
            let low = running[at];
            let change = (running[self.t_s.len()] - low) / (total - n) - low / n;
            n * (total - n) / total * change * change
        };
        Some(self.running.iter().map(square).sum())
    }

    /// A cosine and a sine of this frequency, at the points.
    fn phasors(&self, f: f64) -> Vec<[f64; 2]> {
        let omega = std::f64::consts::TAU * f;
        let each = self.t_s.iter().map(|t| omega * (t - self.t_s[0]));
        each.map(|phase| [phase.cos(), phase.sin()]).collect()
    }

    /// Squares that a parabola in time takes of both axes, in units of the noise.
    pub(super) fn parabola_square(&self) -> f64 {
        self.sums(&self.parabola()).squares()
    }

    /// A line and a parabola in time about their means, at the points.
    fn parabola(&self) -> Vec<[f64; 2]> {
        let all: f64 = self.count.iter().sum();
        let mean = |of: &dyn Fn(usize) -> f64| {
            let weighed = self.count.iter().enumerate().map(|(k, n)| n * of(k));
            weighed.sum::<f64>() / all
        };
        let middle = mean(&|k| self.t_s[k]);
        let half = self
            .t_s
            .iter()
            .fold(0.0, |most: f64, t| most.max((t - middle).abs()));
        let line = |k: usize| (self.t_s[k] - middle) / half;
        let square = mean(&|k| line(k) * line(k));
        let each = (0..self.t_s.len()).map(line);
        each.map(|z| [z, z * z - square]).collect()
    }

    /// Squares that a sinusoid of this frequency takes of both axes, in units of the noise.
    pub(super) fn power_at(&self, f: f64) -> f64 {
        self.sums(&self.phasors(f)).squares()
    }

    /// Sums of two functions of time, at the points.
    fn sums(&self, at: &[[f64; 2]]) -> Sums {
        let [x, y] = &self.value;
        let mut sums = Sums::default();
        for (i, (&[c, s], n)) in at.iter().zip(&self.count).enumerate() {
            let (nc, ns) = (n * c, n * s);
            sums.cc += nc * c;
            sums.cs += nc * s;
            sums.ss += ns * s;
            for (score, value) in sums.score.iter_mut().zip([x[i], y[i]]) {
                score[0] += nc * value;
                score[1] += ns * value;
            }
        }
        sums
    }

    /// Less what two functions of time take of each axis.
    pub(super) fn beside(&self, basis: impl Fn(f64) -> [f64; 2]) -> Self {
        let at: Vec<[f64; 2]> = self.t_s.iter().map(|t| basis(*t)).collect();
        let sizes = self.sums(&at).sizes();
        let mut value = self.value.clone();
        for (value, [a, b]) in value.iter_mut().zip(sizes) {
            for (v, [c, s]) in value.iter_mut().zip(&at) {
                *v -= a * c + b * s;
            }
        }
        Self::of(
            self.t_s.clone(),
            value,
            self.count.clone(),
            self.rows_squares,
        )
    }

    /// Squares that a sinusoid takes of both axes, in units of the noise, at the frequencies of
    /// `grid`. Phasors of all points are turned from one frequency to the next.
    pub(super) fn powers(&self, grid: &Grid) -> Vec<f64> {
        let (mut at, by) = (self.phasors(grid.first_hz), self.phasors(grid.step_hz));
        (0..grid.bins)
            .map(|_| {
                let squares = self.sums(&at).squares();
                for ([c, s], [bc, bs]) in at.iter_mut().zip(&by) {
                    (*c, *s) = (*c * bc - *s * bs, *s * bc + *c * bs);
                }
                squares
            })
            .collect()
    }
}
