//! The loop on bundles of known truth.

mod attitudes;
mod declared;
mod free_frames;
mod gaps;
mod in_time;
mod inputs;
mod invariances;
mod kit;
mod light;
mod noise;
mod nulls;
mod off_grid;
mod orbits;
mod patterns;
mod power;
mod restless;
mod snapshots;
mod star_constants;
mod unknown;
