//! What is left beside the effects that were chosen, described.
//!
//! One pass over the stars holds the chosen effects, what each would be if it changed
//! with something ([`crate::causes::changing_effect`]), and every term of one variable or of two
//! ([`crate::search::empirical`]). Whether an effect stands in for another cause, whether it is
//! the same everywhere, and what the leftover follows are then algebra.
//!
//! Not physics: which columns stand beside which.

use block_regression::Folds;
use effects::{AttitudeRows, Candidate, Coefficient, Effect, EffectError, StarRows, Surroundings};
use focal_plane::{AttitudeSeries, Camera, PointsMut, VectorsMut};
use spectra::robust::median_step;
use std::sync::{Arc, OnceLock};

use crate::causes::by_channel::by_channel;
use crate::causes::changing_effect::{Changing, Inner, Way};
use crate::causes::places::places;
use crate::error::CloseError;
use crate::figures::{self, Followed};
use crate::gaps::longest_step;
use crate::search::empirical::{Empirical, Variable, about_mean, flux_of, range};
use crate::search::group::Group;
use crate::search::selection::{FAMILY_ALPHA, Judgement, columns_of, costs, each};
use crate::search::{Fitted, Found, borrowed, fit, fit_beside};
use crate::situation::Situation;
use crate::situation::channels_of_interest;
use crate::star::columns::star_columns_of;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use crate::unexplained::leftover::jumps::{self, SharedJump};
use nalgebra::Vector3;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use telemetry::report::{Dependence, Unattributed};

/// Stars beyond which none has a term of its own.
pub(crate) const MOST_STARS: usize = 64;
/// Stars beyond which an effect is not tried with a size for each.
const MOST_OF_OWN_SIZE: usize = 24;
/// Chance beyond which stars differ by more than a line through them.
const BESIDE_A_LINE: f64 = 1e-4;
/// Share of a rate by which a steady one may change.
const UNSTEADY: f64 = 0.1;
/// Spread of a motion's size over its mean below which it is steady: such a size is nothing beside what it multiplies.
const STEADY: f64 = 0.25;
/// What may yield to an acceleration, s^2: a swing of 0.16 Hz.
const YIELDS_S2: f64 = 1.0;
/// Sizes show from so many of their sigmas.
const SHOWS: f64 = 5.0;
/// Half of the logarithms of the flux to base 10 are off by more than this where stars change their brightness: 7 %, as
/// those of 95 photons are.
const LEAST_CHANGE_OF_FLUX: f64 = 0.03;
/// Channels beyond which none is paired with another variable: all pairs are paid for.
const MOST_CHANNELS: usize = 6;

/// A term, and where its columns stand.
#[derive(Debug)]
pub(crate) struct Term {
    pub(crate) term: Empirical,
    /// Its first column.
    pub(crate) first: usize,
    /// Parts by which it is judged, as columns; those that the data cannot show are left out.
    pub(crate) parts: Vec<Vec<usize>>,
    /// All its columns, and their credible sizes.
    pub(crate) group: Group,
}

/// A term of a description and the columns of it, counted from its own first.
pub(crate) type Part = (usize, Vec<usize>);

/// See the module.
#[derive(Debug)]
pub(crate) struct Described {
    pub(crate) fitted: Fitted,
    /// The chosen effects are the first groups.
    pub(crate) chosen: Vec<usize>,
    pub(crate) terms: Vec<Term>,
    /// Of each chosen effect, how it may change and the columns of that change.
    pub(crate) changes: Vec<Vec<(Way, Vec<usize>)>>,
    /// Ids of the chosen effects.
    pub(crate) names: Vec<&'static str>,
    /// The channel that each goes with.
    pub(crate) channels: Vec<Option<String>>,
    /// Whether each turns whole frames.
    pub(crate) turns: Vec<bool>,
    /// What having looked for each chosen effect costs, nats ([`costs`]).
    pub(crate) paid: Vec<f64>,
    /// What describes best what is left beside them, and its likelihood after all prices, once it was asked for.
    pub(crate) rest: OnceLock<Option<(f64, Vec<Part>)>>,
}

