//! What the noise level follows, beside the effects of the catalogue on it.
//!
//! Every variable of the bundle is a column that the squares may follow ([`super::squares`]). Of the time,
//! stretches of a fifth, a tenth and a twentieth are tried, too ([`super::bursts`]): noise may come in bursts.
//! What differs between stars alone (colour, place) is held against the scatter of their levels about a line in
//! magnitude, as is each star ([`super::levels`]). Residuals that are slow are no noise: what changes from frame
//! to frame has to tell the same.
//!
//! Not physics: which variables are tried, and what is told of them.

use std::collections::BTreeMap;

use block_regression::Folds;
use rayon::prelude::*;
use telemetry::report::{Dependence, Unattributed};

use super::bursts::burst;
use super::quick::Quick;
use super::rows::{Source, squared_rates};
use super::shared::shared_noise;
use super::squares::{Columns, Judged, MIN_ROWS, Place, Table, both};
use super::{NoiseEffects, declared_variance};
use crate::error::CloseError;
use crate::follows::first_of_each;
use crate::search::empirical::{Scale, Variable, legendre};
use crate::situation::Situation;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;

/// Chance that any variable of a bundle is told although the noise follows none.
const ALPHA: f64 = 0.001;
/// Chance below which a variable says by what stars differ of which it is certain that they do.
const SAYS: f64 = 0.05;

/// Fewest stars that a slot is told from.
const FEWEST_IN_A_SLOT: usize = 3;

/// What the noise follows, most certain first: that of single stars, and that which all stars of a frame share.
#[derive(Clone, Debug, Default)]
pub(crate) struct NoiseFollows {
    own: Vec<Dependence>,
    shared: Vec<Dependence>,
}

impl NoiseFollows {
    /// Of rotations alone, not yet paid for.
    pub(crate) fn of_attitudes(judged: Vec<(String, Judged)>) -> Self {
        Self {
            own: told_of_turning(judged),
            shared: Vec::new(),
        }
    }

    /// Writes it where it is reported; where the residuals themselves follow nothing, it is
    /// what is left.
    pub(crate) fn tell(self, unattributed: &mut Unattributed) {
        if self.own.is_empty() && self.shared.is_empty() {
            return;
        }
        if !unattributed.present {
            let all = self.own.iter().chain(&self.shared).cloned().collect();
            unattributed.depends_on = first_of_each(all, |d| &d.variable);
        }
        unattributed.present = true;
        unattributed.noise_depends_on = self.own;
        unattributed.shared_noise_depends_on = self.shared;
    }
}

/// What stars tell as they move and what they tell by where they are, which know nothing of each other, say the same
/// (Fisher 1925: P = pq (1 - ln pq)).
fn together(within: Judged, among: Judged) -> Option<Judged> {
    let both = (within[0] * among[0]).max(f64::MIN_POSITIVE);
    Some([both * (1.0 - both.ln()), within[1].max(among[1])])
}

/// What single slots tell where many stars pass through each: those that stay in one are their slot's only ones.
fn of_slots(data: &StarData, [all, fast]: [&Table; 2]) -> Vec<Judged> {
    let mut stars: BTreeMap<i32, BTreeMap<usize, usize>> = BTreeMap::new();
    for row in &all.rows {
        let slot = data.frames.slot[row.at];
        *stars.entry(slot).or_default().entry(row.star).or_default() += 1;
    }
    let passed = |rows: &BTreeMap<usize, usize>| {
        rows.values().filter(|n| **n >= MIN_ROWS).count() >= FEWEST_IN_A_SLOT
    };
    let slots: Vec<i32> = stars.iter().filter(|s| passed(s.1)).map(|s| *s.0).collect();
    let each = slots.par_iter().flat_map_iter(|&slot| {
        let column = |row: &Place| [f64::from(u8::from(data.frames.slot[row.at] == slot)), 0.0];
        let columns = [all, fast].map(|t| Columns::of(t, column));
        let within = both(all.within(&columns[0], 1), fast.within(&columns[1], 1));
        let among = both(all.between(&columns[0], 0), fast.between(&columns[1], 0));
        let said = within.zip(among).and_then(|(w, a)| together(w, a));
        [within, among, said].into_iter().flatten()
    });
    each.collect()
}

/// What one variable tells: as stars move, and of what differs between them by where they are.
fn of_variable(
    data: &StarData,
    [all, fast]: [&Table; 2],
    (variable, range): &(Variable, [f64; 2]),
) -> Vec<Judged> {
    let rows = data.rows(0..data.t_s.len(), None, None);
    let scale = Scale::new(*range);
    let column = |row: &Place| -> [f64; 2] {
        if let Variable::Phase(axis) = variable {
            let at = data.landed()[*axis][row.at];
            let (s, c) = data.camera.phase_rad(at).sin_cos();
            return [s, c];
        }
        let [line, bend, _] = legendre(scale.of(variable.value(&rows, row.at)));
        [line, bend]
    };
    let columns = [all, fast].map(|t| Columns::of(t, column));
    let within = |k: usize| both(all.within(&columns[0], k), fast.within(&columns[1], k));
    let mut judged = vec![within(1), within(2)];
    if matches!(variable, Variable::Position(_) | Variable::Colour) {
        let between = |k: usize| both(all.between(&columns[0], k), fast.between(&columns[1], k));
        let among = [between(0), between(1)];
        let said = |k: usize| together(judged[k]?, among[k]?);
        let said = [said(0), said(1)];
        judged.extend(said);
        judged.extend(among);
    }
    if matches!(variable, Variable::Time) {
        judged.push(burst(&[all, fast], |row| data.t_s[row.at], *range));
    }
    judged.into_iter().flatten().collect()
}

