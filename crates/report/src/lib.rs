//! Text from finished results.
//!
//! Nothing is computed here: the crate can be deleted without changing a number.
#![forbid(unsafe_code)]

mod fit_text;
mod text;

pub use fit_text::fit_summary;
pub use text::summary;
