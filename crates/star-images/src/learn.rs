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

use super::banded::Factor;
use super::coupling::{self, Coupling};
use super::dark::{self, Dark};
use super::gaussian_spot::{self, Gaussian, Widths};
use super::geometry::Geometry;
use super::moment_level;
use super::pixel_noise::{self, MIN_READ_VARIANCE};
use super::robust::{MAD_SCALE, robust_median};
use super::sample::Sample;
use super::spline::Grid;
use super::spot::{self, Normal};
use super::window_fit::{self, Fitted, Known, PixelNoise, Pixels};

/// Rounds of everything: with half as many the table's centroids, moved by the very
/// pixels that are sought, still show in the map at twice its error.
const OUTER: usize = 12;
/// Most rounds of spots and map at fixed positions, and the change of the map in
/// its own sigmas that ends them.
const INNER: usize = 60;
const STANDS_STILL: f64 = 0.01;
/// Gauss-Newton steps of a window in the first round, in those that start where the
/// last one ended, and when all else is frozen.
const FIRST_STEPS: usize = 4;
const LEARNING_STEPS: usize = 2;
const FINAL_STEPS: usize = 16;
/// Starting values in the scaled unit: variance of backgrounds, far on the side of knowing nothing, and variance
/// of the second differences of a spot, that of a sharp one. A star that moves along a line trades anything
/// that does not change along that line between its spot and the map, and only the map's prior sends it back,
/// slowly: a spot that is too smooth at first leaves what it lacks in the map. One that follows everything takes
/// from a map of many warm pixels.
const BACKGROUND_VARIANCE: f64 = 1e4;
const ROUGHNESS: f64 = 1e-5;
/// A star's weight in the attitude over the median star's.
const MAX_WEIGHT: f64 = 3.0;
/// What is known of any pixel beforehand over what the data say of it with the spots known: an error of 100
/// times the noise says that nothing is known, and the equations stay definite.
const LEAST_KNOWN: f64 = 1e-4;
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
    /// The Gaussian nearest to it, where there is one, and its spline coefficients, which the spot of the next round is
    /// drawn to; zeros where there is none.
    nearest: Option<Gaussian>,
    about: Vec<f64>,
    pub(crate) background: f64,
    pub(crate) background_variance: f64,
    /// Noise of the star's pixels over that of all.
    pub(crate) scale: f64,
    /// What is taken off every pixel for a first moment that follows the star.
    level: f64,
    /// What lies under the star and is none of its light: without a map by the table, with one by the Gaussian
    /// nearest to the spot.
    plain_level: f64,
    /// Spline coefficients of the Gaussian nearest to it; empty where there is none.
    gaussian: Vec<f64>,
}

