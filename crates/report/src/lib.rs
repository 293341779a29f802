//! Text from finished results; computes nothing.
#![forbid(unsafe_code)]
