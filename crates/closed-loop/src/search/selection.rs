//! Which effects the data supports: forward selection out of fold.
//!
//! Every candidate group is tried beside those already chosen. It is eligible
//! if its out-of-fold log-likelihood gain is positive and its p-value, times what
//! the search costs it, is below [`FAMILY_ALPHA`]. The whole search is paid for:
//! of `n_k` groups of each kind k one pays
//!
//! ```text
//! sqrt(n_k) sum over kinds j of sqrt(n_j)
//! ```
//!
//! whose inverses add up to 1 (weighted Bonferroni). That is between paying by
//! groups, with which a scale of one column would pay for hundreds of warm
//! pixels, and by kinds, with which these would pay alone. A group that was picked by
//! looking at the data (the best line of a spectrum) counts for all that it was picked
//! from, as if each of them had been tried.
//!
//! Of the eligible ones the largest gain after a price per parameter wins, so that a
//! flexible wrong effect does not beat a stiff right one:
//!
//! ```text
//! rank = delta loglik - (p/2) ln n
//! ```
//!
//! A group whose estimate is of a size that nature does not make is not eligible:
//! its columns are a proxy for something else.
//!
//! After each addition all chosen groups are judged again beside the others and
//! those that no longer stand are dropped. Where none stands, two are tried at once: an effect that is left
//! out scatters from block to block as coloured noise does, so that each of two large ones may hide the
//! other. Tried are those that white noise would let stand; each must stand beside the other. And where nothing
//! more stands, other forms of what was chosen are tried, alone and with one more: of a step and a ramp the best
//! single step is neither, and beside it the ramp is nothing. Others are tried in the place of one, too: two, for what lies
//! between two effects takes most of both, and leaves either too little to stand beside it; and one, whose poor form
//! may have been dropped for it.
//!
//! Source: Schwarz 1978 for the price of a parameter; Genovese, Roeder & Wasserman 2006
//! for weights of p-values.

use std::collections::BTreeMap;
use std::ops::Range;

use block_regression::{Fits, OutOfFold};
use rayon::prelude::*;

use super::group::{Group, open_beside};
use super::misplaced::{piled, stars_of};
use super::without;

#[cfg(test)]
mod tests;

/// Chance that a bundle which follows its model gets any effect at all.
pub(crate) const FAMILY_ALPHA: f64 = 0.01;
/// The ratio statistic of a noise model that is only nearly right runs this much
/// wider than chi-squared (red-noise nulls: rms t of 1.13).
pub(crate) const WIDENING: f64 = 1.3;
/// What a slow error of an axis pays for its size and correlation time, nats: a size is
/// known to a fifth and a time to a factor of two, within the decades that they may have.
pub(crate) const SLOW_PRICE: f64 = 4.0;

/// One group's standing beside the chosen ones.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Judgement {
    /// Gain in out-of-fold log-likelihood, nats.
    pub(crate) delta_loglik: f64,
    /// Times what the search costs the group, at most 1.
    pub(crate) p_value: f64,
    /// The amplitudes are of a size that nature makes.
    pub(crate) credible: bool,
    /// The columns can be told from the nuisance and from the chosen.
    pub(crate) observable: bool,
}

impl Judgement {
    /// Nothing can be said of it.
    pub(crate) const UNSEEN: Self = Self {
        delta_loglik: 0.0,
        p_value: 1.0,
        credible: false,
        observable: false,
    };

    /// It may be claimed.
    pub(crate) fn stands(&self) -> bool {
        self.credible && self.stands_but_for_size()
    }

    /// It might be, were it of a size that nature makes.
    pub(crate) fn stands_but_for_size(&self) -> bool {
        self.observable && self.delta_loglik > 0.0 && self.p_value < FAMILY_ALPHA
    }
}

