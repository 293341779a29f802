//! The exact likelihood of a uniformly sampled series, missing samples included.
//!
//! ```text
//! e = y - s,   F = P + w^2,   K = P / F                       innovation, its variance, gain
//! s <- a (s + K e),   P <- a^2 P (1 - K) + q                  next prediction (a missing sample: K = 0)
//! ln L = -1/2 [sum ln F + sum e^2/F]                          from s = 0, P = sigma_HSF^2
//! ```
//!
//! The unknown mean is a diffuse nuisance: with `g` the same filter run on ones, the sum of squares
//! loses `(sum e g/F)^2 / sum g^2/F` and the log-determinant gains `ln sum g^2/F` (restricted
//! likelihood: no bias from estimating a mean of a correlated series).
//!
//! Once P has settled, so have F and K, and a sample costs a few additions.
//!
//! Source: Harvey, Forecasting, Structural Time Series Models and the Kalman Filter (1989), sections
//! 3.4 and 4.2; Harville, JASA 72 (1977) 320 for the restricted likelihood.

use super::likelihood::{LANES, Likelihood, Place, Unit, Value};

/// A series ready for its likelihood.
#[derive(Debug)]
pub(crate) struct Exact {
    /// Deviations from their mean (or from zero); NaN where missing.
    y: Vec<f64>,
    /// Runs of samples without a hole.
    runs: Vec<std::ops::Range<usize>>,
    dt_s: f64,
    used: usize,
    free_mean: bool,
}

impl Exact {
    pub(crate) fn new(y: Vec<f64>, dt_s: f64, free_mean: bool) -> Self {
        let mut runs = vec![];
        let mut from = None;
        for (k, value) in y.iter().enumerate() {
            match (value.is_nan(), from) {
                (false, None) => from = Some(k),
                (true, Some(start)) => {
                    runs.push(start..k);
                    from = None;
                }
                _ => {}
            }
        }
        runs.extend(from.map(|start| start..y.len()));
        let used = runs.iter().map(ExactSizeIterator::len).sum();
        Self {
            y,
            runs,
            dt_s,
            used,
            free_mean,
        }
    }

    /// ln L at its best of white noise alone.
    pub(crate) fn white(&self) -> f64 {
        let sum: f64 = self.y.iter().filter(|y| !y.is_nan()).map(|y| y * y).sum();
        let w = self.weight();
        let mean = if self.free_mean {
            0.5 * (self.used as f64).ln()
        } else {
            0.0
        };
        -(w * (0.5 * sum / w).ln() + mean + w)
    }
}

impl Likelihood for Exact {
    fn weight(&self) -> f64 {
        0.5 * (self.used as f64 - if self.free_mean { 1.0 } else { 0.0 })
    }

    fn evaluate(&self, places: &[Place; LANES]) -> [Value; LANES] {
        let mut filter = Filter::new(places, self.dt_s);
        let mut end = 0;
        for run in &self.runs {
            filter.skip(run.start - end);
            filter.run(&self.y[run.clone()]);
            end = run.end;
        }
        filter.values(self.free_mean)
    }
}

type Lanes = [f64; LANES];

/// Relative distance from the settled variance, and of the ones' filter from its limit, below which
/// they count as settled.
const SETTLED: f64 = 1e-13;
/// Samples between two looks at whether the filter has settled.
const BLOCK: usize = 32;

struct Filter {
    a: Lanes,
    a2: Lanes,
    q: Lanes,
    w: Lanes,
    x: Lanes,
    fogm: Lanes,
    p: Lanes,
    s: Lanes,
    h: Lanes,
    ee: Lanes,
    eg: Lanes,
    gg: Lanes,
    ln_f: Lanes,
}

impl Filter {
    fn new(places: &[Place; LANES], dt_s: f64) -> Self {
        let unit = places.map(|place| Unit::new(place, dt_s));
        let fogm = unit.map(|u| u.fogm());
        Self {
            a: unit.map(|u| u.step.a),
            a2: unit.map(|u| u.step.a * u.step.a),
            q: unit.map(|u| u.drive),
            w: unit.map(|u| u.white),
            x: unit.map(|u| u.step.x),
            fogm,
            p: fogm,
            s: [0.0; LANES],
            h: [0.0; LANES],
            ee: [0.0; LANES],
            eg: [0.0; LANES],
            gg: [0.0; LANES],
            ln_f: [0.0; LANES],
        }
    }

    /// Carries the prediction over missing samples.
    fn skip(&mut self, missing: usize) {
        if missing == 0 {
            return;
        }
        for l in 0..LANES {
            let a = (-self.x[l] * missing as f64).exp();
            self.s[l] *= a;
            self.h[l] *= a;
            self.p[l] = self.fogm[l] + a * a * (self.p[l] - self.fogm[l]);
        }
    }

    fn run(&mut self, y: &[f64]) {
        let mut rest = y;
        while !rest.is_empty() {
            let (block, tail) = rest.split_at(rest.len().min(BLOCK));
            let settled = self.transient(block);
            rest = tail;
            if settled {
                break;
            }
        }
        self.settled(rest);
    }