impl Described {
    /// The pass; `found` is what was chosen under `evidence`.
    pub(crate) fn new(
        evidence: &StarEvidence<'_>,
        folds: &Folds,
        found: &Found,
        terms: Vec<Empirical>,
        ways: &[Way],
    ) -> Result<Self, CloseError> {
        let chosen = &found.selection.chosen;
        let estimate = found.estimate();
        let only = found.only(chosen);
        let mut changing = Vec::new();
        if let Some(estimate) = estimate {
            let values = only.spread(&estimate.value);
            let mut first = 0;
            for candidate in &only.candidates {
                let end = first + candidate.coefficients().len();
                let own = &values.as_slice()[first..end];
                first = end;
                changing.push(Changing::new(Inner::Lent(*candidate), own, ways.to_vec()));
            }
        }
        let mut all: Vec<&dyn Candidate> = only.candidates.clone();
        all.extend(changing.iter().map(|c| c as &dyn Candidate));
        all.extend(terms.iter().map(|t| t as &dyn Candidate));
        // products of hundreds of columns a block: in long runs, of fewer blocks
        let coarse = evidence.coarser(folds);
        let folds = coarse.as_ref().unwrap_or(folds);
        let n = chosen.len();
        let own: Vec<usize> = (0..n).collect();
        let fitted = fit_beside(evidence, folds, &all, &own)?;
        let names = only.candidates.iter().map(|c| c.id()).collect();
        let channels = only.candidates.iter();
        let channels = channels.map(|c| c.selectors().get("channel").cloned());
        let channels = channels.collect();
        let turns = only.candidates.iter().map(|c| c.acts_on_attitude());
        let turns = turns.collect();
        let groups = &found.fitted.groups;
        let costs = costs(groups, &vec![true; groups.len()]);
        let paid = chosen.iter().map(|&g| costs[g].ln()).collect();
        let mut first: usize = only.candidates.iter().map(|c| c.coefficients().len()).sum();
        let mut changes = vec![Vec::new(); n];
        for (k, changing) in changing.iter().enumerate() {
            let seen = &fitted.groups[n + k].columns;
            for (way, columns) in changing.ways() {
                let own = first + columns.start..first + columns.end;
                let columns: Vec<usize> = own.filter(|c| seen.contains(c)).collect();
                if !columns.is_empty() {
                    changes[k].push((way.clone(), columns));
                }
            }
            first += changing.coefficients().len();
        }
        let groups = &fitted.groups[n + changing.len()..];
        let terms = terms
            .into_iter()
            .zip(groups)
            .map(|(term, group)| {
                let mut parts: Vec<Vec<usize>> = Vec::new();
                for part in term.parts() {
                    let part: Vec<usize> = part
                        .into_iter()
                        .map(|k| first + k)
                        .filter(|c| group.columns.contains(c))
                        .collect();
                    if !part.is_empty() && !parts.contains(&part) {
                        parts.push(part);
                    }
                }
                let own = first;
                first += term.coefficients().len();
                Term {
                    term,
                    first: own,
                    parts,
                    group: group.clone(),
                }
            })
            .collect();
        Ok(Self {
            fitted,
            chosen: own,
            terms,
            changes,
            names,
            channels,
            turns,
            paid,
            rest: OnceLock::new(),
        })
    }
}

impl Described {
    /// What the leftover follows; `left` is the share of the before variance that is left.
    pub(crate) fn follows(&self, left: f64) -> Unattributed {
        let set = columns_of(&self.fitted.groups, &self.chosen);
        let terms: Vec<_> = self
            .terms
            .iter()
            .map(|t| Followed {
                variable: t.term.name(),
                parts: t.parts.clone(),
                group: &t.group,
                of_many: t.term.is_of_many(),
                scanned: t.term.scanned(),
            })
            .collect();
        let tried = terms.len();
        let each = each(self.fitted.scalars);
        let mut told = figures::follows(&self.fitted.fits, &set, &terms, tried, each, left);
        self.stars_before_their_constants(&set, &mut told.depends_on);
        told
    }

    /// The columns of a part of a description.
    pub(crate) fn columns(&self, (term, part): &Part) -> Vec<usize> {
        let first = self.terms[*term].first;
        part.iter().map(|c| first + c).collect()
    }

    /// The parts of the terms of that name.
    pub(crate) fn parts_of(&self, name: &str) -> Vec<Part> {
        let named = self
            .terms
            .iter()
            .enumerate()
            .filter(|(_, t)| t.term.name() == name);
        let parts = |(k, term): (usize, &Term)| -> Vec<Part> {
            let own = |part: &Vec<usize>| (k, part.iter().map(|c| c - term.first).collect());
            term.parts.iter().map(own).collect()
        };
        named.flat_map(parts).collect()
    }

