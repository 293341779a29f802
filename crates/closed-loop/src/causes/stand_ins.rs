//! Effects that stand in for a cause outside the catalogue.
//!
//! A residual that follows variables for a reason that nobody listed is fitted best by
//! these. Effects of the catalogue take some of it: a pile of shifted stars in place of a
//! slope in magnitude, a distortion in place of charge left behind. So once effects are
//! chosen, each of them, each pile of one kind, and all together are held against the best
//! description by up to three terms ([`crate::search::empirical`]), term after term,
//!
//! ```text
//! worth(set) = (L(rest + set) - L(rest)) / m - k/2 ln n - ln c     L: log-likelihood out of fold
//! ```
//!
//! with m how many times white noise makes the gain of a set too large that turns whole frames
//! (noise of the reference is theirs, too). A set that a description beats by far is not named:
//! it is said what the leftover follows. A term holds the effects that act through its variable
//! as special cases with more parameters, so that it does not beat an effect that does act.
//!
//! Both pay for their k columns and for the c among which each of their parts was looked for: two
//! misplaced stars are two choices of many, one slope is one. A description takes the columns
//! that it needs, one axis of three, say, and pays for having picked them: so the set pays for no more either,
//! and is judged at its best part.
//!
//! What is left beside a set has a description, too. Where the set gains beside that one nearly all that it gained
//! alone, it is no part of what is described, and the two are held against the description of all:
//! of an effect of 10 sigma beside a cause of 30 that no effect explains the terms describe the cause.
//!
//! What a channel bends and stretches is two effects, and one term of that channel: for what it spares by that it is
//! not likelier.
//!
//! A star or a pixel is not named where a slope in what the catalogue says of stars explains the same, whatever each was
//! looked for among: there are as many stars as places on a slope. Where that slope is nearly that star
//! ([`super::one_star`]) it has to be worth far more.
//!
//! A line that the motion describes nearly as well is the motion's: of all frequencies it would have come
//! upon that at which the tracker moves. An orbit that no channel tells takes the shape of whatever is slow: one
//! that channels describe nearly as well is theirs, and one that nature does not have is the time's.
//!
//! Source: Schwarz 1978 for the price of a parameter.

use block_regression::{Estimate, Fits};
use statrs::function::factorial::ln_binomial;

use crate::causes::REMAINDER;
use crate::causes::description::{Described, Part};
use crate::search::empirical::Empirical;
use crate::search::orbits::OWN_SHAPE;
use crate::search::selection::{FAMILY_ALPHA, columns_of, each};
use crate::search::without;

/// Nats by which a description must be worth more.
pub(crate) const BY_FAR: f64 = 4.0;
/// The effect that a periodic motion may be taken for.
const LINE: &str = "periodic_misalignment";
/// What may be on one star in place of a slope.
const OF_ONE: [&str; 2] = ["catalogue_position", "hot_pixel"];
/// Nats by which a slope that is nearly one star, or what is no slope at all, must be worth more than that star.
const OF_THAT_STAR: f64 = 10.0;
/// Terms of a description.
const MOST_TERMS: usize = 3;
/// Nats that a further term must be worth.
const WORTH: f64 = 3.0;

/// Share of its gain that an effect has beside the description of another cause: all that is not next to nothing.
const APART: f64 = 1.0 - REMAINDER;

/// What is known of chosen effects beside their columns.
pub(crate) struct Known<'a> {
    /// Whether it is an orbit that nature does not have.
    pub(crate) is_no_orbit: &'a dyn Fn(usize) -> bool,
    /// Whether this slope is nothing but the star that it is of.
    pub(crate) one_star: &'a dyn Fn(usize, &Part) -> bool,
}

