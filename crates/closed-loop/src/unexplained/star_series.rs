//! What each star does by itself in time: lines and steps.
//!
//! What all stars of a frame share is looked at elsewhere ([`crate::unexplained::leftover`]). Of what is left
//! of every star beside its frame's rotation, in sigmas of its own noise, per axis a:
//!
//! ```text
//! z_s(f) = sum over a of power of star s at f / mean power around f      4 F(4, 4 n) / 2
//! Z(f)   = sum over the stars                                           one line in many stars
//! T(t0)  = sum over stars and axes of (step at t0)^2 / variance          chi2, 2 a star
//! ```
//!
//! Times the frequencies, and stars, or the instants; of free attitudes with less freedom
//! ([`crate::unexplained::star_freedom`]). A step has to stay one: where the stars are
//! as slow without it as with it, they wander. And it has to be the stars': what a frame turned by
//! is known but for its noise, and a reference that wanders leaves a step or a line in all stars alike, so
//! that one has to be beyond chance at its instant or frequency without all that the stars of a frame share, too.
//! A strong line passes for a step and a step for a line: of both the lesser one is looked for beside the other.
//! Where what they do goes with where they are ([`by_place`]), that is told in the place of the star.
//!
//! Source: Scargle 1982 (periodogram); Wilks 1938.

use std::cell::LazyCell;

use block_regression::beyond;
use rayon::prelude::*;
use spectra::robust::median_step;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};
use telemetry::report::Unattributed;

use crate::causes::commonness::{self, IN_TIME, MOSTLY, stars_first};
use crate::follows::{self, is_beyond_chance};
use crate::star::data::StarData;
use crate::unexplained::around::Around;
use crate::unexplained::grid::{Grid, coherent_s, top};
use crate::unexplained::star_freedom::Freedom;
use by_place::by_place;
use own::Own;

mod by_place;
mod own;

/// Chance that either is told although there is none.
const ALPHA: f64 = 0.001;
/// The same of one that was found, at its instant or frequency, without what the stars of a frame share.
const ALPHA_ALONE: f64 = 0.01;
/// Least share of its squares that is still there then: a frame's rotation takes a few stars' share of what is each
/// star's own, and most of what it was itself.
const OWN_SHARE: f64 = 0.3;
/// Points of a star's series, and fewest.
const MOST_POINTS: usize = 1200;
const MIN_POINTS: usize = 60;
/// Stars beyond which only the brightest sums of rows are looked at.
const MOST_STARS: usize = 64;
/// Fewer cycles in the span are no line.
const MIN_CYCLES: f64 = 4.0;
/// What a line's power is held against.
const USUAL: Around = Around {
    finer: 2,
    count: 12,
    guard: 2,
};
/// Sums of squares have wider tails than chi-squared.
const WIDER: f64 = 1.3;
/// Steps of the samples within which two jumps are one.
const NEAR_STEPS: f64 = 2.5;
/// Share of the stars' slow noise that may be left beside a step.
const LEFT_SLOW: f64 = 0.5;
/// Of the span, times on which noise is slow.
const SLOW_SHARE: f64 = 0.2;

/// What was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct OwnSeries {
    pub(crate) line_hz: Option<f64>,
    pub(crate) jump_s: Option<f64>,
    /// What is smooth takes more of the stars than that jump.
    drifts: bool,
    /// Lines nearer to each other are one, and so are jumps.
    bin_hz: f64,
    apart_s: f64,
    p_value: f64,
    explained: f64,
    /// The coordinates that it goes with, and their shares of it.
    places: Vec<(&'static str, f64)>,
}

