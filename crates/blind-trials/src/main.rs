//! `blind-trials [--seeds N] [--jobs J] [--only NAME]... [--each] [--keep FOLDER] [--check] WORLDS PAGE`: closes the loop on every world
//! and writes the page; with `--only` it prints the page of these worlds instead.
//!
//! Exit status 1 if, with `--check`, a first seed is not what the page says.
#![forbid(unsafe_code)]
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a chore tells the person who started it what it found"
)]

use std::fs;
use std::io::IsTerminal as _;
use std::path::Path;
use std::process::ExitCode;

use blind_trials::{
    BlindError, Plan, Tally, Trial, bounds, differences, first, page, run, simulated, worlds,
};

/// Seeds of a trial where nobody says.
const SEEDS: u64 = 12;
const USAGE: &str = "usage: blind-trials [--seeds N] [--jobs J] [--only NAME]... [--each] [--keep FOLDER] [--check] WORLDS PAGE\n\n  \
    --seeds N    bundles of each world, 12 where left out; a quarter of them where windows are sent, four times\n               \
    as many of simulated ones\n  \
    --jobs J     threads; all that there are where left out\n  \
    --only NAME  this world alone; its page is printed, none is written\n  \
    --each       prints what every single report says, too\n  \
    --keep FOLDER  every bundle, with its model, as FOLDER/NAME.SEED\n  \
    --check      the first seed of each world alone, against the page";

#[derive(Debug, Default)]
struct Arguments {
    seeds: Option<u64>,
    jobs: Option<usize>,
    only: Vec<String>,
    check: bool,
    each: bool,
    keep: Option<String>,
    places: Vec<String>,
}

impl Arguments {
    fn parse(words: impl Iterator<Item = String>) -> Option<Self> {
        let mut words = words;
        let mut out = Self::default();
        while let Some(word) = words.next() {
            match word.as_str() {
                "--seeds" => out.seeds = Some(words.next()?.parse().ok().filter(|n| *n > 0)?),
                "--jobs" => out.jobs = Some(words.next()?.parse().ok().filter(|n| *n > 0)?),
                "--only" => out.only.push(words.next()?),
                "--each" => out.each = true,
                "--keep" => out.keep = Some(words.next()?),
                "--check" => out.check = true,
                _ if word.starts_with('-') => return None,
                _ => out.places.push(word),
            }
        }
        (out.places.len() == 2 && !(out.check && out.seeds.is_some())).then_some(out)
    }
}

fn main() -> ExitCode {
    let Some(arguments) = Arguments::parse(std::env::args().skip(1)) else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    match go(&arguments) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn go(arguments: &Arguments) -> Result<bool, String> {
    let said = |e: BlindError| e.to_string();
    let [folder, file] = [0, 1].map(|k| arguments.places[k].as_str());
    let mut trials = worlds(Path::new(folder)).map_err(said)?;
    trials.extend(simulated().map_err(said)?);
    let trials = chosen(trials, &arguments.only).map_err(said)?;
    let seeds = if arguments.check {
        1
    } else {
        arguments.seeds.unwrap_or(SEEDS)
    };
    let threads = || std::thread::available_parallelism().map_or(1, usize::from);
    let plan = Plan {
        seeds,
        jobs: arguments.jobs.unwrap_or_else(threads),
        keep: arguments.keep.as_deref().map(Path::new),
    };
    let terminal = std::io::stderr().is_terminal();
    let progress = |done: usize, of: usize| {
        if terminal {
            eprint!("\r{done} of {of} ");
        } else if done.is_multiple_of(50) || done == of {
            eprintln!("{done} of {of}");
        }
    };
    let done = run(&trials, plan, &progress).map_err(said)?;
    if terminal {
        eprintln!();
    }
    if arguments.each {
        for (trial, scores) in trials.iter().zip(&done) {
            for score in scores {
                print!("{}", first(trial, score));
            }
        }
    }
    if arguments.check {
        let old = fs::read_to_string(file).map_err(|e| format!("{file}: {e}"))?;
        let found = differences(&old, &trials, &done);
        for difference in &found {
            println!("{file}: not current\n{difference}");
        }
        println!(
            "{} worlds, {}",
            trials.len(),
            if found.is_empty() {
                "all as written"
            } else {
                "see above"
            }
        );
        return Ok(found.is_empty());
    }
    let mut tallies = Vec::new();
    for (trial, scores) in trials.iter().zip(&done) {
        let bounds = bounds(trial).map_err(said)?;
        tallies.push(Tally::of(trial, scores, &bounds));
    }
    let mut command = format!("cargo xtask blind --seeds {seeds}");
    for name in &arguments.only {
        command.push_str(&format!(" --only {name}"));
    }
    let text = page(&trials, &done, &tallies, &command);
    if arguments.only.is_empty() {
        // beside, then renamed: never half a page
        let beside = format!("{file}.new");
        fs::write(&beside, &text).map_err(|e| format!("{beside}: {e}"))?;
        fs::rename(&beside, file).map_err(|e| format!("{file}: {e}"))?;
    } else {
        println!("{text}");
    }
    Ok(true)
}

fn chosen(trials: Vec<Trial>, only: &[String]) -> Result<Vec<Trial>, BlindError> {
    let known: Vec<&str> = trials.iter().map(|t| t.name.as_str()).collect();
    if let Some(name) = only.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(BlindError::NoWorld {
            name: name.clone(),
            known: known.join(", "),
        });
    }
    let wanted = |trial: &Trial| only.is_empty() || only.contains(&trial.name);
    Ok(trials.into_iter().filter(wanted).collect())
}
