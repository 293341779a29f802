//! One module a command.

pub(crate) mod assess;
pub(crate) mod close;
pub(crate) mod compare;
pub(crate) mod fit;
pub(crate) mod render;
pub(crate) mod simulate;
