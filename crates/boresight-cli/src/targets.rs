//! What must not be written over: what was measured, and what the command itself reads.

use std::path::{Path, PathBuf};

use boresight::telemetry::{bundle_files, foreign_file};

/// Refuses a folder that holds a bundle which was not made here.
pub(crate) fn refuse_measured(dir: &Path) -> anyhow::Result<()> {
    let Some(file) = foreign_file(dir) else {
        return Ok(());
    };
    anyhow::bail!(
        "{}: the folder holds {file} of a bundle that boresight did not make; give another folder to --out, or --force to replace the bundle",
        dir.display()
    )
}

/// Whether a file is a result of this format: then what lies beside it may be of the same run.
pub(crate) fn is_result(path: &Path, format: &str) -> bool {
    let text = std::fs::read(path).unwrap_or_default();
    let read: serde_json::Result<serde_json::Value> = serde_json::from_slice(&text);
    read.is_ok_and(|value| value["format"] == format)
}

/// The files of a bundle.
pub(crate) fn of_bundle(dir: &Path) -> Vec<PathBuf> {
    let names = bundle_files(dir).into_iter();
    names.map(|name| dir.join(name)).collect()
}

/// Refuses a folder where a file of these names is one of the inputs.
pub(crate) fn refuse_inputs(dir: &Path, names: &[&str], inputs: &[PathBuf]) -> anyhow::Result<()> {
    let mut files = names.iter().map(|name| dir.join(name));
    files.try_for_each(|file| refuse_input(&file, inputs))
}

/// Refuses to write a file over one of the inputs, whatever way leads there.
pub(crate) fn refuse_input(target: &Path, inputs: &[PathBuf]) -> anyhow::Result<()> {
    // what is not there is not written over
    let Ok(real) = target.canonicalize() else {
        return Ok(());
    };
    let read = |input: &&PathBuf| input.canonicalize().is_ok_and(|input| input == real);
    match inputs.iter().find(read) {
        Some(input) => anyhow::bail!(
            "{}: --out would write over this file, which the command reads; give another place to --out",
            input.display()
        ),
        None => Ok(()),
    }
}
