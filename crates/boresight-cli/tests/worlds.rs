//! The worlds under `fixtures/worlds`, as a user renders them.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;

type Done = Result<(), Box<dyn std::error::Error>>;

fn boresight() -> Command {
    Command::new(env!("CARGO_BIN_EXE_boresight"))
}

fn worlds() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/worlds")
}

fn render(world: &Path, bundle: &Path, more: &[&str]) -> Done {
    let mut command = boresight();
    command
        .arg("simulate")
        .arg(world)
        .args(["--fidelity", "pixel", "--tables", "csv", "--out"]);
    let done = command.arg(bundle).args(more).output()?;
    let said = String::from_utf8(done.stderr)?;
    assert!(done.status.success(), "{}: {said}", world.display());
    Ok(())
}

/// The effects of the catalogue that act alone in one world each.
const SINGLE: [&str; 19] = [
    "thermal_misalignment",
    "step_misalignment",
    "periodic_misalignment",
    "time_tag_offset",
    "rolling_shutter",
    "exposure_smear",
    "velocity_aberration",
    "focal_length_drift",
    "chromatic_shift",
    "pixel_phase_harmonics",
    "dark_map",
    "effective_psf",
    "hot_pixel",
    "catalogue_position",
    "optical_distortion",
    "magnitude_noise",
    "rate_noise",
    "reference_error",
    "outliers",
];

/// Every world is rendered; what acts is sealed beside the tables as its file says, and its model is there.
#[test]
fn every_world_is_rendered_and_sealed() -> Done {
    let dir = tempfile::tempdir()?;
    let (mut pairs, mut outside, mut none) = (0, 0, 0);
    for entry in fs::read_dir(worlds())? {
        let path = entry?.path();
        if path.is_dir() {
            continue;
        }
        let name = path
            .file_stem()
            .ok_or("name")?
            .to_string_lossy()
            .into_owned();
        let bundle = dir.path().join(&name);
        render(&path, &bundle, &[])?;
        let truth: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(bundle.join("truth.json"))?)?;
        let model = truth["model"].as_str().ok_or("model")?;
        assert!(worlds().join(model).is_file(), "{name}: {model}");
        let effects: Vec<&str> = truth["effects"]
            .as_array()
            .ok_or("effects")?
            .iter()
            .filter_map(|effect| effect["id"].as_str())
            .collect();
        let foreign = truth["outside"].as_array().ok_or("outside")?.len();
        let title = fs::read_to_string(bundle.join("bundle.toml"))?;
        assert!(!title.contains(&name), "{name}: its bundle tells what acts");
        match name.split_once('_').map(|(kind, _)| kind) {
            Some("null") => {
                none += 1;
                assert!(effects.is_empty() && foreign == 0, "{name}");
            }
            Some("pair") => {
                pairs += 1;
                assert!(effects.len() == 2 && foreign == 0, "{name}");
            }
            Some("outside") => {
                outside += 1;
                assert!(effects.len() < 2 && foreign == 1, "{name}");
                assert!(truth["follows"].as_array().is_some_and(|f| !f.is_empty()));
            }
            _ => assert!(
                SINGLE.contains(&name.as_str()) && effects[0] == name,
                "{name}"
            ),
        }
    }
    assert_eq!((pairs, outside, none), (10, 5, 3));
    assert!(SINGLE.iter().all(|name| dir.path().join(name).is_dir()));
    Ok(())
}

/// One thread and four: the same files to the last bit, in each form of tables.
#[test]
fn threads_change_nothing() -> Done {
    let dir = tempfile::tempdir()?;
    let world = worlds().join("pair_dark_map_psf.toml");
    let (one, four) = (dir.path().join("one"), dir.path().join("four"));
    render(&world, &one, &["--threads", "1"])?;
    render(&world, &four, &["--threads", "4"])?;
    let mut files = 0;
    for entry in fs::read_dir(&one)? {
        let name = entry?.file_name();
        assert!(
            fs::read(one.join(&name))? == fs::read(four.join(&name))?,
            "{}",
            name.display()
        );
        files += 1;
    }
    // bundle.toml, truth.json, stars, attitude, images, catalog
    assert_eq!(files, 6);
    Ok(())
}

/// A scenario without effects is rendered with the tracker of its model; one with effects is refused.
#[test]
fn a_scenario_is_rendered_unless_it_names_effects() -> Done {
    let dir = tempfile::tempdir()?;
    let example = worlds().join("../scenarios/example.toml");
    let out = dir.path().join("bundle");
    let done = boresight()
        .args(["simulate", "--fidelity", "pixel", "--out"])
        .arg(&out)
        .arg(&example)
        .output()?;
    assert_eq!(done.status.code(), Some(2));
    assert!(String::from_utf8(done.stderr)?.contains("rolling_shutter"));
    assert!(!out.exists());
    let text = fs::read_to_string(&example)?;
    let plain = text.replace(
        "[[effect]]\nid = \"rolling_shutter\"\nline_time_s = 30e-6\n",
        "",
    );
    assert_ne!(plain, text);
    let scenario = dir.path().join("plain.toml");
    fs::write(&scenario, plain)?;
    render(&scenario, &out, &[])?;
    let stars = fs::read_to_string(out.join("stars.csv"))?;
    // 840 frames of 12 stars
    assert!(stars.lines().count() > 9000, "{}", stars.lines().count());
    Ok(())
}

/// The example of the page is a world that is rendered.
#[test]
fn the_example_of_the_page_is_rendered() -> Done {
    let page = fs::read_to_string(worlds().join("../../docs/imager.md"))?;
    let example = page
        .split("```toml\n")
        .nth(1)
        .and_then(|rest| rest.split("```").next());
    let dir = tempfile::tempdir()?;
    let world = dir.path().join("example.toml");
    fs::write(&world, example.ok_or("an example")?)?;
    let bundle = dir.path().join("bundle");
    render(&world, &bundle, &[])?;
    let truth: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(bundle.join("truth.json"))?)?;
    assert_eq!(truth["effects"][0]["values"]["line_time_s"], 2.4e-6);
    assert_eq!(truth["effects"][1]["selectors"]["channel"], "plate_c");
    assert_eq!(truth["settings"]["detector"]["prnu"], 0.003);
    assert!(bundle.join("housekeeping.csv").is_file());
    Ok(())
}

/// A misspelt key of a world is answered with its line and the nearest key, and nothing is written.
#[test]
fn a_misspelt_key_is_answered() -> Done {
    let dir = tempfile::tempdir()?;
    let text = fs::read_to_string(worlds().join("rolling_shutter.toml"))?;
    let world = dir.path().join("w.toml");
    fs::write(&world, text.replace("row_time_s", "rowtime_s"))?;
    let out = dir.path().join("bundle");
    let done = boresight()
        .arg("simulate")
        .arg(&world)
        .arg("--out")
        .arg(&out)
        .output()?;
    let said = String::from_utf8(done.stderr)?;
    assert_eq!(done.status.code(), Some(2), "{said}");
    assert!(
        said.contains("w.toml, line") && said.contains("`row_time_s`"),
        "{said}"
    );
    assert!(!out.exists());
    Ok(())
}
