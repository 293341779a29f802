//! Centroid errors per star and centroids per window, the triangle against `asin(sin)` as printed.
//!
//! `cargo bench -p centroid --bench triangle`

fn main() {}
