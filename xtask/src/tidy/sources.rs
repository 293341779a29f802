//! Files under `src`: where their physics comes from, and how long they are.

use super::layers::{self, Crate};
use super::manifest;
use super::tree::is_test_file;
use super::{Finding, Tree};

/// A file holds one idea; beyond this it holds several.
const MAX_LINES: usize = 700;

/// Files that hold no physics by their name: re-exports, errors, tests.
const BY_NAME: &[&str] = &["lib.rs", "main.rs", "error.rs"];

/// The mark of a module of a physics crate that holds none.
const EXEMPTION: &str = "Not physics:";

/// The column `source` of the table of layers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Owes {
    /// `every module`
    Every,
    /// `modules with an equation`: those with a text block in their header
    WithEquation,
    /// `none`
    Nothing,
}

fn owes(cell: &str) -> Option<Owes> {
    match cell {
        "every module" => Some(Owes::Every),
        "modules with an equation" => Some(Owes::WithEquation),
        "none" => Some(Owes::Nothing),
        _ => None,
    }
}

pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    // What is wrong with the table is told by `layers`.
    let (crates, _) = layers::listed(tree);
    let mut findings = Vec::new();
    for (folder, text) in tree.crates() {
        let name = manifest::parse(text).name;
        let row = crates.iter().find(|c| c.name == name);
        let owes = row.map_or(Ok(Owes::Nothing), |row| owes(row.source).ok_or(row));
        if let Err(row) = owes {
            findings.push(unknown(row));
        }
        let owes = owes.unwrap_or(Owes::Nothing);
        for (path, text) in tree.under(&format!("{folder}/src")) {
            if path.ends_with(".rs") {
                findings.extend(too_long(path, text));
                findings.extend(no_source(path, text, owes));
            }
        }
    }
    findings
}

fn unknown(row: &Crate<'_>) -> Finding {
    let message = format!(
        "`{}`: source `{}` is none of `every module`, `modules with an equation`, `none`",
        row.name, row.source
    );
    Finding::new("docs/architecture.md", row.line, message)
}

fn too_long(path: &str, text: &str) -> Option<Finding> {
    let lines = text.lines().count();
    let message = format!("{lines} lines; a file holds one idea in at most {MAX_LINES}");
    (lines > MAX_LINES).then(|| Finding::new(path, 0, message))
}

fn no_source(path: &str, text: &str, owes: Owes) -> Option<Finding> {
    let header: Vec<&str> = text
        .lines()
        .map_while(|line| line.strip_prefix("//!"))
        .map(str::trim)
        .collect();
    let owed = match owes {
        Owes::Nothing => false,
        Owes::WithEquation => header.iter().any(|line| line.starts_with("```text")),
        Owes::Every => true,
    };
    let by_name = BY_NAME.iter().any(|end| path.ends_with(&format!("/{end}")));
    let says = |mark: &str| {
        header
            .iter()
            .any(|line| line.strip_prefix(mark).is_some_and(|rest| !rest.is_empty()))
    };
    let told = says("Source:") || says("Sources:") || says(EXEMPTION);
    let message = format!("no `//! Source: ..` in the header (or `//! {EXEMPTION} why`)");
    (owed && !by_name && !is_test_file(path) && !told).then(|| Finding::new(path, 1, message))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn misses(path: &str, text: &str, owes: Owes) -> bool {
        no_source(path, text, owes).is_some()
    }

    #[test]
    fn a_module_without_source_is_found() {
        let path = "crates/a/src/b.rs";
        assert!(misses(path, "//! Title.\nfn f() {}", Owes::Every));
        assert!(misses(path, "", Owes::Every));
        assert!(misses(path, "//! Source:\n", Owes::Every), "empty");
        assert!(misses(path, "//! A.\n\n//! Source: late.\n", Owes::Every));
        assert!(misses(path, "fn f() {}\n// Source: x\n", Owes::Every));
        assert!(!misses(path, "//! A.\n//!\n//! Source: X.\n", Owes::Every));
        assert!(!misses(path, "//! Not physics: slices.\n", Owes::Every));
        assert!(!misses("crates/a/src/lib.rs", "", Owes::Every));
        assert!(!misses("crates/a/src/b/tests.rs", "", Owes::Every));
        assert!(!misses(path, "", Owes::Nothing));
    }

    #[test]
    fn an_equation_asks_for_its_source() {
        let path = "crates/a/src/b.rs";
        let with = "//! A.\n//!\n//! ```text\n//! x = y\n//! ```\n";
        assert!(misses(path, with, Owes::WithEquation));
        assert!(!misses(path, "//! A.\n", Owes::WithEquation));
        let told = format!("{with}//! Source: X.\n");
        assert!(!misses(path, &told, Owes::WithEquation));
    }

    #[test]
    fn length_is_counted() {
        assert_eq!(too_long("a.rs", &"\n".repeat(MAX_LINES)), None);
        assert!(too_long("a.rs", &"\n".repeat(MAX_LINES + 1)).is_some());
    }

    #[test]
    fn check_follows_the_table() {
        let table = |source: &str| {
            format!(
                "| crate | layer | depends on | must not name | source |\n|---|---|---|---|---|\n\
                 | `a` | 0 | | | {source} |\n"
            )
        };
        let count = |source: &str| {
            let table = table(source);
            let tree = Tree::from_texts(&[
                ("docs/architecture.md", table.as_str()),
                ("crates/a/Cargo.toml", "[package]\nname = \"a\"\n"),
                ("crates/a/src/b.rs", "//! B.\n"),
            ]);
            check(&tree).len()
        };
        assert_eq!(count("none"), 0);
        assert_eq!(count("every module"), 1);
        assert_eq!(count("some"), 1, "a word the document does not know");
    }
}
