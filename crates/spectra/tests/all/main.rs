//! Tests of spectra against independent programs, theory and identities.
mod allan;
mod bands;
mod cases;
mod cross;
mod errors;
mod identities;
mod irregular;
mod lines;
mod oracle;
mod tapers;
