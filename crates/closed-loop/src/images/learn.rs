//! Spots, dark map and noise learned together from the windows of some frames.
//!
//! ```text
//! z(t, i, p) = F_ti psi_i(p - s_ti) + B_ti + D(p) + noise
//! ```
//!
//! In turn: rigid positions; spot of each star and dark map at these; flux,
//! background and free position of every window; backgrounds' spread; pixel noise.
//! A uniform dark level, a pedestal of the spot and a constant background cannot be
//! told apart: only contrasts of the map mean anything.
//!
//! Source: Anderson & King 2000, PASP 112, 1360 (alternation of positions and
//! effective PSF).

use rayon::prelude::*;

use super::banded::Banded;
use super::dark::{self, Dark};
use super::geometry::Geometry;
use super::pixel_noise::{self, MIN_READ_VARIANCE};
use super::sample::Sample;
use super::spline::Grid;
use super::spot;
use super::window_fit::{self, Fitted, Known, PixelNoise, Pixels};
use super::{MAD_SCALE, robust_median};

/// Rounds of everything.
const OUTER: usize = 5;
/// Rounds of spots and map at fixed positions.
const INNER: usize = 2;
/// Gauss-Newton steps of a window while learning, and when all else is frozen.
const LEARNING_STEPS: usize = 3;
const FINAL_STEPS: usize = 8;
/// Starting values in the scaled unit, each far on the side of knowing nothing:
/// variance of backgrounds, and variance of the second differences of a spot.
const BACKGROUND_VARIANCE: f64 = 1e4;
const ROUGHNESS: f64 = 1e-6;
/// A star's weight in the attitude over the median star's.
const MAX_WEIGHT: f64 = 3.0;
/// Fewest windows to learn a spot from.
const MIN_WINDOWS: usize = 10;
/// Residuals that the noise is judged by.
const NOISE_RESIDUALS: usize = 100_000;

/// What is learned of one star.
#[derive(Clone, Debug)]
pub(crate) struct Spot {
    /// Spline coefficients; empty where there were too few windows.
    pub(crate) psi: Vec<f64>,
    roughness: f64,
    pub(crate) background: f64,
    background_variance: f64,
    scale: f64,
}

/// What is learned from some frames.
#[derive(Clone, Debug)]
pub(crate) struct Learned {
    pub(crate) grid: Grid,
    pub(crate) spots: Vec<Spot>,
    pub(crate) dark: Dark,
    pub(crate) noise: PixelNoise,
    /// Pixels left out as particle hits in the last round.
    pub(crate) clipped: usize,
    /// 1 sigma of the map with the spots unknown; empty unless asked for.
    pub(crate) dark_sigma: Vec<f64>,
}

/// State of the alternation, by window and by value.
struct State {
    fitted: Vec<Fitted>,
    /// Flux and rigid position, split off for the sums over pixels.
    flux: Vec<f64>,
    at: Vec<[f64; 2]>,
    weight: Vec<f64>,
    good: Vec<bool>,
    model: Vec<f64>,
    residual: Vec<f64>,
}

/// Learns from the frames `taken`. `length_px` is the scale of the field, px.
pub(crate) fn learn(
    sample: &Sample,
    taken: &[usize],
    grid: Grid,
    length_px: f64,
    with_sigma: bool,
) -> Learned {
    let windows = usable(sample, taken);
    let n = sample.windows();
    let mut state = State {
        fitted: (0..n)
            .map(|w| Fitted { at: sample.start[w], flux: sample.flux[w], ..Fitted::default() })
            .collect(),
        flux: sample.flux.clone(),
        at: sample.start.clone(),
        weight: vec![0.0; sample.z.len()],
        good: sample.valid.clone(),
        model: Vec::new(),
        residual: vec![0.0; sample.z.len()],
    };
    let mut learned = Learned {
        grid,
        spots: windows.iter().map(|list| first_guess(sample, list, &mut state, &grid)).collect(),
        dark: Dark::none(sample.centre.len()),
        noise: PixelNoise {
            a: (0.1 * robust_median(sample.z.clone()).unwrap_or(0.0)).max(0.0) + 1.0,
            b: 1.0,
        },
        clipped: 0,
        dark_sigma: Vec::new(),
    };
    let mut star_weight = vec![1.0; sample.stars];
    for outer in 0..OUTER {
        place(sample, taken, &mut state, &star_weight, length_px);
        weigh(sample, &windows, &mut state, learned.noise);
        let normals = learned.learn_spots_and_dark(sample, &windows, &state);
        if with_sigma && outer == OUTER - 1 {
            learned.dark_sigma = learned.marginal_sigma(sample, &windows, &state, &normals);
        }
        let weights = learned.fit_windows(sample, &windows, &mut state);
        learned.learn_noise(sample, &windows, &state);
        star_weight = weights;
    }
    learned.clipped = windows
        .iter()
        .flatten()
        .flat_map(|&w| sample.cells_of(w))
        .filter(|&i| sample.valid[i] && !state.good[i])
        .count();
    learned
}

