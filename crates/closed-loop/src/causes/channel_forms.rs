//! A channel by another form than its polynomials: from a threshold on, by what it was before, or with another channel.
//!
//! A clamp that opens at a temperature moves nothing below it, walls that lag behind one another bend by its slope in time,
//! and what has play follows late. No polynomial has any of these. Of what the frames share, residuals r about each axis
//! and in scale, that form is looked for which takes most together with a straight line z in the channel,
//!
//! ```text
//! max(v - v_0, 0);   dv/dt, v(t - d), play of a width;   z z' of two channels
//! u = sum w f r      N = sum w f^2      sum of u^2 / N most      f less what 1 and z take of it
//! ```
//!
//! with `v_0` at every eighth of the frames, and has a term if it takes more than each of the channel's own polynomials,
//! alone or beside that line, where it is of one.
//!
//! Source: least squares; Krasnosel'skii & Pokrovskii 1989 (play, an operator of hysteresis).

use focal_plane::Series;
use spectra::robust::median_step;

use crate::search::empirical::{Empirical, Scale, Variable, about_mean, legendre, range};
use crate::star::data::StarData;
use crate::unexplained::leftover::Track;

/// Thresholds of a channel part the frames into so many.
const PARTS: usize = 8;
/// A slope is taken over this many steps of the channel, or this part of its time, whichever is longer.
const STEPS: f64 = 4.0;
const PART_OF_TIME: f64 = 0.01;
/// Play, parts of a channel's range, and delays, parts of its time.
const PLAYS: [f64; 3] = [0.125, 0.25, 0.5];
const DELAYS: [f64; 4] = [0.016, 0.031, 0.063, 0.125];
/// Rotations and the scale.
const TRACKS: usize = 4;
/// Squares in units of the variance below which none is worth a term.
const LEAST: f64 = 16.0;

/// What is looked for, and what it takes.
type Sought = (f64, Empirical);

/// A term of each kind of form that takes most of what is left, by the `tracks` of its stars; channels are those of
/// `terms`.
pub(super) fn channel_forms(
    data: &StarData,
    tracks: &[Track],
    terms: &[Empirical],
) -> Vec<Empirical> {
    let channels = terms.iter().filter_map(Empirical::channel);
    let channels: Vec<Channel<'_>> = channels.map(|c| Channel::of(data, c)).collect();
    if channels.is_empty() {
        return Vec::new();
    }
    let tracks: Vec<Shared<'_>> = tracks.iter().take(TRACKS).map(Shared::of).collect();
    // beside these lines
    let power = |lines: &[&Channel<'_>], values: &[f64]| -> f64 {
        let lines: Vec<&[f64]> = lines.iter().map(|c| c.scaled.as_slice()).collect();
        tracks.iter().map(|track| track.power(&lines, values)).sum()
    };
    let mut thresholds = Vec::new();
    let mut memories = Vec::new();
    for channel in channels.iter().filter(|c| c.is_bent) {
        let line = power(&[], &channel.scaled);
        let most = |lines: &[&Channel<'_>], least: f64| {
            let bends = channel.bends().map(|bend| power(lines, &bend));
            bends.fold(least.max(LEAST), f64::max)
        };
        // alone, and beside the line
        let own = [most(&[], line), most(&[channel], 0.0)];
        let form = |form: Series| {
            let values = form.at_all(&data.frames.t_s);
            let [alone, beside] = [power(&[], &values), power(&[channel], &values)];
            let takes_more = alone > own[0] || beside > own[1];
            let term = takes_more.then(|| channel.by_form(data, form)).flatten();
            Some((line + beside, term?))
        };
        let each = eighths(&channel.values).into_iter();
        thresholds.extend(
            each.filter_map(|from| beyond(channel.series, from))
                .map(form),
        );
        memories.extend(memory(channel.series).into_iter().map(form));
    }
    let mut products = Vec::new();
    for (k, a) in channels.iter().enumerate() {
        products.extend(channels[k + 1..].iter().map(|b| {
            let both = a.scaled.iter().zip(&b.scaled).map(|(a, b)| a * b);
            let power = power(&[a, b], &both.collect::<Vec<f64>>());
            (power > LEAST)
                .then(|| Some((power, a.times(b)?)))
                .flatten()
        }));
    }
    let best = [thresholds, memories, products]
        .into_iter()
        .filter_map(most);
    best.collect()
}

