//! Lines in series of one number a frame, and the one that several series share.
//!
//! ```text
//! z(f) = power of the best sinusoid at f / mean power around f,    P = (1 + z/n)^-n
//! P3(f) = chance that the product of as many P is as small         Fisher: -2 sum ln P ~ chi2_2k
//! ```
//!
//! n independent frequencies around f are what the mean is of: noise whose density is smooth
//! there passes P < alpha that rarely, whatever its colour. A line of the attitude acts on all
//! axes, so that a product shows it where no axis does by itself: of X and Y, or of all three.
//!
//! Source: Scargle 1982 (periodogram), the F law of a ratio of two mean powers; Fisher 1932 (the
//! product of chances).

use std::sync::Arc;

use coloured_noise::Coloured;
use effects::{Candidate, Scene};
use rayon::prelude::*;
use spectra::robust::median_step;
use spectra::{LombScargle, LombScargleSettings};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::parabola::bottom;
use crate::unexplained::around::Around;
use crate::unexplained::grid::{Grid, coherent_s, top};

use super::{MOST, Series, Track};

/// What a line's power is held against.
const USUAL: Around = Around {
    finer: 4,
    count: 15,
    guard: 2,
};
/// The same for the line that all axes share, which is judged by a search with it: noise around it of three times as many
/// frequencies is better known, and a line of 17 nats is told from it at 15 and not at 13.
const WIDE: Around = Around {
    finer: 4,
    count: 45,
    guard: 2,
};
/// Slow noise that is likelier than white noise by no more nats may be made by the line itself.
const SLIGHT: f64 = 10.0;
/// Fewer cycles in the span are no line but a trend.
const MIN_CYCLES: f64 = 3.0;
/// Grids whose points lie nearer than this share of their step are the same.
const ALIKE: f64 = 0.1;

/// Frequencies by the span and the sampling of `track`; `None` where the span is too short for any.
fn grid_of(track: &Track) -> Option<Grid> {
    let step_s = median_step(&track.t_s)?;
    let fewest = 4 * USUAL.finer * USUAL.count;
    Grid::of(
        coherent_s(&track.t_s),
        step_s,
        MIN_CYCLES,
        USUAL.finer,
        fewest,
    )
}

impl Grid {
    fn plan(&self, t_s: &[f64]) -> Option<LombScargle> {
        let settings = LombScargleSettings {
            first_hz: self.first_hz,
            step_hz: self.step_hz,
            bins: self.bins,
            floating_mean: true,
            fs_hz: 1.0,
        };
        LombScargle::new(t_s, settings).ok()
    }

    fn is_like(&self, other: &Self) -> bool {
        let last = self.bins.min(other.bins) - 1;
        let apart = |k| (self.at(k) - other.at(k)).abs();
        apart(0).max(apart(last)) < ALIKE * self.step_hz
    }
}

/// A series without its colour, and the chance of the power at every frequency.
#[derive(Clone, Debug)]
pub(crate) struct Spectrum {
    grid: Grid,
    plan: Arc<LombScargle>,
    noise: Coloured,
    white: Vec<f64>,
    /// Its power.
    power: Vec<f64>,
    /// Logarithms.
    chance: Vec<f64>,
}

impl Spectrum {
    fn of(track: &Track, grid: Grid, plan: Arc<LombScargle>) -> Option<Self> {
        let noise = track.noise();
        let white = track.whitened(&noise, &track.value);
        let power = plan.process(&white).ok()?.psd;
        let chance = (0..grid.bins).map(|k| chance(USUAL, &power, k).1).collect();
        Some(Self {
            grid,
            plan,
            noise,
            white,
            power,
            chance,
        })
    }