impl OwnSeries {
    /// Writes it where it is reported; the stars' own time is what is left unless it is known what
    /// they follow. `left` is the share of the before variance that is left.
    pub(crate) fn tell(&self, unattributed: &mut Unattributed, left: f64) {
        // where the variables tell of a drift
        let told = unattributed.depends_on.iter().any(is_beyond_chance);
        let jump = self.jump_s.filter(|_| !(self.drifts && told));
        if self.line_hz.is_none() && jump.is_none() {
            return;
        }
        // what the stars do may be in the mean of them, too: the same line is listed once
        let lines = &mut unattributed.lines_hz;
        let new = |f: &f64| lines.iter().all(|g| (f - g).abs() > self.bin_hz);
        let line = self.line_hz.filter(new);
        lines.extend(line);
        lines.sort_by(f64::total_cmp);
        let jumps = &mut unattributed.jumps_s;
        let new = |t: &f64| jumps.iter().all(|s| (t - s).abs() > self.apart_s);
        let jump = jump.filter(new);
        jumps.extend(jump);
        jumps.sort_by(f64::total_cmp);
        if !unattributed.present {
            unattributed.depends_on.clear();
        }
        unattributed.present = true;
        let share = unattributed.variance_fraction.unwrap_or(0.0);
        unattributed.variance_fraction = Some(share.max(self.explained * left));
        let list = &mut unattributed.depends_on;
        let known = follows::largest(list);
        if self.explained < MOSTLY * known {
            return;
        }
        for (variable, share) in self.places.iter().rev() {
            stars_first(list, variable, share * self.explained, self.p_value);
        }
        if self.places.is_empty() {
            stars_first(list, IN_TIME, self.explained, self.p_value);
        }
    }
}

/// Searches what every star has of its `own`: residuals (arcsec, per axis over all rows) less what
/// its frames are known to have turned by; `alone` forms them less all that the stars of a frame share. `drift` says
/// whether what is smooth takes more squares (in units of the noise) of the stars than so many.
pub(crate) fn search(
    data: &StarData,
    own: &[Vec<f64>],
    alone: impl FnOnce() -> [Vec<f64>; 2],
    weight: &[f64],
    drift: impl Fn(f64) -> bool,
) -> OwnSeries {
    if data.frames_are_unrelated() || data.stars.len() > MOST_STARS {
        return OwnSeries::default();
    }
    let by_itself = LazyCell::new(|| series(data, &alone(), weight));
    let beside_rotation = LazyCell::new(|| Freedom::beside_rotation(data, weight));
    let freedom = if data.free_attitude {
        *beside_rotation
    } else {
        Freedom::WHOLE
    };
    let series = series(data, own, weight);
    // neighbours tell the noise, and slow noise is more than that: a share is of all that the rows have
    let all: f64 = series.iter().map(|s| s.rows_squares).sum();
    let mut out = OwnSeries {
        p_value: 1.0,
        ..OwnSeries::default()
    };
    let span_s = coherent_s(&data.frames.t_s);
    if span_s <= 0.0 {
        return out;
    }
    out.bin_hz = 1.0 / span_s;
    out.apart_s = NEAR_STEPS * median_step(&data.frames.t_s).unwrap_or(0.0);
    let apart = LazyCell::new(|| Lines::of(&by_itself, *beside_rotation, span_s));
    let line_in = |series: &[Own]| {
        let lines = Lines::of(series, freedom, span_s)?;
        let (k, found) = lines.best(series)?;
        let apart = apart.as_ref()?;
        let alone = (k < apart.grid.bins).then(|| apart.at(k))?;
        is_own(alone, &found).then_some(found)
    };
    let step_in = |series: &[Own]| {
        let found = step(series, freedom, &data.frames.t_s)?;
        let alone = step_at(&by_itself, *beside_rotation, found.at);
        (is_own(alone?, &found) && is_no_wander(data, own, found.at)).then_some(found)
    };
    let less = |basis: &(dyn Fn(f64) -> [f64; 2] + Sync)| -> Vec<Own> {
        series.iter().map(|s| s.beside(basis)).collect()
    };
    let (mut line, mut jump) = (line_in(&series), step_in(&series));
    if let (Some(both), Some(t)) = (&line, &jump) {
        if both.squares > t.squares {
            jump = step_in(&less(&swing(both.at)));
        } else {
            let side = |after: bool| f64::from(u8::from(after));
            line = line_in(&less(&|s| [side(s <= t.at), side(s > t.at)]));
        }
    }
    for found in [&line, &jump].into_iter().flatten() {
        out.p_value = out.p_value.min(found.p_value);
        out.explained = out.explained.max(found.squares / all);
    }
    out.places = match (&line, &jump) {
        (Some(line), jump) if jump.is_none_or(|t| t.squares <= line.squares) => {
            by_place(data, own, weight, swing(line.at))
        }
        (_, Some(t)) => by_place(data, own, weight, |s| [f64::from(u8::from(s > t.at))]),
        _ => Vec::new(),
    };
    out.drifts =
        jump.is_some_and(|jump| jump.squares <= bent_squares(&series) || drift(jump.squares));
    out.line_hz = line.map(|l| l.at);
    out.jump_s = jump.map(|j| j.at);
    out
}

