//! Centroids formed anew: what is learned where, and what every row becomes.
//!
//! Not physics: the interface of the modules beside it.

use std::fmt;

use focal_plane::{Camera, Pixel, StarFrames};
use rayon::prelude::*;
use telemetry::WindowTable;

use crate::joining::windows_of_rows;
use crate::learn::{self, Learned};
use crate::map::{self, DarkMap};
use crate::robust::{MAD_SCALE, robust_median};
use crate::sample::{Entry, Sample};
use crate::spline::Grid;
use crate::window_fit::{Fitted, Pixels};
use crate::{spot, switching};

#[cfg(test)]
mod tests;

/// Star rows as far as their windows need them, frames one after another.
#[derive(Clone, Copy, Debug)]
pub struct Stars<'a> {
    /// The tracker's camera.
    pub camera: &'a Camera,
    /// Times, slots, centroids, and fluxes where there are any.
    pub frames: &'a StarFrames,
    /// How many stars there are.
    pub stars: usize,
    /// Which of them each row is of.
    pub star: &'a [usize],
    /// Where a model puts each row, px. It may be off by a constant of each star, and by a small rotation
    /// of each frame.
    pub expected_px: [&'a [f64]; 2],
}

/// Centroids formed anew in one way: one variant a fold, learned outside it, and a
/// last one learned on all data; px, `[x, y]` of every star row.
pub type Variants = Vec<[Vec<f64>; 2]>;

/// Centroids formed anew with or without a map.
#[derive(Clone, Debug, Default)]
pub struct Centroids {
    /// First moments at the level at which they follow the star.
    pub moments: Variants,
    /// First moments above what lies under the star: what a spot that its window cuts off pulls them by is in
    /// them. Without a map these are as a tracker forms them, hits left out.
    pub plain: Variants,
    /// Those less what the effective spot says that they are off by: what
    /// the spot explains, apart from the noise that fitting it saves.
    pub unbiased: Variants,
    /// Positions fitted with the effective spot.
    pub fitted: Variants,
    /// Positions fitted with the round Gaussian nearest to it.
    pub gaussian: Variants,
    /// Positions fitted with the effective spot, pixels that switch followed in time; empty where none does.
    pub followed: Variants,
    /// How many pixels are followed, from all data.
    pub switching: usize,
    /// 1 sigma of what is constant for each star, px: what the map takes off moments, and the zeros of
    /// spots, that are set to them.
    pub zero_px: Vec<[f64; 2]>,
    /// Rows that some variant has no centroid for: they keep that of the table.
    kept: Vec<bool>,
}

/// Centroids formed anew, and the map behind them.
#[derive(Clone, Debug)]
pub struct Formed {
    /// By spots that were learned as if no pixel had a value of its own.
    pub without_map: Centroids,
    /// By spots and map that were learned together.
    pub with_map: Centroids,
    /// The map from all data.
    pub map: DarkMap,
    /// Full width at half maximum of each star's spot, px; NaN where none could be learned.
    pub fwhm_px: Vec<f64>,
    /// Star rows whose centroids are formed anew in every way and variant. All others keep that of the table
    /// somewhere, with another noise and what the detector does to it: ways are to be compared without them.
    pub anew: Vec<bool>,
}

/// Why no centroids can be formed anew from some windows. In words it goes on from "none of them can be used: ".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unusable {
    /// No window that can be used has the time and slot of a star row.
    NoWindow,
    /// Too few frames have windows.
    TooFewFrames {
        /// Frames that have.
        frames: usize,
        /// The least that is needed.
        need: usize,
    },
    /// The windows hold no light above their background.
    NoLight,
}

impl fmt::Display for Unusable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoWindow => {
                f.write_str("none has the time and slot of a star row and enough values")
            }
            Self::TooFewFrames { frames, need } => {
                write!(
                    f,
                    "they are of {frames} frames, and at least {need} are needed"
                )
            }
            Self::NoLight => f.write_str("they hold no light above their background"),
        }
    }
}

