//! What is asked once the search is over: how sure, what else, and what would tell.
//!
//! ```text
//! hypothesis      what the data says of an effect that somebody asks about by name
//! confusion       what else could have explained the residual
//! manoeuvre       which small motion would tell the two apart
//! needed          how large an effect would have to be to explain the residual by itself
//! told            coefficients as the parameters of the catalogue
//! ```
//!
//! Not physics: the contents of a folder.

pub(crate) mod confusion;
pub(crate) mod hypothesis;
pub(crate) mod manoeuvre;
pub(crate) mod needed;
pub(crate) mod told;