    /// Logarithms of the chances held against more around each, where that is on both sides; where the slow noise of this
    /// `track` is [`SLIGHT`], without any.
    fn wide(&self, track: &Track) -> Option<Vec<f64>> {
        let noise = self.noise;
        let without = Coloured {
            slow: 0.0,
            white: noise.white.hypot(noise.slow),
            ..noise
        };
        let slight = noise.slow > 0.0 && track.loglik(&noise) - track.loglik(&without) < SLIGHT;
        let bare = slight.then(|| self.plan.process(&track.whitened(&without, &track.value)));
        let bare = bare.transpose().ok()?;
        let power = bare.as_ref().map_or(&self.power, |bare| &bare.psd);
        let wide = |k: usize| match chance(WIDE, power, k) {
            (n, chance) if n >= 2.0 * WIDE.count as f64 => chance,
            _ => chance(USUAL, power, k).1,
        };
        Some((0..self.grid.bins).map(wide).collect())
    }

    /// The frequency of the most certain line, if it is beyond doubt.
    fn strongest(&self, alpha: f64, track: &Track) -> Option<f64> {
        let (best, chance) = least(&self.chance)?;
        let certain = chance + (self.grid.bins as f64).ln() < alpha.ln();
        certain.then(|| track.top(&self.white, self.grid.at(best), self.grid.step_hz))
    }
}

/// Of how many frequencies around point `k` the mean is, and the logarithm of the chance of that point's `power`.
fn chance(around: Around, power: &[f64], k: usize) -> (f64, f64) {
    let (sum, n) = around.sum(power, k);
    (n, -n * (power[k] / sum).ln_1p())
}

/// The least of some numbers, and where it is.
fn least(values: &[f64]) -> Option<(usize, f64)> {
    let all = values.iter().copied().enumerate();
    all.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The spectrum of each series; `None` where the span is too short for any line.
pub(super) fn spectra(tracks: &[&Track]) -> Vec<Option<Spectrum>> {
    // most series have the same times, and one plan serves them
    let first = |k: usize| tracks[..k].iter().position(|t| t.t_s == tracks[k].t_s);
    let plans: Vec<Option<(Grid, Arc<LombScargle>)>> = (0..tracks.len())
        .into_par_iter()
        .map(|k| {
            first(k).is_none().then(|| {
                let grid = grid_of(tracks[k])?;
                Some((grid, Arc::new(grid.plan(&tracks[k].t_s)?)))
            })?
        })
        .collect();
    (0..tracks.len())
        .into_par_iter()
        .map(|k| {
            let (grid, plan) = plans[first(k).unwrap_or(k)].clone()?;
            Spectrum::of(tracks[k], grid, plan)
        })
        .collect()
}

/// A line about all axes at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SharedLine {
    pub(crate) frequency_hz: f64,
    /// Frequencies that were looked at.
    pub(crate) tried: usize,
}

impl SharedLine {
    /// The effect that makes it.
    pub(crate) fn candidate(self, scene: &Scene<'_>) -> Arc<dyn Candidate> {
        effects::line_at(self.frequency_hz, scene.surroundings.span_s, self.tried).into()
    }
}

