//! What the compiler cannot see.
//!
//! Every check reads the same [`Tree`] of files and returns all that it finds;
//! none stops at the first, and none changes a file. What a check holds the code
//! against stands in `docs/architecture.md` and the other documents, never here.

mod code;
mod documents;
mod layers;
mod manifest;
mod provenance;
mod readme;
mod sources;
mod table;
mod tree;

use std::fmt;

pub(crate) use tree::Tree;

/// Something that is not as the documents say.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Finding {
    /// Relative to the root of the workspace.
    path: String,
    /// 1-based; 0 where the whole file is meant.
    line: usize,
    message: String,
}

impl Finding {
    fn new(path: &str, line: usize, message: String) -> Self {
        Self {
            path: path.to_owned(),
            line,
            message,
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.line == 0 {
            write!(f, "{}: {}", self.path, self.message)
        } else {
            write!(f, "{}:{}: {}", self.path, self.line, self.message)
        }
    }
}

const CHECKS: &[fn(&Tree) -> Vec<Finding>] = &[
    layers::check,
    sources::check,
    provenance::check,
    documents::check,
    readme::check,
];

/// All findings of all checks.
pub(crate) fn findings(tree: &Tree) -> Vec<Finding> {
    CHECKS.iter().flat_map(|check| check(tree)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_check_has_its_say() {
        // An empty workspace lacks every document: no check may hide behind
        // the findings of another.
        let found = findings(&Tree::from_texts(&[]));
        for document in [
            "docs/architecture.md",
            "docs/equations.md",
            "docs/errata.md",
            "fixtures/PROVENANCE.md",
            "README.md",
        ] {
            assert!(found.iter().any(|f| f.path == document), "{document}");
        }
    }

    #[test]
    fn a_finding_is_a_place_to_go_to() {
        let finding = Finding::new("a/b.rs", 3, "wrong".to_owned());
        assert_eq!(finding.to_string(), "a/b.rs:3: wrong");
        let whole = Finding::new("a/b.rs", 0, "missing".to_owned());
        assert_eq!(whole.to_string(), "a/b.rs: missing");
    }
}
