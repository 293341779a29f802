//! What a search found, described: what the questions are asked of.
//!
//! Not physics: what is known of an outcome.

use std::cell::OnceCell;

use block_regression::Estimate;

use crate::causes::description::{Described, InTwo, Part};
use crate::causes::invariance::{Change, changing};
use crate::causes::one_star::is_one_star;
use crate::causes::round::{Round, best_beside};
use crate::causes::so_far::SoFar;
use crate::causes::stand_ins::{Known, stand_ins};
use crate::causes::star_constants::Constants;
use crate::causes::{terms, wanders};
use crate::error::CloseError;
use crate::search::empirical::Empirical;
use crate::search::orbits::has_no_speed;
use crate::search::refusal::{Refusal, for_own_path};
use crate::search::selection::columns_of;

/// An outcome that may be spoken against.
pub(super) struct Case<'r, 'a> {
    pub(super) round: &'r Round<'r, 'a>,
    pub(super) constants: Option<Constants<'r>>,
    pub(super) described: Described,
    /// The same under white noise, where the stars may follow something in the place of a slow error of the reference.
    pub(super) plain: Option<Described>,
    /// Terms that stand where what is left has them.
    pub(super) sought: Vec<Empirical>,
    /// Of the chosen, once it was asked for.
    estimate: OnceCell<Option<Estimate>>,
}

impl<'r, 'a> Case<'r, 'a> {
    /// The outcome of `round`, described.
    pub(super) fn of(
        round: &'r Round<'r, 'a>,
        inside: Option<&'r [Vec<f64>]>,
        so_far: &mut SoFar,
    ) -> Result<Self, CloseError> {
        let (inquiry, level, found) = (round.inquiry, round.level(), &round.searched.found);
        // what an orbit that is too fast is held against
        let turns = so_far.found_terms.iter().any(Empirical::turns_to_and_fro);
        if !turns && (0..found.selection.chosen.len()).any(|k| round.is_too_fast(k)) {
            so_far.found_terms.extend(terms::turning(level.data));
        }
        let wander = round.searched.wander.as_ref();
        let all = (inquiry.terms)();
        let is_usual = |term: &Empirical| inquiry.describes(term, wander.is_some());
        let usual: Vec<Empirical> = all.iter().filter(|t| is_usual(t)).cloned().collect();
        let sought = inside.map_or_else(Vec::new, |inside| terms::sought(level, inside, &usual));
        // what follows the path with its error takes the place of that error, and is asked along one without it
        let instead = wander.filter(|_| !round.last && !for_own_path(&so_far.refused));
        let (folds, ways) = (round.folds, inquiry.ways);
        let (described, plain) = if let Some(wander) = instead {
            let frames = wanders::terms(level.data, wander, inside, &level.weight);
            let all = all.into_iter().map(|term| InTwo {
                is_in: [is_usual(&term), true],
                term,
            });
            let terms = in_two(all, &sought, &so_far.found_terms, frames);
            let [described, plain] =
                Described::twice(level, &round.beside, folds, found, terms, ways)?;
            (described, Some(plain))
        } else {
            let terms = so_far.with_found(usual, &sought);
            let described = Described::new(level, folds, found, terms, ways)?;
            (described, None)
        };
        Ok(Self {
            round,
            constants: Constants::of(level, found, inside),
            described,
            plain,
            sought,
            estimate: OnceCell::new(),
        })
    }

    /// Of the sought, channels by another form.
    pub(super) fn channel_forms(&self) -> impl Iterator<Item = &Empirical> {
        self.sought.iter().filter(|term| term.is_of_a_form())
    }

    /// What a description stands for, by its places among the chosen, and that description.
    pub(super) fn stand_in(&self) -> Option<(Vec<usize>, Vec<Part>)> {
        let agreed = |set: &[usize], instead: &[Part]| {
            let constants = self.constants.as_ref();
            constants.is_some_and(|constants| constants.say_as_much(&self.described, set, instead))
        };
        let known = Known {
            is_no_orbit: &|k| self.is_no_orbit(k),
            one_star: &|k, part| self.is_one_star(k, part),
        };
        stand_ins(&self.described, &agreed, &known)
    }

    /// The chosen effect that is not the same everywhere.
    pub(super) fn change(&self) -> Option<Change> {
        let instead = best_beside(&self.round.searched.found, &self.round.may);
        changing(&self.described, instead)
    }

    /// What describes what is left beside the chosen: constants of the stars are in no fit, and half a dozen of them
    /// follow any variable.
    pub(super) fn left(&self) -> Option<Vec<Part>> {
        let left = self.described.left()?;
        let left = match &self.constants {
            Some(constants) => constants.beyond(&self.described, left),
            None => left,
        };
        (!left.is_empty()).then_some(left)
    }

    /// What is spoken against by its places among the chosen, and why.
    pub(super) fn spoken_against(&self) -> Option<(Vec<usize>, Refusal)> {
        let stand_in = || Some((self.stand_in()?.0, Refusal::StandIn));
        let change = || {
            let change = self.change()?;
            Some((vec![change.chosen], Refusal::Change(change.way.name())))
        };
        let disputed = || {
            let constants = self.constants.as_ref()?;
            let disputed = constants.disputed(&self.round.paid());
            Some((disputed, Refusal::StarConstants))
        };
        stand_in().or_else(change).or_else(disputed)
    }

    /// Whether the effect in this place among the chosen is an orbit that nature does not have.
    fn is_no_orbit(&self, place: usize) -> bool {
        let found = &self.round.searched.found;
        let chosen = &found.selection.chosen;
        let first = columns_of(&found.fitted.groups, &chosen[..place]).len();
        let orbit = self.round.chosen(place);
        let told = self.estimate.get_or_init(|| found.estimate()).as_ref();
        self.round.is_too_fast(place) || told.is_some_and(|told| has_no_speed(orbit, told, first))
    }

    /// Whether this slope is nothing but the star that the effect in this place among the chosen is of.
    fn is_one_star(&self, place: usize, (term, columns): &Part) -> bool {
        let selectors = self.round.chosen(place).selectors();
        let id = selectors.get("star_id").and_then(|id| id.parse().ok());
        let slope = &self.described.terms[*term].term;
        let data = self.round.beside.data;
        id.is_some_and(|id| is_one_star(data, slope, columns, id))
    }
}

/// The terms of an outcome beside a slow error of the reference, and of the same under white noise: there frames may turn
/// with the time, and of what was `sought`, forms of channels alone take part.
fn in_two(
    usual: impl Iterator<Item = InTwo>,
    sought: &[Empirical],
    found: &[Empirical],
    frames: Vec<Empirical>,
) -> Vec<InTwo> {
    let sought = sought.iter().map(|term| InTwo {
        is_in: [true, term.is_of_a_form()],
        term: term.clone(),
    });
    let found = found.iter().map(|term| InTwo {
        is_in: [true, false],
        term: term.clone(),
    });
    let frames = frames.into_iter().map(|term| InTwo {
        is_in: [false, true],
        term,
    });
    usual.chain(sought).chain(found).chain(frames).collect()
}
