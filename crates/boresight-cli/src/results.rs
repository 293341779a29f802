//! The folder of results of a command.

use boresight::telemetry::{Output, TelemetryError};

use crate::targets;

/// Puts results in their place. `names` are all that the command may write, its document first: where one of `format`
/// stands there already, those of the run before that this one did not write are taken away.
pub(crate) fn commit(output: Output, names: &[&str], format: &str) -> Result<(), TelemetryError> {
    let document = names.first().map(|name| output.target().join(name));
    if document.is_some_and(|path| targets::is_result(&path, format)) {
        output.commit_in_place_of(names)
    } else {
        output.commit()
    }
}

#[cfg(test)]
mod tests {
    use std::error::Error;
    use std::fs;
    use std::io::Write as _;

    use super::*;

    #[test]
    fn only_results_of_the_same_command_are_replaced() -> Result<(), Box<dyn Error>> {
        for (format, stays) in [("boresight-compare/1", false), ("another/1", true)] {
            let dir = tempfile::tempdir()?;
            let stale = dir.path().join("distortion.svg");
            fs::write(&stale, "of the run before")?;
            fs::write(
                dir.path().join("compare.json"),
                format!("{{ \"format\": \"{format}\" }}"),
            )?;
            let output = Output::new(dir.path())?;
            output.write("compare.json", |to| to.write_all(b"new"))?;
            commit(
                output,
                &["compare.json", "distortion.svg"],
                "boresight-compare/1",
            )?;
            assert_eq!(stale.exists(), stays, "{format}");
        }
        Ok(())
    }
}
