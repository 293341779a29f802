//! One module a command.

pub(crate) mod close;
pub(crate) mod render;
pub(crate) mod simulate;
