//! What is left beside the effects that were added, and what its squares follow.
//!
//! Not physics: the order of the report.

use std::sync::Arc;

use effects::Candidate;
use telemetry::report::Unattributed;

use crate::causes::commonness::Slow;
use crate::causes::slow_left;
use crate::causes::star_constants::Constants;
use crate::causes::terms;
use crate::error::CloseError;
use crate::findings;
use crate::image_level::ImageLevel;
use crate::noise_effects::{self, NoiseEffects, NoiseFollows};
use crate::power::Power;
use crate::search::empirical::Variable;
use crate::star::finish::Finish;
use crate::unexplained::leftover::{self, Leftover, Series};
use crate::unexplained::pattern::{self, Pattern, Turned};
use crate::unexplained::star_series::{self, OwnSeries};

/// What is left, looked at in every way.
pub(super) struct Left {
    /// Lines and jumps of all stars.
    shared: Leftover,
    /// Those of single stars.
    own: OwnSeries,
    pattern: Option<Pattern>,
    slow: Option<Slow>,
    noise: NoiseFollows,
}

/// Looks at the `residual`, of which the `series` may be known; first are effects on the noise level.
pub(super) fn look(
    f: &Finish<'_>,
    residual: &[Vec<f64>],
    series: Option<Series>,
) -> Result<(NoiseEffects, Left), CloseError> {
    let weight = &f.level.weight;
    let series =
        series.unwrap_or_else(|| Series::of(&leftover::star_tracks(f.data, residual, weight)));
    let turned = Turned::of(f.data, [&residual[0], &residual[1]], weight);
    let order = f.situation.model.noise.distortion_order;
    let learned = f.level.learned();
    let variables = terms::of_noise(f.situation, f.data);
    let (noise, ((shared, own), pattern)) = rayon::join(
        || noise_and_slow(f, residual, &variables),
        || {
            rayon::join(
                || (series.describe(), own_series(f, residual, &turned)),
                || pattern::search(f.data, residual, &turned, weight, f.folds, order, learned),
            )
        },
    );
    drop(turned);
    let NoiseAndSlow {
        mut effects,
        slow,
        beside,
    } = noise?;
    if f.image.is_some_and(ImageLevel::new_noise) {
        effects = effects.without_magnitude();
    }
    let mut noise = NoiseFollows::default();
    if f.formed.is_none() && !f.data.frames_are_unrelated() {
        noise = noise_effects::noise_follows(
            f.situation,
            f.level,
            [residual, beside.as_deref().unwrap_or(residual)],
            f.folds,
            &effects,
            &variables,
        )?;
    }
    let left = Left {
        shared,
        own,
        pattern,
        slow,
        noise,
    };
    Ok((effects, left))
}

/// Effects on the noise level, slow noise of the stars, and the residual that they are found in where something is
/// described.
struct NoiseAndSlow {
    effects: NoiseEffects,
    slow: Option<Slow>,
    beside: Option<Vec<Vec<f64>>>,
}

fn noise_and_slow(
    f: &Finish<'_>,
    residual: &[Vec<f64>],
    variables: &[(Variable, [f64; 2])],
) -> Result<NoiseAndSlow, CloseError> {
    // what is described is no noise
    let beside = beside_description(f)?;
    let slow = match &beside {
        Some(beside) => slow_left(f.level, Some(beside)),
        None => f.slow,
    };
    let residual = beside.as_deref().unwrap_or(residual);
    let effects = noise_effects::claim(f.situation, f.level, residual, f.folds, variables)?;
    Ok(NoiseAndSlow {
        effects,
        slow,
        beside,
    })
}

/// What the chosen effects leave in sample beside the description of it, where there is one, arcsec.
fn beside_description(f: &Finish<'_>) -> Result<Option<Vec<Vec<f64>>>, CloseError> {
    if f.level.learned() {
        return Ok(None);
    }
    beside(f, &f.described.terms_left())
}