    /// Parts that a description may be made of.
    pub(crate) fn tried(&self) -> usize {
        self.terms.iter().map(|t| t.parts.len()).sum()
    }

    /// What each part of a description pays for having been looked for, nats.
    pub(crate) fn looked(&self) -> f64 {
        (self.tried() as f64).ln()
    }

    /// Whether what is left follows the acceleration.
    pub(crate) fn follows_acceleration(&self) -> bool {
        let name = Variable::Acceleration.name();
        let follows = |d: &Dependence| d.p_value < FAMILY_ALPHA && d.variable.contains(&name);
        self.follows(1.0).depends_on.iter().any(follows)
    }

    /// A dozen stars lie on some bent line of any number that they have: magnitude, colour and
    /// flux stand behind `star` where the stars differ beyond what such a line explains.
    fn stars_before_their_constants(&self, set: &[usize], list: &mut Vec<Dependence>) {
        let fits = &self.fitted.fits;
        let square = |term: &Term| -> Option<(f64, f64)> {
            let own = term.parts.last()?;
            let mut with = set.to_vec();
            with.extend(own);
            let which: Vec<usize> = (set.len()..with.len()).collect();
            Some((fits.estimate(&with)?.square(&which)?, own.len() as f64))
        };
        let Some(stars) = self.terms.iter().find(|t| t.term.is_of_stars()) else {
            return;
        };
        let Some((of_stars, columns)) = square(stars) else {
            return;
        };
        let behind: Vec<String> = self
            .terms
            .iter()
            .filter(|t| t.term.is_of_a_star())
            .filter(|t| {
                square(t).is_some_and(|(of_line, own)| {
                    let law = ChiSquared::new((columns - own).max(1.0));
                    let beyond = (of_stars - of_line).max(0.0);
                    law.is_ok_and(|law| law.sf(beyond) < BESIDE_A_LINE)
                })
            })
            .map(|t| t.term.name())
            .collect();
        let first = list.iter().position(|d| behind.contains(&d.variable));
        let Some(first) = first else { return };
        let name = stars.term.name();
        let all: Vec<Vec<usize>> = stars.parts.last().into_iter().cloned().collect();
        let tried = self.terms.len();
        let term = Followed {
            variable: name.clone(),
            parts: all,
            group: &stars.group,
            of_many: false,
            scanned: 0.0,
        };
        let whole = figures::follows(fits, set, &[term], tried, 0.0, 1.0);
        let Some(entry) = whole.depends_on.into_iter().find(figures::certain) else {
            return;
        };
        let at = list.iter().position(|d| d.variable == name);
        if at.is_some_and(|at| at < first) {
            return;
        }
        list.retain(|d| d.variable != name);
        list.insert(first, entry);
    }
}

/// The term that `left` follows most, of those that a model can declare, as a candidate
/// behind those of `found`.
pub(crate) fn offer(
    evidence: &StarEvidence<'_>,
    folds: &Folds,
    found: &mut Found,
    left: &Unattributed,
    terms: Vec<Empirical>,
    surroundings: &Surroundings<'_>,
) -> Result<(), CloseError> {
    let mut certain = left.depends_on.iter().filter(|d| figures::certain(d));
    let Some(term) = certain.find_map(|d| {
        let mut of_name = terms.iter().filter(|t| t.name() == d.variable);
        of_name.find(|t| t.is_declarable(surroundings))
    }) else {
        return Ok(());
    };
    found.candidates.push(Arc::new(term.clone()));
    found.fitted = fit(evidence, folds, &borrowed(&found.candidates))?;
    let (fitted, selection) = (&found.fitted, &mut found.selection);
    let cost = vec![terms.len() as f64; fitted.groups.len()];
    let last = fitted.groups.len() - 1;
    let judged = fitted.trials(&cost).within(&selection.chosen, last);
    selection.judged.push(judged.unwrap_or(Judgement::UNSEEN));
    Ok(())
}

