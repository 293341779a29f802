//! Motions and skies: bundles simulated from a scenario.
#![forbid(unsafe_code)]
