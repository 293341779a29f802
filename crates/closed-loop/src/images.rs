//! Raw windows: what the detector itself adds, and centroids without it.
//!
//! Not physics: the interface of the modules below.

use std::collections::HashMap;

use focal_plane::Pixel;
use rayon::prelude::*;
use telemetry::WindowTable;

use crate::folds::Folds;
use crate::star_data::StarData;

use learn::Learned;
use sample::{Entry, Sample};
use spline::Grid;
use window_fit::Pixels;

mod banded;
mod coupling;
mod dark;
mod geometry;
mod learn;
mod map;
mod moment_level;
mod pixel_noise;
mod sample;
mod spline;
mod spot;
#[cfg(test)]
mod synthetic;
#[cfg(test)]
mod tests;
mod window_fit;

/// Id of the effect in the catalogue.
pub(crate) const DARK_MAP: &str = "dark_map";
/// Id of the effect in the catalogue.
pub(crate) const EFFECTIVE_PSF: &str = "effective_psf";
/// The file that an adopted map is written to.
pub(crate) const DARK_MAP_FILE: &str = "dark_map.csv";

/// One pixel of a dark map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DarkPixel {
    /// Centre of the pixel, centred px.
    pub(crate) x_px: f64,
    /// Centre of the pixel, centred px.
    pub(crate) y_px: f64,
    /// What it adds to every read-out, in the unit of the windows.
    pub(crate) dn: f64,
    /// 1 sigma of the pixel against the mean of its surroundings.
    pub(crate) sigma_dn: f64,
}

/// What each detector pixel under the windows adds, by itself, to every read-out.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct DarkMap {
    /// Every pixel that a window has covered.
    pub(crate) pixels: Vec<DarkPixel>,
}

impl DarkMap {
    /// Root mean square of the map about its mean: only contrasts mean anything.
    pub(crate) fn rms_dn(&self) -> f64 {
        let n = self.pixels.len().max(1) as f64;
        let mean = self.pixels.iter().map(|p| p.dn).sum::<f64>() / n;
        (self
            .pixels
            .iter()
            .map(|p| (p.dn - mean).powi(2))
            .sum::<f64>()
            / n)
            .sqrt()
    }
}

/// Centroids formed anew in one way: one variant a fold, learned outside it, and a
/// last one learned on all data; px, `[x, y]` of every star row.
pub(crate) type Variants = Vec<[Vec<f64>; 2]>;

/// Centroids formed anew with or without a map.
#[derive(Clone, Debug, Default)]
pub(crate) struct Centroids {
    /// First moments.
    pub(crate) moments: Variants,
    /// First moments less what the effective spot says that they are off by: what
    /// the spot explains, apart from the noise that fitting it saves.
    pub(crate) unbiased: Variants,
    /// Positions fitted with the effective spot.
    pub(crate) fitted: Variants,
    /// Rows that kept the centroid of the table, at most in any variant.
    pub(crate) fallback_rows: usize,
}

/// Centroids formed anew, and the map behind them.
#[derive(Clone, Debug)]
pub(crate) struct Formed {
    pub(crate) without_map: Centroids,
    pub(crate) with_map: Centroids,
    /// The map from all data.
    pub(crate) map: DarkMap,
    /// Full width at half maximum of each star's spot, px.
    pub(crate) fwhm_px: Vec<f64>,
}

/// Knots of a spot, px: fine enough for the sharpest spot that a window samples.
const KNOTS_PX: f64 = 0.4;
/// Room beside the largest offset of a pixel from its star, px.
const MARGIN_PX: f64 = 0.5;
/// Fewest frames to learn from.
const MIN_FRAMES: usize = 30;

/// The MAD of a Gaussian times this is its standard deviation.
pub(crate) const MAD_SCALE: f64 = 1.482_602_218_505_602;

/// Median of the finite values.
pub(crate) fn robust_median(mut values: Vec<f64>) -> Option<f64> {
    spectra::robust::median(&mut values)
}