/// The chosen set (positions among the chosen) that a description beats by most, if one
/// does, and that description; what `agreed` holds of counts for the set.
pub(crate) fn stand_ins(
    described: &Described,
    agreed: &dyn Fn(&[usize], &[Part]) -> bool,
    known: &Known<'_>,
) -> Option<(Vec<usize>, Vec<Part>)> {
    let groups = &described.fitted.groups;
    let looked = described.looked();
    let mut most = None;
    let mut by = 0.0;
    // those that are beaten by themselves, but by no more than constants of the stars
    let mut excused: Vec<usize> = Vec::new();
    for set in sets(described) {
        // what beats one of them says nothing against others
        if !of_a_kind(described, &set) && set.iter().any(|k| excused.contains(k)) {
            continue;
        }
        let rest = columns_of(groups, &without(&described.chosen, &set));
        let Some(times) = too_large(described, &set, &rest) else {
            continue;
        };
        let Some((worth, parts)) = describe_at(described, &rest, times, &|_| true) else {
            continue;
        };
        let Some(own) = at_best(described, &set, &rest, times) else {
            continue;
        };
        let own = own + beside_the_rest(described, &set, &rest, times);
        let lines = set.iter().all(|&k| described.names[k] == LINE);
        let motion = |(k, _): &Part| described.terms[*k].term.is_of_motion();
        let free = set.iter().all(|&k| groups[k].slopes > 0);
        let channel = |(k, _): &Part| described.terms[*k].term.is_of_channel();
        let time = |(k, _): &Part| described.terms[*k].term.is_of_time();
        let own_shape = |parts: &[Part]| {
            let no_orbit = set.iter().all(|&k| (known.is_no_orbit)(k));
            parts
                .iter()
                .all(|part| channel(part) || no_orbit && time(part))
        };
        let star = set.iter().all(|&k| OF_ONE.contains(&described.names[k]));
        let slope = |(k, _): &Part| described.terms[*k].term.is_of_a_star();
        let that_star = |part: &Part| set.iter().any(|&k| (known.one_star)(k, part));
        let least = if lines && parts.iter().all(motion) {
            -BY_FAR
        } else if star && parts.iter().all(slope) && parts.iter().any(that_star) {
            OF_THAT_STAR
        } else if star && parts.iter().all(slope) {
            // what both pay for having been looked for
            let paid: f64 = set.iter().map(|&k| described.paid[k]).sum();
            paid - parts.len() as f64 * looked
        } else if star && set.len() == 1 {
            // a catalogue errs more often than a camera by halves of its detector
            OF_THAT_STAR
        } else if free && own_shape(&parts) {
            -OWN_SHAPE
        } else {
            BY_FAR + spared(described, &set, &parts) as f64 * looked
        };
        let beyond = worth - parts.len() as f64 * looked - own - least;
        if beyond <= 0.0 {
            continue;
        }
        if agreed(&set, &parts) {
            excused.extend(set);
        } else if beyond > by {
            by = beyond;
            most = Some((set, parts));
        }
    }
    most
}

/// How often a description pays for having been looked for where those of `set` pay once more: it has one term for all
/// that goes with a channel.
fn spared(described: &Described, set: &[usize], parts: &[Part]) -> usize {
    let of_one = |(k, _): &Part| {
        let Some(channel) = described.terms[*k].term.channel_name() else {
            return 0;
        };
        let own = set.iter().map(|&k| described.channels[k].as_deref());
        own.filter(|c| *c == Some(channel))
            .count()
            .saturating_sub(1)
    };
    parts.iter().map(of_one).sum()
}

/// What a description of what `set` leaves adds to its worth, where the set is something else: of what it gained
/// beside `rest` alone, it gains nearly all beside that description, too.
fn beside_the_rest(described: &Described, set: &[usize], rest: &[usize], times: f64) -> f64 {
    let fits = &described.fitted.fits;
    let part = columns_of(&described.fitted.groups, set);
    let with = [rest, &part].concat();
    let more = || {
        let (worth, parts) = describe_at(described, &with, times, &|_| true)?;
        let left: Vec<usize> = parts.iter().flat_map(|p| described.columns(p)).collect();
        let gain = |beside: &[usize]| {
            Some(likelihood(fits, beside, &part)? - likelihood(fits, beside, &[])?)
        };
        let apart = gain(&[rest, &left].concat())? > APART * gain(rest)?;
        let paid = parts.len() as f64 * described.looked();
        apart.then_some(worth - likelihood(fits, &with, &[])? - paid)
    };
    more().unwrap_or(0.0).max(0.0)
}

