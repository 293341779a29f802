//! The search at star level where the reference itself may err.
//!
//! White evidence takes the slow error of a reference for steps, lines and
//! heaters; noise fitted to everything takes slow effects for an error of the
//! reference. So each hypothesis is held against the data at its own best noise,
//!
//! ```text
//! L(H) = max over noise, amplitudes of ln p(data | H)       2 (L(H1) - L(H0)) ~ chi2_p
//! ```
//!
//! Candidates are put forward twice, by what white evidence and by what the present
//! noise makes of them; the few best of each are scored, and the best that stands
//! is added. What white evidence finds by itself competes with that as a whole, each
//! with its own noise and all that its freedom costs,
//!
//! ```text
//! worth = L - sum over effects ( ln cost + k/2 (1 + ln(q/k)) ) - sum over slow errors ( 4 )
//! ```
//!
//! k parameters (instant, frequency and lag too), q the square of the amplitudes over
//! their errors: the evidence if effects are spread like what was found. One slow error may act about X and Y
//! alike; what differs about them, or acts about one alone, pays ln 2 more. Without a slow
//! error the noise is white, so that what such an error would add is taken off. The
//! likelier explanation is named; an effect that is worth less than a slow error in its
//! place is not, even if that error would not be named either. The log-odds of a step of
//! q = 40 in white noise are about 4 +- 2.5, of a wander's best step -2 +- 2 or less:
//! neither is ever certain. Where the rotations of the declared model's residual are
//! white, the plain search is all there is.
//!
//! Source: Wilks 1938 (likelihood ratio); George & Foster 2000 (empirical Bayes selection).

use std::sync::Arc;

use block_regression::Folds;
use coloured_noise::{CommonNoise, Foreknown, Rotations};
use effects::Candidate;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::declared::OnCentroids;
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::search::selection::{FAMILY_ALPHA, WIDENING, costs};
use crate::search::{Choice, Found, borrowed, fit, search, without};
use crate::star::evidence::StarEvidence;
use crate::star::landing::Elsewhere;
use alone::{Begun, Outcome};
use beside_slow::{Coloured, beside_slow};
use trial::{Trial, taken_out_in_turn};

mod alone;
mod beside_slow;
mod first_sight;
mod foreknown;
pub(crate) mod in_vain;
mod on_frames;
mod trial;

/// Parts of a long run of which one is searched before the whole is.
const PARTS: usize = 8;

/// The slow error of the reference as it was found.
#[derive(Clone, Debug)]
pub(crate) struct Wander {
    pub(crate) noise: CommonNoise,
    pub(crate) rotations: Rotations,
    /// Twice the gain in log-likelihood of each axis.
    pub(crate) ratio: [f64; 3],
    /// The same of X and Y together with one size and time.
    pub(crate) alike: f64,
    /// Nats by which effects in its place are less likely, where there are any that come near.
    pub(crate) behind: Option<f64>,
}

/// What the search ends with.
pub(crate) struct Searched<'a> {
    pub(crate) found: Found,
    /// The evidence under the noise that was found; `None`: as it was given.
    pub(crate) evidence: Option<StarEvidence<'a>>,
    pub(crate) wander: Option<Wander>,
}

/// What a search knows of the reference's slow error before it begins.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Start {
    /// There is none.
    White,
    /// There may be one like this.
    Found(CommonNoise),
    /// The model declares one.
    Declared([Option<Foreknown>; 3]),
}

/// What a search ends with.
pub(crate) enum Attempt<'a> {
    /// And what of it a slow error of the reference explains better.
    Searched(Box<Searched<'a>>, Vec<usize>),
    /// What shows first takes the light elsewhere.
    Elsewhere(Box<Elsewhere>),
}

