//! Text from finished results.
//!
//! Nothing is computed here: the crate can be deleted without changing a number.
#![forbid(unsafe_code)]

mod text;

pub use text::summary;