/// The same beside these `terms`, if there are any.
fn beside(
    f: &Finish<'_>,
    terms: &[Arc<dyn Candidate>],
) -> Result<Option<Vec<Vec<f64>>>, CloseError> {
    if terms.is_empty() {
        return Ok(None);
    }
    let level = f.level.keeping(terms);
    let found = f.found.refitted(&level, f.folds)?;
    Ok(noise_effects::in_sample(&level, &found))
}

/// A residual less what its frames are known to have turned by: those whose attitudes are free have turned already.
fn own_of<'r>(f: &Finish<'_>, residual: &'r [Vec<f64>], turned: &'r Turned<'_>) -> &'r [Vec<f64>] {
    if f.data.free_attitude {
        residual
    } else {
        &turned.known
    }
}

/// Lines and jumps that single stars have; `turned` is the residual less its frames' rotations.
fn own_series(f: &Finish<'_>, residual: &[Vec<f64>], turned: &Turned<'_>) -> OwnSeries {
    // a learned spot errs by where the star lies, and so slowly
    if f.level.learned() {
        return OwnSeries::default();
    }
    let own = own_of(f, residual, turned);
    let alone = || match residual {
        [x, y] if f.data.free_attitude => [x.clone(), y.clone()],
        _ => turned.whole(),
    };
    let drift = |squares| {
        let smooth = smooth_squares(f, own).ok().flatten();
        smooth.is_some_and(|smooth| smooth > squares)
    };
    star_series::search(f.data, own, alone, &f.level.weight, drift)
}

/// Squares, in units of the noise, that the smooth terms of the description take of what the stars do by themselves, which
/// is `own`, less those of its numbers; `None`: there are none.
fn smooth_squares(f: &Finish<'_>, own: &[Vec<f64>]) -> Result<Option<f64>, CloseError> {
    let terms = f.described.smooth_terms_left();
    let Some(with) = beside(f, &terms)? else {
        return Ok(None);
    };
    let weight = &f.level.weight;
    let turned = Turned::of(f.data, [&with[0], &with[1]], weight);
    let with = own_of(f, &with, &turned);
    let squares = |own: &[Vec<f64>]| -> [f64; 2] {
        let square = |r: usize| (own[0][r].powi(2) + own[1][r].powi(2)) * weight[r].powi(2);
        let rows = (0..f.data.t_s.len()).filter(|&r| !f.data.outlier[r]);
        let known = rows.map(square).filter(|square| square.is_finite());
        known.fold([0.0; 2], |[sum, n], square| [sum + square, n + 2.0])
    };
    let ([before, _], [after, count]) = (squares(own), squares(with));
    let numbers: usize = terms.iter().map(|t| t.coefficients().len()).sum();
    Ok(Some((before - after) * count / after - numbers as f64))
}

impl Left {
    /// Adds all of it to what the residual is described by; `inside` is the residual in sample, where that is known,
    /// arcsec.
    pub(super) fn tell(
        self,
        f: &Finish<'_>,
        inside: Option<&[Vec<f64>]>,
        power: &Power,
        unattributed: &mut Unattributed,
    ) {
        let share = power.share_left();
        self.shared.tell(unattributed);
        if let Some(pattern) = self.pattern {
            pattern.tell(unattributed, share);
        }
        if let Some(slow) = self.slow {
            slow.tell(unattributed, share);
        }
        self.own.tell(unattributed, share);
        if let Some(constants) = Constants::of(f.level, f.found, inside) {
            constants.tell(f.described, share, unattributed);
        }
        self.noise.tell(unattributed);
        tell_change(f, power, unattributed);
    }
}

/// What no variable predicts may be an effect that changes with one.
fn tell_change(f: &Finish<'_>, power: &Power, unattributed: &mut Unattributed) {
    if !unattributed.present
        && let Some(change) = findings::changing(f.found, f.refused)
    {
        unattributed.present = true;
        unattributed.variance_fraction =
            Some(change.variance_explained * power.left / power.before);
        let list = &mut unattributed.depends_on;
        list.retain(|d| d.variable != change.variable);
        list.insert(0, change);
    }
}
