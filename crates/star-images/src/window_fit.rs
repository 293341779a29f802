//! Position, flux and background of a star from one window.
//!
//! ```text
//! minimise sum w (z - F psi(p - s) - B - D)^2 + (B - B0)^2/sigma_B^2   over F, B, s
//! w = 1/var,   var = a + b max(model, 0) + v       v variance of the dark map
//! ```
//!
//! Gauss-Newton with limited steps of the position, in two stages. Far from the
//! solution every pixel's pull is bounded: `w` times `min(1, c/|chi|)`, with
//! `chi = r/(scale sqrt(var))`. Near it pixels with `|chi| > clip` are left out, decided
//! anew each time. A particle hit costs its pixel, not the star; left out from the
//! start it could take the good pixels with it, as the table's centroid is off by
//! what the hit did to it.
//!
//! Source: Anderson & King 2000, PASP 112, 1360, section 2 (fitting the effective PSF);
//! Huber 1964, Annals of Mathematical Statistics 35, 73 (bounded pull).

use nalgebra::{Matrix4, Vector4};

use super::sample::Sample;
use super::spline::Grid;
use super::spot::WindowTaps;

/// Largest step of a position, px.
const MAX_STEP_PX: f64 = 0.3;
/// A step below this, px, ends the iteration.
const SETTLED_PX: f64 = 1e-7;
/// Multiples of the noise beyond which a pixel is left out.
const CLIP: f64 = 5.0;
/// Multiples of the noise beyond which a pixel pulls no harder, far from the solution.
const BOUND: f64 = 1.5;
/// A step below this, px, is near the solution.
const NEAR_PX: f64 = 0.02;

/// Variance of a pixel as a function of what it should read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PixelNoise {
    /// Variance of a dark pixel.
    pub(crate) a: f64,
    /// Variance per unit of signal.
    pub(crate) b: f64,
}

impl PixelNoise {
    pub(crate) fn variance(self, model: f64) -> f64 {
        self.a + self.b * model.max(0.0)
    }
}

/// What is known before a window of one star is looked at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Known<'a> {
    pub(crate) grid: &'a Grid,
    pub(crate) psi: &'a [f64],
    pub(crate) noise: PixelNoise,
    /// Noise of this star's pixels over that.
    pub(crate) scale: f64,
    /// Expected background and its variance.
    pub(crate) background: f64,
    pub(crate) background_variance: f64,
    /// Dark map by detector pixel.
    pub(crate) dark: &'a [f64],
    /// Its variance, if it is to be counted.
    pub(crate) dark_variance: Option<&'a [f64]>,
    /// What the pixels add to it at this time, by value of the sample.
    pub(crate) shift: Option<&'a [f64]>,
}

/// One window's four numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Fitted {
    pub(crate) at: [f64; 2],
    pub(crate) flux: f64,
    pub(crate) background: f64,
    /// Formal variances.
    pub(crate) background_variance: f64,
    pub(crate) position_variance: [f64; 2],
}

/// Pixels of one window under the fitted model.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pixels {
    pub(crate) residual: Vec<f64>,
    pub(crate) model: Vec<f64>,
    pub(crate) good: Vec<bool>,
    taps: WindowTaps,
}

