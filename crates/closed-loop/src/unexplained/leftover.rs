//! What remains in time: lines and jumps of what all rows of a frame share.
//!
//! Series of one number a frame (rotations, growth and shears of the image, attitude axes) are
//! whitened by the noise that suits them best ([`coloured_noise`]) and searched for a sinusoid,
//!
//! ```text
//! z(f) = power of the best sinusoid at f / mean power around f,    P = M (1 + z/n)^-n
//! ```
//!
//! with M frequencies on a grid four times finer than 1/span, and n independent ones
//! around f that the mean is of ([`lines`]). What is found is refined to the top of z, taken
//! out of the series as it was before whitening, and the search goes on. Steps then ([`jumps`]).
//! alpha is a quarter of a hundredth over all series, lines and jumps together.
//!
//! Source: Scargle 1982 (periodogram), the F law of a ratio of two mean powers.

use block_regression::Folds;
use coloured_noise::Coloured;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3, Vector4};
use rayon::prelude::*;
use spectra::robust::median_step;
use spectra::standing_out::mark;

use crate::attitude::spatial_errors::SpatialErrors;
use crate::bins::{self, Bins};
use crate::follows;
use crate::star::data::StarData;
use crate::star::frame_rotation::rotation_row;
use crate::unexplained::SEARCH_ALPHA;
use crate::unexplained::grid::coherent_s;
use lines::Spectrum;
use telemetry::report::Unattributed;

pub(crate) mod jumps;
pub(crate) mod lines;
#[cfg(test)]
mod tests;

/// Fewest points of a series that is searched.
const MIN_POINTS: usize = 60;
/// Points of a series beyond which neighbours are averaged.
pub(crate) const MOST_POINTS: usize = 4800;
/// Least share of the square of many points that is taken to be white.
const LEAST_WHITE: f64 = 0.01;
/// Lines, and jumps, of one series.
const MOST: usize = 5;
/// Chance below which a line or a jump is worth a search with it: that judges it, and more strictly.
pub(crate) const WORTH_A_SEARCH: f64 = 0.1;

/// What the image can do besides turning: x and y of a shift per x and y of the place. It grows,
/// or is sheared either way.
const STRETCHES: [[[f64; 2]; 2]; 3] = [
    [[1.0, 0.0], [0.0, 1.0]],
    [[1.0, 0.0], [0.0, -1.0]],
    [[0.0, 1.0], [1.0, 0.0]],
];
/// Least share of a stretch that is no rotation.
const LEAST_INFORMATION: f64 = 1e-6;

/// One number a frame.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    pub(crate) t_s: Vec<f64>,
    /// Value, arcsec.
    pub(crate) value: Vec<f64>,
    /// Weight: the white variance is in inverse proportion; 0 does not count.
    pub(crate) weight: Vec<f64>,
    /// Jumps that the declared model makes on this axis.
    pub(crate) changes: Option<(SpatialErrors, usize)>,
    /// It is about an axis that the tracker turns about.
    pub(crate) turns: bool,
}

/// Lines and jumps of one bundle.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Leftover {
    pub(crate) lines_hz: Vec<f64>,
    pub(crate) jumps_s: Vec<f64>,
}

impl Leftover {
    /// Writes them where they are reported: something is left then.
    pub(crate) fn tell(self, unattributed: &mut Unattributed) {
        if self.lines_hz.is_empty() && self.jumps_s.is_empty() {
            return;
        }
        if !unattributed.present {
            // what chance does as well is not named beside it
            unattributed.depends_on.retain(follows::is_beyond_chance);
        }
        unattributed.present = true;
        unattributed.lines_hz = self.lines_hz;
        unattributed.jumps_s = self.jumps_s;
    }
}

/// Series with their spectra: what lines and jumps are looked for in.
pub(crate) struct Series {
    each: Vec<Searched>,
    /// Chance that one of them shows a line, or a jump, that is none.
    alpha: f64,
}

/// One series.
struct Searched {
    /// In which jumps are looked for: means, where there are too many points.
    means: Track,
    /// In which lines are, where these are not the means: a fast line is another in them.
    all: Option<Track>,
    spectrum: Option<Spectrum>,
}

impl Searched {
    fn of(track: &Track) -> Self {
        let means = track.thinned();
        let all = (track.t_s.len() > MOST_POINTS).then(|| track.counted());
        Self {
            means,
            // a spectrum of so many points at any times would take hours
            all: all.filter(|all| spectra::is_on_a_grid(&all.t_s)),
            spectrum: None,
        }
    }

    /// What has the spectrum.
    fn fine(&self) -> &Track {
        self.all.as_ref().unwrap_or(&self.means)
    }