/// Windows by star; none of a star that has too few.
fn usable(sample: &Sample, taken: &[usize]) -> Vec<Vec<usize>> {
    let mut windows = sample.by_star(taken);
    for list in &mut windows {
        if list.len() < MIN_WINDOWS {
            list.clear();
        }
    }
    windows
}

fn first_guess(sample: &Sample, list: &[usize], state: &mut State, grid: &Grid) -> Spot {
    let background =
        robust_median(list.iter().map(|&w| sample.background[w]).collect()).unwrap_or(0.0);
    for &w in list {
        state.fitted[w].background = background;
    }
    Spot {
        psi: if list.is_empty() { Vec::new() } else { vec![0.0; grid.len()] },
        roughness: ROUGHNESS,
        background,
        background_variance: BACKGROUND_VARIANCE,
        scale: 1.0,
    }
}

/// Rigid positions from the free ones.
fn place(sample: &Sample, taken: &[usize], state: &mut State, weight: &[f64], length_px: f64) {
    let free: Vec<[f64; 2]> = state.fitted.iter().map(|f| f.at).collect();
    let geometry = Geometry::fit(sample, taken, &free, weight, length_px);
    let residual = geometry.residual(sample, taken, &free);
    for (w, (p, r)) in free.iter().zip(&residual).enumerate() {
        state.at[w] = [p[0] - r[0], p[1] - r[1]];
        state.flux[w] = state.fitted[w].flux;
    }
}

/// Weights of the values: from the value itself until there is a model.
fn weigh(sample: &Sample, windows: &[Vec<usize>], state: &mut State, noise: PixelNoise) {
    let source = if state.model.is_empty() { &sample.z } else { &state.model };
    for &w in windows.iter().flatten() {
        for i in sample.cells_of(w) {
            state.weight[i] = if state.good[i] { 1.0 / noise.variance(source[i]) } else { 0.0 };
        }
    }
}

impl Learned {
    /// Spots at the given map, the map at these spots, and so on. Returns the
    /// spots' precisions.
    fn learn_spots_and_dark(
        &mut self,
        sample: &Sample,
        windows: &[Vec<usize>],
        state: &State,
    ) -> Vec<Option<Banded>> {
        let grid = self.grid;
        let normals: Vec<_> = windows
            .par_iter()
            .map(|list| spot::normal(&grid, sample, list, &state.flux, &state.at, &state.weight))
            .collect();
        for inner in 0..INNER {
            let dark = &self.dark.value;
            self.spots.par_iter_mut().zip(&normals).zip(windows).for_each(|((spot, normal), list)| {
                if list.is_empty() {
                    return;
                }
                let mut psi = spot::moment(
                    &grid, sample, list, &state.flux, &state.at, &state.weight,
                    |w, i| sample.z[i] - state.fitted[w].background - dark[sample.pixel[i]],
                );
                let Some(factor) = normal.factor(&grid, spot.roughness) else { return };
                factor.solve(&mut psi);
                if inner + 1 == INNER {
                    spot.roughness = spot::next_rho(&grid, &factor, &psi);
                }
                spot.psi = psi;
            });
            self.learn_dark(sample, windows, state);
        }
        normals
            .iter()
            .zip(&self.spots)
            .zip(windows)
            .map(|((n, s), list)| (!list.is_empty()).then(|| n.penalised(&grid, s.roughness)))
            .collect()
    }