/// What is learned from some frames.
#[derive(Clone, Debug)]
pub(crate) struct Learned {
    pub(crate) grid: Grid,
    /// That of the Gaussians.
    finer: Grid,
    pub(crate) spots: Vec<Spot>,
    pub(crate) dark: Dark,
    /// Whether the map was free.
    pub(crate) mapped: bool,
    pub(crate) noise: PixelNoise,
    /// Pixels left out as particle hits in the last round.
    pub(crate) clipped: usize,
    /// Variance of the map with the spots unknown; empty unless asked for.
    pub(crate) dark_variance: Vec<f64>,
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

impl State {
    /// Every window as it was sent.
    fn begin(sample: &Sample) -> Self {
        let sent = |w| Fitted {
            at: sample.start[w],
            flux: sample.flux[w],
            ..Fitted::default()
        };
        Self {
            fitted: (0..sample.windows()).map(sent).collect(),
            flux: sample.flux.clone(),
            at: sample.start.clone(),
            weight: vec![0.0; sample.z.len()],
            good: sample.valid.clone(),
            model: Vec::new(),
            residual: vec![0.0; sample.z.len()],
        }
    }
}

/// Learns from the frames `taken`. `length_px` is the scale of the field, px.
/// Unless `mapped`, the map stays at zero: the spots explain what they can.
pub(crate) fn learn(
    sample: &Sample,
    taken: &[usize],
    grid: Grid,
    length_px: f64,
    mapped: bool,
    with_variance: bool,
) -> Learned {
    let windows = usable(sample, taken);
    let ordered: Vec<_> = windows
        .par_iter()
        .map(|list| coupling::by_pixel(sample, list))
        .collect();
    let mut state = State::begin(sample);
    let mut learned = Learned {
        grid,
        finer: gaussian_spot::finer(&grid),
        spots: windows
            .iter()
            .map(|list| first_guess(sample, list, &mut state, &grid))
            .collect(),
        dark: Dark::none(sample.centre.len()),
        mapped,
        noise: PixelNoise {
            a: (0.1 * robust_median(sample.z.clone()).unwrap_or(0.0)).max(0.0) + 1.0,
            b: 1.0,
        },
        clipped: 0,
        dark_variance: Vec::new(),
    };
    let mut star_weight = vec![1.0; sample.stars];
    for outer in 0..OUTER {
        place(sample, taken, &mut state, &star_weight, length_px);
        weigh(sample, &windows, &mut state, learned.noise);
        let last = outer == OUTER - 1;
        let sums = learned.learn_spots_and_dark(sample, &windows, &ordered, &state, last);
        if with_variance && last {
            learned.dark_variance = learned.free_variance(sample, &sums);
        }
        let steps = if outer == 0 {
            FIRST_STEPS
        } else {
            LEARNING_STEPS
        };
        let weights = learned.fit_windows(sample, &windows, &mut state, steps);
        learned.learn_noise(sample, &windows, &state);
        star_weight = weights;
    }
    learned.level(sample, &windows, &state);
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
        psi: if list.is_empty() {
            Vec::new()
        } else {
            vec![0.0; grid.len()]
        },
        roughness: ROUGHNESS,
        nearest: None,
        about: vec![0.0; grid.len()],
        background,
        background_variance: BACKGROUND_VARIANCE,
        scale: 1.0,
        level: background,
        plain_level: background,
        gaussian: Vec::new(),
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
    let source = if state.model.is_empty() {
        &sample.z
    } else {
        &state.model
    };
    for &w in windows.iter().flatten() {
        for i in sample.cells_of(w) {
            state.weight[i] = if state.good[i] {
                1.0 / noise.variance(source[i])
            } else {
                0.0
            };
        }
    }
}

impl Learned {
    /// The level under each star's spot, that follows it and a plain one.
    fn level(&mut self, sample: &Sample, windows: &[Vec<usize>], state: &State) {
        let of_star = |(list, spot): (&Vec<usize>, &Spot)| {
            let typical = |of: &[f64]| robust_median(list.iter().map(|&w| of[w]).collect());
            let plain = if self.mapped {
                // the map holds a level that no table knows of
                // and lies under the spot as under that Gaussian
                let pedestal = spot.nearest.map_or(0.0, |gaussian| gaussian.pedestal);
                typical(&state.flux).map(|flux| spot.background + flux * pedestal)
            } else {
                typical(&sample.background)
            };
            // of a window that no spot fits no value is good
            let believed = |w: &usize| state.good[sample.cells_of(*w)].iter().any(|good| *good);
            let believed: Vec<usize> = list.iter().copied().filter(believed).collect();
            let following = moment_level::fit(
                sample,
                &believed,
                |w| state.fitted[w].at,
                &state.model,
                &self.dark.value,
                spot.background,
            );
            [following, plain.unwrap_or(spot.background)]
        };
        let each = windows.par_iter().zip(&self.spots);
        let levels: Vec<[f64; 2]> = each.map(of_star).collect();
        for (spot, [following, plain]) in self.spots.iter_mut().zip(levels) {
            (spot.level, spot.plain_level) = (following, plain);
        }
    }