    /// What is left, its lines, and its jumps.
    fn describe(self, alpha: f64) -> (Track, Vec<f64>, Vec<f64>) {
        let Self {
            mut means,
            all,
            spectrum,
        } = self;
        let (lines, noise) = match (all, spectrum) {
            (Some(mut all), Some(spectrum)) => {
                let (lines, _) = all.lines(alpha, spectrum);
                if !lines.is_empty() {
                    means = all.thinned();
                }
                (lines, None)
            }
            (None, Some(spectrum)) => means.lines(alpha, spectrum),
            (_, None) => Default::default(),
        };
        let jumps = means.jumps(alpha, noise);
        (means, lines, jumps)
    }
}

impl Series {
    pub(crate) fn of(tracks: &[Track]) -> Self {
        let mut each: Vec<Searched> = tracks
            .par_iter()
            .map(Searched::of)
            .filter(|one| one.means.t_s.len() >= MIN_POINTS)
            .collect();
        let spectra = lines::spectra(&each.iter().map(Searched::fine).collect::<Vec<_>>());
        for (one, spectrum) in each.iter_mut().zip(spectra) {
            one.spectrum = spectrum;
        }
        Self {
            each,
            alpha: SEARCH_ALPHA / (2.0 * tracks.len().max(1) as f64),
        }
    }

    /// Rotations about X and Y.
    pub(crate) fn across(&self) -> Option<[&Track; 2]> {
        let mut turns = self.each.iter().map(|one| &one.means).filter(|t| t.turns);
        Some([turns.next()?, turns.next()?])
    }

    /// Lines and jumps of all of them.
    pub(crate) fn describe(self) -> Leftover {
        let alpha = self.alpha;
        let each: Vec<_> = self
            .each
            .into_par_iter()
            .map(|one| one.describe(alpha))
            .collect();
        let mut out = Leftover::default();
        for (track, lines, jumps) in each {
            let apart_hz = 1.0 / coherent_s(&track.t_s);
            for f in lines {
                // the same line in two series is one
                if out.lines_hz.iter().all(|g| (f - g).abs() > apart_hz) {
                    out.lines_hz.push(f);
                }
            }
            let step = median_step(&track.t_s).unwrap_or(0.0);
            for t in jumps {
                if out.jumps_s.iter().all(|s| (t - s).abs() > 2.5 * step) {
                    out.jumps_s.push(t);
                }
            }
        }
        out.lines_hz.sort_by(f64::total_cmp);
        out.jumps_s.sort_by(f64::total_cmp);
        out
    }
}

/// What the stars of a frame share, of residuals (arcsec, per axis over all rows) of this
/// `weight`: the rotation where it is held against a reference, and the growth and both shears
/// of the image, arcsec at the edge.
pub(crate) fn star_tracks(data: &StarData, residual: &[Vec<f64>], weight: &[f64]) -> Vec<Track> {
    let frames = data.frames.frames();
    let empty = || Track {
        t_s: data.frames.t_s.clone(),
        value: vec![0.0; frames],
        weight: vec![0.0; frames],
        changes: None,
        turns: false,
    };
    let mut tracks = vec![empty(); 3 + STRETCHES.len()];
    tracks[..3].iter_mut().for_each(|t| t.turns = true);
    let half = data.camera.half_size_px();
    for frame in 0..frames {
        let rows: Vec<usize> = data
            .frames
            .rows_of(frame)
            .filter(|&r| !data.outlier[r] && residual.iter().all(|a| a[r].is_finite()))
            .collect();
        let (mut normal, mut moment) = (Matrix3::zeros(), Vector3::zeros());
        let mut stretch = [(Vector4::zeros(), 0.0); STRETCHES.len()];
        for &r in &rows {
            let w = weight[r] * weight[r];
            let at = [0, 1].map(|a| data.modelled[a][r] / half[a]);
            for (axis, turn) in rotation_row(data, r).into_iter().enumerate() {
                let turn = Vector3::from(turn);
                normal += turn * turn.transpose() * w;
                moment += turn * (w * residual[axis][r]);
                for (sum, by) in stretch.iter_mut().zip(STRETCHES) {
                    let g = by[axis][0] * at[0] + by[axis][1] * at[1];
                    sum.0 += Vector4::new(turn[0], turn[1], turn[2], g) * (w * g);
                    sum.1 += w * g * residual[axis][r];
                }
            }
        }
        let Some(inverse) = normal.try_inverse().filter(|_| rows.len() >= 2) else {
            continue;
        };
        let rotation = inverse * moment;
        if !data.free_attitude {
            for axis in 0..3 {
                tracks[axis].value[frame] = rotation[axis];
                tracks[axis].weight[frame] = 1.0 / inverse[(axis, axis)];
            }
        }
        // each beside the rotation
        for (track, (cross, score)) in tracks[3..].iter_mut().zip(&stretch) {
            let turned = cross.fixed_rows::<3>(0).into_owned();
            let information = cross[3] - turned.dot(&(inverse * turned));
            if rows.len() >= 3 && information > LEAST_INFORMATION * cross[3] {
                track.value[frame] = (score - turned.dot(&rotation)) / information;
                track.weight[frame] = information;
            }
        }
    }
    tracks.retain(|t| t.weight.iter().any(|w| *w > 0.0));
    tracks
}

