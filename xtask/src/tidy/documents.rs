//! References from the documents into the code: `path/to/file.rs::item`.
//!
//! Anywhere in `docs/` and the README such a reference must lead to an item that
//! exists. `docs/equations.md` must cover every equation and step of the model,
//! `docs/errata.md` every correction, each with a test.

use super::code::{Item, defines};
use super::table;
use super::{Finding, Tree};

const EQUATIONS: &str = "docs/equations.md";
const ERRATA: &str = "docs/errata.md";

/// What a row says that has no code yet.
const LATER: &str = "not yet implemented";

pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    let mut findings = references(tree);
    let equations = (1..=20).map(|n| format!("Eq. {n}"));
    let steps = (1..=5).map(|n| format!("Step {n}"));
    let header = ["equation", "what", "where"];
    findings.extend(covered(tree, EQUATIONS, &header, equations.chain(steps)));
    let errata = (1..=20).map(|n| format!("E{n}"));
    let header = ["erratum", "printed", "right", "test"];
    findings.extend(covered(tree, ERRATA, &header, errata));
    findings.extend(tests_of_errata(tree, &header));
    findings
}

/// A reference: the file and the last name of the item's path.
fn reference(code: &str) -> Option<(&str, &str)> {
    let (path, item) = code.split_once(".rs::")?;
    let path = &code[..path.len() + ".rs".len()];
    let is_plain = |c: char| c.is_alphanumeric() || "/_-.".contains(c);
    let name = item.rsplit("::").next().unwrap_or(item);
    (path.chars().all(is_plain) && !name.is_empty()).then_some((path, name))
}

fn references(tree: &Tree) -> Vec<Finding> {
    let documents = tree
        .under("docs")
        .chain(tree.text("README.md").map(|text| ("README.md", text)));
    let mut findings = Vec::new();
    for (document, text) in documents.filter(|(path, _)| path.ends_with(".md")) {
        for (index, line) in text.lines().enumerate() {
            for (path, name) in table::code(line).into_iter().filter_map(reference) {
                let message = match tree.text(path) {
                    None => format!("there is no file {path}"),
                    Some(source) if defines(source, name).is_none() => {
                        format!("{path} does not define `{name}`")
                    }
                    Some(_) => continue,
                };
                findings.push(Finding::new(document, index + 1, message));
            }
        }
    }
    findings
}

/// Every label has a row, and every row a reference or the word that it waits.
fn covered(
    tree: &Tree,
    document: &str,
    header: &[&str],
    labels: impl Iterator<Item = String>,
) -> Vec<Finding> {
    let Some(rows) = tree.text(document).and_then(|t| table::rows(t, header)) else {
        let message = format!("no table with the columns {}", header.join(" | "));
        return vec![Finding::new(document, 0, message)];
    };
    let mut findings = Vec::new();
    for label in labels {
        if !rows.iter().any(|row| row.cell(0) == label) {
            findings.push(Finding::new(document, 0, format!("no row for {label}")));
        }
    }
    for row in rows {
        let last = row.cell(header.len() - 1);
        let told = last.contains(LATER) || table::code(last).into_iter().any(is_reference);
        if !told {
            let message = format!("{}: neither a reference nor `{LATER}`", row.cell(0));
            findings.push(Finding::new(document, row.line, message));
        }
    }
    findings
}

fn is_reference(code: &str) -> bool {
    reference(code).is_some()
}

/// What `docs/errata.md` calls a test is one.
fn tests_of_errata(tree: &Tree, header: &[&str]) -> Vec<Finding> {
    let rows = tree.text(ERRATA).and_then(|t| table::rows(t, header));
    let mut findings = Vec::new();
    for row in rows.unwrap_or_default() {
        let named = table::code(row.cell(header.len() - 1));
        for (path, name) in named.into_iter().filter_map(reference) {
            let item = tree.text(path).and_then(|source| defines(source, name));
            if item == Some(Item::Other) {
                let message = format!("`{name}` in {path} is not a test");
                findings.push(Finding::new(ERRATA, row.line, message));
            }
        }
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: &str = "pub fn shift() {}\n#[test]\nfn shift_is_right() {}\n";

    fn table(header: &str, labels: impl Iterator<Item = String>, last: &str) -> String {
        let rows = labels.map(|label| format!("| {label} | a | {last} |\n"));
        format!("{header}\n|---|---|---|\n{}", rows.collect::<String>())
    }

    fn equations(last: &str) -> String {
        let labels = (1..=20)
            .map(|n| format!("Eq. {n}"))
            .chain((1..=5).map(|n| format!("Step {n}")));
        table("| equation | what | where |", labels, last)
    }

    fn errata(last: &str) -> String {
        let labels = (1..=20).map(|n| format!("E{n}"));
        table(
            "| erratum | printed | right | test |",
            labels,
            &format!("b | {last}"),
        )
    }

    fn found(equations: &str, errata: &str) -> Vec<String> {
        let tree = Tree::from_texts(&[
            (EQUATIONS, equations),
            (ERRATA, errata),
            ("crates/a/src/b.rs", SOURCE),
        ]);
        check(&tree).iter().map(ToString::to_string).collect()
    }

    const HERE: &str = "`crates/a/src/b.rs::shift`";
    const TEST: &str = "`crates/a/src/b.rs::shift_is_right`";

    #[test]
    fn order_is_no_finding() {
        assert!(found(&equations(HERE), &errata(TEST)).is_empty());
        assert!(found(&equations(HERE), &errata(LATER)).is_empty());
    }

    #[test]
    fn references_into_nothing_are_found() {
        let gone = found(&equations("`crates/a/src/c.rs::shift`"), &errata(TEST));
        assert_eq!(gone.len(), 25);
        assert_eq!(
            gone[0],
            "docs/equations.md:3: there is no file crates/a/src/c.rs"
        );
        let renamed = found(&equations("`crates/a/src/b.rs::T::shove`"), &errata(TEST));
        assert!(renamed[0].contains("does not define `shove`"));
    }

    #[test]
    fn gaps_in_the_tables_are_found() {
        let gap = equations(HERE).replace("| Eq. 7 |", "| Eq. 77 |");
        assert_eq!(
            found(&gap, &errata(TEST)),
            ["docs/equations.md: no row for Eq. 7"]
        );
        let silent = errata(TEST).replacen(TEST, "checked", 1);
        assert!(found(&equations(HERE), &silent)[0].contains("E1: neither"));
    }

    #[test]
    fn an_erratum_names_a_test() {
        let other = found(&equations(HERE), &errata(HERE));
        assert_eq!(other.len(), 20);
        assert!(other[0].contains("is not a test"));
    }

    #[test]
    fn a_reference_is_a_file_and_an_item() {
        assert_eq!(reference("a/b-c.rs::d"), Some(("a/b-c.rs", "d")));
        assert_eq!(reference("a.rs::T::new"), Some(("a.rs", "new")));
        for other in ["a.rs", "a::b", "use a.rs::b", "a.rs::"] {
            assert_eq!(reference(other), None, "{other}");
        }
    }
}
