//! Units, coordinates, pinhole, attitude and stars of a star tracker.
#![forbid(unsafe_code)]
