//! What the noise of attitudes follows: squares of what is left about each axis, against time, motion and channels.
//!
//! Not physics: which variables are tried ([`crate::noise_effects`] says how).

use effects::CHANNEL;
use telemetry::ModelKind;

use crate::attitude::finish::Finish;
use crate::attitude::motion_terms;
use crate::attitude::spatial_errors::changes_of_stars;
use crate::evidence::Residuals;
use crate::noise_effects::{NoiseFollows, Turning, Varies};

/// Changes of stars from which on a declared tracker's noise is another one every now and then; then it follows a channel
/// where it changes by more than this share of its variance, rms, which is more than one star of a handful makes, and
/// by more than it does with time or motion.
const CHANGES: f64 = 0.5;
const OF_STARS: f64 = 0.3;

/// Of what is `left`, without the noise that axes share; where the declared tracker's stars change, channels alone.
pub(super) fn noise_follows(f: &Finish<'_>, left: &Residuals) -> NoiseFollows {
    let data = f.data();
    let of_stars = f.situation.model.kind == ModelKind::Pbm;
    let changes = of_stars && changes_of_stars(f.situation, &data.t_s) > CHANGES;
    let (axes, outlier) = data.mixing.mix_rows(&left.axes, &data.outlier);
    let counted = |a: usize| {
        let rows = axes[a].iter().zip(&outlier[a]);
        rows.map(|(v, out)| if *out { f64::NAN } else { *v })
            .collect()
    };
    let turning = Turning {
        t_s: &data.t_s,
        theta: std::array::from_fn(counted),
        known: std::array::from_fn(|_| vec![0.0; data.t_s.len()]),
        folds: f.folds,
    };
    let mut variables = of_time(f);
    variables.extend(Varies::channels(&f.situation.channels, &data.t_s));
    let mut judged = turning.judged(&variables);
    if changes {
        let is_channel = |name: &str| name.starts_with(CHANNEL);
        let others = judged.iter().filter(|(name, _)| !is_channel(name));
        let least = others.fold(OF_STARS, |most, (_, [_, share])| most.max(*share));
        for (name, [p_value, share]) in &mut judged {
            if !is_channel(name) || *share < least {
                *p_value = 1.0;
            }
        }
    }
    NoiseFollows::of_attitudes(judged)
}

fn of_time(f: &Finish<'_>) -> Vec<(String, Varies)> {
    let t_s = &f.data().t_s;
    let mut out = vec![("time".to_owned(), Varies::Time)];
    // errors by where stars are declared to stand are fast as they move
    if f.motion.resolved() && f.changes.is_none() {
        let motions = motion_terms::motions(f.motion, t_s);
        out.extend(motions.map(|(name, motion)| (name.to_owned(), Varies::Motion(motion))));
    }
    out
}
