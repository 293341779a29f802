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

/// What a command that has to fail says; exit 2, nothing on stdout.
fn said(command: &mut Command) -> Result<String, Box<dyn std::error::Error>> {
    let done = command.output()?;
    let said = String::from_utf8(done.stderr)?;
    assert_eq!(done.status.code(), Some(2), "{said}");
    assert!(done.stdout.is_empty(), "{said}");
    Ok(said)
}

#[track_caller]
fn has(said: &str, words: &[&str]) {
    for word in words {
        assert!(said.contains(word), "no {word:?} in: {said}");
    }
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
fn a_mistake_in_an_effect_is_shown_in_its_line() -> Done {
    let dir = tempfile::tempdir()?;
    for (from, to, line, word) in [
        ("rolling_shutter", "roling_shutter", 8, "`rolling_shutter`"),
        ("line_time_s", "line_tim_s", 9, "`line_time_s`"),
        ("30e-6", "30.0", 9, "line_time_s"),
        ("30e-6", "[1.0, 2.0]", 9, "a number"),
        ("line_time_s = 30e-6", "", 7, "line_time_s"),
        (
            "\"rolling_shutter\"\nline_time_s = 30e-6",
            "\"optical_distortion\"\ncx_px = 3.0",
            7,
            "a term of the lens",
        ),
    ] {
        let text = MODEL.replacen(from, to, 1);
        let (model, shown) = file(dir.path(), "model.toml", &text)?;
        let place = format!("error: {shown}, line {line}, ");
        let closed = said(boresight().arg("close").arg(&model).arg(example()))?;
        has(&closed, &[&place, word]);
        let compared = said(boresight().arg("compare").arg(&model).arg(example()))?;
        has(&compared, &[&place, word]);
        let (scenario, shown) = file(dir.path(), "scenario.toml", &format!("{text}{RUN}"))?;
        let mut simulate = boresight();
        simulate.arg("simulate").arg(&scenario).arg("--out");
        let simulated = said(simulate.arg(dir.path().join("bundle")))?;
        has(
            &simulated,
            &[&format!("error: {shown}, line {line}, "), word],
        );
    }
    Ok(())
}

#[test]
fn a_value_of_a_scenario_is_shown_in_its_line() -> Done {
    let dir = tempfile::tempdir()?;
    let good = format!("{MODEL}{RUN}");
    for (from, to, line) in [
        ("duration_s = 10.0", "duration_s = -10.0", 17),
        ("[1.0, 0.0, 0.0]", "[0.0, 0.0, 0.0]", 13),
        ("rate_hz = 2.0\n", "", 16),
    ] {
        let (scenario, shown) = file(dir.path(), "scenario.toml", &good.replacen(from, to, 1))?;
        let mut simulate = boresight();
        simulate.arg("simulate").arg(&scenario).arg("--out");
        let told = said(simulate.arg(dir.path().join("bundle")))?;
        has(&told, &[&format!("error: {shown}, line {line}, ")]);
    }
    let world = fs::read_to_string(fixtures().join("worlds/null_slews.toml"))?;
    let line = world
        .lines()
        .position(|line| line.starts_with("duration_s"));
    let line = 1 + line.ok_or("a duration")?;
    let text = world.replacen("duration_s = ", "duration_s = -", 1);
    let (world, shown) = file(dir.path(), "world.toml", &text)?;
    let mut simulate = boresight();
    simulate.arg("simulate").arg(&world).arg("--out");
    let told = said(simulate.arg(dir.path().join("bundle")))?;
    has(&told, &[&format!("error: {shown}, line {line}, ")]);
    Ok(())
}

#[test]
fn a_scenario_is_no_model() -> Done {
    let dir = tempfile::tempdir()?;
    let (scenario, shown) = file(dir.path(), "scenario.toml", &format!("{MODEL}{RUN}"))?;
    let told = said(boresight().arg("close").arg(&scenario).arg(example()))?;
    has(&told, &[&shown, "line 10", "a scenario", "[motion], [run]"]);
    Ok(())
}

/// As docs/formats/model.md promises: what `close --add-empirical` writes is read by all.
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

#[test]
fn a_band_beyond_the_spectrum_is_told_once() -> Done {
    let mut fit = boresight();
    let told = said(fit.arg("fit").arg(example()).args(["--band-hz", "5,10"]))?;
    has(&told, &["--band-hz", "5 to 10 Hz", "1.000 Hz"]);
    assert_eq!(told.matches("5 to 10 Hz").count(), 1, "{told}");
    assert_eq!(told.trim_end().lines().count(), 1, "{told}");
    Ok(())
}

/// Every frequency left out: fitted to nothing, and that said once.
#[test]
fn nothing_left_to_fit_is_told_once() -> Done {
    let mut fit = boresight();
    let told = said(fit.arg("fit").arg(example()).args(["--exclude-hz", "0,10"]))?;
    has(&told, &["--exclude-hz: fit of the residual about x"]);
    assert_eq!(told.matches("usable").count(), 1, "{told}");
    Ok(())
}

#[test]
fn an_option_that_does_nothing_is_refused() -> Done {
    let mut command = boresight();
    command.arg("assess").arg(example());
    let told = said(command.args(["--inertia", "1,1,2"]))?;
    has(&told, &["--inertia", "--method rigid_rotator", "reference"]);
    let mut command = boresight();
    command.arg("assess").arg(example());
    let told = said(command.args(["--method", "reference", "--gyro-walk", "0.1"]))?;
    has(&told, &["--gyro-walk", "--method gyro"]);
    // pixels are not drawn
    let dir = tempfile::tempdir()?;
    let mut command = boresight();
    command.arg("simulate");
    command.arg(fixtures().join("worlds/null_hold.toml"));
    command.arg("--out").arg(dir.path().join("bundle"));
    let told = said(command.arg("--figures").arg(dir.path().join("pictures")))?;
    has(&told, &["--figures", "pixels"]);
    assert_eq!(fs::read_dir(dir.path())?.count(), 0, "nothing is written");
    Ok(())
}

/// A tracker that is none over this bundle, and attitudes of another convention, are told with the bundle.
#[test]
fn what_does_not_fit_the_bundle_names_it() -> Done {
    let dir = tempfile::tempdir()?;
    let text = "format = \"boresight-model/1\"\n[tracker]\nfov_deg = [20.0, 10.0]\n";
    let (model, _) = file(dir.path(), "model.toml", text)?;
    let told = said(boresight().arg("close").arg(&model).arg(example()))?;
    let bundle = example().display().to_string();
    has(&told, &[&bundle, "the model's tracker over the bundle's"]);
    let text =
        "format = \"boresight-model/1\"\n[tracker]\npixels = [512, 512]\nfov_deg = [20.0, 20.0]\n";
    let (model, _) = file(dir.path(), "other.toml", text)?;
    let told = said(boresight().arg("close").arg(&model).arg(example()))?;
    has(&told, &[&bundle, "the number of pixels", "512", "1024"]);
    Ok(())
}

/// The example's bundle, but its catalogue, in a folder where other files lie.
fn bundle_beside(dir: &Path, others: &[&str]) -> Result<PathBuf, std::io::Error> {
    let bundle = dir.join("bundle");
    fs::create_dir(&bundle)?;
    for entry in fs::read_dir(example())? {
        let entry = entry?;
        if entry.file_name() != "catalog.csv.gz" {
            fs::copy(entry.path(), bundle.join(entry.file_name()))?;
        }
    }
    for name in others {
        fs::write(bundle.join(name), "")?;
    }
    Ok(bundle)
}

/// What a command that succeeds says on stdout and on stderr.
fn both(command: &mut Command) -> Result<[String; 2], Box<dyn std::error::Error>> {
    let done = command.output()?;
    let said = [done.stdout, done.stderr].map(String::from_utf8);
    let [out, warned] = said;
    let (out, warned) = (out?, warned?);
    assert!(done.status.success(), "{warned}");
    Ok([out, warned])
}

#[test]
fn tables_of_other_names_are_told() -> Done {
    let dir = tempfile::tempdir()?;
    let (model, _) = file(dir.path(), "model.toml", MODEL)?;
    let others = ["Rates.csv", "catalogue.csv", "README", "truth.json"];
    let bundle = bundle_beside(dir.path(), &others)?;
    let read = "Tables    attitude.csv.gz, stars.csv.gz, reference.csv.gz, housekeeping.csv.gz\n";
    for (name, models) in [
        ("assess", None),
        ("fit", None),
        ("compare", Some(&model)),
        ("close", Some(&model)),
    ] {
        let mut command = boresight();
        command.arg(name).args(models).arg(&bundle);
        let [out, warned] = both(&mut command)?;
        has(&out, &[read]);
        let shown = bundle.display();
        let start = format!("warning: {shown}: not read, ");
        has(&warned, &[&start, "tables: Rates.csv, catalogue.csv; "]);
        assert_eq!(warned.trim_end().lines().count(), 1, "{warned}");
    }
    // machines have their result alone on stdout
    let mut fit = boresight();
    let [out, warned] = both(fit.arg("fit").arg(&bundle).arg("--json"))?;
    assert!(out.starts_with('{') && !out.contains("Rates"), "{out}");
    has(&warned, &["Rates.csv"]);
    Ok(())
}

#[test]
fn magnitude_noise_without_magnitudes_is_told() -> Done {
    let dir = tempfile::tempdir()?;
    let noise = "[[effect]]\nid = \"magnitude_noise\"\nslope = 1.0\n";
    let (model, _) = file(dir.path(), "model.toml", &format!("{MODEL}{noise}"))?;
    let bundle = bundle_beside(dir.path(), &[])?;
    for (bundle, warnings) in [(&bundle, 1), (&example(), 0)] {
        for name in ["close", "compare"] {
            let mut command = boresight();
            let [_, warned] = both(command.arg(name).arg(&model).arg(bundle))?;
            let not_applied = "warning: the declared magnitude_noise is not applied: ";
            assert_eq!(warned.matches(not_applied).count(), warnings, "{warned}");
        }
    }
    Ok(())
}

#[test]
fn usage_is_told_in_words() -> Done {
    let help = boresight().arg("--help").output()?.stdout;
    let help = String::from_utf8(help)?;
    assert!(help.starts_with("Star tracker error models"), "{help}");
    let version = boresight().args(["close", "--version"]).output()?.stdout;
    assert!(String::from_utf8(version)?.starts_with("boresight 0"));
    let told = said(boresight().args(["close", "--test", "rolling_shuter"]))?;
    has(&told, &["the nearest is `rolling_shutter`", "outliers"]);
    let mut compare = boresight();
    let told = said(compare.args(["compare", "a.toml", "b", "--draws", "1"]))?;
    has(&told, &["at least 8"]);
    let told = said(boresight().args(["simulate", "--print-preset"]))?;
    has(&told, &["--print-preset needs the name of a preset"]);
    Ok(())
}
