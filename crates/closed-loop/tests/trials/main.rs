//! The loop on bundles of known truth.

mod gaps;
mod inputs;
mod invariances;
mod kit;
mod light;
mod lines;
mod noise;
mod nulls;
mod patterns;
mod power;
mod snapshots;
mod unknown;