/// What an effect may change with.
pub(crate) fn ways(situation: &Situation<'_>, data: &StarData) -> Vec<Way> {
    let range = |values: &[f64]| range(values.iter().copied());
    let [vx, vy] = &data.velocity;
    let rate: Vec<f64> = vx.iter().zip(vy).map(|(x, y)| x.hypot(*y)).collect();
    let mut ways = vec![
        Way::With(Variable::Time, range(&data.t_s)),
        Way::Bent(Variable::Time, range(&data.t_s)),
        Way::With(Variable::Rate, range(&rate)),
        Way::With(Variable::Magnitude, range(&data.mag)),
        Way::With(Variable::Colour, range(&data.bv)),
        Way::With(Variable::Position(0), range(&data.modelled[0])),
        Way::With(Variable::Position(1), range(&data.modelled[1])),
    ];
    for (name, series) in channels_of_interest(&situation.channels) {
        let known = range(series.value());
        ways.push(Way::With(
            Variable::Housekeeping(name, series.clone()),
            known,
        ));
    }
    ways.retain(|w| match w {
        Way::With(_, [low, high]) | Way::Bent(_, [low, high]) => high > low,
        Way::Star(_) => true,
    });
    if data.stars.len() <= MOST_OF_OWN_SIZE {
        ways.push(Way::Star(data.stars.iter().map(|s| s.id).collect()));
    }
    ways
}

/// What the noise level may follow.
pub(crate) fn of_noise(situation: &Situation<'_>, data: &StarData) -> Vec<(Variable, [f64; 2])> {
    let mut list: Vec<(Variable, [f64; 2])> = ways(situation, data)
        .into_iter()
        .filter_map(|way| match way {
            // the catalogue has an effect for a slope in magnitude
            Way::With(Variable::Magnitude, _) | Way::Bent(..) | Way::Star(_) => None,
            Way::With(variable, range) => Some((variable, range)),
        })
        .collect();
    let [ax, ay] = &data.acceleration;
    let size = range(ax.iter().zip(ay).map(|(x, y)| x.hypot(*y)));
    if size[1] > size[0] {
        list.push((Variable::Acceleration, size));
    }
    list.extend((0..2).map(|axis| (Variable::Phase(axis), [0.0, 1.0])));
    list.extend(brightening(data));
    list
}

/// By how much stars are brighter than usual, where most change by more than the noise of photons ([`LEAST_CHANGE_OF_FLUX`]):
/// that of a flux is its centroid's, too, and few that are brighter may be hits.
fn brightening(data: &StarData) -> Option<(Variable, [f64; 2])> {
    let known = || data.log_flux_change.iter().filter(|c| c.is_finite());
    let mut sizes: Vec<f64> = known().map(|change| change.abs()).collect();
    let usual = spectra::robust::median(&mut sizes)?;
    let changes = usual > LEAST_CHANGE_OF_FLUX;
    changes.then(|| (Variable::Brightening, about_mean(known().copied())))
}

