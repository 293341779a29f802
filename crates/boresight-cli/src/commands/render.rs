//! `boresight simulate --fidelity pixel`: a bundle from rendered pixels.

use std::path::Path;

use anyhow::Context as _;
use boresight::imager::{self, Instrument, Run, WORLD_FORMAT};
use boresight::scenarios::{Course, Scenario, hipparcos};
use boresight::telemetry::config::Config;

use crate::arguments::{Fidelity, Simulate};
use crate::console::Console;

/// Frames per second where neither run nor model says.
const RATE_HZ: f64 = 2.0;
/// Positions of stars where no date is given, Julian year.
const YEAR: f64 = 2000.0;

/// Whether pixels are asked for: by the option, or by a world file.
pub(crate) fn wanted(file: &Path, fidelity: Option<Fidelity>) -> anyhow::Result<bool> {
    Ok(match fidelity {
        Some(fidelity) => fidelity == Fidelity::Pixel,
        None => is_world(&read(file)?, file),
    })
}

fn read(file: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(file).with_context(|| format!("{}: cannot read", file.display()))
}

fn is_world(text: &str, file: &Path) -> bool {
    // a file that cannot be parsed is refused by whoever reads it
    let Ok(config) = Config::parse(text, &file.display().to_string()) else {
        return false;
    };
    let format = config.root().require("format");
    format.is_ok_and(|format| format.text().is_ok_and(|text| text == WORLD_FORMAT))
}

pub(crate) fn run(
    path: &Path,
    out: &Path,
    options: &Simulate,
    console: &Console,
) -> anyhow::Result<()> {
    console.progress("reading the world");
    let (instrument, course, rate_hz) = world(path)?;
    let settings = &course.run;
    let (truth, t_s) = course.truth(rate_hz)?;
    let year = settings.epoch.map_or(YEAR, |epoch| epoch.julian_year(0.0));
    let run = Run {
        title: settings.title.clone(),
        first_s: t_s[0],
        frames: t_s.len() as u64,
        rate_hz: settings.rate_hz.unwrap_or(rate_hz),
        seed: settings.seed,
        draw: settings.draw,
        epoch: settings.epoch,
        time_scale: settings.time_scale,
    };
    let progress = |done: f64| console.progress(&format!("rendering, {:.0} %", 100.0 * done));
    let to = (out, options.tables.format());
    let done = imager::write(&instrument, &truth, &hipparcos(year)?, &run, to, &progress)?;
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

/// A world file, or a scenario whose tracker is taken as it is.
fn world(path: &Path) -> anyhow::Result<(Instrument, Course, f64)> {
    let (text, file) = (read(path)?, path.display().to_string());
    let folder = path.parent().unwrap_or(Path::new(""));
    if is_world(&text, path) {
        let instrument = Instrument::parse(&text, &file, &Course::TABLES)?;
        return Ok((instrument, Course::parse(&text, &file, folder)?, RATE_HZ));
    }
    let scenario = Scenario::read(path)?;
    let mut instrument = Instrument::of_model(&scenario.model)?;
    instrument.reference = scenario
        .reference
        .as_ref()
        .map(|reference| imager::Reference {
            rate_hz: reference.rate_hz,
            rates: reference.rates,
            white_arcsec: reference.white_arcsec,
            wander_arcsec: reference.wander_arcsec,
            wander_tau_s: reference.wander_tau_s,
            ..imager::Reference::default()
        });
    let rate_hz = scenario.model.tracker.update_rate_hz.unwrap_or(RATE_HZ);
    Ok((instrument, Course::from(&scenario), rate_hz))
}
