//! `boresight fit`: the hybrid empirical model of a bundle.

use std::io::Write as _;

use anyhow::Context as _;
use boresight::comparison::{ComparisonError, FitSettings, fit};
use boresight::report::fit_summary;
use boresight::telemetry::write_file;

use crate::arguments::Fit;
use crate::console::Console;
use crate::inputs;
use crate::targets;

pub(crate) fn run(options: &Fit, console: &Console) -> anyhow::Result<()> {
    if let Some(out) = &options.out {
        targets::refuse_input(out, &targets::of_bundle(&options.bundle))?;
    }
    console.progress("reading");
    let (bundle, tables) = inputs::bundle(&options.bundle, console)?;
    console.progress("fitting");
    let name = options.bundle.display().to_string();
    let settings = FitSettings {
        band_hz: options.band_hz,
        lines_hz: options.exclude_hz.clone(),
    };
    let fitted = fit(&bundle, &settings).map_err(|error| {
        // too few frequencies are the doing of the options that choose them
        let by = match error {
            ComparisonError::EmptyBand { .. } => ", --band-hz",
            ComparisonError::Fit { .. } => chosen_by(options),
            _ => "",
        };
        let place = format!("{name}{by}");
        anyhow::Error::from(error).context(place)
    })?;
    if let Some(out) = &options.out {
        let text = fitted.model.to_toml();
        write_file(out, |to| to.write_all(text.as_bytes()))?;
    }
    console.say(&format!(
        "Input     {name}\n{tables}{}",
        fit_summary(&fitted.report)
    ));
    if console.json() {
        console.machine(&serde_json::to_string_pretty(&fitted.report).context("the fit as JSON")?);
    }
    Ok(())
}

fn chosen_by(options: &Fit) -> &'static str {
    match (options.band_hz.is_some(), options.exclude_hz.is_empty()) {
        (true, true) => ", --band-hz",
        (false, false) => ", --exclude-hz",
        (true, false) => ", --band-hz and --exclude-hz",
        (false, true) => "",
    }
}
