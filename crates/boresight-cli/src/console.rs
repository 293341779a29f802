//! All that is printed.

use std::io::{ErrorKind, Write, stdout};
use std::process;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Where results, progress and errors go.
#[derive(Debug)]
pub(crate) struct Console {
    quiet: bool,
    json: bool,
    bar: ProgressBar,
}

impl Console {
    pub(crate) fn new(quiet: bool, json: bool) -> Self {
        // Draws on stderr, and not at all when that is no terminal.
        let bar = if quiet {
            ProgressBar::hidden()
        } else {
            ProgressBar::new_spinner()
        };
        if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed} {msg}") {
            bar.set_style(style);
        }
        if !quiet {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        Self { quiet, json, bar }
    }

    /// Says what is being done.
    pub(crate) fn progress(&self, what: &str) {
        self.bar.set_message(what.to_owned());
    }

    /// Whether the machine-readable result is wanted.
    pub(crate) fn json(&self) -> bool {
        self.json
    }

    /// A result for people; nothing under `--json` or `--quiet`.
    pub(crate) fn say(&self, text: &str) {
        self.bar.finish_and_clear();
        if !self.json && !self.quiet {
            out(&format!("{}\n", text.trim_end()));
        }
    }

    /// A file that was asked for, as it is, whatever the flags.
    pub(crate) fn text(&self, text: &str) {
        self.bar.finish_and_clear();
        out(text);
    }

    /// A result for machines; nothing without `--json`.
    pub(crate) fn machine(&self, text: &str) {
        self.bar.finish_and_clear();
        if self.json {
            out(&format!("{text}\n"));
        }
    }

    /// What a user should know and may not have meant.
    #[expect(clippy::print_stderr, reason = "warnings go to stderr, here alone")]
    pub(crate) fn warn(&self, what: &str) {
        self.bar.suspend(|| eprintln!("warning: {what}"));
    }

    /// What went wrong, with its causes.
    #[expect(clippy::print_stderr, reason = "errors go to stderr, here alone")]
    pub(crate) fn error(&self, error: &anyhow::Error) {
        self.bar.finish_and_clear();
        eprintln!("error: {error:#}");
    }
}

/// Results go to stdout, here alone. A reader that has seen enough (`| head`) is no error; a disk that is
/// full is one.
#[expect(clippy::exit, clippy::print_stderr, reason = "nobody is left to tell")]
fn out(text: &str) {
    let mut stdout = stdout().lock();
    if let Err(error) = stdout
        .write_all(text.as_bytes())
        .and_then(|()| stdout.flush())
        && error.kind() != ErrorKind::BrokenPipe
    {
        eprintln!("error: stdout: {error}");
        process::exit(2);
    }
}
