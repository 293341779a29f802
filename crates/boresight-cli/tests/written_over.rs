//! What a command must not write over, and what it takes away of an earlier run.

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

fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        fs::copy(entry.path(), to.join(entry.file_name()))?;
    }
    Ok(())
}

/// Names and contents of the files of a folder.
fn files(dir: &Path) -> std::io::Result<Vec<(PathBuf, Vec<u8>)>> {
    let mut all = vec![];
    for entry in fs::read_dir(dir)? {
        let path = entry?.path();
        all.push((path.clone(), fs::read(path)?));
    }
    all.sort();
    Ok(all)
}

/// Exit 2, one line that says these words, and the folder as it was.
fn refuses(command: &mut Command, dir: &Path, words: &[&str]) -> Done {
    let before = files(dir)?;
    let done = command.output()?;
    let said = String::from_utf8(done.stderr)?;
    assert_eq!(done.status.code(), Some(2), "{said}");
    assert_eq!(said.trim_end().lines().count(), 1, "{said}");
    for word in words {
        assert!(said.contains(word), "no {word:?} in: {said}");
    }
    assert!(files(dir)? == before, "the folder has changed: {said}");
    Ok(())
}

const HOLD: &str = r#"format = "boresight-model/1"
[tracker]
pixels = [512, 512]
fov_deg = [20.0, 20.0]
[motion]
kind = "hold"
[run]
duration_s = 5.0
rate_hz = 2.0
"#;

fn simulate(scenario: &Path, out: &Path) -> Command {
    let mut command = boresight();
    command.arg("simulate").arg(scenario).arg("--out").arg(out);
    command
}

#[test]
fn what_was_measured_is_not_replaced_by_a_simulation() -> Done {
    let dir = tempfile::tempdir()?;
    let (scenario, bundle) = (dir.path().join("hold.toml"), dir.path().join("night"));
    fs::write(&scenario, HOLD)?;
    copy(&fixtures().join("bundles/complete"), &bundle)?;
    let words = [bundle.to_str().ok_or("name")?, "attitude.csv", "--force"];
    refuses(&mut simulate(&scenario, &bundle), &bundle, &words)?;
    refuses(
        simulate(&scenario, &bundle).args(["--fidelity", "pixel"]),
        &bundle,
        &words,
    )?;
    // tables without a bundle.toml are nobody's to replace either
    fs::remove_file(bundle.join("bundle.toml"))?;
    refuses(&mut simulate(&scenario, &bundle), &bundle, &words)?;
    copy(&fixtures().join("bundles/complete"), &bundle)?;
    simulate(&scenario, &bundle)
        .arg("--force")
        .assert()
        .success();
    assert!(!bundle.join("housekeeping.csv").exists());
    Ok(())
}

#[test]
fn what_was_made_here_is_replaced() -> Done {
    let dir = tempfile::tempdir()?;
    let (scenario, bundle) = (dir.path().join("hold.toml"), dir.path().join("bundle"));
    fs::write(&scenario, HOLD)?;
    for more in [
        &["--tables", "csv"][..],
        &["--tables", "parquet"],
        &["--fidelity", "pixel"],
        &["--fidelity", "model"],
    ] {
        let mut command = simulate(&scenario, &bundle);
        command.args(more).assert().success();
    }
    assert!(!bundle.join("attitude.csv").exists());
    Ok(())
}

#[test]
fn a_recording_is_not_written_over_by_its_replay() -> Done {
    let dir = tempfile::tempdir()?;
    let (scenario, bundle) = (dir.path().join("hold.toml"), dir.path().join("bundle"));
    fs::write(&scenario, format!("{HOLD}[reference]\n"))?;
    simulate(&scenario, &bundle).assert().success();
    let replay = HOLD.replace("\"hold\"", "\"recorded\"\nbundle = \"bundle\"");
    fs::write(&scenario, replay)?;
    let words = ["attitude.csv.gz", "--out", "reads"];
    refuses(&mut simulate(&scenario, &bundle), &bundle, &words)?;
    refuses(simulate(&scenario, &bundle).arg("--force"), &bundle, &words)?;
    simulate(&scenario, &dir.path().join("other"))
        .assert()
        .success();
    Ok(())
}

#[test]
fn inputs_are_not_written_over() -> Done {
    let dir = tempfile::tempdir()?;
    let here = dir.path();
    let model = here.join("model.toml");
    fs::copy(fixtures().join("example/model.toml"), &model)?;
    let bundle = fixtures().join("example/bundle");
    let mut close = boresight();
    close.arg("close").arg(&model).arg(&bundle);
    // another way to the same folder is the same folder
    let around = here.join("..").join(here.file_name().ok_or("name")?);
    let words = ["model.toml", "--out", "reads"];
    refuses(close.arg("--out").arg(around), here, &words)?;

    let other = here.join("psd.csv");
    fs::rename(&model, &other)?;
    let mut compare = boresight();
    compare
        .arg("compare")
        .arg(fixtures().join("example/model.toml"));
    compare.arg(&bundle).arg("--with").arg(&other);
    refuses(compare.arg("--out").arg(here), here, &["psd.csv", "--out"])?;

    let night = here.join("night");
    copy(&bundle, &night)?;
    for name in ["bundle.toml", "stars.csv.gz"] {
        let mut fit = boresight();
        fit.arg("fit")
            .arg(&night)
            .arg("--out")
            .arg(night.join(name));
        refuses(&mut fit, &night, &[name, "--out"])?;
    }
    Ok(())
}

/// A run without stars after one with them, in the same folder.
#[test]
fn results_of_an_earlier_run_do_not_stay() -> Done {
    let dir = tempfile::tempdir()?;
    let (results, bundle) = (dir.path().join("results"), dir.path().join("bundle"));
    copy(&fixtures().join("example/bundle"), &bundle)?;
    let close = || {
        let mut close = boresight();
        close
            .arg("close")
            .arg(fixtures().join("example/model.toml"));
        close.arg(&bundle).arg("--out").arg(&results);
        close
    };
    // no report is there: what has the name of a result is somebody's own
    fs::create_dir(&results)?;
    fs::write(results.join("dark_map.csv"), "mine")?;
    close().assert().success();
    assert!(results.join("dark_map.csv").exists());
    fs::write(results.join("notes.txt"), "mine")?;
    assert!(results.join("residuals_stars.parquet").exists());
    fs::remove_file(bundle.join("stars.csv.gz"))?;
    close().assert().success();
    for (name, there) in [
        ("residuals_stars.parquet", false),
        ("dark_map.csv", false),
        ("residuals_attitude.parquet", true),
        ("report.html", true),
        ("notes.txt", true),
    ] {
        assert_eq!(results.join(name).exists(), there, "{name}");
    }
    Ok(())
}
