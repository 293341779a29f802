//! What a leftover, an effect or the noise may follow: the variables that a bundle gives values of, alone and in the
//! pairs that matter.
//!
//! Not physics: which columns there are.

use focal_plane::{AttitudeSeries, Camera};
use nalgebra::Vector3;
use spectra::robust::median_step;

use crate::causes::by_channel::by_channel;
use crate::causes::changing_effect::Way;
use crate::causes::channel_forms::channel_forms;
use crate::causes::places::places;
use crate::gaps::longest_step;
use crate::search::empirical::{Empirical, Variable, about_mean, flux_of, range};
use crate::situation::{Situation, channels_of_interest};
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use crate::unexplained::leftover::jumps::{self, SharedJump};
use crate::unexplained::leftover::star_tracks;

/// Stars beyond which none has a term of its own.
pub(crate) const MOST_STARS: usize = 64;
/// Stars beyond which an effect is not tried with a size for each.
const MOST_OF_OWN_SIZE: usize = 24;
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

/// A variable and what it runs over.
type Ranged = (Variable, [f64; 2]);

/// What an effect may change with.
pub(crate) fn ways(situation: &Situation<'_>, data: &StarData) -> Vec<Way> {
    let range = |values: &[f64]| range(values.iter().copied());
    let rate: Vec<f64> = sizes(&data.velocity).collect();
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
pub(crate) fn of_noise(situation: &Situation<'_>, data: &StarData) -> Vec<Ranged> {
    let mut list: Vec<Ranged> = ways(situation, data)
        .into_iter()
        .filter_map(|way| match way {
            // the catalogue has an effect for a slope in magnitude
            Way::With(Variable::Magnitude, _) | Way::Bent(..) | Way::Star(_) => None,
            Way::With(variable, range) => Some((variable, range)),
        })
        .collect();
    let size = range(sizes(&data.acceleration));
    if size[1] > size[0] {
        list.push((Variable::Acceleration, size));
    }
    list.extend((0..2).map(|axis| (Variable::Phase(axis), [0.0, 1.0])));
    list.extend(brightening(data));
    list
}

/// By how much stars are brighter than usual, where most change by more than the noise of photons ([`LEAST_CHANGE_OF_FLUX`]):
/// that of a flux is its centroid's, too, and few that are brighter may be hits.
fn brightening(data: &StarData) -> Option<Ranged> {
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
    let given = Given::of(situation, data, acceleration);
    let mut terms = given.of_detector();
    terms.extend(
        [&given.time, &given.mag, &given.colour]
            .map(|v| given.one(v))
            .into_iter()
            .flatten(),
    );
    terms.extend(given.of_motion());
    terms.extend(given.one(&given.light));
    terms.extend(brightening(data).as_ref().and_then(|v| given.one(v)));
    terms.extend(given.one(&given.off_window));
    terms.extend(given.channels.iter().filter_map(|v| given.one(v)));
    terms.extend(given.of_many(data));
    terms.extend(given.pairs());
    terms
}

/// What a bundle gives values of.
struct Given<'a> {
    camera: &'a Camera,
    position: [Ranged; 2],
    phase: [Ranged; 2],
    /// From the middle of the window.
    off_window: Ranged,
    time: Ranged,
    mag: Ranged,
    colour: Ranged,
    /// What the magnitude makes of it.
    flux: Ranged,
    /// The same, or where there are no magnitudes the flux that was measured.
    light: Ranged,
    rate: Option<Ranged>,
    /// Its size.
    speed: Option<Ranged>,
    acceleration: Option<Ranged>,
    channels: Vec<Ranged>,
}

impl<'a> Given<'a> {
    fn of(situation: &Situation<'_>, data: &'a StarData, acceleration: bool) -> Self {
        let range = |values: &[f64]| range(values.iter().copied());
        let centred = |values: &[f64]| about_mean(values.iter().copied());
        let off: Vec<f64> = (0..2)
            .flat_map(|a| {
                let (at, window) = (&data.modelled[a], &data.window_px[a]);
                at.iter().zip(window).map(|(p, w)| p - w)
            })
            .collect();
        let mag = centred(&data.mag);
        let flux: Vec<f64> = data.mag.iter().map(|m| flux_of(*m)).collect();
        let flux = (Variable::Brightness, centred(&flux));
        let no_magnitudes = mag[0] >= mag[1] || !mag[0].is_finite();
        let light = if no_magnitudes {
            (Variable::Flux, centred(&data.log_flux))
        } else {
            flux.clone()
        };
        // of a camera that turns steadily every place has its rate: that says what the place says; of one at rest there
        // is the noise of its reference
        let moves = !turns_steadily(data) && !data.is_still();
        let motion = |variable, of: &[Vec<f64>; 2]| moves.then(|| (variable, motion(of)));
        let channels = channels_of_interest(&situation.channels).map(|(name, series)| {
            let known = centred(&series.at_all(&data.t_s));
            (Variable::Housekeeping(name, series.clone()), known)
        });
        Self {
            camera: &data.camera,
            position: [0, 1].map(|a| (Variable::Position(a), range(&data.modelled[a]))),
            phase: [0, 1].map(|a| (Variable::Phase(a), [0.0, 1.0])),
            off_window: (Variable::Window, range(&off)),
            time: (Variable::Time, range(&data.t_s)),
            mag: (Variable::Magnitude, mag),
            colour: (Variable::Colour, centred(&data.bv)),
            flux,
            light,
            rate: motion(Variable::Rate, &data.velocity),
            speed: moves.then(|| (Variable::Rate, about_mean(sizes(&data.velocity)))),
            acceleration: motion(Variable::Acceleration, &data.acceleration)
                .filter(|_| acceleration),
            channels: channels.collect(),
        }
    }

