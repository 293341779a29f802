//! Warm pixels that switch or drift, followed in time.
//!
//! ```text
//! z = F psi(p - s) + B + D(p) + d(p, t) + noise,     d: first-order Gauss-Markov, variance q, correlation time tau
//! I_w = W - W X (X^T W X + prior)^-1 X^T W           X = [psi, 1, -F psi_x, -F psi_y] of window w
//! y_w = I_w (z - model)                              score of d, information I_w
//! ```
//!
//! Flux, background and position of a window are free in `I_w`: whatever moves a star, slow or fast, is a
//! combination of the columns X, and `I_w` takes it to zero. What is followed cannot hold it, and the smoothed d, the
//! frame itself taken part, is that of the joint fit. From residuals at rigid positions it would eat the motion.
//!
//! Pixel by pixel, the strongest first: q and tau by maximum likelihood on a grid (frames of the fold left out
//! do not take part), the smoothed mean, and off the scores of all pixels in the same windows; again until
//! nothing moves. A pixel is followed if its likelihood ratio is beyond what chance makes of all of them. A
//! particle hit lasts one frame: a residual that is shared by the frame before or behind is none.
//!
//! Source: Kirton & Uren 1989, Advances in Physics 38, 367 (random telegraph signals: correlation
//! exp(-t/tau)); Rauch, Tung & Striebel 1965 (smoother).

use nalgebra::{Matrix4, Vector4};

use super::learn::Learned;
use super::robust::robust_median;
use super::sample::Sample;
use super::spot::WindowTaps;
use super::window_fit::Fitted;

/// Fewest frames in which a pixel has to be seen.
const MIN_VISITS: usize = 50;
/// Nats beyond the logarithm of the number of pixels: chance raises one in some hundred detectors.
const LEAST_GAIN: f64 = 6.0;
/// Correlation times that are tried, in steps from one visit to the next: what is faster is noise.
const TIMES: [f64; 4] = [10.0, 30.0, 100.0, 300.0];
/// Least variance that is tried, over that of one visit, the factor from one to the next, and their number.
const LEAST_VARIANCE: f64 = 0.03;
const FACTOR: f64 = 3.0;
const VARIANCES: i32 = 10;
/// Most rounds over all pixels, those that still choose q and tau, and the change that ends them, in sigmas of a visit.
const ROUNDS: usize = 10;
const CHOOSING: usize = 3;
const STANDS_STILL: f64 = 0.02;
/// Multiples of the noise beyond which a residual is a particle hit.
const CLIP: f64 = 5.0;

/// What the pixels add to their map, value by value.
pub(crate) struct Followed {
    pub(crate) shift: Vec<f64>,
    /// Variance of the map where pixels are not followed: what is followed knows its mean as well.
    pub(crate) variance: Vec<f64>,
    /// How many are followed.
    pub(crate) pixels: usize,
}

/// Follows the pixels of all windows. `fitted` by window, as `learned` found them; `taken`, whether
/// its frame may be learned from, too. `None` where nothing switches.
pub(crate) fn follow(
    sample: &Sample,
    learned: &Learned,
    fitted: &[Option<Fitted>],
    taken: &[bool],
) -> Option<Followed> {
    let visits = visits(sample);
    let scores = Scores::new(sample, learned, fitted, &visits, |_| true);
    let all = visits.iter().filter(|v| v.len() >= MIN_VISITS).count();
    let least = LEAST_GAIN + (all.max(1) as f64).ln();
    let choose = |scores: &Scores, shift: &[f64], visits: &[[usize; 2]]| {
        let series: Vec<Visit> = visits
            .iter()
            .filter(|v| taken[v[0]])
            .map(|&v| scores.visit(sample, v, shift))
            .filter(|v| v.information > 0.0)
            .collect();
        likeliest(&series).filter(|found| found.0 > least)
    };
    let mut shift = vec![0.0; sample.z.len()];
    let mut pixels: Vec<(f64, usize, Option<Process>)> = visits
        .iter()
        .enumerate()
        .filter_map(|(p, list)| choose(&scores, &shift, list).map(|(gain, _)| (gain, p, None)))
        .collect();
    if pixels.is_empty() {
        return None;
    }
    // what is far off in a pixel that nobody follows is left out, as it is of positions
    let mut may = vec![false; visits.len()];
    for &(_, p, _) in &pixels {
        may[p] = true;
    }
    let mut scores = Scores::new(sample, learned, fitted, &visits, |p| may[p]);
    pixels.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    for round in 0..ROUNDS {
        let mut change = 0.0_f64;
        for (_, p, process) in &mut pixels {
            let list = &visits[*p];
            if round < CHOOSING {
                *process = choose(&scores, &shift, list).map(|found| found.1);
            }
            let series: Vec<Visit> = list
                .iter()
                .map(|&v| scores.visit(sample, v, &shift))
                .collect();
            let smoothed = match process {
                Some(process) => process.smooth(&series),
                None => vec![0.0; series.len()],
            };
            for ((&[w, i], now), visit) in list.iter().zip(smoothed).zip(&series) {
                let step = now - shift[i];
                if step == 0.0 {
                    continue;
                }
                change = change.max(step.abs() * visit.information.sqrt());
                scores.take_off(sample, w, i, step);
                shift[i] = now;
            }
        }
        if change < STANDS_STILL {
            break;
        }
    }
    let mut variance = learned.dark.variance.clone();
    pixels.retain(|p| p.2.is_some());
    for &(_, p, _) in &pixels {
        variance[p] = 0.0;
    }
    (!pixels.is_empty()).then_some(Followed {
        shift,
        variance,
        pixels: pixels.len(),
    })
}

