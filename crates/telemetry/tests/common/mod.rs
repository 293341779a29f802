//! Bundles of the repository in memory, to be changed by a test.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::allow_attributes,
    reason = "each test file uses its own part of this one"
)]

use std::fs;
use std::path::{Path, PathBuf};

use telemetry::{Bundle, MemoryFiles};

/// A path below the root of the repository.
pub fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(path)
}

/// A folder of `fixtures/bundles`, in memory, under the label `b`.
pub fn fixture(name: &str) -> MemoryFiles {
    let folder = repository("fixtures/bundles").join(name);
    let mut files = MemoryFiles::new("b");
    for entry in fs::read_dir(&folder).expect("the fixture is there") {
        let path = entry.expect("a file").path();
        let name = path.file_name().and_then(|n| n.to_str()).expect("a name");
        files.insert(name, fs::read(&path).expect("can be read"));
    }
    files
}

/// The text of a file.
pub fn text(files: &MemoryFiles, name: &str) -> String {
    let bytes = files.get(name).expect("the file is there");
    String::from_utf8(bytes.to_vec()).expect("text")
}

/// The message with which a bundle is refused.
pub fn refusal(files: &MemoryFiles) -> String {
    Bundle::read_from(files)
        .expect_err("a faulty bundle")
        .to_string()
}
