//! A periodic pattern on the detector, which no effect of the catalogue has.
//!
//! What is left of both axes is searched for one wave vector k (cycles/px),
//!
//! ```text
//! r_a(x, y) = c_a cos 2 pi (kx x + ky y) + s_a sin 2 pi (kx x + ky y)      a = x, y
//! ```
//!
//! by a Fourier transform of the residuals on half pixels (x residual real, y residual
//! imaginary, so that |X|^2 + |Y|^2 = (|F(k)|^2 + |F(-k)|^2) / 2), on a grid twice finer
//! than 1/extent. The strongest peaks are held against the exact sums at the modelled
//! positions, and the best is refined there. The half pixels cost a part 1 - sinc^2(kx/2)
//! sinc^2(ky/2) of the power in the first step alone.
//!
//! Rows count by the noise of their star ([`crate::star::weights`]): of fourteen stars alike
//! in nothing but the wave, equal weights lose a third of its power.
//!
//! Every residual is less the mean of its star, so that only what changes along a star's
//! path counts: a constant of each star is the distortion's and the catalogue's. Whole
//! cycles per pixel along one axis are pixel phase and are taken out before; waves of the
//! distortion's length are not looked for. The four scores u (cos and sin, both axes) have
//!
//! ```text
//! T^2 = u' V^-1 u,    V = sum over clusters u_c u_c',    P = 32 J K F(T^2 (G-4) / (4 (G-1)); 4, G-4)
//! ```
//!
//! with K independent wave vectors in the octave of k, of J octaves from the distortion's waves to one cycle per pixel
//! ([`octaves`]), and G clusters: frames in one covariance, cells of star and
//! block of time in another. So a wave of five cycles across the detector, of which there are few, does not pay for a
//! million fringes. A third P is that of the power over the mean power of waves as long, and up to twice,
//! once the wave is taken out. The largest of the three counts.
//!
//! Source: Scargle 1982 (periodogram); Hotelling 1931; Liang and Zeger 1986 (clusters).

use std::ops::Range;

use block_regression::{Folds, beyond};
use nalgebra::{Cholesky, Matrix2, Matrix4, Vector2, Vector4};
use pulp::Arch;
use rayon::prelude::*;
use statrs::distribution::FisherSnedecor;
use telemetry::report::{Dependence, Unattributed};

use crate::star::data::StarData;
use crate::unexplained::SEARCH_ALPHA;

mod octaves;
mod pixel_phase;
mod rings;
#[cfg(test)]
mod tests;
mod transform;
mod turn;
mod waves;

use octaves::{Others, Own};
pub(crate) use turn::Turned;
use waves::{RAW, RawSums, wave};

/// Peaks of the transform that are refined.
const REFINED: usize = 6;
/// A wave a quarter of a cycle off along both axes has (sin(pi/4)/(pi/4))^4 of its power: all of it is more by as much.
const REFINES: f64 = 1.52;
/// How often the middle of three points moves before they come closer, at most.
const MOST_MOVES: usize = 4;
/// Waves fewer than this times the distortion's order across the detector are its own.
const ORDERS: f64 = 0.5;
/// The order where none is declared.
const USUAL_ORDER: u32 = 7;
/// Share of a wave's power that rotations of whole frames must leave: they take a half of a wave at
/// most, but all of what a slow error of the reference leaves along the stars' paths.
const LEAST_OWN: f64 = 0.4;
/// Share of a wave's power that must change along the stars' paths.
const LEAST_MOTION: f64 = 0.1;
/// Fewest clusters of a covariance.
const LEAST_CLUSTERS: usize = 40;
/// From this many stars a frame on, what the reference turns a frame by is left out; of fewer, whose rotation takes
/// most of a wave, where it is so much of all.
const STARS_TO_TURN: usize = 5;
const TURNS_FEW: f64 = 0.1;
/// Least extent, px: less holds no waves to speak of.
const LEAST_EXTENT_PX: f64 = 16.0;

