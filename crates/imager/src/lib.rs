//! What a star tracker's detector sees, and how the tracker reads it out: an independent source of
//! measured data.
//!
//! Nothing here computes an error of the tracker. Stars move over pixels while they are exposed, charge
//! is collected, clipped, trailed and counted, a window is read out and a centroid formed; what is wrong
//! with that centroid follows. Settings are physical: a row time, a full well, a dark current.
//!
//! ```
//! use focal_plane::{Catalogue, CatalogueStar, UniformRotation};
//! use imager::{Instrument, Run, frames};
//!
//! let star = |id: i64, ra_deg, dec_deg| CatalogueStar { id, ra_deg, dec_deg, mag: 3.0, ..CatalogueStar::default() };
//! let sky = Catalogue::new(2000.0, vec![star(1, 88.0, 85.0), star(2, 200.0, 86.0)])?;
//! let run = Run { frames: 10, ..Run::default() };
//! // a tracker at rest that looks at the pole
//! let bundle = frames(&Instrument::default(), &UniformRotation::default(), &sky, &run)?;
//! assert_eq!(bundle.stars.map(|stars| stars.rows()), Some(20));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod background;
mod clock;
mod detector;
mod error;
mod optics;
mod orbit;
mod path;
mod pieces;
mod random;
mod readout;
mod reference;
mod render;
mod run;
mod sky;
mod spot;
mod thermal;
mod tracker;
mod truth;
mod world;

pub use background::Background;
pub use clock::{Clock, Shutter};
pub use detector::{Detector, Fringe, HotPixel, Particles, Trailing};
pub use error::ImagerError;
pub use optics::Optics;
pub use orbit::Orbit;
pub use readout::{BackgroundLevel, Centroid, CentroidForm, Readout};
pub use reference::{Bracket, Reference, Slip};
pub use run::{Run, Summary, frames, write};
pub use sky::{Companion, Misplaced, Stars};
pub use spot::Spot;
pub use thermal::{Node, Sensor, Thermal};
pub use truth::{Acting, Truth};
pub use world::{Instrument, TABLES, WORLD_FORMAT};
