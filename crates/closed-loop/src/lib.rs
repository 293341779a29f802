//! Residual, cause, better model: the loop from telemetry back to the model.
#![forbid(unsafe_code)]
