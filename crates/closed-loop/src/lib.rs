//! The loop from telemetry back to the model: what is left, what causes it, and
//! how much better the model is with it.
//!
//! [`close`] takes a declared model and a bundle. It estimates everything that the
//! model declares unknown, looks among the effects of the catalogue for those
//! that the residual supports out of fold, and reports the error before and
//! after on data that took no part in the fit.
#![forbid(unsafe_code)]

mod attitude;
mod bins;
mod causes;
mod close;
mod declared;
mod error;
mod evidence;
mod figures;
mod image_level;
mod images;
mod motion;
mod noise_effects;
mod questions;
mod search;
mod situation;
mod star;
mod unexplained;

pub use close::{Closed, Rival, close, close_asking};
pub use error::CloseError;
pub use questions::hypothesis::Questions;

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