/// Residuals on the detector, the rows of each star together.
#[derive(Clone, Debug, Default)]
struct Field {
    x_px: Vec<f64>,
    y_px: Vec<f64>,
    /// Weighted residual of each axis, arcsec, less the mean of its star.
    residual: [Vec<f64>; 2],
    frame: Vec<u32>,
    /// Rows of each star, and the weight of each of them: it is in columns and residuals.
    stars: Vec<Range<usize>>,
    weight: Vec<f64>,
    /// Whether the stars have spots of their own.
    own_spots: bool,
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pattern {
    /// Cycles per pixel; of a ring those outwards, first.
    pub(crate) wave: [f64; 2],
    /// Whether it is round about the boresight.
    ring: bool,
    /// What p pays for.
    trials: f64,
    pub(crate) p_value: f64,
    /// Squares that the wave takes, in units of each axis' variance.
    power: f64,
    /// Out-of-fold share of the residual's variance.
    pub(crate) explained: f64,
    /// Extent that the rows cover, px.
    extent: [f64; 2],
}

impl Pattern {
    /// The name of the variable that the residual follows.
    pub(crate) fn variable(&self) -> &'static str {
        let cycles = |axis: usize, k: f64| ((self.wave[axis].abs() - k) * self.extent[axis]).abs();
        if self.ring {
            "x_px*y_px"
        } else if cycles(0, 0.0) < 1.0 {
            "y_px"
        } else if cycles(1, 0.0) < 1.0 {
            "x_px"
        } else if cycles(0, 1.0) < 1.0 && cycles(1, 1.0) < 1.0 {
            "pixel_phase_x*pixel_phase_y"
        } else {
            "x_px*y_px"
        }
    }

    /// Writes it where it is reported: something is left then. `left` is the share of the
    /// before variance that is left.
    pub(crate) fn tell(&self, unattributed: &mut Unattributed, left: f64) {
        let variable = self.variable();
        let list = &mut unattributed.depends_on;
        let better =
            |d: &Dependence| d.variance_explained >= self.explained && d.p_value < SEARCH_ALPHA;
        unattributed.present = true;
        let share = unattributed.variance_fraction.unwrap_or(0.0);
        unattributed.variance_fraction = Some(share.max(self.explained * left));
        if list.iter().any(|d| d.variable == variable && better(d)) {
            return;
        }
        list.retain(|d| d.variable != variable);
        let smaller = |d: &Dependence| d.variance_explained < self.explained;
        let at = list.iter().position(smaller).unwrap_or(list.len());
        let entry = Dependence {
            variable: variable.to_owned(),
            variance_explained: self.explained,
            p_value: self.p_value,
        };
        list.insert(at, entry);
    }
}

/// The pattern that `residual` (arcsec, per axis over all rows) follows, if one is beyond
/// doubt. `turned` is it less its frames' rotations. A star counts by the `weight` of its rows; `order` is
/// the declared distortion's; with `own_spots` the stars' centroids were learned from windows.
pub(crate) fn search(
    data: &StarData,
    residual: &[Vec<f64>],
    turned: &Turned<'_>,
    weight: &[f64],
    folds: &Folds,
    order: Option<u32>,
    own_spots: bool,
) -> Option<Pattern> {
    let [rx, ry] = residual else { return None };
    let frame = data.frames.frame_of_rows();
    let counts = |r: usize| {
        !data.outlier[r]
            && [rx, ry, &data.modelled[0], &data.modelled[1]]
                .iter()
                .all(|v| v[r].is_finite())
    };
    let rows = || (0..frame.len()).filter(|&r| counts(r));
    let mut count = vec![0; data.stars.len()];
    rows().for_each(|row| count[data.star[row]] += 1);
    let mut of_star: Vec<Vec<usize>> = count.into_iter().map(Vec::with_capacity).collect();
    rows().for_each(|row| of_star[data.star[row]].push(row));
    let at = [data.modelled[0].as_slice(), &data.modelled[1]];
    let field = |[x, y]: [&Vec<f64>; 2]| Field {
        own_spots,
        ..Field::new(at, [x, y], &frame, &of_star, weight)
    };
    let as_left = || field([rx, ry]);
    let many = data.t_s.len() >= STARS_TO_TURN * data.frames.frames();
    if !many && turned.share() < TURNS_FEW {
        return likeliest(as_left().patterns(&as_left, folds, order));
    }
    let mut found = field(turned.known.each_ref()).patterns(&as_left, folds, order);
    if !found.is_empty() {
        let whole = turned.whole();
        let own = |pattern: &Pattern| field(whole.each_ref()).power_and_chance_of(pattern, folds);
        found.retain(|pattern| {
            own(pattern).is_some_and(|(power, chance)| {
                let kept = (power / pattern.power).min(1.0);
                // it is not looked for anew: what rotations must take of it is let off the price
                kept > LEAST_OWN && chance * pattern.trials.powf(kept) < SEARCH_ALPHA
            })
        });
    }
    likeliest(found)
}