    /// Spots at the given map, the map at these spots, until both stand still; then the Gaussians, exactly in the
    /// `last` round. Returns the sums they were made of.
    fn learn_spots_and_dark(
        &mut self,
        sample: &Sample,
        windows: &[Vec<usize>],
        ordered: &[Vec<[usize; 3]>],
        state: &State,
        last: bool,
    ) -> Vec<(Normal, Coupling)> {
        let (grid, level) = (self.grid, |w: usize| state.fitted[w].background);
        let (flux, at, weight) = (&state.flux, &state.at, &state.weight);
        let sums: Vec<(Normal, Coupling)> = windows
            .par_iter()
            .zip(ordered)
            .zip(&self.spots)
            .map(|((list, ordered), spot)| {
                let mut normal = spot::normal(&grid, sample, list, flux, at, weight, level);
                normal.draw_to(&grid, spot.roughness, &spot.about);
                let coupling = Coupling::new(&grid, sample, ordered, flux, at, weight, level);
                (normal, coupling)
            })
            .collect();
        let factors: Vec<Option<Factor>> = self
            .spots
            .par_iter()
            .zip(&sums)
            .map(|(spot, (normal, _))| {
                let present = !spot.psi.is_empty();
                present
                    .then(|| normal.factor(&grid, spot.roughness))
                    .flatten()
            })
            .collect();
        let mut moment = vec![0.0; sample.centre.len()];
        let mut total = vec![0.0; sample.centre.len()];
        for _ in 0..INNER {
            moment.fill(0.0);
            total.fill(0.0);
            for ((spot, factor), (normal, coupling)) in
                self.spots.iter_mut().zip(&factors).zip(&sums)
            {
                let Some(factor) = factor else { continue };
                spot.psi.copy_from_slice(&normal.moment);
                coupling.take_off_dark(&self.dark.value, &mut spot.psi);
                factor.solve(&mut spot.psi);
                coupling.tell_pixels(&spot.psi, &mut moment, &mut total);
            }
            if !self.mapped || self.dark.update(&moment, &total, &sample.group) < STANDS_STILL {
                break;
            }
        }
        let finer = self.finer;
        self.spots.par_iter_mut().zip(&factors).zip(&sums).for_each(
            |((spot, factor), (normal, _))| {
                let Some(factor) = factor else { return };
                let own: Vec<f64> = spot
                    .psi
                    .iter()
                    .zip(&spot.about)
                    .map(|(psi, about)| psi - about)
                    .collect();
                spot.roughness = spot::next_rho(&grid, factor, &own);
                let widths = match spot.nearest {
                    Some(gaussian) if !last => Widths::Near(gaussian.width_px),
                    _ => Widths::All,
                };
                spot.nearest = gaussian_spot::nearest(&grid, normal, &spot.psi, widths);
                let about = spot.nearest.and_then(|gaussian| gaussian.shifted(&grid));
                spot.about = about.unwrap_or_else(|| vec![0.0; grid.len()]);
                if last {
                    let written = spot.nearest.and_then(|g| g.coefficients(&finer));
                    spot.gaussian = written.unwrap_or_default();
                }
            },
        );
        sums
    }

    /// Fits every window; returns the stars' weights in the attitude.
    fn fit_windows(
        &mut self,
        sample: &Sample,
        windows: &[Vec<usize>],
        state: &mut State,
        steps: usize,
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
                        let fitted = window_fit::fit(&known, sample, w, &start, steps, &mut pixels);
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
            let variances = results
                .iter()
                .flat_map(|(f, _)| f.position_variance)
                .collect();
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

    /// Variance of the map if nothing is known of pixels beforehand, uncertainty of the spots included: what
    /// quiet pixels are drawn to is no measurement, and the data cannot say how far a pixel is off that a
    /// spot never leaves.
    fn free_variance(&self, sample: &Sample, sums: &[(Normal, Coupling)]) -> Vec<f64> {
        let mut weight = vec![0.0; sample.centre.len()];
        for (spot, (_, coupling)) in self.spots.iter().zip(sums) {
            if spot.psi.is_empty() {
                continue;
            }
            for (&p, w) in coupling.pixel.iter().zip(&coupling.weight) {
                weight[p] += w;
            }
        }
        let mut variance: Vec<f64> = weight
            .iter()
            .map(|w| {
                if *w > 0.0 {
                    1.0 / (w * (1.0 + LEAST_KNOWN))
                } else {
                    0.0
                }
            })
            .collect();
        let added: Vec<Vec<(usize, f64)>> = self
            .spots
            .par_iter()
            .zip(sums)
            .map(|(spot, (normal, coupling))| {
                if spot.psi.is_empty() {
                    return Vec::new();
                }
                let precision = normal.penalised(&self.grid, spot.roughness);
                dark::variance_from_spot(coupling, precision, &variance)
            })
            .collect();
        for (pixel, extra) in added.iter().flatten() {
            variance[*pixel] += extra;
        }
        variance
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
            shift: None,
        }
    }

