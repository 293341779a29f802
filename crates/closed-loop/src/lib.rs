//! The loop from telemetry back to the model: what is left, what causes it, and
//! how much better the model is with it.
//!
//! [`close`] takes a declared model and a bundle. It estimates everything that the
//! model declares unknown, looks among the effects of the catalogue for those
//! that the residual supports out of fold, and reports the error before and
//! after on data that took no part in the fit.
#![forbid(unsafe_code)]

mod attitude_data;
mod attitude_loop;
mod attitude_search;
mod bins;
mod causes;
mod close;
mod coloured;
mod common_noise;
mod commonness;
mod confusion;
mod declared;
mod description;
mod directions;
mod empirical;
mod error;
mod evidence;
mod figures;
mod fit;
mod folds;
mod frame_rotation;
mod gram;
mod hypothesis;
mod image_level;
mod images;
mod instants;
mod invariance;
mod leftover;
mod manoeuvre;
mod motion;
mod noise_effects;
mod nuisance;
mod own_attitude;
mod pattern;
mod reference_wander;
mod search;
mod selection;
mod settling;
mod situation;
mod spatial_errors;
mod stand_ins;
mod star_columns;
mod star_data;
mod star_evidence;
mod star_loop;
mod star_moments;
mod star_search;
mod star_series;
mod star_weights;

pub use close::{Closed, Rival, close, close_asking};
pub use error::CloseError;
pub use hypothesis::Questions;

/// Seeds of a trial of alarms and the most of them that may raise one: `seeds` and
/// `most`, or as many as `BORESIGHT_SEEDS` says and 5 sigma above one in `rarity`.
#[cfg(test)]
fn many_seeds(seeds: u64, most: usize, rarity: usize) -> (u64, usize) {
    match option_env!("BORESIGHT_SEEDS").map(str::parse::<u32>) {
        Some(Ok(n)) => {
            let mean = (n as usize).div_ceil(rarity);
            (u64::from(n), mean + 5 * (mean.isqrt() + 1))
        }
        _ => (seeds, most),
    }
}