/// Every variable that the bundle gives values of, and the pairs that matter; without `acceleration` where
/// that is none, or is a function of time like any other ([`could_yield`]).
pub(crate) fn terms(
    situation: &Situation<'_>,
    data: &StarData,
    acceleration: bool,
) -> Vec<Empirical> {
    let motion = |[x, y]: &[Vec<f64>; 2]| {
        let [low, high] = range(x.iter().chain(y).copied());
        let largest = low.abs().max(high.abs());
        let sizes = x.iter().zip(y).map(|(x, y)| x.hypot(*y));
        let [count, sum, squares] = sizes
            .filter(|size| size.is_finite())
            .fold([0.0, 0.0, 0.0], |[n, sum, squares], v| {
                [n + 1.0, sum + v, squares + v * v]
            });
        let mean = sum / f64::max(count, 1.0);
        let spread = (squares / f64::max(count, 1.0) - mean * mean)
            .max(0.0)
            .sqrt();
        let steady = if spread < STEADY * mean { mean } else { 0.0 };
        [steady - largest, steady + largest]
    };
    let range = |values: &[f64]| range(values.iter().copied());
    let centred = |values: &[f64]| about_mean(values.iter().copied());
    let off: Vec<f64> = (0..2)
        .flat_map(|a| {
            let (at, window) = (&data.modelled[a], &data.window_px[a]);
            at.iter().zip(window).map(|(p, w)| p - w)
        })
        .collect();
    let position = [0, 1].map(|a| (Variable::Position(a), range(&data.modelled[a])));
    let phase = [0, 1].map(|a| (Variable::Phase(a), [0.0, 1.0]));
    let time = (Variable::Time, range(&data.t_s));
    let rate = (Variable::Rate, motion(&data.velocity));
    let mag = (Variable::Magnitude, centred(&data.mag));
    let colour = (Variable::Colour, centred(&data.bv));
    let flux: Vec<f64> = data.mag.iter().map(|m| flux_of(*m)).collect();
    let flux = (Variable::Brightness, centred(&flux));
    let channels: Vec<_> = channels_of_interest(&situation.channels)
        .map(|(name, series)| {
            let known = centred(&series.at_all(&data.t_s));
            (Variable::Housekeeping(name, series.clone()), known)
        })
        .collect();
    let mut terms = Vec::new();
    let one = |(variable, range): &(Variable, [f64; 2])| {
        Some(Empirical::new(variable.clone(), *range, true)?.on(&data.camera))
    };
    let two = |of: &(Variable, [f64; 2]), by: &(Variable, [f64; 2])| {
        Some(Empirical::pair(of.0.clone(), of.1, by.0.clone(), by.1)?.on(&data.camera))
    };
    for axis in 0..2 {
        terms.extend(one(&position[axis]));
        terms.extend(one(&(Variable::Half(axis), [-1.0, 1.0])));
        terms.extend(one(&phase[axis]));
    }
    terms.extend(one(&(Variable::Quarter, [-1.0, 1.0])));
    terms.extend(one(&(Variable::PhaseProduct, [0.0, 1.0])));
    for single in [&time, &mag, &colour] {
        terms.extend(one(single));
    }
    // of a camera that turns steadily every place has its rate: that says what the place says; of one at rest there
    // is the noise of its reference
    let moves = !turns_steadily(data) && !data.is_still();
    if moves {
        terms.extend(one(&rate));
    }
    if acceleration && moves {
        let acceleration = (Variable::Acceleration, motion(&data.acceleration));
        terms.extend(one(&acceleration));
        terms.extend(
            [&mag, &colour]
                .into_iter()
                .chain(&position)
                .filter_map(|by| two(&acceleration, by)),
        );
    }
    if mag.1[0] >= mag.1[1] || !mag.1[0].is_finite() {
        // no magnitudes
        terms.extend(one(&(Variable::Flux, centred(&data.log_flux))));
    } else {
        terms.extend(one(&flux));
    }
    terms.extend(brightening(data).as_ref().and_then(one));
    terms.extend(one(&(Variable::Window, range(&off))));
    terms.extend(channels.iter().filter_map(one));
    let few = !data.free_directions && data.stars.len() <= MOST_STARS;
    let ids: Vec<i64> = data.stars.iter().map(|s| s.id).collect();
    if few {
        let star = (Variable::Star(ids), [0.0, 1.0]);
        terms.extend(one(&star));
        terms.extend(two(&star, &time));
    }
    if let Some(slots) = own_slots(data) {
        let slot = (Variable::Slot(slots), [0.0, 1.0]);
        terms.extend(one(&slot));
        terms.extend(two(&slot, &time));
    }
    let mut scalars = vec![&time, &mag, &colour];
    if channels.len() <= MOST_CHANNELS {
        scalars.extend(&channels);
    }
    for by in &scalars {
        for of in position.iter().chain(&phase) {
            terms.extend(two(of, by));
        }
    }
    // spots that are not the same all over the field err with the pixel phase otherwise
    for of in &phase {
        terms.extend(position.iter().filter_map(|by| two(of, by)));
    }
    // charge is held back in proportion to it, the more the farther it is moved
    terms.extend(position.iter().filter_map(|of| two(of, &flux)));
    if moves {
        let by = position.iter().chain([&time, &mag, &colour]);
        terms.extend(by.filter_map(|by| two(&rate, by)));
    }
    for of in [&mag, &colour] {
        terms.extend(
            scalars
                .iter()
                .filter(|by| !matches!(by.0, Variable::Magnitude | Variable::Colour))
                .filter_map(|by| two(of, by)),
        );
    }
    terms
}

/// Frames that turn to and fro with the time.
pub(crate) fn turning(data: &StarData) -> Option<Empirical> {
    Empirical::new(Variable::Turning, range(data.t_s.iter().copied()), true)
}

/// Terms that stand where what is left, `inside` (arcsec), has them: a scale that is another one from an instant on, an
/// edge or a patch of the detector, a channel of `terms` that one star or slot follows.
pub(crate) fn sought(
    level: &StarEvidence<'_>,
    inside: &[Vec<f64>],
    terms: &[Empirical],
) -> Vec<Empirical> {
    let (data, weight) = (level.data, &level.weight);
    let grown = jumps::growth(data, inside, weight);
    let grown = grown.and_then(|SharedJump { at_s, tried }| {
        let since = Empirical::new(Variable::Since { at_s }, [0.0, 1.0], true)?;
        Some(since.looked_for_among(tried))
    });
    let mut sought: Vec<Empirical> = grown.into_iter().collect();
    sought.extend(places(data, inside, weight));
    sought.extend(by_channel(data, inside, weight, terms));
    sought
}