/// A cosine and a sine of this frequency.
fn swing(f: f64) -> impl Fn(f64) -> [f64; 2] {
    let omega = std::f64::consts::TAU * f;
    move |t| [(omega * t).cos(), (omega * t).sin()]
}

/// Whether what was `found` is the stars', by the chance and the squares of the same `alone`, without what they share.
fn is_own((p_value, squares): (f64, f64), found: &Event) -> bool {
    p_value < ALPHA_ALONE && squares > OWN_SHARE * found.squares
}

/// A line or a step: its frequency or instant, its chance, and the squares that it takes.
#[derive(Clone, Copy, Debug)]
struct Event {
    at: f64,
    p_value: f64,
    squares: f64,
}

impl Event {
    /// The one of most certain; of chances too small to tell, the one that takes most.
    fn first(&self, other: &Self) -> std::cmp::Ordering {
        let chance = self.p_value.total_cmp(&other.p_value);
        chance.then(other.squares.total_cmp(&self.squares))
    }
}

fn series(data: &StarData, own: &[Vec<f64>], weight: &[f64]) -> Vec<Own> {
    let mut rows_of: Vec<Vec<usize>> = vec![Vec::new(); data.stars.len()];
    for r in 0..data.t_s.len() {
        if !data.outlier[r] && own.iter().all(|a| a[r].is_finite()) {
            rows_of[data.star[r]].push(r);
        }
    }
    let size = data.frames.frames().div_ceil(MOST_POINTS).max(1);
    let each = rows_of.into_par_iter().filter_map(|rows| {
        if rows.len() < MIN_POINTS * size {
            return None;
        }
        let n = rows.len() as f64;
        let value = [0, 1].map(|a| {
            let mean = rows.iter().map(|&r| own[a][r]).sum::<f64>() / n;
            let mut left: Vec<f64> = rows.iter().map(|&r| own[a][r] - mean).collect();
            let mut changes: Vec<f64> = left.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
            // the median of |x| is 0.6745 sigma, and neighbours differ by sqrt 2 of it
            let noise = spectra::robust::median(&mut changes).unwrap_or(0.0)
                / (0.6745 * std::f64::consts::SQRT_2);
            let noise = if noise > 0.0 {
                noise
            } else {
                1.0 / weight[rows[0]]
            };
            left.iter_mut().for_each(|v| *v /= noise);
            left
        });
        let rows_squares = value.iter().flatten().map(|v| v * v).sum();
        let (mut t_s, mut count) = (Vec::new(), Vec::new());
        let mut means = [Vec::new(), Vec::new()];
        for at in (0..rows.len()).step_by(size) {
            let part = at..(at + size).min(rows.len());
            let k = part.len() as f64;
            t_s.push(rows[part.clone()].iter().map(|&r| data.t_s[r]).sum::<f64>() / k);
            for (mean, value) in means.iter_mut().zip(&value) {
                mean.push(value[part.clone()].iter().sum::<f64>() / k);
            }
            count.push(k);
        }
        Some(Own::of(t_s, means, count, rows_squares))
    });
    each.collect()
}

/// Powers of every star at the frequencies that are looked at.
struct Lines {
    grid: Grid,
    power: Vec<Vec<f64>>,
    freedom: Freedom,
}