fn likeliest(found: Vec<Pattern>) -> Option<Pattern> {
    let by_chance = |a: &Pattern, b: &Pattern| a.p_value.total_cmp(&b.p_value);
    found.into_iter().min_by(by_chance)
}

/// Sums of the columns cos and sin, less the mean of each star, with each other and with
/// both axes.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    normal: Matrix2<f64>,
    score: [Vector2<f64>; 2],
}

/// Rows that are summed in one go.
const PIECE: usize = 16_384;

fn pieces(rows: &Range<usize>) -> impl Iterator<Item = Range<usize>> + use<> {
    let end = rows.end;
    let starts = rows.clone().step_by(PIECE);
    starts.map(move |at| at..(at + PIECE).min(end))
}

fn pieces_of(rows: usize) -> usize {
    rows.div_ceil(PIECE)
}

impl Sums {
    /// Of the sums over a star's rows, which are `rows` many, each of this `weight`.
    fn centred(raw: &[f64; RAW], rows: usize, weight: f64) -> Self {
        let n = rows as f64;
        let [c, s, cc, cs, ss, cx, sx, cy, sy, x, y] = *raw;
        let cs = cs - c * s / n;
        let normal = Matrix2::new(cc - c * c / n, cs, cs, ss - s * s / n);
        Self {
            normal: normal * (weight * weight),
            // the residuals have theirs
            score: [
                Vector2::new(cx - c * x / n, sx - s * x / n) * weight,
                Vector2::new(cy - c * y / n, sy - s * y / n) * weight,
            ],
        }
    }

    fn add(mut self, other: &Self) -> Self {
        self.normal += other.normal;
        self.score[0] += other.score[0];
        self.score[1] += other.score[1];
        self
    }

    /// Amplitudes of cos and sin for each axis.
    fn amplitudes(&self) -> Option<[Vector2<f64>; 2]> {
        let inverse = self.normal.try_inverse()?;
        Some(self.score.map(|s| inverse * s))
    }

    /// The squares that the wave takes away, in units of each axis' variance.
    fn power(&self, variance: [f64; 2]) -> f64 {
        self.amplitudes().map_or(0.0, |beta| {
            (0..2)
                .map(|a| beta[a].dot(&self.score[a]) / variance[a])
                .sum()
        })
    }
}

impl Field {
    fn new(
        at: [&[f64]; 2],
        residual: [&[f64]; 2],
        frame: &[u32],
        of_star: &[Vec<usize>],
        weight: &[f64],
    ) -> Self {
        let rows = || of_star.iter().filter(|rows| rows.len() > 1);
        let count = rows().map(Vec::len).sum();
        let room = || Vec::with_capacity(count);
        let mut field = Self {
            x_px: room(),
            y_px: room(),
            residual: [room(), room()],
            frame: Vec::with_capacity(count),
            ..Self::default()
        };
        for rows in rows() {
            let first = field.frame.len();
            let w = weight[rows[0]];
            for axis in 0..2 {
                let mean = rows.iter().map(|&r| residual[axis][r]).sum::<f64>() / rows.len() as f64;
                let centred = rows.iter().map(|&r| w * (residual[axis][r] - mean));
                field.residual[axis].extend(centred);
            }
            field.weight.push(w);
            field.x_px.extend(rows.iter().map(|&r| at[0][r]));
            field.y_px.extend(rows.iter().map(|&r| at[1][r]));
            field.frame.extend(rows.iter().map(|&r| frame[r]));
            field.stars.push(first..field.frame.len());
        }
        field
    }

    fn rows(&self) -> usize {
        self.frame.len()
    }

    fn extent(&self) -> [f64; 2] {
        [&self.x_px, &self.y_px].map(|v| {
            let low = v.iter().copied().fold(f64::INFINITY, f64::min);
            v.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low
        })
    }

    fn variance(&self) -> [f64; 2] {
        self.residual
            .each_ref()
            .map(|r| r.iter().map(|v| v * v).sum::<f64>() / r.len() as f64)
    }

