//! What is left of attitudes: what it follows about each axis, and what of it is slow.
//!
//! Not physics: shares and chances of what was fitted elsewhere.

use coloured_noise::Coloured;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use telemetry::report::{Dependence, Unattributed};

use crate::attitude::data::AttitudeData;
use crate::attitude::search;
use crate::error::CloseError;
use crate::evidence::Residuals;
use crate::follows;
use crate::residual_size;
use crate::search::Found;
use crate::unexplained::SEARCH_ALPHA;

/// A correlated part below this share of the variance of its axis, or that the
/// likelihood hardly sees, is not worth a word.
const SLOW_SHARE: f64 = 0.1;
const SLOW_GAIN: f64 = 20.0;

/// Tells what the variables that the leftover follows explain of it in arcsec^2, each axis by its own: no more than
/// `own` by the square, arcsec, about any axis is what the declared model makes, and not left over. `left`: share of
/// the before variance that is left. Returns the term that explains most.
///
/// A slow variable counts at its own best noise too, as effects do: the noise of the search took it for its own.
pub(super) fn by_axes(
    data: &AttitudeData,
    found: &Found,
    plain: &Residuals,
    with: &dyn Fn(usize) -> Result<Residuals, CloseError>,
    own: [f64; 3],
    left: f64,
    unattributed: &mut Unattributed,
) -> Result<Option<usize>, CloseError> {
    // what the axes share hides what is one axis' own
    let squares = |r: &Residuals| -> [f64; 3] {
        let (axes, outlier) = data.mixing.mix_rows(&r.axes, &data.outlier);
        std::array::from_fn(|a| {
            residual_size::rms(&axes[a], &outlier[a]).map_or(0.0, |rms| rms * rms)
        })
    };
    let before = squares(plain);
    let whole: f64 = before.iter().sum();
    let (mut kept, mut most, mut best) = (Vec::new(), 0.0, None);
    let mut all = std::mem::take(&mut unattributed.depends_on);
    tell_at_own_noise(found, &mut all);
    for mut entry in all {
        let term = follows::is_beyond_chance(&entry)
            .then(|| follows::term_of(found, &entry))
            .flatten();
        if let Some(g) = term {
            let after = squares(&with(g)?);
            let gain: [f64; 3] = std::array::from_fn(|a| (before[a] - after[a]).max(0.0));
            if (0..3).all(|a| gain[a] <= own[a] * own[a]) {
                continue;
            }
            entry.variance_explained = gain.iter().sum::<f64>() / whole;
            if entry.variance_explained > most {
                (most, best) = (entry.variance_explained, Some(g));
            }
        }
        kept.push(entry);
    }
    if most > 0.0 {
        kept.retain(follows::is_beyond_chance);
    }
    kept.sort_by(|a, b| b.variance_explained.total_cmp(&a.variance_explained));
    unattributed.present = most > 0.0;
    unattributed.variance_fraction = Some(most * left);
    unattributed.depends_on = kept;
    Ok(best)
}

/// Channels and motions that stand at their own best noise, in the place of what is `told` of them if that is not certain; what
/// they explain is found out later.
fn tell_at_own_noise(found: &Found, told: &mut Vec<Dependence>) {
    for (candidate, judged) in found.candidates.iter().zip(&found.selection.judged) {
        let p_value = judged.p_value;
        let stands = search::is_a_description(candidate.as_ref()) && judged.stands();
        let variable = candidate.selectors().remove("variable");
        let Some(variable) = variable.filter(|_| stands && p_value < SEARCH_ALPHA) else {
            continue;
        };
        let entry = Dependence {
            variable,
            variance_explained: 1.0,
            p_value,
        };
        match told.iter_mut().find(|d| d.variable == entry.variable) {
            Some(known) if follows::is_beyond_chance(known) => {}
            Some(known) => *known = entry,
            None => told.push(entry),
        }
    }
}

/// A slowly varying part that no term predicts is left too: it shows as noise that
/// is correlated in time, which the declared model does not have.
pub(super) fn slow_leftover(
    data: &AttitudeData,
    after: &Residuals,
    declared: [f64; 3],
    unattributed: &mut Unattributed,
    left: f64,
) {
    let (mut slow, mut whole, mut gain, mut most) = (0.0, 0.0, 0.0, 0.0_f64);
    for axis in 0..3 {
        let mut means = data.binned(axis, &after.axes[axis]);
        let count = &data.count[axis];
        let sum: f64 = means.iter().zip(count).map(|(v, n)| v * n).sum();
        let mean = sum / count.iter().sum::<f64>().max(1.0);
        means.iter_mut().for_each(|v| *v -= mean);
        let noise = Coloured::fit(&data.bins.t_s, &means, count);
        let white = Coloured {
            slow: 0.0,
            white: noise.white.hypot(noise.slow),
            ..noise
        };
        let loglik = |n: &Coloured| n.log_likelihood(&data.bins.t_s, &means, count);
        let square = residual_size::rms(&after.axes[axis], &data.outlier[axis])
            .map_or(0.0, |r| (r * r - mean * mean).max(f64::MIN_POSITIVE));
        whole += square;
        // what the declared model makes by itself is not left over
        if noise.slow > declared[axis] {
            slow += noise.slow * noise.slow;
            // each axis by its own noise: that of the boresight would drown the others
            most = most.max(noise.slow * noise.slow / square);
            gain += (loglik(&noise) - loglik(&white)).max(0.0);
        }
    }
    if most < SLOW_SHARE || gain < SLOW_GAIN {
        return;
    }
    let share = (slow / whole).min(1.0);
    unattributed.present = true;
    unattributed.variance_fraction = Some(
        unattributed
            .variance_fraction
            .unwrap_or(0.0)
            .max(share * left),
    );
    unattributed.depends_on.retain(|d| d.variable != "time");
    let entry = Dependence {
        variable: "time".to_owned(),
        variance_explained: share,
        // two parameters an axis: Wilks
        p_value: ChiSquared::new(6.0).map_or(1.0, |law| law.sf(2.0 * gain)),
    };
    unattributed.depends_on.insert(0, entry);
    unattributed.depends_on.retain(follows::is_beyond_chance);
    unattributed
        .depends_on
        .sort_by(|a, b| b.variance_explained.total_cmp(&a.variance_explained));
}
