//! Raw windows of a star tracker: what the detector itself adds, the spots of the stars, and centroids
//! formed anew without what both do to them.
//!
//! ```text
//! window = flux psi(pixel - position) + background + dark(pixel) + noise,   noise variance a + b signal
//! ```
//!
//! with one effective spot psi a star (already integrated over the pixel), one value a detector pixel, and
//! positions that hang together as a rigid body from frame to frame, learned by turns with particle hits
//! clipped pixel by pixel. [`form`] does all of it: outside each fold, for centroids that may be judged on data that
//! had no part in them, and on all data. [`Stars`] and a table of windows go in, no model of what is wrong
//! does; [`Formed`] comes out.
//!
//! | what | where |
//! |---|---|
//! | first moments, less the map, at the level of background at which they follow the star | [`Centroids::moments`] |
//! | first moments above what lies under the star, as a tracker forms them | [`Centroids::plain`] |
//! | the same less what the spot says that they are off by | [`Centroids::unbiased`] |
//! | positions of the effective spot | [`Centroids::fitted`] |
//! | positions of the round Gaussian nearest to it | [`Centroids::gaussian`] |
//! | positions of the effective spot, pixels that switch followed in time | [`Centroids::followed`] |
//! | rows that have a centroid formed in each of these ways | [`Formed::anew`] |
//! | the map, with a sigma for every pixel | [`Formed::map`], [`DarkMap`] |
//! | all of the former with a map and without | [`Formed::with_map`], [`Formed::without_map`] |
//!
//! Only contrasts of the map mean anything: a uniform dark level, a pedestal of the spot and a constant
//! background cannot be told apart. A spot has no zero of its own: positions found with it are set such that
//! their mean over a star is that of its first moments.
#![forbid(unsafe_code)]

mod banded;
mod coupling;
mod dark;
mod form;
mod gaussian_spot;
mod geometry;
mod joining;
mod learn;
mod map;
mod moment_level;
mod pixel_noise;
mod robust;
mod sample;
mod spline;
mod spline_sums;
mod spot;
mod switching;
#[cfg(test)]
mod synthetic;
mod window_fit;

pub use form::{Centroids, Formed, Stars, Unusable, Variants, form};
pub use joining::windows_of_rows;
pub use map::{DarkMap, DarkPixel};
