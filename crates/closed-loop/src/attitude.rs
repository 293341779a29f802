//! Attitudes as the measurement: the tracker's own against a better one.
//!
//! ```text
//! run, finish     the order of the steps, from bundle to what is found, and to the report
//! data            the rotation between both, axis by axis, as evidence for the search
//! mixing          noise that the axes share
//! motion_terms    what it may follow of the motion
//! quest           the search, and another one with what the first leaves
//! search          every hypothesis with its own noise
//! noise           that of each axis
//! fitted          what a fit leaves
//! declared_effects  what the declared effects turn it by
//! spatial_errors  what the declared model itself makes of crossing and changing stars
//! imagined        the same from drawn skies and fields, and its lines
//! likeness        how much of an effect that makes
//! left            what is left follows, and what of it is slow
//! steadied        the reference's path less its slow error
//! ```
//!
//! Not physics: the contents of a folder.

pub(crate) mod data;
mod declared_effects;
mod finish;
mod fitted;
mod imagined;
mod inquiry;
mod left;
mod likeness;
mod line_level;
pub(crate) mod mixing;
mod motion_terms;
mod noise;
mod run;
mod search;
pub(crate) mod spatial_errors;
mod steadied;

pub(crate) use run::run;
