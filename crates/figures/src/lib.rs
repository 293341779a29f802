//! Plots as SVG text: plain numbers in, one `String` out.
//!
//! - [`Figure`] holds [`Panel`]s side by side; [`Figure::svg`] draws them;
//! - a [`Panel`] has two [`Axis`], and [`Mark`]s in the order in which they are painted: lines, bands,
//!   points, arrows, coloured cells;
//! - [`Panel::psd`], [`Panel::time`], [`Panel::focal_plane`], [`Panel::phase`], [`Panel::map`] have the axes of
//!   the pictures that star trackers need;
//! - [`FieldBins`], [`PhaseBins`] and [`Envelope`] average what would be too many points.
//!
//! Text is real text, lines end at the frame, nothing is loaded from elsewhere, and no two figures share a
//! name: any number of them goes into one HTML page. The writer is this crate's own, because the plotting
//! libraries at hand round to whole pixels and neither clip nor dash.
//!
//! ```
//! use figures::{Axis, Colour, Figure, Mark, Panel};
//!
//! let f: Vec<f64> = (1..200).map(|k| f64::from(k) * 0.01).collect();
//! let psd: Vec<f64> = f.iter().map(|f| 3.0 + 1.0 / (f * f)).collect();
//! let panel = Panel::psd("x axis", "arcsec²/Hz")
//!     .with(Mark::line(&f, &psd, Colour::MEASURED).named("measured"));
//! let svg = Figure::new("Residual of a tracker", vec![panel]).svg();
//! assert!(svg.starts_with("<svg") && svg.contains("arcsec²/Hz") && svg.contains("measured"));
//! # let _ = Axis::linear("s");
//! ```
#![forbid(unsafe_code)]

mod axis;
mod bins;
mod colour;
mod figure;
mod mark;
mod paint;
mod panel;
mod thin;

pub use axis::Axis;
pub use bins::{Envelope, FieldBins, PhaseBins};
pub use colour::{Colour, Scale};
pub use figure::Figure;
pub use mark::{Mark, Shape};
pub use paint::long_arrow;
pub use panel::Panel;
