//! The command `boresight`: star tracker error models that close the loop with
//! measured data.
//!
//! This crate parses arguments, shows progress, prints and sets the exit code;
//! everything else is behind the facade `boresight`.
#![forbid(unsafe_code)]

mod arguments;
mod commands;
mod console;
mod example;
mod inputs;
mod interrupt;
mod results;
mod targets;

use std::process::ExitCode;

use clap::Parser;

use arguments::{Arguments, Command};
use console::Console;

/// Bad input or usage.
const BAD_INPUT: u8 = 2;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let console = Console::new(arguments.quiet, arguments.json);
    if let Some(threads) = arguments.threads {
        // Fails only when a pool is there already, which nothing before this made.
        let _ = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global();
    }
    interrupt::leave_nothing();
    let done = match &arguments.command {
        Command::Assess(options) => commands::assess::run(options, &console),
        Command::Close(options) => commands::close::run(options, &console),
        Command::Compare(options) => commands::compare::run(options, &console),
        Command::Fit(options) => commands::fit::run(options, &console),
        Command::Simulate(options) => commands::simulate::run(options, &console),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            console.error(&error);
            ExitCode::from(BAD_INPUT)
        }
    }
}
