//! `boresight compare`: models beside what was measured.

use std::io::Write as _;

use anyhow::Context as _;
use boresight::comparison::{CompareSettings, compare};
use boresight::report::{compare_figures, compare_summary, compare_tables};
use boresight::telemetry::report::COMPARE_FORMAT;
use boresight::telemetry::{Model, Output};

use crate::arguments::Compare;
use crate::console::Console;
use crate::inputs;
use crate::results;
use crate::targets;

/// All files that the command may write.
const RESULTS: [&str; 11] = [
    "compare.json",
    "summary.txt",
    "psd.csv",
    "draws.csv",
    "psd.svg",
    "psd_x.svg",
    "psd_y.svg",
    "psd_z.svg",
    "error.svg",
    "residual.svg",
    "distortion.svg",
];

pub(crate) fn run(options: &Compare, console: &Console) -> anyhow::Result<()> {
    if let Some(dir) = &options.out {
        let mut inputs = targets::of_bundle(&options.bundle);
        inputs.push(options.model.clone());
        inputs.extend(options.others.iter().cloned());
        targets::refuse_inputs(dir, &RESULTS, &inputs)?;
    }
    console.progress("reading");
    let model = Model::read(&options.model)?;
    let mut others = vec![];
    for path in &options.others {
        others.push(Model::read(path)?);
    }
    let (bundle, tables) = inputs::bundle(&options.bundle, console)?;
    let models: Vec<&Model> = others.iter().chain([&model]).collect();
    inputs::warn_of_magnitudes(&models, &bundle, console);
    let settings = CompareSettings {
        draws: options.draws,
        seed: options.seed,
    };
    let compared = compare(&model, &others, &bundle, &settings, &|what| {
        console.progress(what);
    })
    .map_err(|error| match error.is_of_model() {
        // it has the model's name, and the bundle is not to blame
        true => error.into(),
        false => anyhow::Error::from(error).context(options.bundle.display().to_string()),
    })?;
    let json = serde_json::to_string_pretty(&compared.report).context("the comparison as JSON")?;
    let text = compare_summary(&compared.report);
    if let Some(dir) = &options.out {
        console.progress("writing results");
        let output = Output::new(dir)?;
        output.write("compare.json", |to| writeln!(to, "{json}"))?;
        output.write("summary.txt", |to| to.write_all(text.as_bytes()))?;
        for (name, content) in compare_tables(&compared)
            .into_iter()
            .chain(compare_figures(&compared))
        {
            output.write(&name, |to| to.write_all(content.as_bytes()))?;
        }
        results::commit(output, &RESULTS, COMPARE_FORMAT)?;
    }
    console.say(&format!(
        "Input     {} against {}\n{tables}{text}",
        options.bundle.display(),
        options.model.display()
    ));
    console.machine(&json);
    Ok(())
}