    fn learn_dark(&mut self, sample: &Sample, windows: &[Vec<usize>], state: &State) {
        let grid = self.grid;
        let excess: Vec<Vec<f64>> = windows
            .par_iter()
            .zip(&self.spots)
            .map(|(list, spot)| {
                let mut taps = spot::WindowTaps::default();
                let mut out = Vec::with_capacity(list.len() * sample.cells.len());
                for &w in list {
                    taps.set(&grid, sample, w, state.at[w]);
                    for (i, &[c, r]) in sample.cells_of(w).zip(&sample.cells) {
                        let light = state.flux[w] * grid.value(&spot.psi, &taps.x[c], &taps.y[r]);
                        out.push(sample.z[i] - state.fitted[w].background - light);
                    }
                }
                out
            })
            .collect();
        let mut moment = vec![0.0; sample.centre.len()];
        let mut weight = vec![0.0; sample.centre.len()];
        // in the order of stars and windows, whatever ran first above
        for (list, excess) in windows.iter().zip(&excess) {
            let values = list.iter().flat_map(|&w| sample.cells_of(w));
            for (i, e) in values.zip(excess) {
                moment[sample.pixel[i]] += state.weight[i] * e;
                weight[sample.pixel[i]] += state.weight[i];
            }
        }
        self.dark.update(&moment, &weight);
    }

    /// Fits every window; returns the stars' weights in the attitude.
    fn fit_windows(
        &mut self,
        sample: &Sample,
        windows: &[Vec<usize>],
        state: &mut State,
    ) -> Vec<f64> {
        let results: Vec<Vec<(Fitted, Pixels)>> = windows
            .par_iter()
            .enumerate()
            .map(|(star, list)| {
                let known = self.known(star, None);
                list.iter()
                    .map(|&w| {
                        let mut pixels = Pixels::default();
                        let start = state.fitted[w];
                        let fitted =
                            window_fit::fit(&known, sample, w, &start, LEARNING_STEPS, &mut pixels);
                        if fitted.is_none() {
                            // nothing in it is believed
                            pixels.good.fill(false);
                        }
                        (fitted.unwrap_or(start), pixels)
                    })
                    .collect()
            })
            .collect();
        state.model.resize(sample.z.len(), 0.0);
        let mut weights = vec![1.0; sample.stars];
        for (star, (list, results)) in windows.iter().zip(&results).enumerate() {
            if list.is_empty() {
                continue;
            }
            for (&w, (fitted, pixels)) in list.iter().zip(results) {
                let cells = sample.cells_of(w);
                state.fitted[w] = *fitted;
                state.model[cells.clone()].copy_from_slice(&pixels.model);
                state.residual[cells.clone()].copy_from_slice(&pixels.residual);
                state.good[cells].copy_from_slice(&pixels.good);
            }
            let spot = &mut self.spots[star];
            let levels = || results.iter().map(|(f, _)| f.background);
            spot.background = robust_median(levels().collect()).unwrap_or(spot.background);
            let spread = results
                .iter()
                .map(|(f, _)| (f.background - spot.background).powi(2) + f.background_variance);
            spot.background_variance =
                (spread.sum::<f64>() / list.len() as f64).max(MIN_READ_VARIANCE * self.noise.a);
            let variances = results.iter().flat_map(|(f, _)| f.position_variance).collect();
            weights[star] = 1.0 / robust_median(variances).unwrap_or(1.0).max(1e-12);
        }
        balanced(weights, windows)
    }

