//! Crates against the table of layers in `docs/architecture.md`.

use super::code::Code;
use super::manifest::{self, Kind, Manifest};
use super::table::{self, Row};
use super::tree::is_test_file;
use super::{Finding, Tree};

const DOCUMENT: &str = "docs/architecture.md";
const HEADER: &[&str] = &["crate", "layer", "depends on", "must not name", "source"];

/// One row of the table.
#[derive(Debug)]
pub(super) struct Crate<'a> {
    pub(super) name: &'a str,
    /// `None` (a dash): outside the layers; nothing may depend on it.
    layer: Option<u32>,
    depends_on: Vec<&'a str>,
    must_not_name: Vec<&'a str>,
    /// Which modules owe a source: see `sources`.
    pub(super) source: &'a str,
    pub(super) line: usize,
}

/// The crates that the document lists, and what is wrong with the table itself.
pub(super) fn listed(tree: &Tree) -> (Vec<Crate<'_>>, Vec<Finding>) {
    let rows = tree.text(DOCUMENT).and_then(|t| table::rows(t, HEADER));
    let Some(rows) = rows else {
        let columns = HEADER.join(" | ");
        let message = format!("no table with the columns {columns}");
        return (vec![], vec![Finding::new(DOCUMENT, 0, message)]);
    };
    let mut findings = Vec::new();
    let crates = rows
        .iter()
        .filter_map(|row| match read(row) {
            Ok(listed) => Some(listed),
            Err(message) => {
                findings.push(Finding::new(DOCUMENT, row.line, message));
                None
            }
        })
        .collect();
    (crates, findings)
}

fn read<'a>(row: &Row<'a>) -> Result<Crate<'a>, String> {
    let name = match table::code(row.cell(0)).as_slice() {
        [name] => *name,
        _ => return Err(format!("`{}` is not one crate's name", row.cell(0))),
    };
    let layer = match row.cell(1) {
        "-" => None,
        cell => Some(
            cell.parse()
                .map_err(|_| format!("`{name}`: layer `{cell}` is neither a number nor `-`"))?,
        ),
    };
    Ok(Crate {
        name,
        layer,
        depends_on: table::code(row.cell(2)),
        must_not_name: table::code(row.cell(3)),
        source: row.cell(4),
        line: row.line,
    })
}

pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    let (crates, mut findings) = listed(tree);
    let manifests: Vec<(&str, Manifest)> = tree
        .crates()
        .map(|(folder, text)| (folder, manifest::parse(text)))
        .collect();

    findings.extend(table_itself(&crates, &manifests));
    findings.extend(paragraphs(tree, &crates));
    for (folder, manifest) in &manifests {
        let path = format!("{folder}/Cargo.toml");
        if !manifest.inherits_lints {
            let message = "no `[lints] workspace = true`".to_owned();
            findings.push(Finding::new(&path, 0, message));
        }
        match crates.iter().find(|c| c.name == manifest.name) {
            Some(row) => {
                findings.extend(dependencies(&path, manifest, row, &crates));
                findings.extend(forbidden_names(tree, folder, row));
            }
            None => {
                let message = format!("crate `{}` is not in {DOCUMENT}", manifest.name);
                findings.push(Finding::new(&path, 0, message));
            }
        }
    }
    findings
}

/// The table: rows that name no crate, dependencies that point up or that no
/// manifest declares.
fn table_itself(crates: &[Crate<'_>], manifests: &[(&str, Manifest)]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for row in crates {
        let mut find = |message| findings.push(Finding::new(DOCUMENT, row.line, message));
        let manifest = manifests.iter().find(|(_, m)| m.name == row.name);
        let Some((_, manifest)) = manifest else {
            find(format!("there is no crate `{}`", row.name));
            continue;
        };
        for &name in &row.depends_on {
            let Some(below) = crates.iter().find(|c| c.name == name) else {
                find(format!("`{}` depends on `{name}`, not listed", row.name));
                continue;
            };
            if !reaches(row, below) {
                find(format!("`{}` depends upward on `{name}`", row.name));
            }
            let declared = |d: &manifest::Dependency| d.name == name && d.kind == Kind::Built;
            if !manifest.dependencies.iter().any(declared) {
                find(format!("`{}` does not depend on `{name}`", row.name));
            }
        }
    }
    findings
}