/// Window and value of every visit to each pixel, in time.
pub(crate) fn visits(sample: &Sample) -> Vec<Vec<[usize; 2]>> {
    let mut visits = vec![Vec::new(); sample.centre.len()];
    for w in 0..sample.windows() {
        for i in sample.cells_of(w) {
            visits[sample.pixel[i]].push([w, i]);
        }
    }
    visits
}

/// Scores of all values, and what they are made of.
pub(crate) struct Scores {
    pub(crate) weight: Vec<f64>,
    pub(crate) column: Vec<[f64; 4]>,
    inverse: Vec<Matrix4<f64>>,
    pub(crate) score: Vec<f64>,
}

impl Scores {
    pub(crate) fn new(
        sample: &Sample,
        learned: &Learned,
        fitted: &[Option<Fitted>],
        visits: &[Vec<[usize; 2]>],
        may: impl Fn(usize) -> bool,
    ) -> Self {
        let mut scores = Self {
            weight: vec![0.0; sample.z.len()],
            column: vec![[0.0; 4]; sample.z.len()],
            inverse: vec![Matrix4::zeros(); sample.windows()],
            score: vec![0.0; sample.z.len()],
        };
        // residuals first
        let mut taps = WindowTaps::default();
        for (w, fitted) in fitted.iter().enumerate() {
            let Some(fitted) = fitted else { continue };
            let spot = &learned.spots[sample.star[w]];
            taps.set(&learned.grid, sample, w, fitted.at);
            for (i, &[c, r]) in sample.cells_of(w).zip(&sample.cells) {
                if !sample.valid[i] {
                    continue;
                }
                let [psi, gx, gy] = learned.grid.evaluate(&spot.psi, &taps.x[c], &taps.y[r]);
                let pixel = sample.pixel[i];
                let model = fitted.flux * psi + fitted.background + learned.dark.value[pixel];
                // the map of a pixel that is followed is in what is followed
                let map = if may(pixel) {
                    0.0
                } else {
                    learned.dark.variance[pixel]
                };
                let variance = learned.noise.variance(model) + map;
                scores.column[i] = [psi, 1.0, -fitted.flux * gx, -fitted.flux * gy];
                scores.weight[i] = 1.0 / (spot.scale * spot.scale * variance);
                scores.score[i] = sample.z[i] - model;
            }
        }
        scores.leave_out_hits(visits, may);
        for (w, fitted) in fitted.iter().enumerate() {
            let Some(fitted) = fitted else { continue };
            scores.project(sample, learned, w, fitted);
        }
        scores
    }

    /// Weight zero to residuals that are far off; in pixels that may switch to those that are alone with it in time.
    fn leave_out_hits(&mut self, visits: &[Vec<[usize; 2]>], may: impl Fn(usize) -> bool) {
        let mut hits = Vec::new();
        for (p, list) in visits.iter().enumerate() {
            let seen: Vec<usize> = list
                .iter()
                .map(|v| v[1])
                .filter(|&i| self.weight[i] > 0.0)
                .collect();
            let off = |i: usize, from: f64, variance: f64| {
                let r = self.score[i] - from;
                r * r > CLIP * CLIP * (1.0 / self.weight[i] + variance)
            };
            for (k, &i) in seen.iter().enumerate() {
                let alone = |j: usize| off(i, self.score[j], 1.0 / self.weight[j]);
                let near = [k.checked_sub(1), Some(k + 1)];
                let mut near = near.iter().filter_map(|k| seen.get((*k)?));
                if off(i, 0.0, 0.0) && (!may(p) || near.all(|&j| alone(j))) {
                    hits.push(i);
                }
            }
        }
        for i in hits {
            self.weight[i] = 0.0;
        }
    }

