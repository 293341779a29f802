//! The loop from telemetry back to the model: what is left, what causes it, and
//! how much better the model is with it.
//!
//! [`close`] takes a declared model and a bundle. It estimates everything that the
//! model declares unknown, looks among the effects of the catalogue for those
//! that the residual supports out of fold, and reports the error before and
//! after on data that took no part in the fit.
//!
//! ```text
//! close              the door: model and bundle joined (situation, declared), then stars or attitudes
//! outcome            what it hands back
//! conventions        quaternions that are meant another way are refused before anything is made of them
//! star  attitude     the two kinds of measurement, each with the order of its steps (run)
//! evidence           what the search asks of either: sums over blocks, and residuals out of fold
//! search             candidates, selection, refinement until it stands; terms without a cause
//! causes             what speaks against a cause that was found, before it is named
//! noise_effects      effects that move nothing and change the noise
//! image_level        whether dark map and spots explain what raw windows show
//! questions          what else it could be, what would tell, and what somebody asks by name
//! unexplained        what no effect explains: lines, jumps, waves on the detector
//! findings           what was found and considered, turned into the report
//! follows            what the leftover follows
//! noise_level        whether what is left is as loud as declared
//! motion  bins       whether samples resolve a motion; long series as means over short stretches
//! ```
//!
//! Regression, coloured noise and raw windows are crates of their own: [`block_regression`],
//! [`coloured_noise`], [`star_images`].
#![forbid(unsafe_code)]

mod attitude;
mod bins;
mod causes;
mod close;
mod conventions;
mod declared;
mod error;
mod evidence;
mod findings;
mod follows;
mod gaps;
mod image_level;
mod motion;
mod noise_effects;
mod noise_level;
mod outcome;
mod parabola;
mod power;
mod questions;
mod residual_size;
mod search;
mod situation;
mod star;
mod undetermined;
mod unexplained;

pub use close::{close, close_asking};
pub use error::CloseError;
pub use findings::CONFUSABLE;
pub use follows::is_beyond_chance;
pub use noise_level::{noise_ratio, times};
pub use outcome::{Closed, Rival};
pub use questions::hypothesis::{NEXT_TO_NEVER, Questions, of_size, p_is};
pub use questions::manoeuvre::NEEDED_SIGMA;

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
