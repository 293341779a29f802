//! `boresight simulate`: a bundle from a scenario.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use boresight::comparison::Scene;
use boresight::report::scene_figures;
use boresight::scenarios::{Motion, Scenario, Simulated, preset, simulate_with_truth};
use boresight::telemetry::Output;

use crate::arguments::{Fidelity, Simulate};
use crate::commands::render;
use crate::console::Console;
use crate::targets;

pub(crate) fn run(options: &Simulate, console: &Console) -> anyhow::Result<()> {
    if let Some(name) = options.print_preset.as_deref() {
        let name = if name.is_empty() {
            options.preset.as_deref()
        } else {
            Some(name)
        };
        console.text(
            preset(
                name.context("--print-preset needs the name of a preset, or --preset beside it")?,
            )?
            .text,
        );
        return Ok(());
    }
    let out = options.out.as_ref().context("--out needs a folder")?;
    if !options.force {
        targets::refuse_measured(out)?;
    }
    let input = Input::of(options)?;
    if options.fidelity != Some(Fidelity::Model) && render::is_world(&input) {
        return render::world(&input, out, options, console);
    }
    console.progress("reading the scenario");
    let scenario = Scenario {
        folder: input.folder.clone(),
        ..Scenario::parse(&input.text, &input.file)?
    };
    if options.fidelity == Some(Fidelity::Pixel) {
        return render::scenario(&input, &scenario, out, options, console);
    }
    console.progress("simulating");
    refuse_inputs(options, &scenario.motion, &scenario.folder, out)?;
    let simulated = simulate_with_truth(&scenario, scenario.run.draw)
        .map_err(|error| error.in_file(&input.text, &input.file))?;
    let bundle = &simulated.bundle;
    console.progress("writing the bundle");
    bundle.write(out, options.tables.format())?;
    if let Some(dir) = &options.figures {
        console.progress("drawing");
        draw(&simulated, dir)?;
    }
    let solved = bundle.attitude.as_ref().map_or(0, |a| a.t_s.len());
    let frames = bundle.stars.as_ref().map_or(solved, |s| s.frames());
    let rows = bundle.stars.as_ref().map_or(0, |s| s.rows());
    let out = out.display();
    console.say(&format!(
        "{frames} frames, {rows} star rows written to {out}"
    ));
    console.machine(
        &serde_json::json!({ "bundle": out.to_string(), "frames": frames, "star_rows": rows })
            .to_string(),
    );
    Ok(())
}

/// The file that says what is simulated.
pub(crate) struct Input {
    pub(crate) text: String,
    /// What messages call it.
    pub(crate) file: String,
    /// Folder at which relative paths start.
    pub(crate) folder: PathBuf,
}

impl Input {
    fn of(options: &Simulate) -> anyhow::Result<Self> {
        match (&options.preset, &options.scenario) {
            (Some(name), _) => {
                let preset = preset(name)?;
                Ok(Self {
                    text: preset.text.to_owned(),
                    file: format!("preset {}", preset.name),
                    folder: PathBuf::new(),
                })
            }
            (None, Some(path)) => Ok(Self {
                text: std::fs::read_to_string(path)
                    .with_context(|| format!("{}: cannot read", path.display()))?,
                file: path.display().to_string(),
                folder: path.parent().unwrap_or(Path::new("")).to_owned(),
            }),
            (None, None) => anyhow::bail!("a scenario file or --preset is needed"),
        }
    }
}

/// Neither the scenario nor the recording that it names is written over.
pub(super) fn refuse_inputs(
    options: &Simulate,
    motion: &Motion,
    folder: &Path,
    out: &Path,
) -> anyhow::Result<()> {
    let mut inputs: Vec<PathBuf> = options.scenario.iter().cloned().collect();
    if let Motion::Recorded(recorded) = motion {
        inputs.extend(targets::of_bundle(&folder.join(&recorded.bundle)));
    }
    let replaced = targets::of_bundle(out);
    let mut each = replaced.iter();
    each.try_for_each(|file| targets::refuse_input(file, &inputs))
}

/// Pictures of the run; the motion is the reference's where there is one, else the true one.
fn draw(simulated: &Simulated, dir: &Path) -> anyhow::Result<()> {
    let bundle = &simulated.bundle;
    let estimate = match &bundle.reference {
        Some(reference) => Some(reference.series_with_gaps()?),
        None => None,
    };
    let scene = Scene::new(
        &simulated.pbm,
        estimate.as_ref().unwrap_or(&simulated.truth),
        &simulated.rows.t_s,
        bundle.stars.as_ref(),
    );
    let title = bundle.meta.title.as_deref().unwrap_or("simulated run");
    let output = Output::new(dir)?;
    for (name, svg) in scene_figures(&scene, title) {
        output.write(&name, |to| to.write_all(svg.as_bytes()))?;
    }
    output.commit()?;
    Ok(())
}
