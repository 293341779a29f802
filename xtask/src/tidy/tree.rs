//! The files that the checks read, held in memory.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

/// Relative path (with `/`) to text; the text of a data file is left empty.
#[derive(Debug, Default)]
pub(crate) struct Tree {
    files: BTreeMap<String, String>,
}

/// What is looked at, from the root.
const ROOTS: &[&str] = &["README.md", ".ci", "crates", "docs", "fixtures", "xtask"];

/// Read as text; anything else only has to exist.
const TEXT: &[&str] = &[".rs", ".md", "Cargo.toml", ".ci/run"];

impl Tree {
    /// Reads the workspace at `root`.
    pub(crate) fn load(root: &Path) -> io::Result<Self> {
        let mut tree = Self::default();
        for name in ROOTS {
            if root.join(name).exists() {
                tree.add(root, name)?;
            }
        }
        Ok(tree)
    }

    #[cfg(test)]
    pub(crate) fn from_texts(files: &[(&str, &str)]) -> Self {
        let own = |&(path, text): &(&str, &str)| (path.to_owned(), text.to_owned());
        Self {
            files: files.iter().map(own).collect(),
        }
    }

    fn add(&mut self, root: &Path, name: &str) -> io::Result<()> {
        let path = root.join(name);
        if path.is_dir() {
            for entry in fs::read_dir(&path)? {
                let entry = entry?.file_name();
                let entry = entry.to_string_lossy();
                if entry != "target" && entry != "__pycache__" {
                    self.add(root, &format!("{name}/{entry}"))?;
                }
            }
        } else {
            let text = if TEXT.iter().any(|end| name.ends_with(end)) {
                fs::read_to_string(&path)
                    .map_err(|e| io::Error::new(e.kind(), format!("{name}: {e}")))?
            } else {
                String::new()
            };
            self.files.insert(name.to_owned(), text);
        }
        Ok(())
    }

    pub(crate) fn len(&self) -> usize {
        self.files.len()
    }

    /// The text of one file.
    pub(crate) fn text(&self, path: &str) -> Option<&str> {
        self.files.get(path).map(String::as_str)
    }

    /// Files under a folder, in order, with their texts.
    pub(crate) fn under<'a>(
        &'a self,
        folder: &'a str,
    ) -> impl Iterator<Item = (&'a str, &'a str)> + 'a {
        self.files.iter().filter_map(move |(path, text)| {
            path.strip_prefix(folder)?
                .starts_with('/')
                .then_some((path.as_str(), text.as_str()))
        })
    }

    /// Folders that hold a crate: `xtask` and those right under `crates`.
    pub(crate) fn crates(&self) -> impl Iterator<Item = (&str, &str)> {
        self.files.iter().filter_map(|(path, text)| {
            let folder = path.strip_suffix("/Cargo.toml")?;
            let leaf = folder.strip_prefix("crates/").unwrap_or(folder);
            (!leaf.contains('/')).then_some((folder, text.as_str()))
        })
    }
}

/// Files that are compiled for tests alone.
pub(super) fn is_test_file(path: &str) -> bool {
    path.ends_with("/tests.rs") || path.contains("/tests/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn under_is_a_folder_not_a_prefix() {
        let tree = Tree::from_texts(&[("crates/a/src/lib.rs", ""), ("crates/ab/src/lib.rs", "")]);
        let found: Vec<_> = tree.under("crates/a").map(|(path, _)| path).collect();
        assert_eq!(found, ["crates/a/src/lib.rs"]);
    }

    #[test]
    fn crates_are_the_folders_with_a_manifest() {
        let tree = Tree::from_texts(&[
            ("crates/a/Cargo.toml", "A"),
            ("crates/a/fuzz/Cargo.toml", "F"),
            ("xtask/Cargo.toml", "X"),
            ("fixtures/README.md", ""),
        ]);
        let found: Vec<_> = tree.crates().collect();
        assert_eq!(found, [("crates/a", "A"), ("xtask", "X")]);
    }
}
