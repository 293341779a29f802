//! Chores of the workspace: `cargo xtask TASK`.
//!
//! It launches cargo and reads files, with the standard library alone, so that
//! it builds in a second on a machine that has nothing yet.
#![forbid(unsafe_code)]
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a chore tells the person who started it what it found"
)]

mod launch;
mod tidy;

use std::env;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use launch::{Step, run_all, run_built, run_with};

/// One word after `cargo xtask`.
struct Task {
    name: &'static str,
    what: &'static str,
    run: Run,
}

/// What a task does.
enum Run {
    Alone(fn(&Path) -> Result<(), String>),
    /// With the words after its name.
    With(fn(&Path, &[String]) -> Result<(), String>),
}

const TASKS: &[Task] = &[
    Task {
        name: "ci",
        what: "check, paper --check, then test: all that must hold before a change goes in",
        run: Run::Alone(ci),
    },
    Task {
        name: "check",
        what: "format, lints, documentation and tidy",
        run: Run::Alone(check),
    },
    Task {
        name: "test",
        what: "cargo test --workspace",
        run: Run::Alone(test),
    },
    Task {
        name: "tidy",
        what: "what the compiler cannot see: layers, sources, provenance, the tables in docs/",
        run: Run::Alone(tidy),
    },
    Task {
        name: "fixtures",
        what: "make the project's own fixtures again",
        run: Run::Alone(fixtures),
    },
    Task {
        name: "paper",
        what: "compute the papers' claims, write docs/paper-regression.md",
        run: Run::Alone(paper),
    },
    Task {
        name: "paper --check",
        what: "the same, and fail if the page is not current",
        run: Run::Alone(paper_check),
    },
    Task {
        name: "blind",
        what: "worlds through the closed loop, scored: docs/blind.md; [--seeds N] [--jobs J] [--only NAME]... [--each] [--keep FOLDER] [--check]",
        run: Run::With(blind),
    },
];

const FORMAT: Step = Step {
    name: "fmt",
    args: &["fmt", "--all", "--check"],
    env: &[],
};
const LINTS: Step = Step {
    name: "clippy",
    args: &[
        "clippy",
        "--workspace",
        "--all-targets",
        "--",
        "-D",
        "warnings",
    ],
    env: &[],
};
const DOCUMENTATION: Step = Step {
    name: "doc",
    args: &["doc", "--workspace", "--no-deps"],
    env: &[("RUSTDOCFLAGS", "-D warnings")],
};
const TESTS: Step = Step {
    name: "test",
    args: &["test", "--workspace"],
    env: &[],
};

/// What `cargo xtask fixtures` makes, in this order; each file has its row in
/// `fixtures/PROVENANCE.md`. By examples of the libraries: the command holds the
/// example bundle inside itself and cannot be built without it.
const FIXTURES: &[Step] = &[Step {
    name: "fixtures/example",
    args: &[
        "run",
        "--release",
        "--package",
        "scenarios",
        "--example",
        "make_example",
    ],
    env: &[],
}];

/// From nothing, the release profile takes half the time to build that the tests' profile does: it leaves
/// procedural macros unoptimised.
const PAPER: Step = Step {
    name: "paper",
    args: &[
        "run",
        "--release",
        "--quiet",
        "--package",
        "paper-regression",
        "--",
        "docs/paper-regression.md",
    ],
    env: &[],
};
/// All that the tests need: with one package alone, its dependencies would be built once more, with the
/// features that it asks for.
const BUILD_TESTS: Step = Step {
    name: "build",
    args: &["test", "--workspace", "--no-run"],
    env: &[],
};
/// Built with the tests, in their profile: the numbers are the same in both.
const PAPER_CHECK: (&str, &[&str]) = ("paper-regression", &["--check", "docs/paper-regression.md"]);

const BLIND: Step = Step {
    name: "blind",
    args: &[
        "run",
        "--release",
        "--quiet",
        "--package",
        "blind-trials",
        "--",
        "fixtures/worlds",
        "docs/blind.md",
    ],
    env: &[],
};

fn ci(root: &Path) -> Result<(), String> {
    // Tests last: the output then ends with cargo's own account of them. A
    // failing check does not keep them from running.
    let checked = check(root);
    let current = paper_check(root);
    let tested = test(root);
    checked.and(current).and(tested)
}