    /// The power of a pattern, and the chance of its scores, without a search.
    fn power_and_chance_of(mut self, pattern: &Pattern, folds: &Folds) -> Option<(f64, f64)> {
        self.take_out_pixel_phase()?;
        if pattern.ring {
            self.round();
        }
        let power = self.sums(pattern.wave).power(self.variance());
        Some((power, self.chance(pattern.wave, folds)?))
    }

    /// The whole search, for a wave and for a ring; amplitudes and the share they explain are those of the field
    /// `as_left`.
    fn patterns(
        mut self,
        as_left: &dyn Fn() -> Self,
        folds: &Folds,
        order: Option<u32>,
    ) -> Vec<Pattern> {
        let extent = self.extent();
        let small = extent.iter().any(|l| *l < LEAST_EXTENT_PX) || !self.has_clusters(folds);
        if small || self.take_out_pixel_phase().is_none() {
            return Vec::new();
        }
        let cycles = ORDERS * f64::from(order.unwrap_or(USUAL_ORDER).max(3));
        let wave = self.wave(as_left, folds, &Own { extent, cycles });
        // in place: there is no room for another
        self.round();
        let ring = self.ring(as_left, folds, cycles);
        wave.into_iter().chain(ring).collect()
    }

    /// Whether there are as many clusters of both kinds as a chance takes: a transform costs the same of few rows as of many.
    fn has_clusters(&self, folds: &Folds) -> bool {
        let block = block_of_frame(folds);
        let mut frames = vec![false; block.len()];
        let mut cells = 0;
        for rows in &self.stars {
            let mut last = usize::MAX;
            for &frame in &self.frame[rows.clone()] {
                let frame = frame as usize;
                frames[frame] = true;
                cells += usize::from(block[frame] != last);
                last = block[frame];
            }
        }
        let frames = frames.into_iter().filter(|seen| *seen).count();
        frames.min(cells) >= LEAST_CLUSTERS
    }

    fn wave(&self, as_left: &dyn Fn() -> Self, folds: &Folds, own: &Own) -> Option<Pattern> {
        let extent = own.extent;
        let variance = self.variance();
        if variance.iter().any(|v| v.is_nan() || *v <= 0.0) {
            return None;
        }
        let power = |k: [f64; 2]| {
            let sums = self.sums(k);
            let moves = sums.normal.trace() / self.rows() as f64;
            if own.excludes(k) || moves < LEAST_MOTION {
                0.0
            } else {
                sums.power(variance)
            }
        };
        let mut peaks: Vec<(f64, [f64; 2])> = self
            .peaks(variance, own)
            .into_iter()
            .chain([[1.0, 1.0], [1.0, -1.0]])
            .map(|k| (power(k), k))
            .collect();
        // what is left of the power once its octave is paid
        let worth = |peak: &(f64, [f64; 2])| peak.0 - 2.0 * own.trials(peak.1).ln();
        let better = |a: &(f64, [f64; 2]), b: &(f64, [f64; 2])| worth(a).total_cmp(&worth(b));
        peaks.retain(|&(power, k)| could_show(REFINES * power, own.trials(k)));
        peaks.sort_by(|a, b| better(b, a));
        let step = extent.map(|l| 0.25 / l);
        let best = peaks
            .into_iter()
            .take(REFINED)
            .map(|peak| climb(&power, peak, step, 1))
            .max_by(better)?;
        let best = climb(&power, best, step.map(|s| 0.25 * s), 3);
        let wave = best.1;
        if own.excludes(wave) {
            return None;
        }
        let trials = own.trials(wave);
        let found = Pattern {
            wave,
            ring: false,
            trials,
            power: best.0,
            p_value: 1.0,
            explained: 0.0,
            extent,
        };
        self.beyond_doubt(found, || own.as_long_as(wave), as_left, folds)
    }

    /// `found` with its chance, and what it explains of the field `as_left`; `None` where it may be chance, or explains
    /// nothing. `others` are waves like it.
    fn beyond_doubt(
        &self,
        found: Pattern,
        others: impl FnOnce() -> Others,
        as_left: &dyn Fn() -> Self,
        folds: &Folds,
    ) -> Option<Pattern> {
        let chance = self.chance(found.wave, folds)?;
        if chance * found.trials >= SEARCH_ALPHA {
            return None;
        }
        let usual = self.chance_around(found.wave, self.variance(), &others())?;
        let p_value = found.trials * chance.max(usual);
        let mut left = as_left();
        if found.ring {
            left.round();
        }
        let explained = left.share_out_of_fold(found.wave, folds)?;
        (p_value < SEARCH_ALPHA && explained > 0.0).then_some(Pattern {
            p_value,
            explained,
            ..found
        })
    }