/// How many of those that white noise would let stand are tried two by two.
const HIDDEN: usize = 6;
/// How many sets with other forms of what was chosen are judged, of those that fit better.
const BETTER: usize = 24;
/// How many families, the best first, are tried two by two in the place of one.
const IN_ITS_PLACE: usize = 24;
/// How often forms are exchanged, and what that has to be worth, nats.
const EXCHANGES: usize = 4;
const WORTH_IT: f64 = 0.5;

/// The outcome of the search.
#[derive(Clone, Debug)]
pub(crate) struct Selection {
    /// Indices of groups in the order added.
    pub(crate) chosen: Vec<usize>,
    /// Standing of every group beside (for a chosen one: within) the final set.
    pub(crate) judged: Vec<Judgement>,
}

/// All candidate columns of `chosen`, in order.
pub(crate) fn columns_of(groups: &[Group], chosen: &[usize]) -> Vec<usize> {
    chosen
        .iter()
        .flat_map(|&g| groups[g].columns.iter().copied())
        .collect()
}

/// What the p-value of each group is multiplied by where those that `may` be chosen are tried: of n groups of its kind
/// and credit c, sqrt(n)/c times the sum of c sqrt(n) over all kinds. The inverses add up to 1.
pub(crate) fn costs(groups: &[Group], may: &[bool]) -> Vec<f64> {
    let kind = |g: &Group| (g.kind, g.credit.to_bits());
    let mut of_kind: BTreeMap<(&str, u64), f64> = BTreeMap::new();
    let tried = groups.iter().zip(may);
    for (group, _) in tried.filter(|(g, may)| **may && !g.columns.is_empty()) {
        *of_kind.entry(kind(group)).or_default() += group.stands_for;
    }
    let all: f64 = of_kind
        .iter()
        .map(|((_, credit), n)| f64::from_bits(*credit) * n.sqrt())
        .sum();
    let root = |g: &Group| of_kind.get(&kind(g)).map_or(1.0, |n| n.sqrt() / g.credit);
    groups.iter().map(|g| root(g) * all.max(1.0)).collect()
}

/// What a group pays for its sizes and choices, nats.
pub(crate) fn price(group: &Group, scalars: f64) -> f64 {
    let sizes = group.columns.len().saturating_sub(group.slopes);
    (sizes + group.choices) as f64 * each(scalars)
}

/// The chance of a group's columns: of `all`, or of the so many that act `across` the boresight, whichever is less,
/// for two that were looked at. Where a group is not so divided, of all.
pub(crate) fn or_across(all: f64, across: impl FnOnce() -> f64, columns: usize) -> f64 {
    if columns == 0 {
        return all;
    }
    2.0 * all.min(across())
}

/// What a parameter costs, nats.
pub(crate) fn each(scalars: f64) -> f64 {
    0.5 * scalars.max(2.0).ln()
}

/// A group that was tried beside the chosen ones.
pub(crate) struct Tried {
    pub(crate) group: usize,
    pub(crate) judgement: Judgement,
    /// Its p-value if the noise were white, times what the search costs it.
    white: f64,
    /// Gain after its price, nats.
    rank: f64,
}

/// What groups are tried on.
#[derive(Clone, Copy)]
pub(crate) struct Trials<'a> {
    pub(crate) fits: &'a Fits,
    pub(crate) groups: &'a [Group],
    /// What each pays for the search ([`costs`]).
    pub(crate) cost: &'a [f64],
    /// Independent scalars in the data.
    pub(crate) scalars: f64,
}

