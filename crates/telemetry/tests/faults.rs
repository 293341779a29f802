//! Every fault of the format's list, one at a time, made from a good bundle. A message must name
//! the file, the line, the column, what was expected and what was found.

mod common;
#[path = "faults/files.rs"]
mod files;
#[path = "faults/metadata.rs"]
mod metadata;
#[path = "faults/tables.rs"]
mod tables;

use common::{fixture, refusal, text};
use telemetry::MemoryFiles;

/// The good bundle with one place of one file changed.
fn changed(file: &str, from: &str, to: &str) -> MemoryFiles {
    let mut files = fixture("complete");
    let before = text(&files, file);
    assert!(before.contains(from), "{file} has no {from:?}");
    files.insert(file, before.replacen(from, to, 1).into_bytes());
    files
}

/// The good bundle with one line (1-based) of one file changed.
fn line_changed(file: &str, line: usize, change: impl Fn(&str) -> String) -> MemoryFiles {
    let mut files = fixture("complete");
    let mut lines: Vec<String> = text(&files, file).lines().map(String::from).collect();
    lines[line - 1] = change(&lines[line - 1]);
    files.insert(file, (lines.join("\n") + "\n").into_bytes());
    files
}

/// One cell of one line changed.
fn cell_changed(file: &str, line: usize, column: &str, to: &str) -> MemoryFiles {
    let header = text(&fixture("complete"), file);
    let names: Vec<&str> = header.lines().next().unwrap_or("").split(',').collect();
    let at = names.iter().position(|name| *name == column);
    let at = at.expect("a column of the table");
    line_changed(file, line, |line| {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[at] = to;
        cells.join(",")
    })
}

#[track_caller]
fn check(files: &MemoryFiles, parts: &[&str]) {
    let message = refusal(files);
    for part in parts {
        assert!(message.contains(part), "no {part:?} in:\n{message}");
    }
}
