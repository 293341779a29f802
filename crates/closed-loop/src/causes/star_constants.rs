//! Whether stars that hardly move agree on an effect, or each errs by a constant of its own.
//!
//! Every star of a real camera errs by something of its own: what stands beside it, its spectrum, its place in the
//! catalogue. Where stars rest, that is known to a hundredth of a row's noise after some thousand frames, and whatever
//! gives each star a constant takes a part of it. No noise of rows speaks against that; the other stars do. So of the
//! mean errors of the stars, in units of what white noise leaves of them,
//!
//! ```text
//! h(Q, v) = v (1 + ln(Q/v)),  Q > v        -2 ln likelihood of v numbers of squares Q
//!           Q,                otherwise    if they scatter as is likeliest, by noise or more
//! gain    = (h(Q + q, v + k) - h(Q, v) - h(q, k) + W) / 2
//! ```
//!
//! of an effect of k columns that takes q of the squares and leaves Q of v numbers: by how much it is likelier that k of
//! them are an effect of any size than that all are draws of one law. W are the squares that it takes, with the size
//! that it has, from each star's rows beside their mean, where white noise counts. Effects that explain as many numbers
//! as there are gain nothing.
//!
//! Source: empirical Bayes by the largest likelihood of a variance (Efron and Morris 1973).

use nalgebra::DVector;
use telemetry::report::{Dependence, Unattributed};

use crate::causes::commonness::IN_TIME;
use crate::causes::description::{Described, Part};
use crate::causes::stand_ins::BY_FAR;
use crate::follows;
use crate::search::selection::columns_of;
use crate::search::{Found, without};
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use means::{Left, Means, Shift};

mod means;

/// Rows of a star from which its mean is known better than a row.
const LEAST_ROWS: usize = 5;
/// What each column pays for having been chosen, nats: it is there or not.
const CHOSEN: f64 = std::f64::consts::LN_2;
/// What constants pay that do not show in as many numbers as were explained, nats: as any kind of effect does.
const UNSEEN: f64 = 3.0;
/// Share of what an effect takes of the means of stars from which it shows beside them.
const BESIDE: f64 = 0.1;
/// Parts of a variable whose columns are held at once.
const TOGETHER: usize = 8;
/// Name in the report.
const STAR: &str = "star";
const SLOT: &str = "slot";

/// What was chosen, and what it leaves of resting stars.
pub(crate) struct Constants<'a> {
    level: &'a StarEvidence<'a>,
    found: &'a Found,
    /// Estimates of the chosen, in the order of their columns.
    values: DVector<f64>,
    left: Left<'a>,
}

impl<'a> Constants<'a> {
    /// `inside`: what is left in sample, arcsec. `None` where stars were not seen often enough for their means to say
    /// more than rows do, or their places are unknown.
    pub(crate) fn of(
        level: &'a StarEvidence<'a>,
        found: &'a Found,
        inside: Option<&'a [Vec<f64>]>,
    ) -> Option<Self> {
        let data: &StarData = level.data;
        let told = !data.free_directions && data.t_s.len() >= LEAST_ROWS * data.stars.len();
        let inside = inside.filter(|_| told)?;
        let set = columns_of(&found.fitted.groups, &found.selection.chosen);
        let values = found.fitted.fits.estimate(&set)?.value;
        let fits = &found.fitted.fits;
        let distorted = level.nuisance.distorted();
        let distortion = fits.nuisance(None, &set, &values).select_rows(&distorted);
        // beside noise that frames share, with what their rotations say of it, which is next to nothing
        let of_all = fits.nuisance_gram().select_rows(&distorted);
        let told = of_all.select_columns(&distorted) * level.unit_arcsec2();
        Some(Self {
            level,
            found,
            values,
            left: Left {
                inside,
                distortion,
                told,
            },
        })
    }

