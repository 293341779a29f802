//! What is asked once the search is over: how sure, what else, and what would tell.
//!
//! ```text
//! hypothesis      what the data says of an effect that somebody asks about by name
//! confusion       what else could have explained the residual
//! manoeuvre       which small motion would tell the two apart
//! ```
//!
//! Not physics: the contents of a folder.

pub(crate) mod confusion;
pub(crate) mod hypothesis;
pub(crate) mod manoeuvre;
