//! The command line.

use std::path::PathBuf;

use boresight::telemetry::TableFormat;
use clap::{Args, Parser, Subcommand};

/// Star tracker error models that close the loop with measured data.
#[derive(Debug, Parser)]
#[command(name = "boresight", version, propagate_version = true)]
#[command(
    after_help = "Example:\n  boresight close                 the whole loop on the example inside the binary"
)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Print the machine-readable result on stdout, and nothing else there
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// No progress and no summary; errors and warnings are still told
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
        display_name = "boresight",
        after_help = "Examples:\n  boresight close\n  boresight close fixtures/models/aa-str.toml telemetry/ --out results/\n  boresight close model.toml telemetry/ --test rolling_shutter --test exposure_smear"
    )]
    Close(Close),
    /// Make the bundle that a tracker would have sent
    #[command(
        display_name = "boresight",
        after_help = "Examples:\n  boresight simulate fixtures/scenarios/example.toml --out bundle/\n  boresight simulate --preset iht --out bundle/\n  boresight simulate --print-preset pitt > my.toml\n  boresight simulate fixtures/worlds/null_slews.toml --fidelity pixel --out bundle/"
    )]
    Simulate(Simulate),
    /// Fly models along the measured motion, and hold their spectra against the measured ones
    #[command(
        display_name = "boresight",
        after_help = "Examples:\n  boresight compare model.toml telemetry/ --out figures/\n  boresight compare pbm.toml telemetry/ --with hem.toml --out figures/ --draws 200"
    )]
    Compare(Compare),
    /// Fit white noise and a Gauss-Markov process to each axis: a hybrid empirical model
    #[command(
        display_name = "boresight",
        after_help = "Examples:\n  boresight fit telemetry/\n  boresight fit telemetry/ --out hem.toml --exclude-hz 0.03,0.04"
    )]
    Fit(Fit),
    /// On-orbit noise without a model: total and inherent 1 sigma of each axis
    #[command(
        display_name = "boresight",
        after_help = "Examples:\n  boresight assess telemetry/\n  boresight assess telemetry/ --inertia 14710.5,14688.8,29041.9 --requirement 360 --out results/"
    )]
    Assess(Assess),
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
    /// Also say of this effect of the catalogue whether it could be the cause, how large it would
    /// have to be, and what would have shown; may be given several times
    #[arg(long = "test", value_name = "EFFECT")]
    pub(crate) tests: Vec<String>,
    /// Also add what the leftover follows most, as a term without a cause (it never counts as one)
    #[arg(long)]
    pub(crate) add_empirical: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Simulate {
    /// Scenario file, a model with [motion], [sky] and [run]; or a world file
    #[arg(value_name = "SCENARIO.toml", required_unless_present_any = ["preset", "print_preset"])]
    pub(crate) scenario: Option<PathBuf>,
    /// A scenario of the paper: iht, iht-distance, ict1, ict2, pitt, st2-iht, st2-iht-distance, st2-ict1, st2-ict2, image, eo1
    #[arg(long, value_name = "NAME", conflicts_with = "scenario")]
    pub(crate) preset: Option<String>,
    /// Print the file of a preset, to be edited, and do nothing else; beside --preset without a name
    #[arg(long, value_name = "NAME", num_args = 0..=1, default_missing_value = "", conflicts_with = "scenario")]
    pub(crate) print_preset: Option<String>,
    /// How measurements are made [default: what the file's format asks for]
    #[arg(long, value_enum)]
    pub(crate) fidelity: Option<Fidelity>,
    /// Folder of the bundle
    #[arg(long, value_name = "BUNDLE", required_unless_present = "print_preset")]
    pub(crate) out: Option<PathBuf>,
    /// Also replace a bundle that boresight did not make, such as measured telemetry
    #[arg(long)]
    pub(crate) force: bool,
    /// How tables are written
    #[arg(long, value_enum, default_value_t = Tables::CsvGz)]
    pub(crate) tables: Tables,
    /// Folder for pictures of the run (of a model, not of pixels): field, centroid error, motion, tracks
    #[arg(long, value_name = "DIR")]
    pub(crate) figures: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct Compare {
    /// What is believed of the tracker: a model file
    #[arg(value_name = "MODEL.toml")]
    pub(crate) model: PathBuf,
    /// What was measured: a bundle folder with a reference
    #[arg(value_name = "BUNDLE")]
    pub(crate) bundle: PathBuf,
    /// Folder for compare.json, psd.csv, draws.csv and the figures; nothing is written without it
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Draws of each model, at least 8
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = draws)]
    pub(crate) draws: u64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Another model beside the first; may be given several times
    #[arg(long = "with", value_name = "MODEL.toml")]
    pub(crate) others: Vec<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct Fit {
    /// What was measured: a bundle folder with a reference
    #[arg(value_name = "BUNDLE")]
    pub(crate) bundle: PathBuf,
    /// File for the model, which `simulate` and `compare` read
    #[arg(long, value_name = "MODEL.toml")]
    pub(crate) out: Option<PathBuf>,
    /// Frequencies used, Hz [default: all]
    #[arg(long, value_name = "LOW,HIGH", value_parser = range)]
    pub(crate) band_hz: Option<[f64; 2]>,
    /// Frequencies left out, Hz, such as those of a line; may be given several times
    #[arg(long, value_name = "LOW,HIGH", value_parser = range)]
    pub(crate) exclude_hz: Vec<[f64; 2]>,
}

