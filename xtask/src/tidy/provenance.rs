//! Fixtures: each has its row in `fixtures/PROVENANCE.md`, each row its file.

use std::collections::BTreeMap;

use super::table;
use super::{Finding, Tree};

const DOCUMENT: &str = "fixtures/PROVENANCE.md";
const HEADER: &[&str] = &["path", "where from", "licence, or how made", "command"];

pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    let Some(rows) = tree.text(DOCUMENT).and_then(|t| table::rows(t, HEADER)) else {
        let columns = HEADER.join(" | ");
        let message = format!("no table with the columns {columns}");
        return vec![Finding::new(DOCUMENT, 0, message)];
    };
    let mut findings = Vec::new();
    let mut listed = BTreeMap::new();
    for row in rows {
        let mut find = |message| findings.push(Finding::new(DOCUMENT, row.line, message));
        let [name] = table::code(row.cell(0))[..] else {
            find(format!("`{}` is not one path in backticks", row.cell(0)));
            continue;
        };
        if row.cells.len() != HEADER.len() || row.cells[1..3].contains(&"") {
            find(format!("`{name}`: a cell is missing or empty"));
        }
        if listed.insert(name, row.line).is_some() {
            find(format!("`{name}` is listed twice"));
        }
        if tree.text(&format!("fixtures/{name}")).is_none() {
            find(format!("there is no file fixtures/{name}"));
        }
    }
    for (path, _) in tree.under("fixtures") {
        let name = path.trim_start_matches("fixtures/");
        if path != DOCUMENT && !listed.contains_key(name) {
            let message = format!("no row in {DOCUMENT}");
            findings.push(Finding::new(path, 0, message));
        }
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(rows: &str, files: &[&str]) -> Vec<String> {
        let document = format!(
            "| path | where from | licence, or how made | command |\n|---|---|---|---|\n{rows}"
        );
        let mut texts = vec![(DOCUMENT, document.as_str())];
        texts.extend(files.iter().map(|&file| (file, "")));
        check(&Tree::from_texts(&texts))
            .iter()
            .map(ToString::to_string)
            .collect()
    }

    const ROW: &str = "| `a/b.csv` | SciPy 1.14 | made | `python3 make_b.py` |\n";

    #[test]
    fn files_and_rows_agree() {
        assert!(found(ROW, &["fixtures/a/b.csv"]).is_empty());
        assert_eq!(
            found(ROW, &["fixtures/a/b.csv", "fixtures/a/c.csv"]),
            ["fixtures/a/c.csv: no row in fixtures/PROVENANCE.md"]
        );
        assert_eq!(
            found(ROW, &[]),
            ["fixtures/PROVENANCE.md:3: there is no file fixtures/a/b.csv"]
        );
    }

    #[test]
    fn rows_that_say_nothing_are_found() {
        let files = &["fixtures/a/b.csv"];
        assert!(found(&format!("{ROW}{ROW}"), files)[0].contains("twice"));
        assert!(found("| `a/b.csv` | | made | x |\n", files)[0].contains("empty"));
        assert!(found("| `a/b.csv` | here | made |\n", files)[0].contains("missing"));
        assert!(found("| a/b.csv | here | made | x |\n", files)[0].contains("backticks"));
    }
}