/// Fits window `w`, starting from the position, flux and background of `start`.
/// `None` where the numbers leave the window or do not stay numbers.
pub(crate) fn fit(
    known: &Known<'_>,
    sample: &Sample,
    w: usize,
    start: &Fitted,
    steps: usize,
    pixels: &mut Pixels,
) -> Option<Fitted> {
    let cells = sample.cells_of(w);
    pixels.good.resize(cells.len(), false);
    pixels.residual.resize(cells.len(), 0.0);
    pixels.model.resize(cells.len(), 0.0);
    let mut now = *start;
    let mut covariance = Matrix4::zeros();
    let (mut near, mut settled) = (false, false);
    for step in 0..=steps {
        pixels.taps.set(known.grid, sample, w, now.at);
        let last = step == steps || settled;
        let mut normal = Matrix4::<f64>::zeros();
        let mut moment = Vector4::<f64>::zeros();
        for (k, (i, &[c, r])) in cells.clone().zip(&sample.cells).enumerate() {
            let [psi, gx, gy] =
                known
                    .grid
                    .evaluate(known.psi, &pixels.taps.x[c], &pixels.taps.y[r]);
            let dark = sample.pixel[i];
            let shift = known.shift.map_or(0.0, |s| s[i]);
            let model = now.flux * psi + now.background + known.dark[dark] + shift;
            let residual = sample.z[i] - model;
            let variance =
                known.noise.variance(model) + known.dark_variance.map_or(0.0, |v| v[dark]);
            pixels.model[k] = model;
            pixels.residual[k] = residual;
            let chi = residual.abs() / (known.scale * variance.sqrt());
            pixels.good[k] = sample.valid[i] && chi < CLIP;
            let used = if near {
                pixels.good[k]
            } else {
                sample.valid[i]
            };
            if last || !used {
                continue;
            }
            let column = [psi, 1.0, -now.flux * gx, -now.flux * gy];
            let pull = if near { 1.0 } else { (BOUND / chi).min(1.0) };
            let weight = pull / variance;
            for p in 0..4 {
                let v = weight * column[p];
                moment[p] += v * residual;
                for q in p..4 {
                    normal[(q, p)] += v * column[q];
                }
            }
        }
        if last {
            break;
        }
        normal[(1, 1)] += 1.0 / known.background_variance;
        moment[1] += (known.background - now.background) / known.background_variance;
        let ridge = 1e-12 * normal.trace();
        for p in 0..4 {
            normal[(p, p)] += ridge;
        }
        // reads the lower half
        let factor = normal.cholesky()?;
        let d = factor.solve(&moment);
        covariance = factor.inverse();
        now.flux += d[0];
        now.background += d[1];
        for axis in 0..2 {
            now.at[axis] += d[2 + axis].clamp(-MAX_STEP_PX, MAX_STEP_PX);
        }
        let moved = d[2].abs().max(d[3].abs());
        settled = near && moved < SETTLED_PX;
        near |= moved < NEAR_PX;
    }
    now.background_variance = covariance[(1, 1)];
    now.position_variance = [covariance[(2, 2)], covariance[(3, 3)]];
    let sound = now.flux > 0.0 && now.flux.is_finite() && now.background.is_finite();
    (sound && sample.near(w, now.at)).then_some(now)
}

#[cfg(test)]
mod tests {
    use super::super::spot;
    use super::super::synthetic::few_windows;
    use super::*;

    /// Without noise the fit returns the position that the spot was learned at, from
    /// any start within a pixel, and with a hit anywhere in the window. The spline
    /// does not follow the spot exactly: its own fit to the window is the reference.
    #[test]
    fn starts_and_hits_do_not_matter() {
        let mut sample = few_windows(300);
        let grid = Grid::new(sample.reach_px() + 0.5, 0.4);
        let windows: Vec<usize> = (0..sample.windows()).collect();
        let weight = vec![0.05; sample.z.len()];
        let level = sample.background[0];
        let (flux, at) = (sample.flux.clone(), sample.start.clone());
        let normal = spot::normal(&grid, &sample, &windows, &flux, &at, &weight, |_| level);
        let mut psi = normal.moment.clone();
        normal.factor(&grid, 1e-2).unwrap().solve(&mut psi);
        let dark = vec![0.0; sample.centre.len()];
        let mut pixels = Pixels::default();
        for w in [3, 40, 111] {
            let truth = at[w];
            let fit_from = |sample: &Sample, start: [f64; 2], pixels: &mut Pixels| {
                let known = Known {
                    grid: &grid,
                    psi: &psi,
                    noise: PixelNoise { a: 4.0, b: 0.2 },
                    scale: 1.0,
                    background: level,
                    background_variance: 9.0,
                    dark: &dark,
                    dark_variance: None,
                    shift: None,
                };
                let start = Fitted {
                    at: start,
                    flux: 8e3,
                    background: level,
                    ..Fitted::default()
                };
                fit(&known, sample, w, &start, 30, pixels).unwrap()
            };
            let best = fit_from(&sample, truth, &mut pixels);
            assert!((best.at[0] - truth[0]).hypot(best.at[1] - truth[1]) < 2e-3);
            assert!(pixels.good.iter().all(|g| *g));
            let moved = fit_from(&sample, [truth[0] + 0.6, truth[1] - 0.5], &mut pixels);
            assert!((moved.at[0] - best.at[0]).hypot(moved.at[1] - best.at[1]) < 1e-6);
            for cell in 0..16 {
                let i = sample.cells_of(w).start + cell;
                let kept = sample.z[i];
                sample.z[i] += 3000.0;
                let struck = fit_from(&sample, [truth[0] + 0.3, truth[1] + 0.2], &mut pixels);
                sample.z[i] = kept;
                let good = pixels.good.iter().filter(|g| **g).count();
                assert_eq!(
                    (good, pixels.good[cell]),
                    (15, false),
                    "window {w}, pixel {cell}"
                );
                let off = (struck.at[0] - truth[0]).hypot(struck.at[1] - truth[1]);
                // the spline's own misfit without that pixel
                assert!(off < 0.01, "window {w}, pixel {cell}: {off}");
            }
        }
    }
}
