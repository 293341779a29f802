//! Low spatial frequency error: distortion residual polynomials.
#![forbid(unsafe_code)]
