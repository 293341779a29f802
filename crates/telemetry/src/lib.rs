//! Bundles, models and results on disk.
//!
//! The formats are the contract with users: `docs/formats/` has a page for each. What is read is
//! checked, and one clear error names file, line and column; what is written appears whole or not
//! at all.
#![forbid(unsafe_code)]

mod bundle;
pub mod config;
mod error;
mod extra;
mod files;
pub mod hipparcos;
mod layout;
mod metadata;
mod model;
mod output;
mod pixel_name;
pub mod report;
mod residuals;
mod table;
mod tables;
mod time;
mod unfinished;

pub use bundle::{
    Bundle, BundleWriter, TableFiles, TableFormat, bundle_files, foreign_file, made_here,
};
pub use error::{CellError, Place, TelemetryError, TomlError};
pub use extra::{ExtraCells, ExtraColumn, ExtraColumns, TextCells};
pub use files::{Files, Folder, MemoryFiles, Source};
pub use metadata::{
    BUNDLE_FORMAT, Frames, ImagesMeta, Metadata, QuaternionSigns, TrackerMeta, VectorFrame,
};
pub use model::{
    EffectEntry, EffectPlace, EffectValue, HemAxes, HemAxis, MODEL_FORMAT, Model, ModelKind,
    ModelNoise, ModelTracker,
};
pub use output::{Output, write_file};
pub use residuals::{AttitudeResiduals, DarkMap, StarResiduals};
pub use tables::{AttitudeTable, Housekeeping, RateTable, ReferenceTable, WindowTable};
pub use time::{Epoch, TimeScale};
pub use unfinished::remove_unfinished;
