//! The exact likelihood of a series: uniformly sampled, with missing samples, or at any times.
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
    /// Runs of samples without a hole, each with the steps missing before it.
    runs: Vec<(f64, std::ops::Range<usize>)>,
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
        let mut end = 0;
        let runs = runs
            .into_iter()
            .map(|run| {
                let missing = run.start - end;
                end = run.end;
                (missing as f64, run)
            })
            .collect();
        Self {
            y,
            runs,
            dt_s,
            used,
            free_mean,
        }
    }

    /// Samples at `t_s`, ascending; where an interval is one step within `tolerance` of it, the
    /// sample counts as the next of a uniform run. No value is NaN.
    pub(crate) fn at_times(
        t_s: &[f64],
        y: Vec<f64>,
        dt_s: f64,
        tolerance: f64,
        free_mean: bool,
    ) -> Self {
        let mut runs: Vec<(f64, std::ops::Range<usize>)> = vec![];
        for k in 0..y.len() {
            let steps = if k == 0 {
                1.0
            } else {
                (t_s[k] - t_s[k - 1]) / dt_s
            };
            match runs.last_mut() {
                Some((_, run)) if (steps - 1.0).abs() <= tolerance => run.end = k + 1,
                // one step is in the recursion itself; fewer is a step back of the prediction
                _ => runs.push((steps - 1.0, k..k + 1)),
            }
        }
        Self {
            used: y.len(),
            y,
            runs,
            dt_s,
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
        for (missing, run) in &self.runs {
            filter.skip(*missing);
            filter.run(&self.y[run.clone()]);
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

    /// Carries the prediction over missing steps, whole or not. Of an interval shorter than a step the
    /// recursion has gone too far already: the steps are negative then, and lead back exactly.
    fn skip(&mut self, missing: f64) {
        if missing == 0.0 {
            return;
        }
        for l in 0..LANES {
            let a = (-self.x[l] * missing).exp();
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

    /// ln L of samples at irregular times, some closer than a step and some far apart, against the dense
    /// covariance matrix: 80 samples of condition below 1e3, so 1e-9 leaves room.
    #[test]
    fn irregular_times_have_the_likelihood_of_dense_matrices() {
        let (dt_s, sigma, tau, white) = (0.7, 2.0_f64, 3.0, 0.8_f64);
        let mut t = 10.0;
        let (t_s, y): (Vec<f64>, Vec<f64>) = (0..80_u32)
            .map(|k| {
                t += [0.7, 0.21, 1.9, 0.7, 0.715, 40.0, 0.7][k as usize % 7];
                (t, f64::from((k * 7919) % 101) / 20.0 - 2.5)
            })
            .unzip();
        let n = t_s.len();
        let mut l = vec![vec![0.0; n]; n];
        let mut ln_det = 0.0;
        for i in 0..n {
            for j in 0..=i {
                let mut c = sigma * sigma * (-(t_s[i] - t_s[j]).abs() / tau).exp();
                c += if i == j { white * white } else { 0.0 };
                c -= (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>();
                l[i][j] = if i == j { c.sqrt() } else { c / l[j][j] };
            }
            ln_det += 2.0 * l[i][i].ln();
        }
        let whitened = |values: &dyn Fn(usize) -> f64| {
            let mut z = vec![0.0; n];
            for i in 0..n {
                let past: f64 = (0..i).map(|k| l[i][k] * z[k]).sum();
                z[i] = (values(i) - past) / l[i][i];
            }
            z
        };
        let (zy, z1) = (whitened(&|i| y[i]), whitened(&|_| 1.0));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let ones = dot(&z1, &z1);
        let want = -0.5 * (ln_det + ones.ln() + dot(&zy, &zy) - dot(&zy, &z1).powi(2) / ones);

        let (place, ln_v) = place_of([sigma.ln(), f64::ln(tau), white.ln()], dt_s);
        // 0.715 s counts as a step at 5 % and not at 1 %: the filter is exact only in the latter case
        let exact = Exact::at_times(&t_s, y.clone(), dt_s, 0.01, true);
        let Value { a, b } = exact.evaluate(&[place; LANES])[0];
        let ln_l = -(exact.weight() * ln_v + a + b / ln_v.exp());
        assert!((ln_l - want).abs() < 1e-9, "{ln_l}, but {want}");
        let rounded = Exact::at_times(&t_s, y, dt_s, 0.05, true).evaluate(&[place; LANES])[0];
        let rounded = -(exact.weight() * ln_v + rounded.a + rounded.b / ln_v.exp());
        // 15 intervals wrong by 0.5 % of tau each: far below the 1.92 of an interval
        let off = (rounded - want).abs();
        assert!(off > 1e-6 && off < 0.1, "{off}");
    }
}