/// One search on `white` evidence. Candidates that may not be chosen are judged. `sight`: what the model declares of
/// centroids, if the light is to be followed to where it falls at first sight.
pub(crate) fn attempt<'a>(
    white: &StarEvidence<'a>,
    folds: &Folds,
    candidates: Vec<Arc<dyn Candidate>>,
    may: &[bool],
    start: Start,
    sight: Option<&OnCentroids>,
) -> Result<Attempt<'a>, CloseError> {
    let start = match start {
        Start::White => None,
        Start::Found(noise) => Some(noise),
        Start::Declared(known) => {
            let searched = foreknown::beside(white, folds, candidates, may, &known)?;
            return Ok(Attempt::Searched(Box::new(searched), Vec::new()));
        }
    };
    let candidates = match prepared(white, folds, candidates, may, start, sight)? {
        Prepared::Candidates(candidates) => candidates,
        Prepared::Elsewhere(to) => return Ok(Attempt::Elsewhere(to)),
    };
    let plain = |found| Attempt::Searched(Box::new(Searched::plain(found)), Vec::new());
    let Some(start) = start else {
        let fitted = fit(white, folds, &borrowed(&candidates))?;
        if let Some(phase) = sight {
            let (chosen, quieter) = fitted.chosen(folds, &candidates, may)?;
            let choice = Choice {
                candidates: &candidates,
                fitted: quieter.as_ref().unwrap_or(&fitted),
                chosen: &chosen,
            };
            if let Some(to) = first_sight::of_choice(white, folds, choice, phase)? {
                return Ok(Attempt::Elsewhere(to));
            }
        }
        return Ok(plain(search(white, folds, candidates, may, Some(fitted))?));
    };
    let Coloured {
        searched,
        wander,
        begun,
        worth,
    } = match explored(white, folds, candidates, may, start, sight)? {
        Explored::White(found) => return Ok(plain(*found)),
        Explored::Elsewhere(to) => return Ok(Attempt::Elsewhere(to)),
        Explored::Coloured(coloured) => *coloured,
    };
    let beside = |searched: Searched<'a>, wander| {
        let wander = Some(wander);
        Attempt::Searched(Box::new(Searched { wander, ..searched }), Vec::new())
    };
    let certain = wander.axes().contains(&true);
    if certain
        && let Some(phase) = sight
        && searched.found.choice().moves_light()
        && let level = searched.evidence.as_ref().unwrap_or(white)
        && let Some(to) = Elsewhere::of(level, folds, searched.found.choice(), phase)?
    {
        return Ok(Attempt::Elsewhere(to));
    }
    // white evidence is another one where rotations have a prior
    let begun = white.drawn.is_none().then_some(begun);
    if let Some(begun) = begun.as_ref().filter(|_| certain)
        && alone::is_hopeless(white, folds, begun, may, &wander.noise)?
    {
        return Ok(beside(searched, wander));
    }
    // from the forms that were polished beside the slow error: nearly those that suit white noise
    let candidates = searched.found.candidates.clone();
    let found = search(white, folds, candidates, may, begun.map(|b| b.plain))?;
    let instead = Instead::of(white, folds, &found, may, &wander.noise)?;
    // Less than that imitates no effect, and would only hide one.
    if certain {
        let better = |i: &Instead| i.refused.is_empty() && i.worth > worth;
        if !instead.as_ref().is_some_and(better) {
            let behind = instead.map(|i| worth - i.worth);
            return Ok(beside(searched, Wander { behind, ..wander }));
        }
        return Ok(plain(found));
    }
    // forms of one cause (steps at other instants) are no better
    let family = |g: usize| found.fitted.groups[g].family.as_str();
    let causes: Vec<&str> = instead
        .iter()
        .flat_map(|i| i.refused.iter().map(|&g| family(g)))
        .collect();
    let refused = (0..found.candidates.len())
        .filter(|&g| causes.contains(&family(g)))
        .collect();
    Ok(Attempt::Searched(Box::new(Searched::plain(found)), refused))
}

/// What a search of a part leads to.
enum Prepared {
    Candidates(Vec<Arc<dyn Candidate>>),
    Elsewhere(Box<Elsewhere>),
}

