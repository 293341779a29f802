//! `boresight assess`: on-orbit noise without a model.

use std::io::Write as _;

use anyhow::Context as _;
use boresight::assess::{AssessError, Assessment, Options, assess};
use boresight::report::{assess_figures, assess_summary};
use boresight::telemetry::Output;
use boresight::telemetry::report::{ASSESS_FORMAT, AssessMethod};

use crate::arguments::{Assess, Method};
use crate::console::Console;
use crate::inputs;
use crate::results;
use crate::targets;

/// All files that the command may write.
const RESULTS: [&str; 5] = [
    "assess.json",
    "summary.txt",
    "noise.svg",
    "residual.svg",
    "residuals_attitude.parquet",
];

pub(crate) fn run(options: &Assess, console: &Console) -> anyhow::Result<()> {
    if let Some(dir) = &options.out {
        targets::refuse_inputs(dir, &RESULTS, &targets::of_bundle(&options.bundle))?;
    }
    console.progress("reading");
    let (bundle, tables) = inputs::bundle(&options.bundle, console)?;
    let settings = Options {
        method: options.method.map(|method| match method {
            Method::RigidRotator => AssessMethod::RigidRotator,
            Method::Gyro => AssessMethod::Gyro,
            Method::Reference => AssessMethod::Reference,
        }),
        inertia: options.inertia,
        alignment: options
            .alignment
            .map(|[a, b, c, d, e, f, g, h, i]| [[a, b, c], [d, e, f], [g, h, i]]),
        requirement_arcsec: options.requirement,
        gyro_walk_arcsec_rt_s: options.gyro_walk,
        window_s: options.window,
    };
    let name = options.bundle.display().to_string();
    let found = assess(&bundle, &settings, &|what| console.progress(what))
        .map_err(|error| by_option(error).context(name.clone()))?;
    let text = assess_summary(&found);
    let json = serde_json::to_string_pretty(&found.document()).context("the assessment as JSON")?;
    if let Some(dir) = &options.out {
        console.progress("writing results");
        let output = Output::new(dir)?;
        write(&found, &text, &json, &output)?;
        results::commit(output, &RESULTS, ASSESS_FORMAT)?;
    }
    console.say(&format!("Input     {name}\n{tables}{text}"));
    console.machine(&json);
    Ok(())
}

/// An option that does nothing is told as one, with what would make it act.
fn by_option(error: AssessError) -> anyhow::Error {
    match error {
        AssessError::NotUsed {
            given,
            needs,
            method,
        } => {
            let option = given.replace('_', "-");
            anyhow::anyhow!(
                "--{option} is used by --method {needs} alone, and the method here is {method}; leave the option out, or give --method {needs}"
            )
        }
        other => other.into(),
    }
}

fn write(found: &Assessment, text: &str, json: &str, output: &Output) -> anyhow::Result<()> {
    output.write("assess.json", |to| writeln!(to, "{json}"))?;
    output.write("summary.txt", |to| to.write_all(text.as_bytes()))?;
    for (name, svg) in assess_figures(found) {
        output.write(&name, |to| to.write_all(svg.as_bytes()))?;
    }
    if let Some(residuals) = found.residuals() {
        residuals.write(output)?;
    }
    Ok(())
}
