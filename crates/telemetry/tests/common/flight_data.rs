//! Where measurements of real instruments are. They are no part of the project: `BORESIGHT_DATA`
//! names their folder; without it, `../shared/data` beside the workspace.

use std::path::{Path, PathBuf};

/// A bundle of flight data, or `None` and a line that says where it was looked for.
///
/// # Panics
/// When there is none and `BORESIGHT_REQUIRE_DATA=1`.
#[expect(clippy::print_stderr, reason = "a test that has not run must say so")]
pub(crate) fn flight_data(name: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let root = std::env::var_os("BORESIGHT_DATA").map_or_else(beside, PathBuf::from);
    let folder = root.join(name);
    if folder.join("bundle.toml").is_file() {
        return Some(folder);
    }
    let required = std::env::var_os("BORESIGHT_REQUIRE_DATA").is_some_and(|value| value == "1");
    assert!(
        !required,
        "BORESIGHT_REQUIRE_DATA=1, but there are no flight data in {}",
        folder.display()
    );
    eprintln!(
        "SKIPPED: no flight data in {}; set BORESIGHT_DATA",
        folder.display()
    );
    None
}
