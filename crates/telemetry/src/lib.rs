//! Bundles, models and results on disk.
#![forbid(unsafe_code)]