/// Knots of a spot, px: fine enough for the sharpest spot that a window samples.
const KNOTS_PX: f64 = 0.4;
/// Room beside the largest offset of a pixel from its star, px.
const MARGIN_PX: f64 = 0.5;
/// Fewest frames to learn from.
const MIN_FRAMES: usize = 30;

/// Learns dark map and spots from the windows, outside each fold and on all
/// data, and forms the centroids anew. `fold` is the fold of each frame, counted from 0.
///
/// # Errors
/// [`Unusable`] where the windows do not belong to the star rows (by time and slot), are too few to learn from (fewer
/// than 30 frames), or are dark.
///
/// # Panics
/// Unless `fold` has an entry for each frame, and every slice of `data` one for each row.
pub fn form(data: &Stars<'_>, windows: &WindowTable, fold: &[usize]) -> Result<Formed, Unusable> {
    let rows = data.frames.rows();
    assert_eq!(fold.len(), data.frames.frames(), "a fold for each frame");
    assert!(
        [
            data.star.len(),
            data.expected_px[0].len(),
            data.expected_px[1].len()
        ] == [rows; 3],
        "a star and a place for each row"
    );
    let folds = fold.iter().max().map_or(0, |last| last + 1);
    let frames = entries(data, windows);
    let seen = frames.iter().filter(|f| !f.is_empty()).count();
    if seen == 0 {
        return Err(Unusable::NoWindow);
    }
    if seen < MIN_FRAMES {
        return Err(Unusable::TooFewFrames {
            frames: seen,
            need: MIN_FRAMES,
        });
    }
    let sample = Sample::collect(data.stars, windows.size, &windows.unread, &frames)
        .ok_or(Unusable::NoLight)?;
    let grid = Grid::new(sample.reach_px() + MARGIN_PX, KNOTS_PX);
    let length_px = data.camera.half_size_px().into_iter().fold(0.0, f64::max);
    let learn = |mapped: bool| -> Vec<Learned> {
        (0..=folds)
            .into_par_iter()
            .map(|k| {
                let taken: Vec<usize> = (0..fold.len()).filter(|&f| fold[f] != k).collect();
                let last = k == folds;
                learn::learn(&sample, &taken, grid, length_px, mapped, mapped && last)
            })
            .collect()
    };
    let (mut learned, bare) = rayon::join(|| learn(true), || learn(false));
    let (with_map, without_map) = rayon::join(
        || centroids(data, &sample, &learned, fold),
        || centroids(data, &sample, &bare, fold),
    );
    let all = learned.pop().ok_or(Unusable::NoWindow)?;
    let width = |s: &learn::Spot| {
        if s.psi.is_empty() {
            f64::NAN
        } else {
            spot::fwhm_px(&grid, &s.psi)
        }
    };
    let kept = without_map.kept.iter().zip(&with_map.kept);
    Ok(Formed {
        anew: kept.map(|(a, b)| !(a | b)).collect(),
        without_map,
        with_map,
        fwhm_px: all.spots.iter().map(width).collect(),
        map: map::of(&sample, &learned, &all),
    })
}

/// Centroids of every star row from each of `learned`, the last of which has seen all frames, the others
/// those outside their `fold`; rows whose window does not give all of them keep the centroid of the table.
fn centroids(data: &Stars<'_>, sample: &Sample, learned: &[Learned], fold: &[usize]) -> Centroids {
    let made: Vec<Made> = learned
        .par_iter()
        .enumerate()
        .map(|(k, one)| one_variant(data, sample, one, |frame| fold[frame] != k))
        .collect();
    let mut out = Centroids {
        kept: vec![false; data.frames.rows()],
        ..Centroids::default()
    };
    let any = made.iter().any(|m| m.switching > 0);
    for one in made {
        let [moments, plain, unbiased, fitted, gaussian, followed] = one.variants;
        out.moments.push(moments);
        out.plain.push(plain);
        out.unbiased.push(unbiased);
        out.fitted.push(fitted);
        out.gaussian.push(gaussian);
        if any {
            out.followed.push(followed);
        }
        out.switching = one.switching;
        for (kept, one) in out.kept.iter_mut().zip(one.kept) {
            *kept |= one;
        }
    }
    out.zero_px = zeros(data, &out.kept, &[&out.moments, &out.fitted]);
    out
}

