//! The command line.

use std::path::PathBuf;

use boresight::telemetry::TableFormat;
use clap::{Args, Parser, Subcommand};

/// Star tracker error models that close the loop with measured data.
#[derive(Debug, Parser)]
#[command(name = "boresight", version, about, propagate_version = true)]
#[command(
    after_help = "Example:\n  boresight close                 the whole loop on the example inside the binary"
)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Print the machine-readable result on stdout, and nothing else there
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// No progress and no summary; errors are still told
    #[arg(long, global = true)]
    pub(crate) quiet: bool,
    /// Threads to compute with; the numbers do not depend on it [default: all cores]
    #[arg(long, global = true, value_name = "N", value_parser = threads)]
    pub(crate) threads: Option<usize>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Find what the model misses, add it, and report the error before and after
    #[command(
        after_help = "Examples:\n  boresight close\n  boresight close fixtures/models/aa-str.toml telemetry/ --out results/"
    )]
    Close(Close),
    /// Make the bundle that a tracker would have sent
    #[command(
        after_help = "Examples:\n  boresight simulate fixtures/scenarios/example.toml --out bundle/\n  boresight simulate --preset iht --out bundle/\n  boresight simulate --print-preset pitt > my.toml\n  boresight simulate fixtures/worlds/null_slews.toml --fidelity pixel --out bundle/"
    )]
    Simulate(Simulate),
}

#[derive(Debug, Args)]
pub(crate) struct Close {
    /// What is believed of the tracker: a model file
    #[arg(value_name = "MODEL.toml", requires = "bundle")]
    pub(crate) model: Option<PathBuf>,
    /// What was measured: a bundle folder
    #[arg(value_name = "BUNDLE")]
    pub(crate) bundle: Option<PathBuf>,
    /// Folder for report, model and residuals; nothing is written without it
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct Simulate {
    /// Scenario file, a model with [motion], [sky] and [run]; or a world file
    #[arg(value_name = "SCENARIO.toml", required_unless_present_any = ["preset", "print_preset"])]
    pub(crate) scenario: Option<PathBuf>,
    /// A scenario of the paper: iht, iht-distance, ict1, ict2, pitt, st2-iht, st2-iht-distance, st2-ict1, st2-ict2
    #[arg(long, value_name = "NAME", conflicts_with = "scenario")]
    pub(crate) preset: Option<String>,
    /// Print the file of a preset, to be edited, and do nothing else
    #[arg(long, value_name = "NAME", num_args = 0..=1, default_missing_value = "", conflicts_with = "scenario")]
    pub(crate) print_preset: Option<String>,
    /// How measurements are made [default: what the file's format asks for]
    #[arg(long, value_enum)]
    pub(crate) fidelity: Option<Fidelity>,
    /// Folder of the bundle
    #[arg(long, value_name = "BUNDLE", required_unless_present = "print_preset")]
    pub(crate) out: Option<PathBuf>,
    /// How tables are written
    #[arg(long, value_enum, default_value_t = Tables::CsvGz)]
    pub(crate) tables: Tables,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Fidelity {
    /// By the formulas of the model and its effects
    Model,
    /// By rendering pixels: of a world file, or of a scenario without effects
    Pixel,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(crate) enum Tables {
    /// Plain CSV
    Csv,
    /// CSV, gzip
    CsvGz,
    /// Parquet
    Parquet,
}

impl Tables {
    pub(crate) fn format(self) -> TableFormat {
        match self {
            Self::Csv => TableFormat::Csv,
            Self::CsvGz => TableFormat::CsvGz,
            Self::Parquet => TableFormat::Parquet,
        }
    }
}

fn threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) | Err(_) => Err("a whole number of at least 1 is needed".to_owned()),
        Ok(n) => Ok(n),
    }
}
