//! The catalogue of effects: forward action and regressors together.
#![forbid(unsafe_code)]
