//! The few things in a `Cargo.toml` that the checks ask for.

/// Which table a dependency stands in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    /// `[dependencies]` and `[build-dependencies]`.
    Built,
    /// `[dev-dependencies]`.
    Dev,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Dependency {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    /// 1-based.
    pub(crate) line: usize,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Manifest {
    pub(crate) name: String,
    pub(crate) dependencies: Vec<Dependency>,
    pub(crate) inherits_lints: bool,
}

/// Reads line by line: one key a line, as `cargo` itself writes them.
pub(crate) fn parse(text: &str) -> Manifest {
    let mut manifest = Manifest::default();
    let mut table = String::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        let number = index + 1;
        if let Some(header) = line.strip_prefix('[') {
            table = header.trim_end_matches(']').replace(' ', "");
            // [dependencies.name] or [target.'cfg(..)'.dependencies.name]
            if let Some((front, name)) = table.rsplit_once('.')
                && let Some(kind) = kind(front)
            {
                manifest.dependencies.push(Dependency {
                    name: unquoted(name),
                    kind,
                    line: number,
                });
            }
            continue;
        }
        let Some((key, value)) = line.split_once('=') else {
            continue;
        };
        let (key, value) = (key.trim(), value.trim());
        if key.starts_with('#') {
            continue;
        }
        if let Some(kind) = kind(&table) {
            // `alias = { package = "name" }` depends on `name`.
            let name = value
                .split_once("package")
                .and_then(|(_, rest)| rest.split('"').nth(1))
                .unwrap_or_else(|| key.split('.').next().unwrap_or(key));
            manifest.dependencies.push(Dependency {
                name: unquoted(name),
                kind,
                line: number,
            });
        } else if table == "package" && key == "name" {
            manifest.name = unquoted(value);
        } else if table == "lints" && key == "workspace" {
            manifest.inherits_lints = value == "true";
        }
    }
    manifest
}

fn kind(table: &str) -> Option<Kind> {
    match table.rsplit('.').next() {
        Some("dependencies" | "build-dependencies") => Some(Kind::Built),
        Some("dev-dependencies") => Some(Kind::Dev),
        _ => None,
    }
}

fn unquoted(text: &str) -> String {
    text.trim_matches(|c| c == '"' || c == '\'').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_to_write_a_dependency_is_seen() {
        let manifest = parse(
            "[package]\nname = \"here\"\nversion.workspace = true\n\n[dependencies]\n\
             # quest = \"1\"\na.workspace = true\nb = { path = \"../b\" }\n\
             c = { package = \"quest\", path = \"../quest\" }\n\n[dependencies.d]\npath = \"../d\"\n\n\
             [target.'cfg(unix)'.dependencies]\ne = \"1\"\n\n[build-dependencies]\nf = \"1\"\n\n\
             [dev-dependencies]\ng = \"1\"\n\n[lints]\nworkspace = true\n",
        );
        assert_eq!(manifest.name, "here");
        let names: Vec<_> = manifest
            .dependencies
            .iter()
            .map(|d| d.name.as_str())
            .collect();
        assert_eq!(names, ["a", "b", "quest", "d", "e", "f", "g"]);
        for dependency in &manifest.dependencies {
            let expected = if dependency.name == "g" {
                Kind::Dev
            } else {
                Kind::Built
            };
            assert_eq!(dependency.kind, expected, "{}", dependency.name);
        }
        assert_eq!(manifest.dependencies[0].line, 7);
        assert!(manifest.inherits_lints);
    }

    #[test]
    fn lints_of_its_own_are_not_inherited() {
        assert!(!parse("[package]\nname = \"a\"\n").inherits_lints);
        assert!(!parse("[lints]\nworkspace = false\n").inherits_lints);
        assert!(!parse("[lints.rust]\nunsafe_code = \"deny\"\n").inherits_lints);
    }
}
