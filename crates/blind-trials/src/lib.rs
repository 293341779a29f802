//! Rendered worlds through the closed loop, scored against their truth.
//!
//! A [`Trial`] makes bundles, one a seed, and knows what acts in them; the loop is given the bundle and
//! the analyst's model, nothing else. [`score`] holds a report against the truth, [`Tally`] counts over
//! seeds, [`page`] writes it down.
#![forbid(unsafe_code)]

mod bound;
mod error;
mod floor;
mod page;
mod residual;
mod run;
mod score;
mod settings;
mod simulated;
mod tally;
mod trial;

pub use bound::bounds;
pub use error::BlindError;
pub use floor::Floor;
pub use page::{differences, first, page};
pub use run::{Done, Plan, run};
pub use score::{Claim, Drawn, Score, score};
pub use simulated::simulated;
pub use tally::{ParameterRow, Tally};
pub use trial::{Trial, worlds};