    /// Places among the chosen of those that give stars constants, and what they do: what turns the camera does not, and
    /// of what acts on attitudes nothing is seen where the reference's noise turns every frame.
    fn shifting(&self) -> (Vec<usize>, Vec<Shift<'a>>) {
        let chosen = &self.found.selection.chosen;
        let (mut places, mut shifts) = (Vec::new(), Vec::new());
        let restless = !self.level.data.free_attitude && means::turns_freely(self.level);
        let mut values = self.values.iter().copied();
        for (place, &group) in chosen.iter().enumerate() {
            let candidate = self.found.candidates[group].as_ref();
            let columns = self.found.own_columns(group);
            let values = values.by_ref().take(columns.len()).collect();
            let turns = candidate.turns_camera() || restless && candidate.acts_on_attitude();
            if !turns {
                places.push(place);
                shifts.push(Shift {
                    candidate,
                    columns,
                    values,
                });
            }
        }
        (places, shifts)
    }

    /// Which of the chosen, by their places, the stars do not agree on; each pays so many nats.
    pub(crate) fn disputed(&self, paid: &[f64]) -> Vec<usize> {
        let (places, shifts) = self.shifting();
        if shifts.is_empty() {
            return Vec::new();
        }
        let means = Means::of(self.level, &shifts, &self.left);
        let mut standing: Vec<usize> = (0..shifts.len()).collect();
        let mut disputed = Vec::new();
        let margin = |beside: &[usize], of: &[usize]| {
            let each = of.iter();
            let paid = each.map(|&e| paid[places[e]] + price(&shifts[e].columns));
            let spared = if means.are_noise(beside) { UNSEEN } else { 0.0 };
            means.gain(beside, of) + spared - paid.sum::<f64>()
        };
        while !standing.is_empty() {
            let mut doubted = standing.clone();
            doubted.retain(|&e| margin(&standing, &[e]) < 0.0);
            if doubted.is_empty() {
                if margin(&standing, &standing) >= 0.0 {
                    break;
                }
                doubted.clone_from(&standing);
            }
            // where little is left of the stars all are doubted, and the one goes without which the rest is worth most; of
            // those alike the one that was added last
            let rest = |e: usize| {
                let rest = without(&standing, &[e]);
                margin(&rest, &rest)
            };
            let worst = doubted.into_iter().rev();
            let worst = worst.max_by(|&a, &b| rest(a).total_cmp(&rest(b)).then(a.cmp(&b)));
            let Some(worst) = worst else { break };
            standing.retain(|&e| e != worst);
            disputed.push(places[worst]);
        }
        disputed
    }

    /// Whether the description that explains more than `set`, places among the chosen, says no more of stars that rest
    /// than that each has a constant of its own: a dozen columns describe those of half a dozen stars, whatever these
    /// are. It then speaks against nothing; whether the stars agree on the set is asked of them
    /// ([`disputed`](Self::disputed)).
    pub(crate) fn say_as_much(
        &self,
        described: &Described,
        set: &[usize],
        instead: &[Part],
    ) -> bool {
        let (places, mut shifts) = self.shifting();
        let own: Vec<usize> = (0..places.len())
            .filter(|&e| set.contains(&places[e]))
            .collect();
        if own.len() < set.len() {
            return false;
        }
        let chosen: Vec<usize> = (0..shifts.len()).collect();
        shifts.extend(instead.iter().map(|part| term_of(described, part)));
        let means = Means::of(self.level, &shifts, &self.left);
        let terms: Vec<usize> = (chosen.len()..shifts.len()).collect();
        let price: f64 = terms.iter().map(|&e| price(&shifts[e].columns)).sum();
        let with = [without(&chosen, &own), terms.clone()].concat();
        let looked = described.looked() * instead.len() as f64;
        let worth = means.between(&with, &terms) - looked - price;
        let rests = means.beside(&own) < BESIDE * means.taken(&chosen, &own);
        rests && worth < 0.0
    }

