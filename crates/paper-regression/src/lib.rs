//! What the papers claim, beside what this workspace computes.
//!
//! [`m23::groups`] computes the rows of one paper from [`Inputs`], [`a01::groups`] those of the other from its
//! presets; [`page`] writes them down. One module a paper, one file for each group of its claims.
#![forbid(unsafe_code)]

pub mod a01;
mod error;
mod inputs;
pub mod m23;
mod page;
mod row;
mod spectrum;
mod trial;

pub use error::PaperError;
pub use inputs::Inputs;
pub use page::{page, same};
pub use row::{Group, Row, Verdict};