/// How many times white noise makes the gain of `set` beside `rest` too large, at least 1: where it
/// turns whole frames.
fn too_large(described: &Described, set: &[usize], rest: &[usize]) -> Option<f64> {
    if !set.iter().all(|&k| described.turns[k]) {
        return Some(1.0);
    }
    let part = columns_of(&described.fitted.groups, set);
    let (estimate, which) = beside(&described.fitted.fits, rest, &part)?;
    Some(estimate.excess(&which)?.max(1.0))
}

/// Likelihood of `rest` and the part of `set` that is worth most, gains over `times`, after its price: one that
/// is not worth what it pays is left out, so that it tells against none of the others.
fn at_best(described: &Described, set: &[usize], rest: &[usize], times: f64) -> Option<f64> {
    let fits = &described.fitted.fits;
    let price = Price::of(described, times);
    let base = likelihood(fits, rest, &[])?;
    let worth = |set: &[usize]| {
        let paid: f64 = set.iter().map(|&k| described.paid[k]).sum();
        let part = columns_of(&described.fitted.groups, set);
        let (likelihood, part) = needed(fits, rest, part, price)?;
        Some(base + price.worth(likelihood - base, part.len()) - paid)
    };
    let (best, _) = without_ballast(set.to_vec(), &worth, 0.0)?;
    Some(best)
}

/// `set` without those that are worth less than `price` after the other left out, and what is left of its `worth`.
fn without_ballast(
    mut set: Vec<usize>,
    worth: &dyn Fn(&[usize]) -> Option<f64>,
    price: f64,
) -> Option<(f64, Vec<usize>)> {
    let mut best = worth(&set)?;
    while set.len() > 1 {
        let fewer = (0..set.len()).filter_map(|at| {
            let mut less = set.clone();
            less.remove(at);
            Some((worth(&less)?, less))
        });
        match fewer.max_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((value, less)) if best - value < price => (best, set) = (value, less),
            _ => break,
        }
    }
    Some((best, set))
}

/// What columns pay.
#[derive(Clone, Copy)]
struct Price {
    /// By how much less gains count.
    times: f64,
    /// Of a column, nats.
    each: f64,
}

impl Price {
    fn of(described: &Described, times: f64) -> Self {
        Self {
            times,
            each: each(described.fitted.scalars),
        }
    }

    /// What is left of `nats` that so many `columns` gain.
    fn worth(self, nats: f64, columns: usize) -> f64 {
        nats / self.times - self.each * columns as f64
    }
}

/// The columns of `part` that are needed beside `rest`, and the likelihood with them.
fn needed(
    fits: &Fits,
    rest: &[usize],
    part: Vec<usize>,
    price: Price,
) -> Option<(f64, Vec<usize>)> {
    let likely = |part: &[usize]| likelihood(fits, rest, part);
    without_ballast(part, &likely, price.times * price.each)
}

/// The term of a description that is worth most: by how much, and the likelihood with it.
struct Best<'a> {
    more: f64,
    likelihood: f64,
    term: usize,
    part: &'a [usize],
}

/// Likelihood of `rest` and `part` out of fold.
fn likelihood(fits: &Fits, rest: &[usize], part: &[usize]) -> Option<f64> {
    let with = [rest, part].concat();
    Some(fits.out_of_fold(&with)?.total_loglik())
}

/// The estimate of `rest` and `part`, and which of it are the part.
fn beside(fits: &Fits, rest: &[usize], part: &[usize]) -> Option<(Estimate, Vec<usize>)> {
    let with = [rest, part].concat();
    Some((fits.estimate(&with)?, (rest.len()..with.len()).collect()))
}

/// The best description of what `rest` leaves: its likelihood after all prices.
pub(crate) fn describe(described: &Described, rest: &[usize]) -> Option<(f64, Vec<Part>)> {
    describe_at(described, rest, 1.0, &|_| true)
}

/// The same of those terms that `may` be taken.
pub(super) fn describe_with(
    described: &Described,
    rest: &[usize],
    may: &dyn Fn(&Empirical) -> bool,
) -> Option<(f64, Vec<Part>)> {
    describe_at(described, rest, 1.0, may)
}

