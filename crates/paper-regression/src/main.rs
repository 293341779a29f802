//! `paper-regression [--check] PAGE`: writes the page, or says whether it is current.
//!
//! Exit status 1 if a row's verdict is not the one that it was written with, or, with `--check`, if the
//! page differs.
#![forbid(unsafe_code)]
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a chore tells the person who started it what it found"
)]

use std::fs;
use std::process::ExitCode;

use paper_regression::{Inputs, a01, m23, page, same};

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let (check, file) = match words[..] {
        ["--check", file] if !file.starts_with('-') => (true, file),
        [file] if !file.starts_with('-') => (false, file),
        _ => {
            eprintln!("usage: paper-regression [--check] PAGE");
            return ExitCode::from(2);
        }
    };
    match run(check, file) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(check: bool, file: &str) -> Result<bool, String> {
    let inputs = Inputs::default();
    let mut groups = m23::groups(&inputs).map_err(|e| e.to_string())?;
    groups.extend(a01::groups().map_err(|e| e.to_string())?);
    let text = page(&groups);
    let mut holds = true;
    for row in groups.iter().flat_map(|group| &group.rows) {
        if !row.holds() {
            holds = false;
            println!(
                "{}: was {}, is {}: {}",
                row.id, row.expected, row.verdict, row.ours
            );
        }
    }
    if check {
        let old = fs::read_to_string(file).map_err(|e| format!("{file}: {e}"))?;
        if let Err((line, new)) = same(&old, &text) {
            holds = false;
            println!("{file}, line {line}: not current; it would be\n{new}");
        }
    } else {
        // beside, then renamed: never half a page
        let beside = format!("{file}.new");
        fs::write(&beside, &text).map_err(|e| format!("{beside}: {e}"))?;
        fs::rename(&beside, file).map_err(|e| format!("{file}: {e}"))?;
    }
    println!("{}", m23::saving(&inputs).map_err(|e| e.to_string())?);
    let rows: usize = groups.iter().map(|group| group.rows.len()).sum();
    println!(
        "{rows} rows, {}",
        if holds { "all as written" } else { "see above" }
    );
    Ok(holds)
}
