//! Text and pictures from finished results.
//!
//! Nothing is computed here that is not drawn: the crate can be deleted without changing a number.
#![forbid(unsafe_code)]

mod assess_figures;
mod assess_text;
#[cfg(test)]
mod bare;
mod compare_figures;
mod compare_tables;
mod compare_text;
mod fit_text;
mod html;
mod number;
mod order;
mod scene_figures;
mod set_aside;
mod text;
mod verdict;
mod why_not;
mod windows;

pub use assess_figures::assess_figures;
pub use assess_text::assess_summary;
pub use compare_figures::compare_figures;
pub use compare_tables::compare_tables;
pub use compare_text::compare_summary;
pub use fit_text::fit_summary;
pub use html::{Run, html};
pub use scene_figures::scene_figures;
pub use text::summary;