/// Centroids by what was learned from some frames.
struct Made {
    /// Moments, plain moments, these less their bias, fits, Gaussian fits, and fits with switching pixels followed.
    variants: [[Vec<f64>; 2]; WAYS],
    /// Rows that are those of the table.
    kept: Vec<bool>,
    /// Pixels that are followed.
    switching: usize,
}

/// Ways to form a centroid.
const WAYS: usize = 6;

/// Centroids of every star row by `one`, that was learned from the frames `taken`.
///
/// A spot has no zero of its own: positions found with it are set such that they are, in the mean over a
/// star, where its first moments are.
fn one_variant(
    data: &Stars<'_>,
    sample: &Sample,
    one: &Learned,
    taken: impl Fn(usize) -> bool,
) -> Made {
    let table = [data.frames.x_px.clone(), data.frames.y_px.clone()];
    let mut variants = [(); WAYS].map(|()| table.clone());
    let mut pixels = Pixels::default();
    let mut formed = Vec::with_capacity(sample.windows());
    let mut fits = Vec::with_capacity(sample.windows());
    let mut frame_taken = Vec::with_capacity(sample.windows());
    for frame in 0..fold_frames(sample) {
        for w in sample.windows_of(frame) {
            let fit = one.fitted(sample, w, &mut pixels);
            let found = fit.and_then(|fit| {
                let f = fit.at;
                let [m, plain] = one.moments(sample, w, &pixels)?;
                let b = one.moment_bias(sample, w, &fit, &pixels)?;
                let g = one.by_gaussian(sample, w, &mut pixels)?;
                Some([m, plain, [plain[0] - b[0], plain[1] - b[1]], f, g, f])
            });
            fits.push(fit);
            formed.push(found);
            frame_taken.push(taken(frame));
        }
    }
    let switching = follow(sample, one, &fits, &frame_taken, &mut formed);
    let mut off = vec![[const { Vec::new() }; 2 * (WAYS - 1)]; sample.stars];
    for (w, found) in formed.iter().enumerate() {
        let Some([m, others @ ..]) = found.filter(|_| frame_taken[w]) else {
            continue;
        };
        let star = &mut off[sample.star[w]];
        for (k, at) in others.iter().enumerate() {
            for axis in 0..2 {
                star[2 * k + axis].push(m[axis] - at[axis]);
            }
        }
    }
    let zero: Vec<[f64; 2 * (WAYS - 1)]> = off
        .into_iter()
        .map(|star| star.map(|list| clipped_mean(&list)))
        .collect();
    let mut kept = vec![true; data.frames.rows()];
    for (w, found) in formed.into_iter().enumerate() {
        let Some(found) = found else {
            continue;
        };
        kept[sample.row[w]] = false;
        for (k, (variant, at)) in variants.iter_mut().zip(found).enumerate() {
            for axis in 0..2 {
                let zero = k
                    .checked_sub(1)
                    .map_or(0.0, |k| zero[sample.star[w]][2 * k + axis]);
                variant[axis][sample.row[w]] = at[axis] + zero;
            }
        }
    }
    Made {
        variants,
        kept,
        switching,
    }
}

