//! The example inside the binary: a simulated bundle and a model that lacks one
//! of its effects. `cargo xtask fixtures` makes it.

use boresight::telemetry::{Bundle, MemoryFiles, Model, TelemetryError};

const MODEL: &str = include_str!("../../../fixtures/example/model.toml");

/// The model that the example is held against.
pub(crate) fn model() -> Result<Model, TelemetryError> {
    Model::parse(MODEL, "example/model.toml", &[])
}

/// The example's telemetry.
pub(crate) fn bundle() -> Result<Bundle, TelemetryError> {
    macro_rules! files {
        ($($name:literal),*) => {
            MemoryFiles::new("example")
                $(.with($name, include_bytes!(concat!("../../../fixtures/example/bundle/", $name))))*
        };
    }
    Bundle::read_from(&files!(
        "bundle.toml",
        "stars.csv.gz",
        "attitude.csv.gz",
        "reference.csv.gz",
        "catalog.csv.gz",
        "housekeeping.csv.gz"
    ))
}
