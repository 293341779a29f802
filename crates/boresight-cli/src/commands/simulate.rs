//! `boresight simulate`: a bundle from a scenario.

use boresight::scenarios::{Scenario, simulate};
use boresight::telemetry::TableFormat;

use crate::arguments::{Simulate, Tables};
use crate::console::Console;

pub(crate) fn run(options: &Simulate, console: &Console) -> anyhow::Result<()> {
    console.progress("reading the scenario");
    let scenario = Scenario::read(&options.scenario)?;
    console.progress("simulating");
    let bundle = simulate(&scenario)?;
    console.progress("writing the bundle");
    let format = match options.tables {
        Tables::Csv => TableFormat::Csv,
        Tables::CsvGz => TableFormat::CsvGz,
        Tables::Parquet => TableFormat::Parquet,
    };
    bundle.write(&options.out, format)?;
    let frames = bundle.stars.as_ref().map_or(0, |s| s.frames());
    let rows = bundle.stars.as_ref().map_or(0, |s| s.rows());
    let out = options.out.display();
    console.say(&format!(
        "{frames} frames, {rows} star rows written to {out}"
    ));
    console.machine(
        &serde_json::json!({ "bundle": out.to_string(), "frames": frames, "star_rows": rows })
            .to_string(),
    );
    Ok(())
}