    /// Those of `parts` that say more of the stars than that each has a constant of its own.
    pub(crate) fn beyond(&self, described: &Described, parts: Vec<Part>) -> Vec<Part> {
        let (_, mut shifts) = self.shifting();
        let chosen = shifts.len();
        shifts.extend(parts.iter().map(|part| term_of(described, part)));
        let means = Means::of(self.level, &shifts, &self.left);
        let standing: Vec<usize> = (0..chosen).collect();
        if means.scatter(&standing).is_none() {
            return parts;
        }
        let says = |at: usize| {
            let with = [standing.clone(), vec![chosen + at]].concat();
            let paid = described.looked() + price(&shifts[chosen + at].columns);
            means.gain(&with, &[chosen + at]) > paid
        };
        let says: Vec<bool> = (0..parts.len()).map(says).collect();
        let each = parts.into_iter().zip(says);
        each.filter(|(_, says)| *says)
            .map(|(part, _)| part)
            .collect()
    }

    /// Puts `star` where it belongs among what the leftover follows: before what gives the stars constants of which
    /// these hold no more than chance, if they have any. `left` is the share of the before variance that is left.
    pub(crate) fn tell(&self, described: &Described, left: f64, unattributed: &mut Unattributed) {
        if !unattributed.present {
            return;
        }
        let (_, chosen) = self.shifting();
        let standing: Vec<usize> = (0..chosen.len()).collect();
        let means = Means::of(self.level, &chosen, &self.left);
        let Some((mut share, p_value)) = means.scatter(&standing) else {
            return;
        };
        let paid = described.looked() + BY_FAR;
        let of = |parts: &[Part]| {
            let (_, mut shifts) = self.shifting();
            shifts.extend(parts.iter().map(|part| term_of(described, part)));
            let means = Means::of(self.level, &shifts, &self.left);
            let each = standing.len()..shifts.len();
            let judged = each.map(|own| {
                let with = [standing.as_slice(), &[own]].concat();
                let share = means.scatter(&with).map_or(0.0, |(share, _)| share);
                let gain = means.gain(&with, &[own]);
                // one slope that explains the same is before many stars
                let stands = gain > paid || gain > 0.0 && means.are_noise(&with);
                (stands, gain, share)
            });
            judged.collect::<Vec<_>>()
        };
        let (mut before, mut behind) = (Vec::new(), Vec::new());
        let mut entries = std::mem::take(&mut unattributed.depends_on);
        // rows hardly pay for all slots: fewer numbers than stars may hold all that these hold
        let slots = described.parts_of(SLOT);
        let slots = slots.into_iter().max_by_key(|(_, columns)| columns.len());
        let slots = slots.and_then(|all| of(&[all]).pop());
        if let Some((true, _, own)) = slots.filter(|(_, _, own)| share > 2.0 * own) {
            entries.retain(|e| e.variable != SLOT);
            before.push(Dependence {
                variable: SLOT.to_owned(),
                variance_explained: share - own,
                p_value,
            });
            share = own;
        }
        for entry in entries {
            if entry.variable == STAR || entry.variable == IN_TIME {
                continue;
            }
            let parts = described.parts_of(&entry.variable);
            let gains = parts.chunks(TOGETHER).flat_map(of);
            let best = gains.max_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            let (stands, own) = best.map_or((true, share), |(stands, _, own)| (stands, own));
            if stands && entry.variance_explained > own {
                share = own;
                before.push(entry);
            } else {
                behind.push(entry);
            }
        }
        before.push(Dependence {
            variable: STAR.to_owned(),
            variance_explained: share,
            p_value,
        });
        before.extend(behind);
        unattributed.variance_fraction = Some(left * follows::largest(&before));
        unattributed.depends_on = before;
    }
}

/// What columns pay for having been chosen, nats.
fn price(columns: &[usize]) -> f64 {
    columns.len() as f64 * CHOSEN
}

/// A part of a description, of which nothing is in the fit.
fn term_of<'a>(described: &'a Described, (term, columns): &Part) -> Shift<'a> {
    Shift {
        candidate: &described.terms[*term].term,
        columns: columns.clone(),
        values: vec![0.0; columns.len()],
    }
}