/// Learns dark map and spots from the windows, outside each fold and on all
/// data, and forms the centroids anew. `None` where the windows do not belong to
/// the star rows or are too few to learn from.
pub(crate) fn form(data: &StarData, windows: &WindowTable, folds: &Folds) -> Option<Formed> {
    let frames = entries(data, windows);
    if frames.iter().filter(|f| !f.is_empty()).count() < MIN_FRAMES {
        return None;
    }
    let sample = Sample::collect(data.stars.len(), windows.size, &windows.unread, &frames)?;
    let grid = Grid::new(sample.reach_px() + MARGIN_PX, KNOTS_PX);
    let length_px = data.camera.half_size_px().into_iter().fold(0.0, f64::max);
    let fold = folds.fold_of_frame();
    let learn = |mapped: bool| -> Vec<Learned> {
        (0..=folds.count)
            .into_par_iter()
            .map(|k| {
                let taken: Vec<usize> = (0..fold.len()).filter(|&f| fold[f] != k).collect();
                let last = k == folds.count;
                learn::learn(&sample, &taken, grid, length_px, mapped, mapped && last)
            })
            .collect()
    };
    let (mut learned, bare) = rayon::join(|| learn(true), || learn(false));
    let with_map = centroids(data, &sample, &learned);
    let without_map = centroids(data, &sample, &bare);
    let all = learned.pop()?;
    let width = |s: &learn::Spot| {
        if s.psi.is_empty() {
            f64::NAN
        } else {
            spot::fwhm_px(&grid, &s.psi)
        }
    };
    Some(Formed {
        without_map,
        with_map,
        fwhm_px: all.spots.iter().map(width).collect(),
        map: map::of(&sample, &learned, &all),
    })
}

/// Centroids of every star row from each of `learned`; rows whose window does not
/// give all of them keep the centroid of the table.
fn centroids(data: &StarData, sample: &Sample, learned: &[Learned]) -> Centroids {
    let table = [data.frames.x_px.clone(), data.frames.y_px.clone()];
    let mut out = Centroids::default();
    for one in learned {
        let mut pixels = Pixels::default();
        let mut variant = [table.clone(), table.clone(), table.clone()];
        let mut fallback = data.t_s.len() - sample.windows();
        for w in 0..sample.windows() {
            let formed = one.fitted(sample, w, &mut pixels).and_then(|f| {
                let m = one.moment(sample, w, &pixels)?;
                let b = one.moment_bias(sample, w, f, &pixels)?;
                Some([m, [m[0] - b[0], m[1] - b[1]], f])
            });
            let Some(formed) = formed else {
                fallback += 1;
                continue;
            };
            for (variant, at) in variant.iter_mut().zip(formed) {
                for axis in 0..2 {
                    variant[axis][sample.row[w]] = at[axis];
                }
            }
        }
        let [moments, unbiased, fitted] = variant;
        out.moments.push(moments);
        out.unbiased.push(unbiased);
        out.fitted.push(fitted);
        out.fallback_rows = out.fallback_rows.max(fallback);
    }
    out
}

/// The windows of the star rows, frame by frame; a row without one has no entry.
fn entries<'a>(data: &StarData, windows: &'a WindowTable) -> Vec<Vec<Entry<'a>>> {
    let key = |t_s: f64, slot: i32| (t_s.to_bits(), slot);
    let at: HashMap<(u64, i32), usize> = windows
        .t_s
        .iter()
        .zip(&windows.slot)
        .enumerate()
        .map(|(i, (&t, &s))| (key(t, s), i))
        .collect();
    // With directions of its own every star's constant is free, and a distortion
    // fitted fold by fold would only add steps between the folds.
    let base = if data.free_directions {
        &data.projected
    } else {
        &data.modelled
    };
    // Outliers are kept: a warm pixel that few windows cross looks like one, and
    // particle hits are left out pixel by pixel.
    (0..data.frames.frames())
        .map(|k| {
            data.frames
                .rows_of(k)
                .filter_map(|row| {
                    let i = *at.get(&key(data.t_s[row], data.frames.slot[row]))?;
                    let centre = Pixel {
                        x: base[0][row],
                        y: base[1][row],
                    };
                    Some(Entry {
                        row,
                        star: data.star[row],
                        start: [data.frames.x_px[row], data.frames.y_px[row]],
                        flux: data.frames.flux.as_ref().map(|f| f[row]),
                        base: [centre.x, centre.y],
                        jacobian: data.camera.rotation_jacobian(centre),
                        corner: [windows.x0_px[i], windows.y0_px[i]],
                        background: windows.background[i],
                        values: windows.window(i),
                    })
                })
                .collect()
        })
        .collect()
}
