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
use super::rows::{Row, Source, squared_rates};
use super::squares::{Columns, Judged, MIN_ROWS, Table, both};
use super::{NoiseEffects, declared_variance};
use crate::error::CloseError;
use crate::figures::first_of_each;
use crate::search::empirical::{Scale, Variable};
use crate::situation::Situation;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;

/// Chance that any variable of a bundle is told although the noise follows none.
const ALPHA: f64 = 0.001;
/// Chance below which a variable says by what stars differ of which it is certain that they do.
const SAYS: f64 = 0.05;

/// Fewest stars that a slot is told from.
const FEWEST_IN_A_SLOT: usize = 3;

/// What the noise follows, most certain first.
#[derive(Clone, Debug, Default)]
pub(crate) struct NoiseFollows(Vec<Dependence>);

impl NoiseFollows {
    /// Writes it where it is reported; where the residuals themselves follow nothing, it is
    /// what is left.
    pub(crate) fn tell(self, unattributed: &mut Unattributed) {
        if self.0.is_empty() {
            return;
        }
        if !unattributed.present {
            unattributed.depends_on.clone_from(&self.0);
        }
        unattributed.present = true;
        unattributed.noise_depends_on = self.0;
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
        let column = |row: &Row| [f64::from(u8::from(data.frames.slot[row.at] == slot)), 0.0];
        let columns = [all, fast].map(|t| Columns::of(t, column));
        let within = both(all.within(&columns[0], 1), fast.within(&columns[1], 1));
        let among = both(all.between(&columns[0], 0), fast.between(&columns[1], 0));
        let said = within.zip(among).and_then(|(w, a)| together(w, a));
        [within, among, said].into_iter().flatten()
    });
    each.collect()
}

/// Looks at the squares of `residual`, which the stars leave at `level` beside `claimed`.
pub(crate) fn noise_follows(
    situation: &Situation<'_>,
    level: &StarEvidence<'_>,
    residual: &[Vec<f64>],
    folds: &Folds,
    claimed: &NoiseEffects,
    variables: &[(Variable, [f64; 2])],
) -> Result<NoiseFollows, CloseError> {
    let data = level.data;
    let mut declared = declared_variance(situation, data)?;
    let rate = squared_rates(data);
    // a rate adds to the level that there is, whatever is declared
    let there = claimed.level.unwrap_or(1.0);
    for (v, rate) in declared.iter_mut().zip(&rate) {
        *v *= there;
        let more = claimed.rate.powi(2) * rate;
        if more.is_finite() {
            *v += more;
        }
    }
    let quick = Quick::of(data, residual, [&declared, &rate]);
    let [its_declared, its_rate] = &quick.squares;
    let of = [
        (residual, &declared, &rate),
        (&quick.residual, its_declared, its_rate),
    ];
    let tables: Vec<Table> = of
        .into_par_iter()
        .filter_map(|(residual, declared, rate)| {
            Table::new(&Source {
                data,
                residual,
                declared,
                rate,
                folds,
            })
        })
        .collect();
    let [all, fast] = tables.as_slice() else {
        return Ok(NoiseFollows::default());
    };
    let rows = data.rows(0..data.t_s.len(), None, None);
    let each = |(variable, range): &(Variable, [f64; 2])| -> Vec<Judged> {
        let scale = Scale::new(*range);
        let column = |row: &Row| -> [f64; 2] {
            if let Variable::Phase(axis) = variable {
                let at = data.landed()[*axis][row.at];
                let (s, c) = data.camera.phase_rad(at).sin_cos();
                return [s, c];
            }
            let z = scale.of(variable.value(&rows, row.at));
            [z, 1.5 * z * z - 0.5]
        };
        let columns = [all, fast].map(|t| Columns::of(t, column));
        let within = |k: usize| both(all.within(&columns[0], k), fast.within(&columns[1], k));
        let mut judged = vec![within(1), within(2)];
        if matches!(variable, Variable::Position(_) | Variable::Colour) {
            let between =
                |k: usize| both(all.between(&columns[0], k), fast.between(&columns[1], k));
            let among = [between(0), between(1)];
            let said = |k: usize| together(judged[k]?, among[k]?);
            let said = [said(0), said(1)];
            judged.extend(said);
            judged.extend(among);
        }
        if matches!(variable, Variable::Time) {
            judged.push(burst([all, fast], |row| data.t_s[row.at], *range));
        }
        judged.into_iter().flatten().collect()
    };
    let judged: Vec<Vec<Judged>> = variables.par_iter().map(each).collect();
    let names = variables.iter().map(|(variable, _)| variable.name());
    let mut found: Vec<Dependence> = names
        .zip(judged)
        .flat_map(|(name, judged)| judged.into_iter().map(move |j| (name.clone(), j)))
        .chain(both(all.odd_star(), fast.odd_star()).map(|j| ("star".to_owned(), j)))
        .chain(
            of_slots(data, [all, fast])
                .into_iter()
                .map(|j| ("slot".to_owned(), j)),
        )
        .map(|(variable, [p_value, share])| Dependence {
            variable,
            variance_explained: share,
            p_value,
        })
        .collect();
    let tried = found.len();
    for d in &mut found {
        d.p_value = (d.p_value * tried as f64).min(1.0);
    }
    found.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
    let certain = found.iter().take_while(|d| d.p_value < ALPHA).count();
    // stars that differ all over: by what says most, if anything does
    let differ = if certain == 0 {
        both(all.scatter(), fast.scatter())
    } else {
        None
    };
    let differ = differ.filter(|[p, _]| p * ((tried + 1) as f64) < ALPHA);
    found.truncate(match differ {
        Some(_) => found.iter().take_while(|d| d.p_value < SAYS).count(),
        None => certain,
    });
    if let Some([p, share]) = differ {
        found.push(Dependence {
            variable: "star".to_owned(),
            variance_explained: share,
            p_value: p * (tried + 1) as f64,
        });
    }
    Ok(NoiseFollows(first_of_each(found, |d| &d.variable)))
}
