//! Mistakes as a user meets them: one message, once, that names the file, the line or the option.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;

type Done = Result<(), Box<dyn std::error::Error>>;

fn boresight() -> Command {
    Command::new(env!("CARGO_BIN_EXE_boresight"))
}

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures")
}

fn example() -> PathBuf {
    fixtures().join("example/bundle")
}

/// A file in a folder, with its name as messages have it.
fn file(dir: &Path, name: &str, text: &str) -> Result<(PathBuf, String), std::io::Error> {
    let path = dir.join(name);
    fs::write(&path, text)?;
    let shown = path.display().to_string();
    Ok((path, shown))
}

const MODEL: &str = r#"format = "boresight-model/1"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
[noise]
temporal_arcsec = 7.43
[[effect]]
id = "rolling_shutter"
line_time_s = 30e-6
"#;

const RUN: &str = r#"[motion]
kind = "slews"
[[motion.slew]]
axis = [1.0, 0.0, 0.0]
angle_deg = 1.0
duration_s = 5.0
[run]
duration_s = 10.0
rate_hz = 2.0
"#;

#[test]
fn a_model_with_an_empirical_term_is_simulated_and_compared() -> Done {
    let dir = tempfile::tempdir()?;
    let term = "[[effect]]\nid = \"empirical\"\nvariable = \"time\"\nacts_on = \"attitude\"\nmiddle = 5.0\nhalf = 5.0\ncoefficients = [2.0, -1.0, 20.0]\n";
    let (model, _) = file(dir.path(), "model.toml", &format!("{MODEL}{term}"))?;
    let mut compare = boresight();
    compare.arg("compare").arg(&model).arg(example());
    compare.args(["--draws", "8"]).assert().success();
    let (scenario, _) = file(dir.path(), "s.toml", &format!("{MODEL}{term}{RUN}"))?;
    let mut simulate = boresight();
    simulate.arg("simulate").arg(&scenario).arg("--out");
    simulate.arg(dir.path().join("bundle")).assert().success();
    Ok(())
}
