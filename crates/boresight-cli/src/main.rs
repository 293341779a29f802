//! The command `boresight`.
#![forbid(unsafe_code)]
fn main() {}
