//! Ctrl-C: what is half-written goes.

use boresight::telemetry::remove_unfinished;

/// As a shell tells of a program that was interrupted.
const INTERRUPTED: i32 = 130;

/// From now on an interrupted run leaves nothing behind.
#[expect(
    clippy::exit,
    reason = "the answer to Ctrl-C, after what was half-written is gone"
)]
pub(crate) fn leave_nothing() {
    // Fails only when there is a handler already, which nothing before this made.
    let _ = ctrlc::set_handler(|| {
        remove_unfinished();
        std::process::exit(INTERRUPTED)
    });
}
