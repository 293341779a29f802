//! `boresight close`: the main job.

use std::io::Write as _;
use std::path::PathBuf;

use anyhow::Context as _;
use boresight::closed_loop::{CloseError, Closed, Questions, close_asking};
use boresight::comparison::{CompareSettings, Compared, compare};
use boresight::report::{Run, html, summary};
use boresight::telemetry::config::nearest;
use boresight::telemetry::report::{ComparedModel, REPORT_FORMAT};
use boresight::telemetry::{Bundle, Model, Output};

use crate::arguments::Close;
use crate::console::Console;
use crate::example;
use crate::inputs;
use crate::results;
use crate::targets;

/// All files that the command may write.
const RESULTS: [&str; 7] = [
    "report.json",
    "report.html",
    "summary.txt",
    "model.toml",
    "residuals_stars.parquet",
    "residuals_attitude.parquet",
    "dark_map.csv",
];

pub(crate) fn run(options: &Close, console: &Console) -> anyhow::Result<()> {
    let questions = Questions::about(&options.tests)
        .map_err(with_nearest)?
        .adding_empirical(options.add_empirical);
    if let Some(dir) = &options.out {
        let bundle = options.bundle.iter().flat_map(|b| targets::of_bundle(b));
        let inputs: Vec<PathBuf> = options.model.iter().cloned().chain(bundle).collect();
        targets::refuse_inputs(dir, &RESULTS, &inputs)?;
    }
    console.progress("reading");
    let (model, (bundle, tables), title) = match (&options.model, &options.bundle) {
        (Some(model), Some(bundle)) => {
            let title = format!("{} against {}", bundle.display(), model.display());
            (Model::read(model)?, inputs::bundle(bundle, console)?, title)
        }
        _ => {
            let title =
                "the example inside the binary: simulated, with an effect that its model lacks";
            let bundle = (example::bundle()?, String::new());
            (example::model()?, bundle, title.to_owned())
        }
    };
    inputs::warn_of_magnitudes(&[&model], &bundle, console);
    let progress = |what: &str| console.progress(what);
    let closed = close_asking(&model, &bundle, &questions, &progress);
    let mut closed = closed.map_err(|error| in_its_bundle(error, options))?;
    let compared = (options.out.is_some() || console.json())
        .then(|| flown(&model, &bundle, &mut closed, console));
    let mut text = summary(&closed);
    let mut added = closed.report.effects.iter();
    if options.add_empirical && !added.any(|e| e.id == "empirical") {
        text.push_str(
            "--add-empirical added nothing: what is left follows no variable that a model can declare\n",
        );
    }
    if let Some(dir) = &options.out {
        console.progress("writing results");
        let output = Output::new(dir)?;
        let run = Run {
            closed: &closed,
            bundle: &bundle,
            input: &title,
            compared: match &compared {
                Some(Ok(compared)) => Ok(compared),
                Some(Err(reason)) => Err(reason),
                None => Err("it was not asked for"),
            },
        };
        let (written, page) = rayon::join(|| write(&closed, &text, &output), || html(&run));
        written?;
        output.write("report.html", |to| to.write_all(page.as_bytes()))?;
        results::commit(output, &RESULTS, REPORT_FORMAT)?;
    }
    console.say(&format!("Input     {title}\n{tables}{text}"));
    if console.json() {
        console
            .machine(&serde_json::to_string_pretty(&closed.report).context("the report as JSON")?);
    }
    Ok(())
}

/// With the bundle that an error is about.
fn in_its_bundle(error: CloseError, options: &Close) -> anyhow::Error {
    match &options.bundle {
        Some(bundle) if error.is_of_bundle() => {
            anyhow::anyhow!("{}: {error}", bundle.display())
        }
        _ => error.into(),
    }
}

/// A misspelt effect is answered with the nearest, too.
fn with_nearest(error: CloseError) -> anyhow::Error {
    if let CloseError::UnknownHypothesis { id, known } = &error {
        let names: Vec<&str> = known.split(", ").collect();
        if let Some(near) = nearest(id, &names) {
            return anyhow::anyhow!(
                "--test: no effect `{id}` in the catalogue; the nearest is `{near}` (all: {known})"
            );
        }
    }
    error.into()
}

/// Draws of each model behind its spectrum: enough for a mean and its 3 sigma.
const DRAWS: u64 = 40;
/// A long run has many periods in every band, and needs fewer draws of it.
const FLOWN_FRAMES: u64 = 72_000;
const FEWEST_DRAWS: u64 = 8;

fn draws(frames: usize) -> u64 {
    (FLOWN_FRAMES / frames.max(1) as u64).clamp(FEWEST_DRAWS, DRAWS)
}

/// Ensembles of the declared model and of the better one beside the measured attitude error, and
/// their `log_psd_cost` in the report; or why they cannot be had.
fn flown(
    model: &Model,
    bundle: &Bundle,
    closed: &mut Closed,
    console: &Console,
) -> Result<Compared, String> {
    let settings = CompareSettings {
        draws: draws(bundle.attitude.as_ref().map_or(0, |a| a.t_s.len())),
        ..CompareSettings::default()
    };
    let added = (!closed.report.effects.is_empty()).then(|| closed.model.clone());
    let others: Vec<Model> = added.into_iter().collect();
    let compared = compare(model, &others, bundle, &settings, &|what| {
        console.progress(what);
    })
    .map_err(|error| error.to_string())?;
    let cost = |model: &ComparedModel| {
        let axes = &model.axes;
        Some([&axes.x, &axes.y, &axes.z].map(|axis| axis.log_psd_cost))
    };
    let told = &compared.report;
    closed.report.before.log_psd_cost = cost(&told.model);
    closed.report.after.log_psd_cost = cost(told.others.first().unwrap_or(&told.model));
    Ok(compared)
}

fn write(closed: &Closed, text: &str, output: &Output) -> anyhow::Result<()> {
    let json = serde_json::to_string_pretty(&closed.report).context("the report as JSON")?;
    output.write("report.json", |to| writeln!(to, "{json}"))?;
    output.write("summary.txt", |to| to.write_all(text.as_bytes()))?;
    output.write("model.toml", |to| {
        to.write_all(closed.model.to_toml().as_bytes())
    })?;
    if let Some(stars) = &closed.stars {
        stars.write(output)?;
    }
    if let Some(attitude) = &closed.attitude {
        attitude.write(output)?;
    }
    if let Some(map) = &closed.dark_map {
        map.write(output)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_run_is_flown_less_often() {
        assert_eq!(draws(0), DRAWS);
        assert_eq!(draws(1800), DRAWS);
        assert_eq!(draws(3600), 20);
        assert_eq!(draws(7200), 10);
        assert_eq!(draws(144_000), FEWEST_DRAWS);
    }
}
