//! What the papers claim, beside what this workspace computes.
//!
//! [`m23::groups`] computes every row from [`Inputs`]; [`page`] writes them down. Another paper is
//! another module beside `m23`, one file for each group of its claims.
#![forbid(unsafe_code)]

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