/// The one that takes most, which pays for all that there are.
fn most(forms: Vec<Option<Sought>>) -> Option<Empirical> {
    let tried = forms.len();
    let best = forms
        .into_iter()
        .flatten()
        .max_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, term)| term.looked_for_among(tried))
}

/// A channel, and its values frame by frame.
struct Channel<'a> {
    variable: &'a Variable,
    series: &'a Series,
    range: [f64; 2],
    /// Whether it has more than two values: these all polynomials tell alike.
    is_bent: bool,
    values: Vec<f64>,
    /// -1 to 1.
    scaled: Vec<f64>,
}

impl<'a> Channel<'a> {
    fn of(
        data: &StarData,
        (variable, series, range): (&'a Variable, &'a Series, [f64; 2]),
    ) -> Self {
        let values = series.at_all(&data.frames.t_s);
        let scale = Scale::new(range);
        Self {
            variable,
            series,
            range,
            is_bent: variable.is_bent(),
            scaled: values.iter().map(|v| scale.of(*v)).collect(),
            values,
        }
    }

    /// Its polynomials that are no straight line.
    fn bends(&self) -> impl Iterator<Item = Vec<f64>> + '_ {
        (1..3).map(|k| self.scaled.iter().map(|z| legendre(*z)[k]).collect())
    }

    fn by_form(&self, data: &StarData, form: Series) -> Option<Empirical> {
        let range = about_mean(form.at_all(&data.t_s).into_iter());
        let variable = self.variable.with_series(form);
        Some(Empirical::new(variable, range, true)?.straight())
    }

    fn times(&self, other: &Self) -> Option<Empirical> {
        let by = (other.variable.clone(), other.range);
        Empirical::pair(self.variable.clone(), self.range, by.0, by.1)
    }
}

/// The values below which 1, 2, .. 7 eighths of these are.
fn eighths(values: &[f64]) -> Vec<f64> {
    let mut known: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    known.sort_by(f64::total_cmp);
    let at = |k: usize| known.get(k * known.len() / PARTS).copied();
    (1..PARTS).filter_map(at).collect()
}

/// By how much a channel is beyond a threshold.
fn beyond(series: &Series, from: f64) -> Option<Series> {
    let value = series.value().iter().map(|v| (v - from).max(0.0));
    Series::new(series.t_s().to_vec(), value.collect()).ok()
}

/// What it was before: its slope, itself later, and what follows it with play.
fn memory(series: &Series) -> Vec<Series> {
    let (t_s, value) = (series.t_s(), series.value());
    let [low, high] = range(value.iter().copied());
    let [from, to] = range(t_s.iter().copied());
    let plays = PLAYS.map(|width| with_play(series, width * (high - low)));
    let late = DELAYS.map(|part| {
        let was = |t: &f64| {
            series
                .at((t - part * (to - from)).max(from))
                .unwrap_or(f64::NAN)
        };
        Series::new(t_s.to_vec(), t_s.iter().map(was).collect()).ok()
    });
    let all = [slope(series)].into_iter().chain(plays).chain(late);
    all.flatten().collect()
}

/// What follows a channel with play of this width: it stays where it is until the channel is half of it away.
fn with_play(series: &Series, width: f64) -> Option<Series> {
    let half = 0.5 * width;
    let mut at = *series.value().first()?;
    let follow = series.value().iter().map(|v| {
        at = at.clamp(v - half, v + half);
        at
    });
    let value = follow.collect();
    Series::new(series.t_s().to_vec(), value).ok()
}

/// How fast it changes, 1/s: between the values a while before and after, or those at its ends.
fn slope(series: &Series) -> Option<Series> {
    let t_s = series.t_s();
    let (from, to) = (*t_s.first()?, *t_s.last()?);
    let half = 0.5 * (STEPS * median_step(t_s)?).max(PART_OF_TIME * (to - from));
    let value = t_s.iter().map(|t| {
        let around = [(t - half).max(from), (t + half).min(to)];
        let [before, after] = around.map(|t| series.at(t));
        match (before, after) {
            (Some(before), Some(after)) => (after - before) / (around[1] - around[0]),
            _ => f64::NAN,
        }
    });
    Series::new(t_s.to_vec(), value.collect()).ok()
}

/// What all stars of a frame share of one kind.
struct Shared<'a> {
    track: &'a Track,
    variance: f64,
}