/// The candidates in the forms that a part of a long run gives them: of the whole, each other form costs a
/// pass.
fn prepared(
    white: &StarEvidence<'_>,
    folds: &Folds,
    candidates: Vec<Arc<dyn Candidate>>,
    may: &[bool],
    start: Option<CommonNoise>,
    sight: Option<&OnCentroids>,
) -> Result<Prepared, CloseError> {
    let Some(coarse) = white.coarser(folds) else {
        return Ok(Prepared::Candidates(candidates));
    };
    let part = coarse.thinned(PARTS);
    let searched = match start {
        Some(start) => {
            let explored = explored(white, &part, candidates.clone(), may, start, None);
            explored.map(|explored| match explored {
                Explored::White(found) => Some(Searched::plain(*found)),
                Explored::Coloured(coloured) => Some(coloured.searched),
                Explored::Elsewhere(_) => None,
            })
        }
        None => {
            let found = search(white, &part, candidates.clone(), may, None);
            found.map(|found| Some(Searched::plain(found)))
        }
    };
    let Ok(Some(searched)) = searched else {
        return Ok(Prepared::Candidates(candidates));
    };
    if let Some(phase) = sight
        && let Some(to) = first_sight::of_part(white, folds, &searched, phase)?
    {
        return Ok(Prepared::Elsewhere(to));
    }
    Ok(Prepared::Candidates(searched.found.candidates))
}

impl Searched<'_> {
    /// The noise of what was found, or of what the model declares, where the reference errs slowly.
    pub(crate) fn slow_error(&self) -> Option<&CommonNoise> {
        let found = self.wander.as_ref().map(|w| &w.noise);
        let declared = || self.evidence.as_ref()?.noise.as_ref();
        let noise = found.or_else(declared)?;
        noise
            .reference
            .iter()
            .any(|axis| axis.slow > 0.0)
            .then_some(noise)
    }

    /// Of white evidence alone.
    fn plain(found: Found) -> Self {
        Self {
            found,
            evidence: None,
            wander: None,
        }
    }
}

/// What white evidence chose, as an explanation in place of a slow error.
struct Instead {
    /// Beside a reference that has white noise alone.
    worth: f64,
    /// What a slow error is worth more than.
    refused: Vec<usize>,
}

impl Instead {
    /// `None`: nothing that a slow error could imitate.
    fn of(
        white: &StarEvidence<'_>,
        folds: &Folds,
        found: &Found,
        may: &[bool],
        noise: &CommonNoise,
    ) -> Result<Option<Self>, CloseError> {
        let chosen = &found.selection.chosen;
        let turns = |g: &usize| found.candidates[*g].acts_on_attitude();
        if !chosen.iter().any(turns) {
            return Ok(None);
        }
        let only = found.only(chosen);
        let moments = white.moments(folds, &only.candidates);
        let groups = only.groups(&found.fitted.groups, chosen);
        let cost = costs(&found.fitted.groups, may);
        let trial = Trial {
            moments: &moments,
            folds,
            precision: white.precision(),
            variance: found.fitted.variance_beside(chosen).unwrap_or(1.0),
            slow_price: white.slow_price,
            groups: &groups,
            cost: chosen.iter().map(|&g| cost[g]).collect(),
            all: None,
            single: false,
        };
        trial.sum_up();
        let all: Vec<usize> = (0..chosen.len()).collect();
        let turns = all.iter().copied().filter(|&at| turns(&chosen[at]));
        // the first is the choice as it is
        let out = taken_out_in_turn(turns.collect());
        let scored = out.par_iter().map(|out| {
            let rest = trial.score(&without(&all, out), noise);
            let rest = rest.ok_or(CloseError::Singular)?;
            Ok(if out.is_empty() {
                trial.worth_of_white(&rest)
            } else {
                trial.worth(&rest)
            })
        });
        let scored: Vec<f64> = scored.collect::<Result<_, CloseError>>()?;
        let worth = scored[0];
        let better = out.into_iter().zip(&scored).skip(1);
        let mut refused: Vec<usize> = better
            .filter(|(_, instead)| **instead > worth)
            .flat_map(|(set, _)| set.into_iter().map(|at| chosen[at]))
            .collect();
        refused.sort_unstable();
        refused.dedup();
        Ok(Some(Self { worth, refused }))
    }
}