impl Series {
    /// The line that the tracker most likely turns with, if one as likely is there by chance in fewer than this share
    /// of runs.
    pub(crate) fn shared_line(&self, by_chance: f64) -> Option<SharedLine> {
        let turns: Vec<(&Track, &Spectrum)> = self
            .each
            .iter()
            .filter(|one| one.means.turns)
            .filter_map(|one| Some((one.fine(), one.spectrum.as_ref()?)))
            .collect();
        let grid = turns.first()?.1.grid;
        let turns: Vec<_> = turns
            .into_iter()
            .filter(|(_, s)| s.grid.is_like(&grid))
            .collect();
        let bins = turns.iter().map(|(_, s)| s.grid.bins).min()?;
        let wide = turns.iter().map(|(track, s)| s.wide(track));
        let wide: Vec<Vec<f64>> = wide.collect::<Option<_>>()?;
        // across the boresight, and about it as well
        let (chance, best) = (wide.len().min(2)..=wide.len())
            .filter_map(|axes| {
                let sum_at = |k: usize| wide[..axes].iter().map(|chance| chance[k]).sum();
                let sums: Vec<f64> = (0..bins).map(sum_at).collect();
                let (best, sum) = least(&sums)?;
                let law = ChiSquared::new(2.0 * axes as f64).ok()?;
                let beside = |k: usize| sums.get(k..k + 3)?.try_into().ok();
                let between = best.checked_sub(1).and_then(beside).map_or(0.0, bottom);
                Some((law.sf(-2.0 * sum), best as f64 + between))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        let likely = 2.0 * chance * (bins as f64) < by_chance;
        likely.then_some(SharedLine {
            frequency_hz: grid.first_hz + best * grid.step_hz,
            tried: bins,
        })
    }
}

impl Track {
    /// Frequencies of lines that the declared model does not make; all are taken out of the series,
    /// whose `spectrum` this is. With the noise that the series has then, if it is still the same.
    pub(super) fn lines(&mut self, alpha: f64, spectrum: Spectrum) -> (Vec<f64>, Option<Coloured>) {
        let mut found: Vec<f64> = Vec::new();
        let whole = self.clone();
        let (grid, plan) = (spectrum.grid, Arc::clone(&spectrum.plan));
        let mut now = spectrum;
        while found.len() < MOST {
            let Some(f) = now.strongest(alpha, self) else {
                break;
            };
            found.push(f);
            let left = whole.take_out(&now.noise, &whole.sinusoids(&found));
            let next = left.and_then(|(_, left)| {
                let spectrum = Spectrum::of(&left, grid, Arc::clone(&plan))?;
                Some((left, spectrum))
            });
            let Some((left, spectrum)) = next else {
                found.pop();
                break;
            };
            (*self, now) = (left, spectrum);
        }
        let noise = now.noise;
        // white noise takes a mean out that is out already
        let known = (found.is_empty() && noise.slow <= 0.0).then_some(noise);
        // once more each, without what the others left in it
        for k in 0..found.len() {
            let others: Vec<f64> = (0..found.len())
                .filter(|&j| j != k)
                .map(|j| found[j])
                .collect();
            if let Some((_, left)) = whole.take_out(&noise, &whole.sinusoids(&others)) {
                let white = left.whitened(&noise, &left.value);
                found[k] = left.top(&white, found[k], grid.step_hz);
            }
        }
        if let Some((size, left)) = whole.take_out(&noise, &whole.sinusoids(&found)) {
            *self = left;
            let each = found.into_iter().enumerate();
            found = each
                .filter(|(k, f)| {
                    self.is_beyond_declared(*f, [size[1 + 2 * k], size[2 + 2 * k]], &noise)
                })
                .map(|(_, f)| f)
                .collect();
        }
        (found, known)
    }

    /// Whether a line with these amplitudes of cosine and sine is more than the declared model makes.
    fn is_beyond_declared(
        &self,
        frequency_hz: f64,
        [cos, sin]: [f64; 2],
        noise: &Coloured,
    ) -> bool {
        let rows_s = self.weight.iter().sum::<f64>() / self.span();
        let changes = self.changes.as_ref();
        changes
            .is_none_or(|(c, axis)| c.is_line(frequency_hz, *axis, cos.hypot(sin), noise, rows_s))
    }

    fn sinusoids(&self, frequencies: &[f64]) -> Vec<Vec<f64>> {
        let mut columns = vec![vec![1.0; self.t_s.len()]];
        for f in frequencies {
            let phase = |t: &f64| std::f64::consts::TAU * f * (t - self.t_s[0]);
            columns.push(self.t_s.iter().map(|t| phase(t).cos()).collect());
            columns.push(self.t_s.iter().map(|t| phase(t).sin()).collect());
        }
        columns
    }

    /// The top of the power near `f`, to a thousandth of a grid point.
    fn top(&self, white: &[f64], f: f64, step: f64) -> f64 {
        let power = |f: f64| {
            let one = Grid {
                first_hz: f,
                step_hz: 1.0,
                bins: 1,
            };
            one.plan(&self.t_s)
                .and_then(|plan| plan.process(white).ok())
                .map_or(0.0, |psd| psd.psd[0])
        };
        top(f, step, power)
    }
}