fn check(root: &Path) -> Result<(), String> {
    let launched = run_all(root, &[FORMAT, LINTS, DOCUMENTATION]);
    let tidied = tidy(root);
    launched.and(tidied)
}

fn test(root: &Path) -> Result<(), String> {
    run_all(root, &[TESTS])
}

fn tidy(root: &Path) -> Result<(), String> {
    let tree = tidy::Tree::load(root).map_err(|e| format!("tidy: {e}"))?;
    let findings = tidy::findings(&tree);
    for finding in &findings {
        println!("{finding}");
    }
    if findings.is_empty() {
        println!("tidy: nothing found in {} files", tree.len());
        Ok(())
    } else {
        Err(format!("tidy: {} findings", findings.len()))
    }
}

fn fixtures(root: &Path) -> Result<(), String> {
    run_all(root, FIXTURES)
}

fn paper(root: &Path) -> Result<(), String> {
    run_all(root, &[PAPER])
}

fn paper_check(root: &Path) -> Result<(), String> {
    run_all(root, &[BUILD_TESTS])?;
    let (program, words) = PAPER_CHECK;
    run_built(root, program, words)
}

fn blind(root: &Path, words: &[String]) -> Result<(), String> {
    run_with(root, &BLIND, words)
}

/// The workspace: the folder above this crate.
fn root() -> PathBuf {
    let here = env::var_os("CARGO_MANIFEST_DIR")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
    here.parent().map_or(here.clone(), Path::to_path_buf)
}

/// The task that the arguments ask for; anything but the words of one task is none, but for a task that
/// takes more words.
fn task(args: &[String]) -> Option<&'static Task> {
    let words = args.join(" ");
    TASKS.iter().find(|task| match task.run {
        Run::Alone(_) => task.name == words,
        Run::With(_) => args.first().is_some_and(|word| word == task.name),
    })
}

fn usage() -> String {
    let mut text = String::from("usage: cargo xtask TASK\n\n");
    for task in TASKS {
        text.push_str(&format!("  {:<15}{}\n", task.name, task.what));
    }
    text
}

fn main() -> ExitCode {
    let args: Vec<String> = env::args().skip(1).collect();
    let Some(task) = task(&args) else {
        if !args.is_empty() {
            eprintln!("error: no task `{}`\n", args.join(" "));
        }
        eprint!("{}", usage());
        return ExitCode::from(2);
    };
    let done = match task.run {
        Run::Alone(run) => run(&root()),
        Run::With(run) => run(&root(), &args[1..]),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<String> {
        text.split_whitespace().map(str::to_owned).collect()
    }

    #[test]
    fn only_the_words_of_a_task_are_one() {
        for name in ["tidy", "paper", "paper --check"] {
            assert_eq!(task(&words(name)).map(|t| t.name), Some(name));
        }
        let blind = task(&words("blind --seeds 4")).map(|t| t.name);
        assert_eq!(blind, Some("blind"));
        for wrong in [
            "",
            "tidi",
            "tidy now",
            "tidy --check",
            "--check",
            "--help",
            "blindly",
        ] {
            assert!(task(&words(wrong)).is_none(), "`{wrong}`");
        }
    }

    #[test]
    fn usage_lists_every_task() {
        let usage = usage();
        for task in TASKS {
            assert!(usage.contains(task.name) && usage.contains(task.what));
        }
    }

    /// What CI holds the page against is what writes it, and leaves it alone.
    #[test]
    fn the_page_is_checked_by_what_writes_it() {
        let (program, checked) = PAPER_CHECK;
        let page: Vec<&str> = checked
            .iter()
            .copied()
            .filter(|w| *w != "--check")
            .collect();
        let written = PAPER.args.iter().skip_while(|w| **w != program);
        let written: Vec<&str> = written.copied().filter(|w| *w != "--").collect();
        assert_eq!(written, [&[program], page.as_slice()].concat());
        assert!(checked.contains(&"--check"));
    }

    #[test]
    fn root_is_the_workspace() {
        assert!(root().join("xtask/src/main.rs").is_file());
    }
}