    /// One block with all variances moving; whether they have stopped.
    fn transient(&mut self, block: &[f64]) -> bool {
        let mut product = [1.0; LANES];
        let mut change = [0.0; LANES];
        for (k, y) in block.iter().enumerate() {
            for l in 0..LANES {
                let f = self.p[l] + self.w[l];
                let inverse = 1.0 / f;
                let gain = self.p[l] * inverse;
                let (e, g) = (y - self.s[l], 1.0 - self.h[l]);
                self.ee[l] += e * e * inverse;
                self.eg[l] += e * g * inverse;
                self.gg[l] += g * g * inverse;
                product[l] *= f;
                self.s[l] = self.a[l] * (self.s[l] + gain * e);
                self.h[l] = self.a[l] * (self.h[l] + gain * g);
                let next = self.a2[l] * (gain * self.w[l]) + self.q[l];
                change[l] = next - self.p[l];
                self.p[l] = next;
            }
            // F is at least 1: sixteen of them stay far from overflow
            if k % 16 == 15 || k + 1 == block.len() {
                for l in 0..LANES {
                    self.ln_f[l] += product[l].ln();
                    product[l] = 1.0;
                }
            }
        }
        (0..LANES).all(|l| change[l].abs() <= SETTLED * self.p[l])
    }

    /// The remaining samples at constant gain.
    fn settled(&mut self, y: &[f64]) {
        if y.is_empty() {
            return;
        }
        let mut gain = [0.0; LANES];
        let mut pole = [0.0; LANES];
        let mut inverse = [0.0; LANES];
        for l in 0..LANES {
            let f = self.p[l] + self.w[l];
            inverse[l] = 1.0 / f;
            gain[l] = self.a[l] * self.p[l] / f;
            pole[l] = self.a[l] * self.w[l] / f;
            self.ln_f[l] += f.ln() * y.len() as f64;
        }
        let (mut ee, mut eg, mut gg) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        let mut rest = y;
        // until the ones' filter has settled too
        while !rest.is_empty() {
            let (block, tail) = rest.split_at(rest.len().min(BLOCK));
            let mut change = [0.0_f64; LANES];
            for y in block {
                for l in 0..LANES {
                    let (e, g) = (y - self.s[l], 1.0 - self.h[l]);
                    ee[l] += e * e;
                    eg[l] += e * g;
                    gg[l] += g * g;
                    self.s[l] = pole[l] * self.s[l] + gain[l] * y;
                    let next = pole[l] * self.h[l] + gain[l];
                    change[l] = next - self.h[l];
                    self.h[l] = next;
                }
            }
            rest = tail;
            if (0..LANES).all(|l| change[l].abs() <= SETTLED * (1.0 - self.h[l]).abs()) {
                break;
            }
        }
        let mut sum = [0.0; LANES];
        for y in rest {
            for l in 0..LANES {
                let e = y - self.s[l];
                ee[l] += e * e;
                sum[l] += e;
                self.s[l] = pole[l] * self.s[l] + gain[l] * y;
            }
        }
        for l in 0..LANES {
            let g = 1.0 - self.h[l];
            self.ee[l] += inverse[l] * ee[l];
            self.eg[l] += inverse[l] * (eg[l] + g * sum[l]);
            self.gg[l] += inverse[l] * (gg[l] + g * g * rest.len() as f64);
        }
    }

    fn values(&self, free_mean: bool) -> [Value; LANES] {
        std::array::from_fn(|l| {
            if free_mean {
                Value {
                    a: 0.5 * (self.ln_f[l] + self.gg[l].ln()),
                    b: 0.5 * (self.ee[l] - self.eg[l] * self.eg[l] / self.gg[l]),
                }
            } else {
                Value {
                    a: 0.5 * self.ln_f[l],
                    b: 0.5 * self.ee[l],
                }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::likelihood::place_of;
    use super::*;

    fn table(name: &str) -> Vec<Vec<f64>> {
        let path = format!(
            "{}/../../fixtures/oracles/fogm-fit/{name}",
            env!("CARGO_MANIFEST_DIR")
        );
        let rows = csv::Reader::from_path(path).unwrap().into_records();
        rows.map(|r| r.unwrap().iter().map(|v| v.parse().unwrap()).collect())
            .collect()
    }

    /// ln L at given parameters against dense covariance matrices. Those lose digits with their
    /// condition, up to 3e4 here; the filter's settled variances are good to 1e-13.
    #[test]
    fn filter_has_the_likelihood_of_dense_matrices() {
        let series = table("series.csv");
        for row in table("likelihoods.csv") {
            let column = if row[0] < 0.5 { 1 } else { 2 };
            let y = series.iter().map(|r| r[column] - 100.0).collect();
            let exact = Exact::new(y, 1.0, true);
            let (place, ln_v) = place_of([row[1].ln(), row[2].ln(), row[3].ln()], 1.0);
            let Value { a, b } = exact.evaluate(&[place; LANES])[0];
            let ln_l = -(exact.weight() * ln_v + a + b / ln_v.exp());
            assert!((ln_l - row[4]).abs() < 1e-8, "{ln_l}, but {}", row[4]);
        }
    }

    /// The settled recursion against the one with all variances moving: what settles is off by at most
    /// 1e-13 a sample, of 3000.
    #[test]
    fn settling_changes_nothing() {
        let y: Vec<f64> = (0..3000)
            .map(|k| f64::from((k * 7919) % 101) - 50.0)
            .collect();
        let places: [Place; LANES] = std::array::from_fn(|l| Place {
            x: [0.1_f64, 1.0, 5.0, 30.0, 100.0, 1e3, 1e5, 3.0][l].ln(),
            u: [0.0, -1.0, -2.0, -4.0, 0.5, -3.0, -6.0, 8.0][l],
        });
        let whole = Exact::new(y.clone(), 1.0, true).evaluate(&places);
        let mut filter = Filter::new(&places, 1.0);
        for part in y.chunks(20) {
            filter.transient(part);
        }
        for (a, b) in whole.iter().zip(filter.values(true)) {
            assert!((a.a - b.a).abs() < 1e-9 * b.a.abs().max(1.0), "{a:?} {b:?}");
            assert!((a.b - b.b).abs() < 1e-9 * b.b, "{a:?} {b:?}");
        }
    }
}
