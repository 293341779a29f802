//! QUEST attitude from star vectors, one frame or a batch.
#![forbid(unsafe_code)]
