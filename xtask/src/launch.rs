//! Launching cargo, one step after another.

use std::env;
use std::ffi::OsString;
use std::path::Path;
use std::process::Command;

/// One call of cargo, from the root of the workspace.
pub(crate) struct Step {
    pub(crate) name: &'static str,
    pub(crate) args: &'static [&'static str],
    pub(crate) env: &'static [(&'static str, &'static str)],
}

/// Runs every step, also after one has failed, and names those that did.
pub(crate) fn run_all(root: &Path, steps: &[Step]) -> Result<(), String> {
    run_each(steps, |step| run_one(root, step, &[]))
}

/// Runs one step with more words after its own.
pub(crate) fn run_with(root: &Path, step: &Step, more: &[String]) -> Result<(), String> {
    run_one(root, step, more).map_err(|why| format!("failed: {} ({why})", step.name))
}

/// Runs a binary of the workspace that has been built, in the profile of this one: it lies beside it.
pub(crate) fn run_built(root: &Path, program: &str, words: &[&str]) -> Result<(), String> {
    println!("== {program} {}", words.join(" "));
    let this = env::current_exe().map_err(|e| e.to_string())?;
    let beside = this.with_file_name(format!("{program}{}", env::consts::EXE_SUFFIX));
    launch(Command::new(beside).args(words).current_dir(root))
        .map_err(|why| format!("failed: {program} ({why})"))
}

fn run_one(root: &Path, step: &Step, more: &[String]) -> Result<(), String> {
    let words = step.args.iter().copied();
    let words: Vec<&str> = words.chain(more.iter().map(String::as_str)).collect();
    println!("== {}: cargo {}", step.name, words.join(" "));
    launch(
        Command::new(cargo())
            .args(words)
            .envs(step.env.iter().copied())
            .current_dir(root),
    )
}

fn launch(command: &mut Command) -> Result<(), String> {
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(status.to_string()),
        Err(error) => Err(error.to_string()),
    }
}

fn run_each(
    steps: &[Step],
    mut run: impl FnMut(&Step) -> Result<(), String>,
) -> Result<(), String> {
    let mut failed = Vec::new();
    for step in steps {
        if let Err(why) = run(step) {
            failed.push(format!("{} ({why})", step.name));
        }
    }
    if failed.is_empty() {
        Ok(())
    } else {
        Err(format!("failed: {}", failed.join(", ")))
    }
}

/// The cargo that launched this program.
fn cargo() -> OsString {
    env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn step(name: &'static str) -> Step {
        Step {
            name,
            args: &["--version"],
            env: &[],
        }
    }

    #[test]
    fn a_failing_step_is_named_and_does_not_stop_the_next() {
        let mut seen = Vec::new();
        let result = run_each(&[step("first"), step("second"), step("third")], |step| {
            seen.push(step.name);
            if step.name == "second" {
                Ok(())
            } else {
                Err("exit status: 1".to_owned())
            }
        });
        assert_eq!(seen, ["first", "second", "third"]);
        let expected = "failed: first (exit status: 1), third (exit status: 1)";
        assert_eq!(result.unwrap_err(), expected);
    }

    #[test]
    fn cargo_is_launched() {
        assert_eq!(run_all(Path::new("."), &[step("version")]), Ok(()));
        let more = ["--no-such-word".to_owned()];
        let result = run_with(Path::new("."), &step("version"), &more);
        assert!(result.unwrap_err().starts_with("failed: version ("));
        let nothing = run_built(Path::new("."), "no-such-program", &[]);
        assert!(
            nothing
                .unwrap_err()
                .starts_with("failed: no-such-program (")
        );
    }
}