impl Trials<'_> {
    /// Runs the search: groups that `may` be chosen are added while one stands, each at its `cost`. In the order added.
    pub(crate) fn choose(&self, may: &[bool]) -> Vec<usize> {
        let mut chosen: Vec<usize> = Vec::new();
        // Each round adds one or stops; a group dropped by the backward check may
        // not return, so the search ends.
        let mut may = may.to_vec();
        let mut exchanges = EXCHANGES;
        let stars = stars_of(self.groups);
        loop {
            let tried = self.tried(&may, &chosen);
            let added = match tried.iter().find(|t| t.judgement.stands()) {
                Some(best) => vec![best.group],
                None => self.hidden(&tried, &chosen),
            };
            if !added.is_empty() {
                chosen.extend(added);
                self.prune(&mut chosen, &mut may);
                if piled(self.groups, &chosen, stars) {
                    break;
                }
                continue;
            }
            let better = (exchanges > 0).then(|| self.exchanged(&may, &chosen));
            let Some(better) = better.flatten() else {
                break;
            };
            exchanges -= 1;
            chosen = better;
        }
        chosen
    }

    /// All groups that may be tried beside `chosen` and gain out of fold, the largest gain after the price of
    /// their parameters and choices first.
    pub(crate) fn tried(&self, may: &[bool], chosen: &[usize]) -> Vec<Tried> {
        let Some(base) = self.out_of_fold(chosen) else {
            return Vec::new();
        };
        let groups = self.groups;
        self.fits.ask_all();
        let mut tried: Vec<Tried> = (0..groups.len())
            .into_par_iter()
            .filter(|&g| may[g] && !chosen.contains(&g))
            .filter(|&g| open_beside(groups, chosen, g))
            .filter_map(|g| {
                // what gains nothing cannot stand, whatever its errors
                let gain = self.gain(chosen, g, &base).filter(|gain| *gain > 0.0)?;
                let (judgement, white) = self.standing(chosen, g, gain)?;
                Some(Tried {
                    group: g,
                    rank: judgement.delta_loglik - price(&groups[g], self.scalars),
                    judgement,
                    white,
                })
            })
            .collect();
        tried.sort_by(|a, b| b.rank.total_cmp(&a.rank));
        tried
    }

    /// The two groups that gain most together where each stands beside the other, though of those `tried` none
    /// does alone; or none.
    fn hidden(&self, tried: &[Tried], chosen: &[usize]) -> Vec<usize> {
        let alone = tried.iter().filter(|t| t.white < FAMILY_ALPHA);
        let alone: Vec<&Tried> = alone.take(HIDDEN).collect();
        let mut best = (0.0, Vec::new());
        for (i, a) in alone.iter().enumerate() {
            for b in &alone[i + 1..] {
                if self.groups[a.group].excludes(&self.groups[b.group]) {
                    continue;
                }
                let pair = [a.group, b.group];
                let set = [chosen, &pair].concat();
                let within = |g| self.within(&set, g).filter(Judgement::stands);
                let Some(second) = within(b.group) else {
                    continue;
                };
                let price = price(&self.groups[b.group], self.scalars);
                let both = a.rank + second.delta_loglik - price;
                if both > best.0 && within(a.group).is_some() {
                    best = (both, pair.to_vec());
                }
            }
        }
        best.1
    }

    /// `chosen` with one of them in another form, and perhaps one more, or two in the place of one, where that
    /// gains more after its price and each stands beside the others; the best of these.
    fn exchanged(&self, may: &[bool], chosen: &[usize]) -> Option<Vec<usize>> {
        let groups = self.groups;
        let open = |g: &usize| may[*g] && !groups[*g].columns.is_empty();
        let all: Vec<usize> = (0..groups.len()).filter(open).collect();
        let family = |g: usize| groups[g].family.as_str();
        let mut swapped: Vec<Vec<usize>> = Vec::new();
        for (at, &g) in chosen.iter().enumerate() {
            let others = without(chosen, &[g]);
            let form = |c: usize| c != g && family(c) == family(g);
            let forms = all
                .iter()
                .filter(|&&c| form(c) && open_beside(groups, &others, c));
            swapped.extend(forms.map(|&form| {
                let mut set = chosen.to_vec();
                set[at] = form;
                set
            }));
        }
        // in sample first, which costs little
        let now = self.fit(chosen)?;
        let mut better: Vec<(f64, Vec<usize>)> = swapped
            .into_par_iter()
            .flat_map_iter(|set| {
                let other = |h: &&usize| open_beside(groups, &set, **h);
                let more = all.iter().filter(other).map(|&h| [&set[..], &[h]].concat());
                let sets = std::iter::once(set.clone()).chain(more);
                let fits = sets.filter_map(|set| Some((self.fit(&set)?, set)));
                fits.filter(|(fit, _)| *fit > now + WORTH_IT)
                    .collect::<Vec<_>>()
            })
            .collect();
        better.extend(self.others_for_one(&all, chosen, now + WORTH_IT));
        better.sort_by(|a, b| b.0.total_cmp(&a.0));
        better.truncate(BETTER);
        let now = self.worth(chosen)? + WORTH_IT;
        let stands = |set: &[usize]| {
            let stands = |&g: &usize| self.within(set, g).is_some_and(|j| j.stands());
            set.iter().all(stands)
        };
        better
            .into_iter()
            .filter_map(|(_, set)| Some((self.worth(&set)?, set)))
            .filter(|(worth, set)| *worth > now && stands(set))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, set)| set)
    }

    /// Another, or two, of `all` in the place of one of `chosen`, each the form of its family that fits best there, where they
    /// fit better than `now`.
    fn others_for_one(&self, all: &[usize], chosen: &[usize], now: f64) -> Vec<(f64, Vec<usize>)> {
        let mut out = Vec::new();
        for &g in chosen {
            let others = without(chosen, &[g]);
            let mut best = self.best_of_families(&others, all, |h| h != g);
            best.sort_by(|a, b| b.0.total_cmp(&a.0));
            best.truncate(IN_ITS_PLACE);
            // another alone, too: what was dropped for this one may have been a poor form of it
            let one = best.iter().filter(|(fit, _)| *fit > now);
            out.extend(one.map(|&(fit, h)| (fit, [&others[..], &[h]].concat())));
            let pairs = best.iter().enumerate();
            let pairs = pairs.flat_map(|(i, a)| best[i + 1..].iter().map(|b| [a.1, b.1]));
            let sets: Vec<Vec<usize>> = pairs.map(|pair| [&others[..], &pair].concat()).collect();
            let fits = sets
                .into_par_iter()
                .filter_map(|set| Some((self.fit(&set)?, set)));
            out.extend(fits.filter(|(fit, _)| *fit > now).collect::<Vec<_>>());
        }
        out
    }

    /// Of each family of `all` that `may` be chosen the group that fits best beside `others`, behind what it fits.
    pub(crate) fn best_of_families(
        &self,
        others: &[usize],
        all: &[usize],
        may: impl Fn(usize) -> bool + Sync,
    ) -> Vec<(f64, usize)> {
        let each: Vec<(f64, usize)> = all
            .par_iter()
            .filter(|&&g| may(g) && open_beside(self.groups, others, g))
            .filter_map(|&g| Some((self.fit(&[others, &[g]].concat())?, g)))
            .collect();
        let mut best: BTreeMap<&str, (f64, usize)> = BTreeMap::new();
        for (fit, g) in each {
            let known = best.entry(&self.groups[g].family).or_insert((fit, g));
            if fit > known.0 {
                *known = (fit, g);
            }
        }
        best.into_values().collect()
    }

    /// Log-likelihood in sample less the price of all parameters and choices, up to a constant.
    pub(crate) fn fit(&self, set: &[usize]) -> Option<f64> {
        let variance = self.fits.variance(&columns_of(self.groups, set))?;
        Some(-0.5 * self.scalars * variance.ln() - self.paid(set))
    }

    fn paid(&self, set: &[usize]) -> f64 {
        let each = set.iter().map(|&g| price(&self.groups[g], self.scalars));
        each.sum()
    }

    /// Log-likelihood out of fold less the price of all parameters and choices.
    pub(crate) fn worth(&self, set: &[usize]) -> Option<f64> {
        Some(self.out_of_fold(set)?.total_loglik() - self.paid(set))
    }

    /// Standing of every group beside (for a chosen one: within) `chosen`.
    pub(crate) fn judged(&self, chosen: &[usize]) -> Vec<Judgement> {
        let base = self.out_of_fold(chosen);
        let beside = |g| {
            let gain = self.gain(chosen, g, base.as_ref()?)?;
            Some(self.standing(chosen, g, gain)?.0)
        };
        self.fits.ask_all();
        let judge = |g| {
            if chosen.contains(&g) {
                self.within(chosen, g)
            } else {
                beside(g)
            }
        };
        let all = (0..self.groups.len()).into_par_iter();
        all.map(|g| judge(g).unwrap_or(Judgement::UNSEEN)).collect()
    }

    /// Drops chosen groups that no longer stand beside the others, and may not be chosen again.
    fn prune(&self, chosen: &mut Vec<usize>, may: &mut [bool]) {
        loop {
            let falls = |&g: &usize| self.within(chosen, g).is_some_and(|j| !j.stands());
            let fallen = chosen.iter().copied().find(falls);
            let Some(g) = fallen else { return };
            may[g] = false;
            chosen.retain(|&c| c != g);
        }
    }

    fn out_of_fold(&self, chosen: &[usize]) -> Option<OutOfFold> {
        self.fits.out_of_fold(&columns_of(self.groups, chosen))
    }

    /// Standing of a group of `set` beside the others; `None` if these cannot be told apart.
    pub(crate) fn within(&self, set: &[usize], g: usize) -> Option<Judgement> {
        let others = without(set, &[g]);
        let base = self.out_of_fold(&others)?;
        let gain = self.gain(&others, g, &base);
        let standing = gain.and_then(|gain| self.standing(&others, g, gain));
        Some(standing.map_or(Judgement::UNSEEN, |(judgement, _)| judgement))
    }

    /// The p-value of a group beside `others` if the noise were white, times what the search costs it: none that stands
    /// has more. `None` if it cannot be told from them.
    pub(crate) fn white_chance(&self, others: &[usize], g: usize) -> Option<f64> {
        Some(self.standing(others, g, 0.0)?.1)
    }

    /// What a group adds to the log-likelihood out of fold of `others`, which is `base`.
    fn gain(&self, others: &[usize], g: usize, base: &OutOfFold) -> Option<f64> {
        let (set, _) = self.beside(others, g)?;
        Some(self.fits.out_of_fold(&set)?.total_loglik() - base.total_loglik())
    }

    /// Standing of a group with this `gain` beside `others`, and its p-value if the noise were white; `None` if it
    /// cannot be told from them.
    fn standing(&self, others: &[usize], g: usize, gain: f64) -> Option<(Judgement, f64)> {
        let (set, own) = self.beside(others, g)?;
        let which: Vec<usize> = own.clone().collect();
        let estimate = self.fits.estimate(&set)?;
        let group = &self.groups[g];
        let across = &which[..group.across];
        let least = |p: &dyn Fn(&[usize]) -> f64| {
            self.cost[g] * or_across(p(&which), || p(across), across.len())
        };
        let judgement = Judgement {
            delta_loglik: gain,
            credible: group.believes(&group.columns, &estimate, own.start),
            p_value: least(&|which| estimate.p_value(which)).min(1.0),
            observable: true,
        };
        let white = least(&|which| estimate.white_p_value(which));
        Some((judgement, white))
    }

    /// Columns of `others` and of a group, and which of these are its own; `None` if it has none.
    fn beside(&self, others: &[usize], g: usize) -> Option<(Vec<usize>, Range<usize>)> {
        let mut set = columns_of(self.groups, others);
        let first = set.len();
        set.extend(&self.groups[g].columns);
        let own = first..set.len();
        (!own.is_empty()).then_some((set, own))
    }
}
