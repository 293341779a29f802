//! What is left when every effect is found: described, as no effect explains it.
//!
//! ```text
//! leftover        lines and jumps in time, of what all rows of a frame share
//! star_series     lines and steps in time, of each star by itself
//! star_freedom    how many numbers those stars tell
//! pattern         a wave on the detector, of any direction and pitch
//! ```
//!
//! What it follows among the measured variables is described while causes are named
//! ([`crate::causes`]).
//!
//! Not physics: the contents of a folder.

mod around;
mod grid;
pub(crate) mod leftover;
pub(crate) mod pattern;
mod star_freedom;
pub(crate) mod star_series;