    /// Position of the star of window `w` by its spot, everything learned frozen.
    pub(crate) fn fitted(&self, sample: &Sample, w: usize, pixels: &mut Pixels) -> Option<Fitted> {
        let spot = &self.spots[sample.star[w]];
        self.by(&self.grid, &spot.psi, sample, w, pixels)
    }

    /// The same by the Gaussian nearest to the spot.
    pub(crate) fn by_gaussian(
        &self,
        sample: &Sample,
        w: usize,
        pixels: &mut Pixels,
    ) -> Option<[f64; 2]> {
        let spot = &self.spots[sample.star[w]];
        self.by(&self.finer, &spot.gaussian, sample, w, pixels)
            .map(|f| f.at)
    }

    fn by(
        &self,
        grid: &Grid,
        psi: &[f64],
        sample: &Sample,
        w: usize,
        pixels: &mut Pixels,
    ) -> Option<Fitted> {
        if psi.is_empty() {
            return None;
        }
        let star = sample.star[w];
        let start = Fitted {
            at: sample.start[w],
            flux: sample.flux[w],
            background: self.spots[star].background,
            ..Fitted::default()
        };
        let known = Known {
            grid,
            psi,
            ..self.known(star, Some(&self.dark.variance))
        };
        window_fit::fit(&known, sample, w, &start, FINAL_STEPS, pixels)
    }

    /// The position by the spot with what the pixels add to their map in time, from where the star was found
    /// without: `shift` value by value, beside which the map has `dark_variance`.
    pub(crate) fn fitted_with(
        &self,
        sample: &Sample,
        w: usize,
        start: &Fitted,
        [shift, dark_variance]: [&[f64]; 2],
        pixels: &mut Pixels,
    ) -> Option<Fitted> {
        let known = Known {
            shift: Some(shift),
            ..self.known(sample.star[w], Some(dark_variance))
        };
        window_fit::fit(&known, sample, w, start, FINAL_STEPS, pixels)
    }

    /// First moments of window `w`, map and a constant level taken off: the one at which they follow the star, and
    /// the plain one. Pixels with a particle hit, as [`fitted`](Self::fitted) left them in `pixels`, take their value
    /// from the spot.
    pub(crate) fn moments(
        &self,
        sample: &Sample,
        w: usize,
        pixels: &Pixels,
    ) -> Option<[[f64; 2]; 2]> {
        let cells = sample.cells_of(w);
        if !sample.valid[cells.clone()].iter().all(|v| *v) {
            return None;
        }
        let values = sample.z[cells]
            .iter()
            .zip(&pixels.good)
            .zip(&pixels.model)
            .map(|((&z, &good), &model)| if good { z } else { model });
        let spot = &self.spots[sample.star[w]];
        let at = |level| {
            let found = self.moment_of(sample, w, level, values.clone());
            found.filter(|&at| sample.near(w, at))
        };
        Some([at(spot.level)?, at(spot.plain_level)?])
    }

    /// How far the plain first moment of the noise-free spot of window `w`, on the star's usual background, is from
    /// the position where it was [`fitted`](Self::fitted), which left it in `pixels`. A background of its own is in part
    /// the window's noise: taking off what that does to a moment would be no correction by the spot.
    pub(crate) fn moment_bias(
        &self,
        sample: &Sample,
        w: usize,
        fit: &Fitted,
        pixels: &Pixels,
    ) -> Option<[f64; 2]> {
        let spot = &self.spots[sample.star[w]];
        let own = fit.background - spot.background;
        let values = pixels.model.iter().map(|v| v - own);
        let [x, y] = self.moment_of(sample, w, spot.plain_level, values)?;
        Some([x - fit.at[0], y - fit.at[1]])
    }

    fn moment_of(
        &self,
        sample: &Sample,
        w: usize,
        level: f64,
        values: impl Iterator<Item = f64>,
    ) -> Option<[f64; 2]> {
        if self.spots[sample.star[w]].psi.is_empty() {
            return None;
        }
        let mut sum = [0.0; 3];
        for ((i, z), &[c, r]) in sample.cells_of(w).zip(values).zip(&sample.cells) {
            let q = z - level - self.dark.value[sample.pixel[i]];
            sum = [sum[0] + q, sum[1] + q * c as f64, sum[2] + q * r as f64];
        }
        let corner = sample.corner[w];
        (sum[0] > 0.0).then(|| [corner[0] + sum[1] / sum[0], corner[1] + sum[2] / sum[0]])
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
