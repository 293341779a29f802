//! The physics-based star tracker model: truth attitude in, centroids and attitude out.
#![forbid(unsafe_code)]