impl Lines {
    fn of(series: &[Own], freedom: Freedom, span: f64) -> Option<Self> {
        let median = |s: &Own| median_step(&s.t_s).unwrap_or(f64::INFINITY);
        let step = series.iter().map(median).fold(0.0, f64::max);
        let fewest = 4 * USUAL.finer * (USUAL.count + USUAL.guard);
        let grid = Grid::of(span, step, MIN_CYCLES, USUAL.finer, fewest)?;
        let powers = series.par_iter().map(|s| s.powers(&grid));
        let power = powers.collect();
        Some(Self {
            grid,
            power,
            freedom,
        })
    }

    /// Chance of what the stars have at grid point `k`, of one of them or of all, and the squares that it takes.
    fn at(&self, k: usize) -> (f64, f64) {
        // power over what is usual around, and how many it is the mean of
        let relative = |p: &Vec<f64>| -> (f64, f64) {
            let (sum, count) = USUAL.sum(p, k);
            let ratio = p[k] * count / sum;
            // a star of one value has no power around, and says nothing
            if sum > 0.0 && ratio.is_finite() {
                (ratio, count)
            } else {
                (1.0, 0.0)
            }
        };
        let chance = |mean: f64, of: f64, around: f64, share: f64| -> f64 {
            FisherSnedecor::new(4.0 * share * of, 4.0 * share * around)
                .map_or(1.0, |law| beyond(&law, mean))
        };
        let stars = self.power.len() as f64;
        let each: Vec<(f64, f64)> = self.power.iter().map(relative).collect();
        let sum: f64 = each.iter().map(|e| e.0).sum();
        let around: f64 = each.iter().map(|e| e.1).sum();
        let one = each
            .iter()
            .map(|e| stars * chance(e.0, 1.0, e.1, self.freedom.one))
            .fold(1.0, f64::min);
        let all = chance(sum / stars, stars, around, self.freedom.all);
        let excess = self.power.iter().zip(&each).map(|(p, e)| p[k] - p[k] / e.0);
        let squares = if one < all {
            excess.fold(0.0, f64::max)
        } else {
            excess.sum()
        };
        // both are tried
        (2.0 * one.min(all), squares)
    }

    /// The line of `series` that is most certain, and its grid point.
    fn best(&self, series: &[Own]) -> Option<(usize, Event)> {
        let tried = (0..self.grid.bins).into_par_iter().map(|k| {
            let (p, squares) = self.at(k);
            let line = Event {
                at: self.grid.at(k),
                // the top between grid points
                p_value: 2.0 * self.grid.bins as f64 * p,
                squares: squares.max(0.0),
            };
            (k, line)
        });
        let (k, line) = tried
            .min_by(|a, b| a.1.first(&b.1))
            .filter(|best| best.1.p_value < ALPHA)?;
        let power = |f: f64| -> f64 { series.iter().map(|s| s.power_at(f)).sum() };
        let at = top(line.at, self.grid.step_hz, power);
        Some((k, Event { at, ..line }))
    }
}

/// The step that is most certain.
fn step(series: &[Own], freedom: Freedom, t_s: &[f64]) -> Option<Event> {
    let stride = t_s.len().div_ceil(MOST_POINTS).max(1);
    let instants: Vec<f64> = t_s
        .windows(2)
        .step_by(stride)
        .map(|w| 0.5 * (w[0] + w[1]))
        .collect();
    let tried = instants.par_iter().filter_map(|&at| {
        let (p, squares) = step_at(series, freedom, at)?;
        Some(Event {
            at,
            p_value: p * instants.len() as f64,
            squares,
        })
    });
    tried
        .min_by(|a, b| a.first(b))
        .filter(|best| best.p_value < ALPHA)
}

/// A step of every star at `t`: its chance there, and the squares that it takes.
fn step_at(series: &[Own], freedom: Freedom, t: f64) -> Option<(f64, f64)> {
    let (mut square, mut numbers) = (0.0, 0.0);
    for one in series.iter().filter_map(|s| s.step_square(t)) {
        square += one;
        numbers += 2.0;
    }
    let law = ChiSquared::new(numbers * freedom.all).ok()?;
    Some((law.sf(square * freedom.all / WIDER), square - numbers))
}