/// Follows pixels that switch and sets the last way of every window that they touch; returns their number.
fn follow(
    sample: &Sample,
    one: &Learned,
    fits: &[Option<Fitted>],
    taken: &[bool],
    formed: &mut [Option<[[f64; 2]; WAYS]>],
) -> usize {
    if !one.mapped {
        return 0;
    }
    let Some(followed) = switching::follow(sample, one, fits, taken) else {
        return 0;
    };
    let in_time = [followed.shift.as_slice(), &followed.variance];
    let mut pixels = Pixels::default();
    for (w, (found, start)) in formed.iter_mut().zip(fits).enumerate() {
        let (Some(found), Some(start)) = (found, start) else {
            continue;
        };
        if followed.shift[sample.cells_of(w)].iter().all(|s| *s == 0.0) {
            continue;
        }
        if let Some(fit) = one.fitted_with(sample, w, start, in_time, &mut pixels) {
            found[WAYS - 1] = fit.at;
        }
    }
    followed.pixels
}

fn fold_frames(sample: &Sample) -> usize {
    sample.first_window.len() - 1
}

/// Mean of what lies within five robust sigmas of the median.
fn clipped_mean(values: &[f64]) -> f64 {
    let middle = robust_median(values.to_vec()).unwrap_or(0.0);
    let off = values.iter().map(|v| (v - middle).abs()).collect();
    let reach = 5.0 * MAD_SCALE * robust_median(off).unwrap_or(0.0);
    let near = values.iter().filter(|v| (*v - middle).abs() <= reach);
    let (sum, count) = near.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    if count > 0.0 { sum / count } else { middle }
}

/// 1 sigma of each star's mean position, px, from its scatter between what was learned outside each fold
/// (delete-one jackknife), the largest over `kinds`; with few folds each star's own is drawn half way to the
/// mean over all. Rows `kept` from the table know nothing of it.
///
/// Source: Efron & Stein 1981, Annals of Statistics 9, 586 (jackknife).
fn zeros(data: &Stars<'_>, kept: &[bool], kinds: &[&Variants]) -> Vec<[f64; 2]> {
    let stars = data.stars;
    let mut largest = vec![[0.0_f64; 2]; stars];
    for variants in kinds {
        // the last has seen all frames
        let folds = variants.len().saturating_sub(1);
        if folds < 2 {
            continue;
        }
        let n = folds as f64;
        let mut variance = vec![[0.0; 2]; stars];
        for axis in 0..2 {
            let mut means = vec![vec![0.0; stars]; folds];
            let mut rows = vec![0.0_f64; stars];
            for (row, &star) in data.star.iter().enumerate().filter(|(row, _)| !kept[*row]) {
                rows[star] += 1.0;
                for (mean, variant) in means.iter_mut().zip(variants.iter()) {
                    // from the table's: positions on a wide detector lose digits
                    mean[star] += variant[axis][row] - variants[folds][axis][row];
                }
            }
            for star in 0..stars {
                let at = |k: usize| means[k][star] / rows[star].max(1.0);
                let middle = (0..folds).map(at).sum::<f64>() / n;
                let square: f64 = (0..folds).map(|k| (at(k) - middle).powi(2)).sum();
                variance[star][axis] = (n - 1.0) / n * square;
            }
        }
        let pooled = variance.as_flattened().iter().sum::<f64>() / (2.0 * stars as f64);
        for (sigma, own) in largest.iter_mut().zip(&variance) {
            for axis in 0..2 {
                sigma[axis] = sigma[axis].max((0.5 * (own[axis] + pooled)).sqrt());
            }
        }
    }
    largest
}

/// The windows of the star rows, frame by frame; a row without one has no entry.
fn entries<'a>(data: &Stars<'_>, windows: &'a WindowTable) -> Vec<Vec<Entry<'a>>> {
    let window = windows_of_rows(data.frames, windows);
    // Outliers are kept: a warm pixel that few windows cross looks like one, and
    // particle hits are left out pixel by pixel.
    (0..data.frames.frames())
        .map(|k| {
            data.frames
                .rows_of(k)
                .filter_map(|row| {
                    let i = window[row]?;
                    let centre = Pixel {
                        x: data.expected_px[0][row],
                        y: data.expected_px[1][row],
                    };
                    Some(Entry {
                        row,
                        t_s: data.frames.t_s[k],
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