/// The same where gains count by `times` less.
fn describe_at(
    described: &Described,
    rest: &[usize],
    times: f64,
    may: &dyn Fn(&Empirical) -> bool,
) -> Option<(f64, Vec<Part>)> {
    let fits = &described.fitted.fits;
    let price = Price::of(described, times);
    let tried = described.tried();
    let mut with = rest.to_vec();
    let mut base = likelihood(fits, rest, &[])?;
    let mut worth = base;
    let mut parts = Vec::new();
    while parts.len() < MOST_TERMS {
        let mut best: Option<Best<'_>> = None;
        let open = described.terms.iter().enumerate();
        for (k, term) in open.filter(|(_, term)| may(&term.term)) {
            for part in &term.parts {
                if part.iter().any(|c| with.contains(c)) {
                    continue;
                }
                let Some(likelihood) = likelihood(fits, &with, part) else {
                    continue;
                };
                // what is in the description already has been paid for
                let scanned = term.term.scanned();
                let more = price.worth(likelihood - base, part.len()) - scanned;
                let certain = || {
                    beside(fits, &with, part).is_some_and(|(e, which)| {
                        e.p_value(&which) * (tried as f64) * scanned.exp() < FAMILY_ALPHA
                            && term.group.believes(part, &e, with.len())
                    })
                };
                if more > WORTH && best.as_ref().is_none_or(|best| more > best.more) && certain() {
                    best = Some(Best {
                        more,
                        likelihood,
                        term: k,
                        part,
                    });
                }
            }
        }
        let Some(best) = best else { break };
        let mut more = best.more;
        let (mut likelihood, mut part) = (best.likelihood, best.part.to_vec());
        // a star is one place
        if !described.terms[best.term].term.is_of_many() {
            let (its, fewer) = needed(fits, &with, part.clone(), price)?;
            let picked = ln_binomial(part.len() as u64, fewer.len() as u64);
            let scanned = described.terms[best.term].term.scanned();
            let worth = price.worth(its - base, fewer.len()) - picked - scanned;
            if worth > more {
                (more, likelihood, part) = (worth, its, fewer);
            }
        }
        worth += more;
        base = likelihood;
        let first = described.terms[best.term].first;
        parts.push((best.term, part.iter().map(|c| c - first).collect()));
        with.extend(part);
    }
    (!parts.is_empty()).then_some((worth, parts))
}

fn of_a_kind(described: &Described, set: &[usize]) -> bool {
    set.windows(2)
        .all(|pair| described.names[pair[0]] == described.names[pair[1]])
}

/// Each effect, each pile of one kind, and all.
fn sets(described: &Described) -> Vec<Vec<usize>> {
    let chosen = &described.chosen;
    let mut sets: Vec<Vec<usize>> = chosen.iter().map(|&g| vec![g]).collect();
    for &g in chosen {
        let pile: Vec<usize> = chosen
            .iter()
            .copied()
            .filter(|&c| described.names[c] == described.names[g])
            .collect();
        if pile.len() > 1 && !sets.contains(&pile) {
            sets.push(pile);
        }
    }
    if chosen.len() > 1 && !sets.contains(chosen) {
        sets.push(chosen.clone());
    }
    sets
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drift of 59 nats beside a misplaced star of 2 that pays 11 for having been looked for: together they would be
    /// worth less than the drift alone, and a description of it that is worth 5 more than both would refuse it.
    #[test]
    fn what_is_not_worth_its_price_tells_against_no_other() {
        let each = [59.0, 2.0 - 11.0, -1.0];
        let worth = |set: &[usize]| Some(set.iter().map(|&k| each[k]).sum());
        let of = |set: &[usize]| {
            let left = without_ballast(set.to_vec(), &worth, 0.0);
            left.map_or(f64::NAN, |(worth, _)| worth)
        };
        assert!((of(&[0, 1]) - 59.0).abs() < 1e-12);
        assert!((of(&[2, 1, 0]) - 59.0).abs() < 1e-12);
        // one is left, whatever it is worth
        assert!((of(&[1]) + 9.0).abs() < 1e-12);
    }
}