    /// Weighted columns cos and sin of the rows of one star, less their means.
    fn columns(&self, star: usize, k: [f64; 2], out: &mut Vec<[f64; 2]>) {
        let (rows, w) = (&self.stars[star], self.weight[star]);
        out.clear();
        let (mut c, mut s) = (0.0, 0.0);
        for row in rows.clone() {
            let [cos, sin] = wave(k[0] * self.x_px[row] + k[1] * self.y_px[row]);
            c += cos;
            s += sin;
            out.push([cos, sin]);
        }
        let n = rows.len() as f64;
        for v in out {
            *v = [w * (v[0] - c / n), w * (v[1] - s / n)];
        }
    }

    fn sums(&self, k: [f64; 2]) -> Sums {
        let pieces: Vec<Range<usize>> = self.stars.iter().flat_map(pieces).collect();
        let raw: Vec<[f64; RAW]> = pieces.par_iter().map(|p| self.raw_sums(p, k)).collect();
        let mut raw = raw.iter();
        let stars = self.stars.iter().zip(&self.weight);
        stars.fold(Sums::default(), |all, (rows, weight)| {
            let mut sum = [0.0; RAW];
            for piece in raw.by_ref().take(pieces_of(rows.len())) {
                sum.iter_mut().zip(piece).for_each(|(s, p)| *s += p);
            }
            all.add(&Sums::centred(&sum, rows.len(), *weight))
        })
    }

    /// Where some rows lie, x and y.
    fn places(&self, rows: &Range<usize>) -> [&[f64]; 2] {
        [&self.x_px[rows.clone()], &self.y_px[rows.clone()]]
    }

    /// Sums of cos and sin, of their products, and of both with the residuals.
    fn raw_sums(&self, rows: &Range<usize>, k: [f64; 2]) -> [f64; RAW] {
        Arch::new().dispatch(RawSums {
            at: self.places(rows),
            residual: self.residual.each_ref().map(|r| &r[rows.clone()]),
            k,
        })
    }

    fn sums_of(&self, first: usize, columns: &[[f64; 2]], counts: impl Fn(usize) -> bool) -> Sums {
        let (mut cc, mut cs, mut ss) = (0.0, 0.0, 0.0);
        let mut score = [[0.0; 2]; 2];
        for (j, &[c, s]) in columns.iter().enumerate() {
            let row = first + j;
            if counts(row) {
                cc += c * c;
                cs += c * s;
                ss += s * s;
                for (score, residual) in score.iter_mut().zip(&self.residual) {
                    score[0] += c * residual[row];
                    score[1] += s * residual[row];
                }
            }
        }
        Sums {
            normal: Matrix2::new(cc, cs, cs, ss),
            score: score.map(Vector2::from),
        }
    }

    /// The chance of the scores at `k` under both covariances, without a search.
    fn chance(&self, k: [f64; 2], folds: &Folds) -> Option<f64> {
        let mut frames: Vec<Vector4<f64>> = Vec::new();
        let mut cells: Vec<Vector4<f64>> = Vec::new();
        let block = block_of_frame(folds);
        frames.resize(block.len(), Vector4::zeros());
        let mut columns = Vec::new();
        for (star, rows) in self.stars.iter().enumerate() {
            self.columns(star, k, &mut columns);
            let mut last = usize::MAX;
            for (j, &[c, s]) in columns.iter().enumerate() {
                let row = rows.start + j;
                let [x, y] = [self.residual[0][row], self.residual[1][row]];
                let u = Vector4::new(c * x, s * x, c * y, s * y);
                let frame = self.frame[row] as usize;
                frames[frame] += u;
                let cell = block[frame];
                if cell != last {
                    last = cell;
                    cells.push(Vector4::zeros());
                }
                if let Some(cell) = cells.last_mut() {
                    *cell += u;
                }
            }
        }
        frames.retain(|u| u.norm_squared() > 0.0);
        Some(hotelling(&frames)?.max(hotelling(&cells)?))
    }

