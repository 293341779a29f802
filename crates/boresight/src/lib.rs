//! Star tracker error models that close the loop with measured data: one door to all crates.
#![forbid(unsafe_code)]
