//! `boresight simulate`: a bundle from a scenario.

use anyhow::Context as _;
use boresight::scenarios::{Scenario, preset, simulate};

use crate::arguments::{Fidelity, Simulate};
use crate::commands::render;
use crate::console::Console;

pub(crate) fn run(options: &Simulate, console: &Console) -> anyhow::Result<()> {
    if let Some(name) = options.print_preset.as_deref() {
        let name = if name.is_empty() {
            options.preset.as_deref()
        } else {
            Some(name)
        };
        console.text(preset(name.context("--print-preset needs a name")?)?.text);
        return Ok(());
    }
    let out = options.out.as_ref().context("--out needs a folder")?;
    if let Some(path) = &options.scenario
        && options.fidelity != Some(Fidelity::Model)
        && render::is_world(path)?
    {
        return render::world(path, out, options, console);
    }
    console.progress("reading the scenario");
    let scenario = match (&options.preset, &options.scenario) {
        (Some(name), _) => preset(name)?.scenario()?,
        (None, Some(path)) => Scenario::read(path)?,
        (None, None) => anyhow::bail!("a scenario file or --preset is needed"),
    };
    if options.fidelity == Some(Fidelity::Pixel) {
        return render::scenario(&scenario, out, options, console);
    }
    console.progress("simulating");
    let bundle = simulate(&scenario)?;
    console.progress("writing the bundle");
    bundle.write(out, options.tables.format())?;
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
