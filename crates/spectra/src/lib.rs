//! Power spectra, coherence and Allan deviation of error series.
#![forbid(unsafe_code)]