/// The squares of `residual`, and of what of it changes from frame to frame, over what is `declared`; `None`: there are
/// too few.
fn tables(
    data: &StarData,
    residual: &[Vec<f64>],
    folds: &Folds,
    [declared, rate]: [&[f64]; 2],
) -> Option<[Table; 2]> {
    let quick = Quick::of(data, residual, [declared, rate]);
    let [its_declared, its_rate] = &quick.squares;
    let table = |residual, declared, rate| {
        Table::new(&Source {
            data,
            residual,
            declared,
            rate,
            folds,
        })
    };
    let (all, fast) = rayon::join(
        || table(residual, declared, rate),
        || table(&quick.residual, its_declared, its_rate),
    );
    Some([all?, fast?])
}

/// Declared variance of every row beside what is `claimed` of it, arcsec^2.
fn known_variance(
    situation: &Situation<'_>,
    data: &StarData,
    claimed: &NoiseEffects,
    rate: &[f64],
) -> Result<Vec<f64>, CloseError> {
    let mut declared = declared_variance(situation, data)?;
    // a rate adds to the level that there is, whatever is declared
    let there = claimed.level.unwrap_or(1.0);
    for (v, rate) in declared.iter_mut().zip(rate) {
        *v *= there;
        let more = claimed.rate.powi(2) * rate;
        if more.is_finite() {
            *v += more;
        }
    }
    Ok(declared)
}

/// Looks at the squares of `residual`, which the stars leave at `level` beside `claimed`, and at those of what all stars
/// of a frame share in what is left `beside` the description of it.
pub(crate) fn noise_follows(
    situation: &Situation<'_>,
    level: &StarEvidence<'_>,
    [residual, beside]: [&[Vec<f64>]; 2],
    folds: &Folds,
    claimed: &NoiseEffects,
    variables: &[(Variable, [f64; 2])],
) -> Result<NoiseFollows, CloseError> {
    let data = level.data;
    let rate = squared_rates(data);
    let mut variance = known_variance(situation, data, claimed, &rate)?;
    let Some(tables) = tables(data, residual, folds, [&variance, &rate]) else {
        return Ok(NoiseFollows::default());
    };
    let own = of_stars(data, tables.each_ref(), variables);
    let [all, _] = tables;
    for (v, star) in variance.iter_mut().zip(&data.star) {
        let known = all.stars[*star].level;
        *v *= if known > 0.0 { known } else { 1.0 };
    }
    let shared = shared_noise(situation, level, [&beside[0], &beside[1]], &variance, folds);
    let mut shared = told_of_turning(shared);
    // a noise of the stars turns their frames as well
    shared.retain(|d| own.iter().all(|o| o.variable != d.variable));
    Ok(NoiseFollows { own, shared })
}

/// What the noise of single stars follows.
fn of_stars(
    data: &StarData,
    tables: [&Table; 2],
    variables: &[(Variable, [f64; 2])],
) -> Vec<Dependence> {
    let [all, fast] = tables;
    let mut judged: Vec<(String, Judged)> = variables
        .par_iter()
        .flat_map_iter(|variable| {
            let judged = of_variable(data, tables, variable).into_iter();
            judged.map(|judged| (variable.0.name(), judged))
        })
        .collect();
    let odd = both(all.odd_star(), fast.odd_star());
    judged.extend(odd.map(|j| ("star".to_owned(), j)));
    let of_slots = of_slots(data, tables).into_iter();
    judged.extend(of_slots.map(|j| ("slot".to_owned(), j)));
    // stars that differ all over
    let told = told(judged, || both(all.scatter(), fast.scatter()));
    first_of_each(told, |d| &d.variable)
}

/// Of what the noise of rotations may follow, what is certain: what explains most first. A slew has its rate and its
/// acceleration, both beyond chance, and which of them a dozen blocks are surer of is chance.
fn told_of_turning(judged: Vec<(String, Judged)>) -> Vec<Dependence> {
    let mut told = told(judged, || None);
    told.sort_by(|a, b| b.variance_explained.total_cmp(&a.variance_explained));
    first_of_each(told, |d| &d.variable)
}

/// Of what was `judged`, each paid for by how many were tried, what is certain, most so first; where nothing is and stars
/// `differ`, what says by what they do.
fn told(judged: Vec<(String, Judged)>, differ: impl FnOnce() -> Option<Judged>) -> Vec<Dependence> {
    let tried = judged.len();
    let mut found: Vec<Dependence> = judged
        .into_iter()
        .map(|(variable, [p, share])| Dependence {
            variable,
            variance_explained: share,
            p_value: (p * tried as f64).min(1.0),
        })
        .collect();
    found.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
    let below = |p: f64| found.iter().take_while(|d| d.p_value < p).count();
    let certain = below(ALPHA);
    let differ = if certain == 0 { differ() } else { None };
    let differ = differ.map(|[p, share]| Dependence {
        variable: "star".to_owned(),
        variance_explained: share,
        p_value: p * (tried + 1) as f64,
    });
    if let Some(differ) = differ.filter(|d| d.p_value < ALPHA) {
        found.truncate(below(SAYS));
        found.push(differ);
    } else {
        found.truncate(certain);
    }
    found
}