/// Squares that a parabola in time takes of the stars, less those of its numbers: at least 3/4 of a ramp's are a step's,
/// too, and no more than 4/5 of a step's a parabola's.
fn bent_squares(series: &[Own]) -> f64 {
    series.iter().map(|s| s.parabola_square() - 4.0).sum()
}

/// Whether the stars are less slow beside a step of each at `t`.
fn is_no_wander(data: &StarData, own: &[Vec<f64>], t: f64) -> bool {
    let mut beside = own.to_vec();
    for axis in &mut beside {
        let mut mean = vec![[(0.0, 0.0); 2]; data.stars.len()];
        let side = |r: usize| usize::from(data.t_s[r] > t);
        let counts = |r: usize, v: f64| !data.outlier[r] && v.is_finite();
        for (r, v) in axis.iter().enumerate().filter(|(r, v)| counts(*r, **v)) {
            let sum = &mut mean[data.star[r]][side(r)];
            *sum = (sum.0 + v, sum.1 + 1.0);
        }
        for (r, v) in axis.iter_mut().enumerate() {
            let (sum, n) = mean[data.star[r]][side(r)];
            *v -= sum / f64::max(n, 1.0);
        }
    }
    let span = data.frames.t_s.last().unwrap_or(&0.0) - data.frames.t_s.first().unwrap_or(&0.0);
    let slow = |residual: &[Vec<f64>]| {
        commonness::slow(data, residual, [true; 3], SLOW_SHARE * span).map_or(0.0, |s| s.stars)
    };
    slow(&beside) < LEFT_SLOW * slow(own)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::star::harness::at_rest;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use telemetry::report::Dependence;

    /// What is found of six stars for 750 s that do this by themselves, of time and star, in units of their noise;
    /// `alike`: all the same, so that they turn the frame.
    fn found(alike: bool, does: impl Fn(f64, f64) -> f64) -> OwnSeries {
        let data = at_rest((0..1500).map(|k| 0.5 * f64::from(k)).collect());
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(8);
        let rows = data.t_s.len();
        let noise = [(); 2]
            .map(|()| -> Vec<f64> { (0..rows).map(|_| StandardNormal.sample(&mut rng)).collect() });
        let own = noise.each_ref().map(|axis| -> Vec<f64> {
            let each = axis.iter().enumerate();
            each.map(|(r, v)| v + does(data.t_s[r], data.star[r] as f64))
                .collect()
        });
        let alone = if alike { noise } else { own.clone() };
        search(&data, &own, || alone, &vec![1.0; rows], |_| false)
    }

    /// Beyond chance without what the stars share, and of a third of the size at least.
    #[test]
    fn what_the_frames_turned_by_is_not_the_stars() {
        let found = Event {
            at: 0.005,
            p_value: 1e-20,
            squares: 100.0,
        };
        for (alone, own) in [
            ((0.005, 60.0), true),
            ((0.005, 20.0), false),
            ((0.05, 60.0), false),
        ] {
            assert_eq!(is_own(alone, &found), own, "{alone:?}");
        }
    }

    /// A line of half the noise is 1500/16 nats an axis and star, beyond doubt; of thirty times the noise no chance is
    /// left in which the frequencies differ. It is the stars' own only where they differ, and no step.
    #[test]
    fn a_line_is_told_at_its_frequency_and_is_no_step() {
        let swing = |size: f64, apart: f64| {
            found(apart == 0.0, |t, star| {
                size * (std::f64::consts::TAU * 0.0507 * t + apart * star).sin()
            })
        };
        for size in [0.5, 30.0] {
            let found = swing(size, 1.0);
            // the bound is sqrt(6) / (pi T) times the noise over the amplitudes and the root of half the numbers
            let sigma = 6.0_f64.sqrt() / (std::f64::consts::PI * 750.0 * size * 9000.0_f64.sqrt());
            let off = found.line_hz.unwrap() - 0.0507;
            assert!(
                off.abs() < 5.0 * sigma + 0.001 * found.bin_hz,
                "{size}: {off}"
            );
            assert_eq!(found.jump_s, None, "{size}");
            // of a variance of a half of the size's square, beside that of the noise; a line takes a little noise too
            let share = 0.5 * size * size / (1.0 + 0.5 * size * size);
            assert!((found.explained - share).abs() < 0.01, "{size}: {found:?}");
        }
        assert_eq!(swing(0.5, 0.0).line_hz, None);
    }

    /// A step of thirty times the noise has no chance at hundreds of instants, and is no line.
    #[test]
    fn a_step_is_told_at_its_instant_and_is_no_line() {
        for size in [0.5, 30.0] {
            let step =
                |t: f64, star: f64| size * (star - 2.5).signum() * f64::from(u8::from(t > 290.0));
            let found = found(false, step);
            assert!((found.jump_s.unwrap() - 290.25).abs() < 5.0, "{size}");
            assert!(size < 1.0 || found.jump_s == Some(290.25));
            assert_eq!(found.line_hz, None, "{size}");
        }
    }

    /// Stars that drift, each its own way, straight or bent, have no jump beside the variable that tells of it, however
    /// strong that is: a parabola takes all of it, a step three quarters.
    #[test]
    fn a_drift_is_no_jump() {
        for size in [0.3, 30.0] {
            for bent in [false, true] {
                let drift = |t: f64, star: f64| {
                    let z = t / 750.0;
                    size * (star - 2.5) * if bent { z * z } else { z }
                };
                let found = found(false, drift);
                let told = |depends_on: &[Dependence]| {
                    let mut left = Unattributed {
                        depends_on: depends_on.to_vec(),
                        ..Unattributed::default()
                    };
                    found.tell(&mut left, 1.0);
                    left.jumps_s.len()
                };
                let time = Dependence {
                    variable: "time".to_owned(),
                    variance_explained: 0.1,
                    p_value: 1e-9,
                };
                assert_eq!(told(&[time]), 0, "{size}, {bent}");
                // a faint one is told as it looks where nothing else tells of it; a strong one is as slow beside a step
                let faint = usize::from(size < 1.0);
                assert_eq!(told(&[]), faint, "{size}, {bent}");
            }
        }
    }

    /// Stars that have no noise have no line, and nothing to hold one against.
    #[test]
    fn stars_of_one_value_have_no_line() {
        let data = at_rest((0..1500).map(|k| 0.5 * f64::from(k)).collect());
        let still = [(); 2].map(|()| vec![0.0; data.t_s.len()]);
        let weight = vec![1.0; data.t_s.len()];
        let found = search(&data, &still, || still.clone(), &weight, |_| false);
        assert_eq!((found.line_hz, found.jump_s), (None, None));
    }

    /// A jump that all stars share and each by itself is one.
    #[test]
    fn a_jump_that_is_known_is_listed_once() {
        let own = OwnSeries {
            jump_s: Some(290.25),
            apart_s: 1.25,
            explained: 0.3,
            ..OwnSeries::default()
        };
        let mut left = Unattributed {
            jumps_s: vec![289.75],
            ..Unattributed::default()
        };
        own.tell(&mut left, 1.0);
        assert_eq!(left.jumps_s, [289.75]);
    }

    /// A line that is listed already is not listed again; that it is the stars' is told all the same.
    #[test]
    fn a_line_that_is_known_is_listed_once() {
        let own = OwnSeries {
            line_hz: Some(0.6235),
            bin_hz: 0.002,
            explained: 0.3,
            ..OwnSeries::default()
        };
        let told = |known: f64| {
            let mut left = Unattributed {
                lines_hz: vec![known],
                ..Unattributed::default()
            };
            own.tell(&mut left, 1.0);
            left
        };
        assert_eq!(told(0.623).lines_hz, [0.623]);
        assert_eq!(told(0.63).lines_hz, [0.6235, 0.63]);
        for known in [0.623, 0.63] {
            assert_eq!(told(known).depends_on[0].variable, "time*star");
        }
    }
}