    fn one(&self, (variable, range): &Ranged) -> Option<Empirical> {
        Some(Empirical::new(variable.clone(), *range, true)?.on(self.camera))
    }

    fn two(&self, of: &Ranged, by: &Ranged) -> Option<Empirical> {
        Some(Empirical::pair(of.0.clone(), of.1, by.0.clone(), by.1)?.on(self.camera))
    }

    fn of_detector(&self) -> Vec<Empirical> {
        let halves = [-1.0, 1.0];
        let mut terms = Vec::new();
        for axis in 0..2 {
            terms.extend(self.one(&self.position[axis]));
            terms.extend(self.one(&(Variable::Half(axis), halves)));
            terms.extend(self.one(&self.phase[axis]));
        }
        terms.extend(self.one(&(Variable::Quarter, halves)));
        terms.extend(self.one(&(Variable::PhaseProduct, [0.0, 1.0])));
        terms
    }

    /// The rate, and the acceleration with what it takes along.
    fn of_motion(&self) -> Vec<Empirical> {
        let mut terms: Vec<Empirical> = self.rate.iter().filter_map(|v| self.one(v)).collect();
        if let Some(acceleration) = &self.acceleration {
            terms.extend(self.one(acceleration));
            let by = [&self.mag, &self.colour].into_iter().chain(&self.position);
            terms.extend(by.filter_map(|by| self.two(acceleration, by)));
        }
        terms
    }

    /// A shift of each star and of each slot, constant and with the time.
    fn of_many(&self, data: &StarData) -> Vec<Empirical> {
        let few = !data.free_directions && data.stars.len() <= MOST_STARS;
        let stars = few.then(|| Variable::Star(data.stars.iter().map(|s| s.id).collect()));
        let slots = own_slots(data).map(Variable::Slot);
        let many = stars.into_iter().chain(slots);
        many.flat_map(|of| {
            let of = (of, [0.0, 1.0]);
            [self.one(&of), self.two(&of, &self.time)]
        })
        .flatten()
        .collect()
    }

    fn pairs(&self) -> Vec<Empirical> {
        let mut scalars = vec![&self.time, &self.mag, &self.colour];
        if self.channels.len() <= MOST_CHANNELS {
            scalars.extend(&self.channels);
        }
        let mut pairs: Vec<(&Ranged, &Ranged)> = Vec::new();
        for by in &scalars {
            pairs.extend(self.position.iter().chain(&self.phase).map(|of| (of, *by)));
        }
        // spots that are not the same all over the field err with the pixel phase otherwise
        for of in &self.phase {
            pairs.extend(self.position.iter().map(|by| (of, by)));
        }
        // a spot that smears flattens its pixel phase
        if let Some(speed) = &self.speed {
            pairs.extend(self.phase.iter().map(|of| (of, speed)));
        }
        // charge is held back in proportion to it, the more the farther it is moved
        pairs.extend(self.position.iter().map(|of| (of, &self.flux)));
        if let Some(rate) = &self.rate {
            // a clock drifts with its temperature
            let by = self.position.iter();
            let by = by.chain(scalars.iter().copied());
            pairs.extend(by.map(|by| (rate, by)));
        }
        for of in [&self.mag, &self.colour] {
            let by = scalars.iter().copied();
            let by = by.filter(|by| !matches!(by.0, Variable::Magnitude | Variable::Colour));
            pairs.extend(by.map(|by| (of, by)));
        }
        pairs
            .into_iter()
            .filter_map(|(of, by)| self.two(of, by))
            .collect()
    }
}

/// How large a motion is, row by row.
fn sizes([x, y]: &[Vec<f64>; 2]) -> impl Iterator<Item = f64> + Clone + '_ {
    x.iter().zip(y).map(|(x, y)| x.hypot(*y))
}

/// What a motion runs over: about its mean size, where that is steady.
fn motion(of: &[Vec<f64>; 2]) -> [f64; 2] {
    let [low, high] = range(of.iter().flatten().copied());
    let largest = low.abs().max(high.abs());
    let [count, sum, squares] = sizes(of)
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
}

/// Frames that turn to and fro with the time.
pub(crate) fn turning(data: &StarData) -> Option<Empirical> {
    Empirical::new(Variable::Turning, range(data.t_s.iter().copied()), true)
}

/// Terms that stand where what is left, `inside` (arcsec), has them: a scale that is another one from an instant on, an
/// edge or a patch of the detector, a channel of `terms` that one star or slot follows, or all do from a threshold on.
pub(crate) fn sought(
    level: &StarEvidence<'_>,
    inside: &[Vec<f64>],
    terms: &[Empirical],
) -> Vec<Empirical> {
    let (data, weight) = (level.data, &level.weight);
    let tracks = star_tracks(data, inside, weight);
    let grown = jumps::growth(&tracks);
    let grown = grown.and_then(|SharedJump { at_s, tried }| {
        let since = Empirical::new(Variable::Since { at_s }, [0.0, 1.0], true)?;
        Some(since.looked_for_among(tried))
    });
    let mut sought: Vec<Empirical> = grown.into_iter().collect();
    sought.extend(places(data, inside, weight));
    sought.extend(by_channel(data, inside, weight, terms));
    sought.extend(channel_forms(data, &tracks, terms));
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
