//! `boresight simulate --fidelity pixel`: a bundle from rendered pixels.

use std::path::Path;

use boresight::imager::{self, Instrument, Run, WORLD_FORMAT};
use boresight::scenarios::{Course, Scenario, hipparcos};
use boresight::telemetry::BundleWriter;
use boresight::telemetry::config::Config;

use crate::arguments::Simulate;
use crate::commands::simulate::{Input, refuse_inputs};
use crate::console::Console;

/// Frames per second where neither run nor model says.
const RATE_HZ: f64 = 2.0;
/// Positions of stars where no date is given, Julian year.
const YEAR: f64 = 2000.0;

/// Whether a file is a world.
pub(crate) fn is_world(input: &Input) -> bool {
    // a file that cannot be parsed is refused by whoever reads it
    let Ok(config) = Config::parse(&input.text, &input.file) else {
        return false;
    };
    let format = config.root().require("format");
    format.is_ok_and(|format| format.text().is_ok_and(|text| text == WORLD_FORMAT))
}

/// A world file.
pub(crate) fn world(
    input: &Input,
    out: &Path,
    options: &Simulate,
    console: &Console,
) -> anyhow::Result<()> {
    console.progress("reading the world");
    let (text, file) = (&input.text, &input.file);
    let instrument = Instrument::parse(text, file, &Course::TABLES)
        .map_err(|error| error.in_file(text, file))?;
    let course = Course::parse(text, file, &input.folder)?;
    render(input, &instrument, &course, RATE_HZ, out, options, console)
}

/// A scenario, whose tracker and reference are taken as they are.
pub(crate) fn scenario(
    input: &Input,
    scenario: &Scenario,
    out: &Path,
    options: &Simulate,
    console: &Console,
) -> anyhow::Result<()> {
    let mut instrument = Instrument::of_model(&scenario.model)
        .map_err(|error| error.in_file(&input.text, &input.file))?;
    instrument.reference = scenario
        .reference
        .as_ref()
        .map(|reference| imager::Reference {
            rate_hz: reference.rate_hz,
            rates: reference.rates,
            cant_axis: reference.cant_axis,
            cant_deg: reference.cant_deg,
            white_arcsec: reference.white_arcsec,
            wander_arcsec: reference.wander_arcsec,
            wander_tau_s: reference.wander_tau_s,
            ..imager::Reference::default()
        });
    let rate_hz = scenario.model.tracker.update_rate_hz.unwrap_or(RATE_HZ);
    render(
        input,
        &instrument,
        &Course::from(scenario),
        rate_hz,
        out,
        options,
        console,
    )
}

fn render(
    input: &Input,
    instrument: &Instrument,
    course: &Course,
    rate_hz: f64,
    out: &Path,
    options: &Simulate,
    console: &Console,
) -> anyhow::Result<()> {
    anyhow::ensure!(
        options.figures.is_none(),
        "--figures draws the runs of models, and this one is rendered from pixels; leave the option out, or give a scenario and --fidelity model"
    );
    refuse_inputs(options, &course.motion, &course.folder, out)?;
    let settings = &course.run;
    let (truth, first_s, frames) = course
        .long_truth(rate_hz)
        .map_err(|error| error.in_file(&input.text, &input.file))?;
    let year = settings.epoch.map_or(YEAR, |epoch| epoch.julian_year(0.0));
    let run = Run {
        title: settings.title.clone(),
        first_s,
        frames,
        rate_hz: settings.rate_hz.unwrap_or(rate_hz),
        seed: settings.seed,
        draw: settings.draw,
        epoch: settings.epoch,
        time_scale: settings.time_scale,
    };
    let progress = |done: f64| console.progress(&format!("rendering, {:.0} %", 100.0 * done));
    let writer = BundleWriter::new(out, options.tables.format())?;
    let done = imager::write(
        instrument,
        truth.as_ref(),
        &hipparcos(year)?,
        &run,
        writer,
        &progress,
    )
    .map_err(|error| error.in_file(&input.text, &input.file))?;
    let out = out.display();
    console.say(&format!(
        "{} frames, {} star rows rendered to {out}, {} windows without a star",
        done.frames, done.star_rows, done.lost
    ));
    console.machine(
        &serde_json::json!({ "bundle": out.to_string(), "frames": done.frames, "star_rows": done.star_rows, "lost": done.lost })
            .to_string(),
    );
    Ok(())
}