/// What the declared model's residual may hold of a slow error. How much
/// of one shows only later: what is fitted here (a distortion under drifting stars)
/// takes some of it along.
pub(crate) fn start(
    white: &StarEvidence<'_>,
    folds: &Folds,
    known: &[Option<Foreknown>; 3],
) -> Result<Start, CloseError> {
    if known.iter().any(Option::is_some) {
        return Ok(Start::Declared(*known));
    }
    let moments = white.moments(folds, &[]);
    let trial = Trial {
        moments: &moments,
        folds,
        precision: white.precision(),
        variance: white.variance_guess(),
        slow_price: white.slow_price,
        groups: &[],
        cost: Vec::new(),
        all: None,
        single: true,
    };
    let noise = trial.taken_out(&trial.columns(&[]));
    let slow = noise.filter(|n| n.reference.iter().any(|r| r.slow > 0.0));
    Ok(slow.map_or(Start::White, Start::Found))
}

/// What a search beside a slow error comes to.
enum Explored<'a> {
    /// There is none beside what white evidence finds.
    White(Box<Found>),
    Coloured(Box<Coloured<'a>>),
    Elsewhere(Box<Elsewhere>),
}

/// The search beside a slow error, unless white evidence makes it needless ([`alone::without_slow`]).
fn explored<'a>(
    white: &StarEvidence<'a>,
    folds: &Folds,
    candidates: Vec<Arc<dyn Candidate>>,
    may: &[bool],
    start: CommonNoise,
    sight: Option<&OnCentroids>,
) -> Result<Explored<'a>, CloseError> {
    let begun = Begun::by_frame(white, folds, candidates)?;
    Ok(
        match alone::without_slow(white, folds, begun, may, start, sight)? {
            Outcome::Settled(found) => Explored::White(found),
            Outcome::Elsewhere(to) => Explored::Elsewhere(to),
            Outcome::Open(begun) => {
                Explored::Coloured(Box::new(beside_slow(white, folds, *begun, may, start)?))
            }
        },
    )
}

impl Wander {
    /// Of what the `rotations` hold at their best `noise`.
    fn of(rotations: Rotations, noise: CommonNoise) -> Self {
        Self {
            noise,
            ratio: rotations.slow_ratio(&noise),
            alike: rotations.alike_ratio(&noise),
            rotations,
            behind: None,
        }
    }

    /// Axes on which the slow error is beyond doubt: by themselves, or X and Y together.
    pub(crate) fn axes(&self) -> [bool; 3] {
        let both = chance(self.alike) < FAMILY_ALPHA;
        std::array::from_fn(|axis| {
            let alone = chance(self.ratio[axis]) < FAMILY_ALPHA;
            // of the two, those whose own slow part earns its keep (Akaike)
            alone || both && axis < 2 && self.ratio[axis] > 4.0
        })
    }

    /// What it gains about all axes.
    pub(crate) fn nats(&self) -> f64 {
        0.5 * self.ratio.iter().sum::<f64>()
    }

    /// Chance of the likeliest of these where the noise is white.
    pub(crate) fn p_value(&self) -> f64 {
        let all = self.ratio.iter().copied().chain([self.alike]);
        chance(all.fold(0.0, f64::max)).min(1.0)
    }
}

/// Chance of such a ratio of two parameters where the noise is white: three axes are tried, and X and Y
/// together.
fn chance(ratio: f64) -> f64 {
    4.0 * ChiSquared::new(2.0).map_or(1.0, |law| law.sf(ratio.max(0.0) / WIDENING))
}
