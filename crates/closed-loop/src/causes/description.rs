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
use focal_plane::{Camera, PointsMut, VectorsMut};
use std::sync::{Arc, OnceLock};

use crate::causes::changing_effect::Way;
use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::follows::{self, Followed};
use crate::search::empirical::{Empirical, Variable};
use crate::search::group::Group;
use crate::search::selection::{FAMILY_ALPHA, Judgement, columns_of, each};
use crate::search::{Fitted, Found, borrowed, fit_beside};
use crate::star::columns::star_columns_of;
use crate::star::evidence::StarEvidence;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use telemetry::report::{Dependence, Unattributed};

use columns::Columns;
pub(crate) use columns::InTwo;

mod columns;

/// Chance beyond which stars differ by more than a line through them.
const BESIDE_A_LINE: f64 = 1e-4;

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
    /// What having looked for each chosen effect among all candidates costs, nats
    /// ([`crate::search::selection::costs`]): those that were refused since were looked at, too.
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
        let columns = Columns::of(found, terms, ways);
        let coarse = evidence.coarser(folds);
        let folds = coarse.as_ref().unwrap_or(folds);
        let grams = evidence.grams(folds, &columns.candidates());
        columns.described(evidence, folds, &grams)
    }

    /// Two descriptions of the same under two noises, that of `level` and white, from one pass: the second has no
    /// changes, and each the terms that are its own.
    pub(crate) fn twice(
        level: &StarEvidence<'_>,
        white: &StarEvidence<'_>,
        folds: &Folds,
        found: &Found,
        terms: Vec<InTwo>,
        ways: &[Way],
    ) -> Result<[Self; 2], CloseError> {
        let coarse = level.coarser(folds);
        let folds = coarse.as_ref().unwrap_or(folds);
        let (terms, is_in): (_, Vec<_>) = terms.into_iter().map(|t| (t.term, t.is_in)).unzip();
        let all = Columns::of(found, terms, ways);
        // where the reference has white noise, white evidence is another pass
        let shared = level.noise.is_some() && white.drawn.is_none();
        let moments = shared.then(|| level.moments(folds, &all.candidates()));
        let first = level.precision().nrows();
        let of_part = |evidence: &StarEvidence<'_>, which: usize| {
            let (part, places) = all.part(&is_in, which);
            let grams = match &moments {
                Some(moments) => {
                    let residuals = moments.width() - level.residual_columns()..moments.width();
                    let own = places.into_iter().map(|c| first + c);
                    let own: Vec<usize> = (0..first).chain(own).chain(residuals).collect();
                    evidence.under_of(moments, &own)
                }
                None => evidence.grams(folds, &part.candidates()),
            };
            part.described(evidence, folds, &grams)
        };
        Ok([of_part(level, 0)?, of_part(white, 1)?])
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
        let mut told = follows::follows(&self.fitted.fits, &set, &terms, tried, each, left);
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
        let whole = follows::follows(fits, set, &[term], tried, 0.0, 1.0);
        let Some(entry) = whole.depends_on.into_iter().find(follows::is_beyond_chance) else {
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
    let mut certain = left
        .depends_on
        .iter()
        .filter(|d| follows::is_beyond_chance(d));
    let Some(term) = certain.find_map(|d| {
        let mut of_name = terms.iter().filter(|t| t.name() == d.variable);
        of_name.find(|t| t.is_declarable(surroundings))
    }) else {
        return Ok(());
    };
    found.candidates.push(Arc::new(term.clone()));
    let all = borrowed(&found.candidates);
    found.fitted = fit_beside(evidence, folds, &all, &found.selection.chosen)?;
    let (fitted, selection) = (&found.fitted, &mut found.selection);
    let cost = vec![terms.len() as f64; fitted.groups.len()];
    let last = fitted.groups.len() - 1;
    let judged = fitted.trials(&cost).within(&selection.chosen, last);
    selection.judged.push(judged.unwrap_or(Judgement::UNSEEN));
    Ok(())
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

#[cfg(test)]
mod tests {
    use coloured_noise::{Coloured, CommonNoise};
    use telemetry::Model;

    use super::*;
    use crate::star::harness::{at_rest, silent};

    /// Two descriptions of one pass are those of a pass each, to rounding, with the terms and changes that are their own.
    #[test]
    fn two_descriptions_of_one_pass_are_those_of_two() {
        let data = at_rest((0..200).map(|k| 0.5 * f64::from(k)).collect());
        let of = |variable, range| Empirical::new(variable, range, true).unwrap();
        let star = |k: usize| of(Variable::Star(vec![data.stars[k].id]), [0.0, 1.0]);
        let span = [0.0, 99.5];
        let terms = [
            (star(0), [true, false]),
            (of(Variable::Time, span), [true, true]),
            (of(Variable::Position(0), [-390.0, 300.0]), [false, true]),
            (star(4), [true, true]),
        ];
        let rows = data.t_s.len();
        let residual = [1.3, 2.1].map(|f| (0..rows).map(|r| (f * r as f64).sin()).collect());
        let white = StarEvidence {
            residuals: Arc::new(vec![residual]),
            kept: vec![Arc::new(star(2))],
            ..silent(&data, &Model::default())
        };
        let slow = Coloured {
            white: 0.0,
            slow: 0.5,
            tau_s: 20.0,
        };
        let level = white.with_noise(&CommonNoise {
            centroid: 0.7,
            reference: [slow; 3],
        });
        let folds = Folds::cut(data.frames.t_s.len());
        let chosen: Arc<dyn Candidate> = effects::step_at(31.3, span, 1).into();
        let found = Found::of_chosen(&level, &folds, &[chosen], &[0]).unwrap();
        let ways = [Way::With(Variable::Time, span)];
        let in_two = terms
            .iter()
            .cloned()
            .map(|(term, is_in)| InTwo { term, is_in });
        let both = Described::twice(&level, &white, &folds, &found, in_two.collect(), &ways);
        let alone = |evidence: &StarEvidence<'_>, which: usize, ways: &[Way]| {
            let own = terms.iter().filter(|(_, is_in)| is_in[which]);
            let own = own.map(|(term, _)| term.clone()).collect();
            Described::new(evidence, &folds, &found, own, ways).unwrap()
        };
        let others = [alone(&level, 0, &ways), alone(&white, 1, &[])];
        for (ours, other) in both.unwrap().iter().zip(&others) {
            let columns = |d: &Described| -> Vec<usize> {
                let parts = d.terms.iter().flat_map(|t| t.parts.concat());
                parts
                    .chain(d.changes[0].iter().flat_map(|(_, c)| c.clone()))
                    .collect()
            };
            assert_eq!(columns(ours), columns(other));
            for c in columns(ours) {
                let [a, b] = [ours, other].map(|d| d.fitted.fits.error(&[c]).unwrap());
                assert!((a - b).abs() < 1e-9 * b, "column {c}: {a}, {b}");
            }
        }
        assert!(!others[0].changes[0].is_empty() && others[1].changes[0].is_empty());
    }
}
