//! The README's two commands: one that runs the tool, one that tests it, the
//! second the same as in `.ci/run`.

use super::{Finding, Tree};

const TEST: &str = "cargo xtask test";
const CHECK: &str = "cargo xtask check";
const README: &str = "README.md";
const CI: &str = ".ci/run";

pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    let commands = commands(tree.text(README).unwrap_or_default());
    match commands.as_slice() {
        [(_, first), (_, second), ..] if first.starts_with("cargo run ") && *second == TEST => {}
        _ => {
            let message = format!(
                "the first two commands are to be `cargo run ..` and `{TEST}`, they are {:?}",
                commands.iter().take(2).map(|c| c.1).collect::<Vec<_>>()
            );
            let line = commands.first().map_or(0, |c| c.0);
            findings.push(Finding::new(README, line, message));
        }
    }
    let ci = tree.text(CI).unwrap_or_default();
    for command in [CHECK, TEST] {
        if !ci.lines().any(|line| line.starts_with(command)) {
            findings.push(Finding::new(CI, 0, format!("does not run `{command}`")));
        }
    }
    findings
}

/// Lines of code blocks that call cargo, with the line they stand on.
fn commands(text: &str) -> Vec<(usize, &str)> {
    let mut in_block = false;
    let mut found = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.starts_with("```") {
            in_block = !in_block;
        } else if in_block {
            let command = line.strip_prefix("$ ").unwrap_or(line);
            let command = command.split(" #").next().unwrap_or(command).trim();
            if command.starts_with("cargo ") {
                found.push((index + 1, command));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const RUN: &str = "# comment\ncargo xtask check || status=$?\ncargo xtask test || status=$?\n";
    const TEXT: &str = "# Name\n\n```sh\ncargo run --release -- close --out out  # main job\n\
                        cargo xtask test\n```\n";

    fn found(readme: &str, run: &str) -> Vec<String> {
        let tree = Tree::from_texts(&[(README, readme), (CI, run)]);
        check(&tree).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn order_is_no_finding() {
        assert!(found(TEXT, RUN).is_empty());
        let prompt = TEXT.replace("cargo", "$ cargo");
        assert!(found(&prompt, RUN).is_empty());
    }

    #[test]
    fn a_missing_or_other_command_is_found() {
        assert_eq!(found("", RUN).len(), 1);
        assert_eq!(found(&TEXT.replace("xtask test", "test"), RUN).len(), 1);
        assert_eq!(found(&TEXT.replace("run", "build"), RUN).len(), 1);
        let prose = TEXT.replace("```sh\n", "").replace("```\n", "");
        assert_eq!(found(&prose, RUN).len(), 1);
    }

    #[test]
    fn ci_runs_the_same_test_command() {
        let other = RUN.replace("xtask test", "test");
        assert_eq!(
            found(TEXT, &other),
            [".ci/run: does not run `cargo xtask test`"]
        );
    }
}
