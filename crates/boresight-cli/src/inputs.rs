//! What is read, and what of it goes unused without being wrong.

use std::path::Path;

use boresight::telemetry::{Bundle, Folder, Model, TableFiles};

use crate::console::Console;

/// A bundle, and the line that says which tables it has; a warning of files that only look like tables of it.
pub(crate) fn bundle(path: &Path, console: &Console) -> anyhow::Result<(Bundle, String)> {
    let bundle = Bundle::read(path)?;
    let tables = TableFiles::of(&Folder::at(path))?;
    if let Some(warning) = tables.warning() {
        console.warn(&format!("{}: {warning}", path.display()));
    }
    let line = format!("Tables    {}\n", tables.read.join(", "));
    Ok((bundle, line))
}

/// Stars of unknown magnitude keep their noise, whatever `magnitude_noise` a model declares.
pub(crate) fn warn_of_magnitudes(models: &[&Model], bundle: &Bundle, console: &Console) {
    let Some(stars) = &bundle.stars else {
        return;
    };
    let known = stars.mag.is_some() || bundle.catalog.is_some();
    let mut declared = models.iter().flat_map(|model| &model.effects);
    if !known && declared.any(|effect| effect.id == "magnitude_noise") {
        console.warn("the declared magnitude_noise is not applied: the bundle has no magnitudes, neither a column mag of table stars nor a table catalog");
    }
}