#[derive(Debug, Args)]
pub(crate) struct Assess {
    /// What was measured: a bundle folder with an attitude
    #[arg(value_name = "BUNDLE")]
    pub(crate) bundle: PathBuf,
    /// What stands in for the truth [default: the gyro, else the reference, else a rigid body]
    #[arg(long, value_enum)]
    pub(crate) method: Option<Method>,
    /// Moments of inertia about body x, y, z, any unit [default: ratios are estimated]
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>)]
    pub(crate) inertia: Option<[f64; 3]>,
    /// Matrix from tracker to body, row by row [default: the spin axis is body z]
    #[arg(long, value_name = "NINE NUMBERS", value_parser = numbers::<9>, allow_hyphen_values = true)]
    pub(crate) alignment: Option<[f64; 9]>,
    /// Attitude accuracy that is required, arcsec
    #[arg(long, value_name = "ARCSEC")]
    pub(crate) requirement: Option<f64>,
    /// Angle random walk of the gyro, arcsec/sqrt(s) [default: estimated]
    #[arg(long, value_name = "ARCSEC")]
    pub(crate) gyro_walk: Option<f64>,
    /// Window of the ECSS indices, s [default: a hundredth of the record]
    #[arg(long, value_name = "SECONDS")]
    pub(crate) window: Option<f64>,
    /// Folder for assess.json, summary.txt, pictures and residuals; nothing is written without it
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
#[value(rename_all = "snake_case")]
pub(crate) enum Method {
    /// A rigid body without torque
    RigidRotator,
    /// Propagated gyro rates
    Gyro,
    /// The table `reference`
    Reference,
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

fn range(text: &str) -> Result<[f64; 2], String> {
    let ends = text
        .split_once(',')
        .map(|(low, high)| (low.trim().parse(), high.trim().parse()));
    match ends {
        Some((Ok(low), Ok(high))) if 0.0 <= low && low < high && f64::is_finite(high) => {
            Ok([low, high])
        }
        _ => Err("two numbers LOW,HIGH with 0 <= LOW < HIGH are needed".to_owned()),
    }
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

fn draws(text: &str) -> Result<u64, String> {
    match text.parse() {
        Ok(n) if n >= 8 => Ok(n),
        _ => Err("a whole number of at least 8 is needed".to_owned()),
    }
}

fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let parsed: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let wrong = || format!("{N} finite numbers with commas between them are needed");
    let numbers = parsed.map_err(|_| wrong())?;
    let finite = numbers.iter().all(|x: &f64| x.is_finite());
    numbers.try_into().ok().filter(|_| finite).ok_or_else(wrong)
}
