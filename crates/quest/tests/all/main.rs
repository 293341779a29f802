//! Tests of QUEST against independent solutions, theory and its own invariances.
mod agreement;
mod batch;
mod cases;
mod errata;
mod errors;
mod invariance;
mod oracle;