    /// From residuals to scores.
    fn project(&mut self, sample: &Sample, learned: &Learned, w: usize, fitted: &Fitted) {
        let spot = &learned.spots[sample.star[w]];
        let prior = 1.0 / (spot.scale * spot.scale * spot.background_variance);
        let mut normal = Matrix4::zeros();
        let mut moment = Vector4::zeros();
        normal[(1, 1)] = prior;
        moment[1] = prior * (spot.background - fitted.background);
        for i in sample.cells_of(w) {
            let x = Vector4::from(self.column[i]);
            normal += self.weight[i] * x * x.transpose();
            moment += self.weight[i] * self.score[i] * x;
        }
        let Some(factor) = normal.cholesky() else {
            self.weight[sample.cells_of(w)].fill(0.0);
            self.score[sample.cells_of(w)].fill(0.0);
            return;
        };
        self.inverse[w] = factor.inverse();
        let step = self.inverse[w] * moment;
        for i in sample.cells_of(w) {
            let x = Vector4::from(self.column[i]);
            self.score[i] = self.weight[i] * (self.score[i] - x.dot(&step));
        }
    }

    /// What one visit says of its pixel, all other pixels as they are.
    fn visit(&self, sample: &Sample, [w, i]: [usize; 2], shift: &[f64]) -> Visit {
        let x = Vector4::from(self.column[i]);
        let weight = self.weight[i];
        let information = (weight - weight * weight * x.dot(&(self.inverse[w] * x))).max(0.0);
        Visit {
            t_s: sample.t_s[w],
            information,
            score: self.score[i] + information * shift[i],
        }
    }

    /// The scores of window `w` once value `i` has `step` more of its own.
    fn take_off(&mut self, sample: &Sample, w: usize, i: usize, step: f64) {
        let weighted = self.weight[i] * step;
        let u = self.inverse[w] * Vector4::from(self.column[i]) * weighted;
        for j in sample.cells_of(w) {
            self.score[j] += self.weight[j] * Vector4::from(self.column[j]).dot(&u);
        }
        self.score[i] -= weighted;
    }
}

/// One pixel in one window.
#[derive(Clone, Copy, Debug)]
struct Visit {
    t_s: f64,
    information: f64,
    score: f64,
}

/// A first-order Gauss-Markov process.
#[derive(Clone, Copy, Debug)]
struct Process {
    variance: f64,
    tau_s: f64,
}

impl Process {
    /// Log-likelihood over that of a pixel which does not change.
    fn gain(self, series: &[Visit]) -> f64 {
        let (mut mean, mut variance, mut gain) = (0.0, self.variance, 0.0);
        let mut last = f64::NAN;
        for v in series {
            if last.is_finite() {
                let a = self.kept(v.t_s - last);
                mean *= a;
                variance = self.variance + a * a * (variance - self.variance);
            }
            last = v.t_s;
            let wider = 1.0 + variance * v.information;
            let off = v.score - v.information * mean;
            gain += 0.5 * ((v.score * v.score - off * off / wider) / v.information - wider.ln());
            mean += variance * off / wider;
            variance /= wider;
        }
        gain
    }

    /// Smoothed mean at every visit.
    fn smooth(self, series: &[Visit]) -> Vec<f64> {
        let mut state = Vec::with_capacity(series.len());
        let (mut mean, mut variance) = (0.0, self.variance);
        for (k, v) in series.iter().enumerate() {
            let a = match k {
                0 => 0.0,
                _ => self.kept(v.t_s - series[k - 1].t_s),
            };
            mean *= a;
            variance = self.variance + a * a * (variance - self.variance);
            let predicted = [mean, variance];
            let wider = 1.0 + variance * v.information;
            mean += variance * (v.score - v.information * mean) / wider;
            variance /= wider;
            state.push((a, predicted, [mean, variance]));
        }
        let mut out: Vec<f64> = state.iter().map(|s| s.2[0]).collect();
        for k in (1..state.len()).rev() {
            let (a, predicted, _) = state[k];
            let [mean, variance] = state[k - 1].2;
            out[k - 1] = mean + a * variance / predicted[1] * (out[k] - predicted[0]);
        }
        out
    }

    fn kept(self, gap_s: f64) -> f64 {
        (-gap_s.abs() / self.tau_s).exp()
    }
}

/// The likeliest process of those that are tried, and its gain.
fn likeliest(series: &[Visit]) -> Option<(f64, Process)> {
    if series.len() < MIN_VISITS {
        return None;
    }
    let gaps = series.windows(2).map(|v| v[1].t_s - v[0].t_s).collect();
    let step_s = robust_median(gaps)?;
    let information = robust_median(series.iter().map(|v| v.information).collect())?;
    if !(step_s > 0.0 && information > 0.0) {
        return None;
    }
    let span_s = series[series.len() - 1].t_s - series[0].t_s;
    let mut best: Option<(f64, Process)> = None;
    for steps in TIMES {
        let tau_s = steps * step_s;
        if tau_s > span_s {
            break;
        }
        let mut last = f64::NEG_INFINITY;
        for k in 0..VARIANCES {
            let process = Process {
                variance: LEAST_VARIANCE * FACTOR.powi(k) / information,
                tau_s,
            };
            let gain = process.gain(series);
            // one top
            if gain < last {
                break;
            }
            last = gain;
            if best.is_none_or(|b| gain > b.0) {
                best = Some((gain, process));
            }
        }
    }
    best
}