    /// The chance of the power at `k` where that of `others` is usual.
    fn chance_around(&self, k: [f64; 2], variance: [f64; 2], others: &Others) -> Option<f64> {
        let sums = self.sums(k);
        let beta = sums.amplitudes()?;
        let mut left = self.clone();
        let mut columns = Vec::new();
        for (star, rows) in self.stars.iter().enumerate() {
            self.columns(star, k, &mut columns);
            for (j, &[c, s]) in columns.iter().enumerate() {
                for (residual, b) in left.residual.iter_mut().zip(&beta) {
                    residual[rows.start + j] -= b[0] * c + b[1] * s;
                }
            }
        }
        let waves = others.waves.iter();
        let powers: Vec<f64> = waves.map(|k| left.sums(*k).power(variance)).collect();
        others.chance(sums.power(variance), &powers)
    }

    /// Share of the variance that the wave explains in each fold with the amplitudes of the others.
    fn share_out_of_fold(&self, k: [f64; 2], folds: &Folds) -> Option<f64> {
        let fold = folds.fold_of_frame();
        let mut each = vec![Sums::default(); folds.count];
        let mut columns = Vec::new();
        for (star, rows) in self.stars.iter().enumerate() {
            self.columns(star, k, &mut columns);
            for (f, sums) in each.iter_mut().enumerate() {
                let part = self.sums_of(rows.start, &columns, |row| {
                    fold[self.frame[row] as usize] == f
                });
                *sums = sums.add(&part);
            }
        }
        let whole = each.iter().fold(Sums::default(), Sums::add);
        let mut gain = 0.0;
        for own in &each {
            let others = Sums {
                normal: whole.normal - own.normal,
                score: [0, 1].map(|a| whole.score[a] - own.score[a]),
            };
            for (b, score) in others.amplitudes()?.iter().zip(&own.score) {
                gain += 2.0 * b.dot(score) - (own.normal * b).dot(b);
            }
        }
        let total: f64 = self.residual.iter().flatten().map(|r| r * r).sum();
        Some(gain / total)
    }
}

/// Whether so much power, a chi-squared of 4 of which no covariance makes more, could be beyond chance.
fn could_show(power: f64, trials: f64) -> bool {
    let x = 0.5 * power;
    (1.0 + x) * (-x).exp() * trials < SEARCH_ALPHA
}

/// The top of `power` near a wave vector: axis by axis that of a parabola through three points, a `step` apart, which
/// is then a quarter as long; where the highest of the three is at an end, that is the next middle.
fn climb(
    power: &impl Fn([f64; 2]) -> f64,
    mut best: (f64, [f64; 2]),
    mut step: [f64; 2],
    rounds: usize,
) -> (f64, [f64; 2]) {
    for _ in 0..rounds {
        for _ in 0..MOST_MOVES {
            let mut inside = true;
            for axis in 0..2 {
                let (middle, mut k) = best;
                let mut at = |offset: f64| {
                    k[axis] = best.1[axis] + offset;
                    (power(k), k)
                };
                let [low, high] = [at(-step[axis]), at(step[axis])];
                let bend = 2.0 * middle - low.0 - high.0;
                let end = if high.0 > low.0 { high } else { low };
                let found = if end.0 > middle {
                    inside = false;
                    end
                } else if bend > 0.0 {
                    at(0.5 * step[axis] * (high.0 - low.0) / bend)
                } else {
                    best
                };
                if found.0 > best.0 {
                    best = found;
                }
            }
            if inside {
                break;
            }
        }
        step = step.map(|s| 0.25 * s);
    }
    best
}

fn block_of_frame(folds: &Folds) -> Vec<usize> {
    let mut out = Vec::new();
    for (b, block) in folds.blocks.iter().enumerate() {
        out.extend(std::iter::repeat_n(b, block.len()));
    }
    out
}

/// The chance of the sum of independent vectors of mean zero.
fn hotelling(clusters: &[Vector4<f64>]) -> Option<f64> {
    if clusters.len() < LEAST_CLUSTERS {
        return None;
    }
    let n = clusters.len() as f64;
    let sum: Vector4<f64> = clusters.iter().sum();
    let mean = sum / n;
    let spread: Matrix4<f64> = clusters
        .iter()
        .map(|u| (u - mean) * (u - mean).transpose())
        .sum();
    let covariance = spread * (n / (n - 1.0));
    let square = sum.dot(&Cholesky::new(covariance)?.solve(&sum));
    let law = FisherSnedecor::new(4.0, n - 4.0).ok()?;
    Some(beyond(&law, square * (n - 4.0) / (4.0 * (n - 1.0))))
}
