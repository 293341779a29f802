//! First-order Gauss-Markov processes: exact simulation, spectra, and fits to them.
#![forbid(unsafe_code)]
