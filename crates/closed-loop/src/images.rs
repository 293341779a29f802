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

/// Centroids formed anew, and the map behind them. Every list holds one variant a
/// fold, learned outside it, and a last one learned on all data.
#[derive(Clone, Debug)]
pub(crate) struct Formed {
    /// First moments with the map taken off, px, `[x, y]` of every star row.
    pub(crate) moments: Vec<[Vec<f64>; 2]>,
    /// Positions fitted with the effective spot, px.
    pub(crate) fitted: Vec<[Vec<f64>; 2]>,
    /// The map from all data.
    pub(crate) map: DarkMap,
    /// Full width at half maximum of each star's spot, px.
    pub(crate) fwhm_px: Vec<f64>,
    /// Rows that kept the centroid of the table.
    pub(crate) fallback_rows: usize,
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
    crate::robust::median(&mut values)
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
    let mut learned: Vec<Learned> = (0..=folds.count)
        .into_par_iter()
        .map(|k| {
            let taken: Vec<usize> = (0..fold.len()).filter(|&f| fold[f] != k).collect();
            learn::learn(&sample, &taken, grid, length_px, k == folds.count)
        })
        .collect();
    let mut formed = Formed {
        moments: Vec::new(),
        fitted: Vec::new(),
        map: DarkMap::default(),
        fwhm_px: Vec::new(),
        fallback_rows: 0,
    };
    let table = [data.frames.x_px.clone(), data.frames.y_px.clone()];
    for one in &learned {
        let mut pixels = Pixels::default();
        let (mut moments, mut fitted) = (table.clone(), table.clone());
        let mut without = data.t_s.len() - sample.windows();
        for w in 0..sample.windows() {
            let row = sample.row[w];
            match (one.moment(&sample, w), one.fitted(&sample, w, &mut pixels)) {
                (Some(m), Some(f)) => {
                    for axis in 0..2 {
                        moments[axis][row] = m[axis];
                        fitted[axis][row] = f[axis];
                    }
                }
                _ => without += 1,
            }
        }
        formed.fallback_rows = formed.fallback_rows.max(without);
        formed.moments.push(moments);
        formed.fitted.push(fitted);
    }
    let all = learned.pop()?;
    formed.fwhm_px = all
        .spots
        .iter()
        .map(|s| {
            if s.psi.is_empty() {
                f64::NAN
            } else {
                spot::fwhm_px(&grid, &s.psi)
            }
        })
        .collect();
    formed.map = map::of(&sample, &learned, &all);
    Some(formed)
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