/// Whether the rotation from one frame to the next is the same all the time, but for [`UNSTEADY`] of it.
fn turns_steadily(data: &StarData) -> bool {
    let longest_s = longest_step(&data.frames.t_s);
    let t_s = data.frames.t_s.windows(2).map(|t| t[1] - t[0]);
    let steps = data.attitude.windows(2).zip(t_s);
    let rates: Vec<Vector3<f64>> = steps
        .filter(|(_, dt)| *dt > 0.0 && *dt < longest_s)
        .map(|(q, dt)| focal_plane::rotation_vector(&q[1], &q[0]) / dt)
        .collect();
    let count = rates.len().max(1) as f64;
    let mean = rates.iter().sum::<Vector3<f64>>() / count;
    let scatter = rates.iter().map(|r| (r - mean).norm_squared()).sum::<f64>() / count;
    rates.len() > 2 && scatter.sqrt() < UNSTEADY * mean.norm()
}

/// Whether what yields to the acceleration could show beside a residual of `rms` arcsec: a structure that swings
/// at f yields by 1/(2 pi f)^2 of it, an exposure of T seconds by T^2/24, a path between samples h apart by h^2/8.
/// How much of it could is a choice: [`YIELDS_S2`], or the square of the largest of these times.
pub(crate) fn could_yield(situation: &Situation<'_>, data: &StarData, rms: [f64; 2]) -> bool {
    let [low, high] = range(data.acceleration.iter().flatten().copied());
    let largest = high.max(-low);
    let scale = data.camera.arcsec_per_px();
    let row_px = (rms[0] / scale[0]).min(rms[1] / scale[1]);
    let shows_px = SHOWS * row_px / (2.0 * data.counted().max(1) as f64).sqrt();
    let samples = situation.reference.as_ref().map(AttitudeSeries::t_s);
    let step_s = median_step(samples.unwrap_or(&data.frames.t_s)).unwrap_or(0.0);
    let longest_s = situation.exposure_s().unwrap_or(0.0).max(step_s);
    // where nothing is known, nothing is ruled out
    shows_px.is_nan() || largest * YIELDS_S2.max(longest_s * longest_s) >= shows_px
}

/// The slots, where they are not just the stars under another name.
pub(crate) fn own_slots(data: &StarData) -> Option<Vec<i32>> {
    let mut pairs: Vec<(i32, i64)> = data
        .frames
        .slot
        .iter()
        .copied()
        .zip(data.frames.star_id.iter().copied())
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    let mut slots: Vec<i32> = pairs.iter().map(|p| p.0).collect();
    slots.dedup();
    let moved = pairs.len() > slots.len() || pairs.len() > data.stars.len();
    (moved && slots.len() <= MOST_STARS).then_some(slots)
}

/// Some of the columns of a candidate, kept in every fit: described, but not named.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    inner: Arc<dyn Candidate>,
    columns: Vec<usize>,
    coefficients: Vec<Coefficient>,
}

impl Kept {
    pub(crate) fn new(inner: Arc<dyn Candidate>, columns: Vec<usize>) -> Self {
        let coefficients = columns
            .iter()
            .map(|&c| inner.coefficients()[c].clone())
            .collect();
        Self {
            inner,
            columns,
            coefficients,
        }
    }
}

impl Candidate for Kept {
    fn id(&self) -> &'static str {
        self.inner.id()
    }
    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }
    fn acts_on_stars(&self) -> bool {
        true
    }
    fn acts_on_attitude(&self) -> bool {
        false
    }
    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        let n = rows.len();
        let Some([x, y]) = star_columns_of(self.inner.as_ref(), camera, rows) else {
            return false;
        };
        for (to, &from) in self.columns.iter().enumerate() {
            out.x[to * n..(to + 1) * n].copy_from_slice(&x[from * n..(from + 1) * n]);
            out.y[to * n..(to + 1) * n].copy_from_slice(&y[from * n..(from + 1) * n]);
        }
        true
    }
    fn attitude_columns(&self, _: &AttitudeRows<'_>, _: VectorsMut<'_>) -> bool {
        false
    }
    fn realise(
        &self,
        values: &[f64],
        surroundings: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        self.inner.realise(values, surroundings)
    }
}
