//! Makes the bundle and the model of `fixtures/example` from `fixtures/scenarios/example.toml`:
//! `cargo run --release -p scenarios --example make_example`.

use std::path::Path;

use scenarios::{Scenario, simulate};
use telemetry::TableFormat;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    let scenario = Scenario::read(&fixtures.join("scenarios/example.toml"))?;
    let out = fixtures.join("example");
    simulate(&scenario)?.write(&out.join("bundle"), TableFormat::CsvGz)?;
    std::fs::write(
        out.join("model.toml"),
        scenario.model_without_effects().to_toml(),
    )?;
    Ok(())
}