/// Whether a dependency of `from` on `to` points down or sideways.
fn reaches(from: &Crate<'_>, to: &Crate<'_>) -> bool {
    matches!((from.layer, to.layer), (Some(from), Some(to)) if to <= from)
}

fn dependencies(
    path: &str,
    manifest: &Manifest,
    row: &Crate<'_>,
    crates: &[Crate<'_>],
) -> Vec<Finding> {
    let mut findings = Vec::new();
    for dependency in &manifest.dependencies {
        let Some(below) = crates.iter().find(|c| c.name == dependency.name) else {
            continue; // from outside the workspace
        };
        let (from, to) = (row.name, below.name);
        // Tests may use what stands beside or below without saying so.
        let message = if !reaches(row, below) {
            format!("`{from}` depends upward on `{to}`")
        } else if dependency.kind == Kind::Built && !row.depends_on.contains(&to) {
            let way = if row.layer == below.layer {
                "sideways on"
            } else {
                "on"
            };
            format!("`{from}` depends {way} `{to}`, which {DOCUMENT} does not list")
        } else {
            continue;
        };
        findings.push(Finding::new(path, dependency.line, message));
    }
    findings
}

fn forbidden_names(tree: &Tree, folder: &str, row: &Crate<'_>) -> Vec<Finding> {
    let mut findings = Vec::new();
    if row.must_not_name.is_empty() {
        return findings;
    }
    let sources = format!("{folder}/src");
    for (path, text) in tree.under(&sources) {
        if !path.ends_with(".rs") || is_test_file(path) {
            continue;
        }
        let code = Code::new(text);
        for name in &row.must_not_name {
            for line in code.naming(name) {
                let message = format!("`{}` must not name `{name}`", row.name);
                findings.push(Finding::new(path, line, message));
            }
        }
    }
    findings
}

/// Each crate has its paragraph, which says what the crate must not know.
fn paragraphs(tree: &Tree, crates: &[Crate<'_>]) -> Vec<Finding> {
    let text = tree.text(DOCUMENT).unwrap_or_default();
    let mut findings = Vec::new();
    for row in crates {
        let start = format!("**`{}`**", row.name);
        let paragraph = text.split("\n\n").find(|p| p.trim().starts_with(&start));
        let message = match paragraph {
            None => format!("no paragraph on `{}`", row.name),
            Some(paragraph) if !paragraph.contains("It must not know") => {
                format!("`{}`: not said what it must not know", row.name)
            }
            Some(_) => continue,
        };
        findings.push(Finding::new(DOCUMENT, row.line, message));
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "\
| crate | layer | depends on | must not name | source |
|---|---|---|---|---|
| `low` | 0 | | `std::fs` | none |
| `beside` | 0 | `low` | | none |
| `high` | 1 | `low` | `truth.json` | none |
| `chores` | - | | | none |

**`low`** is low. It must not know files.

**`beside`** is low. It must not know high.

**`high`** is high. It must not know the truth.

**`chores`** launches. It must not know anything.
";

    fn manifest(name: &str, rest: &str) -> String {
        format!("[package]\nname = \"{name}\"\n[lints]\nworkspace = true\n{rest}")
    }

    /// Findings of a workspace that is in order but for the given changes.
    fn found(changes: &[(&str, &str)]) -> Vec<String> {
        let manifests = [
            manifest("low", ""),
            manifest("beside", "[dependencies]\nlow.workspace = true\n"),
            manifest("high", "[dependencies]\nlow.workspace = true\n"),
            manifest("chores", ""),
        ];
        let mut files = vec![
            (DOCUMENT, TABLE),
            ("crates/low/Cargo.toml", manifests[0].as_str()),
            ("crates/beside/Cargo.toml", manifests[1].as_str()),
            ("crates/high/Cargo.toml", manifests[2].as_str()),
            ("xtask/Cargo.toml", manifests[3].as_str()),
        ];
        for change in changes {
            files.retain(|(path, _)| path != &change.0);
            if !change.1.is_empty() {
                files.push(*change);
            }
        }
        let tree = Tree::from_texts(&files);
        check(&tree).iter().map(ToString::to_string).collect()
    }

    fn one(changes: &[(&str, &str)], part: &str) {
        let found = found(changes);
        assert!(
            found.len() == 1 && found[0].contains(part),
            "`{part}` is not the one finding in {found:?}"
        );
    }

    #[test]
    fn order_is_no_finding() {
        assert_eq!(found(&[]), Vec::<String>::new());
    }

    #[test]
    fn upward_unlisted_and_sideways_dependencies_are_found() {
        let upward = manifest("low", "[dependencies]\nhigh.workspace = true\n");
        one(
            &[("crates/low/Cargo.toml", &upward)],
            "crates/low/Cargo.toml:6: `low` depends upward on `high`",
        );
        let tests = manifest("low", "[dev-dependencies]\nhigh.workspace = true\n");
        one(&[("crates/low/Cargo.toml", &tests)], "depends upward");
        let chores = manifest("low", "[build-dependencies]\nchores.workspace = true\n");
        one(&[("crates/low/Cargo.toml", &chores)], "depends upward");
        let sideways = manifest("low", "[dependencies]\nbeside = { path = \"../beside\" }\n");
        one(&[("crates/low/Cargo.toml", &sideways)], "depends sideways");
        let unlisted = manifest(
            "high",
            "[dependencies]\nlow.workspace = true\nbeside.workspace = true\n",
        );
        one(&[("crates/high/Cargo.toml", &unlisted)], "does not list");
    }

    #[test]
    fn tests_may_use_what_stands_below() {
        let tests = manifest(
            "high",
            "[dependencies]\nlow.workspace = true\n[dev-dependencies]\nbeside.workspace = true\n",
        );
        assert!(found(&[("crates/high/Cargo.toml", &tests)]).is_empty());
    }

    #[test]
    fn crates_outside_the_table_and_rows_without_crate_are_found() {
        let other = manifest("other", "");
        one(
            &[("crates/other/Cargo.toml", &other)],
            "crate `other` is not in docs/architecture.md",
        );
        one(&[("xtask/Cargo.toml", "")], "there is no crate `chores`");
    }

    #[test]
    fn a_table_that_is_not_true_is_found() {
        let idle = manifest("high", "");
        one(
            &[("crates/high/Cargo.toml", &idle)],
            "docs/architecture.md:5: `high` does not depend on `low`",
        );
        let up = TABLE.replace("| `low` | 0 | |", "| `low` | 2 | |");
        let up = found(&[(DOCUMENT, &up)]);
        assert_eq!(up.len(), 4, "{up:?}"); // two rows and two manifests
        let layer = TABLE.replace("| `chores` | - |", "| `chores` | top |");
        assert!(found(&[(DOCUMENT, &layer)])[0].contains("layer `top`"));
        let paragraph = TABLE.replace(" It must not know high.", "");
        one(&[(DOCUMENT, &paragraph)], "`beside`: not said");
    }

    #[test]
    fn forbidden_names_are_found_outside_tests() {
        let source = "use std::{fmt, fs};\n#[cfg(test)]\nmod tests { use std::fs; }\n";
        one(
            &[("crates/low/src/lib.rs", source)],
            "crates/low/src/lib.rs:1: `low` must not name `std::fs`",
        );
        one(
            &[("crates/high/src/a.rs", "const T: &str = \"x/truth.json\";")],
            "must not name `truth.json`",
        );
        assert!(found(&[("crates/high/src/a.rs", "// truth.json\nuse std::fs;")]).is_empty());
    }

    #[test]
    fn own_lints_are_found() {
        one(
            &[("crates/low/Cargo.toml", "[package]\nname = \"low\"\n")],
            "workspace = true",
        );
    }
}