    fn learn_noise(&mut self, sample: &Sample, windows: &[Vec<usize>], state: &State) {
        let values: usize = windows.iter().map(Vec::len).sum::<usize>() * sample.cells.len();
        let stride = values.div_ceil(NOISE_RESIDUALS).max(1);
        let pairs = windows
            .iter()
            .flatten()
            .flat_map(|&w| sample.cells_of(w))
            .filter(|&i| state.good[i])
            .step_by(stride)
            .map(|i| [state.model[i], state.residual[i]])
            .collect();
        if let Some(noise) = pixel_noise::fit(pairs) {
            self.noise = noise;
        }
        for (spot, list) in self.spots.iter_mut().zip(windows) {
            let chi = list
                .iter()
                .flat_map(|&w| sample.cells_of(w))
                .filter(|&i| sample.valid[i])
                .map(|i| state.residual[i].abs() / self.noise.variance(state.model[i]).sqrt())
                .collect();
            spot.scale = (MAD_SCALE * robust_median(chi).unwrap_or(0.0)).max(1.0);
        }
    }

    /// 1 sigma of the map, uncertainty of the spots included.
    fn marginal_sigma(
        &self,
        sample: &Sample,
        windows: &[Vec<usize>],
        state: &State,
        precisions: &[Option<Banded>],
    ) -> Vec<f64> {
        let added: Vec<Vec<(usize, f64)>> = windows
            .par_iter()
            .zip(precisions)
            .map(|(list, precision)| match precision {
                Some(precision) => dark::variance_from_spot(
                    &self.grid,
                    sample,
                    list,
                    &state.flux,
                    &state.at,
                    &state.weight,
                    precision.clone(),
                    &self.dark.variance,
                ),
                None => Vec::new(),
            })
            .collect();
        let mut variance = self.dark.variance.clone();
        for (pixel, extra) in added.iter().flatten() {
            variance[*pixel] += extra;
        }
        variance.iter().map(|v| v.sqrt()).collect()
    }

    fn known<'a>(&'a self, star: usize, dark_variance: Option<&'a [f64]>) -> Known<'a> {
        let spot = &self.spots[star];
        Known {
            grid: &self.grid,
            psi: &spot.psi,
            noise: self.noise,
            scale: spot.scale,
            background: spot.background,
            background_variance: spot.background_variance,
            dark: &self.dark.value,
            dark_variance,
        }
    }

    /// Position of the star of window `w` by its spot, everything learned frozen.
    pub(crate) fn fitted(&self, sample: &Sample, w: usize, pixels: &mut Pixels) -> Option<[f64; 2]> {
        let star = sample.star[w];
        if self.spots[star].psi.is_empty() {
            return None;
        }
        let start = Fitted {
            at: sample.start[w],
            flux: sample.flux[w],
            background: self.spots[star].background,
            ..Fitted::default()
        };
        let known = self.known(star, Some(&self.dark.variance));
        window_fit::fit(&known, sample, w, &start, FINAL_STEPS, pixels).map(|f| f.at)
    }

    /// First moment of window `w`, map and constant background taken off.
    pub(crate) fn moment(&self, sample: &Sample, w: usize) -> Option<[f64; 2]> {
        let spot = &self.spots[sample.star[w]];
        let cells = sample.cells_of(w);
        if spot.psi.is_empty() || !sample.valid[cells.clone()].iter().all(|v| *v) {
            return None;
        }
        let mut sum = [0.0; 3];
        for (i, &[c, r]) in cells.zip(&sample.cells) {
            let q = sample.z[i] - spot.background - self.dark.value[sample.pixel[i]];
            sum = [sum[0] + q, sum[1] + q * c as f64, sum[2] + q * r as f64];
        }
        let corner = sample.corner[w];
        let at = [corner[0] + sum[1] / sum[0], corner[1] + sum[2] / sum[0]];
        (sum[0] > 0.0 && sample.near(w, at)).then_some(at)
    }
}

/// Weights with mean 1 over the stars that have windows, none far above the median.
fn balanced(mut weights: Vec<f64>, windows: &[Vec<usize>]) -> Vec<f64> {
    let present = || (0..windows.len()).filter(|&s| !windows[s].is_empty());
    let count = present().count().max(1) as f64;
    let mean = present().map(|s| weights[s]).sum::<f64>() / count;
    for s in present() {
        weights[s] /= mean;
    }
    let median = robust_median(present().map(|s| weights[s]).collect()).unwrap_or(1.0);
    for w in &mut weights {
        *w = w.min(MAX_WEIGHT * median);
    }
    weights
}