/// Attitude residuals (arcsec) of three axes.
pub(crate) fn attitude_tracks(
    t_s: &[f64],
    axes: &[Vec<f64>],
    outlier: &[Vec<bool>; 3],
    changes: Option<&SpatialErrors>,
) -> Vec<Track> {
    axes.iter()
        .zip(outlier)
        .enumerate()
        .map(|(axis, (value, outlier))| Track {
            changes: changes.map(|c| (c.clone(), axis)),
            turns: true,
            t_s: t_s.to_vec(),
            value: value.clone(),
            weight: outlier.iter().map(|o| f64::from(u8::from(!o))).collect(),
        })
        .collect()
}

impl Track {
    fn span(&self) -> f64 {
        self.t_s
            .last()
            .zip(self.t_s.first())
            .map_or(0.0, |(l, f)| l - f)
    }

    /// Points that count, about their mean, without spikes.
    fn counted(&self) -> Self {
        self.means_over((0..self.t_s.len()).map(|k| k..k + 1))
    }

    /// The same, averaged where they are too many.
    fn thinned(&self) -> Self {
        if self.t_s.len() <= MOST_POINTS {
            return self.counted();
        }
        let folds = Folds::whole(self.t_s.len());
        self.means_over(Bins::cut(&self.t_s, &folds, bins::MOST).rows)
    }

    fn means_over(&self, rows: impl IntoIterator<Item = std::ops::Range<usize>>) -> Self {
        let mut spike: Vec<bool> = self.weight.iter().map(|w| *w <= 0.0).collect();
        mark(&self.value, &mut spike);
        let mut out = Self {
            t_s: Vec::new(),
            value: Vec::new(),
            weight: Vec::new(),
            changes: self.changes.clone(),
            turns: self.turns,
        };
        for rows in rows {
            let (mut t, mut v, mut w, mut n) = (0.0, 0.0, 0.0, 0.0);
            for k in rows.filter(|&k| !spike[k]) {
                t += self.t_s[k];
                v += self.weight[k] * self.value[k];
                w += self.weight[k];
                n += 1.0;
            }
            if w > 0.0 {
                // whatever the weights: series of the same points have the same times
                out.t_s.push(t / n);
                out.value.push(v / w);
                out.weight.push(w);
            }
        }
        // a weight of the usual point: sigmas stay those of a point
        let usual = out.weight.iter().sum::<f64>() / out.weight.len().max(1) as f64;
        for w in &mut out.weight {
            *w /= usual;
        }
        out.centre();
        out
    }

    fn centre(&mut self) {
        let total: f64 = self.weight.iter().sum();
        let mean = self
            .value
            .iter()
            .zip(&self.weight)
            .map(|(v, w)| v * w)
            .sum::<f64>()
            / total;
        for v in &mut self.value {
            *v -= mean;
        }
    }

    /// Of many points what is slow is that of their means, and all else is white.
    fn noise(&self) -> Coloured {
        let fit = |of: &Self| Coloured::fit(&of.t_s, &of.value, &of.weight);
        if self.t_s.len() <= MOST_POINTS {
            return fit(self);
        }
        let noise = fit(&self.thinned());
        let weighed = self.value.iter().zip(&self.weight).map(|(v, w)| w * v * v);
        let square = weighed.sum::<f64>() / self.weight.iter().sum::<f64>();
        let white = square - noise.slow * noise.slow;
        Coloured {
            white: white.max(LEAST_WHITE * square).sqrt(),
            ..noise
        }
    }

    fn whitened(&self, noise: &Coloured, series: &[f64]) -> Vec<f64> {
        let mut out = series.to_vec();
        noise.whiten(&self.t_s, &self.weight, &mut [&mut out]);
        out
    }

    /// Least squares of `columns` under `noise`: amplitudes, and what they leave.
    fn take_out(&self, noise: &Coloured, columns: &[Vec<f64>]) -> Option<(Vec<f64>, Self)> {
        let n = self.t_s.len();
        let white: Vec<Vec<f64>> = columns.iter().map(|c| self.whitened(noise, c)).collect();
        let y = self.whitened(noise, &self.value);
        let design = DMatrix::from_fn(n, white.len(), |i, j| white[j][i]);
        let normal = design.transpose() * &design;
        let beta = normal
            .cholesky()?
            .solve(&(design.transpose() * DVector::from_vec(y)));
        let mut left = self.clone();
        for (column, b) in columns.iter().zip(beta.iter()) {
            for (v, c) in left.value.iter_mut().zip(column) {
                *v -= b * c;
            }
        }
        Some((beta.iter().copied().collect(), left))
    }

    fn loglik(&self, noise: &Coloured) -> f64 {
        noise.log_likelihood(&self.t_s, &self.value, &self.weight)
    }
}
