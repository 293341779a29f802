//! Whose a bundle is: what was measured cannot be had again, what was made here can.
//!
//! Source: telemetry bundle format, `source` (docs/formats/bundle.md).

use std::path::Path;

use super::read::METADATA;
use super::table_files;
use crate::config::Config;

/// What `source` says of every bundle that is made here.
const MADE_HERE: &str = " by boresight, seed ";

/// `source` of a bundle that is `simulated` or `rendered` here.
///
/// ```
/// let source = telemetry::made_here("simulated", 7, 0);
/// assert_eq!(source, "simulated by boresight, seed 7, draw 0");
/// ```
#[must_use]
pub fn made_here(how: &str, seed: u64, draw: u64) -> String {
    format!("{how}{MADE_HERE}{seed}, draw {draw}")
}

/// Names of the files of a bundle that are in a folder: `bundle.toml` and tables, whatever their form.
#[must_use]
pub fn bundle_files(dir: &Path) -> Vec<String> {
    table_files()
        .chain([METADATA.to_owned()])
        .filter(|name| dir.join(name).is_file())
        .collect()
}

/// A file of a bundle in this folder that was not made here, a table where there is one; none where
/// nothing of a bundle is there, or where its `source` says that it was made here.
#[must_use]
pub fn foreign_file(dir: &Path) -> Option<String> {
    let found = bundle_files(dir).into_iter().next()?;
    (!is_made_here(dir)).then_some(found)
}

/// A `bundle.toml` that cannot be read says nothing.
fn is_made_here(dir: &Path) -> bool {
    let path = dir.join(METADATA);
    let Ok(text) = std::fs::read_to_string(&path) else {
        return false;
    };
    Config::parse(&text, METADATA)
        .and_then(|config| config.root().text("source"))
        .is_ok_and(|source| source.is_some_and(|source| source.contains(MADE_HERE)))
}