impl<'a> Shared<'a> {
    fn of(track: &'a Track) -> Self {
        let frames = track.weight.iter().filter(|w| **w > 0.0).count();
        let mut own = Self {
            track,
            variance: 1.0,
        };
        let mut value = track.value.clone();
        own.less(&mut value, None);
        own.variance = own.product(&value, &value) / frames.max(1) as f64;
        own
    }

    fn product(&self, a: &[f64], b: &[f64]) -> f64 {
        let each = self.track.weight.iter().zip(a).zip(b);
        each.map(|((w, a), b)| if *w > 0.0 { w * a * b } else { 0.0 })
            .sum()
    }

    /// Takes off `values` what is in proportion to `line`, or constant.
    fn less(&self, values: &mut [f64], line: Option<&[f64]>) {
        let ones = line.is_none().then(|| vec![1.0; values.len()]);
        let line = line.or(ones.as_deref()).unwrap_or_default();
        let share = self.product(values, line) / self.product(line, line);
        if share.is_finite() {
            values
                .iter_mut()
                .zip(line)
                .for_each(|(v, l)| *v -= share * l);
        }
    }

    /// The squares that `values` take of it beside a constant and `lines`, in units of its variance.
    fn power(&self, lines: &[&[f64]], values: &[f64]) -> f64 {
        let mut beside: Vec<Vec<f64>> = Vec::new();
        let mut own = |values: &[f64]| {
            let known = values.iter().map(|v| if v.is_finite() { *v } else { 0.0 });
            let mut own: Vec<f64> = known.collect();
            self.less(&mut own, None);
            beside
                .iter()
                .for_each(|line| self.less(&mut own, Some(line)));
            beside.push(own);
        };
        lines.iter().for_each(|line| own(line));
        own(values);
        let Some(f) = beside.pop() else { return 0.0 };
        let whole = self.product(values, values);
        let information = self.product(&f, &f);
        // less is rounding
        if information <= 1e-9 * whole {
            return 0.0;
        }
        let power = self.product(&f, &self.track.value).powi(2) / information / self.variance;
        if power.is_finite() { power } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A channel that rises by 2 a second for five seconds and falls back: its slope is that, and what is beyond 6 is 4 at
    /// the top.
    #[test]
    fn forms_of_a_channel() {
        let value = |k: i32| f64::from(2 * (5 - (k - 5).abs()));
        let t_s = (0..11).map(f64::from).collect();
        let series = Series::new(t_s, (0..11).map(value).collect()).unwrap();
        let slope = slope(&series).unwrap();
        // over two seconds on both sides
        let is = |series: &Series, at: usize, value: f64| {
            let off = (series.value()[at] - value).abs();
            assert!(off < 1e-12, "{at}: {:?}", series.value());
        };
        for (at, value) in [(0, 2.0), (2, 2.0), (5, 0.0), (8, -2.0)] {
            is(&slope, at, value);
        }
        let beyond = beyond(&series, 6.0).unwrap();
        for (at, value) in [(2, 0.0), (4, 2.0), (5, 4.0)] {
            is(&beyond, at, value);
        }
        assert_eq!(eighths(series.value()).len(), 7);
        // two behind, at the top for two seconds
        let late = with_play(&series, 4.0).unwrap();
        for (at, value) in [(0, 0.0), (3, 4.0), (5, 8.0), (7, 8.0), (9, 4.0)] {
            is(&late, at, value);
        }
    }

    /// Weights count: a slope of 3 beside any constant, of which the half that weighs nothing says otherwise.
    #[test]
    fn what_a_form_takes() {
        let value: Vec<f64> = (0..20)
            .map(|k| {
                if k % 2 == 0 {
                    7.0 + 3.0 * f64::from(k)
                } else {
                    -100.0
                }
            })
            .collect();
        let track = Track {
            t_s: (0..20).map(f64::from).collect(),
            weight: (0..20).map(|k| f64::from(1 - k % 2)).collect(),
            value,
            changes: None,
            turns: true,
        };
        let shared = Shared::of(&track);
        let form: Vec<f64> = (0..20).map(|k| 5.0 + f64::from(k)).collect();
        // all of it: ten frames of their variance
        assert!((shared.power(&[], &form) - 10.0).abs() < 1e-9);
        assert!(shared.power(&[], &[2.0; 20]) < 1e-9);
        assert!(shared.power(&[&form], &form) < 1e-9);
    }
}
